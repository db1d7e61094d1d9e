//! Properties of all matchers, on rigs of any kind, with numbers and bits.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_component::Choice;
use seafix_geometry::{Pinhole, Pixel, Point, StereoPixels, StereoRig, Transform};
use seafix_vision::{Descriptors, Image, Keypoint, MATCHERS, Match, Matcher, Sides, Table, Threads, View, Workspace};

fn numbers(seed: u32) -> impl FnMut() -> f32 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    }
}

const SIZE: usize = 320;

/// Rigs side by side, vertical, and one camera ahead of the other, rotated, with lens distortion.
fn rigs() -> [StereoRig; 3] {
    let rig = |step: Vector3<f64>, turn: Vector3<f64>, lens: &[f64]| {
        let camera = Pinhole::new([SIZE as u32; 2], [200.0, 201.0], [159.0, 161.0], lens).expect("a valid camera");
        let rotation = UnitQuaternion::from_scaled_axis(turn);
        StereoRig::new(camera, camera, Transform::new(rotation, rotation * -step)).expect("a valid rig")
    };
    [
        rig(Vector3::new(0.25, 0.0, 0.0), Vector3::zeros(), &[]),
        rig(Vector3::new(0.01, 0.3, 0.02), Vector3::new(0.02, -0.02, 0.05), &[-0.1, 0.02, 1e-3, 0.0]),
        rig(Vector3::new(0.05, 0.02, 0.3), Vector3::new(0.0, 0.01, 0.02), &[0.05, 0.0, 0.0, 1e-3]),
    ]
}

/// One camera's part of a scene: image, key points, descriptors as numbers and as bits.
struct Seen {
    image: Image,
    keypoints: Vec<Keypoint>,
    patterns: [Descriptors; 2],
}

impl Seen {
    fn view(&self, kind: usize) -> View<'_> {
        View { image: &self.image, keypoints: &self.keypoints, descriptors: &self.patterns[kind] }
    }
}

/// The two views of `n` points on a smooth surface, in reverse order on the right.
///
/// Each point is a spot with its own pattern in both images.
fn scene(rig: &StereoRig, n: usize) -> [Seen; 2] {
    let mut next = numbers(17);
    let mut seen: Vec<StereoPixels> = Vec::new();
    for _ in 0..100 * n {
        let (x, y) = (f64::from(next()) * 1.6 - 0.8, f64::from(next()) * 1.6 - 0.8);
        let z = 2.0 + 0.2 * x;
        let Some(pixels) = rig.sees(&Point::new(x * z, y * z, z), 12.0) else { continue };
        if seen.len() < n && seen.iter().all(|other| other.left.distance(&pixels.left) > 14.0) {
            seen.push(pixels);
        }
    }
    let spots: Vec<Vec<f32>> = seen.iter().map(|_| (0..16).map(|_| 100.0 * (next() - 0.5)).collect()).collect();
    let patterns: Vec<Vec<f32>> = seen.iter().map(|_| (0..24).map(|_| next() - 0.5).collect()).collect();
    let mut side = |right: bool| {
        let at = |i: usize| if right { seen[i].right } else { seen[i].left };
        let order: Vec<usize> = if right { (0..seen.len()).rev().collect() } else { (0..seen.len()).collect() };
        let mut values = vec![100.0_f32; SIZE * SIZE];
        for (i, spot) in spots.iter().enumerate() {
            for (v, u) in (-7..=7).flat_map(|v| (-7..=7).map(move |u| (v, u))) {
                let (x, y) = (at(i).u.round() as i32 + u, at(i).v.round() as i32 + v);
                let place = y as usize * SIZE + x as usize;
                values[place] = 100.0 + spot[((v + 7) / 4 * 4 + (u + 7) / 4) as usize];
            }
        }
        let keypoints = order.iter().map(|&i| Keypoint { at: at(i), response: 1.0, scale: 1.0 }).collect();
        let noisy: Vec<f32> = order
            .iter()
            .flat_map(|&i| {
                let descriptor: Vec<f32> = patterns[i].iter().map(|x| x + 0.15 * (next() - 0.5)).collect();
                let length = descriptor.iter().map(|x| x * x).sum::<f32>().sqrt();
                descriptor.into_iter().map(move |x| x / length)
            })
            .collect();
        let bits = noisy.iter().map(|x| if *x > 0.0 { 0xFFFF_FFFF_u64 << 16 } else { 0 }).collect();
        let patterns = [Descriptors::Numbers(Table::new(24, noisy)), Descriptors::Bits(Table::new(24, bits))];
        Seen { image: Image::new(SIZE, SIZE, values).expect("an image"), keypoints, patterns }
    };
    [side(false), side(true)]
}

