//! Laws of the whole front end, on rigs of any kind.

mod scenes;

use seafix_component::Choice;
use seafix_geometry::{Pixel, StereoRig};
use seafix_vision::{
    DESCRIPTORS, DETECTORS, FrontEnd, LOCATORS, Look, MATCHERS, Pair, Place, Refine, Threads, Triangulator, Warp,
};

fn front_end(matcher: &str) -> FrontEnd {
    FrontEnd {
        filters: Vec::new(),
        detector: DETECTORS.build(&Choice::named("harris").with("features", 400)).expect("a detector"),
        locator: LOCATORS.build(&Choice::named("corner")).expect("a locator"),
        descriptor: DESCRIPTORS.build(&Choice::named("surf")).expect("a descriptor"),
        matcher: MATCHERS.build(&Choice::named(matcher)).expect("a matcher"),
        refine: Refine::default(),
        triangulator: Triangulator::default(),
    }
}

/// Beside, above, turned towards each other, rolled, behind strong lenses, one before the other.
fn rigs() -> Vec<(&'static str, StereoRig)> {
    let strong = [-0.32, 0.12, 1e-3, -1e-3];
    vec![
        ("beside", scenes::rig([0.2, 0.0, 0.0], [0.0; 3], &[])),
        ("vertical", scenes::rig([0.0, 0.2, 0.0], [0.0; 3], &[])),
        ("vertical, strong lens", scenes::rig([0.0, 0.2, 0.01], [0.03, 0.0, 0.02], &strong)),
        ("converging", scenes::rig([0.5, 0.0, 0.0], [0.0, 0.25, 0.0], &[])),
        ("converging, strong lens", scenes::rig([0.4, 0.1, -0.05], [-0.03, 0.2, 0.05], &strong)),
        ("forward", scenes::rig([0.05, 0.0, 0.25], [0.0; 3], &[])),
    ]
}

/// Most key points become points of the plane, and at most one in a hundred is another place of the right image, more
/// than 1.5 px from the truth: in clear water, and with a contrast of a few grey levels under noise of ±2.
///
/// Seen to fail when pairs that cannot be aligned stay: under noise one in four of the band's is false; and when the
/// right image's part of the noise is forgotten in the covariance.
#[test]
fn the_cloud_lies_on_the_plane() {
    for (name, rig) in rigs() {
        for (contrast, grain) in [(60.0, 0.0), (9.0, 2.0)] {
            let [left, right] = scenes::images(&rig, contrast, grain);
            for matcher in ["epipolar-band", "lucas-kanade", "zncc-band"] {
                let mut look = Look::new(Threads::One);
                front_end(matcher).look(&left, &right, &rig, &mut look);
                let seen = look.keypoints()[0]
                    .iter()
                    .filter_map(|k| scenes::truth(&rig, k.at))
                    .filter(|pair| rig.right().contains(&pair.right, 15.0) && rig.left().contains(&pair.left, 15.0));
                let (seen, found) = (seen.count(), look.cloud.len());
                let wrong = look.pixels.iter().filter(|pair| {
                    scenes::truth(&rig, pair.at.left).is_none_or(|truth| truth.right.distance(&pair.at.right) > 1.5)
                });
                let wrong = wrong.count();
                let case = format!("{name}, ±{contrast}, {matcher}: {found} of {seen}, {wrong} wrong");
                println!("{case}");
                assert!(10 * found >= 4 * seen && seen > 100, "{case}");
                assert!(100 * wrong <= found, "{case}");
            }
        }
    }
}

/// Alignment finds where the right image shows a left place within a few hundredths of a pixel, for every rig and warp,
/// from a start half a pixel beside it.
///
/// Seen to fail when the window is laid over the right image as it is, whatever the rig, and when its mean stays.
#[test]
fn alignment_finds_the_place_for_every_rig() {
    for (name, rig) in rigs() {
        let [left, right] = scenes::images(&rig, 60.0, 0.0);
        let at = |i: usize| Pixel { u: 30.3 + 14.0 * (i % 20) as f64, v: 25.7 + 13.0 * (i / 20) as f64 };
        let inside = |i: &usize| scenes::truth(&rig, at(*i)).is_some_and(|p| rig.right().contains(&p.right, 12.0));
        let pairs: Vec<(Pair, Pixel)> = (0..300)
            .filter(inside)
            .filter_map(|i| {
                let truth = scenes::truth(&rig, at(i))?.right;
                let start = Pixel { u: truth.u + 0.4, v: truth.v - 0.3 };
                Some((Pair { left: Place::independent(at(i), 0.1), right: Place::independent(start, 0.1) }, truth))
            })
            .collect();
        assert!(pairs.len() > 60, "{name}: {}", pairs.len());
        for warp in [Warp::Translation, Warp::Slanted, Warp::Affine] {
            let refine = Refine { warp, ..Refine::default() };
            let starts: Vec<Pair> = pairs.iter().map(|(pair, _)| *pair).collect();
            let found = refine.align(&starts, &left, &right, &rig);
            let mut errors: Vec<f64> =
                found.iter().zip(&pairs).map(|(found, (_, truth))| found.at.right.distance(truth)).collect();
            errors.sort_by(f64::total_cmp);
            let (median, most) = (errors[errors.len() / 2], errors[errors.len() * 9 / 10]);
            println!("{name}, {warp:?}: {} pairs, median {median:.4} px, nine in ten {most:.4} px", errors.len());
            assert!(median < 0.05 && most < 0.2, "{name}, {warp:?}: {median} and {most} px");
        }
    }
}

/// An image of 16 bits in dim light shows what the bright one does: 16 levels of grey, each cut into 257, keep the points.
///
/// Seen to fail when finer levels are believed to err by rounding to 8 bits: one point in six is lost at 16 levels.
#[test]
fn dim_images_of_many_bits_keep_their_points() {
    let rig = scenes::rig([0.2, 0.0, 0.0], [0.0; 3], &[]);
    let bright = scenes::images(&rig, 60.0, 0.0);
    let dimmed = |image: &seafix_vision::Image| {
        let mut image = image.clone();
        image.pixels_mut().iter_mut().for_each(|level| *level = (*level / 16.0 * 257.0).round() / 257.0);
        image
    };
    let dim = [dimmed(&bright[0]), dimmed(&bright[1])];
    let [many, few] = [&bright, &dim].map(|[left, right]| {
        let mut look = Look::new(Threads::One);
        let mut stages = front_end("epipolar-band");
        // Contrast is counted in grey levels: a sixteenth of it is left.
        stages.locator = LOCATORS.build(&Choice::named("peak")).expect("a locator");
        stages.look(left, right, &rig, &mut look);
        look.cloud.len()
    });
    assert!(many > 100 && 10 * few >= 9 * many, "{few} of {many}");
}

/// Whoever works, and whatever was looked at before.
///
/// Seen to fail when every piece of the alignment begins at the first pair.
#[test]
fn threads_and_memory_change_no_bit() {
    for matcher in ["epipolar-band", "lucas-kanade", "zncc-band"] {
        let front_end = front_end(matcher);
        let mut kept = [Threads::One, Threads::Pool].map(Look::new);
        for (name, rig) in &rigs()[1..4] {
            let [left, right] = scenes::images(rig, 60.0, 2.0);
            let shown = |look: &Look| format!("{:?}", (&look.matches, &look.pixels, &look.cloud));
            let mut fresh = Look::new(Threads::One);
            front_end.look(&left, &right, rig, &mut fresh);
            for look in &mut kept {
                front_end.look(&left, &right, rig, look);
                assert!(shown(look) == shown(&fresh), "{name}, {matcher}");
            }
        }
    }
}
