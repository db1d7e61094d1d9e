//! P71. Protection levels: bounds that errors exceed with at most the stated risk, wrong matches included.

use std::fmt::Write as _;

use seafix_evaluation::{attitude_error, position_error};
use seafix_geometry::MeasuredPoint;
use seafix_proptests::bent::{Bend, bent_object};
use seafix_referencing::{
    Acceptance, Candidates, Correspondence, Mahalanobis, ModelPoint, Outcome, Problem, Protection, RejectionReason,
    StereoReprojection, Tolerance, judge_labelled,
};
use seafix_simulation::{Layout, Placed, Purpose, Shape, Stream, VirtualRig};

/// Half-size of the gate of a wrong match (m).
const GATE: f64 = 0.25;
/// Half-size of a gate in which most wrong matches pass for noise (m).
const HIDDEN: f64 = 0.02;
/// Number of draws of a layout.
const DRAWS: u64 = 500;

/// An accepted fix.
struct Fix {
    points: usize,
    position: f64,
    attitude: f64,
    protection: Option<Protection>,
}

/// The statistics of all fixes.
#[derive(Default)]
struct Count {
    /// Number of simulated fixes.
    generated: u64,
    /// Number of draws with a point that cannot be triangulated, and of those with a layout outside of the view: no
    /// fixes.
    undrawn: u64,
    /// Number of fixes with a wrong match.
    wrong: u64,
    fixed: u64,
    available: u64,
    within_alert: u64,
    position: u64,
    attitude: u64,
    /// Number of fixes of three points with a protection level.
    unmonitored: u64,
    /// For the position, error (mm) and level (mm), each in a tenth of a decade.
    stanford: Vec<[u32; 40]>,
}

impl Count {
    fn add(&mut self, fix: &Fix, alert: f64) {
        self.fixed += 1;
        let Some(level) = fix.protection else { return };
        self.available += 1;
        self.within_alert += u64::from(level.position <= alert);
        self.position += u64::from(fix.position > level.position);
        self.attitude += u64::from(fix.attitude > level.attitude);
        self.unmonitored += u64::from(fix.points == 3);
        if self.stanford.is_empty() {
            self.stanford = vec![[0; 40]; 40];
        }
        let bin = |metres: f64| (10.0 * (metres * 1e3).max(0.1).log10() + 10.0).clamp(0.0, 39.0) as usize;
        self.stanford[bin(fix.position)][bin(level.position)] += 1;
    }

    fn merge(&mut self, other: &Self) {
        let of = |count: &mut u64, more: u64| *count += more;
        of(&mut self.generated, other.generated);
        of(&mut self.undrawn, other.undrawn);
        of(&mut self.wrong, other.wrong);
        of(&mut self.fixed, other.fixed);
        of(&mut self.available, other.available);
        of(&mut self.within_alert, other.within_alert);
        of(&mut self.position, other.position);
        of(&mut self.attitude, other.attitude);
        of(&mut self.unmonitored, other.unmonitored);
        self.stanford.resize(40, [0; 40]);
        for (row, more) in self.stanford.iter_mut().zip(&other.stanford) {
            row.iter_mut().zip(more).for_each(|(count, more)| *count += more);
        }
    }
}

/// Fixes of layout `number`: three to twelve points, 1.5 to 5 m, spread or compact. At the rate of the settings one
/// point is replaced by one that is uniform in its gate of this half-size (m).
fn fixes(number: u64, acceptance: &Acceptance, gate: f64) -> Count {
    let mut choose = Stream::new(71, number, 0, Purpose::Survey);
    let rigs = [VirtualRig::default(), VirtualRig { size: [1600, 1200], focal: 1348.3, baseline: 0.25 }];
    let layout = Layout {
        shape: [Shape::Spread, Shape::Compact][choose.below(2)],
        points: 3 + choose.below(10),
        number,
        distance: choose.between(1.5, 5.0),
        sigma_px: 0.2,
        model_sigma: 0.0,
        rig: rigs[choose.below(2)].clone(),
    };
    let mut count = Count::default();
    let Ok(placed) = layout.place(71) else { return Count { undrawn: DRAWS, ..count } };
    for draw in 0..DRAWS {
        let mut stream = Stream::new(71, number, draw, Purpose::Survey);
        let wrong = wrong(layout.points, acceptance, &mut stream);
        let Some(mut cloud) = placed.draw(draw) else {
            count.undrawn += 1;
            continue;
        };
        count.generated += 1;
        count.wrong += u64::from(!wrong.is_empty());
        for wrong in wrong {
            cloud[wrong] = placed.elsewhere(&placed.model[wrong], gate, &mut stream);
        }
        if let Some(fix) = fix(&placed, &cloud, acceptance) {
            count.add(&fix, acceptance.alert_limit);
        }
    }
    count
}

