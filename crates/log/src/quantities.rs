//! The logged quantities, each defined once: name, unit, meaning, topic and accessor.
//!
//! The columns of `results.csv` and `results.parquet`, the fields of reports and their verification, and the page
//! `docs/quantities.md` follow from [`QUANTITIES`]. A new quantity is a field of a message in `proto/`, a field of its record
//! in `record/`, and a line here.

use crate::record::{FrameRecord, Integrity, NavigationRecord, PointOfInterest, TargetRecord};

/// The value of a quantity in one row; `None` where it is unknown.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A word or a sentence; empty where it is unknown.
    Text(String),
    /// An integer.
    Integer(Option<i64>),
    /// A real number.
    Real(Option<f64>),
    /// A truth value.
    Flag(Option<bool>),
}

/// The type of a quantity's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Words.
    Text,
    /// Integers.
    Integer,
    /// Real numbers.
    Real,
    /// Truth values.
    Flag,
}

/// The record that a quantity is read from.
#[derive(Debug, Clone, Copy)]
pub enum Accessor {
    /// The name of the trial.
    Trial(fn(&str) -> Value),
    /// A frame.
    Frame(fn(&FrameRecord) -> Value),
    /// An attempt to fix a target.
    Target(fn(&TargetRecord) -> Value),
}

/// A logged quantity.
#[derive(Debug)]
pub struct Quantity {
    /// The name: a column of the results, and the key of a number in a report.
    pub name: &'static str,
    /// The type of its values.
    pub kind: Kind,
    /// The unit; empty for words, counts and ratios.
    pub unit: &'static str,
    /// The meaning, in one sentence.
    pub doc: &'static str,
    /// The topic of the log that carries it; empty for the name of the trial.
    pub topic: &'static str,
    /// The accessor.
    pub accessor: Accessor,
}

impl PartialEq for Quantity {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Quantity {}

impl Quantity {
    /// The quantity that is called `name`.
    pub fn named(name: &str) -> Option<&'static Self> {
        QUANTITIES.iter().copied().find(|quantity| quantity.name == name)
    }

    /// The value in one row: a trial, a frame and an attempt.
    pub fn value(&self, trial: &str, frame: &FrameRecord, target: &TargetRecord) -> Value {
        match self.accessor {
            Accessor::Trial(read) => read(trial),
            Accessor::Frame(read) => read(frame),
            Accessor::Target(read) => read(target),
        }
    }

    /// The value of an attempt as a real number; `None` where it is unknown, or no number of an attempt.
    pub fn of(&self, target: &TargetRecord) -> Option<f64> {
        let Accessor::Target(read) = self.accessor else { return None };
        match read(target) {
            Value::Integer(value) => value.map(|value| value as f64),
            Value::Real(value) => value,
            Value::Text(_) | Value::Flag(_) => None,
        }
    }
}

fn navigation(frame: &FrameRecord) -> Option<&NavigationRecord> {
    frame.navigation.as_deref()
}

fn integrity(target: &TargetRecord) -> Option<&Integrity> {
    target.integrity.as_ref()
}

/// The point of interest that is nearest to the optical axis of the left camera.
fn poi(frame: &FrameRecord) -> Option<&PointOfInterest> {
    let off = |point: &PointOfInterest| point.at[0].hypot(point.at[1]) / point.at[2];
    frame.poi.iter().min_by(|a, b| off(a).total_cmp(&off(b)))
}

fn count(value: Option<u32>) -> Option<i64> {
    value.map(i64::from)
}

macro_rules! quantities {
    ($($id:ident: $from:ident $kind:ident $name:literal $unit:literal $topic:literal $doc:literal = $read:expr;)*) => {
        $(
            #[doc = $doc]
            pub static $id: Quantity = Quantity {
                name: $name,
                kind: Kind::$kind,
                unit: $unit,
                doc: $doc,
                topic: $topic,
                accessor: Accessor::$from(|record| Value::$kind($read(record))),
            };
        )*

        /// All quantities, in the order of the columns of the results.
        pub static QUANTITIES: &[&Quantity] = &[$(&$id),*];
    };
}

