//! Coordinate frames as types, and points typed by their frame.

use std::{fmt, marker::PhantomData};

use nalgebra::Vector3;

/// A Cartesian, right-handed coordinate frame; implemented by empty marker types.
pub trait Frame: Copy + fmt::Debug + PartialEq + Send + Sync + 'static {}

macro_rules! frames {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name;
        impl Frame for $name {}
    )*};
}

frames! {
    /// The left camera: x to the right of the image, y down, z forward along the optical axis.
    Camera,
    /// The right (or second) camera, axes as [`Camera`].
    RightCamera,
    /// The vehicle: x forward, y to starboard, z down.
    Body,
    /// The world of the survey and of the prior: north, east, down in simulated dives, any right-handed frame in
    /// others.
    World,
    /// A known object: origin P1, x along P1→P3, z along (P2−P1)×(P3−P1), y = z × x.
    ///
    /// P2 therefore has y < 0 (the rule of the paper's Fig. 2; built by [`triad`](crate::triad)).
    Object,
    /// The site: the frame of one chosen object of the production system.
    Site,
}

/// A point with its coordinates (m) in frame `F`.
///
/// ```compile_fail
/// use seafix_geometry::{Camera, Object, Point};
/// let seen: Point<Camera> = Point::new(0.0, 0.0, 3.0);
/// let known: Point<Object> = Point::new(0.0, 0.0, 0.0);
/// let nonsense = seen - known; // points of different frames have no difference
/// ```
#[derive(Clone, Copy, PartialEq)]
pub struct Point<F> {
    /// The coordinates (m).
    pub coords: Vector3<f64>,
    frame: PhantomData<F>,
}

impl<F: Frame> Point<F> {
    /// The point with these coordinates (m).
    pub const fn new(x: f64, y: f64, z: f64) -> Self {
        Self { coords: Vector3::new(x, y, z), frame: PhantomData }
    }

    /// The origin of the frame.
    pub const fn origin() -> Self {
        Self::new(0.0, 0.0, 0.0)
    }

    /// The distance to another point of the same frame (m).
    pub fn distance(&self, other: &Self) -> f64 {
        (self.coords - other.coords).norm()
    }

    /// Whether all three coordinates are finite.
    pub fn is_finite(&self) -> bool {
        self.coords.iter().all(|x| x.is_finite())
    }
}

impl<F: Frame> From<Vector3<f64>> for Point<F> {
    fn from(coords: Vector3<f64>) -> Self {
        Self { coords, frame: PhantomData }
    }
}

impl<F: Frame> From<[f64; 3]> for Point<F> {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self::new(x, y, z)
    }
}

impl<F: Frame> std::ops::Sub for Point<F> {
    type Output = Vector3<f64>;

    /// The vector from `other` to `self` (m), along the axes of the frame.
    fn sub(self, other: Self) -> Vector3<f64> {
        self.coords - other.coords
    }
}

impl<F: Frame> std::ops::Add<Vector3<f64>> for Point<F> {
    type Output = Self;

    fn add(self, step: Vector3<f64>) -> Self {
        Self::from(self.coords + step)
    }
}

impl<F> fmt::Debug for Point<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = std::any::type_name::<F>().rsplit("::").next().unwrap_or("?");
        write!(f, "{name}({}, {}, {})", self.coords.x, self.coords.y, self.coords.z)
    }
}
