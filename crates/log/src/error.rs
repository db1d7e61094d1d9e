//! What can go wrong with a log.

use std::path::PathBuf;

/// Why a log could not be written or read: what, in which file, and what to do about it.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file system refused.
    #[error("cannot {doing} {}: {source}; {remedy}", .path.display())]
    Io {
        /// What was attempted: `create`, `write`, `read`, ….
        doing: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
        /// What to do about it.
        remedy: &'static str,
    },
    /// The MCAP library refused to write.
    #[error("cannot write {}: {message}; the log is not complete, run again", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the library said.
        message: String,
    },
    /// A record that contradicts itself or what came before it.
    #[error("cannot log to {}: {what}", .path.display())]
    Record {
        /// The file.
        path: PathBuf,
        /// What is wrong with the record.
        what: String,
    },
    /// The file is no MCAP file.
    #[error("{} is not an MCAP file: {looks_like}", .path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// What it looks like, and what to do.
        looks_like: String,
    },
    /// The file ends before its footer.
    #[error(
        "{} has no footer: it was cut off or is still being written; {messages} messages up to stamp {last_ns} ns \
         are readable; run the trial again{}",
        .path.display(),
        if *messages > 0 { ", or save them with `seafix recover`" } else { "" }
    )]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Messages in complete chunks.
        messages: u64,
        /// The last readable stamp (ns).
        last_ns: u64,
    },
    /// The bytes are not those that were written.
    #[error("{} is damaged: {what}; copy it again from its source, or save the rest with `seafix recover`", .path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What the reader found, and where.
        what: String,
    },
    /// The bytes are not those whose hash the manifest of the run has.
    #[error("{} is not the file that its run has written: its SHA-256 differs from that in manifest.json; make the run again, or remove the manifest to read the file as it is", .path.display())]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// Nothing of a damaged file can be saved.
    #[error("no message in it is readable: {}: {what}; copy it again from its source, or run the trial again", .path.display())]
    Lost {
        /// The file.
        path: PathBuf,
        /// What the reader found, and where.
        what: String,
    },
    /// The file is sound MCAP but no log of a trial.
    #[error("{} is not a log of a Seafix trial: {what}", .path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What is missing or of another kind.
        what: String,
    },
    /// The log declares more than this program will hold in memory.
    #[error("{} exceeds a limit: {what}", .path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Which limit, and the value.
        what: String,
    },
}
