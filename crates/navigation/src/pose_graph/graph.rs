//! Sparse least-squares optimisation of a pose graph.

use faer::{
    Mat, Side,
    linalg::solvers::Solve,
    sparse::{SparseColMat, Triplet, linalg::solvers::Llt},
};
use nalgebra::{Matrix6, SMatrix, Vector6};
use seafix_geometry::{Camera, Covariance6, Transform, World, right_jacobian_inverse};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::drift::{self, Drift, Numbers, SIDES, Square, Units};
use crate::{
    correlated_error::{CORRELATED, CorrelatedCovariance, CorrelatedSensitivities},
    odometry_trajectory::RelativeMotion,
};

/// A pose of the graph; object frames are relabelled as camera frames at the interface.
type Pose = Transform<World, Camera>;

/// A factor graph: poses as nodes, measurements as factors.
///
/// - `between`: r = log(Z⁻¹ A⁻¹ B), with Z the measured motion from A to B;
/// - `prior`: r = log(Z⁻¹ A), with Z an independent measurement of the pose.
///
/// [Correlated errors](crate::CorrelatedError) are nodes as well; a motion with correlated errors is a factor of four
/// nodes, its two poses and the errors at both ends (`drifting`).
///
/// The estimate minimises Σ ρ(rᵀ Σ⁻¹ r). The loss ρ is the identity for trusted factors. Doubtful factors have dynamic
/// covariance scaling: ρ(x) = s² x + (1 − s)² Φ with s = min(1, 2Φ/(Φ + x)), so that a factor that contradicts all
/// others loses its weight. Φ is the 99 % quantile of χ²₆; a consistent factor keeps its full weight.
///
/// After a long path a correct loop contradicts the drifted initial poses as much as a wrong one does. The optimisation
/// therefore starts with full weight for every factor and halves the threshold until it reaches Φ (graduated
/// non-convexity).
///
/// Source: Grisetti et al., *A tutorial on graph-based SLAM*, 2010; Agarwal et al., *Robust map optimization using
/// dynamic covariance scaling*, ICRA 2013; Yang, Antonante, Tzoumas and Carlone, *Graduated non-convexity for robust
/// spatial perception*, 2020.
#[derive(Debug, Clone, Default)]
pub struct FactorGraph {
    nodes: Vec<Node>,
    correlated: Vec<Lasts>,
    factors: Vec<Factor>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    pose: Pose,
    held: bool,
}

/// The correlated errors at one instant.
#[derive(Debug, Clone)]
struct Lasts {
    numbers: Numbers,
    units: Units,
    /// Their prior information, at the start of a chain of edges.
    prior: Option<Square>,
}

#[derive(Debug, Clone)]
struct Factor {
    /// The first node; `None` for a prior.
    from: Option<usize>,
    to: usize,
    measured: Pose,
    weight: Weight,
    doubtful: bool,
}

/// The weight of a factor.
#[derive(Debug, Clone)]
enum Weight {
    /// The information matrix of an independent error.
    Own(Box<Matrix6<f64>>),
    /// A factor with correlated errors, and the nodes of these errors at its start and end.
    Drifting(Box<Drift>, [usize; 2]),
}

/// A covariance that is not positive definite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the covariance is not positive definite")]
pub struct NoCovariance;

/// Maximum number of iterations, rejected steps included.
const STEPS: usize = 200;
/// Convergence threshold: squared Mahalanobis length of a step.
const LAST: f64 = 1e-18;
/// Convergence threshold while the switch still narrows.
const ROUGHLY: f64 = 1e-4;

/// The threshold Φ of the switch.
fn max() -> f64 {
    ChiSquared::new(6.0).expect("six degrees of freedom").inverse_cdf(0.99)
}

impl FactorGraph {
    /// Adds a node with an initial pose; returns its index.
    pub fn node(&mut self, near: Pose) -> usize {
        self.nodes.push(Node { pose: near, held: false });
        self.nodes.len() - 1
    }

    /// Fixes a node at its pose.
    pub fn hold(&mut self, node: usize) {
        self.nodes[node].held = true;
    }

