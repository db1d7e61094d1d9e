//! Sites as data, read from their two files.

use std::path::{Path, PathBuf};

use seafix_component::{Fault, read_text};
use seafix_referencing::Site;

use super::{check, plan::Geometry};

/// A site as data: its nominal description, and the bodies that carry its points.
#[derive(Debug, Clone, PartialEq)]
pub struct SitePlan {
    /// The site in the format `seafix-site/1`, without survey errors.
    pub site: Site,
    /// The bodies in the format `seafix-geometry/1`.
    pub geometry: Geometry,
}

impl SitePlan {
    /// Parses the texts of both files.
    ///
    /// # Errors
    /// All faults of both.
    pub fn parse(site: (&str, &Path), geometry: (&str, &Path)) -> Result<Self, Vec<Fault>> {
        let described = Site::parse(site.0, site.1)?;
        let shape = Geometry::parse(geometry.0, geometry.1).map_err(|fault| vec![fault])?;
        let faults = check::faults(&shape, &described, geometry.0, geometry.1);
        if faults.is_empty() { Ok(Self { site: described, geometry: shape }) } else { Err(faults) }
    }

    /// Reads `NAME.site.toml` and `NAME.geometry.toml`, given the path of the first.
    ///
    /// # Errors
    /// The files that cannot be read, or all faults in them.
    pub fn read(path: &Path) -> Result<Self, Vec<Fault>> {
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let Some(stem) = name.strip_suffix(".site.toml") else {
            let remedy = "give a file NAME.site.toml with NAME.geometry.toml beside it";
            return Err(vec![Fault::new("not the name of a site file", path).remedy(remedy)]);
        };
        let other: PathBuf = path.with_file_name(format!("{stem}.geometry.toml"));
        let read = |path: &Path| read_text(path).map_err(|fault| vec![fault]);
        Self::parse((&read(path)?, path), (&read(&other)?, &other))
    }

    /// All faults of the geometry against the site; empty when a dive is possible.
    pub fn faults(&self) -> Vec<Fault> {
        check::faults(&self.geometry, &self.site, "", Path::new(&self.geometry.name))
    }
}
