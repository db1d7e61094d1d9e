//! The quantities of a navigated frame, under the names that the columns of the results have.

use seafix_log::NavigationRecord;

macro_rules! quantities {
    ($($quantity:ident $name:literal $take:ident;)*) => {
        /// One quantity of what a navigator knew after a frame.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub(crate) enum NavigationQuantity { $($quantity),* }

        impl NavigationQuantity {
            pub(crate) const ALL: &[Self] = &[$(Self::$quantity),*];

            /// Its name.
            pub(crate) fn name(self) -> &'static str {
                match self { $(Self::$quantity => $name),* }
            }

            /// Its value in the logged record; `None` where nothing is known.
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

/// Frames that are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Counted {
    /// All of a trial that navigates.
    NavigationQuantity,
    /// With a pose.
    Navigated,
    /// At which a fix was tried.
    Tried,
    /// On a fix of their own instant.
    Fix,
    /// To which the odometry knew no motion, the first pair left out.
    Lost,
}

impl NavigationQuantity {
    /// The quantity that is called `name`.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|quantity| quantity.name() == name)
    }
}

impl Counted {
    pub(crate) const ALL: [Self; 5] = [Self::NavigationQuantity, Self::Navigated, Self::Tried, Self::Fix, Self::Lost];

    /// Its name in keys.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::NavigationQuantity => "sailed",
            Self::Navigated => "navigated",
            Self::Tried => "tried",
            Self::Fix => "fix",
            Self::Lost => "lost",
        }
    }

    /// Whether a frame is one of them.
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
