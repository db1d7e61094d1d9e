//! What the frames of a trial add up to.

use crate::{
    proto,
    record::{Region, Totals},
};

/// The message that holds `totals`.
pub(crate) fn totals_message(totals: &Totals) -> proto::Totals {
    let reason = |(reason, &count): (&String, &u64)| proto::Reason { reason: reason.clone(), count };
    proto::Totals {
        every: totals.every,
        failures_left_out: totals.failures_left_out,
        frames: totals.frames,
        fix_frames: totals.fix_frames,
        wrong_frames: totals.wrong_frames,
        attempted: totals.attempted,
        found: totals.found,
        wrong: totals.wrong,
        unjudged: totals.unjudged,
        reasons: totals.reasons.iter().map(reason).collect(),
        judged: totals.judged,
        tre_squares: totals.tre_squares,
        position_squares: totals.position_squares,
        bounded: totals.bounded,
        tre_crlb_squares: totals.tre_crlb_squares,
        position_crlb_squares: totals.position_crlb_squares,
        nees_sum: totals.nees_sum,
        nees_count: totals.nees_count,
        nees_within: totals.nees_within,
        regions: totals.regions.map(regions_message),
    }
}

/// The totals that `message` holds.
pub(crate) fn totals_record(message: proto::Totals) -> Totals {
    Totals {
        every: message.every,
        failures_left_out: message.failures_left_out,
        frames: message.frames,
        fix_frames: message.fix_frames,
        wrong_frames: message.wrong_frames,
        attempted: message.attempted,
        found: message.found,
        wrong: message.wrong,
        unjudged: message.unjudged,
        reasons: message.reasons.into_iter().map(|reason| (reason.reason, reason.count)).collect(),
        judged: message.judged,
        tre_squares: message.tre_squares,
        position_squares: message.position_squares,
        bounded: message.bounded,
        tre_crlb_squares: message.tre_crlb_squares,
        position_crlb_squares: message.position_crlb_squares,
        nees_sum: message.nees_sum,
        nees_count: message.nees_count,
        nees_within: message.nees_within,
        regions: message.regions.map(|of| {
            [of.available, of.misleading, of.hazardous, of.unavailable, of.unavailable_misleading, of.unprotected]
        }),
    }
}

fn regions_message(of: [u64; Region::ALL.len()]) -> proto::Regions {
    let [available, misleading, hazardous, unavailable, unavailable_misleading, unprotected] = of;
    proto::Regions { available, misleading, hazardous, unavailable, unavailable_misleading, unprotected }
}
