//! The normal equations of a joint fix.

use std::collections::BTreeSet;

use faer::{Mat, Side, linalg::solvers::Solve};
use nalgebra::{Matrix3x6, Matrix6, Vector3, Vector6};
use seafix_geometry::{Camera, Object, StereoRig, Transform, so3::skew};

use super::member::{Member, ObjectObservations, Placement};
use crate::{
    observations::{Observation, Observations},
    solve::{
        degeneracy::{Degenerate, converged},
        likelihood::{
            descent::{Linearized as ObjectTerms, Term},
            mixed::Mixed,
            normal::{inverse, rounding},
            pixel_terms::{PixelTerms, TermTarget as PixelTarget},
        },
    },
};

/// All unknowns: the pose of each instant and of each object.
#[derive(Debug, Clone)]
pub(super) struct JointState {
    pub(super) poses: Vec<Transform<Object, Camera>>,
    pub(super) places: Vec<Transform<Object, Object>>,
}

/// The problem with prepared weights.
pub(super) struct System<'a> {
    members: &'a [Member],
    observations_by_frame: &'a [ObjectObservations],
    /// The points of each frame, without those of objects with edges.
    points: Vec<Vec<(usize, Observation)>>,
    pixel_terms: Vec<PixelTerms<'a>>,
    /// Objects with edges: the frame, the object, and its features together.
    mixed: Vec<(usize, usize, Mixed<'a>)>,
    /// The index of each object's block of six unknowns; `None` for an exact pose.
    unknowns: Vec<Option<usize>>,
    /// The inverse of each survey's covariance.
    surveys: Vec<Option<Matrix6<f64>>>,
    blocks: usize,
}

/// The points and edges of an object with edges in one frame.
pub(super) struct WithEdges<'a> {
    frame: usize,
    object: usize,
    data: Observations<'a>,
}

/// The objects with edges of every frame. Their features share model places, so that they are solved together.
pub(super) fn with_edges<'a>(rig: &'a StereoRig, observations_by_frame: &[ObjectObservations]) -> Vec<WithEdges<'a>> {
    let of_frame = |(frame, all): (usize, &ObjectObservations)| {
        let objects: BTreeSet<usize> = all.edges.iter().map(|(object, _)| *object).collect();
        let group = |object: usize| WithEdges {
            frame,
            object,
            data: Observations {
                points: all.points.iter().filter(|(o, _)| *o == object).map(|(_, point)| *point).collect(),
                edges: all.edges.iter().filter(|(o, _)| *o == object).map(|(_, edge)| *edge).collect(),
                rig: Some(rig),
            },
        };
        objects.into_iter().map(group).collect::<Vec<_>>()
    };
    observations_by_frame.iter().enumerate().flat_map(of_frame).collect()
}

struct Linearized {
    normal: Mat<f64>,
    gradient: Mat<f64>,
    cost: f64,
}

/// Maximum number of steps of one descent.
const MAX_STEPS: u64 = 100;
/// Decrement below which the cost is dominated by rounding.
const NEAR: f64 = 1e-4;
/// Decrement below which no improvement is left.
const NOTHING: f64 = 1e-18;