/// The wrong matches: one or two at their rates, mostly none.
fn wrong(points: usize, acceptance: &Acceptance, stream: &mut Stream) -> Vec<usize> {
    let (one, two) = (acceptance.wrong_match_rate, acceptance.two_wrong_rate);
    match stream.unit() {
        u if u < one => vec![stream.below(points)],
        u if u < one + two => {
            let first = stream.below(points);
            vec![first, (first + 1 + stream.below(points - 1)) % points]
        }
        _ => Vec::new(),
    }
}

/// The accepted fix with every point identified as drawn.
fn fix(placed: &Placed, cloud: &[MeasuredPoint], acceptance: &Acceptance) -> Option<Fix> {
    let model: Vec<ModelPoint> = placed.model.iter().map(|&at| ModelPoint::exact("", at)).collect();
    let pairs: Vec<Correspondence> = (0..model.len()).map(|i| Correspondence { model: i, cloud: i }).collect();
    let candidates = Candidates { lists: (0..model.len()).map(|i| vec![i]).collect() };
    let problem = Problem {
        model: &model,
        cloud,
        candidates: &candidates,
        tolerance: Tolerance::Sigmas(3.0),
        prior: None,
        edges: Default::default(),
    };
    let attempt = judge_labelled(&problem, pairs, &StereoReprojection::default(), acceptance, Some(&placed.rig));
    let Outcome::Fix(reference) = attempt.outcome else { return None };
    let truth = &placed.object_from_camera;
    Some(Fix {
        points: reference.pairs.len(),
        position: position_error(&reference.object_from_camera, truth),
        attitude: attitude_error(&reference.object_from_camera, truth),
        protection: reference.integrity.protection,
    })
}

/// `layouts` layouts on two threads; counts do not depend on the number of threads.
fn trial(layouts: u64, acceptance: &Acceptance, gate: f64) -> Count {
    let half = |first: u64| {
        let mut all = Count::default();
        (first..layouts).step_by(2).for_each(|number| all.merge(&fixes(number, acceptance, gate)));
        all
    };
    let mut all = Count::default();
    std::thread::scope(|scope| {
        let other = scope.spawn(|| half(1));
        all.merge(&half(0));
        all.merge(&other.join().expect("it does not panic"));
    });
    all
}

/// The count that is exceeded once in a thousand experiments if the risk is just met: n·p + 3.09 √(n·p).
fn max(generated: u64, risk: f64) -> u64 {
    let expected = generated as f64 * risk;
    (expected + 3.09 * expected.sqrt()).floor() as u64
}

/// P71 over 1 000 000 draws at risk 1e-4: at most 130 violations, each of position and of attitude. `STANFORD` names a
/// file for the counts of a Stanford diagram.
#[test]
#[ignore = "long: a million fixes"]
fn a_million_fixes_keep_their_levels() {
    let acceptance = Acceptance::default();
    million(&acceptance);
}

/// The same with two wrong matches in two of a hundred draws, known to the settings.
#[test]
#[ignore = "long: a million fixes"]
fn a_million_fixes_keep_their_levels_under_two_wrong_matches() {
    million(&Acceptance { two_wrong_rate: 0.02, ..Acceptance::default() });
}

fn million(acceptance: &Acceptance) {
    let all = trial(1_000_000 / DRAWS, acceptance, GATE);
    let fraction = |n: u64| 100.0 * n as f64 / all.generated as f64;
    println!(
        "{} fixes, {} with a wrong match; {} draws of no fix: accepted {:.2} %, with a level {:.2} %, level within the alert limit {:.2} %; beyond the level: \
         position {}, attitude {}",
        all.generated,
        all.wrong,
        all.undrawn,
        fraction(all.fixed),
        fraction(all.available),
        fraction(all.within_alert),
        all.position,
        all.attitude
    );
    if let Ok(file) = std::env::var("STANFORD") {
        let mut text = String::from("error_mm,level_mm,fixes\n");
        for (e, row) in all.stanford.iter().enumerate() {
            for (l, fixes) in row.iter().enumerate().filter(|(_, fixes)| **fixes > 0) {
                let edge = |bin: usize| 10f64.powf((bin as f64 - 10.0) / 10.0);
                writeln!(text, "{:.3},{:.3},{fixes}", edge(e), edge(l)).expect("a string takes it");
            }
        }
        std::fs::write(file, text).expect("the file can be written");
    }
    assert_eq!(all.unmonitored, 0, "three points are unavailable");
    assert!(all.position <= 130 && all.attitude <= 130, "position {}, attitude {}", all.position, all.attitude);
}

