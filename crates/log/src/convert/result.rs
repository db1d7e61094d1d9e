//! What came of the attempts of a frame: results, candidates, evaluations, times.

use super::{
    fields::{Malformed, flat, matrix, matrix_if_any},
    line::{edge_pair_messages, edge_pair_records},
};
use crate::{
    proto,
    record::{
        Alternative, BestPose, Evaluation, FrameRecord, FrameTimes, Integrity, Outcome, Pair, SharedStages,
        TargetRecord, TargetTimes,
    },
};

/// The message that holds target `index` of `frame`, without candidates, evaluation and times.
pub(crate) fn result_message(frame: &FrameRecord, index: usize) -> proto::ReferencingResult {
    let target = &frame.targets[index];
    let alternative = |other: &Alternative| proto::Alternative {
        object_from_camera: flat(&other.object_from_camera),
        pairs: pair_messages(&other.pairs),
        score: other.score,
    };
    proto::ReferencingResult {
        frame: frame.frame,
        stamp_ns: frame.stamp_ns,
        index: index as u32,
        object: target.object.clone(),
        search: target.search.clone(),
        solver: target.solver.clone(),
        outcome: outcome_message(target.outcome).into(),
        reason: target.reason.clone(),
        explanation: target.explanation.clone(),
        object_from_camera: target.object_from_camera.as_ref().map(flat).unwrap_or_default(),
        covariance: target.covariance.as_ref().map(flat).unwrap_or_default(),
        pairs: pair_messages(&target.pairs),
        used: target.used.clone(),
        alternatives: target.alternatives.iter().map(alternative).collect(),
        optimal: target.optimal,
        consensus_bound: target.consensus_bound,
        nfa: target.nfa,
        pair_tests: target.pair_tests,
        residual_rms: target.residual_rms,
        integrity: target.integrity.as_ref().map(integrity_message),
        p_absent: target.p_absent,
        p_wrong: target.p_wrong,
        best: target.best.as_ref().map(|best| proto::BestPose {
            object_from_camera: flat(&best.object_from_camera),
            covariance: best.covariance.as_ref().map(flat).unwrap_or_default(),
            pairs: pair_messages(&best.pairs),
        }),
        edges: edge_pair_messages(&target.edges),
    }
}

fn integrity_message(it: &Integrity) -> proto::Integrity {
    let mut message = proto::Integrity::default();
    it.write(&mut message);
    message
}

fn pair_messages(pairs: &[Pair]) -> Vec<proto::Pair> {
    pairs.iter().map(|&Pair { model, cloud }| proto::Pair { model, cloud }).collect()
}

fn outcome_message(outcome: Outcome) -> proto::Outcome {
    match outcome {
        Outcome::Fix => proto::Outcome::Fix,
        Outcome::Ambiguous => proto::Outcome::Ambiguous,
        Outcome::Rejected => proto::Outcome::Rejected,
        Outcome::Degenerate => proto::Outcome::Degenerate,
    }
}

/// The target that `message` and its `candidates` hold, still without evaluation and times.
pub(crate) fn result_record(
    message: proto::ReferencingResult,
    candidates: proto::Candidates,
) -> Result<TargetRecord, Malformed> {
    let outcome = match message.outcome() {
        proto::Outcome::Fix => Outcome::Fix,
        proto::Outcome::Ambiguous => Outcome::Ambiguous,
        proto::Outcome::Rejected => Outcome::Rejected,
        proto::Outcome::Degenerate => Outcome::Degenerate,
        proto::Outcome::Unspecified => return Err(Malformed(format!("outcome {} is unknown", message.outcome))),
    };
    let alternative = |other: proto::Alternative| {
        Ok(Alternative {
            object_from_camera: matrix("alternative.object_from_camera", &other.object_from_camera)?,
            pairs: pair_records(&other.pairs),
            score: other.score,
        })
    };
    let best = |best: proto::BestPose| {
        Ok(BestPose {
            object_from_camera: matrix("best.object_from_camera", &best.object_from_camera)?,
            covariance: matrix_if_any("best.covariance", &best.covariance)?,
            pairs: pair_records(&best.pairs),
        })
    };
    Ok(TargetRecord {
        object: message.object,
        search: message.search,
        solver: message.solver,
        outcome,
        reason: message.reason,
        explanation: message.explanation,
        object_from_camera: matrix_if_any("object_from_camera", &message.object_from_camera)?,
        covariance: matrix_if_any("covariance", &message.covariance)?,
        candidates: candidates.lists.into_iter().map(|list| list.cloud).collect(),
        pairs: pair_records(&message.pairs),
        edges: edge_pair_records(&message.edges),
        used: message.used,
        alternatives: message.alternatives.into_iter().map(alternative).collect::<Result<_, _>>()?,
        optimal: message.optimal,
        consensus_bound: message.consensus_bound,
        nfa: message.nfa,
        p_absent: message.p_absent,
        p_wrong: message.p_wrong,
        best: message.best.map(best).transpose()?,
        pair_tests: message.pair_tests,
        residual_rms: message.residual_rms,
        integrity: message.integrity.as_ref().map(Integrity::of),
        evaluation: Evaluation::default(),
        times: TargetTimes::default(),
    })
}