    /// The current pose of a node.
    pub fn pose(&self, node: usize) -> &Pose {
        &self.nodes[node].pose
    }

    /// Adds an independent measurement of a node's pose; returns the index of the factor.
    ///
    /// # Errors
    /// [`NoCovariance`] if the covariance is not positive definite.
    pub fn prior(&mut self, node: usize, at: Pose, covariance: &Matrix6<f64>) -> Result<usize, NoCovariance> {
        let information = covariance.cholesky().ok_or(NoCovariance)?.inverse();
        let weight = Weight::Own(Box::new(information));
        self.factors.push(Factor { from: None, to: node, measured: at, weight, doubtful: false });
        Ok(self.factors.len() - 1)
    }

    /// Adds a measured motion `from_from_to` between two nodes; returns the index of the factor.
    ///
    /// A `doubtful` motion may be an outlier and has a robust loss.
    ///
    /// # Errors
    /// [`NoCovariance`] if the covariance is not positive definite.
    pub fn between(
        &mut self,
        from: usize,
        to: usize,
        motion: &RelativeMotion,
        doubtful: bool,
    ) -> Result<usize, NoCovariance> {
        let information = motion.covariance.matrix.cholesky().ok_or(NoCovariance)?.inverse();
        let measured = motion.motion.relabel();
        self.factors.push(Factor {
            from: Some(from),
            to,
            measured,
            weight: Weight::Own(Box::new(information)),
            doubtful,
        });
        Ok(self.factors.len() - 1)
    }

    /// Adds a node of correlated errors at the start of a chain of edges; returns its index.
    ///
    /// # Errors
    /// [`NoCovariance`] if their covariance is not positive semidefinite.
    pub(super) fn begin_correlated(&mut self, spread: &CorrelatedCovariance) -> Result<usize, NoCovariance> {
        let (units, prior) = drift::prior(spread)?;
        self.correlated.push(Lasts { numbers: Numbers::zeros(), units, prior: Some(prior) });
        Ok(self.correlated.len() - 1)
    }

    /// Adds a measured motion with correlated errors; returns the node of the errors at its end.
    ///
    /// `before` is the node of the errors at its start. A motion without correlated errors becomes an ordinary factor
    /// and ends the chain.
    ///
    /// # Errors
    /// [`NoCovariance`] if a covariance is not positive definite.
    pub(super) fn drifting(
        &mut self,
        from: usize,
        to: usize,
        motion: &RelativeMotion,
        before: Option<usize>,
    ) -> Result<Option<usize>, NoCovariance> {
        let Some(correlated) = &motion.correlated else { return self.between(from, to, motion, false).map(|_| None) };
        let before = before.map_or_else(|| self.begin_correlated(&correlated.before), Ok)?;
        let (drift, units) = Drift::of(motion, correlated)?;
        self.correlated.push(Lasts { numbers: Numbers::zeros(), units, prior: None });
        let after = self.correlated.len() - 1;
        let (measured, weight) = (motion.motion.relabel(), Weight::Drifting(Box::new(drift), [before, after]));
        self.factors.push(Factor { from: Some(from), to, measured, weight, doubtful: false });
        Ok(Some(after))
    }

    /// The maximum-likelihood poses, by Levenberg–Marquardt on the sparse normal equations.
    ///
    /// A connected part of the graph without a prior or fixed node has its first node fixed (gauge). `None` if the
    /// normal equations have no solution.
    pub fn solve(mut self) -> Option<GraphSolution> {
        let parts = self.parts();
        let held = self.gauge(&parts);
        let places: Vec<Option<usize>> = held
            .iter()
            .scan(0, |free, held| {
                let place = (!held).then_some(*free);
                *free += usize::from(!held);
                Some(place)
            })
            .collect();
        let free = places.iter().flatten().count();
        if free == 0 {
            return Some(GraphSolution { graph: self, parts, places, factor: None, free });
        }
        let doubted = self.factors.iter().any(|factor| factor.doubtful);
        if doubted {
            self.descend(&places, free, f64::INFINITY, ROUGHLY)?;
            let worst = self.factors.iter().filter(|factor| factor.doubtful).map(|factor| self.disagreement(factor));
            let mut wide = 0.5 * worst.fold(0.0, f64::max);
            while wide > max() {
                self.descend(&places, free, wide, ROUGHLY)?;
                wide *= 0.5;
            }
        }
        self.descend(&places, free, max(), LAST)?;
        let (normal, _) = self.equations(&places, free, 0.0, max())?;
        let factor = normal.sp_cholesky(Side::Lower).ok()?;
        Some(GraphSolution { graph: self, parts, places, factor: Some(factor), free })
    }

