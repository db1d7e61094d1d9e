//! Poses that contradict the site or each other.
//!
//! A pose is judged by what it predicts: the feature points in view of both cameras. If the given poses put no object in
//! view, the known mistakes are undone one by one; the one that puts objects in view in most pairs explains them.

use std::{cmp::Ordering, path::Path};

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion};
use seafix_component::Fault;
use seafix_geometry::{Body, Camera, Object, Point, StereoPixels, StereoRig, Transform, UncertainPixels, World};
use seafix_referencing::Site;

use super::{
    evidence::{MeasuredPair, confirmed, is_clearly_more, median_depth},
    rig_mistakes::rig_mistakes,
};

type Pose = Transform<World, Camera>;

/// What a pose predicts: the rig, and the points of the objects in the world.
pub(crate) struct View<'a> {
    pub(crate) rig: &'a StereoRig,
    pub(crate) body_from_camera: Transform<Body, Camera>,
    /// The points of each object with a pose.
    pub(super) objects: Vec<Vec<Point<World>>>,
}

/// A mistake, how to undo it, and the remedy.
pub(super) struct Mistake {
    pub(super) name: String,
    pub(super) remedy: &'static str,
    pub(super) undo: Box<dyn Fn(&Pose) -> Pose>,
}

/// The minimum number of points of an object in view.
const IN_VIEW: usize = 3;
/// The maximum number of judged pairs.
const JUDGED: usize = 40;
/// The distance (m) up to which an object can be in view under water.
const MAX_DEPTH: f64 = 50.0;

impl<'a> View<'a> {
    /// The view of the objects with a pose in the world: `moved` where their pose differs from the survey.
    pub(crate) fn new(
        site: &Site,
        moved: &[(String, Transform<World, Object>)],
        rig: &'a StereoRig,
        body_from_camera: Transform<Body, Camera>,
    ) -> Self {
        let place = |id: &str| moved.iter().find(|(moved, _)| moved == id).map(|(_, pose)| *pose);
        let objects = site.objects.iter().filter_map(|object| {
            let world_from_object = place(&object.id).or(object.world_from_object)?;
            Some(object.points.iter().map(|point| world_from_object * point.at).collect())
        });
        Self { rig, body_from_camera, objects: objects.collect() }
    }

    /// Whether an object is in view of both cameras at this pose.
    fn shows(&self, pose: &Pose) -> bool {
        let camera_from_world = pose.inverse();
        self.objects.iter().any(|points| {
            let seen = points.iter().filter(|point| {
                let point = camera_from_world * **point;
                (0.0..MAX_DEPTH).contains(&point.coords.z) && self.rig.sees(&point, 0.0).is_some()
            });
            seen.take(IN_VIEW).count() == IN_VIEW
        })
    }

    fn count(&self, poses: &[Pose], undo: &dyn Fn(&Pose) -> Pose) -> usize {
        poses.iter().filter(|pose| self.shows(&undo(pose))).count()
    }
}