/// P71, short: `layouts` times 500 draws, no level for three points, and a level for at least `available` of ten.
fn held(layouts: u64, acceptance: &Acceptance, gate: f64, available: u64) {
    let all = trial(layouts, acceptance, gate);
    println!(
        "{} drawn, {} with a level, beyond it {} and {}",
        all.generated, all.available, all.position, all.attitude
    );
    assert_eq!(all.unmonitored, 0, "three points are unavailable");
    assert!(all.available * 10 > all.generated * available, "{} of {} have a level", all.available, all.generated);
    let max = max(all.generated, acceptance.risk);
    assert!(all.position <= max && all.attitude <= max, "{} {} of {max}", all.position, all.attitude);
}

/// P71, short: 5000 draws at risk 1e-3. Levels far exceed the errors, since any point may be wrong; the two laws below
/// are tighter.
///
/// Seen to fail when three points have a level, and with levels of a tenth (11 897 violations, 33 allowed, in 20 000
/// draws).
#[test]
fn levels_hold() {
    held(10, &Acceptance { risk: 1e-3, ..Acceptance::default() }, GATE, 5);
}

/// P71 without wrong matches, known to the settings: levels protect against noise only.
///
/// Seen to fail with levels a third smaller (249 and 225 violations, 33 allowed, in 20 000 draws), and without the
/// radius of the fix itself.
#[test]
fn levels_hold_against_noise_alone() {
    held(10, &Acceptance { risk: 1e-3, wrong_match_rate: 1e-12, ..Acceptance::default() }, GATE, 5);
}

/// Settings without a test that excludes wrong matches and without displaced parts, so that only levels protect.
fn without_tests(risk: f64, wrong_match_rate: f64, two_wrong_rate: f64) -> Acceptance {
    let wide = Acceptance { alert_limit: 1e3, alert_fraction: 1e3, attitude_limit: 1e3, ..Acceptance::default() };
    Acceptance { confidence: 1.0 - 1e-12, risk, wrong_match_rate, two_wrong_rate, moved_part_rate: 0.0, ..wide }
}

/// P71 with a wrong match in every draw that is too small to be excluded, 5000 draws.
///
/// Seen to fail when levels are the radius of the fix itself (1037 and 1058 violations, 461 allowed, in 20 000 draws),
/// and without the radius of the fix without the point (598 and 599). Without the separation (490 and 485) only the
/// long form fails.
#[test]
fn levels_hold_where_wrong_matches_hide() {
    held(10, &without_tests(0.02, 1.0, 0.0), HIDDEN, 1);
}

/// P71 under two wrong matches, short: 2500 draws at risk 1e-3, two wrong in one of ten and one in another.
///
/// Seen to fail with levels of a tenth (4404 violations, 19 allowed, in 10 000 draws); with larger ones only the law
/// below fails.
#[test]
fn levels_hold_under_two_wrong_matches() {
    held(5, &Acceptance { risk: 1e-3, two_wrong_rate: 0.1, ..Acceptance::default() }, GATE, 3);
}

/// The same with two small wrong matches in every draw, 2500 draws.
///
/// Seen to fail when sets of two are not excluded (692 and 711 violations, 461 allowed, in 20 000 draws), and when
/// levels are the radius of the fix itself (1070 and 1097).
#[test]
fn levels_hold_where_two_wrong_matches_hide() {
    held(5, &without_tests(0.02, 1e-12, 1.0), HIDDEN, 1);
}

/// The two laws of hidden matches, 20 000 draws each.
#[test]
#[ignore = "long: 40 000 draws"]
fn levels_hold_in_many_draws_where_wrong_matches_hide() {
    held(40, &without_tests(0.02, 1.0, 0.0), HIDDEN, 1);
    held(40, &without_tests(0.02, 1e-12, 1.0), HIDDEN, 1);
}

/// The answers for bent objects.
#[derive(Default)]
struct Bent {
    fixes: u32,
    inconsistent: u32,
    /// Number of fixes with a level, and of those with an error beyond a level of position or attitude.
    available: u32,
    beyond: u32,
    /// The levels of the position (m) of the fixes that have one.
    levels: Vec<f64>,
}

impl Bent {
    fn median(&mut self) -> f64 {
        self.levels.sort_by(f64::total_cmp);
        self.levels.get(self.levels.len() / 2).copied().unwrap_or(f64::NAN)
    }

    fn beyond(&self) -> f64 {
        f64::from(self.beyond) / f64::from(self.available.max(1))
    }
}