    /// Minimises the cost at switch threshold `wide`, until a step is shorter than `last`.
    ///
    /// `None` if the normal equations have no solution.
    fn descend(&mut self, places: &[Option<usize>], free: usize, wide: f64, last: f64) -> Option<()> {
        let mut damping = 0.0;
        let mut cost = self.cost(wide);
        for _ in 0..STEPS {
            let (normal, pull) = self.equations(places, free, damping, wide)?;
            let Ok(factor) = normal.sp_cholesky(Side::Lower) else {
                damping = f64::max(10.0 * damping, 1e-6);
                if damping > 1e6 {
                    return None;
                }
                continue;
            };
            let step = factor.solve(&pull);
            let size: f64 = (0..self.unknowns(free)).map(|k| step[(k, 0)] * pull[(k, 0)]).sum();
            if !size.is_finite() {
                return None;
            }
            let before = (self.nodes.clone(), self.correlated.clone());
            for (node, place) in self.nodes.iter_mut().zip(places) {
                let Some(place) = place else { continue };
                let xi = Vector6::from_fn(|row, _| step[(6 * place + row, 0)]);
                node.pose = node.pose.perturbed(&xi).renormalized();
            }
            for (index, lasts) in self.correlated.iter_mut().enumerate() {
                lasts.numbers += Numbers::from_fn(|row, _| step[(6 * free + CORRELATED * index + row, 0)]);
            }
            let next = self.cost(wide);
            if size < last {
                break;
            }
            if next <= cost {
                damping *= 0.1;
                if damping < 1e-12 {
                    damping = 0.0;
                }
                // The remaining decrease is rounding.
                let still = cost - next <= 1e-14 * cost && size < 1e-9;
                cost = next;
                if still {
                    break;
                }
            } else {
                (self.nodes, self.correlated) = before;
                if size < 1e-12 {
                    break;
                }
                damping = f64::max(10.0 * damping, 1e-6);
                if damping > 1e9 {
                    break;
                }
            }
        }
        Some(())
    }

    /// The connected component of each node, identified by its first node.
    fn parts(&self) -> Vec<usize> {
        let mut parent: Vec<usize> = (0..self.nodes.len()).collect();
        fn root(parent: &mut [usize], mut node: usize) -> usize {
            while parent[node] != node {
                parent[node] = parent[parent[node]];
                node = parent[node];
            }
            node
        }
        for factor in &self.factors {
            let Some(from) = factor.from else { continue };
            let (a, b) = (root(&mut parent, from), root(&mut parent, factor.to));
            parent[a.max(b)] = a.min(b);
        }
        (0..self.nodes.len()).map(|node| root(&mut parent, node)).collect()
    }

    /// For each node, whether it is fixed.
    fn gauge(&self, parts: &[usize]) -> Vec<bool> {
        let mut placed = vec![false; self.nodes.len()];
        for factor in self.factors.iter().filter(|factor| factor.from.is_none()) {
            placed[parts[factor.to]] = true;
        }
        for (node, part) in self.nodes.iter().zip(parts) {
            placed[*part] |= node.held;
        }
        let still = |(index, node): (usize, &Node)| node.held || (parts[index] == index && !placed[index]);
        self.nodes.iter().enumerate().map(still).collect()
    }

    fn residual(&self, factor: &Factor) -> Vector6<f64> {
        let to = self.nodes[factor.to].pose;
        match factor.from {
            None => factor.measured.error_to(&to),
            Some(from) => factor.measured.error_to(&(self.nodes[from].pose.inverse() * to).relabel()),
        }
    }

