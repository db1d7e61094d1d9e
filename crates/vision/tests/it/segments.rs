//! Properties of segment detectors and of the fit.

use nalgebra::Vector2;
use seafix_component::Choice;
use seafix_geometry::Pinhole;
use seafix_vision::{FitScratch, FittedSegment, Image, SEGMENT_DETECTORS, SegmentFit};

const SIZE: [usize; 2] = [640, 480];

fn camera(lens: &[f64]) -> Pinhole {
    Pinhole::new([640, 480], [533.0, 531.0], [318.0, 241.0], lens).expect("a valid camera")
}

/// A bright half-plane in directions: the points with n·x > offset, n at the angle `turn`.
#[derive(Debug, Clone, Copy)]
struct HalfPlane {
    normal: Vector2<f64>,
    offset: f64,
}

impl HalfPlane {
    fn new(turn: f64, offset: f64) -> Self {
        Self { normal: Vector2::new(libm::cos(turn), libm::sin(turn)), offset }
    }

    /// The distance of a direction from the edge, times the focal length.
    fn distance(&self, direction: &Vector2<f64>) -> f64 {
        533.0 * (self.normal.dot(direction) - self.offset)
    }
}

fn hash(i: usize) -> f64 {
    let mut h = (i as u32).wrapping_mul(0x9E37_79B1);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 13)).wrapping_mul(0x297A_2D39);
    f64::from(h >> 8) / f64::from(1 << 24)
}

/// The half-plane's image with a blur of 0.8 px and uniform noise of ±`grain`, in 8 bits.
fn image(camera: &Pinhole, shape: &HalfPlane, grain: f64) -> Image {
    let pixel = |i: usize| {
        let at = seafix_geometry::Pixel { u: (i % SIZE[0]) as f64, v: (i / SIZE[0]) as f64 };
        let Some(direction) = camera.normalize(&at) else { return 0.0 };
        let lit = 0.5 * libm::erfc(-shape.distance(&direction) / (0.8 * std::f64::consts::SQRT_2));
        (80.0 + 60.0 * lit + grain * (2.0 * hash(i) - 1.0)).round() as f32
    };
    Image::new(SIZE[0], SIZE[1], (0..SIZE[0] * SIZE[1]).map(pixel).collect()).expect("width × height pixels")
}

/// The fitted segments of a detector, the longest first.
fn fitted(name: &str, image: &Image, camera: &Pinhole) -> Vec<FittedSegment> {
    let detector = SEGMENT_DETECTORS.build(&Choice::named(name)).expect("a valid detector");
    let (fit, mut scratch) = (SegmentFit::default(), FitScratch::default());
    let found = detector.detect(image, camera);
    let mut all: Vec<FittedSegment> =
        found.iter().filter_map(|segment| fit.fit(image, camera, segment, &mut scratch)).collect();
    all.sort_by(|a, b| b.length.total_cmp(&a.length));
    all
}

/// Law E10: the lens bends straight edges (k₁ = −0.3); both half-points lie within 0.03 px of the true edge.
#[test]
fn a_bent_image_of_a_straight_edge_is_fitted() {
    let camera = camera(&[-0.3, 0.0, 0.0, 0.0]);
    for name in SEGMENT_DETECTORS.names() {
        for (turn, offset) in [(0.1, 0.45), (1.5, 0.33), (0.9, -0.4), (2.5, 0.02)] {
            let shape = HalfPlane::new(turn, offset);
            let found = fitted(name, &image(&camera, &shape, 1.0), &camera);
            let longest = found.first().unwrap_or_else(|| panic!("{name} finds the edge {turn} {offset}"));
            assert!(longest.length > 200.0, "{name}, {turn} {offset}: {} px", longest.length);
            for half in longest.offsets {
                let direction = camera.normalize(&half.at).unwrap();
                // The distance in the image: the lens shrinks distances in directions.
                let off = shape.distance(&direction);
                assert!(off.abs() < 0.03, "{name}, {turn} {offset}: {off} px at {:?}", half.at);
            }
        }
    }
}

/// The errors of half-points over their stated standard deviations are those of unit variance.
#[test]
fn the_stated_sigma_is_the_error() {
    let camera = camera(&[]);
    let (mut squares, mut count) = (0.0, 0.0);
    for i in 0..24 {
        let turn = 0.26 * f64::from(i) + 0.05;
        let shape = HalfPlane::new(turn, 0.1 * libm::sin(f64::from(i)));
        let found = fitted("a-contrario", &image(&camera, &shape, 12.0), &camera);
        let longest = found.first().expect("the edge");
        for half in longest.offsets {
            let error = shape.distance(&camera.normalize(&half.at).unwrap());
            squares += (error / half.sigma).powi(2);
            count += 1.0;
        }
    }
    let ratio: f64 = squares / count;
    // 48 squares of unit variance have a mean within 1 ± 3 √(2/48); the floor makes it smaller.
    assert!((0.3..1.6).contains(&ratio), "{ratio}");
}

/// The brighter side lies along the normals, and the fitted levels are those of both sides.
#[test]
fn the_brighter_side_is_known() {
    let camera = camera(&[]);
    for i in 0..8 {
        let shape = HalfPlane::new(0.8 * f64::from(i), 0.05);
        let found = fitted("a-contrario", &image(&camera, &shape, 2.0), &camera);
        let longest = found.first().expect("the edge");
        for half in longest.offsets {
            assert!(half.normal.dot(&shape.normal) > 0.999, "{i}: {:?}", half.normal);
        }
        assert!((longest.levels[0] - 80.0).abs() < 2.0 && (longest.levels[1] - 140.0).abs() < 2.0);
    }
}
