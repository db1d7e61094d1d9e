//! The reasons for which a frame has no attempt at any target.

/// A reason for which no target of a frame was attempted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NotAttempted {
    /// The policy asked for no fix at this frame.
    NotDue,
    /// No point was triangulated.
    NoData,
    /// By the prior no object is in view.
    NothingInView,
}

impl NotAttempted {
    /// The reason in logs and tables, in kebab-case.
    pub(crate) fn reason(self) -> &'static str {
        match self {
            Self::NotDue => "not-due",
            Self::NoData => "no-data",
            Self::NothingInView => "nothing-in-view",
        }
    }

    /// The reason as a sentence with its remedy, like [`Outcome::sentence`](seafix_referencing::Outcome::sentence).
    pub(crate) fn sentence(self) -> &'static str {
        match self {
            Self::NotDue => "the policy asked for no fix; choose another policy (`navigation.policy`)",
            Self::NoData => {
                "no point was triangulated; check that both images show one scene and belong to the rig (`seafix check`)"
            }
            Self::NothingInView => {
                "by the prior no object is in view; compare poses, site and images with `seafix check`: priors are \
                 world_from_camera in metres"
            }
        }
    }
}