/// The faults of the prior and of the true poses, each of one pair. A prior predicts the objects of the `survey`, the
/// truth those of `view`, where objects stand truly; `sigma` are the standard deviations (m, rad) of the
/// prior, `measured` the matches of some pairs. The poses of `file` are named as the fault's place.
pub(crate) fn poses_faults(
    [survey, view]: [&View<'_>; 2],
    priors: &[Option<Pose>],
    truths: &[Option<Pose>],
    sigma: Option<(f64, f64)>,
    measured: &[MeasuredPair],
    file: &Path,
) -> Vec<Fault> {
    let mut faults = Vec::new();
    if !view.objects.is_empty() {
        for (name, view, poses, sigma) in [("prior", survey, priors, sigma), ("truth", view, truths, None)] {
            let images = Images { measured, poses, reach: sigma.map_or(0.0, |sigma| reach(view, measured, sigma)) };
            let fault = out_of_view(view, name, &sample(poses.iter().flatten()), &images, file);
            faults.extend(fault.or_else(|| beside(view, name, &images, file)));
        }
    }
    if faults.is_empty() {
        let both: Vec<(Pose, Pose)> = priors.iter().zip(truths).filter_map(|(p, t)| Some(((*p)?, (*t)?))).collect();
        faults.extend(apart(view, &sample(both.iter()), sigma, file));
    }
    faults
}

/// The fault of measured depths that differ from those of the site at the true poses: a focal length or a baseline that
/// is off. `pairs` are the true pose and the matches of a pair each.
pub(crate) fn scale_fault(view: &View<'_>, pairs: &[(Pose, Vec<StereoPixels>)], file: &Path) -> Option<Fault> {
    /// The minimum number of points, and the minimum error.
    const FEW: usize = 8;
    const LARGE: f64 = 0.03;
    let ratios = distance_ratios(view, pairs);
    let at = |part: usize| ratios.get(ratios.len() * part / 4).copied();
    let (low, middle, high) = (at(1)?, at(2)?, at(3)?);
    // Hidden points and wrong matches scatter the ratios; an error of the rig moves them together.
    let sure = ratios.len() >= FEW && (middle - 1.0).abs() > LARGE && (high - low) < (middle - 1.0).abs();
    sure.then(|| {
        let value = format!(
            "{:.1} % {} in {} points at the true poses",
            100.0 * (middle - 1.0).abs(),
            if middle > 1.0 { "longer" } else { "shorter" },
            ratios.len()
        );
        let fault = Fault::new("measured distances that differ from the site's", file).value(value);
        fault.remedy("the baseline or the focal length is off, or the survey: calibrate again, in water")
    })
}

/// The ratios of measured and predicted depths of the points with one match near their projection, in order.
pub(super) fn distance_ratios(view: &View<'_>, pairs: &[(Pose, Vec<StereoPixels>)]) -> Vec<f64> {
    /// The maximum distance (px) of a match from the projection of its point.
    const NEAR: f64 = 3.0;
    let mut ratios = Vec::new();
    for (pose, seen) in pairs {
        let camera_from_world = pose.inverse();
        for point in view.objects.iter().flatten() {
            let point = camera_from_world * *point;
            let Some(pixel) = view.rig.left().project(&point).filter(|_| point.coords.z < MAX_DEPTH) else { continue };
            let mut near = seen.iter().filter(|seen| seen.left.distance(&pixel) < NEAR);
            let (Some(only), None) = (near.next(), near.next()) else { continue };
            let measured = view.rig.triangulate(&UncertainPixels::independent(*only, 1.0));
            ratios.extend(measured.ok().map(|measured| measured.point.coords.z / point.coords.z));
        }
    }
    ratios.sort_by(f64::total_cmp);
    ratios
}

/// At most [`JUDGED`] of the items, evenly spread.
fn sample<'i, T: Copy + 'i>(items: impl Iterator<Item = &'i T>) -> Vec<T> {
    let all: Vec<T> = items.copied().collect();
    all.iter().step_by(all.len().div_ceil(JUDGED).max(1)).copied().collect()
}

/// The matches of some pairs, with the poses that are compared with them.
struct Images<'a> {
    measured: &'a [MeasuredPair],
    poses: &'a [Option<Pose>],
    /// The largest displacement (px) of a prediction by the error of the pose.
    reach: f64,
}

impl Images<'_> {
    fn confirmed(&self, view: &View<'_>, undo: &dyn Fn(&Pose) -> Pose) -> f64 {
        confirmed(view, self.measured, self.poses, undo, self.reach)
    }

    /// Whether the images confirm more points if `one` is undone than if `other` is.
    fn prefer(&self, view: &View<'_>, one: &Mistake, other: &Mistake) -> bool {
        self.confirmed(view, &*one.undo) > self.confirmed(view, &*other.undo)
    }
}