quantities! {
    TRIAL: Trial Text "trial" "" "" "The name of the trial." = |name: &str| name.to_owned();
    FRAME: Frame Integer "frame" "" "/referencing/frame" "The number of the frame." = |r: &FrameRecord| Some(r.frame as i64);
    STAMP_NS: Frame Integer "stamp_ns" "ns" "/referencing/frame" "The time of the frame." = |r: &FrameRecord| Some(r.stamp_ns as i64);
    OBJECT: Target Text "object" "" "/referencing/result" "The target; empty where the frame attempted none." = |r: &TargetRecord| r.object.clone();
    SEARCH: Target Text "search" "" "/referencing/result" "The search." = |r: &TargetRecord| r.search.clone();
    SOLVER: Target Text "solver" "" "/referencing/result" "The solver." = |r: &TargetRecord| r.solver.clone();
    OUTCOME: Target Text "outcome" "" "/referencing/result" "The outcome: fix, ambiguous, rejected or degenerate." = |r: &TargetRecord| r.outcome.to_string();
    REASON: Target Text "reason" "" "/referencing/result" "The reason of an outcome without a fix, one word." = |r: &TargetRecord| r.reason.clone();
    EXPLANATION: Target Text "explanation" "" "/referencing/result" "The reason in a sentence with its numbers, and its remedy." = |r: &TargetRecord| r.explanation.clone();
    P_ABSENT: Target Real "p_absent" "" "/referencing/result" "The probability that the object is absent." = |r: &TargetRecord| r.p_absent;
    P_WRONG: Target Real "p_wrong" "" "/referencing/result" "The probability that the pose is not the object's: absence and other poses together." = |r: &TargetRecord| r.p_wrong;
    WRONG: Target Flag "wrong" "" "/metrics/evaluation" "A fix whose TRE exceeds the alert limit." = |r: &TargetRecord| r.evaluation.wrong;
    WRONG_PAIRS: Target Flag "wrong_pairs" "" "/metrics/evaluation" "A fix that rests on a false pair." = |r: &TargetRecord| r.evaluation.wrong_pairs;
    VISIBLE: Target Integer "visible" "" "/metrics/evaluation" "The number of model points that both cameras truly see." = |r: &TargetRecord| count(r.evaluation.visible);
    IDENTIFIED: Target Integer "identified" "" "/metrics/evaluation" "The number of identified pairs." = |r: &TargetRecord| count(r.evaluation.identified);
    CORRECT_PAIRS: Target Integer "correct_pairs" "" "/metrics/evaluation" "The number of identified pairs within 2 px of the true projections in both images." = |r: &TargetRecord| count(r.evaluation.correct_pairs);
    EDGES_VISIBLE: Target Integer "edges_visible" "" "/metrics/evaluation" "The number of model edges that face the camera and of whose length at least a quarter lies in both images; bodies that hide them are not considered." = |r: &TargetRecord| count(r.evaluation.edges_visible);
    EDGES_IDENTIFIED: Target Integer "edges_identified" "" "/metrics/evaluation" "The number of identified edges." = |r: &TargetRecord| count(r.evaluation.edges_identified);
    CORRECT_EDGES: Target Integer "correct_edges" "" "/metrics/evaluation" "The number of identified edges whose measured line lies within 2 px of the true edge at both ends, in both images." = |r: &TargetRecord| count(r.evaluation.correct_edges);
    FIT_RMS: Target Real "fit_rms" "m" "/metrics/evaluation" "The RMS residual of the correctly identified pairs at the estimated pose (the paper's measure)." = |r: &TargetRecord| r.evaluation.fit_rms;
    FIT_RMS_UNUSED: Target Real "fit_rms_unused" "m" "/metrics/evaluation" "The fit RMS without the points that the solver used." = |r: &TargetRecord| r.evaluation.fit_rms_unused;
    TRE_RMS: Target Real "tre_rms" "m" "/metrics/evaluation" "The target registration error: the RMS error of all model points that the pose transfers." = |r: &TargetRecord| r.evaluation.tre_rms;
    POSITION_ERROR: Target Real "position_error" "m" "/metrics/evaluation" "The error of the left camera's position in the object frame." = |r: &TargetRecord| r.evaluation.position_error;
    ATTITUDE_ERROR: Target Real "attitude_error" "rad" "/metrics/evaluation" "The rotation angle of the pose error." = |r: &TargetRecord| r.evaluation.attitude_error;
    MSSD: Target Real "mssd" "m" "/metrics/evaluation" "The maximum symmetry-aware surface distance of the BOP benchmark: the largest error of a model point, after the motion that maps the model onto itself and makes it smallest." = |r: &TargetRecord| r.evaluation.mssd;
    MSPD: Target Real "mspd" "px" "/metrics/evaluation" "The maximum symmetry-aware projection distance of the BOP benchmark: the same between projections into the left image." = |r: &TargetRecord| r.evaluation.mspd;
    NEES: Target Real "nees" "" "/metrics/evaluation" "The normalised estimation error squared, six degrees of freedom." = |r: &TargetRecord| r.evaluation.nees;
    TRE_CRLB: Target Real "tre_crlb" "m" "/metrics/evaluation" "The Cramér–Rao bound of the TRE." = |r: &TargetRecord| r.evaluation.tre_crlb;
    POSITION_CRLB: Target Real "position_crlb" "m" "/metrics/evaluation" "The Cramér–Rao bound of the position error." = |r: &TargetRecord| r.evaluation.position_crlb;
    RESIDUAL_RMS: Target Real "residual_rms" "m" "/referencing/result" "The RMS residual of all identified pairs at the estimated pose." = |r: &TargetRecord| r.residual_rms;
    OPTIMAL: Target Flag "optimal" "" "/referencing/result" "Whether the search proved its set the best." = |r: &TargetRecord| r.optimal;
    CONSENSUS_BOUND: Target Integer "consensus_bound" "" "/referencing/result" "An upper bound of the size of any admissible set." = |r: &TargetRecord| r.consensus_bound.map(|n| n as i64);
    NFA: Target Real "nfa" "" "/referencing/result" "The number of false alarms: the expected number of random sets that are at least as large and fit at least as well." = |r: &TargetRecord| r.nfa;
    PAIR_TESTS: Target Integer "pair_tests" "" "/referencing/result" "The number of pair tests of the search; of `rigid-consensus`, words read of its graph, of 64 pairs each." = |r: &TargetRecord| r.pair_tests.map(|n| n as i64);
    CANDIDATES: Target Integer "candidates" "" "/referencing/candidates" "The number of candidate pairs." = |r: &TargetRecord| Some(r.candidates.iter().map(Vec::len).sum::<usize>() as i64);
    DETECT_MS: Frame Real "detect_ms" "ms" "/metrics/timing" "The duration of filters and detection, both images." = |r: &FrameRecord| r.times.detect_ms;
    LOCATE_MS: Frame Real "locate_ms" "ms" "/metrics/timing" "The duration of the corner location, both images." = |r: &FrameRecord| r.times.locate_ms;
    DESCRIBE_MS: Frame Real "describe_ms" "ms" "/metrics/timing" "The duration of the description, both images." = |r: &FrameRecord| r.times.describe_ms;
    MATCH_MS: Frame Real "match_ms" "ms" "/metrics/timing" "The duration of the matching." = |r: &FrameRecord| r.times.match_ms;
    REFINE_MS: Frame Real "refine_ms" "ms" "/metrics/timing" "The duration of the alignment of the right image to the left." = |r: &FrameRecord| r.times.refine_ms;
    TRIANGULATE_MS: Frame Real "triangulate_ms" "ms" "/metrics/timing" "The duration of the triangulation." = |r: &FrameRecord| r.times.triangulate_ms;
    CANDIDATES_MS: Target Real "candidates_ms" "ms" "/metrics/timing" "The duration of the selection of candidates." = |r: &TargetRecord| r.times.candidates_ms;
    SEARCH_MS: Target Real "search_ms" "ms" "/metrics/timing" "The duration of the search." = |r: &TargetRecord| r.times.search_ms;
    SOLVE_MS: Target Real "solve_ms" "ms" "/metrics/timing" "The duration of the solver and the acceptance tests." = |r: &TargetRecord| r.times.solve_ms;
    TOTAL_MS: Target Real "total_ms" "ms" "/metrics/timing" "The duration from the images to the answer about the target." = |r: &TargetRecord| r.times.total_ms;
    ODOMETRY_MS: Frame Real "odometry_ms" "ms" "/metrics/timing" "The duration of the odometry." = |r: &FrameRecord| r.times.odometry_ms;
    NAVIGATION: Frame Text "navigation" "" "/referencing/frame" "The state of the navigation." = |r: &FrameRecord| navigation(r).map_or_else(String::new, |known| known.state.clone());
    NAVIGATED_OBJECT: Frame Text "navigated_object" "" "/referencing/frame" "The object that the navigated pose is relative to." = |r: &FrameRecord| navigation(r).and_then(|known| known.pose.as_ref()).map_or_else(String::new, |pose| pose.object.clone());
    NAVIGATED_TRE_RMS: Frame Real "navigated_tre_rms" "m" "/referencing/frame" "The TRE of the navigated pose over its object's points." = |r: &FrameRecord| navigation(r)?.errors.tre_rms;
    NAVIGATED_POSITION_ERROR: Frame Real "navigated_position_error" "m" "/referencing/frame" "The position error of the navigated pose." = |r: &FrameRecord| navigation(r)?.errors.position_error;
    NAVIGATED_ATTITUDE_ERROR: Frame Real "navigated_attitude_error" "rad" "/referencing/frame" "The attitude error of the navigated pose." = |r: &FrameRecord| navigation(r)?.errors.attitude_error;
    NAVIGATED_NEES: Frame Real "navigated_nees" "" "/referencing/frame" "The NEES of the navigated pose, six degrees of freedom." = |r: &FrameRecord| navigation(r)?.errors.nees;
    ODOMETRY_ONLY_POSITION_ERROR: Frame Real "odometry_only_position_error" "m" "/referencing/frame" "The position error of the first fix moved by odometry alone." = |r: &FrameRecord| navigation(r)?.errors.odometry_only_position_error;
    POI_IN_VIEW: Frame Integer "poi_in_view" "" "/metrics/inspection" "The number of points of interest in view." = |r: &FrameRecord| Some(r.poi.len() as i64);
    POI: Frame Text "poi" "" "/metrics/inspection" "The point of interest nearest to the optical axis: object/point." = |r: &FrameRecord| poi(r).map_or_else(String::new, |point| format!("{}/{}", point.object, point.point));
    POI_RANGE: Frame Real "poi_range" "m" "/metrics/inspection" "The distance of that point from the left camera." = |r: &FrameRecord| poi(r).map(PointOfInterest::range);
    POI_ERROR: Frame Real "poi_error" "m" "/metrics/inspection" "The error of that point's estimated position." = |r: &FrameRecord| poi(r)?.error();
    POI_NEES: Frame Real "poi_nees" "" "/metrics/inspection" "The NEES of that position, three degrees of freedom." = |r: &FrameRecord| poi(r)?.nees;
    REDUNDANCY: Target Text "redundancy" "" "/referencing/result" "The redundancy of the fix: unmonitored, detectable or excludable." = |r: &TargetRecord| integrity(r).map_or_else(String::new, |it| it.redundancy.clone());
    CHI2: Target Real "chi2" "" "/referencing/result" "The χ² of the residuals at the maximum-likelihood pose." = |r: &TargetRecord| Some(integrity(r)?.chi2);
    CHI2_DOF: Target Integer "chi2_dof" "" "/referencing/result" "The degrees of freedom of that χ²." = |r: &TargetRecord| Some(integrity(r)?.dof as i64);
    CHI2_LIMIT: Target Real "chi2_limit" "" "/referencing/result" "The quantile of χ² at the confidence of the acceptance." = |r: &TargetRecord| Some(integrity(r)?.chi2_limit);
    SOLUTION_SEPARATION: Target Real "solution_separation" "m" "/referencing/result" "The maximum shift of the position when one point is excluded." = |r: &TargetRecord| integrity(r)?.solution_separation;
    SOLUTION_SEPARATION_TWO: Target Real "solution_separation_two" "m" "/referencing/result" "The maximum shift of the position when two points are excluded." = |r: &TargetRecord| integrity(r)?.solution_separation_two;
    PROTECTION_POSITION: Target Real "protection_position" "m" "/referencing/result" "The protection level of the position." = |r: &TargetRecord| integrity(r)?.protection_position;
    PROTECTION_ATTITUDE: Target Real "protection_attitude" "rad" "/referencing/result" "The protection level of the attitude." = |r: &TargetRecord| integrity(r)?.protection_attitude;
    SCALE_ERROR: Target Real "scale_error" "" "/referencing/result" "The relative excess of measured distances over the model's." = |r: &TargetRecord| integrity(r)?.scale_error;
    SCALE_ERROR_SIGMA: Target Real "scale_error_sigma" "" "/referencing/result" "The standard deviation of the scale error." = |r: &TargetRecord| integrity(r)?.scale_error_sigma;
    DEPTH_ERROR: Target Real "depth_error" "" "/referencing/result" "The relative excess of measured distances over the model's along the optical axis." = |r: &TargetRecord| integrity(r)?.depth_error;
    DEPTH_ERROR_SIGMA: Target Real "depth_error_sigma" "" "/referencing/result" "The standard deviation of the depth error." = |r: &TargetRecord| integrity(r)?.depth_error_sigma;
    ALERT_LIMIT: Target Real "alert_limit" "m" "/metrics/evaluation" "The alert limit of the target." = |r: &TargetRecord| r.evaluation.alert_limit;
    REGION: Target Text "region" "" "/metrics/evaluation" "The region of the Stanford diagram that error, protection level and alert limit lie in." = |r: &TargetRecord| r.region().map_or_else(String::new, |region| region.name().to_owned());
}

/// The quantities as a Markdown table: the page `docs/quantities.md`.
pub fn markdown() -> String {
    let mut text = "| quantity | unit | meaning | topic |\n|---|---|---|---|\n".to_owned();
    for quantity in QUANTITIES {
        let topic = if quantity.topic.is_empty() { String::new() } else { format!("`{}`", quantity.topic) };
        text += &format!("| `{}` | {} | {} | {topic} |\n", quantity.name, quantity.unit, quantity.doc);
    }
    text
}
