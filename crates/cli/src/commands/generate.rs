//! `seafix generate`.

use std::{fs, path::PathBuf};

use clap::Args;
use seafix_component::create_real_folder;
use seafix_simulation::families::{Family, Generated, Presence};

use crate::{
    atomic_file,
    exit::{DONE, Ended, Failure, OUTPUT, USAGE},
    terminal::print,
};

#[derive(Debug, Args)]
pub(crate) struct Generate {
    /// The family: paper-scale, site-scale, no-prior, putative, lattice, few-visible or dense-clutter.
    family: Family,
    /// The seed of the random numbers; equal seeds give equal problems.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of problems.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    count: u64,
    /// Number of the first problem in its family; the family's parameters cycle with the number.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=1_000_000_000))]
    first: u64,
    /// Omit the object: the cloud is clutter only.
    #[arg(long)]
    absent: bool,
    /// Omit the object and put a box of other dimensions in its place (families of boxes).
    #[arg(long, conflicts_with = "absent")]
    replaced: bool,
    /// The folder of the problems, new or empty.
    #[arg(long)]
    out: PathBuf,
}

impl Generate {
    pub(crate) fn execute(&self) -> Ended {
        let failed = |error: &dyn std::fmt::Display| {
            Failure::new(OUTPUT, format!("cannot write into {}: {error}", self.out.display()))
        };
        if self.replaced && matches!(self.family, Family::D | Family::E) {
            return Err(Failure::new(
                USAGE,
                format!("--replaced: family {} has no box to replace; use --absent", self.family.name()),
            ));
        }
        create_real_folder(&self.out).map_err(|error| failed(&error))?;
        if fs::read_dir(&self.out).map_err(|error| failed(&error))?.next().is_some() {
            return Err(failed(&"the folder is not empty; name another folder with --out"));
        }
        let presence = match (self.absent, self.replaced) {
            (true, _) => Presence::Absent,
            (_, true) => Presence::Replaced,
            _ => Presence::Present,
        };
        for number in self.first..self.first + self.count {
            let generated = Generated::new(self.family, self.seed, number, presence);
            let file = |end: &str| self.out.join(format!("{}{end}", generated.problem.id));
            atomic_file::write(&file(".json"), text(serde_json::to_string(&generated.problem)))?;
            atomic_file::write(&file(".truth.json"), text(serde_json::to_string(&generated.truth)))?;
        }
        let problems = if self.count == 1 { "problem" } else { "problems" };
        print(&format!("{} {problems} and their truth in {}\n", self.count, self.out.display()))?;
        Ok(DONE)
    }
}

fn text(content: serde_json::Result<String>) -> String {
    content.expect("a problem is plain data")
}
