//! Policies: when to attempt a fix.

/// The navigation quantities that a policy may use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Situation {
    /// Time since the last accepted fix or recognised key frame (s); infinite before it and after a break.
    pub seconds: f64,
    /// Path length since then (m); infinite likewise.
    pub metres: f64,
    /// Standard deviation of the camera position along its least accurate axis (m); infinite before the first fix.
    pub sigma: f64,
    /// Whether the navigated or the prior pose puts an object in view.
    pub in_view: bool,
}

/// A re-referencing policy: it decides when a fix is tried. A fix costs a search; without a fix the error grows.
///
/// ```
/// use seafix_component::Choice;
/// use seafix_navigation::{POLICIES, Situation};
///
/// let policy = POLICIES.build(&Choice::named("travelled").with("metres", 10.0)).unwrap();
/// let after = |metres| Situation { seconds: 60.0, metres, sigma: 0.1, in_view: false };
/// assert!(!policy.due(&after(5.0)) && policy.due(&after(15.0)));
/// ```
pub trait Policy: Send + Sync + std::fmt::Debug {
    /// Whether a fix should be tried now.
    fn due(&self, situation: &Situation) -> bool;
}
