//! The stages, and the requests to their peers.

use seafix_component::{Choice, Registry};
use seafix_geometry::{Pixel, StereoRig};
use seafix_vision::{
    DESCRIPTORS, DETECTORS, Descriptors, Direct, FrontEnd, FrontEndOutput, Image, Keypoint, LOCATORS, MATCHERS, Match,
    Matcher, Optimal, Pair, Refinement, Table, Threads, UncertainPixel, View, Warp, Workspace,
};
use serde_json::{Value, json};

use super::{
    peer::{OPENCV, Peer, SURF, floats},
    scene,
};

/// The number of points of an image.
pub(crate) const COUNT: usize = 1000;

/// A stage of the front end.
pub(crate) struct Stage<'a> {
    pub(crate) name: &'static str,
    /// The environment variable of the peer.
    pub(crate) asks: &'static str,
    /// The request to the peer; null if the peer has no equivalent.
    pub(crate) request: Value,
    /// The maximum ratio of Seafix's time to the peer's.
    pub(crate) max_ratio: Option<f64>,
    /// The maximum time of Seafix (ms).
    pub(crate) max_ms: Option<f64>,
    /// The stage of Seafix.
    pub(crate) ours: Box<dyn FnMut(Threads) + Send + 'a>,
}

/// The standard deviation of OpenCV's window, which is 3 px wide (px).
const BLOCK: f64 = 0.82;

/// Two images with their features.
pub(crate) struct Scene {
    images: [Image; 2],
    rig: StereoRig,
    keypoints: [Vec<Keypoint>; 2],
    /// Matches a few tenths of a pixel from the truth.
    matches: Vec<Match>,
    /// Descriptors of many more points; they are synthetic, since their values do not affect the time.
    large_sets: [[Descriptors; 2]; 2],
}

const LARGE: [usize; 2] = [1000, 3000];

/// The component, if it is registered with these settings.
fn listed<T: ?Sized>(registry: &'static Registry<T>, choice: &Choice) -> Option<Box<T>> {
    registry.build(choice).ok()
}

/// Runs with separate memory for one thread and for the pool.
fn with_memory<'a>(mut run: impl FnMut(&mut Workspace) + Send + 'a) -> Box<dyn FnMut(Threads) + Send + 'a> {
    let mut memory = [Threads::One, Threads::Pool].map(Workspace::new);
    Box::new(move |threads| run(&mut memory[usize::from(threads == Threads::Pool)]))
}

/// Distinct unit vectors.
fn unit_vectors(count: usize, seed: u32) -> Vec<f32> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0 - 0.5
    };
    let rows = (0..count).flat_map(|_| {
        let row: [f32; 64] = std::array::from_fn(|_| next());
        let norm = row.iter().map(|x| x * x).sum::<f32>().sqrt();
        row.map(|x| x / norm)
    });
    rows.collect()
}

impl Scene {
    /// The images, stored in the peers as `left` and `right`.
    pub(crate) fn new(base: &Image, size: [usize; 2], peers: [&mut Option<Peer>; 2]) -> Self {
        let images = scene::stereo(base, size, size[0] as f64 / 1024.0);
        let rig = scene::rig(size);
        let harris = Choice::named("harris").with("features", COUNT as i64);
        let harris = DETECTORS.build(&harris).expect("a detector");
        let keypoints = [0, 1].map(|i| harris.detect(&images[i]));
        let right_from_left = scene::right_from_left(&rig);
        let aside = |i: usize| [0.6, -0.4, 0.3, -0.7, 0.1][i % 5];
        let there = keypoints[0].iter().map(|keypoint| scene::map(&right_from_left, keypoint.at));
        let right = there.enumerate().map(|(i, p)| Pixel { u: p.u + aside(i), v: p.v + aside(i + 2) });
        let matches = right.enumerate().map(|(left, right)| Match { left, right, distance: 0.0 }).collect();
        let values = LARGE.map(|count| [1, 2].map(|seed| unit_vectors(count, seed)));
        for peer in peers.into_iter().flatten() {
            peer.keep("left", &images[0]);
            peer.keep("right", &images[1]);
            for (count, pair) in LARGE.iter().zip(&values) {
                for (side, values) in ["a", "b"].iter().zip(pair) {
                    peer.keep_table(&format!("{side}{count}"), *count, values);
                }
            }
        }
        let large_sets = values.map(|pair| pair.map(|values| Descriptors::Numbers(Table::new(64, values))));
        Self { images, rig, keypoints, matches, large_sets }
    }

