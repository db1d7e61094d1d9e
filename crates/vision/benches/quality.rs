//! Repeatability of detectors and matching accuracy of descriptors, compared with OpenCV at equal numbers of points.
//!
//! `cargo bench -p seafix-vision --bench quality [-- PART-OF-A-NAME]`; see the README in this folder for the
//! requirements.
//!
//! Photographs of scikit-image's wheel lie on planes. A second image of each is rendered through a known homography
//! (cubic convolution, 8 bits; a smaller image averages the area of its pixels). Every method gives its 1000 strongest
//! points of each image; the default Harris detector, which spreads them over the image at the cost of repeatability,
//! has a row of its own. Points outside the other image are excluded, and n is the smaller number of the remaining
//! ones. Points are mapped to the other image by the homography:
//!
//! - *repeatability*: the number of pairs of points, one of each image, within 1.5 px over n; nearest pairs first, each
//!   point once (Mikolajczyk et al., *A comparison of affine region detectors*, IJCV 2005, with the distance of points
//!   instead of the overlap of regions);
//! - *matching score*: the number of mutual nearest neighbours by descriptor within 3 px over n (ibid.);
//! - *matching accuracy*: the same number over that of all mutual nearest neighbours (HPatches; Dusmanu et al., D2-Net,
//!   CVPR 2019), here at 3 px.
//!
//! Each is averaged over the photographs. Distances are Euclidean or Hamming, by one matcher for all methods. The last
//! table gives the cosine between the SURF descriptors of Seafix and OpenCV at the same key points.

#![allow(clippy::print_stdout, reason = "a bench prints its results")]

mod common;

use common::{
    features::{Features, Scores, rows, scores},
    peer::{OPENCV, Peer, SURF, floats, numbers},
    scene::{eight_bits, render, rig, right_from_left},
};
use nalgebra::Matrix3;
use seafix_component::Choice;
use seafix_geometry::Pixel;
use seafix_vision::{DESCRIPTORS, DETECTORS, Image, Keypoint};
use serde_json::{Value, json};

/// The number of points of an image.
const COUNT: usize = 1000;
/// The minimum response of a corner, relative to the strongest.
const QUALITY: f64 = 1e-6;
/// The minimum of the images' shorter side (px); smaller photographs are enlarged.
const SIDE: usize = 768;
const PHOTOGRAPHS: [&str; 8] = [
    "astronaut.png",
    "brick.png",
    "coffee.png",
    "grass.png",
    "gravel.png",
    "hubble_deep_field.jpg",
    "motorcycle_left.png",
    "rocket.jpg",
];

/// The generation of a second view.
struct Change {
    name: &'static str,
    /// The homography from the first image to the second.
    homography: fn([usize; 2]) -> Matrix3<f64>,
    /// The number of samples along the side of a pixel.
    samples: usize,
    /// The change of a grey level, given a normal deviate.
    light: fn(f64, f64) -> f64,
}

const CHANGES: [Change; 5] = [
    Change { name: "stereo", homography: |size| right_from_left(&rig(size)), samples: 1, light: same },
    Change { name: "30° rotation", homography: |size| turned(size, 30.0, 1.0), samples: 1, light: same },
    Change { name: "scale 0.7", homography: |size| turned(size, 0.0, 0.7), samples: 3, light: same },
    Change { name: "perspective", homography: perspective, samples: 2, light: same },
    Change { name: "gamma, noise", homography: |_| Matrix3::identity(), samples: 1, light: darker },
];

fn same(value: f64, _: f64) -> f64 {
    value
}

/// γ = 1.5 and noise of 5 grey levels.
fn darker(value: f64, deviate: f64) -> f64 {
    255.0 * (value / 255.0).powf(1.5) + 5.0 * deviate
}

/// A rotation and scaling about the middle of the image.
fn turned(size: [usize; 2], degrees: f64, scale: f64) -> Matrix3<f64> {
    let [cx, cy] = size.map(|n| 0.5 * (n - 1) as f64);
    let (sin, cos) = degrees.to_radians().sin_cos();
    let middle = Matrix3::new(1.0, 0.0, cx, 0.0, 1.0, cy, 0.0, 0.0, 1.0);
    let turn = Matrix3::new(scale * cos, -scale * sin, 0.0, scale * sin, scale * cos, 0.0, 0.0, 0.0, 1.0);
    middle * turn * Matrix3::new(1.0, 0.0, -cx, 0.0, 1.0, -cy, 0.0, 0.0, 1.0)
}

