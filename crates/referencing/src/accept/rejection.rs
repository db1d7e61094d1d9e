//! The reasons for which an answer is rejected.

use std::borrow::Cow;

use super::{integrity::consistency::Consistency, max_p_wrong::MaxPWrong};
use crate::{
    search::identification::{MORE_POINTS, Rejected},
    solve::likelihood::scale_error::ScaleError,
};

/// The reason for which a set or its pose is rejected.
///
/// Its `Display` is one line: the failed test and its numbers. [`remedy`](Self::remedy) says what helps.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RejectionReason {
    /// The search returned no set.
    #[error(transparent)]
    Search(#[from] Rejected),
    /// The set has fewer features than required.
    #[error("too few identified points{}: {found} found, {needed} required", if *.edges > 0 { " and edges" } else { "" })]
    TooFew {
        /// The number of identified points and edges.
        found: usize,
        /// The number of edges among them.
        edges: usize,
        /// The required number: the larger of [`Acceptance::min_points`](crate::Acceptance::min_points) and the
        /// solver's minimum.
        needed: usize,
    },
    /// The probability that the pose is not the object's is too large.
    #[error("{}", absent(.p_wrong, .max, [*.identified, *.model], .edges))]
    Absent {
        /// The probability of absence, or that of absence and other poses together.
        ///
        /// A NaN, if the noise of a point is not a number.
        p_wrong: f64,
        /// The largest accepted probability, [`Acceptance::max_p_wrong`](crate::Acceptance::max_p_wrong).
        max: MaxPWrong,
        /// The number of identified points.
        identified: usize,
        /// The number of model points.
        model: usize,
        /// The number of identified edges, and of model edges.
        edges: [usize; 2],
    },
    /// The residuals are larger than the noise of the points explains (χ² test).
    #[error("residuals too large: χ² = {chi2:.1}, the limit is {limit:.1}")]
    Residuals {
        /// The χ² of the residuals, Σ rᵀ S⁻¹ r, at the maximum-likelihood pose.
        chi2: f64,
        /// The quantile of χ² with 3k + 4m − 6 degrees of freedom, for k points and m edges, at
        /// [`Acceptance::confidence`](crate::Acceptance::confidence).
        limit: f64,
    },
    /// Twice the predicted error of the model points exceeds the alert limit.
    #[error(
        "pose too imprecise: the model points have a predicted error of {rms:.3} m (RMS, one sigma), twice that \
         exceeds the alert limit of {limit:.3} m"
    )]
    Imprecise {
        /// The predicted error of the model points (m, RMS over the points, one sigma).
        rms: f64,
        /// The alert limit (m).
        limit: f64,
    },
    /// One wrong match, or two, could move the pose beyond the alert limit.
    #[error("{}", influential_message(.points, .rms, .limit))]
    InfluentialPairs {
        /// The identifiers of the model points, one or two.
        points: Vec<String>,
        /// The error of the model points for these wrong matches (m, RMS, one sigma).
        ///
        /// Infinite if the other points determine no pose.
        rms: f64,
        /// The alert limit (m).
        limit: f64,
    },
    /// The attitude is too imprecise by its own covariance.
    ///
    /// Points near a line leave the rotation about it undetermined: it moves no point, but it moves the vehicle.
    #[error(
        "attitude too imprecise: its worst axis has an error of {:.1}° (one sigma), twice that exceeds the limit of \
         {:.1}°",
        .sigma.to_degrees(), .limit.to_degrees()
    )]
    Attitude {
        /// The largest standard deviation over all axes (rad).
        sigma: f64,
        /// The limit, [`Acceptance::attitude_limit`](crate::Acceptance::attitude_limit) (rad).
        limit: f64,
    },
    /// The pose places the camera behind identified points.
    #[error(
        "camera behind identified points: model point `{point}` would be seen {:.1}° from its normal, the largest \
         possible angle is {:.1}°",
        .angle.to_degrees(), .max.to_degrees()
    )]
    Behind {
        /// The point with the largest angle.
        point: String,
        /// The angle between the point's normal and the line of sight (rad).
        angle: f64,
        /// The largest angle at which a point is visible (rad).
        max: f64,
    },
    /// The scale error between measurement and model may displace the object beyond the alert limit.
    #[error(
        "scale error: measured distances are {:.1} % {} than the model's (one sigma {:.1} %), which may displace the \
         object by {off:.2} m, the alert limit is {limit:.2} m",
        100.0 * .scale_error.value.abs(), if .scale_error.value > 0.0 { "longer" } else { "shorter" },
        100.0 * .scale_error.sigma
    )]
    ScaleError {
        /// The estimated scale error.
        scale_error: ScaleError,
        /// The displacement of the object (m) at the scale error plus two standard deviations.
        off: f64,
        /// The alert limit (m).
        limit: f64,
    },
    /// The depth error between measurement and model may displace the object beyond the alert limit.
    #[error(
        "depth error: distances along the optical axis are {:.1} % {} than the model's (one sigma {:.1} %), which may \
         displace the object by {off:.2} m, the alert limit is {limit:.2} m",
        100.0 * .depth_error.value.abs(), if .depth_error.value > 0.0 { "longer" } else { "shorter" },
        100.0 * .depth_error.sigma
    )]
    DepthError {
        /// The estimated depth error.
        depth_error: ScaleError,
        /// The displacement of the object along the optical axis (m) at the depth error plus two standard deviations.
        off: f64,
        /// The alert limit (m).
        limit: f64,
    },
    /// A part of the object is displaced against the rest, which may displace the pose beyond the alert limit.
    #[error(
        "inconsistent parts: {} of {points} identified points are displaced by {:.3} m against the others (one sigma \
         {:.3} m), {:.1e} times as probable as an object as modelled, the limit is {limit:.1e}; the model points have \
         an error of {rms:.3} m (RMS, one sigma), twice that exceeds the alert limit of {alert_limit:.3} m",
        .consistency.moved, .consistency.shift, .consistency.sigma, .consistency.bayes_factor
    )]
    Inconsistent {
        /// The evidence for the displaced part.
        consistency: Consistency,
        /// The number of identified points.
        points: usize,
        /// The largest accepted Bayes factor, 1 / (1 − [`Acceptance::confidence`](crate::Acceptance::confidence)).
        limit: f64,
        /// The predicted error of the model points, if any part may be displaced (m, RMS, one sigma).
        rms: f64,
        /// The alert limit (m).
        alert_limit: f64,
    },
    /// The pose contradicts the prior.
    #[error("pose contradicts the prior: its distance is {off:.3} times the largest allowed")]
    Prior {
        /// The distance from the prior divided by the largest allowed distance.
        off: f64,
    },
}

