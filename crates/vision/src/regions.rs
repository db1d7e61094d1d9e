//! Regions of an image where features are wanted.

use seafix_geometry::Pixel;

/// Discs of an image where points of an object are expected.
///
/// A disc covers the complete gate of a point, with one density of features throughout: a density that rose towards the
/// prediction would make clutter there look like the object.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Regions {
    discs: Vec<Disc>,
}

/// The pixels within `radius` of `centre`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// The centre (px).
    pub centre: Pixel,
    /// The radius (px).
    pub radius: f64,
}

impl Regions {
    /// Regions without pixels.
    pub const NONE: Self = Self { discs: Vec::new() };

    /// The union of these discs.
    pub fn new(discs: Vec<Disc>) -> Self {
        Self { discs }
    }

    /// Whether no pixel belongs to the regions.
    pub fn is_empty(&self) -> bool {
        self.discs.is_empty()
    }

    /// Whether a pixel belongs to the regions.
    pub fn contains(&self, at: &Pixel) -> bool {
        self.discs.iter().any(|disc| disc.centre.distance(at) <= disc.radius)
    }
}
