//! Accuracy of the alignment between two views against the Cramér–Rao bound and against its own covariance.
//!
//! `cargo bench -p seafix-vision --bench alignment`
//!
//! Scenes are blurred by a Gaussian of 0.8 px, with a contrast of ±60 grey levels and noise of 0, 2 or 5 grey levels,
//! rounded to 8 bits; the left position and the disparity have random fractions. The bound is √2 σ (Σ w g gᵀ)^(−1/2):
//! both images are noisy, σ² includes rounding (1/12), all pixels of the window have full weight and the scene is
//! known.

#![allow(clippy::print_stdout, reason = "a bench prints its results")]

#[path = "common/random.rs"]
mod random;

use std::f64::consts::PI;

use nalgebra::{Matrix2, UnitQuaternion, Vector2, Vector3};
use seafix_geometry::{Pinhole, Pixel, StereoRig, Transform};
use seafix_vision::{Direct, Image, Pair, Refinement, UncertainPixel, Warp, Weight, ZnccParabola};

use random::Random;

const BLUR: f64 = 0.8;
const CONTRAST: f64 = 60.0;

/// A blurred step from −1 to 1.
fn step(x: f64) -> f64 {
    libm::erf(x / (BLUR * 2f64.sqrt()))
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Kind {
    X,
    L,
    Gravel,
}

/// The brightness around the origin.
struct Scene {
    kind: Kind,
    turn: f64,
    stones: Vec<[f64; 4]>,
}

/// Half the side of the gravel seabed (px).
const SEABED: f64 = 34.0;
/// The spacing of the stones (px).
const SPACING: f64 = 4.5;

impl Scene {
    fn new(kind: Kind, random: &mut Random) -> Self {
        let turn = 2.0 * PI * random.uniform();
        let across = (2.0 * SEABED / SPACING) as usize;
        let stone = |i: usize, random: &mut Random| {
            let [x, y] =
                [i % across, i / across].map(|k| -SEABED + SPACING * (k as f64 + 0.2 + 0.6 * random.uniform()));
            let sign = if random.uniform() < 0.5 { -1.0 } else { 1.0 };
            [x, y, 1.2 + 1.2 * random.uniform(), sign * (0.5 + 0.5 * random.uniform())]
        };
        let stones = (0..across * across).map(|i| stone(i, random)).collect();
        Self { kind, turn, stones }
    }

    fn at(&self, x: f64, y: f64) -> f64 {
        let (sin, cos) = self.turn.sin_cos();
        let (u, v) = (cos * x + sin * y, cos * y - sin * x);
        let value = match self.kind {
            Kind::X => step(u) * step(v),
            Kind::L => 0.5 * (1.0 + step(u)) * (1.0 + step(v)) - 1.0,
            Kind::Gravel => {
                let across = (2.0 * SEABED / SPACING) as isize;
                let [i, j] = [x, y].map(|x| ((x + SEABED) / SPACING).floor() as isize);
                let mut sum = 0.0;
                for j in (j - 1).max(0)..(j + 2).min(across) {
                    for i in (i - 1).max(0)..(i + 2).min(across) {
                        let [cx, cy, radius, value] = self.stones[(j * across + i) as usize];
                        let off = ((x - cx).powi(2) + (y - cy).powi(2)).sqrt();
                        sum += 0.5 * value * (1.0 + step(radius - off));
                    }
                }
                sum.clamp(-1.0, 1.0)
            }
        };
        128.0 + CONTRAST * value
    }
}

const SIDE: usize = 65;

/// The image of the scene; pixel p shows the point map(p).
fn picture(scene: &Scene, map: impl Fn(Vector2<f64>) -> Vector2<f64>, noise: f64, random: &mut Random) -> Image {
    let pixel = |i: usize, random: &mut Random| {
        let place = map(Vector2::new((i % SIDE) as f64, (i / SIDE) as f64));
        let value = scene.at(place.x, place.y) + noise * random.normal();
        value.round().clamp(0.0, 255.0) as f32
    };
    Image::new(SIDE, SIDE, (0..SIDE * SIDE).map(|i| pixel(i, random)).collect()).expect("square")
}

/// The sums over the trials of one row of the table.
#[derive(Default)]
struct Sums {
    count: usize,
    failed: usize,
    squares: f64,
    along: f64,
    bound: f64,
    normalised: f64,
    predicted: f64,
}

fn rig() -> StereoRig {
    let camera = Pinhole::new([SIDE as u32; 2], [500.0; 2], [32.0; 2], &[]).expect("a camera");
    StereoRig::new(camera, camera, Transform::new(UnitQuaternion::identity(), Vector3::new(-0.25, 0.0, 0.0)))
        .expect("a rig")
}

/// The errors of `trials` pairs with this slope of the disparity along each axis.
fn measure(kind: Kind, slope: f64, noise: f64, refinement: &dyn Refinement, window: usize, trials: usize) -> Sums {
    let (mut sums, rig) = (Sums::default(), rig());
    for trial in 0..trials {
        let mut random = Random(trial as u64 * 7919 + 17);
        let scene = Scene::new(kind, &mut random);
        let [du, dv, sx, sy] = [0; 4].map(|_| random.uniform() - 0.5);
        let left_at = Vector2::new(32.0 + du, 32.0 + dv);
        let right_at = Vector2::new(32.0 + sx, 32.0 + sy);
        let tilt = 2.0 * PI * random.uniform();
        // right = right_at + shape · (left − left_at)
        let shape = Matrix2::new(1.0 + slope * tilt.cos(), slope * tilt.sin(), 0.0, 1.0);
        let back = shape.try_inverse().expect("a slope below one");
        let left = picture(&scene, |p| p - left_at, noise, &mut random);
        let right = picture(&scene, |p| back * (p - right_at), noise, &mut random);
        let start = right_at + Vector2::new(random.uniform() - 0.5, random.uniform() - 0.5);
        let pixel = |v: &Vector2<f64>| Pixel { u: v.x, v: v.y };
        let [l, r] = [&left_at, &start].map(|at| UncertainPixel::independent(pixel(at), 0.15));
        sums.count += 1;
        let [pair] = refinement.refine(&[Pair { left: l, right: r }], &left, &right, &rig)[..] else {
            sums.failed += 1;
            continue;
        };
        let error = Vector2::new(pair.at.right.u, pair.at.right.v) - right_at;
        sums.squares += error.norm_squared();
        sums.along += error.x * error.x;
        let common = pair.covariance.fixed_view::<2, 2>(0, 2).into_owned();
        let place = pair.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        let own =
            pair.covariance.fixed_view::<2, 2>(2, 2) - common.transpose() * place.try_inverse().expect("L") * common;
        sums.normalised += (error.transpose() * own.try_inverse().expect("A") * error).x;
        sums.predicted += own.trace();
        let half = (window / 2) as isize;
        let mut information = Matrix2::zeros();
        for y in -half..=half {
            for x in -half..=half {
                let (x, y, h) = (x as f64, y as f64, 1e-3);
                let g = Vector2::new(scene.at(x + h, y) - scene.at(x - h, y), scene.at(x, y + h) - scene.at(x, y - h))
                    / (2.0 * h);
                information += g * g.transpose();
            }
        }
        sums.bound += 2.0 * (noise * noise + 1.0 / 12.0) * information.try_inverse().map_or(f64::NAN, |i| i.trace());
    }
    sums
}

fn main() {
    let trials = std::env::args().filter_map(|a| a.parse().ok()).next().unwrap_or(400);
    println!("scene    slope noise window   warp         weight     RMS px  bound   ratio  predicted  NEES/2  failed");
    let print = |kind: Kind,
                 slope: f64,
                 noise: f64,
                 refinement: &dyn Refinement,
                 window: usize,
                 [warp, weight]: [String; 2]| {
        let sums = measure(kind, slope, noise, refinement, window, trials);
        let n = (sums.count - sums.failed).max(1) as f64;
        let rms = |sum: f64| (sum / (2.0 * n)).sqrt();
        let (error, bound) = (rms(sums.squares), rms(sums.bound));
        println!(
            "{:<8} {slope:5.2} {noise:4.0} {:5}    {:<12} {:<9} {error:.4}  {bound:.4}  {:.3}   {:.4}     {:.2}    {}",
            format!("{kind:?}"),
            window,
            warp,
            weight,
            error / bound,
            rms(sums.predicted),
            sums.normalised / (2.0 * n),
            sums.failed
        );
    };
    let row = |kind: Kind, slope: f64, noise: f64, direct: &Direct| {
        let words = [format!("{:?}", direct.warp), format!("{:?}", direct.weight)];
        print(kind, slope, noise, direct, direct.window, words);
    };
    let moving = Direct { warp: Warp::Translation, ..Direct::default() };
    let uniform = Direct { window: 21, weight: Weight::Uniform, ..moving.clone() };
    for kind in [Kind::X, Kind::L, Kind::Gravel] {
        for noise in [0.0, 2.0, 5.0] {
            for refinement in [&uniform, &moving, &Direct::default()] {
                row(kind, 0.0, noise, refinement);
            }
        }
    }
    for slope in [0.05, 0.15] {
        for warp in [Warp::Translation, Warp::Slanted, Warp::AsSeen, Warp::Affine] {
            row(Kind::Gravel, slope, 2.0, &Direct { warp, ..uniform.clone() });
        }
        for kind in [Kind::X, Kind::L, Kind::Gravel] {
            for warp in [Warp::Translation, Warp::Slanted, Warp::AsSeen] {
                row(kind, slope, 2.0, &Direct { warp, ..Direct::default() });
            }
        }
    }
    row(Kind::X, 0.15, 2.0, &Direct { warp: Warp::Slanted, ..uniform.clone() });
    row(Kind::L, 0.15, 2.0, &Direct { warp: Warp::Slanted, ..uniform.clone() });
    let wide = ZnccParabola { window: 21, ..ZnccParabola::default() };
    for parabola in [&wide, &ZnccParabola::default()] {
        let words = || ["parabola".to_owned(), "Uniform".to_owned()];
        for kind in [Kind::X, Kind::L, Kind::Gravel] {
            for noise in [0.0, 2.0, 5.0] {
                print(kind, 0.0, noise, parabola, parabola.window, words());
            }
        }
        for slope in [0.05, 0.15] {
            print(Kind::Gravel, slope, 2.0, parabola, parabola.window, words());
        }
    }
}
