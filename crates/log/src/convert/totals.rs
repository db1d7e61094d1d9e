//! What the frames of a trial add up to.

use crate::{Region, Totals, proto};

/// The message that holds `totals`.
pub(crate) fn totals_message(totals: &Totals) -> proto::Totals {
    let reason = |(reason, &count): (&String, &u64)| proto::Reason { reason: reason.clone(), count };
    proto::Totals {
        every: totals.every,
        failures_left_out: totals.failures_left_out,
        frames: totals.frames,
        referenced_frames: totals.referenced_frames,
        wrong_frames: totals.wrong_frames,
        attempted: totals.attempted,
        found: totals.found,
        wrong: totals.wrong,
        unjudged: totals.unjudged,
        reasons: totals.reasons.iter().map(reason).collect(),
        judged: totals.judged,
        m2_squares: totals.m2_squares,
        m3_squares: totals.m3_squares,
        bounded: totals.bounded,
        m2_bound_squares: totals.m2_bound_squares,
        m3_bound_squares: totals.m3_bound_squares,
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
        referenced_frames: message.referenced_frames,
        wrong_frames: message.wrong_frames,
        attempted: message.attempted,
        found: message.found,
        wrong: message.wrong,
        unjudged: message.unjudged,
        reasons: message.reasons.into_iter().map(|reason| (reason.reason, reason.count)).collect(),
        judged: message.judged,
        m2_squares: message.m2_squares,
        m3_squares: message.m3_squares,
        bounded: message.bounded,
        m2_bound_squares: message.m2_bound_squares,
        m3_bound_squares: message.m3_bound_squares,
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
