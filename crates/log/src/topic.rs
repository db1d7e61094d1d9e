//! Topics, and the schema of each message on them.

use crate::proto::{self, foxglove};

/// The header of the trial.
pub(crate) const HEADER: &str = "/run/header";
/// The exact record of a frame; it closes the frame.
pub(crate) const FRAME: &str = "/referencing/frame";
/// What the method of a frame was given, to the last bit.
pub(crate) const INPUTS: &str = "/referencing/inputs";
/// What came of each attempt.
pub(crate) const RESULT: &str = "/referencing/result";
/// Which cloud points might be which points of the target.
pub(crate) const CANDIDATES: &str = "/referencing/candidates";
/// Comparison with truth.
pub(crate) const EVALUATION: &str = "/metrics/evaluation";
/// The points of interest in view, as the vehicle had them and as they are.
pub(crate) const INSPECTION: &str = "/metrics/inspection";
/// What all frames add up to.
pub(crate) const TOTALS: &str = "/metrics/totals";
/// Wall-clock times.
pub(crate) const TIMING: &str = "/metrics/timing";

/// Images, left and right.
pub(crate) const IMAGES: [&str; 2] = ["/camera/left/image", "/camera/right/image"];
/// Calibrations, left and right.
pub(crate) const CALIBRATIONS: [&str; 2] = ["/camera/left/calibration", "/camera/right/calibration"];
/// Marks in the images, left and right.
pub(crate) const ANNOTATIONS: [&str; 2] = ["/camera/left/annotations", "/camera/right/annotations"];
/// Transforms between frames.
pub(crate) const TF: &str = "/tf";
/// All triangulated points.
pub(crate) const CLOUD: &str = "/cloud";
/// Those that are a candidate of some model point.
pub(crate) const CLOUD_CANDIDATES: &str = "/cloud/candidates";
/// Those that were identified, in the colour of their target.
pub(crate) const CLOUD_IDENTIFIED: &str = "/cloud/identified";
/// The model's points, as a scene.
pub(crate) const SCENE_MODEL: &str = "/scene/model";
/// The model's points, as a cloud in the site's frame.
pub(crate) const MODEL: &str = "/model";
/// The model's straight edges, as dots in the site's frame.
pub(crate) const MODEL_EDGES: &str = "/model/edges";
/// The measured lines, as dots.
pub(crate) const CLOUD_LINES: &str = "/cloud/lines";
/// The gates of the prior, as dots.
pub(crate) const CLOUD_GATES: &str = "/cloud/gates";
/// The ellipsoid of the estimated position, as dots.
pub(crate) const POSE_COVARIANCE: &str = "/pose/covariance";
/// The vehicle, as one dot a frame: as estimated and as it really was.
pub(crate) const POSE_PATHS: [&str; 2] = ["/path/estimate", "/path/truth"];
/// The vehicle, as estimated.
pub(crate) const POSE_ESTIMATE: &str = "/pose/estimate";
/// The vehicle, as it really was.
pub(crate) const POSE_TRUTH: &str = "/pose/truth";
/// The vehicle, as roughly known before.
pub(crate) const POSE_PRIOR: &str = "/pose/prior";

/// A message with a schema to publish.
pub(crate) trait Logged: prost::Message {
    /// The schema's name and its serialised `FileDescriptorSet`.
    fn schema() -> Schema;
}

macro_rules! own {
    ($($message:ident),*) => {$(
        impl Logged for proto::$message {
            fn schema() -> Schema {
                (concat!("seafix.v2.", stringify!($message)), proto::DESCRIPTORS)
            }
        }
    )*};
}
own!(TrialHeader, Frame, Inputs, ReferencingResult, Candidates, Evaluation, Inspection, Timing, Totals);

macro_rules! well_known {
    ($($message:ident),*) => {$(
        impl Logged for foxglove::$message {
            fn schema() -> Schema {
                let descriptors = include_bytes!(concat!("../proto/foxglove/", stringify!($message), ".bin"));
                (concat!("foxglove.", stringify!($message)), descriptors)
            }
        }
    )*};
}
well_known!(
    CompressedImage,
    CameraCalibration,
    ImageAnnotations,
    FrameTransforms,
    PointCloud,
    SceneUpdate,
    PoseInFrame
);

/// A schema's name and its serialised `FileDescriptorSet`.
pub(crate) type Schema = (&'static str, &'static [u8]);

/// The schema of a message, [`Logged::schema`].
pub(crate) type SchemaOf = fn() -> Schema;

/// The topics of which every frame has its own messages, with their schemas: what is copied when logs are joined.
pub(crate) const OF_FRAMES: [(&str, SchemaOf); 23] = [
    (IMAGES[0], foxglove::CompressedImage::schema),
    (IMAGES[1], foxglove::CompressedImage::schema),
    (ANNOTATIONS[0], foxglove::ImageAnnotations::schema),
    (ANNOTATIONS[1], foxglove::ImageAnnotations::schema),
    (TF, foxglove::FrameTransforms::schema),
    (POSE_ESTIMATE, foxglove::PoseInFrame::schema),
    (POSE_TRUTH, foxglove::PoseInFrame::schema),
    (POSE_PRIOR, foxglove::PoseInFrame::schema),
    (CLOUD, foxglove::PointCloud::schema),
    (CLOUD_CANDIDATES, foxglove::PointCloud::schema),
    (CLOUD_IDENTIFIED, foxglove::PointCloud::schema),
    (CLOUD_LINES, foxglove::PointCloud::schema),
    (CLOUD_GATES, foxglove::PointCloud::schema),
    (POSE_COVARIANCE, foxglove::PointCloud::schema),
    (POSE_PATHS[0], foxglove::PointCloud::schema),
    (POSE_PATHS[1], foxglove::PointCloud::schema),
    (CANDIDATES, proto::Candidates::schema),
    (RESULT, proto::ReferencingResult::schema),
    (EVALUATION, proto::Evaluation::schema),
    (INSPECTION, proto::Inspection::schema),
    (TIMING, proto::Timing::schema),
    (INPUTS, proto::Inputs::schema),
    (FRAME, proto::Frame::schema),
];

/// Whether only frames have messages on this topic; the transforms are also among the records before the first frame.
pub(crate) fn is_of_frame(topic: &str) -> bool {
    topic != TF && OF_FRAMES.iter().any(|(name, _)| *name == topic)
}

/// The metadata record of a log that was saved of one that was not whole.
pub(crate) const RECOVERED: &str = "recovered";

/// That record: what is lost.
pub(crate) fn recovered(lost: &str) -> mcap::records::Metadata {
    let metadata = std::collections::BTreeMap::from([("lost".to_owned(), lost.to_owned())]);
    mcap::records::Metadata { name: RECOVERED.to_owned(), metadata }
}

/// What is lost, by that record; nothing by any other.
pub(crate) fn lost(metadata: &mcap::records::Metadata) -> Option<String> {
    (metadata.name == RECOVERED).then(|| metadata.metadata.get("lost").cloned().unwrap_or_default())
}
