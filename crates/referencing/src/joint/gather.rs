//! Points of objects without a fix of their own, searched at their predicted positions.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, Covariance6, MeasuredPoint, Object, StereoRig, Transform, World};

use super::{
    fix::{JointFix, joint_fix},
    member::{Member, ObjectObservations, Placement},
};
use crate::{
    a_contrario::absence::by_nfa,
    accept::{acceptance::Acceptance, max_p_wrong::MaxPWrong},
    candidates::{Candidates, Gate, candidates},
    chi_square::chi_square,
    observations::Observations,
    problem::{Correspondence, Prior, PriorBound},
    site::{model::ModelPoint, target::Target},
    solve::degeneracy::Degenerate,
};

/// The contribution of objects without a fix of their own to a joint fix.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Gathered {
    /// The objects that take part, by index, with their pairs.
    pub added: Vec<(usize, Vec<Correspondence>)>,
    /// The possibly visible objects that take no part, by index, with the reason.
    pub left_out: Vec<(usize, Unadded)>,
}

/// The reason for which an object's points take no part in a joint fix.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unadded {
    /// The object has no survey, so it needs three points of its own.
    #[error("no survey and no fix of its own: its pose is unknown")]
    Unsurveyed,
    /// The correspondence of its points is ambiguous.
    #[error("ambiguous candidates: {points} of its points have several near their prediction, or share theirs")]
    Several {
        /// The number of points with an ambiguous candidate.
        points: usize,
    },
    /// Its pairs are too likely to be a false alarm (a-contrario test).
    #[error("P(wrong) of {size} points near their predictions is {p_wrong:.1e}, at most {max} is allowed")]
    AContrario {
        /// The number of pairs.
        size: usize,
        /// The probability by the number of false alarms: the expected number of random sets of this size or larger.
        p_wrong: f64,
        /// The limit, [`Acceptance::max_p_wrong`].
        max: MaxPWrong,
    },
    /// Its points contradict their joint prediction.
    #[error("contradiction: {size} of its points raise χ² by {chi2:.1}, the limit is {limit:.1}")]
    Contradiction {
        /// The number of pairs.
        size: usize,
        /// The increase of χ² of pixels and surveys by these pairs.
        chi2: f64,
        /// The limit, which correct pairs exceed with probability one minus the confidence.
        limit: f64,
    },
    /// The joint fix with its points is degenerate.
    #[error("{0}")]
    Degenerate(#[from] Degenerate),
}

