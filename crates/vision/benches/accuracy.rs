//! Accuracy of corner localisation: synthetic corners at random positions and angles against the Cramér–Rao bound.
//!
//! `cargo bench -p seafix-vision --bench accuracy` prints a table of errors and, at its end, run times. The images are
//! integrated numerically, not by the model that is fitted.

#![allow(clippy::print_stdout, reason = "a bench prints its results")]

#[path = "common/random.rs"]
mod random;

use cpu_time::ThreadTime;
use nalgebra::{SMatrix, SVector};
use seafix_geometry::Pixel;
use seafix_vision::{
    Corner, CornerFit, Detector, Harris, Image, Junction, Keypoint, LCorner, Locator, Workspace, XCorner,
};

use random::Random;

/// The standard deviation of the blur (px).
const BLUR: f64 = 0.8;
/// Half the contrast (grey levels).
const CONTRAST: f64 = 60.0;
/// The standard deviations of the noise (grey levels).
const NOISES: [f64; 3] = [0.0, 2.0, 5.0];
const CORNERS: usize = 200;
const SIDE: usize = 31;
/// The side of the square window of the bound (px).
const WINDOW: usize = 11;
/// The error (px) from which on a result counts as a failure and not as an inaccuracy.
const FAILED: f64 = 1.0;

/// The centre, the directions of two normals, blur, dark level, and contrast.
type Parameters = [f64; 7];

fn main() {
    // `cargo test` runs benches too; a few corners suffice there.
    let count = if std::env::args().any(|argument| argument == "--bench") { CORNERS } else { 4 };
    println!(
        "{count} corners, blur {BLUR} px, contrast ±{CONTRAST}, 8 bit; RMS px an axis (NEES/2, failures) for noise {NOISES:?}"
    );
    let [x, l]: [&dyn Locator; 2] = [&XCorner::default(), &LCorner::default()];
    let wide = CornerFit { window: 13, ..CornerFit::default() };
    let all: [(&str, &dyn Locator); 5] = [
        ("own", x),
        ("own", l),
        ("corner", &Corner::default()),
        ("corner 13", &Corner(wide)),
        ("junction", &Junction::default()),
    ];
    for chequer in [true, false] {
        let mut random = Random(17);
        let scenes: Vec<(Parameters, Vec<f64>)> = (0..count)
            .map(|_| {
                let at = [15.0 + random.uniform() - 0.5, 15.0 + random.uniform() - 0.5];
                let first = std::f64::consts::TAU * random.uniform();
                // The angle inside a wedge is π less that between the normals.
                let second = first + (60.0 + 60.0 * random.uniform()).to_radians();
                let scene = [at[0], at[1], first, second, BLUR, 128.0 - CONTRAST, 2.0 * CONTRAST];
                (scene, pixels(&scene, chequer, 0, 0, SIDE))
            })
            .collect();
        println!("\n{}", if chequer { "X corner" } else { "L corner" });
        for (known, name) in [(false, "bound"), (true, "bound, blur known")] {
            let information: Vec<f64> = scenes.iter().map(|(scene, _)| bound(scene, chequer, known)).collect();
            let unit = (information.iter().sum::<f64>() / information.len() as f64).sqrt();
            let row: Vec<String> =
                NOISES.map(|noise| format!("{:.4}", unit * (noise * noise + 1.0 / 12.0).sqrt())).into();
            println!("{name:<20} {}", row.join("            "));
        }
        let mut rows: Vec<(&str, Vec<String>)> = vec![("harris", Vec::new())];
        rows.extend(all.iter().map(|(name, _)| (*name, Vec::new())));
        for noise in NOISES {
            let images: Vec<Image> = scenes
                .iter()
                .map(|(_, clean)| {
                    let value = |v: &f64| (v + noise * random.normal()).round().clamp(0.0, 255.0) as f32;
                    Image::new(SIDE, SIDE, clean.iter().map(value).collect()).expect("a square")
                })
                .collect();
            let starts: Vec<Option<Keypoint>> =
                images.iter().zip(&scenes).map(|(image, (scene, _))| harris(image, scene)).collect();
            let mut tallies = vec![Tally::default(); rows.len()];
            for ((image, start), (scene, _)) in images.iter().zip(&starts).zip(&scenes) {
                let Some(start) = start else {
                    tallies.iter_mut().for_each(|tally| tally.failures += 1);
                    continue;
                };
                tallies[0].add(scene, start.at, None);
                for (tally, (_, locator)) in tallies[1..].iter_mut().zip(&all) {
                    match locator.locate(image, &[*start])[0] {
                        Some(place) => tally.add(scene, place.at, Some(place.covariance)),
                        None => tally.failures += 1,
                    }
                }
            }
            rows.iter_mut().zip(tallies).for_each(|((_, row), tally)| row.push(tally.row()));
        }
        for (i, (name, row)) in rows.iter().enumerate() {
            if i != if chequer { 2 } else { 1 } {
                println!("{name:<18} {}", row.join(" "));
            }
        }
        let image = Image::new(SIDE, SIDE, scenes[0].1.iter().map(|v| v.round() as f32).collect()).expect("a square");
        let start = harris(&image, &scenes[0].0).expect("a corner");
        let points = vec![start; 1000];
        let mut work = Workspace::default();
        let mut places = Vec::new();
        for (name, locator) in &all {
            let mut min = f64::INFINITY;
            for _ in 0..9 {
                let begin = ThreadTime::now();
                locator.locate_into(&image, &points, &mut work, &mut places);
                min = min.min(begin.elapsed().as_secs_f64() * 1e3);
            }
            println!("1000 × {name}: {min:.2} ms on one thread");
        }
    }
}

