//! The cost of the paper's enumeration against searches that prune: pair tests and times for 5 to 13 points, three
//! candidates each.
//!
//! Generated problems, one thread, a budget of 10⁸ pair tests: `cargo bench -p seafix-proptests --bench enumeration`,
//! some minutes. Points lie anywhere in a box of 2 × 1.5 × 1 m, noise 5 mm, Δ = 3√2 σ. A point's candidates are its
//! image and two others within 0.25 m of it, or three others for an unmeasured point. With every point measured the
//! first sample is the answer; with one unmeasured point the enumeration exhausts all samples of n points before those
//! of n − 1.
//!
//! Each figure is the median of five problems. A strategy that reaches its budget on most of them is marked, and not
//! tested with more points.

#![allow(clippy::print_stdout, reason = "a bench prints")]

use std::{hint::black_box, time::Instant};

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_component::Choice;
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint};
use seafix_referencing::{
    Candidates, Identification, ModelPoint, Prior, PriorBound, Problem, Rejected, SEARCHES, Search, Tolerance,
};

/// Maximum number of pair tests of a strategy.
const BUDGET: i64 = 100_000_000;
/// Number of problems of a median.
const PROBLEMS: u64 = 5;
/// Number of candidates of a point.
const LIST: usize = 3;
/// Standard deviation of a measured coordinate (m).
const SIGMA: f64 = 0.005;
/// Half-size of the gate of the candidates (m).
const GATE: f64 = 0.25;

fn main() {
    let strategies: [(&str, Choice); 6] = [
        ("complete-enumeration", Choice::named("complete-enumeration")),
        ("structural-coherence, permutations", Choice::named("structural-coherence").with("samples", "permutations")),
        ("structural-coherence, combinations", Choice::named("structural-coherence").with("samples", "combinations")),
        ("backtracking", Choice::named("backtracking")),
        ("maximum-clique", Choice::named("maximum-clique")),
        ("rigid-consensus", Choice::named("rigid-consensus")),
    ];
    for hidden in [0, 1] {
        println!("\nUnmeasured points: {hidden}. Pair tests, median time, points found.\n");
        let head: Vec<&str> = strategies.iter().map(|(name, _)| *name).collect();
        println!("| n | {} |\n|---|{}", head.join(" | "), "---|".repeat(head.len()));
        let mut stopped = [None; 6];
        for n in 5..=13 {
            let problems: Vec<Planted> = (0..PROBLEMS).map(|seed| Planted::draw(seed, n, hidden)).collect();
            let cells = strategies.iter().zip(&mut stopped).map(|((_, choice), stopped)| {
                if let Some(at) = stopped {
                    return format!("not run: budget reached at n = {at}");
                }
                let search = SEARCHES.build(&choice.clone().with("budget", BUDGET)).expect("in range");
                match median(&*search, &problems) {
                    Ok(cell) => cell,
                    Err(Rejected::Budget { .. }) => {
                        *stopped = Some(n);
                        "budget reached".to_owned()
                    }
                    Err(why) => why.reason().to_owned(),
                }
            });
            println!("| {n} | {} |", cells.collect::<Vec<_>>().join(" | "));
        }
    }
}

/// The medians over the problems as a cell of the table, or the most frequent failure.
fn median(search: &dyn Search, problems: &[Planted]) -> Result<String, Rejected> {
    let (mut pair_tests, mut times, mut sizes) = (Vec::new(), Vec::new(), Vec::new());
    let mut without = 0;
    for planted in problems {
        match planted.run(search) {
            Ok((spent, size, seconds)) => {
                pair_tests.push(spent);
                sizes.push(size);
                times.push(seconds);
            }
            Err(why) => {
                without += 1;
                if 2 * without > problems.len() {
                    return Err(why);
                }
            }
        }
    }
    // Stopped problems count as slower than any other.
    let middle = problems.len() / 2;
    pair_tests.sort_unstable();
    times.sort_by(f64::total_cmp);
    sizes.sort_unstable();
    let all = if without > 0 { format!(" ({without} without an answer)") } else { String::new() };
    Ok(format!("{}, {}, {}{all}", grouped(pair_tests[middle]), duration(times[middle]), sizes[sizes.len() / 2]))
}

/// A problem with a known solution.
struct Planted {
    model: Vec<ModelPoint>,
    cloud: Vec<MeasuredPoint>,
    candidates: Candidates,
    /// The true pose with its gates, for searches that use a prior.
    prior: Prior,
}

impl Planted {
    fn draw(seed: u64, n: usize, hidden: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut within = |half: Vector3<f64>| half.map(|half| rng.random_range(-half..half));
        let camera_from_object = Transform::<Camera, Object>::exp(&[0.4, -1.1, 0.7, 0.3, -0.2, 4.0].into());
        let (mut model, mut cloud) = (Vec::new(), Vec::new());
        let mut lists = vec![Vec::new(); n];
        for (i, list) in lists.iter_mut().enumerate() {
            let at = Point::<Object>::from(within(Vector3::new(1.0, 0.75, 0.5)));
            model.push(ModelPoint::exact(format!("P{i}"), at));
            let image = camera_from_object * at;
            for place in 0..LIST {
                let measured = place == 0 && i >= hidden;
                // Uniform noise of the stated standard deviation.
                let reach = if measured { SIGMA * 3f64.sqrt() } else { GATE };
                list.push(cloud.len());
                let position = UncertainPoint::isotropic(image + within(Vector3::from_element(reach)), SIGMA);
                cloud.push(MeasuredPoint { position, pixels: None });
            }
        }
        let pairs = lists.iter().enumerate().flat_map(|(i, list)| list.iter().map(move |&j| (i, j)));
        let prior = Prior { object_from_camera: camera_from_object.inverse(), bound: PriorBound::Box(GATE) };
        Self { candidates: Candidates::from_pairs(n, pairs), model, cloud, prior }
    }

    /// Pair tests, points found and seconds (median of some runs).
    fn run(&self, search: &dyn Search) -> Result<(u64, usize, f64), Rejected> {
        let problem = Problem {
            model: &self.model,
            cloud: &self.cloud,
            candidates: &self.candidates,
            tolerance: Tolerance::Fixed(3.0 * 2f64.sqrt() * SIGMA),
            prior: Some(&self.prior),
            edges: Default::default(),
        };
        let mut times = Vec::new();
        loop {
            let start = Instant::now();
            let answer = black_box(search.search(black_box(&problem), &mut ChaCha8Rng::seed_from_u64(0)));
            times.push(start.elapsed().as_secs_f64());
            let Identification { pair_tests, pairs, undecided, .. } = answer?;
            if let Some(why @ Rejected::Budget { .. }) = undecided {
                return Err(why);
            }
            if times.len() == 15 || times.iter().sum::<f64>() > 0.02 {
                times.sort_by(f64::total_cmp);
                return Ok((pair_tests, pairs.len(), times[times.len() / 2]));
            }
        }
    }
}

/// A number with groups of digits: 1234567 as 1 234 567.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let groups: Vec<&str> = digits.as_bytes().rchunks(3).rev().filter_map(|group| str::from_utf8(group).ok()).collect();
    groups.join(" ")
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1e-3 => format!("{:.0} µs", s * 1e6),
        s if s < 1.0 => format!("{:.1} ms", s * 1e3),
        s => format!("{s:.1} s"),
    }
}