    /// The squared Mahalanobis norm rᵀ Σ⁻¹ r of a factor's residual.
    fn disagreement(&self, factor: &Factor) -> f64 {
        let r = self.residual(factor);
        match &factor.weight {
            Weight::Own(information) => r.dot(&(**information * r)),
            Weight::Drifting(drift, [before, after]) => {
                drift.disagreement(&r, &self.correlated[*before].numbers, &self.correlated[*after].numbers)
            }
        }
    }

    /// The number of unknowns with `free` movable poses.
    fn unknowns(&self, free: usize) -> usize {
        6 * free + CORRELATED * self.correlated.len()
    }

    fn cost(&self, wide: f64) -> f64 {
        let each = self.factors.iter().map(|factor| {
            let chi = self.disagreement(factor);
            let s = factor.switch(chi, wide);
            if s < 1.0 { s * s * chi + (1.0 - s) * (1.0 - s) * wide } else { chi }
        });
        let known = self.correlated.iter().filter_map(|lasts| Some(lasts.numbers.dot(&(lasts.prior? * lasts.numbers))));
        each.chain(known).sum()
    }

    /// The normal equations of all unknowns: the lower triangle of the matrix and the right-hand side.
    fn equations(
        &self,
        places: &[Option<usize>],
        free: usize,
        damping: f64,
        wide: f64,
    ) -> Option<(SparseColMat<usize, f64>, Mat<f64>)> {
        let unknowns = self.unknowns(free);
        let mut pull = Mat::zeros(unknowns, 1);
        let mut own = vec![Matrix6::zeros(); free];
        let mut correlated = vec![Square::zeros(); self.correlated.len()];
        let mut entries = Vec::new();
        for factor in &self.factors {
            let r = self.residual(factor);
            let slope = right_jacobian_inverse(&r);
            // With A Exp(α) and B Exp(β), the residual of Z⁻¹ A⁻¹ B is r + J_r(r)⁻¹ (β − Ad(B⁻¹ A) α).
            let mut sides: [Option<(usize, Matrix6<f64>)>; 2] = [None, None];
            sides[0] = places[factor.to].map(|place| (place, slope));
            if let Some(from) = factor.from {
                let to_from_from = self.nodes[factor.to].pose.inverse() * self.nodes[from].pose;
                sides[1] = places[from].map(|place| (place, -slope * to_from_from.adjoint()));
            }
            let information = match &factor.weight {
                Weight::Own(information) => information.as_ref(),
                Weight::Drifting(drift, [before, after]) => {
                    let zero = Matrix6::zeros();
                    let by = [1, 0].map(|side| sides[side].as_ref().map_or(&zero, |(_, by)| by));
                    let [n, m] = [*before, *after].map(|lasts| &self.correlated[lasts].numbers);
                    let (square, gradient) = drift.equations(&r, by, n, m);
                    let first = |lasts: &usize| 6 * free + CORRELATED * lasts;
                    let place = |side: usize| sides[side].as_ref().map(|(place, _)| 6 * place);
                    let parts = [
                        (0, 6, place(1)),
                        (6, 6, place(0)),
                        (12, CORRELATED, Some(first(before))),
                        (12 + CORRELATED, CORRELATED, Some(first(after))),
                    ];
                    scatter(&parts, &square, &gradient, &mut entries, &mut pull);
                    for (part, start) in [(1, 0), (0, 6)] {
                        if let Some((place, _)) = sides[part] {
                            own[place] += square.fixed_view::<6, 6>(start, start);
                        }
                    }
                    correlated[*before] += square.fixed_view::<CORRELATED, CORRELATED>(12, 12);
                    correlated[*after] += square.fixed_view::<CORRELATED, CORRELATED>(12 + CORRELATED, 12 + CORRELATED);
                    continue;
                }
            };
            let chi = r.dot(&(information * r));
            let s = factor.switch(chi, wide);
            let weight = information * (s * s);
            for (place, by) in sides.iter().flatten() {
                own[*place] += by.transpose() * weight * by;
                let gradient = by.transpose() * (weight * r);
                (0..6).for_each(|row| pull[(6 * place + row, 0)] -= gradient[row]);
            }
            if let [Some((a, by_a)), Some((b, by_b))] = &sides {
                let across = by_a.transpose() * weight * by_b;
                let (low, high, block) = if a > b { (*b, *a, across) } else { (*a, *b, across.transpose()) };
                push(&mut entries, high, low, &block);
            }
        }
        for (place, block) in own.iter_mut().enumerate() {
            (0..6).for_each(|k| block[(k, k)] *= 1.0 + damping);
            push(&mut entries, place, place, block);
        }
        for (index, (lasts, square)) in self.correlated.iter().zip(&mut correlated).enumerate() {
            let first = 6 * free + CORRELATED * index;
            if let Some(prior) = &lasts.prior {
                *square += prior;
                let gradient = prior * lasts.numbers;
                (0..CORRELATED).for_each(|row| pull[(first + row, 0)] -= gradient[row]);
            }
            (0..CORRELATED).for_each(|k| square[(k, k)] *= 1.0 + damping);
            let lower = (0..CORRELATED).flat_map(|j| (j..CORRELATED).map(move |i| (i, j)));
            entries.extend(lower.map(|(i, j)| Triplet::new(first + i, first + j, square[(i, j)])));
        }
        Some((SparseColMat::try_new_from_triplets(unknowns, unknowns, &entries).ok()?, pull))
    }
}

