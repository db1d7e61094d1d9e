//! The result of a model from a dive.

use nalgebra::Matrix3;
use seafix_component::Fault;
use seafix_evaluation::ModelDifference;
use seafix_geometry::{Object, Point, StereoPixels};
use seafix_referencing::Site;

use super::picture::Picture;
use crate::model::adjust::Excess;

/// An object's model from a dive, with the details of each point.
#[derive(Debug)]
pub struct DiveModel {
    /// The object, without a pose in the world.
    pub site: Site,
    /// The points, in the order of the site.
    pub points: Vec<DivePoint>,
    /// The straight edges, in the order of the site; `None` unless asked for.
    pub edges: Option<Vec<DiveEdge>>,
    /// Marked features that became no point, with the reason.
    pub given_up: Vec<(String, String)>,
    /// The number of pairs of the dive.
    pub pairs: usize,
    /// The stamps (ns) of the pairs that observe a point.
    pub used: Vec<u64>,
    /// The noise of the observations beyond their own covariances (px): of the part common to both images, and of the
    /// disparity.
    pub excess: [f64; 2],
    /// The sum of the squared Mahalanobis norms of all residuals.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub dof: usize,
    /// The number of motions by odometry that linked pairs.
    pub motions: usize,
    /// Seen and unseen sides of the object, by the axes of its frame.
    pub sides: [(&'static str, bool); 6],
    /// The difference of the models from every second pair; `None` unless asked for, or with fewer than three common
    /// points.
    pub halves: Option<ModelDifference>,
    /// The warnings.
    pub warnings: Vec<Fault>,
}

/// A model point with its observations.
#[derive(Debug)]
pub struct DivePoint {
    /// The name.
    pub id: String,
    /// Whether the point is a corner; otherwise its mark defines it.
    pub corner: bool,
    /// The lines of its marks.
    pub lines: Vec<usize>,
    /// The position in the object's frame.
    pub at: Point<Object>,
    /// The covariance in the object's frame (m²); the coordinates that the rule of the frame makes zero have none.
    pub covariance: Matrix3<f64>,
    /// The standard deviation of a coordinate relative to the other points (m), the `sigma` of the site.
    pub sigma: f64,
    /// The largest angle between two lines of sight (rad).
    pub parallax: f64,
    /// The observations: stamp (ns) and pixels.
    pub observations: Vec<(u64, StereoPixels)>,
    /// The pairs in which the point was searched for and not used: stamp (ns) and reason.
    pub rejected: Vec<(u64, String)>,
    /// The best views; empty unless asked for.
    pub pictures: Vec<Picture>,
}

/// A straight edge of the model.
#[derive(Debug)]
pub struct DiveEdge {
    /// The name.
    pub id: String,
    /// The standard deviation (m) of its ends across the edge.
    pub sigma: f64,
    /// χ² of its lines in all pairs per degree of freedom: their scatter relative to their noise.
    pub scatter: f64,
    /// The stamps (ns) of the pairs that show most of the edge.
    pub pairs: Vec<u64>,
    /// The number of pairs with both ends in view.
    pub in_view: usize,
}

impl DiveModel {
    pub(super) fn excess_of(excess: &Excess) -> [f64; 2] {
        [excess.common, excess.difference]
    }
}
