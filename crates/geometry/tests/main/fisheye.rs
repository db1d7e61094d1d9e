//! Equidistant lenses and thin prisms against OpenCV 5.0 (`fisheye.projectPoints`, `projectPoints`).

use nalgebra::{Matrix2x3, UnitQuaternion, Vector3};
use seafix_geometry::{
    BadCamera, Camera, LensModel, Pinhole, Pixel, Point, StereoPixels, StereoRig, Transform, UncertainPixels,
};

const SIZE: [u32; 2] = [848, 806];
const FOCAL: [f64; 2] = [285.7, 286.1];
const CENTRE: [f64; 2] = [419.3, 402.8];
const K: [f64; 4] = [-0.0083, 0.0431, -0.0402, 0.0072];

/// Points up to 76° off the axis, with their pixels in the left and in the right camera.
const SEEN: [([f64; 3], [f64; 2], [f64; 2]); 6] = [
    ([0.034, -0.017, 1.7], [425.0130243125041, 399.93948852676334], [367.9688883866069, 397.89966466008894]),
    ([0.68, 0.51, 1.7], [525.2525942880991, 482.37570150286615], [470.4395007644929, 485.3463757907186]),
    ([-1.87, 1.19, 1.7], [197.67973569932988, 544.0285306631088], [167.4717999086578, 528.4229994500722]),
    ([3.4, -2.55, 1.7], [688.479824657252, 200.63247855852336], [677.466317932173, 199.6142074701893]),
    ([-5.95, 0.34, 1.7], [59.73158718055964, 423.3755333581963], [52.65473537875812, 411.4520181104049]),
    ([0.85, 6.8, 1.7], [464.871207525644, 767.8800832505917], [435.4138012632158, 767.7035218998051]),
];

fn camera() -> Pinhole {
    Pinhole::equidistant(SIZE, FOCAL, CENTRE, &K).unwrap()
}

fn rig() -> StereoRig {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.01, -0.02, 0.03));
    StereoRig::new(camera(), camera(), Transform::new(turn, Vector3::new(-0.31, 0.004, 0.002))).unwrap()
}

fn pixel([u, v]: [f64; 2]) -> Pixel {
    Pixel { u, v }
}

#[test]
fn projection_and_its_inverse_are_opencv_s() {
    assert_eq!(camera().distortion().model(), LensModel::Equidistant);
    for (point, left, right) in SEEN {
        let point = Point::<Camera>::from(Vector3::from(point));
        let seen = rig().project(&point).unwrap();
        assert!(seen.left.distance(&pixel(left)) < 1e-9, "{seen:?}");
        assert!(seen.right.distance(&pixel(right)) < 1e-9, "{seen:?}");
        let direction = camera().normalize(&pixel(left)).unwrap();
        let back = camera().project(&Point::<Camera>::new(direction.x, direction.y, 1.0)).unwrap();
        assert!(back.distance(&pixel(left)) < 1e-9);
        assert!((direction - point.coords.xy() / point.coords.z).norm() < 1e-11 * (1.0 + direction.norm_squared()));
    }
}

#[test]
fn triangulation_meets_the_points() {
    for (point, left, right) in SEEN {
        let pixels = StereoPixels { left: pixel(left), right: pixel(right) };
        let found = rig().triangulate(&UncertainPixels::independent(pixels, 0.2)).unwrap();
        let seen = rig().project(&found.point).unwrap();
        assert!(seen.left.distance(&pixel(left)) < 1e-9 && seen.right.distance(&pixel(right)) < 1e-9, "{seen:?}");
        assert!((found.point.coords - Vector3::from(point)).norm() < 1e-8, "{:?}", found.point);
        assert!(rig().epipolar_distance(&pixels).unwrap() < 1e-9);
    }
}

/// Central differences with steps that are a fraction of the distance.
#[test]
fn the_derivative_is_that_of_the_projection() {
    let prism = Pinhole::new(
        SIZE,
        FOCAL,
        CENTRE,
        &[0.31, -0.12, 1.1e-3, -7e-4, 0.02, 0.28, -0.1, 0.03, 9e-4, -4e-4, -1.2e-3, 3e-4],
    );
    for (camera, count) in [(camera(), 6), (prism.unwrap(), 3)] {
        for (point, ..) in SEEN.iter().take(count).chain(&[([1e-6, 2e-6, 1.0], [0.0; 2], [0.0; 2])]) {
            let point = Point::<Camera>::from(Vector3::from(*point));
            let (_, by_point) = camera.project_with_jacobian(&point).unwrap();
            let columns: Vec<_> = (0..3)
                .map(|axis| {
                    let step = Vector3::ith(axis, 1e-5);
                    let [ahead, behind] = [point + step, point + -step].map(|point| camera.project(&point).unwrap());
                    nalgebra::Vector2::new(ahead.u - behind.u, ahead.v - behind.v) / 2e-5
                })
                .collect();
            let numerical = Matrix2x3::from_columns(&columns);
            assert!((by_point - numerical).amax() < 1e-5 * (1.0 + by_point.amax()), "{by_point} {numerical}");
        }
    }
}

#[test]
fn a_thin_prism_is_opencv_s_and_a_tilted_sensor_rejected() {
    let numbers = [0.31, -0.12, 0.0011, -0.0007, 0.02, 0.28, -0.1, 0.03, 0.0009, -0.0004, -0.0012, 0.0003, 0.0, 0.0];
    let expected = [
        [425.0138285108613, 399.93908587177026],
        [534.2529413706504, 489.1282601517582],
        [117.00131889665533, 595.4920698574532],
    ];
    for count in [12, 14] {
        let camera = Pinhole::new(SIZE, FOCAL, CENTRE, &numbers[..count]).unwrap();
        for ((point, ..), pixel_) in SEEN.iter().zip(expected) {
            let seen = camera.project(&Point::<Camera>::from(Vector3::from(*point))).unwrap();
            assert!(seen.distance(&pixel(pixel_)) < 1e-9, "{seen:?}");
        }
        assert_eq!(camera.distortion().shortest(), &numbers[..12]);
    }
    let tilted = [&numbers[..12], &[0.01, 0.0]].concat();
    assert_eq!(Pinhole::new(SIZE, FOCAL, CENTRE, &tilted), Err(BadCamera::Tilted(0.01, 0.0)));
    assert_eq!(Pinhole::equidistant(SIZE, FOCAL, CENTRE, &[0.1; 5]), Err(BadCamera::EquidistantLength(5)));
}

#[test]
fn a_lens_without_coefficients_is_no_pinhole() {
    let camera = Pinhole::equidistant(SIZE, FOCAL, CENTRE, &[]).unwrap();
    let seen = camera.project(&Point::<Camera>::new(1.0, 0.0, 1.0)).unwrap();
    assert!((seen.u - CENTRE[0] - FOCAL[0] * std::f64::consts::FRAC_PI_4).abs() < 1e-12);
    assert_eq!(camera.distortion().shortest(), &[0.0; 4]);
    let stereo = StereoRig::new(camera, camera, Transform::new(UnitQuaternion::identity(), -Vector3::x())).unwrap();
    assert!(!stereo.is_rectified());
}