/// The answers for `draws` objects of `points` points, bent by at most `size` (m), with every point identified.
fn bent(bend: Bend, points: usize, sigma: f64, size: f64, draws: u64, acceptance: &Acceptance) -> Bent {
    let mut all = Bent::default();
    for number in 0..draws {
        let object = bent_object(bend, points, sigma, size, number);
        let pairs: Vec<Correspondence> = (0..points).map(|i| Correspondence { model: i, cloud: i }).collect();
        let candidates = Candidates { lists: (0..points).map(|i| vec![i]).collect() };
        let problem = Problem {
            model: &object.model,
            cloud: &object.cloud,
            candidates: &candidates,
            tolerance: Tolerance::Sigmas(3.0),
            prior: None,
            edges: Default::default(),
        };
        match judge_labelled(&problem, pairs, &Mahalanobis::default(), acceptance, None).outcome {
            Outcome::Fix(fix) => {
                all.fixes += 1;
                let Some(level) = fix.integrity.protection else { continue };
                all.available += 1;
                all.levels.push(level.position);
                let (pose, truth) = (&fix.object_from_camera, &object.object_from_camera);
                let outside =
                    position_error(pose, truth) > level.position || attitude_error(pose, truth) > level.attitude;
                all.beyond += u32::from(outside);
            }
            Outcome::Rejected(RejectionReason::Inconsistent { .. }) => all.inconsistent += 1,
            _ => {}
        }
    }
    all
}

/// Settings without the case of a displaced part.
fn rigid() -> Acceptance {
    Acceptance { moved_part_rate: 0.0, ..Acceptance::default() }
}

/// At most one in a hundred fixes of bent objects exceeds its level, where one in ten does without the case of a
/// displaced part. Noise at which a bend of 5 cm often passes the test of residuals.
#[test]
fn levels_hold_where_a_part_of_the_object_is_displaced() {
    let (mut before, mut after) = (Bent::default(), Bent::default());
    for (points, sigma) in [(8, 0.007), (13, 0.008), (50, 0.018)] {
        for bend in [Bend::Half, Bend::TwoThirds, Bend::Hinge] {
            for (sum, acceptance) in [(&mut before, rigid()), (&mut after, Acceptance::default())] {
                let one = bent(bend, points, sigma, 0.05, 60, &acceptance);
                sum.available += one.available;
                sum.beyond += one.beyond;
            }
        }
    }
    println!("{} of {} before, {} of {} after", before.beyond, before.available, after.beyond, after.available);
    assert!(before.beyond() > 0.1, "{} of {}", before.beyond, before.available);
    assert!(after.available > 100 && after.beyond() <= 0.01, "{} of {}", after.beyond, after.available);
}

/// An object as modelled is not called inconsistent, and its levels grow by less than two.
#[test]
fn levels_of_an_object_as_modelled_stay_useful() {
    for (points, sigma) in [(8, 0.01), (13, 0.01), (50, 0.02)] {
        let [mut before, mut after] =
            [rigid(), Acceptance::default()].map(|acceptance| bent(Bend::None, points, sigma, 0.0, 60, &acceptance));
        assert_eq!((after.inconsistent, after.fixes), (0, before.fixes), "{points}");
        let growth = after.median() / before.median();
        assert!((1.0..2.0).contains(&growth), "{points}: {growth}");
    }
}

/// Levels, rejections and growth for every kind of bend, size of model and noise. `DRAWS` is the number of draws of a
/// cell, 300 by default.
#[test]
#[ignore = "table"]
fn bent_objects_by_kind() {
    let draws = std::env::var("DRAWS").ok().and_then(|n| n.parse().ok()).unwrap_or(300);
    println!(
        "points sigma_mm size_mm kind: fixes before after, inconsistent, beyond before after (%), growth of the level"
    );
    for points in [8, 13, 50] {
        for (sigma, size) in [(0.002, 0.01), (0.007, 0.05), (0.015, 0.05), (0.03, 0.05), (0.03, 0.1)] {
            for bend in Bend::ALL {
                let [mut before, mut after] = [rigid(), Acceptance::default()]
                    .map(|acceptance| bent(bend, points, sigma, size, draws, &acceptance));
                let growth = after.median() / before.median();
                println!(
                    "{points} {:.0} {:.0} {bend:?}: {} {} {} {:.2} {:.2} {growth:.2}",
                    1e3 * sigma,
                    1e3 * size,
                    before.fixes,
                    after.fixes,
                    after.inconsistent,
                    100.0 * before.beyond(),
                    100.0 * after.beyond(),
                );
            }
        }
    }
}
