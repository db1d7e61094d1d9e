//! What the vehicle is there for: the points of interest in view.

/// A point of interest that truly is in both images: where it is, and where the vehicle had it.
#[derive(Debug, Clone, PartialEq)]
pub struct PointOfInterest {
    /// Id of its object.
    pub object: String,
    /// Its own id.
    pub point: String,
    /// The true position, frame of the left camera (m).
    pub at: [f64; 3],
    /// The estimated position, from the navigated pose or fix and the site (m); `None` without a pose.
    pub believed: Option<[f64; 3]>,
    /// Normalised estimation error squared of that place, three degrees of freedom.
    pub nees: Option<f64>,
}

impl PointOfInterest {
    /// How far from its true place the vehicle had it (m); `None` where no pose is known.
    pub fn error(&self) -> Option<f64> {
        let [x, y, z] = self.believed?;
        let [a, b, c] = self.at;
        Some(((x - a).powi(2) + (y - b).powi(2) + (z - c).powi(2)).sqrt())
    }

    /// How far it truly is from the left camera (m).
    pub fn range(&self) -> f64 {
        self.at.iter().map(|x| x * x).sum::<f64>().sqrt()
    }
}
