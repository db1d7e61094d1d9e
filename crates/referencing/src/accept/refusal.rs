//! Why an answer is not believed.

use crate::{Rejected, ScaleError};

/// Why an answer is not believed, or why there is none.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RejectionReason {
    /// The search found nothing.
    #[error(transparent)]
    Search(#[from] Rejected),
    /// The set is smaller than asked for.
    #[error("{found} points were identified; {needed} are needed")]
    TooFew {
        /// Its size.
        found: usize,
        /// [`Acceptance::min_points`](crate::Acceptance::min_points), or what the solver needs.
        needed: usize,
    },
    /// Chance alone would give sets as large.
    #[error("{}", a_contrario(.size, .expected, .budget))]
    AContrario {
        /// Size of the set.
        size: usize,
        /// Expected number of chance sets of this size.
        expected: f64,
        /// [`Acceptance::max_nfa`](crate::Acceptance::max_nfa).
        budget: f64,
    },
    /// The cloud may well be clutter alone.
    #[error("without the object the cloud has a probability of {probability:.2e}; at most {limit:.1e} is accepted")]
    Absent {
        /// Posterior probability that the object is not there.
        probability: f64,
        /// [`Acceptance::absence`](crate::Acceptance::absence).
        limit: f64,
    },
    /// No rigid motion explains the set within its noise.
    #[error("the residuals have χ² = {chi2:.1}; at most {limit:.1} is likely of a true set")]
    Residuals {
        /// Σ rᵀ S⁻¹ r of the most likely rigid motion.
        chi2: f64,
        /// The quantile of χ² with 3k − 6 degrees of freedom.
        limit: f64,
    },
    /// By its own covariance the pose may be further off than the alert limit.
    #[error(
        "the model points are known to {rms:.3} m (RMS, one sigma); twice that exceeds the alert limit of {limit:.3} m"
    )]
    Imprecise {
        /// Root mean square over the model points of the predicted error (m).
        rms: f64,
        /// The alert limit (m).
        limit: f64,
    },
    /// If one point is a wrong match, the pose may be further off than the alert limit.
    #[error("{}", hinge(.point, .rms, .limit))]
    Hinge {
        /// The model point.
        point: String,
        /// By how much the pose is off if that point is a wrong match: root mean square over the model points (m, one sigma);
        /// infinite where the other points determine no pose.
        rms: f64,
        /// The alert limit (m).
        limit: f64,
    },
    /// By its own covariance the attitude is hardly determined: points near a line leave a turn about it free, which moves
    /// no point and yet the vehicle.
    #[error("the attitude is known to {:.1}° (one sigma, its worst axis); twice that exceeds {:.1}°", .sigma.to_degrees(), .limit.to_degrees())]
    Attitude {
        /// Greatest standard deviation over all axes (rad).
        sigma: f64,
        /// [`Acceptance::attitude_limit`](crate::Acceptance::attitude_limit) (rad).
        limit: f64,
    },
    /// The camera of the pose would have to see points from behind.
    #[error(
        "the pose has the camera behind points that it identified: model point `{point}` would be seen {:.1}° from its normal; \
         at most {:.1}° is possible", .angle.to_degrees(), .max.to_degrees()
    )]
    Behind {
        /// The point that turns its back the most.
        point: String,
        /// The angle between its normal and the line of sight (rad).
        angle: f64,
        /// The greatest at which a point shows itself (rad).
        max: f64,
    },
    /// All that is measured is longer or shorter than the model says, by more than the pose may be off for it.
    #[error(
        "measured distances are {:.1} % {} than the model's (one sigma {:.1} %): if the rig is at fault, the object may be {off:.2} m \
         from where it seems to be, and {limit:.2} m are allowed; look at baseline, focal length and survey",
        100.0 * .scale_error.value.abs(), if .scale_error.value > 0.0 { "longer" } else { "shorter" }, 100.0 * .scale_error.sigma
    )]
    Stretched {
        /// By how much.
        scale_error: ScaleError,
        /// What that, and two standard deviations more, makes of the object's distance (m).
        off: f64,
        /// The alert limit (m).
        limit: f64,
    },
    /// The pose contradicts the prior.
    #[error("the pose is {off:.3} times as far from the prior as the prior allows")]
    Prior {
        /// Distance from the prior over the largest allowed.
        off: f64,
    },
}

impl RejectionReason {
    /// The reason as logs and tables have it, in kebab-case.
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

/// The sentence of [`RejectionReason::AContrario`].
fn a_contrario(size: &usize, expected: &f64, budget: &f64) -> String {
    if expected.is_nan() {
        return format!(
            "how many sets of {size} points chance gives cannot be told: the noise of a point is no number"
        );
    }
    format!("chance gives {expected:.2e} sets of {size} points; at most {budget:.1e} are accepted")
}

/// The sentence of [`RejectionReason::Hinge`].
fn hinge(point: &str, rms: &f64, limit: &f64) -> String {
    if !rms.is_finite() {
        return format!(
            "the pose hangs on model point `{point}`: the others determine none, should that be a wrong match"
        );
    }
    format!(
        "the pose hangs on model point `{point}`: should that be a wrong match, the model points are {rms:.3} m off (RMS, one sigma); \
         twice that exceeds the alert limit of {limit:.3} m"
    )
}
