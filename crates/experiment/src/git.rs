//! The state of the source code that the program was built from.

use std::{process::Command, sync::OnceLock};

use serde::{Deserialize, Serialize};

/// The state of the source code, if the program was built in a checkout.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Git {
    pub(crate) commit: Option<String>,
    pub(crate) dirty: Option<bool>,
}

impl Git {
    /// The last commit that changed this program, and whether there are uncommitted changes. Both come from the
    /// checkout of the build and are empty without it. Commits of other files, such as reports, do not affect runs.
    pub(crate) fn here() -> Self {
        static HERE: OnceLock<Git> = OnceLock::new();
        HERE.get_or_init(Self::find).clone()
    }

    fn find() -> Self {
        let workspace = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        let inside = std::env::current_exe().ok().zip(std::fs::canonicalize(workspace).ok());
        if !inside.is_some_and(|(program, workspace)| program.starts_with(workspace)) {
            return Self { commit: None, dirty: None };
        }
        let git = |arguments: &[&str]| {
            let output = Command::new("git").arg("-C").arg(env!("CARGO_MANIFEST_DIR")).args(arguments).output().ok()?;
            output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
        };
        Self {
            commit: git(&["log", "-1", "--format=%H", "--", ":/crates", ":/Cargo.toml", ":/Cargo.lock"]),
            dirty: git(&["status", "--porcelain", "--", ":/crates", ":/Cargo.toml", ":/Cargo.lock"])
                .map(|changes| !changes.is_empty()),
        }
    }

    /// Whether both are known and differ. An unknown state, for example without `git`, is no difference, so that a run
    /// can be resumed.
    pub(crate) fn contradicts(&self, other: &Self) -> bool {
        fn differ<T: PartialEq>(a: Option<&T>, b: Option<&T>) -> bool {
            a.zip(b).is_some_and(|(a, b)| a != b)
        }
        differ(self.commit.as_ref(), other.commit.as_ref()) || differ(self.dirty.as_ref(), other.dirty.as_ref())
    }
}
