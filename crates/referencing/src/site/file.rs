//! The keys of the file format `seafix-site/1`.

use std::path::Path;

use seafix_component::Fault;
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::Site;

/// The format that this reader supports.
pub(super) const FORMAT: &str = "seafix-site/1";
/// The rule that defines object frames: the paper's Fig. 2, right-handed.
pub(super) const AXES: &str = "p1p3-x/p1p2xp1p3-z/zx-y";

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SiteFile {
    pub(super) format: String,
    pub(super) name: String,
    pub(super) axes: String,
    pub(super) site_frame: String,
    #[serde(default, rename = "object")]
    pub(super) objects: Vec<ObjectFile>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectFile {
    pub(super) id: String,
    pub(super) base: [String; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) base_in_world: Option<[[f64; 3]; 3]>,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(super) survey_sigma: f64,
    #[serde(default, rename = "point")]
    pub(super) points: Vec<PointFile>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) interest: Vec<InterestFile>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PointFile {
    pub(super) id: String,
    pub(super) at: [f64; 3],
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(super) sigma: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) normal: Option<[f64; 3]>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InterestFile {
    pub(super) id: String,
    pub(super) at: [f64; 3],
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
    if let Some(format) = head.format.filter(|format| format.get_ref() != FORMAT) {
        return Err(Fault::new("unknown format", file)
            .on_line(seafix_component::line_at(text, format.span().start))
            .value(format!("`{}`", format.get_ref()))
            .remedy(format!("this reader supports `{FORMAT}`")));
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
    let file = SiteFile {
        format: FORMAT.to_owned(),
        name: site.name.clone(),
        axes: AXES.to_owned(),
        site_frame: site.frame_object().id.clone(),
        objects: objects.collect(),
    };
    toml::to_string(&file).expect("a site consists of tables, strings and numbers")
}
