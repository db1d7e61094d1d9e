//! The sections of a report, one a file.

pub(crate) mod ablation;
pub(crate) mod breakdown;
pub(crate) mod claims;
pub(crate) mod data;
pub(crate) mod failures;
pub(crate) mod hypotheses;
pub(crate) mod inspection;
pub(crate) mod integrity;
pub(crate) mod limits;
pub(crate) mod method;
pub(crate) mod missing;
pub(crate) mod navigation;
pub(crate) mod objects;
pub(crate) mod protocol;
pub(crate) mod reach;
pub(crate) mod reproduce;
pub(crate) mod results;
pub(crate) mod significance;
pub(crate) mod threats;
pub(crate) mod time;