impl RejectionReason {
    /// The short name of the reason in logs and tables, in kebab-case.
    pub fn reason(&self) -> &'static str {
        match self {
            Self::Search(why) => why.reason(),
            Self::TooFew { .. } => "too-few",
            Self::Absent { .. } => "absent",
            Self::Residuals { .. }
            | Self::Behind { .. }
            | Self::ScaleError { .. }
            | Self::DepthError { .. }
            | Self::Prior { .. } => "gate",
            Self::Inconsistent { .. } => "inconsistent",
            Self::Imprecise { .. } | Self::InfluentialPairs { .. } | Self::Attitude { .. } => "imprecise",
        }
    }

    /// The remedy in one phrase, with the settings that help and, where one follows from the numbers, its value.
    pub fn remedy(&self) -> Cow<'static, str> {
        Cow::Borrowed(match self {
            Self::Search(why) => why.remedy(),
            Self::TooFew { .. } => MORE_POINTS,
            Self::Absent { p_wrong, .. } if p_wrong.is_nan() => "check the point covariances",
            Self::Absent { p_wrong, .. } => return improbable(*p_wrong),
            Self::Residuals { .. } => "check calibration, object model and point covariances",
            Self::Imprecise { .. } => {
                "identify more points (`detector.features`), move closer, or set `acceptance.alert-limit` to the error that \
                 the use tolerates"
            }
            Self::InfluentialPairs { .. } => "identify more points (`detector.features`)",
            Self::Attitude { .. } => "identify points farther from a common line",
            Self::Behind { .. } => "check the normals of the object model",
            Self::ScaleError { .. } => "check baseline, focal length and survey",
            Self::DepthError { .. } => {
                "check the focal length: was the rig calibrated in the same medium, air or water?"
            }
            Self::Inconsistent { .. } => "survey the object again, or model the displaced part as an object of its own",
            Self::Prior { .. } => "check the prior's pose and covariance",
        })
    }
}

