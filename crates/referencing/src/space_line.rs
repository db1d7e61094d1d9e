//! Measured lines in space, and their offsets from a model edge.

use nalgebra::{Matrix4, Vector3};
use seafix_geometry::MeasuredLine;

/// Minimum cosine between a measured and a predicted direction; beyond it the offsets across the line are undefined.
pub(crate) const MIN_SLOPE: f64 = 0.1;

/// One residual of an edge under a pose: measured minus predicted offset.
pub struct LineOffset {
    /// The place on the model edge that the residual belongs to, camera frame (m).
    pub at: Vector3<f64>,
    /// The derivative of the predicted offset by that place; it is orthogonal to the model edge.
    pub gradient: Vector3<f64>,
    /// The residual.
    pub residual: f64,
    /// The place as a fraction of the edge, 0 at its first end and 1 at the second.
    pub along: f64,
}

/// A measured line with prepared directions.
#[derive(Debug, Clone, Copy)]
pub struct SpaceLine {
    /// The ends (m).
    pub ends: [Vector3<f64>; 2],
    pub(crate) across: [Vector3<f64>; 2],
    pub(crate) direction: Vector3<f64>,
    /// The covariance (m²) of the offsets.
    pub noise: Matrix4<f64>,
}

impl SpaceLine {
    /// `None` if the ends coincide, or the noise is not finite and positive.
    pub fn of(line: &MeasuredLine) -> Option<Self> {
        let ends = line.ends.map(|end| end.coords);
        let digits = 1e-9_f64.max(4.0 * f64::EPSILON * ends[0].amax().max(ends[1].amax()));
        let noise = line.offsets + Matrix4::identity() * (digits * digits);
        let direction = line.direction();
        (noise.cholesky().is_some() && direction.iter().all(|x| x.is_finite())).then(|| Self {
            ends,
            across: line.across(),
            direction,
            noise,
        })
    }

    /// The standard deviation of the direction (rad), both axes across it together.
    pub(crate) fn direction_sigma(&self) -> f64 {
        let n = &self.noise;
        let of = |axis: usize| n[(axis, axis)] + n[(axis + 2, axis + 2)] - 2.0 * n[(axis, axis + 2)];
        (of(0) + of(1)).max(0.0).sqrt() / self.length()
    }

    /// The length (m).
    pub(crate) fn length(&self) -> f64 {
        (self.ends[1] - self.ends[0]).norm()
    }

    /// The residuals of a model edge with these ends, camera frame; `None` if their directions differ too much.
    pub fn rows(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Option<[LineOffset; 4]> {
        let Self { ends, across, direction, .. } = self;
        let along = to - from;
        let slope = direction.dot(&along);
        if !(slope.abs() > MIN_SLOPE * along.norm()) {
            return None;
        }
        let row = |k: usize| {
            let (end, normal) = (&ends[k / 2], &across[k % 2]);
            let t = direction.dot(&(end - from)) / slope;
            let at = from + along * t;
            let gradient = normal - direction * (normal.dot(&along) / slope);
            LineOffset { at, gradient, residual: normal.dot(&(end - at)), along: t }
        };
        Some([row(0), row(1), row(2), row(3)])
    }

    /// The overlap of line and edge along the edge, as a fraction of the shorter one, if the edge may slide by `slack`
    /// (a fraction of its length).
    pub(crate) fn overlap(&self, rows: &[LineOffset; 4], slack: f64) -> f64 {
        let (a, b) = (rows[0].along, rows[2].along);
        let (low, high) = (a.min(b), a.max(b));
        (high.min(1.0 + slack) - low.max(-slack)) / (high - low).min(1.0)
    }

    /// The covariance of the residuals by independent errors of the model's ends.
    pub(crate) fn model_noise(rows: &[LineOffset; 4], [from, to]: [f64; 2]) -> Matrix4<f64> {
        Matrix4::from_fn(|i, k| {
            let (one, other) = (&rows[i], &rows[k]);
            let by_ends = (1.0 - one.along) * (1.0 - other.along) * from * from + one.along * other.along * to * to;
            one.gradient.dot(&other.gradient) * by_ends
        })
    }
}
