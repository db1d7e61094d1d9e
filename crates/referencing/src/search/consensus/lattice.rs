//! The translations of a repeated pattern.

use nalgebra::{DMatrix, Vector3};

use super::motion::Motion;

/// Sine of the angle between two steps below which they are one direction.
const SAME: f64 = 0.3;

/// The shortest of some steps, up to three, each in another direction than the shorter ones.
pub(super) fn independent(mut steps: Vec<Vector3<f64>>) -> Vec<Vector3<f64>> {
    let by = |a: &Vector3<f64>, b: &Vector3<f64>| a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne());
    steps.sort_by(|a, b| {
        a.norm_squared().total_cmp(&b.norm_squared()).then(by(a, b).unwrap_or(std::cmp::Ordering::Equal))
    });
    let mut basis: Vec<Vector3<f64>> = Vec::new();
    for step in steps {
        let rest = basis.iter().fold(step, |rest, known| rest - known * (rest.dot(known) / known.norm_squared()));
        if basis.len() < 3 && rest.norm() > SAME * step.norm() {
            basis.push(step);
        }
    }
    basis
}

/// All integer combinations of one to three steps, or of a fraction of them.
pub(super) struct Lattice {
    basis: Vec<Vector3<f64>>,
    /// The least-squares multiples of a step.
    multiples: DMatrix<f64>,
}

impl Lattice {
    pub(super) fn of(steps: &[Vector3<f64>], fraction: f64) -> Self {
        let basis: Vec<Vector3<f64>> = steps.iter().map(|step| step * fraction).collect();
        let columns = DMatrix::from_fn(3, basis.len(), |row, column| basis[column][row]);
        let inverse = (!basis.is_empty()).then(|| columns.pseudo_inverse(0.0).ok()).flatten();
        Self { multiples: inverse.unwrap_or_else(|| DMatrix::zeros(basis.len(), 3)), basis }
    }

    /// The nearest lattice vector of a step.
    pub(super) fn nearest(&self, step: &Vector3<f64>) -> Vector3<f64> {
        let multiples = &self.multiples * step;
        self.basis.iter().zip(multiples.iter()).map(|(basis, m)| basis * m.round()).sum()
    }

    /// The distance of a step from the nearest lattice vector.
    pub(super) fn off(&self, step: &Vector3<f64>) -> f64 {
        (step - self.nearest(step)).norm()
    }

    /// The shift from one pose of some places to another (object frame): the same attitude, and a step of the lattice,
    /// both up to `off` (m); `None` if it is none.
    pub(super) fn shift_between(
        &self,
        places: &[Vector3<f64>],
        [from, to]: [&Motion; 2],
        off: f64,
    ) -> Option<Vector3<f64>> {
        let reach = places.iter().map(|p| p.norm()).fold(0.0, f64::max);
        let turned = (to.rotation - from.rotation).norm() * reach;
        let centroid = places.iter().sum::<Vector3<f64>>() / places.len() as f64;
        let step = from.rotation.transpose() * (to.apply(&centroid) - from.apply(&centroid));
        (turned <= off && self.off(&step) <= off).then(|| self.nearest(&step))
    }
}

/// Whether a step, rather than its reverse, is the canonical one of the two.
pub(super) fn forward(step: &Vector3<f64>) -> bool {
    step.iter().copied().find(|x| x.abs() > 1e-9).is_none_or(|x| x > 0.0)
}
