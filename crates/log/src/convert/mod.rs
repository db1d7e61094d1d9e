//! Exact conversion between plain records and the messages of `seafix.v2`.

mod bare;
mod fields;
mod frame;
mod header;
mod inputs;
mod inspection;
mod line;
mod navigation;
mod result;
mod totals;

pub(crate) use bare::{BareFrame, bare_frame_record};
pub(crate) use frame::{frame_message, frame_record};
pub(crate) use header::{header_message, header_record};
pub(crate) use inputs::{inputs_message, inputs_record};
pub(crate) use inspection::{inspection_message, inspection_record};
pub(crate) use result::{
    candidates_message, evaluation_message, result_message, result_record, target_times, timing_message,
};
pub(crate) use totals::{totals_message, totals_record};