/// Sums of squared errors.
#[derive(Debug, Clone, Default)]
struct Tally {
    count: usize,
    failures: usize,
    squares: f64,
    normalized: f64,
}

impl Tally {
    fn add(&mut self, scene: &Parameters, at: Pixel, covariance: Option<nalgebra::Matrix2<f64>>) {
        let error = nalgebra::Vector2::new(at.u - scene[0], at.v - scene[1]);
        if covariance.is_some() && error.norm() > FAILED {
            self.failures += 1;
            return;
        }
        self.count += 1;
        self.squares += error.norm_squared();
        if let Some(inverse) = covariance.and_then(|covariance| covariance.try_inverse()) {
            self.normalized += error.dot(&(inverse * error));
        }
    }

    fn row(&self) -> String {
        let count = 2.0 * self.count as f64;
        format!("{:.4} ({:4.2}, {:3})", (self.squares / count).sqrt(), self.normalized / count, self.failures)
    }
}

/// The Harris corner nearest to the truth.
fn harris(image: &Image, scene: &Parameters) -> Option<Keypoint> {
    let truth = Pixel { u: scene[0], v: scene[1] };
    let found = Harris::default().detect(image);
    let near = found.into_iter().filter(|found| found.at.distance(&truth) < 4.0);
    near.min_by(|a, b| a.at.distance(&truth).total_cmp(&b.at.distance(&truth)))
}

/// The Cramér–Rao bound of a coordinate of the centre (px², the mean of both) for noise of one grey level.
///
/// It is the inverse information of all seven parameters, or of six with the blur known.
fn bound(scene: &Parameters, chequer: bool, blur_known: bool) -> f64 {
    let corner = |x: f64| x.round() as usize - WINDOW / 2;
    let (left, top) = (corner(scene[0]), corner(scene[1]));
    let derivative = |parameter: usize| {
        let moved = |by: f64| {
            let mut scene = *scene;
            scene[parameter] += by;
            pixels(&scene, chequer, left, top, WINDOW)
        };
        let (less, more) = (moved(-0.01), moved(0.01));
        more.iter().zip(&less).map(|(a, b)| (a - b) / 0.02).collect::<Vec<f64>>()
    };
    let columns: Vec<Vec<f64>> = (0..7).map(derivative).collect();
    let dot = |i: usize, j: usize| columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum::<f64>();
    let mut information = SMatrix::<f64, 7, 7>::from_fn(dot);
    if blur_known {
        information.set_row(4, &SVector::<f64, 7>::zeros().transpose());
        information.set_column(4, &SVector::<f64, 7>::zeros());
        information[(4, 4)] = 1.0;
    }
    let covariance = information.try_inverse().expect("a corner determines all parameters");
    0.5 * (covariance[(0, 0)] + covariance[(1, 1)])
}

/// A square of pixels of the blurred corner.
///
/// The bright intervals on each line across the Gaussian are integrated exactly, the lines by the trapezoidal rule.
fn pixels(scene: &Parameters, chequer: bool, left: usize, top: usize, side: usize) -> Vec<f64> {
    let [cx, cy, first, second, blur, dark, difference] = *scene;
    // The lines lie between the two normals, so that both edges intersect them at a large angle.
    let turn = 0.5 * (first + second);
    let normals = [first - turn, second - turn].map(|angle| [angle.cos(), angle.sin()]);
    const LINES: i32 = 60;
    let step = 6.0 / f64::from(LINES);
    let below = |x: f64| 0.5 * libm::erfc(-x / std::f64::consts::SQRT_2);
    let pixel = |i: usize| {
        let (dx, dy) = ((left + i % side) as f64 - cx, (top + i / side) as f64 - cy);
        let (x, y) = (turn.cos() * dx + turn.sin() * dy, turn.cos() * dy - turn.sin() * dx);
        let (mut lit, mut all) = (0.0, 0.0);
        for line in -LINES..=LINES {
            let v = step * f64::from(line);
            let weight = (-0.5 * v * v).exp();
            // Along the line u, n₀(x + su) + n₁(y + sv) > 0 holds from, or up to, the intersection with the edge.
            let cuts = normals.map(|n| -(n[0] * x + n[1] * (y + blur * v)) / (n[0] * blur));
            let side =
                |k: usize| if normals[k][0] > 0.0 { (cuts[k], f64::INFINITY) } else { (f64::NEG_INFINITY, cuts[k]) };
            let ((a0, a1), (b0, b1)) = (side(0), side(1));
            let mass = |from: f64, to: f64| if to > from { below(to) - below(from) } else { 0.0 };
            let both = mass(a0.max(b0), a1.min(b1));
            let fraction = if chequer { 1.0 - mass(a0, a1) - mass(b0, b1) + 2.0 * both } else { both };
            lit += weight * fraction;
            all += weight;
        }
        dark + difference * lit / all
    };
    (0..side * side).map(pixel).collect()
}
