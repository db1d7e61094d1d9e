//! What one search looks for.

use seafix_geometry::{Object, Transform, World};
use serde::{Deserialize, Serialize};

use super::{ModelPoint, Shell, Site, SiteObject};

/// What is searched for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TargetKind {
    /// Each object by itself, in its own frame.
    #[default]
    Object,
    /// All points of the site at once, in the site's frame.
    Site,
}

/// The whole site cannot be one target: an object's place in the world is unknown.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "the whole site cannot be one target: object `{object}` has no `base_in_world`; add it, or use target = \"object\""
)]
pub struct NoWorld {
    /// The object without a place.
    pub object: String,
}

/// A set of feature points in one frame that a search looks for.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// The object's name, or the site's.
    pub name: String,
    /// The feature points, in the target's frame.
    pub points: Vec<ModelPoint>,
    /// Where the target's frame stands; `None` where no world is known.
    pub world_from_object: Option<Transform<World, Object>>,
    /// Standard deviation of each surveyed coordinate of that place (m).
    pub survey_sigma: f64,
}

impl Target {
    /// The greatest distance between two of its points (m).
    pub fn diameter(&self) -> f64 {
        diameter(&self.points)
    }

    /// The min–max shell of its points in its own frame.
    pub fn shell(&self) -> Shell<Object> {
        Shell::around(self.points.iter().map(|point| point.at)).expect("a target has at least three points")
    }

    fn of(object: &SiteObject) -> Self {
        Self {
            name: object.id.clone(),
            points: object.points.clone(),
            world_from_object: object.world_from_object,
            survey_sigma: object.survey_sigma,
        }
    }
}

/// The greatest distance between two of the points (m); 0 of fewer than two.
pub(crate) fn diameter(points: &[ModelPoint]) -> f64 {
    let pairs = points.iter().enumerate().flat_map(|(i, a)| points[..i].iter().map(move |b| a.at.distance(&b.at)));
    pairs.fold(0.0, f64::max)
}

/// The targets of a kind; see [`Site::targets`].
pub(super) fn targets(site: &Site, kind: TargetKind) -> Result<Vec<Target>, NoWorld> {
    match kind {
        TargetKind::Object => Ok(site.objects.iter().map(Target::of).collect()),
        TargetKind::Site => Ok(vec![whole(site)?]),
    }
}

/// All points of the site in the frame of its frame object, carried there through Eq. (1).
fn whole(site: &Site) -> Result<Target, NoWorld> {
    let frame = site.frame_object();
    let mut points = Vec::new();
    for (index, object) in site.objects.iter().enumerate() {
        let own = index == site.frame;
        let site_from_object: Transform<Object, Object> = if own {
            Transform::identity() // exactly, whatever the survey rounds
        } else {
            let place = |o: &SiteObject| o.world_from_object.ok_or_else(|| NoWorld { object: o.id.clone() });
            (place(frame)?.inverse() * place(object)?).relabel()
        };
        // Within the frame object the survey cancels; to the others it does not.
        let survey = if own { 0.0 } else { object.survey_sigma.hypot(frame.survey_sigma) };
        points.extend(object.points.iter().map(|point| ModelPoint {
            id: format!("{}/{}", object.id, point.id),
            at: site_from_object * point.at,
            sigma: if own { point.sigma } else { point.sigma.hypot(survey) },
            normal: point.normal.map(|normal| site_from_object.rotation() * normal),
        }));
    }
    Ok(Target {
        name: site.name.clone(),
        points,
        world_from_object: frame.world_from_object,
        survey_sigma: frame.survey_sigma,
    })
}