/// A rotation of the plane by 40° about the vertical through its centre; the focal length is the image width.
fn perspective(size: [usize; 2]) -> Matrix3<f64> {
    let [cx, cy] = size.map(|n| 0.5 * (n - 1) as f64);
    let f = size[0] as f64;
    let camera = Matrix3::new(f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0);
    let (sin, cos) = 40.0_f64.to_radians().sin_cos();
    // Points (x, y, 1) of the first view's plane z = 1, rotated about the middle of that plane.
    let turn = Matrix3::new(cos, 0.0, 0.0, 0.0, 1.0, 0.0, -sin, 0.0, 1.0);
    camera * turn * camera.try_inverse().expect("a camera")
}

/// A source of features.
enum Method {
    Ours {
        detector: Choice,
        descriptor: Choice,
    },
    Peer {
        variable: &'static str,
        request: Value,
    },
    /// OpenCV's Harris corners, described by its SURF.
    PeerCorners,
}

struct Peers {
    opencv: Peer,
    surf: Peer,
}

impl Peers {
    fn keep(&mut self, image: &Image) {
        self.opencv.keep("image", image);
        self.surf.keep("image", image);
    }

    fn corners(&mut self) -> Vec<[f32; 5]> {
        rows(&self.opencv.ask(&json!({"do": "corners", "image": "image", "count": COUNT, "quality": QUALITY})))
    }

    fn described(&mut self, keypoints: &[[f32; 5]], upright: bool, extended: bool) -> Value {
        let keypoints = floats(&[keypoints.len(), 5], keypoints.as_flattened());
        let request = json!({"do": "describe", "image": "image", "keypoints": keypoints});
        let mut request = request.as_object().expect("a JSON object").clone();
        request.extend([("upright".to_owned(), upright.into()), ("extended".to_owned(), extended.into())]);
        self.surf.ask(&request.into())
    }
}

impl Method {
    fn features(&self, image: &Image, peers: &mut Peers) -> Features {
        match self {
            Self::Ours { detector, descriptor } => {
                let detector = DETECTORS.build(detector).expect("a listed detector");
                let descriptor = DESCRIPTORS.build(descriptor).expect("a listed descriptor");
                let found = detector.detect(image);
                let descriptors = descriptor.describe(image, &found);
                Features { at: found.iter().map(|keypoint| keypoint.at).collect(), descriptors }
            }
            Self::Peer { variable, request } => {
                let peer = if *variable == OPENCV { &mut peers.opencv } else { &mut peers.surf };
                Features::of_peer(&peer.ask(request), COUNT)
            }
            Self::PeerCorners => {
                let corners = peers.corners();
                Features::of_peer(&peers.described(&corners, true, false), COUNT)
            }
        }
    }
}

/// The name, the peer of the comparison, and the method; peers first, then the listed components of Seafix.
fn methods() -> Vec<(&'static str, &'static str, Method)> {
    let peer = |variable, kind: &str, upright: bool| Method::Peer {
        variable,
        request: json!({"do": "features", "image": "image", "kind": kind, "count": COUNT, "upright": upright}),
    };
    let ours = |detector: Choice, descriptor: Choice| Method::Ours {
        detector: detector.with("features", COUNT as i64),
        descriptor,
    };
    let named = Choice::named;
    // The maximum number limits the points, as in the peers, not the relative threshold.
    let corners = |name: &str| named(name).with("quality", QUALITY).with("selection", "strongest");
    let (own, own_turned) = (named("surf").with("scale", 0.0), named("surf").with("scale", 0.0).with("upright", false));
    let mut list = vec![
        ("OpenCV SURF upright", "", peer(SURF, "surf", true)),
        ("OpenCV SURF rotated", "", peer(SURF, "surf", false)),
        ("OpenCV Harris + SURF upright", "", Method::PeerCorners),
        ("OpenCV SIFT", "", peer(OPENCV, "sift", false)),
        ("OpenCV ORB", "", peer(OPENCV, "orb", false)),
        ("surf + surf upright", "OpenCV SURF upright", ours(named("surf"), own)),
        ("surf + surf rotated", "OpenCV SURF rotated", ours(named("surf"), own_turned)),
        ("harris + surf upright", "OpenCV Harris + SURF upright", ours(corners("harris"), named("surf"))),
        ("harris + surf rotated", "", ours(corners("harris"), named("surf").with("upright", false))),
        ("harris by default + surf upright", "", ours(named("harris"), named("surf"))),
        ("shi-tomasi + surf upright", "", ours(corners("shi-tomasi"), named("surf"))),
        (
            "dog + sift",
            "OpenCV SIFT",
            ours(named("dog").with("selection", "strongest"), named("sift").with("upright", false)),
        ),
        ("fast + orb", "OpenCV ORB", ours(named("fast").with("selection", "strongest"), named("orb"))),
        ("harris + zncc-patch", "", ours(corners("harris"), named("zncc-patch"))),
    ];
    list.retain(|(.., method)| match method {
        Method::Ours { detector, descriptor } => {
            DETECTORS.build(detector).is_ok() && DESCRIPTORS.build(descriptor).is_ok()
        }
        _ => true,
    });
    list
}

