//! Run time of each stage of the front end, compared with its peer on the same images.
//!
//! `cargo bench -p seafix-vision --bench speed [-- PART-OF-A-NAME]`; see the README in this folder for the
//! requirements. Both programs run in turns. Times are minima over all turns, with the median in brackets, since other
//! programs may disturb a turn. One thread is measured in processor time; two threads, and the gain, by the clock.
//! Seafix runs warm, as in a dive; allocations are counted after two frames, on one thread and on two. Without a peer
//! Seafix is timed alone.

#![allow(clippy::print_stdout, reason = "a bench prints its results")]

mod common;

use std::{alloc::System, time::Instant};

use common::{
    peer::{OPENCV, Peer, SURF},
    scene::stones,
    stages::{Scene, Stage},
};
use cpu_time::ThreadTime;
use seafix_vision::Threads;
use serde_json::Value;

use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATIONS: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// The number of turns of each program.
const TURNS: usize = 9;
/// The minimum time of a turn (ms).
const TURN_MS: f64 = 30.0;

fn main() {
    let filter = std::env::args().skip(1).find(|argument| !argument.starts_with('-')).unwrap_or_default();
    let mut opencv = Peer::from_env(OPENCV, "the comparison with OpenCV 5");
    let mut surf = Peer::from_env(SURF, "the comparison with OpenCV's SURF");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("two threads");

    for peer in [&opencv, &surf].into_iter().flatten() {
        println!("peer: {}, one thread", peer.version);
    }
    let base = opencv.as_mut().map_or_else(|| stones([512, 512]), |peer| peer.photograph("gravel.png"));
    let shown = if opencv.is_some() { "scikit-image's gravel.png" } else { "synthetic stones" };
    println!("images: a tilted plane with {shown}, 8 bit, left and right; load {}", load());
    for size in [[1024, 768], [1600, 1200]] {
        let scene = Scene::new(&base, size, [&mut opencv, &mut surf]);
        println!("\n{}×{}: minimum (median) ms", size[0], size[1]);
        println!(
            "{:<40} {:>17} {:>17} {:>7} {:>17} {:>5} {:>7}  target",
            "stage", "peer", "Seafix, 1 thread", "ratio", "Seafix, 2 threads", "gain", "allocs"
        );
        for mut stage in scene.stages().into_iter().filter(|stage| stage.name.contains(&filter)) {
            let peer = match stage.asks {
                OPENCV => opencv.as_mut(),
                _ => surf.as_mut(),
            };
            measure(&mut stage, peer, &pool);
        }
    }
    println!("\nload {}", load());
}

/// The processor time on one thread, then Seafix's times on one and on two threads by the clock (ms).
#[derive(Default)]
struct Times {
    peer: Vec<f64>,
    ours: Vec<f64>,
    clock: [Vec<f64>; 2],
}

fn measure(stage: &mut Stage<'_>, mut peer: Option<&mut Peer>, pool: &rayon::ThreadPool) {
    let allocations = [Threads::One, Threads::Pool].map(|threads| {
        pool.install(|| {
            (0..2).for_each(|_| (stage.ours)(threads));
            let region = Region::new(ALLOCATIONS);
            (stage.ours)(threads);
            let change = region.change();
            change.allocations + change.reallocations
        })
    });
    // The number of repetitions in a turn, from the time of the first run.
    let repeats = |first: f64| (TURN_MS / first).clamp(1.0, 50.0) as usize;
    let [mut of_peer, mut of_ours] = [1; 2];
    let mut times = Times::default();
    for turn in 0..=TURNS {
        if let Some(peer) = peer.as_mut().filter(|_| !stage.request.is_null()) {
            stage.request["repeats"] = of_peer.into();
            let answer = peer.ask(&stage.request);
            times.peer.extend(answer["ms"].as_array().into_iter().flatten().filter_map(Value::as_f64));
        }
        for (threads, clock) in [Threads::One, Threads::Pool].into_iter().zip(&mut times.clock) {
            pool.install(|| {
                for _ in 0..of_ours {
                    let (start, busy) = (Instant::now(), ThreadTime::now());
                    (stage.ours)(threads);
                    clock.push(start.elapsed().as_secs_f64() * 1e3);
                    if threads == Threads::One {
                        times.ours.push(busy.elapsed().as_secs_f64() * 1e3);
                    }
                }
            });
        }
        if turn == 0 {
            [of_peer, of_ours] = [&times.peer, &times.ours].map(|first| first.first().map_or(1, |&ms| repeats(ms)));
            times = Times::default();
        }
    }
    print(stage, times, allocations);
}

fn print(stage: &Stage<'_>, times: Times, allocations: [usize; 2]) {
    let [peer, one] = [times.peer, times.ours].map(Summary::of);
    let [alone, two] = times.clock.map(Summary::of);
    let ratio = one.min / peer.min;
    let verdict = |met: bool| if met { "met" } else { "MISSED" };
    let mut remarks = Vec::new();
    if let Some(limit) = stage.max_ratio {
        remarks.push(format!("at most {limit:.3}: {}", verdict(ratio <= limit)));
    }
    if let Some(limit) = stage.max_ms {
        remarks.push(format!("at most {limit} ms: {}", verdict(one.min <= limit)));
        remarks.push(format!("{:.1} Hz, on two threads {:.1} Hz", 1e3 / one.min, 1e3 / two.min));
    }
    println!(
        "{:<40} {:>17} {:>17} {:>7.3} {:>17} {:>5.2} {:>7}  {}",
        stage.name,
        peer.to_string(),
        one.to_string(),
        ratio,
        two.to_string(),
        alone.min / two.min,
        format!("{}/{}", allocations[0], allocations[1]),
        remarks.join("; "),
    );
}

struct Summary {
    min: f64,
    median: f64,
}

impl Summary {
    fn of(mut times: Vec<f64>) -> Self {
        times.sort_by(f64::total_cmp);
        let at = |i: usize| times.get(i).copied().unwrap_or(f64::NAN);
        Self { min: at(0), median: at(times.len() / 2) }
    }
}

impl std::fmt::Display for Summary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.min.is_nan() { write!(f, "–") } else { write!(f, "{:.2} ({:.2})", self.min, self.median) }
    }
}

/// The load average of the last minute.
fn load() -> String {
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{} on {processors} processors", load.split(' ').next().unwrap_or("unknown"))
}
