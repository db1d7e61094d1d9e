//! Warnings about valid but implausible problems.

use std::path::Path;

use nalgebra::Vector3;
use seafix_component::{Fault, counted, number};

use super::{duplicates::firsts, input::CoherenceProblem};
use crate::{
    problem::PriorBound,
    search::{
        identification::{FEWER, Rejected},
        limits::NEEDED,
        rigid_consensus::RigidConsensus,
    },
    site::{
        check::{COINCIDENT, SUSPICIOUS},
        congruence::congruences,
        target::nearest_two,
    },
    solve::degeneracy::{ON_A_LINE, second_ratio},
};

/// The ratio of a length to the noise below which it is far below the noise.
const FAR_BELOW: f64 = 0.1;
/// The ratio of a gate's half-size to half of the cloud above which the gate excludes nothing.
const FAR_ABOVE: f64 = 10.0;
/// The distance (m) beyond which an object is out of view.
const OUT_OF_VIEW: f64 = 1e6;
/// The maximum number of model points for the symmetry test; larger models have too many triangles.
const MAX_CHECKED: usize = 100;
/// Distance of mapped points, in standard deviations, up to which a motion equals the identity.
const DISTINGUISHED: f64 = 3.0;

/// Distance of two cloud points, in standard deviations, up to which they may be measurements of one place; 95 % of two
/// measurements are within it.
const SAME_PLACE: f64 = 4.0;
/// Maximum ratio of the pairs up to twice that distance to those within it, for measurements of separate places.
const CLUMPED: f64 = 1.25;
/// Number of others at its place from which a cloud point counts as measured repeatedly; a second one may be clutter.
const REPEATED: usize = 2;

/// The standard deviation (rad) of a rotation that leaves an attitude useless, 5°.
const OPEN: f64 = 0.09;

/// The warnings about a file.
pub(super) struct Hints<'a> {
    file: &'a Path,
    all: Vec<Fault>,
}

impl Hints<'_> {
    pub(super) fn warn(&mut self, what: &str, value: impl Into<String>, remedy: &str) {
        self.all.push(Fault::new(what, self.file).value(value.into()).remedy(remedy));
    }
}

impl CoherenceProblem {
    /// Warnings about valid but implausible contents of `file`.
    ///
    /// They cover points too few for a pose, collinear, repeated, measured several times, or too close for Δ; a symmetric model; zero noise, or noise far
    /// above Δ; putative pairs that determine no pose; a prior that places the object out of view or bounds nothing;
    /// coordinates that are apparently not in metres; edges without lines, or lines without edges; lines that are behind the
    /// camera, repeated, or shorter than their noise; and too many candidates.
    pub fn warnings(&self, file: &Path) -> Vec<Fault> {
        let mut reported = Hints { file, all: Vec::new() };
        self.of_the_model(&mut reported);
        self.of_the_cloud(&mut reported);
        self.of_duplicates(&mut reported);
        self.of_repeated_measurements(&mut reported);
        self.of_the_edges(&mut reported);
        self.of_the_noise(&mut reported);
        self.of_putative(&mut reported);
        let before = reported.all.len();
        self.of_the_prior(&mut reported);
        let sound = reported.all.len() == before;
        self.of_candidates(&mut reported, sound);
        reported.all
    }