impl Factor {
    fn switch(&self, chi: f64, wide: f64) -> f64 {
        if self.doubtful && chi > wide { 2.0 * wide / (wide + chi) } else { 1.0 }
    }
}

/// Adds a 6×6 block to the lower triangle.
fn push(entries: &mut Vec<Triplet<usize, usize, f64>>, row: usize, column: usize, block: &Matrix6<f64>) {
    for j in 0..6 {
        let first = if row == column { j } else { 0 };
        for i in first..6 {
            entries.push(Triplet::new(6 * row + i, 6 * column + j, block[(i, j)]));
        }
    }
}

/// Adds the gradient and the off-diagonal blocks of a factor to the lower triangle.
///
/// Each part is its first column in the factor, its size, and its first unknown in the system.
fn scatter(
    parts: &[(usize, usize, Option<usize>)],
    square: &SMatrix<f64, SIDES, SIDES>,
    gradient: &nalgebra::SVector<f64, SIDES>,
    entries: &mut Vec<Triplet<usize, usize, f64>>,
    pull: &mut Mat<f64>,
) {
    for (own, count, first) in parts {
        let Some(first) = first else { continue };
        (0..*count).for_each(|k| pull[(first + k, 0)] -= gradient[own + k]);
        for (other, others, low) in parts {
            let Some(low) = low.filter(|low| low < first) else { continue };
            let all = (0..*others).flat_map(|j| (0..*count).map(move |i| (i, j)));
            entries.extend(all.map(|(i, j)| Triplet::new(first + i, low + j, square[(own + i, other + j)])));
        }
    }
}

/// The optimised graph, with the covariances of its poses.
#[derive(Debug, Clone)]
pub struct GraphSolution {
    graph: FactorGraph,
    parts: Vec<usize>,
    places: Vec<Option<usize>>,
    factor: Option<Llt<usize, f64>>,
    free: usize,
}

impl GraphSolution {
    /// The pose of a node.
    pub fn pose(&self, node: usize) -> &Pose {
        self.graph.pose(node)
    }

    /// The marginal covariance of a node's pose; zero for a fixed node.
    pub fn covariance(&self, node: usize) -> Covariance6<World, Camera> {
        Covariance6::new(self.joint(&[self.block(node)]).fixed_view::<6, 6>(0, 0).into_owned())
    }

