//! Tests of one camera against OpenCV, and of the limits of its domain by hand.

use seafix_geometry::{BadCamera, Camera, Pinhole, Pixel, Point};

use crate::{names, near, numbers};

const OPENCV: &str = include_str!("../fixtures/opencv.txt");
const TRIANGULATION: &str = include_str!("../fixtures/triangulation.txt");

fn camera(distortion: &[f64]) -> Pinhole {
    Pinhole::new([640, 480], [533.4, 541.7], [342.5, 234.7], distortion).unwrap()
}

fn ahead(x: f64, y: f64) -> Point<Camera> {
    Point::new(x, y, 1.0)
}

/// The test fails with the sign of p2 inverted, and with 4 p1 x y.
#[test]
fn opencv_projects_alike() {
    let points = numbers(OPENCV, "points");
    let mut lenses = 0;
    for name in names(OPENCV, "lens ") {
        let camera = camera(&numbers(OPENCV, &format!("lens {name}")));
        let (mut pixels, mut slopes) = (Vec::new(), Vec::new());
        for point in points.chunks(3) {
            let point = Point::<Camera>::new(point[0], point[1], point[2]);
            let (pixel, slope) = camera.project_with_jacobian(&point).unwrap();
            assert_eq!(camera.project(&point), Some(pixel));
            pixels.extend([pixel.u, pixel.v]);
            slopes.extend(slope.transpose().iter());
        }
        near(&pixels, &numbers(OPENCV, &format!("project {name}")), 1e-15, name);
        near(&slopes, &numbers(OPENCV, &format!("derivative {name}")), 1e-14, name);
        lenses += 1;
    }
    assert_eq!(lenses, 5);
}

#[test]
fn opencv_undistorts_alike() {
    let pixels = numbers(OPENCV, "pixels");
    for name in names(OPENCV, "undistort ") {
        let camera = camera(&numbers(OPENCV, &format!("lens {name}")));
        let found: Vec<f64> = pixels
            .chunks(2)
            .flat_map(|pixel| {
                let n = camera.normalize(&Pixel { u: pixel[0], v: pixel[1] }).unwrap();
                [n.x, n.y]
            })
            .collect();
        near(&found, &numbers(OPENCV, &format!("undistort {name}")), 1e-13, name);
    }
}

/// The fold is searched for in steps of 0.005 (normalised).
#[test]
fn a_lens_ends_where_its_radial_map_folds_back() {
    for name in names(TRIANGULATION, "fold ") {
        let line = numbers(TRIANGULATION, &format!("fold {name}"));
        let (camera, fold) = (camera(&line[..8]), line[8]);
        for (s, c) in [(0.0, 1.0), (0.6, -0.8)] {
            let at = |radius: f64| camera.project(&ahead(radius * c, radius * s));
            assert!(at(fold - 1e-6).is_some(), "{name} inside {fold}");
            assert!(at(fold + 0.005 + 1e-6).is_none(), "{name} outside {fold}");
        }
    }
    // Without distortion, or with a map that never decreases, every angle below 90° is valid.
    assert!(camera(&[]).project(&ahead(1e6, 0.0)).is_some());
    assert!(camera(&[0.1, 0.0, 0.0, 0.0]).project(&ahead(300.0, 0.0)).is_some());
    // A lens that folds beyond 84 degrees counts as one that does not fold.
    assert!(camera(&[-0.003, 0.0, 0.0, 0.0]).project(&ahead(10.1, 0.0)).is_some());
}

/// At the fold of ρ = 1 − 0.28 r² the distorted radius is (2/3) r; a pixel beyond it has no direction.
#[test]
fn a_pixel_beyond_the_fold_has_no_direction() {
    let camera = camera(&[-0.28, 0.0, 0.0, 0.0]);
    let fold = (1.0_f64 / 0.84).sqrt();
    let farthest = 342.5 + 533.4 * fold * 2.0 / 3.0;
    assert!(camera.normalize(&Pixel { u: farthest - 0.01, v: 234.7 }).is_some());
    assert!(camera.normalize(&Pixel { u: farthest + 0.01, v: 234.7 }).is_none());
}

/// A tangential term moves (0, y) along both axes: by p2 y² and p1 (3 y²), with p1 = 0.01, p2 = 0.02, y = 1/2.
#[test]
fn the_tangential_terms_by_hand() {
    let pixel = camera(&[0.0, 0.0, 0.01, 0.02]).project(&ahead(0.0, 0.5)).unwrap();
    assert!((pixel.u - (342.5 + 533.4 * 0.005)).abs() < 1e-12);
    assert!((pixel.v - (234.7 + 541.7 * (0.5 + 0.0075))).abs() < 1e-12);
}

#[test]
fn a_margin_is_kept_on_every_side() {
    let camera = camera(&[]);
    let inside = |u: f64, v: f64, margin: f64| camera.contains(&Pixel { u, v }, margin);
    assert!(inside(0.0, 0.0, 0.0) && inside(639.0, 479.0, 0.0));
    assert!(!inside(-0.1, 5.0, 0.0) && !inside(5.0, -0.1, 0.0));
    assert!(!inside(639.1, 5.0, 0.0) && !inside(5.0, 479.1, 0.0));
    assert!(inside(10.0, 10.0, 10.0) && inside(629.0, 469.0, 10.0));
    assert!(!inside(9.9, 10.0, 10.0) && !inside(10.0, 9.9, 10.0));
    assert!(!inside(629.1, 10.0, 10.0) && !inside(10.0, 469.1, 10.0));
}