fn pair_records(pairs: &[proto::Pair]) -> Vec<Pair> {
    pairs.iter().map(|&proto::Pair { model, cloud }| Pair { model, cloud }).collect()
}

/// The message that holds the candidates of target `index` of `frame`.
pub(crate) fn candidates_message(frame: &FrameRecord, index: usize) -> proto::Candidates {
    let target = &frame.targets[index];
    proto::Candidates {
        frame: frame.frame,
        stamp_ns: frame.stamp_ns,
        index: index as u32,
        object: target.object.clone(),
        lists: target.candidates.iter().map(|list| proto::CandidateList { cloud: list.clone() }).collect(),
    }
}

/// The message that holds the evaluation of target `index` of `frame`.
pub(crate) fn evaluation_message(frame: &FrameRecord, index: usize) -> proto::Evaluation {
    let target = &frame.targets[index];
    let (object, index) = (target.object.clone(), index as u32);
    let mut message =
        proto::Evaluation { frame: frame.frame, stamp_ns: frame.stamp_ns, index, object, ..Default::default() };
    target.evaluation.write(&mut message);
    message
}

/// The message that holds all times of `frame`.
pub(crate) fn timing_message(frame: &FrameRecord) -> proto::Timing {
    let FrameTimes { detect_ms, locate_ms, describe_ms, match_ms, refine_ms, triangulate_ms, odometry_ms, shared } =
        frame.times;
    let target = |target: &TargetRecord| {
        let TargetTimes { candidates_ms, search_ms, solve_ms, total_ms } = target.times;
        proto::TargetTiming { object: target.object.clone(), candidates_ms, search_ms, solve_ms, total_ms }
    };
    proto::Timing {
        frame: frame.frame,
        stamp_ns: frame.stamp_ns,
        detect_ms,
        locate_ms,
        describe_ms,
        match_ms,
        refine_ms,
        triangulate_ms,
        odometry_ms,
        front_end_shared: shared.front_end,
        search_shared: shared.search,
        odometry_shared: shared.odometry,
        targets: frame.targets.iter().map(target).collect(),
    }
}

/// The times that `message` holds: of the frame, and of each target.
pub(crate) fn target_times(message: &proto::Timing) -> (FrameTimes, Vec<TargetTimes>) {
    let proto::Timing { detect_ms, locate_ms, describe_ms, match_ms, refine_ms, triangulate_ms, odometry_ms, .. } =
        *message;
    let target = |timing: &proto::TargetTiming| TargetTimes {
        candidates_ms: timing.candidates_ms,
        search_ms: timing.search_ms,
        solve_ms: timing.solve_ms,
        total_ms: timing.total_ms,
    };
    let shared = SharedStages {
        front_end: message.front_end_shared,
        search: message.search_shared,
        odometry: message.odometry_shared,
    };
    let times =
        FrameTimes { detect_ms, locate_ms, describe_ms, match_ms, refine_ms, triangulate_ms, odometry_ms, shared };
    (times, message.targets.iter().map(target).collect())
}