/// The fault of poses that put objects in view where the images do not show them, with the mistake of the poses or of
/// the calibration that explains it.
fn beside(view: &View<'_>, name: &str, images: &Images<'_>, file: &Path) -> Option<Fault> {
    let given = images.confirmed(view, &|pose| *pose);
    let of_poses = mistakes(&view.body_from_camera).into_iter();
    let counts = of_poses.map(|mistake| (images.confirmed(view, &*mistake.undo), mistake.name, mistake.remedy));
    let of_rig = rig_mistakes(view.rig).into_iter().map(|mistake| {
        let other = View { rig: &mistake.rig, body_from_camera: view.body_from_camera, objects: view.objects.clone() };
        let measured: Vec<MeasuredPair> = images.measured.iter().map(|pair| pair.again(&other)).collect();
        let count = confirmed(&other, &measured, images.poses, &|pose| *pose, images.reach);
        (count, mistake.name.to_owned(), mistake.remedy)
    });
    let (count, mistake, remedy) =
        counts.chain(of_rig).reduce(|best, next| if next.0 > best.0 { next } else { best })?;
    is_clearly_more(count, given).then(|| {
        let what = format!("poses of the {name} that contradict the images");
        let value = format!("matches lie at {given} predicted feature points as given, at {count} {mistake}");
        Fault::new(what, file).value(value).remedy(remedy)
    })
}

/// The displacement (px) of predictions by three standard deviations (m, rad) of a prior, at the depth of the matches.
fn reach(view: &View<'_>, measured: &[MeasuredPair], (position, attitude): (f64, f64)) -> f64 {
    let depth = median_depth(measured).unwrap_or(f64::INFINITY);
    3.0 * view.rig.mean_focal() * (position / depth).hypot(attitude)
}

/// The fault of poses that put no object in view, with the mistake that explains them if one does.
fn out_of_view(view: &View<'_>, name: &str, poses: &[Pose], images: &Images<'_>, file: &Path) -> Option<Fault> {
    let n = poses.len();
    let given = view.count(poses, &|pose| *pose);
    /// Fewer pairs may lie beside the objects by chance.
    const MIN_PAIRS: usize = 3;
    // A dive may pass the objects in few pairs only.
    if n < MIN_PAIRS || 3 * given > n {
        return None;
    }
    let counts =
        mistakes(&view.body_from_camera).into_iter().map(|mistake| (view.count(poses, &*mistake.undo), mistake));
    // Of equal counts the one that the images confirm, else the first, the more usual mistake.
    let best = counts.reduce(|best, next| match next.0.cmp(&best.0) {
        Ordering::Greater => next,
        Ordering::Equal if next.0 > 0 && images.prefer(view, &next.1, &best.1) => next,
        _ => best,
    });
    let what = format!("poses of the {name} that put no object in view");
    let fault = Fault::new(what, file);
    // A wrong pose may show an object by chance, in few pairs.
    let explains =
        |count: usize| 10 * given <= n && 2 * count >= n && count > given || 10 * count >= 9 * n && count >= 3 * given;
    match best.filter(|(count, _)| explains(*count)) {
        Some((count, mistake)) => {
            let value = format!("in view in {given} of {n} pairs as given, in {count} {}", mistake.name);
            Some(fault.value(value).remedy(mistake.remedy))
        }
        None if given == 0 => {
            let remedy = "check the world frame of poses and survey, and that poses are world_from_camera in metres";
            Some(fault.value(format!("in view in 0 of {n} pairs")).remedy(remedy))
        }
        None => None,
    }
}