impl<'a> System<'a> {
    pub(super) fn new(
        rig: &'a StereoRig,
        members: &'a [Member],
        observations_by_frame: &'a [ObjectObservations],
        groups: &'a [WithEdges<'a>],
    ) -> Result<Self, Degenerate> {
        let mixed: Vec<(usize, usize, Mixed<'a>)> = groups
            .iter()
            .map(|group| Ok((group.frame, group.object, Mixed::of(&group.data, Some(rig), Some(rig))?)))
            .collect::<Result<_, Degenerate>>()?;
        let mut points = Vec::with_capacity(observations_by_frame.len());
        let mut pixel_terms = Vec::with_capacity(observations_by_frame.len());
        for object_observations in observations_by_frame {
            let own: Vec<(usize, Observation)> = object_observations
                .points
                .iter()
                .filter(|(object, _)| object_observations.edges.iter().all(|(o, _)| o != object))
                .copied()
                .collect();
            let mut seen = PixelTerms::new(rig);
            seen.see(&own.iter().map(|(_, point)| *point).collect::<Vec<_>>(), PixelTarget::Pixels)?;
            points.push(own);
            pixel_terms.push(seen);
        }
        let seen = |object: usize| observations_by_frame.iter().any(|observations| observations.shows(object));
        let mut blocks = observations_by_frame.len();
        let mut unknowns = Vec::with_capacity(members.len());
        let mut surveys = Vec::with_capacity(members.len());
        for (object, member) in members.iter().enumerate() {
            // An unobserved object is not estimated, and does not count as an undetermined motion.
            let open = member.placement != Placement::Exact && seen(object);
            unknowns.push(open.then_some(blocks));
            blocks += usize::from(open);
            surveys.push(match member.placement {
                Placement::Surveyed(covariance) if open => Some(inverse(&covariance.matrix)?),
                _ => None,
            });
        }
        Ok(Self { members, observations_by_frame, points, pixel_terms, mixed, unknowns, surveys, blocks })
    }

    /// The index of an object's block of six unknowns.
    pub(super) fn unknown(&self, object: usize) -> Option<usize> {
        self.unknowns[object]
    }

    /// The number of pixel coordinates, offsets and survey numbers minus that of the unknowns.
    pub(super) fn dof(&self) -> usize {
        let pixels: usize = self.observations_by_frame.iter().map(|all| 4 * (all.points.len() + all.edges.len())).sum();
        (pixels + 6 * self.surveys.iter().flatten().count()).saturating_sub(6 * self.blocks)
    }

    /// The normal equations at a state; `live` evaluates the weights at the fitted points.
    ///
    /// Otherwise the weights are those at the measured points, so that costs are comparable.
    fn linearize(&self, state: &JointState, live: bool) -> Result<Linearized, Degenerate> {
        let size = 6 * self.blocks;
        let mut all = Linearized { normal: Mat::zeros(size, size), gradient: Mat::zeros(size, 1), cost: 0.0 };
        for (f, (points, pixel_terms)) in self.points.iter().zip(&self.pixel_terms).enumerate() {
            let (r, t) = (state.poses[f].rotation_matrix(), state.poses[f].translation());
            for (k, (object, point)) in points.iter().enumerate() {
                let place = &state.places[*object];
                let at: Vector3<f64> = r.tr_mul(&((*place * point.model).coords - t));
                let term = if live { pixel_terms.live(k, &at) } else { pixel_terms.frozen(k, &at) };
                let term = term.ok_or(Degenerate::Hidden { index: k, depth: at.z })?;
                all.cost += term.cost;
                // Under T Exp(ξ) the point moves by [p]× φ − ρ, under S Exp(η) by R (ρ − [P]× φ).
                let mut by_pose = Matrix3x6::zeros();
                by_pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&skew(&at));
                by_pose.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
                by_pose.fixed_view_mut::<3, 3>(0, 3).neg_mut();
                all.add(f, f, &by_pose, &by_pose, &term);
                all.pull(f, &by_pose, &term);
                if let Some(o) = self.unknowns[*object] {
                    let turn = r.transpose() * place.rotation_matrix();
                    let mut by_place = Matrix3x6::zeros();
                    by_place.fixed_view_mut::<3, 3>(0, 0).copy_from(&(-turn * skew(&point.model.coords)));
                    by_place.fixed_view_mut::<3, 3>(0, 3).copy_from(&turn);
                    all.add(o, o, &by_place, &by_place, &term);
                    all.add(o, f, &by_place, &by_pose, &term);
                    all.pull(o, &by_place, &term);
                }
            }
        }
        for (f, object, mixed) in &self.mixed {
            let pose = state.places[*object].inverse() * state.poses[*f];
            let terms = if live { mixed.shared(&pose)? } else { mixed.independent(&pose)? };
            all.add_object(*f, self.unknowns[*object], &pose, &terms);
        }
        for (object, survey) in self.surveys.iter().enumerate() {
            let (Some(information), Some(o)) = (survey, self.unknowns[object]) else { continue };
            let eta = self.members[object].site_from_object.error_to(&state.places[object]);
            all.cost += eta.dot(&(information * eta));
            let by_step = right_jacobian_inverse(&eta);
            let pull = by_step.tr_mul(&(information * eta));
            let information = by_step.tr_mul(&(information * by_step));
            for i in 0..6 {
                all.gradient[(6 * o + i, 0)] -= pull[i];
                for j in 0..6 {
                    all.normal[(6 * o + i, 6 * o + j)] += information[(i, j)];
                }
            }
        }
        if all.cost.is_finite() { Ok(all) } else { Err(Degenerate::NotFinite) }
    }

    /// The cost at a state, with weights that are comparable between states.
    pub(super) fn cost(&self, state: &JointState) -> Result<f64, Degenerate> {
        self.linearize(state, false).map(|all| all.cost)
    }

    fn moved(&self, state: &JointState, step: &Mat<f64>) -> JointState {
        let six = |block: usize| Vector6::from_fn(|i, _| step[(6 * block + i, 0)]);
        let poses = state.poses.iter().enumerate().map(|(f, pose)| pose.perturbed(&six(f)).renormalized());
        let places = state.places.iter().zip(&self.unknowns).map(|(place, unknown)| match unknown {
            Some(block) => place.perturbed(&six(*block)).renormalized(),
            None => *place,
        });
        JointState { poses: poses.collect(), places: places.collect() }
    }

    /// The minimum of the cost near a state, and its cost.
    pub(super) fn minimize(&self, mut state: JointState) -> Result<(JointState, f64), Degenerate> {
        let (mut here, mut damping) = (self.linearize(&state, false)?, 0.0);
        for _ in 0..MAX_STEPS {
            let (step, decrement) = here.step(damping)?;
            if damping == 0.0 && decrement <= NEAR {
                break;
            }
            let next = self.moved(&state, &step);
            match self.linearize(&next, false).ok().filter(|next| next.cost < here.cost) {
                Some(better) => {
                    (state, here) = (next, better);
                    damping = if damping > 1e-5 { damping * 0.1 } else { 0.0 };
                }
                None if damping > 1e8 => break,
                None => damping = f64::max(1e-4, damping * 10.0),
            }
        }
        let (mut here, mut last) = (self.linearize(&state, true)?, f64::INFINITY);
        for taken in 0..MAX_STEPS {
            let (step, decrement) = here.step(0.0)?;
            if !(decrement < last) {
                return converged(taken, last.sqrt()).map(|()| (state, here.cost));
            }
            state = self.moved(&state, &step);
            here = self.linearize(&state, true)?;
            if decrement <= NOTHING {
                return Ok((state, here.cost));
            }
            last = decrement;
        }
        converged(MAX_STEPS, last.sqrt()).map(|()| (state, here.cost))
    }

    /// The inverse of the normal equations at a state.
    pub(super) fn covariance(&self, state: &JointState) -> Result<Mat<f64>, Degenerate> {
        let all = self.linearize(state, true)?;
        let factor = all.normal.llt(Side::Lower).map_err(|_| all.singular())?;
        Ok(factor.solve(Mat::<f64>::identity(6 * self.blocks, 6 * self.blocks)))
    }
}