    fn of_the_model(&self, reported: &mut Hints<'_>) {
        if !self.has_edges() && self.model.len() < NEEDED {
            let value = counted(self.model.len(), "point");
            reported.warn("the model has too few points", value, "a pose needs at least three");
        }
        if let Some((i, k, distance)) = nearest_two(&self.model, 2.0 * self.delta) {
            let value = format!("points {i} and {k}, {} m apart, and Δ = {} m", number(distance), number(self.delta));
            let remedy = "they may be confused; keep model points at least 2Δ apart";
            reported.warn("model points closer than 2Δ", value, remedy);
        }
        if let Some(ratio) = on_a_line(&self.model_places()) {
            let remedy = "a rotation about the line changes no measurement; add a point off the line";
            reported.warn("collinear model points", of_extents(ratio), remedy);
        } else if let Some(turn) = self.open_turn().filter(|turn| *turn > OPEN && self.typical_sigma() <= self.extent())
        {
            let value =
                format!("the rotation about the line has an error of {:.0}° (one sigma)", turn.to_degrees().min(180.0));
            reported.warn("model points near a line", value, "add a point off the line");
        }
        if let Some((degrees, off)) = self.symmetry() {
            let value = format!(
                "after a rotation by {degrees:.0}° each point is within {} m of another, σ = {} m",
                number(off),
                number(self.typical_sigma())
            );
            let remedy = "both poses explain the measurements; give a prior, or add a point that breaks the symmetry";
            reported.warn("the model is symmetric", value, remedy);
        }
        let extent = self.extent();
        if self.model.len() > 1 && !(SUSPICIOUS[0]..=SUSPICIOUS[1]).contains(&extent) {
            let value = format!("the diagonal of the model's bounding box is {} m", number(extent));
            reported.warn("implausible units", value, "give coordinates in metres");
        }
    }

    fn of_the_cloud(&self, reported: &mut Hints<'_>) {
        match self.cloud.len() {
            few if few < NEEDED && self.has_edges() => return,
            0 => return reported.warn("the cloud has no points", "0 points", "add measured points"),
            few if few < NEEDED => {
                let value = counted(few, "point");
                return reported.warn("the cloud has too few points", value, "a pose needs at least three");
            }
            _ => {}
        }
        let places = self.cloud_places();
        let (full, half) = (extent(&places), extent(&nearer_half(&places)));
        if full < COINCIDENT {
            let value = format!("{} in a bounding box of {} m", counted(places.len(), "point"), number(full));
            return reported.warn("coincident cloud points", value, "a pose needs three distinct points");
        }
        if let Some(ratio) = largest_on_a_line(&places) {
            let remedy = "a rotation about the line changes no measurement; add a point off the line";
            reported.warn("collinear cloud points", of_extents(ratio), remedy);
        }
        let nearest = nearest_two(&self.model, f64::INFINITY).map_or(0.0, |(.., distance)| distance);
        if nearest > full + self.delta {
            let (full, nearest) = (number(full), number(nearest));
            let value = format!("bounding box with a diagonal of {full} m, no two model points within {nearest} m");
            reported.warn("the cloud is smaller than the model", value, "give coordinates of both in metres");
        } else if full < SUSPICIOUS[0] || half > SUSPICIOUS[1] {
            let (points, size) = if full < SUSPICIOUS[0] { ("the cloud", full) } else { ("half of the cloud", half) };
            let value = format!("{points} lies in a bounding box with a diagonal of {} m", number(size));
            reported.warn("implausible units", value, "give coordinates in metres");
        } else if self.model.len() > 1 && all_apart(&places, self.extent() + self.delta) {
            let value = format!(
                "no two cloud points are within {} m, the diagonal of the model's bounding box",
                number(self.extent())
            );
            reported.warn("cloud points too far apart", value, "give coordinates of both in metres");
        }
    }

    fn of_duplicates(&self, reported: &mut Hints<'_>) {
        if self.putative.is_none() {
            return;
        }
        let models = firsts(self.model.iter().map(|point| point.at));
        let clouds = firsts(self.cloud.iter().map(|point| point.position.at));
        for (what, firsts) in [("model", models), ("cloud", clouds)] {
            let mut again = firsts.iter().enumerate().filter(|(index, first)| index != *first);
            if let Some((index, first)) = again.next() {
                let value = format!("{} of {}, e.g. {index} and {first}", 1 + again.count(), firsts.len());
                let remedy = "equal coordinates are one point; each takes part as its first";
                reported.warn(&format!("repeated {what} points"), value, remedy);
            }
        }
    }