/// The points of objects without a fix that contribute to the joint fix of the `fixed` ones, whose features use the cloud
/// points `used`.
///
/// One or two points of an object determine no pose, but with a survey each of them adds four pixel coordinates. The
/// joint fix of `fixed` determines the camera's pose. From it and the survey the points of every other object are
/// predicted, with the covariance of both. A cloud point that no fixed object uses is a candidate within the
/// Mahalanobis gate of [`Acceptance::confidence`] (Bar-Shalom and Fortmann, *Tracking and Data Association*, 1988),
/// and, if Stage 1 listed candidates, among those `listed`. A set of pairs is added on three conditions: no pair has
/// another candidate on either side; the probability of a false alarm, NFA/(1 + NFA), is at most
/// [`Acceptance::max_p_wrong`]; and the joint fix with the pairs raises χ² by no more than its limit, since an object's points share the survey's error and all points share the
/// camera's. Objects are added in their order.
///
/// Nothing is added if `fixed` has no joint fix or contradicts itself: the wrong object is unknown then.
///
/// # Panics
///
/// If an index is out of range.
pub fn gather(
    rig: &StereoRig,
    targets: &[Target],
    cloud: &[MeasuredPoint],
    listed: &[Option<&Candidates>],
    (fixed, used): (&ObjectObservations, &[usize]),
    acceptance: &Acceptance,
) -> Gathered {
    let mut gathered = Gathered::default();
    let members: Vec<Member> = targets.iter().map(Target::member).collect();
    let mut object_observations = fixed.clone();
    let mut free: Vec<bool> = cloud.iter().map(|point| point.pixels.is_some()).collect();
    used.iter().for_each(|&point| free[point] = false);
    let Some(mut fix) = agreeing(rig, &members, &object_observations, acceptance.confidence) else { return gathered };
    let (site_from_camera, covariance) = &fix.site_from_camera[0];
    let mut others: Vec<Gates> = Vec::new();
    for (object, target) in targets.iter().enumerate().filter(|(object, _)| !fixed.shows(*object)) {
        match members[object].placement {
            Placement::Displaced if listed[object].is_some() => gathered.left_out.push((object, Unadded::Unsurveyed)),
            Placement::Displaced => {}
            _ => {
                let gates = Gates::of(object, target, site_from_camera, covariance, cloud, acceptance.confidence);
                others.extend(gates.map(|gates| gates.only(&free, listed[object])).filter(Gates::any));
            }
        }
    }
    let mut claims = vec![0_usize; cloud.len()];
    others.iter().flat_map(|gates| gates.lists.iter().flatten()).for_each(|&j| claims[j] += 1);
    for gates in others {
        let (object, points) = (gates.object, &targets[gates.object].points);
        let pairs = gates.alone(&claims);
        match gates.bears(&pairs, cloud, &free, acceptance).and_then(|()| {
            let mut more = object_observations.clone();
            more.see(object, &Observations::of(&pairs, points, cloud, Some(rig)));
            let next = joint_fix(rig, &members, std::slice::from_ref(&more))?;
            let (size, chi2) = (pairs.len(), next.chi2 - fix.chi2);
            let limit = chi_square(4 * size, acceptance.confidence);
            // A NaN is rejected as well.
            if chi2 <= limit { Ok((more, next)) } else { Err(Unadded::Contradiction { size, chi2, limit }) }
        }) {
            Ok(better) => {
                (object_observations, fix) = better;
                gathered.added.push((object, pairs));
            }
            Err(why) => gathered.left_out.push((object, why)),
        }
    }
    gathered.left_out.sort_by_key(|(object, _)| *object);
    gathered
}

/// The joint fix of one instant, if its χ² is within the limit.
fn agreeing(
    rig: &StereoRig,
    members: &[Member],
    object_observations: &ObjectObservations,
    confidence: f64,
) -> Option<JointFix> {
    let fix = joint_fix(rig, members, std::slice::from_ref(object_observations)).ok()?;
    (fix.chi2 <= chi_square(fix.dof.max(1), confidence)).then_some(fix)
}

/// The predicted positions of an object's points, with their candidates.
struct Gates {
    object: usize,
    /// The predicted position of each point in the camera frame, and its covariance without measurement noise.
    places: Vec<(Vector3<f64>, Matrix3<f64>)>,
    /// The candidates of each point.
    lists: Vec<Vec<usize>>,
}

impl Gates {
    /// `None` if no pose relative to the object follows from the pose relative to the site.
    fn of(
        object: usize,
        target: &Target,
        site_from_camera: &Transform<Object, Camera>,
        covariance: &Covariance6<Object, Camera>,
        cloud: &[MeasuredPoint],
        confidence: f64,
    ) -> Option<Self> {
        // The site's frame is the world's.
        let known = Covariance6::<World, Camera>::new(covariance.matrix);
        let prior = target.prior(&site_from_camera.relabel(), &known)?;
        let Prior { object_from_camera, bound: PriorBound::Gaussian(spread) } = &prior else { return None };
        let camera_from_object = object_from_camera.inverse();
        let place = |point: &ModelPoint| {
            let at = camera_from_object * point.at;
            (at.coords, spread.of_point(&at) + Matrix3::identity() * (point.sigma * point.sigma))
        };
        let lists = candidates(&target.points, cloud, Some(&prior), &Gate::ChiSquare(confidence), None).lists;
        Some(Self { object, places: target.points.iter().map(place).collect(), lists })
    }

    /// Removes the cloud points that are not `free` or not `listed`.
    fn only(mut self, free: &[bool], listed: Option<&Candidates>) -> Self {
        for (k, list) in self.lists.iter_mut().enumerate() {
            list.retain(|&j| free[j] && listed.is_none_or(|listed| listed.lists[k].contains(&j)));
        }
        self
    }

    fn any(&self) -> bool {
        self.lists.iter().any(|list| !list.is_empty())
    }