/// The fault of a prior that contradicts the truth, with the mistake that explains it if one does.
fn apart(view: &View<'_>, both: &[(Pose, Pose)], sigma: Option<(f64, f64)>, file: &Path) -> Option<Fault> {
    /// A prior beyond this many standard deviations in most pairs contradicts the truth.
    const FAR: f64 = 6.0;
    let (position, attitude) = sigma.filter(|_| both.len() >= 3)?;
    let measure = |undo: &dyn Fn(&Pose) -> Pose| {
        let mut all: Vec<(f64, f64, f64)> = both
            .iter()
            .map(|(prior, truth)| {
                let prior = undo(prior);
                let off = (prior.translation() - truth.translation()).norm();
                let turned = prior.rotation().angle_to(&truth.rotation());
                ((off / position).max(turned / attitude), off, turned)
            })
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all[all.len() / 2]
    };
    let (given, off, turned) = measure(&|pose| *pose);
    if given <= FAR {
        return None;
    }
    let value = format!(
        "{off:.2} m and {:.1}° apart in the middle pair, its standard deviations are {position:.2} m and {:.1}°",
        turned.to_degrees(),
        attitude.to_degrees()
    );
    let explained = mistakes(&view.body_from_camera).into_iter().find(|mistake| measure(&*mistake.undo).0 <= FAR);
    let fault = Fault::new("a prior that contradicts the truth", file);
    Some(match explained {
        Some(mistake) => fault.value(format!("{value}; they agree {}", mistake.name)).remedy(mistake.remedy),
        None => fault.value(value).remedy("check both trajectories, or enlarge the standard deviations of the prior"),
    })
}

/// The known mistakes, the usual ones first.
pub(super) fn mistakes(body_from_camera: &Transform<Body, Camera>) -> Vec<Mistake> {
    let mut all: Vec<Mistake> = Vec::new();
    let mut add = |name: &str, remedy: &'static str, undo: Box<dyn Fn(&Pose) -> Pose>| {
        all.push(Mistake { name: name.to_owned(), remedy, undo });
    };
    const INVERT: &str =
        "write world_from_camera; COLMAP's images and T_cam_world are camera_from_world and must be inverted";
    const ORDER: &str = "name the columns in a comment, `# seconds tx ty tz qx qy qz qw`, in the order of the file";
    let inverse = |pose: &Pose| pose.inverse().relabel();
    let w_first = |pose: &Pose| with_rotation(pose, |q| Quaternion::new(q.i, q.j, q.k, q.w));
    let w_last = |pose: &Pose| with_rotation(pose, |q| Quaternion::new(q.k, q.w, q.i, q.j));
    add("if the inverse is taken (camera_from_world)", INVERT, Box::new(inverse));
    add("if w is read first (qw qx qy qz)", ORDER, Box::new(w_first));
    add("if w is read last (qx qy qz qw)", ORDER, Box::new(w_last));
    let enu = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    add(
        "if the world's axes are exchanged (ENU for NED)",
        "give poses and survey in one world: x and y exchanged, z negated turns ENU into NED",
        Box::new(move |pose| turned(&enu, pose)),
    );
    let mounted = *body_from_camera;
    if mounted != Transform::identity() {
        add(
            "if they are poses of the vehicle (body_from_camera is applied)",
            "give poses of the left camera: world_from_body · body_from_camera",
            Box::new(move |pose| pose.relabel::<World, Body>() * mounted),
        );
    }
    for (name, axes) in [
        ("of a camera with y up and z backwards (OpenGL)", [[1, 0, 0], [0, -1, 0], [0, 0, -1]]),
        (
            "of the vehicle, x forward, y left, z up, with the camera looking forward",
            [[0, 0, 1], [-1, 0, 0], [0, -1, 0]],
        ),
        (
            "of the vehicle, x forward, y right, z down, with the camera looking forward",
            [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
        ),
        ("of the vehicle, x forward, y left, z up, with the camera looking down", [[0, -1, 0], [-1, 0, 0], [0, 0, -1]]),
        (
            "of the vehicle, x forward, y right, z down, with the camera looking down",
            [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        ),
    ] {
        let axes = Matrix3::from_fn(|row, column| f64::from(axes[row][column]));
        add(
            &format!("if they are poses {name}"),
            "give poses of the left camera with x right, y down and z forward",
            Box::new(move |pose| axes_of(pose, &axes)),
        );
    }
    for (name, unit) in [("millimetres", 1e-3), ("centimetres", 1e-2), ("kilometres", 1e3)] {
        add(
            &format!("if positions are in {name}"),
            "give positions in metres, or name the unit in the header: `tx [mm]`",
            Box::new(move |pose| Transform::new(pose.rotation(), pose.translation() * unit)),
        );
    }
    add(
        "if the rotations alone are inverted (JPL quaternions, or those of camera_from_world)",
        "give the rotation of world_from_camera: negate qx, qy and qz",
        Box::new(conjugated),
    );
    add("if the inverse is taken and w is read first", INVERT, Box::new(move |pose| inverse(&w_first(pose))));
    add(
        "if the inverse is taken in a world with exchanged axes (ENU for NED)",
        INVERT,
        Box::new(move |pose| turned(&enu, &inverse(pose))),
    );
    all
}

/// The pose with its quaternion read in another order.
fn with_rotation(pose: &Pose, read: impl Fn(&UnitQuaternion<f64>) -> Quaternion<f64>) -> Pose {
    Transform::new(UnitQuaternion::new_normalize(read(&pose.rotation())), pose.translation())
}

/// The pose with its rotation inverted and its position kept.
fn conjugated(pose: &Pose) -> Pose {
    Transform::new(pose.rotation().inverse(), pose.translation())
}

/// The pose in a world with other axes.
fn turned(axes: &Matrix3<f64>, pose: &Pose) -> Pose {
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*axes));
    Transform::new(turn * pose.rotation(), axes * pose.translation())
}

