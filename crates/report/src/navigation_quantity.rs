//! The quantities of a navigated frame, named like the columns of the results.

use seafix_log::NavigationRecord;

macro_rules! quantities {
    ($($quantity:ident $name:literal $take:ident;)*) => {
        /// A quantity of the navigated pose after a frame.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub(crate) enum NavigationQuantity { $($quantity),* }

        impl NavigationQuantity {
            pub(crate) const ALL: &[Self] = &[$(Self::$quantity),*];

            /// The name in keys, equal to the column of the results.
            pub(crate) fn name(self) -> &'static str {
                match self { $(Self::$quantity => $name),* }
            }

            /// The value in a logged record; `None` where it is unknown.
            pub(crate) fn of(self, record: &NavigationRecord) -> Option<f64> {
                match self { $(Self::$quantity => record.errors.$take),* }
            }
        }
    };
}

quantities! {
    Tre "navigated_tre_rms" tre_rms;
    Position "navigated_position_error" position_error;
    Attitude "navigated_attitude_error" attitude_error;
    Nees "navigated_nees" nees;
    AlonePosition "odometry_only_position_error" odometry_only_position_error;
    AloneAttitude "odometry_only_attitude_error" odometry_only_attitude_error;
}

/// A counted group of frames of a trial with a navigator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Counted {
    /// All frames.
    NavigationQuantity,
    /// The frames with a pose.
    Navigated,
    /// The frames at which the policy asked for a fix.
    Tried,
    /// The frames whose pose is a fix of the same frame.
    Fix,
    /// The frames without an odometry step from the frame before; the first frame does not count.
    Lost,
}

impl NavigationQuantity {
    /// The quantity with this name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|quantity| quantity.name() == name)
    }
}

impl Counted {
    pub(crate) const ALL: [Self; 5] = [Self::NavigationQuantity, Self::Navigated, Self::Tried, Self::Fix, Self::Lost];

    /// The name in keys.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::NavigationQuantity => "sailed",
            Self::Navigated => "navigated",
            Self::Tried => "tried",
            Self::Fix => "fix",
            Self::Lost => "lost",
        }
    }

    /// Whether a frame belongs to the group.
    pub(crate) fn holds(self, record: &NavigationRecord) -> bool {
        match self {
            Self::NavigationQuantity => true,
            Self::Navigated => record.pose.is_some(),
            Self::Tried => record.due,
            Self::Fix => record.state == "fix",
            Self::Lost => !record.odometry.lost.is_empty(),
        }
    }
}