fn every(mut law: impl FnMut(&str, &dyn Matcher)) {
    for listing in MATCHERS.listings() {
        law(listing.name, &*MATCHERS.build(&Choice::named(listing.name)).expect("the defaults"));
    }
}

/// The matchers that search the right image and ignore its key points.
const PLACES: [&str; 2] = ["lucas-kanade", "zncc-band"];

/// The index of the key point within a pixel of a position.
fn index(keypoints: &[Keypoint], at: Pixel) -> Option<usize> {
    keypoints.iter().position(|keypoint| keypoint.at.distance(&at) < 1.0)
}

fn bits(found: &[Match]) -> Vec<(usize, u64, u64, u32)> {
    found.iter().map(|m| (m.left, m.right.u.to_bits(), m.right.v.to_bits(), m.distance.to_bits())).collect()
}

/// Every matcher finds most points of an easy scene and no wrong one, each once, in the order of the left key points.
///
/// Seen to fail when the epipolar line is taken from the wrong side.
#[test]
fn points_are_found_once_and_in_order() {
    for rig in rigs() {
        let [l, r] = scene(&rig, 60);
        for kind in 0..2 {
            every(|name, matcher| {
                let found = matcher.matches(&l.view(kind), &r.view(kind), &rig);
                assert!(found.len() * 10 >= l.keypoints.len() * 8, "{name} {kind}: {}", found.len());
                assert!(found.is_sorted_by(|a, b| a.left < b.left), "{name}: a left key point twice, or not in order");
                for (index, pair) in found.iter().enumerate() {
                    assert!(
                        found[..index].iter().all(|other| other.right != pair.right),
                        "{name}: a right pixel twice"
                    );
                    let seen = StereoPixels { left: l.keypoints[pair.left].at, right: pair.right };
                    assert!(rig.epipolar_distance(&seen).unwrap() < 1.0, "{name}");
                }
                let last = l.keypoints.len() - 1;
                let right = found.iter().filter(|pair| index(&r.keypoints, pair.right) == Some(last - pair.left));
                let wrong = found.len() - right.count();
                let may_be = if PLACES.contains(&name) { found.len() / 20 } else { 0 };
                assert!(wrong <= may_be, "{name} {kind}: {wrong} are wrong");
            });
        }
    }
}

/// P54. Exchanging the images and the rig gives the same pairs.
///
/// Seen to fail when the second side of the mutual test is skipped.
#[test]
fn left_to_right_to_left_returns_the_same_pairs() {
    for rig in rigs() {
        let [l, r] = scene(&rig, 60);
        let back = rig.exchanged();
        for listing in MATCHERS.listings().iter().filter(|listing| !PLACES.contains(&listing.name)) {
            // Support uses the neighbours of left key points and is the only asymmetric part.
            let alone = Choice::named(listing.name).with("neighbours", 0).with("ratio", 1.0);
            let alone = alone.with("max-distance", 2.0).with("max-hamming", 1.0);
            // Depth is that of the left camera; only its sign is the same for both.
            let alone = alone.with("min-depth", 0.0).with("max-depth", 1e9);
            let matcher = MATCHERS.build(&alone).or_else(|_| MATCHERS.build(&Choice::named(listing.name))).unwrap();
            for kind in 0..2 {
                // The descriptors of other points: each left one has a nearest, few are mutual.
                let shuffled = View { descriptors: &l.patterns[kind], ..r.view(kind) };
                let there = matcher.matches(&l.view(kind), &shuffled, &rig);
                let there: Vec<_> = there.iter().map(|m| (m.left, index(&r.keypoints, m.right).unwrap())).collect();
                let again = matcher.matches(&shuffled, &l.view(kind), &back);
                let mut again: Vec<_> = again.iter().map(|m| (index(&l.keypoints, m.right).unwrap(), m.left)).collect();
                again.sort_unstable();
                assert_eq!(there, again, "{}", listing.name);
            }
        }
    }
}