    /// All stages with a component of Seafix.
    pub(crate) fn stages(&self) -> Vec<Stage<'_>> {
        let mut stages = Vec::new();
        stages.extend(self.detectors());
        stages.extend(self.features());
        stages.extend(self.given());
        stages.extend(self.matchers());
        stages.extend(self.refinement());
        stages.extend(self.pairs());
        stages
    }

    fn detectors(&self) -> Vec<Stage<'_>> {
        let features = COUNT as i64;
        let corners = |harris: bool| json!({"do": "corners", "image": "left", "count": COUNT, "harris": harris});
        let named = |name: &str| Choice::named(name).with("features", features);
        let plain = |name: &str| named(name).with("window", "box").with("sigma", BLOCK).with("selection", "strongest");
        // OpenCV's criterion: every pixel that is stronger than its eight neighbours.
        let every_fast = Choice::named("fast").with("radius", 1).with("subpixel", false).with("features", 1_000_000);
        let list = [
            ("Harris, NMS, top 1000", plain("harris"), corners(true), Some(0.4)),
            ("Harris by default: Gaussian, balanced", named("harris"), corners(true), None),
            ("Shi-Tomasi, NMS, top 1000", plain("shi-tomasi"), corners(false), None),
            (
                "FAST, every corner of threshold 20",
                every_fast,
                json!({"do": "fast", "image": "left", "threshold": 20}),
                None,
            ),
        ];
        let stages = list.into_iter().filter_map(|(name, choice, request, max_ratio)| {
            let detector = listed(&DETECTORS, &choice)?;
            let mut found = Vec::new();
            let ours = with_memory(move |work| detector.detect_into(&self.images[0], work, &mut found));
            Some(Stage { name, asks: OPENCV, request, max_ratio, max_ms: None, ours })
        });
        stages.collect()
    }

    /// Detection and description in one.
    fn features(&self) -> Vec<Stage<'_>> {
        let features = |kind: &str| json!({"do": "features", "image": "left", "kind": kind, "count": COUNT});
        let surf = |upright: bool| {
            let mut request = features("surf");
            request["upright"] = upright.into();
            request
        };
        let detect = |name: &str| Choice::named(name).with("features", COUNT as i64);
        let own = Choice::named("surf").with("scale", 0.0);
        let list = [
            ("SURF upright, detect and describe", SURF, surf(true), "surf", own.clone(), Some(0.25)),
            ("SURF rotated, detect and describe", SURF, surf(false), "surf", own.with("upright", false), Some(0.25)),
            (
                "SIFT, detect and describe",
                OPENCV,
                features("sift"),
                "dog",
                Choice::named("sift").with("upright", false),
                None,
            ),
            ("ORB, detect and describe", OPENCV, features("orb"), "fast", Choice::named("orb"), None),
        ];
        let stages = list.into_iter().filter_map(|(name, asks, request, detects, describes, max_ratio)| {
            let (detector, descriptor) = (listed(&DETECTORS, &detect(detects))?, listed(&DESCRIPTORS, &describes)?);
            let (mut found, mut described) = (Vec::new(), Descriptors::default());
            let ours = with_memory(move |work| {
                detector.detect_into(&self.images[0], work, &mut found);
                descriptor.describe_into(&self.images[0], &found, work, &mut described);
            });
            Some(Stage { name, asks, request, max_ratio, max_ms: None, ours })
        });
        stages.collect()
    }

    /// Description at given corners.
    fn given(&self) -> Vec<Stage<'_>> {
        let rows = self.keypoints[0].iter().flat_map(|k| [k.at.u as f32, k.at.v as f32, 11.25, -1.0, 1.0]);
        let rows: Vec<f32> = rows.collect();
        let request = |upright: bool| {
            let keypoints = floats(&[rows.len() / 5, 5], &rows);
            json!({"do": "describe", "image": "left", "upright": upright, "keypoints": keypoints})
        };
        let list = [
            ("SURF upright at 1000 corners", Choice::named("surf"), request(true), Some(0.5)),
            ("SURF rotated at 1000 corners", Choice::named("surf").with("upright", false), request(false), None),
        ];
        let stages = list.into_iter().filter_map(|(name, choice, request, max_ratio)| {
            let descriptor = listed(&DESCRIPTORS, &choice)?;
            let mut described = Descriptors::default();
            let ours = with_memory(move |work| {
                descriptor.describe_into(&self.images[0], &self.keypoints[0], work, &mut described);
            });
            Some(Stage { name, asks: SURF, request, max_ratio, max_ms: None, ours })
        });
        stages.collect()
    }

    /// The two nearest neighbours of each descriptor, by the matcher without geometry.
    ///
    /// The matcher also works in the other direction and applies the ratio test.
    fn matchers(&self) -> Vec<Stage<'_>> {
        let names = ["2-NN, 64 floats, 1000²", "2-NN, 64 floats, 3000²"];
        let stages = names.into_iter().enumerate().map(|(i, name)| {
            let choice = Choice::named("mutual-ratio");
            let matcher: Box<dyn Matcher> = MATCHERS.build(&choice).expect("a matcher");
            let count = LARGE[i];
            let keypoints = [vec![self.keypoints[0][0]; count], vec![self.keypoints[1][0]; count]];
            let mut found = Vec::new();
            let ours = with_memory(move |work| {
                let view = |side: usize| View {
                    image: &self.images[side],
                    keypoints: &keypoints[side],
                    descriptors: &self.large_sets[i][side],
                };
                matcher.match_into(&view(0), &view(1), &self.rig, work, &mut found);
            });
            let request = json!({"do": "nearest_two", "a": format!("a{count}"), "b": format!("b{count}")});
            Stage { name, asks: OPENCV, request, max_ratio: Some(1.0 / 3.0), max_ms: None, ours }
        });
        stages.collect()
    }

    fn refinement(&self) -> Vec<Stage<'_>> {
        let flat = |at: &mut dyn Iterator<Item = Pixel>| {
            let values: Vec<f32> = at.flat_map(|p| [p.u as f32, p.v as f32]).collect();
            floats(&[values.len() / 2, 1, 2], &values)
        };
        let points = flat(&mut self.matches.iter().map(|m| self.keypoints[0][m.left].at));
        let guess = flat(&mut self.matches.iter().map(|m| m.right));
        let aside = json!({"do": "lucas_kanade", "points": points, "guess": guess, "window": 21});
        let nothing = json!({"do": "lucas_kanade", "points": points, "window": 21});
        let wide = || Direct { window: 21, warp: Warp::Translation, ..Direct::default() };
        let list = [
            ("refine 1000, window 21; LK from zero flow", wide(), nothing.clone(), Some(1.0 / 3.0)),
            ("refine 1000, window 21; LK from matches", wide(), aside, None),
            ("refine 1000, default; LK from zero flow", Direct::default(), nothing.clone(), None),
            (
                "refine 1000, translation; LK from zero flow",
                Direct { warp: Warp::Translation, ..Direct::default() },
                nothing,
                None,
            ),
        ];
        let stages = list.into_iter().map(|(name, refinement, request, max_ratio)| {
            let mut pixels = Vec::new();
            let pair = |found: &Match| Pair {
                left: UncertainPixel::independent(self.keypoints[0][found.left].at, 0.15),
                right: UncertainPixel::independent(found.right, 0.15),
            };
            let pairs: Vec<Pair> = self.matches.iter().map(pair).collect();
            let ours = with_memory(move |work| {
                refinement.refine_into(&pairs, &self.images[0], &self.images[1], &self.rig, work, &mut pixels);
            });
            Stage { name, asks: OPENCV, request, max_ratio, max_ms: None, ours }
        });
        stages.collect()
    }

    fn pairs(&self) -> Vec<Stage<'_>> {
        let [focal, _] = self.rig.left().focal();
        let [cx, cy] = self.rig.left().principal();
        let projection = |shift: f64| {
            let values = [focal, 0.0, cx, -shift, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0].map(|x| x as f32);
            floats(&[3, 4], &values)
        };
        let projections = [projection(0.0), projection(focal * self.rig.baseline())];
        let limit = if self.images[0].width() > 1024 { 40.0 } else { 25.0 };
        // The peer's stages, then those of the default pipeline, which locates every corner first.
        let list = [("stereo pair, the peer's stages", "peak"), ("stereo pair, the default pipeline", "corner")];
        let stages = list.into_iter().map(|(name, locator)| {
            let harris = Choice::named("harris").with("features", COUNT as i64);
            let front_end = FrontEnd {
                filters: Vec::new(),
                detector: listed(&DETECTORS, &harris).expect("a detector"),
                descriptor: listed(&DESCRIPTORS, &Choice::named("surf")).expect("a descriptor"),
                matcher: MATCHERS.build(&Choice::named("epipolar-band")).expect("a matcher"),
                locator: LOCATORS.build(&Choice::named(locator)).expect("a locator"),
                refinement: Box::new(Direct::default()),
                triangulator: Box::new(Optimal::default()),
            };
            let mut outputs = [Threads::One, Threads::Pool].map(FrontEndOutput::new);
            Stage {
                name,
                asks: SURF,
                request: json!({"do": "pair", "count": COUNT, "projections": projections}),
                max_ratio: None,
                max_ms: Some(limit),
                ours: Box::new(move |threads| {
                    let output = &mut outputs[usize::from(threads == Threads::Pool)];
                    front_end.run(&self.images[0], &self.images[1], &self.rig, output);
                }),
            }
        });
        stages.collect()
    }
}