/// The derivative of η under Exp(η) Exp(δ) at δ = 0: I + ad/2 + ad²/12, ad = \[ \[φ\]×, 0; \[ρ\]×, \[φ\]× \].
///
/// The error is of fourth order (Barfoot, *State Estimation for Robotics*, 2017, Sec. 7.1.5).
fn right_jacobian_inverse(eta: &Vector6<f64>) -> Matrix6<f64> {
    let turn = skew(&eta.fixed_rows::<3>(0).into_owned());
    let mut ad = Matrix6::zeros();
    ad.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
    ad.fixed_view_mut::<3, 3>(3, 0).copy_from(&skew(&eta.fixed_rows::<3>(3).into_owned()));
    ad.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
    Matrix6::identity() + ad * 0.5 + ad * ad / 12.0
}

impl Linearized {
    /// Adds JₐᵀW J_b to the block (a, b), a ≥ b; only the lower half is factorised.
    fn add(&mut self, a: usize, b: usize, by_a: &Matrix3x6<f64>, by_b: &Matrix3x6<f64>, term: &Term) {
        self.add_block(a, b, &(by_a.transpose() * term.information * by_b));
    }

    fn pull(&mut self, a: usize, by_a: &Matrix3x6<f64>, term: &Term) {
        self.add_gradient(a, &(by_a.transpose() * term.pull));
    }

    /// Adds the normal equations of the pose of frame `f` relative to an object, `pose`.
    ///
    /// Under T_sc Exp(ξ) and T_so Exp(η) it moves by T_oc Exp(ξ − Ad(T_oc⁻¹) η).
    fn add_object(&mut self, f: usize, unknown: Option<usize>, pose: &Transform<Object, Camera>, terms: &ObjectTerms) {
        let normal = terms.normal();
        self.cost += terms.cost;
        self.add_block(f, f, &normal);
        self.add_gradient(f, &terms.gradient);
        if let Some(o) = unknown {
            let by_place = -pose.inverse().adjoint();
            self.add_block(o, o, &(by_place.transpose() * normal * by_place));
            self.add_block(o, f, &(by_place.transpose() * normal));
            self.add_gradient(o, &(by_place.transpose() * terms.gradient));
        }
    }

    fn add_block(&mut self, a: usize, b: usize, block: &Matrix6<f64>) {
        for i in 0..6 {
            for j in 0..6 {
                self.normal[(6 * a + i, 6 * b + j)] += block[(i, j)];
            }
        }
    }

