//! The quantities of an attempt that reports use; name, topic and value are those of [`seafix_log::quantities`].

use seafix_log::{
    TargetRecord,
    quantities::{self, Quantity},
};

macro_rules! fields {
    ($($field:ident = $quantity:ident;)*) => {
        /// A quantity of an attempt.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub(crate) enum Field { $($field),* }

        impl Field {
            pub(crate) const ALL: &[Self] = &[$(Self::$field),*];

            fn quantity(self) -> &'static Quantity {
                match self { $(Self::$field => &quantities::$quantity),* }
            }
        }
    };
}

fields! {
    Fit = FIT_RMS;
    FitUnused = FIT_RMS_UNUSED;
    Tre = TRE_RMS;
    Position = POSITION_ERROR;
    Attitude = ATTITUDE_ERROR;
    Nees = NEES;
    TreCrlb = TRE_CRLB;
    PositionBound = POSITION_CRLB;
    Level = PROTECTION_POSITION;
    Limit = ALERT_LIMIT;
    Residual = RESIDUAL_RMS;
    Visible = VISIBLE;
    Identified = IDENTIFIED;
    Correct = CORRECT_PAIRS;
    Candidates = CANDIDATES;
    Tests = PAIR_TESTS;
    PWrong = P_WRONG;
    CandidatesTime = CANDIDATES_MS;
    SearchTime = SEARCH_MS;
    SolveTime = SOLVE_MS;
    TotalTime = TOTAL_MS;
}

impl Field {
    /// The field with this name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|field| field.name() == name)
    }

    /// The name in keys: the column of the results.
    pub(crate) fn name(self) -> &'static str {
        self.quantity().name
    }

    /// The unit in the logs; empty for counts and ratios.
    pub(crate) fn unit(self) -> &'static str {
        self.quantity().unit
    }

    /// The topic whose messages have the quantity.
    pub(crate) fn topic(self) -> &'static str {
        self.quantity().topic
    }

    /// The value in a logged record; `None` where it is unknown.
    pub(crate) fn of(self, record: &TargetRecord) -> Option<f64> {
        self.quantity().of(record)
    }
}