/// Normal deviates with a fixed seed.
struct Deviates(u64);

impl Deviates {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn next(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

impl Change {
    fn image(&self, photograph: &Image) -> Image {
        let size = [photograph.width(), photograph.height()];
        let from = (self.homography)(size).try_inverse().expect("an invertible homography");
        let seen = render(photograph, size, &from, self.samples);
        let mut deviates = Deviates(1);
        let pixels = seen.pixels().iter().map(|&p| eight_bits((self.light)(f64::from(p), deviates.next())));
        Image::new(size[0], size[1], pixels.collect()).expect("width × height pixels")
    }
}

/// The photograph, enlarged to a shorter side of at least [`SIDE`].
fn enlarged(photograph: Image) -> Image {
    let scale = SIDE as f64 / photograph.width().min(photograph.height()) as f64;
    if scale <= 1.0 {
        return photograph;
    }
    let size = [photograph.width(), photograph.height()].map(|n| (n as f64 * scale).round() as usize);
    let back = 1.0 / scale;
    // The outer edges coincide, not the centres of the first pixels.
    let shift = 0.5 * (back - 1.0);
    render(&photograph, size, &Matrix3::new(back, 0.0, shift, 0.0, back, shift, 0.0, 0.0, 1.0), 1)
}

fn main() {
    let filter = std::env::args().skip(1).find(|argument| !argument.starts_with('-')).unwrap_or_default();
    let Some(opencv) = Peer::from_env(OPENCV, "the comparison with OpenCV on photographs") else { return };
    let Some(surf) = Peer::from_env(SURF, "the comparison with OpenCV's SURF") else { return };
    let mut peers = Peers { opencv, surf };
    println!("peers: {}; {}", peers.opencv.version, peers.surf.version);
    println!("{COUNT} points; photographs at least {SIDE} px high: {}", PHOTOGRAPHS.join(", "));
    let photographs = PHOTOGRAPHS.map(|name| enlarged(peers.opencv.photograph(name)));
    let methods: Vec<_> = methods().into_iter().filter(|(name, ..)| name.contains(&filter)).collect();
    let firsts: Vec<Vec<Features>> = photographs
        .iter()
        .map(|image| {
            peers.keep(image);
            methods.iter().map(|(.., method)| method.features(image, &mut peers)).collect()
        })
        .collect();
    for change in CHANGES {
        println!(
            "\n{:<32} {:>13} {:>15} {:>18} {:>9}",
            change.name, "repeatability", "matching score", "matching accuracy", "points"
        );
        let mut sums = vec![Scores::default(); methods.len()];
        for (photograph, firsts) in photographs.iter().zip(&firsts) {
            let size = [photograph.width(), photograph.height()];
            let second = change.image(photograph);
            peers.keep(&second);
            for ((sum, (.., method)), first) in sums.iter_mut().zip(&methods).zip(firsts) {
                *sum += scores(first, &method.features(&second, &mut peers), &(change.homography)(size), size);
            }
        }
        let n = photographs.len() as f64;
        let means: Vec<[f64; 3]> =
            sums.iter().map(|sum| [sum.repeatability, sum.matching, sum.accuracy].map(|sum| sum / n)).collect();
        for (((name, beside, _), mean), sum) in methods.iter().zip(&means).zip(&sums) {
            let peer = methods.iter().position(|(name, ..)| name == beside).map(|i| means[i]);
            let [repeated, matched, right] = mean;
            let points = sum.points / n;
            println!(
                "{name:<32} {repeated:>13.3} {matched:>15.3} {right:>18.3} {points:>9.0}  {}",
                peer.map_or(String::new(), |peer| verdict(mean, &peer))
            );
        }
    }
    cosines(&photographs, &mut peers);
}

/// Whether the scores are at most 0.02 below the peer's.
fn verdict(ours: &[f64; 3], peer: &[f64; 3]) -> String {
    let behind = ours.iter().zip(peer).map(|(ours, peer)| peer - ours).fold(f64::NEG_INFINITY, f64::max);
    if behind <= 0.02 { "met".to_owned() } else { format!("MISSED by {:.3}", behind - 0.02) }
}

/// One comparison of SURF descriptors at OpenCV's key points.
struct Agreement {
    name: &'static str,
    upright: bool,
    /// Whether to use OpenCV's Harris corners instead of its Hessian points.
    corners: bool,
    extended: bool,
    /// Whether to use the position of OpenCV's window, which is rounded to integer pixels.
    rounded: bool,
}

const AGREEMENTS: [Agreement; 6] = {
    const PLAIN: Agreement =
        Agreement { name: "upright, Hessian points", upright: true, corners: false, extended: false, rounded: false };
    [
        PLAIN,
        Agreement { name: "upright, Harris corners", corners: true, ..PLAIN },
        Agreement { name: "rotated, Hessian points", upright: false, ..PLAIN },
        Agreement { name: "128, upright, Hessian points", extended: true, ..PLAIN },
        Agreement { name: "128, upright, at integer pixels", extended: true, rounded: true, ..PLAIN },
        Agreement { name: "128, rotated, Hessian points", extended: true, upright: false, ..PLAIN },
    ]
};

/// Prints the cosines between the SURF descriptors of Seafix and OpenCV at OpenCV's key points.
///
/// OpenCV rounds its upright window to integer pixels and its means to integer grey levels. The effect is small on 64
/// numbers; with 128 it changes the sign of weak derivatives, which then count in another sum.
fn cosines(photographs: &[Image], peers: &mut Peers) {
    println!(
        "\n{:<32} {:>13} {:>15} {:>18} {:>9} {:>8}",
        "SURF at OpenCV's key points", "mean cosine", "median", "5th percentile", "≥ 0.98", "points"
    );
    for Agreement { name, upright, corners, extended, rounded } in AGREEMENTS {
        let choice = Choice::named("surf").with("scale", 0.0).with("upright", upright).with("extended", extended);
        let Ok(descriptor) = DESCRIPTORS.build(&choice) else { continue };
        let mut cosines = Vec::new();
        for image in photographs {
            peers.keep(image);
            let request =
                json!({"do": "features", "image": "image", "kind": "surf", "count": COUNT, "upright": upright});
            let given = if corners { peers.corners() } else { rows(&peers.surf.ask(&request)) };
            let answer = peers.described(&given, upright, extended);
            let (given, theirs) = (rows(&answer), numbers(&answer["descriptors"]));
            let given: Vec<Keypoint> = given.iter().map(|row| keypoint(row, rounded)).collect();
            let described = descriptor.describe(image, &given);
            let ours = described.numbers().expect("SURF descriptors are numbers");
            let length = ours.length();
            cosines.extend((0..given.len()).map(|i| {
                let theirs = &theirs[length * i..][..length];
                let theirs = if upright { as_ours(theirs) } else { theirs.to_vec() };
                ours.row(i).iter().zip(theirs).map(|(a, b)| f64::from(a * b)).sum::<f64>()
            }));
        }
        cosines.sort_by(f64::total_cmp);
        let n = cosines.len();
        let mean = cosines.iter().sum::<f64>() / n as f64;
        let agree = cosines.iter().filter(|&&cosine| cosine >= 0.98).count() as f64 / n as f64;
        let (median, fifth) = (cosines[n / 2], cosines[n / 20]);
        println!("{name:<32} {mean:>13.4} {median:>15.4} {fifth:>18.4} {:>7.1} % {n:>8}", 100.0 * agree);
    }
}

/// The key point of a row of x, y, size, angle, response; with `rounded` at the centre of OpenCV's upright window.
fn keypoint(row: &[f32; 5], rounded: bool) -> Keypoint {
    // A size of 9 px is the filter of scale 1.2.
    let scale = row[2] * 1.2 / 9.0;
    let half = 0.5 * (f64::from(21.0 * scale).trunc() - 1.0);
    let at = [(row[0], -half), (row[1], half)].map(|(x, offset)| {
        let x = f64::from(x);
        if rounded { (x + offset).round_ties_even() - offset } else { x }
    });
    Keypoint { at: Pixel { u: at[0], v: at[1] }, response: row[4], scale }
}

/// The permutation of OpenCV's numbers into the order of Seafix.
///
/// OpenCV takes its upright window with x down and −y to the right: row r, column c, dx, dy of Seafix are its row c,
/// column 3 − r, dy, −dx.
fn as_ours(theirs: &[f32]) -> Vec<f32> {
    let parts = theirs.len() / 16;
    let region = |i: usize| {
        let (r, c) = (i / 4, i % 4);
        let s = &theirs[parts * (4 * c + 3 - r)..][..parts];
        match s {
            [x, y, xs, ys] => vec![*y, -x, *ys, *xs],
            // Sums are split by the sign of the other derivative: theirs of y by that of x, ours of x by that of −y.
            s => vec![s[6], s[7], s[4], s[5], -s[0], s[1], -s[2], s[3]],
        }
    };
    (0..16).flat_map(region).collect()
}
