//! The result of a recovery.

/// The recovered part of a log, and the lost one.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Recovered {
    /// The number of written messages.
    pub messages: u64,
    /// The number of frames of a trial among them; 0 for the log of another program.
    pub frames: u64,
    /// The number of readable messages of incomplete frames.
    pub dropped: u64,
    /// The stamp of the last written message (ns).
    pub last_ns: u64,
    /// The places of unreadable parts, with causes.
    pub lost: Vec<String>,
}