#[test]
fn the_shortest_list_is_one_that_files_know() {
    let shortest = |numbers: &[f64]| camera(numbers).distortion().shortest().len();
    assert_eq!([shortest(&[]), shortest(&[0.0; 8]), shortest(&[0.1, 0.0, 0.0, 0.0])], [0, 0, 4]);
    assert_eq!(shortest(&[0.1, 0.0, 0.0, 0.2, 0.0]), 4);
    assert_eq!(shortest(&[0.0, 0.0, 0.0, 0.0, 0.2]), 5);
    assert_eq!(shortest(&[0.1, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0]), 8);
    let camera = camera(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]);
    assert_eq!(camera.distortion().coefficients()[..8], [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]);
    assert_eq!(camera.distortion().shortest(), &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]);
}

#[test]
fn a_camera_reports_its_numbers() {
    let camera = camera(&[]);
    assert_eq!(camera.size(), [640, 480]);
    assert_eq!(camera.focal(), [533.4, 541.7]);
    assert_eq!(camera.principal(), [342.5, 234.7]);
    assert_eq!(Pixel { u: 1.0, v: -2.0 }.distance(&Pixel { u: 4.0, v: 2.0 }), 5.0);
    assert_eq!(Pixel { u: 4.0, v: 2.5 }.distance(&Pixel { u: 4.0, v: 2.0 }), 0.5);
}

/// Lens models whose slope nearly vanishes: full steps of Newton's iteration cross the fold at 3.9, shorter ones do not
/// converge.
#[test]
fn long_steps_of_the_iteration_are_shortened() {
    let there_and_back = |lens: &[f64], x: f64, y: f64| {
        let camera = camera(lens);
        let found = camera.normalize(&camera.project(&ahead(x, y)).unwrap());
        assert!(found.is_some_and(|n| (n.x - x).hypot(n.y - y) < 1e-10), "{lens:?} {x} {y}: {found:?}");
    };
    let wavy = [-0.3, 0.0509, 0.0, 0.0, -0.00299];
    for radius in [2.105_286_445, 2.164_726_296, 2.510_384_623] {
        there_and_back(&wavy, radius, 0.0);
        there_and_back(&wavy, -0.6 * radius, 0.8 * radius);
    }
    there_and_back(&[-0.3, 0.0442, 0.0, 0.0, -0.00105], 3.255_231_655, 0.0);
    there_and_back(&[0.4, 0.2, 0.0, 0.0, 0.1, 0.5, 0.1, 0.02], 7.961_303_5, 0.0);
    there_and_back(&[0.0, 3.0, 0.0, 0.0], -3.373_036_93, 7.155_447_98);
}

#[test]
fn a_point_in_the_plane_of_the_camera_is_not_seen() {
    assert!(camera(&[]).project(&Point::<Camera>::new(1.0, 0.0, 0.0)).is_none());
    assert!(camera(&[]).project(&Point::<Camera>::new(0.0, 0.0, f64::NAN)).is_none());
    assert!(camera(&[]).project(&Point::<Camera>::new(0.0, 0.0, 1e-9)).is_some());
    // The point is so near the plane that its direction overflows.
    assert!(camera(&[]).project(&Point::<Camera>::new(1.0, 0.0, 1e-310)).is_none());
}

#[test]
fn the_number_that_is_wrong_is_named() {
    let new = |size, focal, principal, distortion: &[f64]| Pinhole::new(size, focal, principal, distortion);
    assert_eq!(new([0, 4], [1.0; 2], [0.0; 2], &[]), Err(BadCamera::Size(0, 4)));
    assert_eq!(new([4, 0], [1.0; 2], [0.0; 2], &[]), Err(BadCamera::Size(4, 0)));
    assert!(new([1, 1], [1e-9; 2], [0.0, 1.0], &[]).is_ok(), "one pixel, and the border of the image");
    for bad in [0.0, -1.0, f64::INFINITY] {
        assert_eq!(new([4, 3], [bad, 1.0], [1.0; 2], &[]), Err(BadCamera::FocalLength { name: "fx", value: bad }));
        assert_eq!(new([4, 3], [1.0, bad], [1.0; 2], &[]), Err(BadCamera::FocalLength { name: "fy", value: bad }));
    }
    for bad in [-0.1, f64::INFINITY, f64::NEG_INFINITY] {
        let wrong = |name, limit| Err(BadCamera::PrincipalPoint { name, value: bad, limit });
        assert_eq!(new([4, 3], [1.0; 2], [bad, 1.0], &[]), wrong("cx", 4));
        assert_eq!(new([4, 3], [1.0; 2], [1.0, bad], &[]), wrong("cy", 3));
    }
    assert!(new([4, 3], [1.0; 2], [3.5, 3.1], &[]).is_err() && new([4, 3], [1.0; 2], [4.1, 2.0], &[]).is_err());
    for length in [1, 2, 3, 6, 7, 9] {
        assert_eq!(new([4, 3], [1.0; 2], [1.0; 2], &vec![0.0; length]), Err(BadCamera::DistortionLength(length)));
    }
    let infinite = [0.0, 0.0, 0.0, f64::INFINITY];
    let wrong = Err(BadCamera::DistortionValue { index: 3, value: f64::INFINITY });
    assert_eq!(new([4, 3], [1.0; 2], [1.0; 2], &infinite), wrong);
}