    /// The motion between two nodes with its covariance, including the cross-covariance of both poses.
    ///
    /// Its error is ξ = β − Ad(B⁻¹ A) α. `None` if the nodes are not connected.
    pub fn relative(&self, from: usize, to: usize) -> Option<RelativeMotion> {
        let placed = |node: usize| self.places[node].is_none() || self.graph.placed(&self.parts, self.parts[node]);
        if self.parts[from] != self.parts[to] && !(placed(from) && placed(to)) {
            return None;
        }
        let motion = self.pose(from).inverse() * *self.pose(to);
        if from == to {
            return Some(RelativeMotion::new(motion, Covariance6::new(Matrix6::zeros())));
        }
        let joint = self.joint(&[self.block(from), self.block(to)]);
        let by = between(&motion);
        let joint = joint.fixed_view::<12, 12>(0, 0).into_owned();
        Some(RelativeMotion::new(motion, Covariance6::new(by * joint * by.transpose())))
    }

    /// The cross-covariance E\[ξ mᵀ\] of the motion between two nodes and the correlated errors m.
    pub(super) fn sensitivities(&self, from: usize, to: usize, correlated: usize) -> CorrelatedSensitivities {
        let first = 6 * self.free + CORRELATED * correlated;
        let joint = self.joint(&[self.block(from), self.block(to), (Some(first), CORRELATED)]);
        let motion = self.pose(from).inverse() * *self.pose(to);
        let in_units: CorrelatedSensitivities = between(&motion) * joint.fixed_view::<12, CORRELATED>(0, 12);
        self.graph.correlated[correlated].units.own(&in_units)
    }

    /// The first unknown of a movable node, and the number of its unknowns.
    fn block(&self, node: usize) -> (Option<usize>, usize) {
        (self.places[node].map(|place| 6 * place), 6)
    }

    /// The squared Mahalanobis norm rᵀ Σ⁻¹ r of a factor, χ² with six degrees of freedom.
    pub fn disagreement(&self, factor: usize) -> f64 {
        self.graph.disagreement(&self.graph.factors[factor])
    }

    /// Whether a doubtful factor was rejected: less than half of its weight remains.
    pub fn given_up(&self, factor: usize) -> bool {
        let s = self.graph.factors[factor].switch(self.disagreement(factor), max());
        s * s < 0.5
    }

    /// The joint covariance of several blocks of unknowns.
    fn joint(&self, blocks: &[(Option<usize>, usize)]) -> nalgebra::DMatrix<f64> {
        let size = blocks.iter().map(|(_, count)| count).sum();
        let mut all = nalgebra::DMatrix::zeros(size, size);
        let Some(factor) = &self.factor else { return all };
        // Pairs of (row of the result, unknown).
        let mut rows = Vec::with_capacity(size);
        let mut row = 0;
        for (first, count) in blocks {
            rows.extend((0..*count).filter_map(|k| Some((row + k, (*first)? + k))));
            row += count;
        }
        let mut units = Mat::<f64>::zeros(self.graph.unknowns(self.free), rows.len());
        rows.iter().enumerate().for_each(|(column, (_, unknown))| units[(*unknown, column)] = 1.0);
        let columns = factor.solve(&units);
        for (column, (b, _)) in rows.iter().enumerate() {
            rows.iter().for_each(|(a, unknown)| all[(*a, *b)] = columns[(*unknown, column)]);
        }
        all
    }
}

/// The derivative of ξ = β − Ad(B⁻¹ A) α by (α, β).
fn between(motion: &Transform<Camera, Camera>) -> SMatrix<f64, 6, 12> {
    let mut by = SMatrix::<f64, 6, 12>::zeros();
    by.fixed_view_mut::<6, 6>(0, 0).copy_from(&-motion.inverse().adjoint());
    by.fixed_view_mut::<6, 6>(0, 6).copy_from(&Matrix6::identity());
    by
}

impl FactorGraph {
    /// Whether a connected component has a prior or a fixed node.
    fn placed(&self, parts: &[usize], part: usize) -> bool {
        let prior = self.factors.iter().any(|factor| factor.from.is_none() && parts[factor.to] == part);
        prior || self.nodes.iter().zip(parts).any(|(node, own)| *own == part && node.held)
    }
}

#[cfg(test)]
mod tests;