    /// The pairs without another candidate on either side.
    fn alone(&self, claims: &[usize]) -> Vec<Correspondence> {
        let pair = |(model, list): (usize, &Vec<usize>)| match list[..] {
            [cloud] if claims[cloud] == 1 => Some(Correspondence { model, cloud }),
            _ => None,
        };
        self.lists.iter().enumerate().filter_map(pair).collect()
    }

    /// Whether there are pairs and their NFA is within the limit.
    fn bears(
        &self,
        pairs: &[Correspondence],
        cloud: &[MeasuredPoint],
        free: &[bool],
        acceptance: &Acceptance,
    ) -> Result<(), Unadded> {
        if pairs.is_empty() {
            return Err(Unadded::Several { points: self.lists.iter().filter(|list| !list.is_empty()).count() });
        }
        let (size, max) = (pairs.len(), acceptance.max_p_wrong);
        let p_wrong = by_nfa(self.expected(size, cloud, free, acceptance.confidence));
        if max.allows(p_wrong) { Ok(()) } else { Err(Unadded::AContrario { size, p_wrong, max }) }
    }

    /// The expected number of random sets of `size` or more points in the gates.
    ///
    /// It is Σ_{j ≥ size} e_j(p), with e_j the elementary symmetric polynomials and p_k the volume of a point's gate
    /// times the density of the cloud about it.
    fn expected(&self, size: usize, cloud: &[MeasuredPoint], free: &[bool], confidence: f64) -> f64 {
        let gate = 4.0 / 3.0 * std::f64::consts::PI * chi_square(3, confidence).powf(1.5);
        // e_0 … e_size of the points so far; the last also counts all larger sets.
        let mut sets = vec![0.0; size + 1];
        sets[0] = 1.0;
        for ((place, spread), list) in self.places.iter().zip(&self.lists) {
            let mut near: Vec<(f64, usize)> = (0..cloud.len())
                .filter(|&j| free[j])
                .map(|j| ((cloud[j].position.at.coords - place).norm(), j))
                .collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0));
            let noise = near.first().map_or_else(Matrix3::zeros, |&(_, j)| cloud[j].position.covariance);
            let volume = gate * (spread + noise).determinant().max(0.0).sqrt();
            near.retain(|(_, j)| !list.contains(j));
            let p = volume * density(&near);
            sets[size] += p * sets[size];
            for j in (1..=size).rev() {
                sets[j] += p * sets[j - 1];
            }
        }
        sets[size]
    }
}

