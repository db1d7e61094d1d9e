//! The quantities of one attempt, named like the columns of the results.

use seafix_log::TargetRecord;

macro_rules! fields {
    ($($field:ident $name:literal $take:expr;)*) => {
        /// A quantity of an attempt.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub(crate) enum Field { $($field),* }

        impl Field {
            pub(crate) const ALL: &[Self] = &[$(Self::$field),*];

            /// The name in keys, equal to the column of the results if there is one.
            pub(crate) fn name(self) -> &'static str {
                match self { $(Self::$field => $name),* }
            }

            /// The value in a logged record; `None` where it is unknown.
            pub(crate) fn of(self, record: &TargetRecord) -> Option<f64> {
                match self { $(Self::$field => { let take: fn(&TargetRecord) -> Option<f64> = $take; take(record) })* }
            }
        }
    };
}

fields! {
    Fit "fit_rms" |r| r.evaluation.fit_rms;
    FitUnused "fit_rms_unused" |r| r.evaluation.fit_rms_unused;
    Tre "tre_rms" |r| r.evaluation.tre_rms;
    Position "position_error" |r| r.evaluation.position_error;
    Attitude "attitude_error" |r| r.evaluation.attitude_error;
    Nees "nees" |r| r.evaluation.nees;
    TreCrlb "tre_crlb" |r| r.evaluation.tre_crlb;
    PositionBound "position_crlb" |r| r.evaluation.position_crlb;
    Level "protection_position" |r| r.integrity.as_ref()?.protection_position;
    Limit "alert_limit" |r| r.evaluation.alert_limit;
    Residual "residual_rms" |r| r.residual_rms;
    Visible "visible" |r| r.evaluation.visible.map(f64::from);
    Identified "identified" |r| r.evaluation.identified.map(f64::from);
    Correct "correct_pairs" |r| r.evaluation.correct_pairs.map(f64::from);
    Candidates "candidates" |r| Some(r.candidates.iter().map(Vec::len).sum::<usize>() as f64);
    Tests "pair_tests" |r| r.pair_tests.map(|pair_tests| pair_tests as f64);
    CandidatesTime "candidates_ms" |r| r.times.candidates_ms;
    SearchTime "search_ms" |r| r.times.search_ms;
    SolveTime "solve_ms" |r| r.times.solve_ms;
    TotalTime "total_ms" |r| r.times.total_ms;
}

impl Field {
    /// The field with this name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|field| field.name() == name)
    }

    /// The topic whose messages have the quantity.
    pub(crate) fn topic(self) -> &'static str {
        match self {
            Self::Residual | Self::Tests | Self::Level => "/referencing/result",
            Self::Candidates => "/referencing/candidates",
            Self::CandidatesTime | Self::SearchTime | Self::SolveTime | Self::TotalTime => "/metrics/timing",
            _ => "/metrics/evaluation",
        }
    }
}