    fn add_gradient(&mut self, a: usize, pull: &Vector6<f64>) {
        for i in 0..6 {
            self.gradient[(6 * a + i, 0)] += pull[i];
        }
    }

    /// The step and its decrement.
    fn step(&self, damping: f64) -> Result<(Mat<f64>, f64), Degenerate> {
        let mut normal = self.normal.clone();
        for i in 0..normal.nrows() {
            normal[(i, i)] *= 1.0 + damping;
        }
        let step = normal.llt(Side::Lower).map_err(|_| self.singular())?.solve(&self.gradient);
        let decrement: f64 = (0..step.nrows()).map(|i| step[(i, 0)] * self.gradient[(i, 0)]).sum();
        if decrement.is_finite() { Ok((step, decrement)) } else { Err(self.singular()) }
    }

    /// The error for normal equations without a Cholesky factor.
    ///
    /// It states the smallest eigenvalue after scaling the diagonal to ones.
    fn singular(&self) -> Degenerate {
        let rows = self.normal.nrows();
        let root = |i: usize| if self.normal[(i, i)] > 0.0 { 1.0 / self.normal[(i, i)].sqrt() } else { 0.0 };
        let scaled = Mat::from_fn(rows, rows, |i, j| self.normal[(i.max(j), i.min(j))] * root(i) * root(j));
        let min = scaled.self_adjoint_eigenvalues(Side::Lower).ok().and_then(|values| values.first().copied());
        Degenerate::Singular { fraction: min.unwrap_or(f64::NAN), min: rounding(rows) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint::tests::{instant, normal, object_observations, observed_edges, pose_of, rig};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::Covariance6;

    /// P46. The gradient of χ² by every unknown, at random states, agrees with central differences of χ²: error at most
    /// 1e-6 of the largest.
    ///
    /// Fails if the gradient of a survey ignores the object's rotation.
    #[test]
    fn derivatives_are_those_of_the_cost() {
        let (rig, mut rng) = (rig(), ChaCha8Rng::seed_from_u64(11));
        for _ in 0..20 {
            let message = [pose_of(0.0, 0.0), pose_of(0.8, 0.3), pose_of(-0.9, 0.2)];
            // The survey is as precise as the pixels and anisotropic, so that a wrong rotation of its gradient shows.
            let mut root = nalgebra::Matrix6::from_fn(|_, _| 2e-4 * normal(&mut rng));
            root.set_diagonal(&Vector6::new(1e-3, 2e-3, 4e-4, 3e-3, 6e-4, 1e-3));
            let survey = Covariance6::new(root * root.transpose());
            let members: Vec<Member> = message
                .iter()
                .zip([Placement::Exact, Placement::Surveyed(survey), Placement::Displaced])
                .map(|(&site_from_object, placement)| Member { site_from_object, placement })
                .collect();
            let mut seen = [0, 1].map(|k| object_observations(&rig, &message, k, 1.0, &mut rng));
            // Two objects of the second instant show edges as well.
            for object in [0, 1] {
                let edges = observed_edges(&rig, &message[object], 1, 1.0, &mut rng);
                seen[1].edges.extend(edges.into_iter().map(|edge| (object, edge)));
            }
            let groups = with_edges(&rig, &seen);
            let system = System::new(&rig, &members, &seen, &groups).unwrap();
            let mut off = |size: f64| Vector6::from_fn(|_, _| normal(&mut rng) * size);
            let state = JointState {
                poses: (0..2).map(|k| instant(k).perturbed(&off(0.02))).collect(),
                places: message
                    .iter()
                    .enumerate()
                    .map(|(o, s)| if o == 0 { *s } else { s.perturbed(&off(0.05)) })
                    .collect(),
            };
            let here = system.linearize(&state, false).unwrap();
            let greatest = (0..here.gradient.nrows()).map(|i| here.gradient[(i, 0)].abs()).fold(0.0, f64::max);
            for i in 0..here.gradient.nrows() {
                let cost = |size: f64| {
                    let mut step = Mat::zeros(here.gradient.nrows(), 1);
                    step[(i, 0)] = size;
                    system.linearize(&system.moved(&state, &step), false).unwrap().cost
                };
                // The gradient is Jᵀ W r, minus half of the cost's.
                let expected = -(cost(1e-5) - cost(-1e-5)) / 4e-5;
                assert!((here.gradient[(i, 0)] - expected).abs() < 1e-6 * greatest, "{i}: {expected}");
            }
        }
    }
}