    /// A cloud that holds most points several times, as one that was gathered from several frames.
    ///
    /// Points in clumps are the image of clumped clutter: little evidence remains for each.
    fn of_repeated_measurements(&self, reported: &mut Hints<'_>) {
        if self.putative.is_some() {
            return;
        }
        let reach = SAME_PLACE * self.typical_sigma();
        let mut places: Vec<_> = self.cloud.iter().map(|point| point.position.at.coords).collect();
        places.sort_by(|a, b| a.x.total_cmp(&b.x));
        let (mut near, mut pairs, mut wide) = (vec![0usize; places.len()], 0u32, 0u32);
        for (a, from) in places.iter().enumerate() {
            let next = places.iter().enumerate().skip(a + 1).take_while(|(_, to)| to.x - from.x <= 2.0 * reach);
            for (b, apart) in next.map(|(b, to)| (b, (to - from).norm())).filter(|(_, apart)| *apart <= 2.0 * reach) {
                wide += 1;
                if apart <= reach {
                    pairs += 1;
                    near[a] += 1;
                    near[b] += 1;
                }
            }
        }
        let repeated = near.iter().filter(|count| **count >= REPEATED).count();
        // A dense line or surface has twice as many pairs and more up to twice the distance.
        let separate = (wide as usize) < places.len() * places.len().saturating_sub(1) / 2;
        let clumped = separate && f64::from(wide) <= CLUMPED * f64::from(pairs);
        if repeated > 0 && 2 * repeated >= places.len() && clumped {
            let value = format!(
                "{repeated} of {} cloud points have {REPEATED} or more others within {} m",
                places.len(),
                number(reach)
            );
            let remedy = "give each place once: merge its measurements into their mean, with its standard deviation";
            reported.warn("repeated measurements", value, remedy);
        }
    }

    fn of_the_noise(&self, reported: &mut Hints<'_>) {
        let variances = || self.cloud.iter().map(|point| point.position.covariance.diagonal());
        let remedy = "no measurement is more precise than a nanometre; give the standard deviation";
        if let Some(exact) = variances().position(|all| all.max() == 0.0) {
            reported.warn("points without noise", format!("cloud point {exact}, 0 m"), remedy);
        }
        if let Some((point, all)) = variances().enumerate().find(|(_, all)| all.min() == 0.0 && all.max() > 0.0) {
            let row: Vec<String> = all.iter().map(|variance| number(variance.sqrt())).collect();
            let value = format!("cloud point {point}, [{}] m", row.join(", "));
            reported.warn("zero noise along one axis", value, remedy);
        }
        let (sigma, extent) = (self.typical_sigma(), self.extent());
        if self.model.len() >= NEEDED && sigma > extent {
            let value =
                format!("σ = {} m, the diagonal of the model's bounding box is {} m", number(sigma), number(extent));
            reported.warn("noise larger than the model", value, "give standard deviations in metres");
        } else if self.delta < FAR_BELOW * sigma {
            let value = format!("Δ = {} m, σ = {} m", number(self.delta), number(sigma));
            reported.warn(
                "`delta` is far below the noise",
                value,
                "few true pairs would agree; nearly all agree at 3√2 σ",
            );
        }
    }

    fn of_putative(&self, reported: &mut Hints<'_>) {
        let Some(pairs) = &self.putative else { return };
        let models = distinct(pairs.iter().map(|(model, _)| *model));
        let clouds = distinct(pairs.iter().map(|(_, cloud)| *cloud));
        for (which, used) in [("model", &models), ("cloud", &clouds)] {
            if used.len() < NEEDED {
                let points = counted(used.len(), &format!("{which} point"));
                let value = format!("{} of {points}", counted(pairs.len(), "pair"));
                let remedy = "a pose needs pairs of three; omit `putative` to consider all pairs";
                return reported.warn("`putative` has too few pairs", value, remedy);
            }
        }
        for (which, used, all) in [("model", &models, self.model_places()), ("cloud", &clouds, self.cloud_places())] {
            let places: Vec<Vector3<f64>> = used.iter().map(|&index| all[index]).collect();
            // Collinearity of all points is reported already.
            if let Some(ratio) = largest_on_a_line(&places).filter(|_| largest_on_a_line(&all).is_none()) {
                let value = format!("{} of {}, {}", used.len(), all.len(), of_extents(ratio));
                let remedy = "collinear pairs determine no pose; add pairs of a point off the line";
                reported.warn(&format!("collinear {which} points in `putative`"), value, remedy);
            }
        }
    }