/// The density (1/m³) of points at these distances from a position, from the nearest four.
fn density(near: &[(f64, usize)]) -> f64 {
    const NEAREST: usize = 4;
    let count = near.len().min(NEAREST);
    match count.checked_sub(1).map(|last| near[last].0) {
        Some(radius) => count as f64 / (4.0 / 3.0 * std::f64::consts::PI * radius.powi(3)),
        None => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint::{
        displaced::joint_fixes,
        tests::{MODEL, SIGMA, instant, normal, pose_of, rig},
    };
    use crate::site::{
        model::{Site, SiteObject},
        target::TargetKind,
    };
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{Pixel, Point, StereoPixels, UncertainPixels, UncertainPoint, triad};

    /// Three objects of five points each, one cloud, and the ground truth.
    struct Scene {
        rig: StereoRig,
        targets: Vec<Target>,
        /// The true pose of each object's frame.
        truly: Vec<Transform<World, Object>>,
        cloud: Vec<MeasuredPoint>,
        /// The object and the point that each of the first cloud points shows.
        shows: Vec<(usize, usize)>,
    }

    /// A scene with the first `seen` points of each object, and `clutter` random points.
    fn scene(seen: [usize; 3], survey_sigma: f64, clutter: usize, rng: &mut ChaCha8Rng) -> Scene {
        let rig = rig();
        let (mut objects, mut truly, mut places, mut shows) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (k, stands) in [pose_of(0.0, 0.0), pose_of(0.8, 0.0), pose_of(-0.9, 0.2)].into_iter().enumerate() {
            let stands: Transform<World, Object> = stands.relabel();
            let points: Vec<Point<World>> = MODEL.iter().map(|&at| stands * Point::from(at)).collect();
            let base = [points[0], points[1], points[2]];
            let frame = |[a, b, c]: [Point<World>; 3]| triad(&a, &b, &c).unwrap();
            let surveyed = base.map(|at| at + Vector3::from_fn(|_, _| normal(rng) * survey_sigma));
            let own = |(i, at): (usize, &Point<World>)| ModelPoint::exact(format!("P{i}"), frame(base).inverse() * *at);
            objects.push(SiteObject {
                id: format!("o{k}"),
                base: [0, 1, 2],
                base_in_world: Some(surveyed),
                survey_sigma,
                world_from_object: Some(frame(surveyed)),
                points: points.iter().enumerate().map(own).collect(),
                edges: Vec::new(),
                interest: Vec::new(),
            });
            truly.push(frame(base));
            shows.extend((0..seen[k]).map(|i| (k, i)));
            places.extend(points[..seen[k]].iter().copied());
        }
        places.extend((0..clutter).map(|_| {
            let at = Vector3::from_fn(|_, _| rng.random_range(-1.5..1.5));
            Point::from(at)
        }));
        let camera_from_world: Transform<Camera, World> = instant(1).inverse().relabel();
        let see = |place: &Point<World>| {
            let exact = rig.project(&(camera_from_world * *place)).unwrap();
            let mut off = |p: Pixel| Pixel { u: p.u + SIGMA * normal(rng), v: p.v + SIGMA * normal(rng) };
            let pixels =
                UncertainPixels::independent(StereoPixels { left: off(exact.left), right: off(exact.right) }, SIGMA);
            let found = rig.triangulate(&pixels).unwrap();
            let position = UncertainPoint { at: found.point, covariance: found.covariance };
            MeasuredPoint { position, pixels: Some(pixels) }
        };
        let cloud = places.iter().map(see).collect();
        let site = Site { name: "test".to_owned(), frame: 0, objects, warnings: Vec::new() };
        Scene { rig, targets: site.targets(TargetKind::Joint).unwrap(), truly, cloud, shows }
    }

    impl Scene {
        /// The pairs of the first object, which has a fix of its own.
        fn fixed(&self) -> Vec<(usize, Vec<Correspondence>)> {
            let own = self.shows.iter().enumerate().filter(|(_, (object, _))| *object == 0);
            vec![(0, own.map(|(cloud, &(_, model))| Correspondence { model, cloud }).collect())]
        }

        fn gathered(&self) -> Gathered {
            self.gather(&self.targets, &[None; 3])
        }

        fn gather(&self, targets: &[Target], listed: &[Option<&Candidates>]) -> Gathered {
            let mut fixed = ObjectObservations::default();
            let mut used = Vec::new();
            for (object, pairs) in self.fixed() {
                let points = &targets[object].points;
                fixed.see(object, &Observations::of(&pairs, points, &self.cloud, Some(&self.rig)));
                used.extend(pairs.iter().map(|pair| pair.cloud));
            }
            gather(&self.rig, targets, &self.cloud, listed, (&fixed, &used), &Acceptance::default())
        }

        /// The pose relative to the first object from these pairs.
        fn fix(&self, all: &[(usize, Vec<Correspondence>)]) -> crate::joint::relative_pose::RelativePose {
            let mut object_observations = ObjectObservations::default();
            for (object, pairs) in all {
                let points = &self.targets[*object].points;
                object_observations.see(*object, &Observations::of(pairs, points, &self.cloud, Some(&self.rig)));
            }
            let members: Vec<Member> = self.targets.iter().map(Target::member).collect();
            joint_fixes(&self.rig, &members, &[object_observations], 0.9999).unwrap().object_from_camera[0].unwrap()
        }

        /// The true pose relative to an object.
        fn truth(&self, object: usize) -> Transform<Object, Camera> {
            self.truly[object].inverse() * instant(1).relabel::<World, Camera>()
        }
    }

    /// Two points of one object and one of another, neither with a fix of its own: every pair is true, the covariance
    /// is consistent (NEES), and the fix is more accurate than that of the first object alone, by its covariance and
    /// over the draws.
    ///
    /// Fails if the covariance of the predicted positions has a lever of the wrong sign.
    #[test]
    fn one_or_two_points_of_others_make_the_fix_better() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let draws = 300;
        let (mut found, mut nees, mut alone, mut joint) = (0.0, 0.0, 0.0, 0.0);
        for _ in 0..draws {
            let scene = scene([5, 2, 1], 5e-4, 20, &mut rng);
            let gathered = scene.gathered();
            for (object, pairs) in &gathered.added {
                assert!(pairs.iter().all(|pair| scene.shows.get(pair.cloud) == Some(&(*object, pair.model))));
                found += pairs.len() as f64;
            }
            let by_itself = scene.fix(&scene.fixed());
            let all: Vec<_> = scene.fixed().into_iter().chain(gathered.added).collect();
            let (pose, covariance) = scene.fix(&all);
            assert!(covariance.matrix.trace() <= by_itself.1.matrix.trace() * 1.05);
            let truth = scene.truth(0);
            let xi = pose.error_to(&truth);
            nees += xi.dot(&covariance.matrix.cholesky().unwrap().solve(&xi)) / f64::from(draws);
            alone += (by_itself.0.translation() - truth.translation()).norm_squared();
            joint += (pose.translation() - truth.translation()).norm_squared();
        }
        assert!(found > 0.8 * 3.0 * f64::from(draws), "{found} of {}", 3 * draws);
        assert!((nees - 6.0).abs() < 4.0 * (12.0 / f64::from(draws)).sqrt(), "{nees}");
        assert!(joint < 0.9 * alone, "{joint} {alone}");
    }

    /// Clutter near the predicted positions of invisible points is not accepted as points.
    ///
    /// Fails without the NFA test: 122 sets in 300 scenes.
    #[test]
    fn clutter_is_not_taken_for_points() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let (mut added, mut rejected) = (0, 0);
        for _ in 0..300 {
            let gathered = scene([5, 0, 0], 1e-2, 600, &mut rng).gathered();
            added += gathered.added.len();
            rejected += gathered.left_out.len();
        }
        assert!(added <= 3, "{added} sets of clutter");
        assert!(rejected > 30, "only {rejected} sets of clutter were available for rejection");
    }

    /// Fails if the first of several candidates is taken.
    #[test]
    fn what_takes_no_part_is_reported_why() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let why = |scene: &Scene| scene.gathered().left_out.into_iter().map(|(_, why)| why).collect::<Vec<_>>();
        // A duplicated cloud point: the correspondence is ambiguous.
        let mut twice = scene([5, 1, 0], 5e-4, 0, &mut rng);
        twice.cloud.push(twice.cloud[5]);
        assert_eq!(why(&twice), [Unadded::Several { points: 1 }]);
        // Each point is within its own gate, but together they move as no rigid object does.
        let mut torn = scene([5, 4, 0], 2e-3, 0, &mut rng);
        for (k, point) in torn.cloud[5..].iter_mut().enumerate() {
            let pixels = point.pixels.as_mut().unwrap();
            pixels.at.left.v += if k % 2 == 0 { 3.0 } else { -3.0 };
            pixels.at.right.v += if k % 2 == 0 { 3.0 } else { -3.0 };
        }
        assert!(matches!(why(&torn)[..], [Unadded::Contradiction { size: 4, .. }]), "{:?}", why(&torn));
        // An object without a survey.
        let unknown = scene([5, 2, 0], 5e-4, 0, &mut rng);
        let mut targets = unknown.targets.clone();
        targets[1].world_from_object = None;
        let listed = Candidates::all(5, unknown.cloud.len());
        let lists = [Some(&listed), Some(&listed), None];
        let message = unknown.gather(&targets, &lists);
        assert_eq!(message, Gathered { added: Vec::new(), left_out: vec![(1, Unadded::Unsurveyed)] });
        // Stage 1 ran and listed nothing.
        let none = Candidates { lists: vec![Vec::new(); 5] };
        let lists = [Some(&listed), Some(&none), None];
        let scene = scene([5, 2, 0], 5e-4, 0, &mut rng);
        let message = scene.gather(&scene.targets, &lists);
        assert_eq!(message, Gathered::default());
    }
}