/// The pose of a camera whose axes are the columns of `axes` in the frame of the given pose.
fn axes_of(pose: &Pose, axes: &Matrix3<f64>) -> Pose {
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*axes));
    Transform::new(pose.rotation() * turn, pose.translation())
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use seafix_geometry::Pinhole;

    use super::*;

    fn rig() -> StereoRig {
        let camera = Pinhole::new([1024, 768], [500.0; 2], [511.5, 383.5], &[]).unwrap();
        StereoRig::new(camera, camera, Transform::new(UnitQuaternion::identity(), Vector3::new(-0.25, 0.0, 0.0)))
            .unwrap()
    }

    /// Cameras at 3 m around an object at (10, -20, 40), each looking at it.
    fn walk() -> (Vec<Vec<Point<World>>>, Vec<Pose>) {
        let middle = Vector3::new(10.0, -20.0, 40.0);
        let corners = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.1], [0.0, 0.3, -0.1], [0.2, 0.2, 0.2]];
        let points = corners.iter().map(|corner| Point::from(middle + Vector3::from(*corner))).collect();
        let pose = |k: usize| {
            let turn =
                UnitQuaternion::from_euler_angles(0.4 + 0.1 * k as f64, 0.7 - 0.2 * k as f64, 0.3 + 0.4 * k as f64);
            Transform::new(turn, middle - turn * Vector3::new(0.1, 0.0, 3.0))
        };
        (vec![points], (0..6).map(pose).collect())
    }

    fn said(undo: &dyn Fn(&Pose) -> Pose, mounted: Transform<Body, Camera>) -> Option<String> {
        let (objects, poses) = walk();
        let rig = rig();
        let view = View { rig: &rig, body_from_camera: mounted, objects };
        let wrong: Vec<Option<Pose>> = poses.iter().map(|pose| Some(undo(pose))).collect();
        let faults = poses_faults([&view; 2], &wrong, &[], None, &[], Path::new("prior.tum"));
        faults.first().map(ToString::to_string)
    }

    /// Each mistake, made on sound poses, is named; sound poses are not doubted.
    #[test]
    fn the_mistake_is_named() {
        let none = Transform::identity();
        assert_eq!(said(&|pose| *pose, none), None);
        type Mistake<'a> = &'a dyn Fn(&Pose) -> Pose;
        let cases: [(Mistake<'_>, &str); 6] = [
            (
                &|pose| pose.inverse().relabel(),
                "in view in 0 of 6 pairs as given, in 6 if the inverse is taken (camera_from_world)",
            ),
            (&|pose| with_rotation(pose, |q| Quaternion::new(q.k, q.w, q.i, q.j)), "if w is read first"),
            (&conjugated, "if the rotations alone are inverted (JPL"),
            (&|pose| turned(&Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0), pose), "ENU for NED"),
            (&|pose| Transform::new(pose.rotation(), pose.translation() * 1e3), "if positions are in millimetres"),
            (&|pose| axes_of(pose, &Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0)), "OpenGL"),
        ];
        for (mistake, name) in cases {
            let said = said(mistake, none).unwrap();
            assert!(said.contains(name), "{name}: {said}");
        }
        let mounted = Transform::new(UnitQuaternion::from_euler_angles(1.2, 0.3, 2.0), Vector3::new(0.5, 0.1, -0.2));
        let vehicle = |pose: &Pose| (*pose * mounted.inverse().relabel::<Camera, Camera>()).relabel();
        assert!(said(&vehicle, mounted).unwrap().contains("poses of the vehicle (body_from_camera"));
    }

    #[test]
    fn a_baseline_off_by_five_per_cent_is_named() {
        let (objects, poses) = walk();
        let rig = rig();
        let longer = StereoRig::new(
            *rig.left(),
            *rig.right(),
            Transform::new(UnitQuaternion::identity(), rig.right_from_left().translation() * 1.05),
        );
        let longer = longer.unwrap();
        let see = |pose: &Pose| objects[0].iter().filter_map(|point| rig.project(&(pose.inverse() * *point))).collect();
        let pairs: Vec<(Pose, Vec<StereoPixels>)> = poses.iter().map(|pose| (*pose, see(pose))).collect();
        let said = |rig: &StereoRig| {
            let view = View { rig, body_from_camera: Transform::identity(), objects: objects.clone() };
            scale_fault(&view, &pairs, Path::new("dataset.toml")).map(|fault| fault.to_string())
        };
        assert_eq!(said(&rig), None);
        assert!(said(&longer).unwrap().contains("5.0 % longer in 24 points"), "{:?}", said(&longer));
    }

    #[test]
    fn a_prior_far_from_the_truth_is_named() {
        let (objects, truth) = walk();
        let rig = rig();
        let view = View { rig: &rig, body_from_camera: Transform::identity(), objects };
        let truths: Vec<Option<Pose>> = truth.iter().copied().map(Some).collect();
        let faults = |step: f64| {
            let moved =
                |pose: &Pose| Transform::new(pose.rotation(), pose.translation() + Vector3::new(step, 0.0, 0.0));
            let priors: Vec<Option<Pose>> = truth.iter().map(|pose| Some(moved(pose))).collect();
            poses_faults([&view; 2], &priors, &truths, Some((0.1, 0.01)), &[], Path::new("prior.tum"))
        };
        assert!(faults(0.2).is_empty());
        assert!(
            faults(0.7)[0].to_string().starts_with("a prior that contradicts the truth in prior.tum: 0.70 m and 0.0°")
        );
    }

    /// Objects to all sides are in view of the prior too, so that only its attitude speaks against it.
    #[test]
    fn a_prior_with_conjugate_quaternions_is_explained_by_the_truth() {
        let (_, truth) = walk();
        let (rig, steps) = (rig(), || (-8..=8).map(|k| 0.5 * f64::from(k)));
        let sides = steps().flat_map(|x| steps().flat_map(move |y| [[x, y, -4.0], [x, y, 4.0]]));
        let wall = sides.flat_map(|[a, b, c]| [[a, b, c], [c, a, b], [b, c, a]]);
        let around = wall.map(|at| Point::from(truth[0].translation() + Vector3::from(at))).collect();
        let view = View { rig: &rig, body_from_camera: Transform::identity(), objects: vec![around] };
        let priors: Vec<Option<Pose>> = truth.iter().map(|pose| Some(conjugated(pose))).collect();
        let truths: Vec<Option<Pose>> = truth.iter().copied().map(Some).collect();
        let faults = poses_faults([&view; 2], &priors, &truths, Some((0.1, 0.01)), &[], Path::new("prior.tum"));
        let said = faults[0].to_string();
        assert!(said.contains("contradicts the truth") && said.contains("they agree if the rotations alone"), "{said}");
    }
}
