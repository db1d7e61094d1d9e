//! The keys of the file formats `seafix-site/1` and `/1.1`.

use std::path::Path;

use seafix_component::{Fault, Settings};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::{
    edge::{End, ModelEdge},
    model::{ModelPoint, Site},
};

/// The format of a site without edges.
pub(super) const FORMAT: &str = "seafix-site/1";
/// The format of a site with edges.
pub(super) const FORMAT_WITH_EDGES: &str = "seafix-site/1.1";
/// The rule that defines object frames: the paper's Fig. 2, right-handed.
pub(super) const AXES: &str = "p1p3-x/p1p2xp1p3-z/zx-y";

#[derive(Debug, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields)]
pub(super) struct SiteFile {
    /// Format: `seafix-site/1`, or `seafix-site/1.1` of a site with edges.
    pub(super) format: String,
    /// Name of the site, in reports.
    pub(super) name: String,
    /// Rule that defines the frame of an object by its base; relative coordinates depend on it.
    pub(super) axes: String,
    /// Id of the object whose frame is the frame of the site.
    pub(super) site_frame: String,
    /// Objects of the site, at least one.
    #[serde(default, rename = "object")]
    pub(super) objects: Vec<ObjectFile>,
}

#[derive(Debug, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectFile {
    /// Name of the object, unique in the site.
    pub(super) id: String,
    /// Ids of the three points P1, P2 and P3 that define the frame of the object; they are not collinear.
    pub(super) base: [String; 3],
    /// Surveyed world coordinates of the base's three points (m); an object without them has a relative pose only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) base_in_world: Option<[[f64; 3]; 3]>,
    /// Standard deviation of a surveyed coordinate (m); 0, the default, is an exact survey.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(super) survey_sigma: f64,
    /// Feature points of the object, three or more.
    #[serde(default, rename = "point")]
    pub(super) points: Vec<PointFile>,
    /// Straight edges of the object (format `seafix-site/1.1`); none by default.
    #[serde(default, rename = "edge", skip_serializing_if = "Vec::is_empty")]
    pub(super) edges: Vec<EdgeFile>,
    /// Points of interest, whose position a report states; none by default.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) interest: Vec<InterestFile>,
}

#[derive(Debug, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields)]
pub(super) struct PointFile {
    /// Name of the point, unique in its object.
    pub(super) id: String,
    /// Coordinates in the object frame (m).
    pub(super) at: [f64; 3],
    /// Standard deviation of a coordinate (m); 0, the default, is an exact model.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(super) sigma: f64,
    /// Outward direction of the surface, of any length; a point without it counts as visible from every side.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) normal: Option<[f64; 3]>,
}

#[derive(Debug, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields)]
pub(super) struct EdgeFile {
    /// Name of the edge, unique in its object.
    pub(super) id: String,
    /// First end: the id of a point, or coordinates (m).
    pub(super) from: EndFile,
    /// Second end: the id of a point, or coordinates (m).
    pub(super) to: EndFile,
    /// Standard deviation (m) of an end that is a place, along each axis; 0, the default, is an exact model.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(super) sigma: f64,
    /// Outward unit normals of the adjacent faces, two at most; an edge without them counts as visible from every side.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) faces: Vec<[f64; 3]>,
}

/// A point's id or a place.
#[derive(Debug, Serialize, Deserialize, Settings)]
#[serde(untagged, expecting = "an end is a point's id or a place [x, y, z]")]
pub(super) enum EndFile {
    /// The id of a point.
    Point(String),
    /// Coordinates (m).
    At([f64; 3]),
}

#[derive(Debug, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields)]
pub(super) struct InterestFile {
    /// Name of the point of interest, unique in its object.
    pub(super) id: String,
    /// Coordinates in the frame of the object's points (m).
    pub(super) at: [f64; 3],
    /// Outward direction of the surface, of any length; a point without it counts as visible from every side.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) normal: Option<[f64; 3]>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's `skip_serializing_if` passes a reference")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// The keys of `text`; an unknown format is reported before unknown keys.
pub(super) fn read(text: &str, file: &Path) -> Result<SiteFile, Fault> {
    #[derive(Deserialize)]
    struct Head {
        format: Option<Spanned<String>>,
    }
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let head: Head = toml::from_str(text).map_err(|error| Fault::in_toml(file, text, &error))?;
    if let Some(format) = head.format.filter(|format| ![FORMAT, FORMAT_WITH_EDGES].contains(&format.get_ref().as_str()))
    {
        return Err(Fault::new("unknown format", file)
            .on_line(seafix_component::line_at(text, format.span().start))
            .value(format!("`{}`", format.get_ref()))
            .remedy(format!("this reader supports `{FORMAT}` and `{FORMAT_WITH_EDGES}`")));
    }
    toml::from_str(text).map_err(|error| Fault::in_toml(file, text, &error))
}

/// The site as text in its file format.
pub(super) fn write(site: &Site) -> String {
    let objects = site.objects.iter().map(|object| ObjectFile {
        id: object.id.clone(),
        base: object.base.map(|index| object.points[index].id.clone()),
        base_in_world: object.base_in_world.map(|base| base.map(|point| point.coords.into())),
        survey_sigma: object.survey_sigma,
        points: object
            .points
            .iter()
            .map(|point| PointFile {
                id: point.id.clone(),
                at: point.at.coords.into(),
                sigma: point.sigma,
                normal: point.normal.map(Into::into),
            })
            .collect(),
        edges: object
            .edges
            .iter()
            .map(|edge| EdgeFile {
                id: edge.id.clone(),
                from: end_of(edge, 0, &object.points),
                to: end_of(edge, 1, &object.points),
                sigma: edge.sigma,
                faces: edge.faces.iter().map(|face| (*face).into()).collect(),
            })
            .collect(),
        interest: object
            .interest
            .iter()
            .map(|interest| InterestFile {
                id: interest.id.clone(),
                at: interest.at.coords.into(),
                normal: interest.normal.map(Into::into),
            })
            .collect(),
    });
    let edges = site.objects.iter().any(|object| !object.edges.is_empty());
    let file = SiteFile {
        format: if edges { FORMAT_WITH_EDGES } else { FORMAT }.to_owned(),
        name: site.name.clone(),
        axes: AXES.to_owned(),
        site_frame: site.frame_object().id.clone(),
        objects: objects.collect(),
    };
    toml::to_string(&file).expect("a site consists of tables, strings and numbers")
}

fn end_of(edge: &ModelEdge, end: usize, points: &[ModelPoint]) -> EndFile {
    match edge.ends[end] {
        End::Point(index) => EndFile::Point(points[index].id.clone()),
        End::At(place) => EndFile::At(place.coords.into()),
    }
}
