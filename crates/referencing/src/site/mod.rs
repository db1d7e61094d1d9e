//! The site: known objects, their feature points, and their surveyed poses.
//!
//! There are two levels, as in the paper: a production system (site) of objects. Every object has its own frame by the
//! rule of Fig. 2; the site's frame is that of one chosen object.

pub(crate) mod bounding_box;
pub(crate) mod check;
pub(crate) mod check_edges;
mod check_faces;
pub(crate) mod congruence;
pub(crate) mod edge;
mod file;
pub(crate) mod model;
mod settings;
pub(crate) mod target;

use std::path::Path;

use seafix_component::Fault;
use seafix_geometry::World;

pub use bounding_box::BoundingBox;
pub use congruence::Congruence;
pub use edge::{End, ModelEdge};
pub use model::{Interest, ModelPoint, Site, SiteObject};
pub use settings::site_settings;
pub use target::{NoWorld, Target, TargetKind};

impl Site {
    /// Reads a site file (`seafix-site/1` or `/1.1`).
    ///
    /// # Errors
    ///
    /// An unreadable file, or all faults of its content.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, Vec<Fault>> {
        let path = path.as_ref();
        let text = seafix_component::read_text(path).map_err(|fault| vec![fault])?;
        Self::parse(&text, path)
    }

    /// Parses a site in the format `seafix-site/1` or `/1.1`; `file` is the file named in faults.
    ///
    /// # Errors
    ///
    /// All faults of the content, each with its line.
    pub fn parse(text: &str, file: &Path) -> Result<Self, Vec<Fault>> {
        check::site(&file::read(text, file).map_err(|fault| vec![fault])?, text, file)
    }

    /// The site in the format `seafix-site/1`, or `/1.1` if an object has edges.
    pub fn to_toml(&self) -> String {
        file::write(self)
    }

    /// The object whose frame is the site's.
    pub fn frame_object(&self) -> &SiteObject {
        &self.objects[self.frame]
    }

    /// The object with this identifier.
    pub fn object(&self, id: &str) -> Option<&SiteObject> {
        self.objects.iter().find(|object| object.id == id)
    }

    /// The bounding box of the site in the world; `None` unless every object is surveyed.
    pub fn bounding_box_in_world(&self) -> Option<BoundingBox<World>> {
        self.objects.iter().map(SiteObject::bounding_box_in_world).reduce(|a, b| Some(a?.union(&b?)))?
    }

    /// The targets of the site: each object by itself, or the complete site as one.
    ///
    /// # Errors
    ///
    /// [`NoWorld`] if the complete site is requested and an object has no surveyed pose.
    pub fn targets(&self, kind: TargetKind) -> Result<Vec<Target>, NoWorld> {
        target::targets(self, kind)
    }
}

#[cfg(test)]
mod tests;
