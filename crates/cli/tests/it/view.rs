//! `seafix view`: the commands for Rerun.

use std::{fs, os::unix::fs::PermissionsExt as _, path::Path};

use tempfile::TempDir;

use crate::{ended_with, program};

/// A log, and a `rerun` that notes its arguments and writes the files that it is asked for.
fn prepared(script: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    let experiment = "question = 'Where?'\n[source]\nname = 'virtual-points'\nframes = 1\n";
    fs::write(at("e.toml"), experiment).unwrap();
    ended_with(0, program().arg("run").arg(at("e.toml")).arg("--out").arg(at("out")));
    fs::write(at("rerun"), format!("#!/bin/sh\n{script}\n")).unwrap();
    fs::set_permissions(at("rerun"), fs::Permissions::from_mode(0o755)).unwrap();
    folder
}

fn log(folder: &Path) -> std::path::PathBuf {
    let entries = fs::read_dir(folder.join("out")).unwrap().map(|entry| entry.unwrap().path());
    entries.into_iter().find(|path| path.extension().is_some_and(|end| end == "mcap")).unwrap()
}

/// The log becomes a recording of the blueprint's application, joined with the blueprint: Rerun applies a blueprint to
/// its own application only. Nothing is left behind.
#[test]
fn the_blueprint_is_applied_to_the_log() {
    let folder = prepared(
        "echo \"$*\" >> \"$NOTES\"\nwhile [ $# -gt 0 ]; do case $1 in -o) touch \"$2\";; *.rbl) test -s \"$1\" || exit 9;; \
         esac; shift; done",
    );
    let (log, notes) = (log(folder.path()), folder.path().join("notes"));
    let scratch = folder.path().join("scratch");
    fs::create_dir(&scratch).unwrap();
    let mut view = program();
    view.arg("view").arg(&log).env("PATH", format!("{}:/usr/bin:/bin", folder.path().display()));
    ended_with(0, view.env("NOTES", &notes).env("TMPDIR", &scratch));
    let said = fs::read_to_string(&notes).unwrap();
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines.len(), 3, "{said}");
    assert!(lines[0].starts_with("mcap convert ") && lines[0].contains("--application-id seafix -o "), "{said}");
    assert!(lines[1].starts_with("rrd merge ") && lines[1].contains("seafix.rbl -o "), "{said}");
    assert_eq!(lines[1].split(' ').next_back(), Some(lines[2]));
    assert_eq!(fs::read_dir(&scratch).unwrap().count(), 0);
}

/// A Rerun that cannot convert logs, or none, is named with the remedy.
#[test]
fn a_rerun_that_fails_is_reported() {
    let folder = prepared("echo 'unrecognized subcommand' >&2; exit 2");
    let log = log(folder.path());
    let mut view = program();
    view.arg("view").arg(&log).env("PATH", format!("{}:/usr/bin:/bin", folder.path().display()));
    let said = ended_with(4, &mut view).error;
    assert!(
        said.lines().count() == 1 && said.contains("unrecognized subcommand") && said.contains("install -U"),
        "{said}"
    );
    let said = ended_with(4, program().arg("view").arg(&log).env("PATH", "/nowhere")).error;
    assert!(said.lines().count() == 1 && said.contains("pip install rerun-sdk"), "{said}");
    let said = ended_with(3, program().arg("view").arg(folder.path().join("out"))).error;
    assert!(said.contains("a folder, not the log of a trial"), "{said}");
}
