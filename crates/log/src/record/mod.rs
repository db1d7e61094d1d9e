//! Plain records: what a trial hands to its log and gets back from it.

mod displaced;
mod frame;
mod header;
mod inputs;
mod inspection;
mod line;
mod matrix;
mod mirror;
mod navigation;
mod region;
mod target;
mod totals;

pub use displaced::{displaced_event, displaced_object};
pub use frame::{
    CloudPoint, FrameRecord, FrameTimes, GreyImage, PixelPair, PriorRecord, SharedStages, TruthRecord, VisiblePoint,
};
pub use header::{Axis, CameraRecord, Component, ModelPoint, RigRecord, TargetModel, TrialHeader};
pub use inputs::{AnswerRecord, ExactPose, Inputs, ProblemEdge, ProblemRecord, SensorReading, SitePoint, TrueState};
pub use inspection::PointOfInterest;
pub use line::{EdgePair, Line, ModelEdge, Offset};
pub use matrix::{Matrix3, Matrix4, Matrix6};
pub use navigation::{NavigatedRecord, NavigationErrors, NavigationRecord, OdometryStep};
pub use region::Region;
pub use target::{Alternative, BestPose, Evaluation, Integrity, Outcome, Pair, TargetRecord, TargetTimes};
pub use totals::Totals;
