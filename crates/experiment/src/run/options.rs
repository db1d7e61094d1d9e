//! Options of a run that do not change its results.

use std::{
    fmt,
    path::{Path, PathBuf},
    str::FromStr,
};

use rayon::{ThreadPool, ThreadPoolBuilder};
use seafix_component::Fault;

use crate::run::outcome::RunError;

/// The options of a run: its folder, its threads and its part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// The folder of the run; by default the next free one below `runs`.
    pub out: Option<PathBuf>,
    /// The treatment of an existing run.
    pub existing: Existing,
    /// The number of threads.
    pub threads: usize,
    /// The part of the run to compute; [`merge`](super::merge) joins all parts.
    pub shard: Option<Shard>,
    /// Whether durations are logged. Without them two runs of a plan have the same bytes.
    pub timed: bool,
    /// Whether every trial computes all of its stages, so that its durations are its own. Otherwise trials share equal
    /// stages.
    pub separate: bool,
}

impl Options {
    /// A run by one thread into `out`, a new or an empty folder.
    pub fn into(out: impl Into<PathBuf>) -> Self {
        Self {
            out: Some(out.into()),
            existing: Existing::Refuse,
            threads: 1,
            shard: None,
            timed: true,
            separate: false,
        }
    }

    /// The thread pool.
    pub(super) fn pool(&self) -> Result<ThreadPool, RunError> {
        let threads = self.threads.max(1);
        ThreadPoolBuilder::new().num_threads(threads).build().map_err(|error| {
            let fault = Fault::new(format!("no threads ({error})"), Path::new("the machine")).value(threads);
            RunError::Output(fault.remedy("give a smaller number with --threads"))
        })
    }

    /// Whether the piece of this number is to be computed.
    pub(super) fn takes(&self, piece: usize) -> bool {
        self.shard.is_none_or(|shard| piece % shard.of == shard.number - 1)
    }
}

/// The treatment of an existing run in the folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Existing {
    /// It remains, and the new run is rejected.
    Refuse,
    /// It is resumed if it is the same run.
    Resume,
    /// It is removed.
    Overwrite,
    /// It remains if it has the new run's results, and is resumed if it is the same run; otherwise it is removed.
    Keep,
}

/// A part of a run that is divided piece by piece: `2/7` is the second of seven.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    of: usize,
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((number, of)) if 1 <= number && number <= of && of <= 1_000_000 => Ok(Self { number, of }),
            _ => Err(format!("`{text}` is not a shard; write k/n with 1 <= k <= n <= 1000000, for instance 2/7")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_piece_is_in_one_shard() {
        let all: Vec<Options> = (1..=3)
            .map(|k| Options { shard: Some(format!("{k}/3").parse().unwrap()), ..Options::into("out") })
            .collect();
        for piece in 0..10 {
            assert_eq!(all.iter().filter(|options| options.takes(piece)).count(), 1);
        }
        assert!(Options::into("out").takes(4));
    }

    #[test]
    fn only_some_words_are_shards() {
        for wrong in ["0/3", "4/3", "3", "a/b", "1/", "-1/3", "1/2000000"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
        assert_eq!("2/7".parse::<Shard>().unwrap().to_string(), "2/7");
    }
}