    fn of_the_prior(&self, reported: &mut Hints<'_>) {
        let Some(prior) = &self.prior else { return };
        if self.model.is_empty() {
            return;
        }
        let camera_from_object = prior.object_from_camera.inverse();
        let predicted = || self.model.iter().map(|point| (camera_from_object * point.at).coords);
        let nearest = predicted().map(|place| place.amax()).fold(f64::INFINITY, f64::min);
        let foremost = predicted().map(|place| place.z).fold(f64::NEG_INFINITY, f64::max);
        if nearest > OUT_OF_VIEW {
            let value = format!("its nearest point is {} m away along an axis", number(nearest));
            reported.warn(
                "the prior places the object too far away",
                value,
                "`T_cam_obj` is camera_from_object, in metres",
            );
        } else if foremost <= 0.0 {
            let value = format!("its largest z is {} m", number(foremost));
            let remedy = "`T_cam_obj` is camera_from_object, z forward; is it the inverse?";
            reported.warn("the prior places the object behind the camera", value, remedy);
        }
        let PriorBound::Box(half) = prior.bound else { return };
        let cloud = extent(&nearer_half(&self.cloud_places()));
        if half < FAR_BELOW * self.typical_sigma() {
            let value = format!("{} m, σ = {} m", number(half), number(self.typical_sigma()));
            let remedy = "few true points would lie in their gates; give the largest error of the prior";
            reported.warn("`prior.shell_half_m` is far below the noise", value, remedy);
        } else if half > FAR_ABOVE * cloud && self.cloud.len() >= NEEDED {
            let value = format!("{} m, half of the cloud lies in a bounding box of {} m", number(half), number(cloud));
            let remedy = "every point lies in every gate; give metres, or omit the prior";
            reported.warn("`prior.shell_half_m` excludes nothing", value, remedy);
        }
    }

    /// A self-symmetry of the model within the noise: the angle (°), and the largest distance (m) of a mapped point
    /// from its image point.
    fn symmetry(&self) -> Option<(f64, f64)> {
        if self.model.len() > MAX_CHECKED {
            return None;
        }
        let full = congruences(&self.model).into_iter().filter(|found| found.broken_by.is_empty());
        let mut reported =
            full.map(|found| (found.motion.rotation().angle().to_degrees(), found.farthest_off(&self.model)));
        reported.find(|(_, off)| *off <= DISTINGUISHED * self.typical_sigma())
    }

    /// Warns of candidates that no search accepts; empty gates are reported only if the prior has no other warning.
    fn of_candidates(&self, reported: &mut Hints<'_>, sound: bool) {
        let max = RigidConsensus::default().max_pairs;
        let mut many = |pairs: String| {
            reported.warn(
                "too many candidate pairs",
                format!("{pairs}, the limit of `rigid-consensus` is {max}"),
                FEWER,
            );
        };
        match self.candidates() {
            Err(Rejected::TooLarge { size, .. }) => many(format!("at least {size}")),
            Err(rejected) => many(rejected.to_string()),
            Ok(found) if found.pairs() > max => many(found.pairs().to_string()),
            Ok(found) => {
                let enough = self.model.len() >= NEEDED && self.cloud.len() >= NEEDED;
                let some = found.with_candidates();
                if sound && enough && self.putative.is_none() && some < NEEDED {
                    let value = format!("{some} of {} model points", self.model.len());
                    let remedy =
                        "a pose needs three; check that `T_cam_obj` is camera_from_object, or enlarge `shell_half_m`";
                    reported.warn("too few gates contain a cloud point", value, remedy);
                }
            }
        }
    }