/// Results are bit-identical on one thread or many, with a new or a used workspace.
///
/// Seen to fail when the nearest neighbours of the previous pair remain.
#[test]
fn threads_and_memory_change_no_bit() {
    let [first, second, _] = rigs();
    let mut kept = [Workspace::new(Threads::One), Workspace::new(Threads::Pool)];
    for (rig, n) in [(&first, 60), (&second, 33), (&first, 48), (&second, 1), (&first, 60)] {
        let [l, r] = scene(rig, n);
        for kind in 0..2 {
            every(|name, matcher| {
                let fresh = matcher.matches(&l.view(kind), &r.view(kind), rig);
                for work in &mut kept {
                    let mut found = vec![Match { left: 7, right: Pixel { u: 0.0, v: 0.0 }, distance: 0.0 }];
                    matcher.match_into(&l.view(kind), &r.view(kind), rig, work, &mut found);
                    assert_eq!(bits(&found), bits(&fresh), "{name}");
                }
            });
        }
    }
}

/// Without key points there is no match, and a single one gives at most one.
///
/// Key points outside the range of the lens model do not match, nor do descriptors of different kinds or lengths. Seen
/// to fail when every key point is assumed to have a nearest one.
#[test]
fn few_points_and_none() {
    let [rig, ..] = rigs();
    let [l, r] = scene(&rig, 40);
    for kind in 0..2 {
        let none = Seen { keypoints: Vec::new(), ..scene(&rig, 0).into_iter().next().unwrap() };
        let [one, other] = scene(&rig, 1);
        let mut lost = scene(&rig, 1).into_iter().next().unwrap();
        lost.keypoints[0].at = Pixel { u: f64::NAN, v: 1e300 };
        every(|name, matcher| {
            let count = |l: &Seen, r: &Seen| matcher.matches(&l.view(kind), &r.view(kind), &rig).len();
            assert_eq!((count(&l, &none), count(&none, &r), count(&none, &none)), (0, 0, 0), "{name}");
            assert_eq!(count(&one, &other), 1, "{name}");
            assert!(count(&l, &other) <= 1 && count(&one, &r) <= 1, "{name}");
            if name != "mutual-ratio" {
                assert_eq!(count(&lost, &other), 0, "{name}");
                assert!(PLACES.contains(&name) || count(&one, &lost) == 0, "{name}");
            }
        });
    }
    every(|_, matcher| {
        matcher.matches(&l.view(0), &r.view(1), &rig);
        let short = Descriptors::Numbers(Table::new(1, vec![0.5; r.keypoints.len()]));
        matcher.matches(&l.view(0), &View { descriptors: &short, ..r.view(0) }, &rig);
    });
}

/// P53. Exchanged images are recognised by their matches, and so are images in order, on any rig.
///
/// Seen to fail when both orders are matched on the same rig.
#[test]
fn images_that_changed_places_are_known() {
    let mut work = Workspace::default();
    for rig in rigs() {
        let [l, r] = scene(&rig, 60);
        for kind in 0..2 {
            assert!(!Sides::of(&l.view(kind), &r.view(kind), &rig, &mut work).are_swapped());
            let swapped = Sides::of(&r.view(kind), &l.view(kind), &rig, &mut work);
            assert!(swapped.are_swapped(), "{swapped:?}");
        }
    }
}
