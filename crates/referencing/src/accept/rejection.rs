//! The reasons for which an answer is rejected.

use crate::{Rejected, ScaleError};

/// The reason for which a set or its pose is rejected.
///
/// Its `Display` is one line: the failed test, its numbers, and a remedy.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RejectionReason {
    /// The search returned no set.
    #[error(transparent)]
    Search(#[from] Rejected),
    /// The set has fewer points than required.
    #[error(
        "too few identified points: {found} found, {needed} required; bring more of the object into view or widen the \
         prior"
    )]
    TooFew {
        /// The number of identified points.
        found: usize,
        /// The required number: the larger of [`Acceptance::min_points`](crate::Acceptance::min_points) and the
        /// solver's minimum.
        needed: usize,
    },
    /// The number of false alarms of the set is too large (a-contrario test).
    #[error("{}", a_contrario(.size, .expected, .budget))]
    AContrario {
        /// The number of points of the set.
        size: usize,
        /// The number of false alarms (NFA): the expected number of random sets of this size.
        expected: f64,
        /// The largest accepted NFA, [`Acceptance::max_nfa`](crate::Acceptance::max_nfa).
        budget: f64,
    },
    /// The posterior probability that the object is absent is too large.
    #[error(
        "object possibly absent: its absence has a probability of {probability:.2e}, the limit is {limit:.1e}; narrow \
         the prior or bring more of the object into view"
    )]
    Absent {
        /// The posterior probability of absence.
        probability: f64,
        /// The limit that applies to this model and cloud; it derives from
        /// [`Acceptance::absence`](crate::Acceptance::absence).
        limit: f64,
    },
    /// The residuals are larger than the noise of the points explains (χ² test).
    #[error(
        "residuals too large: χ² = {chi2:.1}, the limit is {limit:.1}; check calibration, object model and point \
         covariances"
    )]
    Residuals {
        /// The χ² of the residuals, Σ rᵀ S⁻¹ r, at the maximum-likelihood pose.
        chi2: f64,
        /// The quantile of χ² with 3k − 6 degrees of freedom at
        /// [`Acceptance::confidence`](crate::Acceptance::confidence).
        limit: f64,
    },
    /// Twice the predicted error of the model points exceeds the alert limit.
    #[error(
        "pose too imprecise: the model points have a predicted error of {rms:.3} m (RMS, one sigma), twice that \
         exceeds the alert limit of {limit:.3} m; identify more points or move closer"
    )]
    Imprecise {
        /// The predicted error of the model points (m, RMS over the points, one sigma).
        rms: f64,
        /// The alert limit (m).
        limit: f64,
    },
    /// One wrong match could move the pose beyond the alert limit.
    #[error("{}", hinge(.point, .rms, .limit))]
    Hinge {
        /// The identifier of the model point.
        point: String,
        /// The error of the model points for this wrong match (m, RMS, one sigma).
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
         {:.1}°; identify points farther from a common line",
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
         possible angle is {:.1}°; check the normals of the object model",
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
         object by {off:.2} m, the alert limit is {limit:.2} m; check baseline, focal length and survey",
        100.0 * .scale_error.value.abs(), if .scale_error.value > 0.0 { "longer" } else { "shorter" },
        100.0 * .scale_error.sigma
    )]
    Stretched {
        /// The estimated scale error.
        scale_error: ScaleError,
        /// The displacement of the object (m) at the scale error plus two standard deviations.
        off: f64,
        /// The alert limit (m).
        limit: f64,
    },
    /// The pose contradicts the prior.
    #[error(
        "pose contradicts the prior: its distance is {off:.3} times the largest allowed; check the prior's pose and \
         covariance"
    )]
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
            Self::AContrario { .. } | Self::Absent { .. } => "absent",
            Self::Residuals { .. } | Self::Behind { .. } | Self::Stretched { .. } | Self::Prior { .. } => "gate",
            Self::Imprecise { .. } | Self::Hinge { .. } | Self::Attitude { .. } => "imprecise",
        }
    }
}

/// The message of [`RejectionReason::AContrario`].
fn a_contrario(size: &usize, expected: &f64, budget: &f64) -> String {
    if expected.is_nan() {
        return format!(
            "cannot compute the number of false alarms (NFA) of {size} points: the noise of a point is not a number; \
             check the point covariances"
        );
    }
    format!(
        "possible false alarm: the expected number of random sets of {size} points (NFA) is {expected:.2e}, the limit \
         is {budget:.1e}; narrow the prior or identify more points"
    )
}

/// The message of [`RejectionReason::Hinge`].
fn hinge(point: &str, rms: &f64, limit: &f64) -> String {
    if !rms.is_finite() {
        return format!(
            "pose depends on one point: without model point `{point}` the others determine no pose; identify more \
             points"
        );
    }
    format!(
        "pose depends on one point: if model point `{point}` is a wrong match, the model points have an error of \
         {rms:.3} m (RMS, one sigma), twice that exceeds the alert limit of {limit:.3} m; identify more points"
    )
}