    fn model_places(&self) -> Vec<Vector3<f64>> {
        self.model.iter().map(|point| point.at.coords).collect()
    }

    fn cloud_places(&self) -> Vec<Vector3<f64>> {
        self.cloud.iter().map(|point| point.position.at.coords).collect()
    }

    /// The diagonal of the model's bounding box (m), at least its diameter.
    fn extent(&self) -> f64 {
        extent(&self.model_places())
    }

    /// The median over the cloud of the standard deviation per axis (m).
    pub(super) fn typical_sigma(&self) -> f64 {
        let mut all: Vec<f64> =
            self.cloud.iter().map(|point| (point.position.covariance.trace() / 3.0).sqrt()).collect();
        let middle = all.len() / 2;
        if all.is_empty() { 0.0 } else { *all.select_nth_unstable_by(middle, f64::total_cmp).1 }
    }
}

/// The diagonal of the bounding box of points (m).
fn extent(places: &[Vector3<f64>]) -> f64 {
    let corner =
        |outer: fn(&Vector3<f64>, &Vector3<f64>) -> Vector3<f64>| places.iter().copied().reduce(|a, b| outer(&a, &b));
    let (min, greatest) = (corner(Vector3::inf), corner(Vector3::sup));
    min.zip(greatest).map_or(0.0, |(min, greatest)| (greatest - min).norm())
}

/// The ratio of second to first extent of three or more collinear or coincident points; `None` for others.
fn on_a_line(places: &[Vector3<f64>]) -> Option<f64> {
    // The scaling prevents overflow of the squares of large numbers.
    let largest = places.iter().map(|at| at.amax()).fold(f64::MIN_POSITIVE, f64::max);
    let ratio = || second_ratio(places.iter().map(|at| at / largest));
    (places.len() >= NEEDED).then(ratio).filter(|&ratio| ratio < ON_A_LINE)
}

/// The ratio in words.
fn of_extents(ratio: f64) -> String {
    format!("second extent over first {ratio:.1e}")
}

/// [`on_a_line`] without the influence of a few distant outliers, which make any cloud long and thin.
fn largest_on_a_line(places: &[Vector3<f64>]) -> Option<f64> {
    on_a_line(places).filter(|_| on_a_line(&nearer_half(places)).is_some())
}

/// The half of the points, at least three, that is nearest to the median.
fn nearer_half(places: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let kept = places.len().div_ceil(2).max(NEEDED);
    if kept >= places.len() {
        return places.to_vec();
    }
    let middle = Vector3::from_fn(|axis, _| {
        let mut all: Vec<f64> = places.iter().map(|at| at[axis]).collect();
        *all.select_nth_unstable_by(kept, f64::total_cmp).1
    });
    let mut half = places.to_vec();
    let off = |at: &Vector3<f64>| (at - middle).amax();
    half.select_nth_unstable_by(kept, |a, b| off(a).total_cmp(&off(b)));
    half.truncate(kept);
    half
}

/// Whether every two points are farther apart than `limit`.
///
/// It sweeps as [`nearest_two`] does: points farther along the direction are skipped.
fn all_apart(places: &[Vector3<f64>], limit: f64) -> bool {
    let direction = Vector3::new(1.0, 2f64.sqrt(), 3f64.sqrt()).normalize();
    let mut along: Vec<(f64, &Vector3<f64>)> = places.iter().map(|at| (direction.dot(at), at)).collect();
    along.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    along.iter().enumerate().all(|(place, (here, at))| {
        let mut near = along[..place].iter().rev().take_while(|(there, _)| here - there <= limit);
        near.all(|(_, other)| (*at - *other).norm() > limit)
    })
}

fn distinct(numbers: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut all: Vec<usize> = numbers.collect();
    all.sort_unstable();
    all.dedup();
    all
}