/// The remedy for [`RejectionReason::Absent`].
///
/// A larger limit is advised up to the preset for studies: no use of fixes tolerates more.
fn improbable(p_wrong: f64) -> Cow<'static, str> {
    match larger_limit(p_wrong) {
        Some(limit) => Cow::Owned(format!(
            "try more features (`detector.features`), edges in the site, a prior (a narrower one, or a wider one if it may be wrong), or `acceptance.max-p-wrong={limit}`"
        )),
        None => Cow::Borrowed(
            "try more features (`detector.features`), edges in the site, or a prior (a narrower one, or a wider one if it may be wrong)",
        ),
    }
}

/// The smallest of 1, 2 and 5 times a power of ten that is at least twice `p_wrong`.
///
/// A limit at the probability itself would accept no attempt but this one. The result is `None` above
/// [`MaxPWrong::Permissive`].
fn larger_limit(p_wrong: f64) -> Option<String> {
    let limits = (0..=9).rev().flat_map(|decade| [1, 2, 5].map(|step| format!("{step}e-{decade}")));
    let value = |limit: &String| limit.parse::<f64>().unwrap_or(f64::INFINITY);
    let mut larger = limits.filter(|limit| value(limit) >= 2.0 * p_wrong);
    larger.next().filter(|limit| value(limit) <= MaxPWrong::Permissive.value())
}

/// The message of [`RejectionReason::Absent`].
fn absent(p_wrong: &f64, max: &MaxPWrong, [identified, model]: [usize; 2], edges: &[usize; 2]) -> String {
    if p_wrong.is_nan() {
        return format!("P(wrong) of {identified} points is undefined: the noise of a point is not a number");
    }
    let and_edges = match edges {
        [_, 0] => String::new(),
        [identified, model] => format!(" and {identified} of {model} edges"),
    };
    let p = if *p_wrong < 0.1 { format!("{p_wrong:.1e}") } else { format!("{p_wrong:.2}") };
    let preset = max.preset().map_or_else(String::new, |preset| format!(" (preset {preset})"));
    format!(
        "P(wrong) is {p}, at most {:.1e} is allowed{preset}; {identified} of {model} points{and_edges} identified",
        max.value()
    )
}

/// The message of [`RejectionReason::InfluentialPairs`].
fn influential_message(points: &[String], rms: &f64, limit: &f64) -> String {
    let named = points.join("` and `");
    let (number, noun, wrong) = match points.len() {
        1 => ("one point", "point", "is a wrong match"),
        _ => ("two points", "points", "are wrong matches"),
    };
    if !rms.is_finite() {
        return format!("pose depends on {number}: without model {noun} `{named}` the others determine no pose");
    }
    format!(
        "pose depends on {number}: if model {noun} `{named}` {wrong}, the model points have an error of {rms:.3} m \
         (RMS, one sigma); the alert limit is {limit:.3} m"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn absent(p_wrong: f64) -> RejectionReason {
        RejectionReason::Absent { p_wrong, max: MaxPWrong::Balanced, identified: 4, model: 8, edges: [0, 0] }
    }

    /// Fails if the sentence lacks its number, its limit, or a setting that would have helped.
    #[test]
    fn a_rejection_states_its_number_and_the_settings_that_help() {
        let rejection = absent(1.8e-3);
        assert_eq!(
            rejection.to_string(),
            "P(wrong) is 1.8e-3, at most 1.0e-3 is allowed (preset balanced); 4 of 8 points identified"
        );
        let remedy = "try more features (`detector.features`), edges in the site, a prior (a narrower one, or a wider one if it may be wrong), or `acceptance.max-p-wrong=5e-3`";
        assert_eq!(rejection.remedy(), remedy);
        assert!(!absent(0.4).remedy().contains("max-p-wrong"), "no use tolerates such a limit");
    }

    #[test]
    fn an_advised_limit_leaves_room_and_is_a_round_number() {
        for (p_wrong, limit) in [(1.1e-3, Some("5e-3")), (9e-4, Some("2e-3")), (9.9e-3, Some("2e-2")), (1.1e-2, None)] {
            assert_eq!(larger_limit(p_wrong).as_deref(), limit, "{p_wrong}");
        }
        assert_eq!(larger_limit(f64::NAN), None);
    }
}
