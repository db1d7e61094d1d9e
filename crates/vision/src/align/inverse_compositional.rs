//! Inverse-compositional Gauss–Newton on windows of zero mean and unit variance.

use nalgebra::{Matrix2, SVector, Vector2};
use seafix_geometry::Pixel;

use super::{
    covariance::{Residual, covariance, slant},
    lanes::{dot, dot3},
    spline::Spline,
    warp::{Model, Slanted, Translation},
    window::{Grid, MIN_VARIANCE, Normal, Template, Weight},
};
use crate::{image::Image, locate::UncertainPixel};

/// The acceptance rules of an alignment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rules {
    /// The side of the window (px), odd.
    pub(crate) window: usize,
    /// The weights of its pixels.
    pub(crate) weight: Weight,
    /// The maximum shift of the position (px).
    pub(crate) reach: f64,
    /// The minimum correlation of the windows.
    pub(crate) min_correlation: f64,
    /// The maximum number of steps.
    pub(crate) iterations: usize,
    /// The length (px) below which a step is the last.
    pub(crate) precision: f64,
    /// Whether windows may extend beyond the images, which are then mirrored at their borders.
    pub(crate) beyond: bool,
}

/// The maximum number of pixels of a spline for several positions.
const MAX_AT_ONCE: f64 = 20_000.0;

impl Rules {
    /// A precision (px) far below the resolution of any window.
    pub(crate) const FINE: f64 = 3e-3;
    /// A precision (px) for alignments with one more step, a tenth as long.
    const COARSE: f64 = 1e-2;
}

/// The result of an alignment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Aligned {
    /// The position in the right image.
    pub(crate) at: Vector2<f64>,
    /// The deformation: the position of the left pixel + x is at + shape · x.
    pub(crate) shape: Matrix2<f64>,
    /// The covariance of `at`, given the left pixel (px²).
    pub(crate) covariance: Matrix2<f64>,
    /// The zero-normalised cross-correlation of the windows.
    pub(crate) correlation: f64,
}

impl Aligned {
    /// The position with its covariance, given the left pixel.
    pub(super) fn place(&self) -> UncertainPixel {
        UncertainPixel { at: Pixel { u: self.at.x, v: self.at.y }, covariance: self.covariance }
    }
}

/// The working memory of alignments, reused for each match.
#[derive(Debug, Default)]
pub(crate) struct Aligner {
    grid: Grid,
    template: Template,
    spline: Spline,
    /// The variance of rounding in the right image (squared grey levels).
    rounding: f64,
    across: Vec<f32>,
    patch: Vec<f32>,
}

impl Aligner {
    /// The position in `right` whose window matches that around `centre` in `left`, from the initial `start` and
    /// `shape`.
    pub(crate) fn align<const P: usize>(
        &mut self,
        left: &Image,
        right: &Image,
        centre: &Vector2<f64>,
        (start, shape): (&Vector2<f64>, &Matrix2<f64>),
        rules: &Rules,
        model: &impl Model<P>,
    ) -> Option<Aligned> {
        let normal = self.take(left, [centre, start], rules, model)?;
        let (at, shape, found) = self.descend(right, start, (start, shape), None, &normal, rules, model)?;
        self.judge(&at, &shape, &normal, &found, rules)
    }

    /// Aligns by translation as [`align`](Self::align), or with a slant if the translation leaves a significant one.
    ///
    /// The test is Rao's score. Under noise alone, the gradient by the slant at the end of the translation, without its
    /// part due to translation, follows χ² with two degrees of freedom. If the slant is not significant or the slanted
    /// alignment fails, the translation's position is kept and its covariance grows by the error that the slant would
    /// cause.
    pub(super) fn align_as_seen(
        &mut self,
        left: &Image,
        right: &Image,
        centre: &Vector2<f64>,
        begin: (&Vector2<f64>, &Matrix2<f64>),
        rules: &Rules,
        model: &Slanted,
    ) -> Option<Aligned> {
        let start = begin.0;
        // One comparison with the slant follows; the last step of every alignment reuses it.
        let coarse = Rules { precision: Rules::COARSE, ..*rules };
        let slanted = self.take(left, [centre, start], rules, model)?;
        let moving = slanted.moving();
        let Some((at, shape, _)) = self.descend(right, start, begin, None, &moving, &coarse, &Translation) else {
            let (at, shape, found) = self.descend(right, start, begin, None, &slanted, rules, model)?;
            return self.judge(&at, &shape, &slanted, &found, rules);
        };
        let found = self.compare::<4>(right, &at, &shape, rules)?;
        let residual = self.residual(&at, &shape, &found);
        let slant = slant(&slanted, &found.gradient, &residual)?;
        let (alike, plain) = (found.correlation, found.moving());
        let stays = |aligner: &Self| {
            let last = moving.information.cholesky()?.solve(&plain.gradient);
            let moved = aligner.judge(&(at - shape * last), &shape, &moving, &plain, rules)?;
            let off = shape * slant.off * slant.fraction();
            Some(Aligned { covariance: moved.covariance + off * off.transpose(), ..moved })
        };
        if !slant.is_seen() {
            return stays(self);
        }
        let followed = self.descend(right, start, (&at, &shape), Some(found), &slanted, &coarse, model);
        let followed = followed.and_then(|(at, shape, again)| {
            let better = again.correlation >= alike;
            self.judge(&at, &shape, &slanted, &again, rules).filter(|_| better)
        });
        followed.or_else(|| stays(self))
    }

    /// Takes the template around `centre`.
    fn take<const P: usize>(
        &mut self,
        left: &Image,
        [centre, start]: [&Vector2<f64>; 2],
        rules: &Rules,
        model: &impl Model<P>,
    ) -> Option<Normal<P>> {
        // Positions far outside have no window, and would overflow integers.
        let possible = |at: &Vector2<f64>| at.iter().all(|x| x.abs() < 1e9);
        if !(possible(centre) && possible(start)) {
            return None;
        }
        self.grid.place(centre, rules.window / 2, rules.weight);
        let normal = self.template.take(left, &self.grid, rules.beyond, model)?;
        self.patch.resize(self.grid.weights.len(), 0.0);
        self.spline.forget();
        Some(normal)
    }

    /// Iterates from `at` and `shape`, within reach of `start`, until a step is shorter than the precision.
    ///
    /// Returns the last comparison; that step is too short to change it. `known` is the initial comparison, if
    /// available.
    #[expect(clippy::too_many_arguments, reason = "two call sites with distinct arguments")]
    fn descend<const P: usize>(
        &mut self,
        right: &Image,
        start: &Vector2<f64>,
        (at, shape): (&Vector2<f64>, &Matrix2<f64>),
        mut known: Option<Found<P>>,
        normal: &Normal<P>,
        rules: &Rules,
        model: &impl Model<P>,
    ) -> Option<(Vector2<f64>, Matrix2<f64>, Found<P>)> {
        let begun = shape.try_inverse()?;
        let (mut at, mut shape) = (*at, *shape);
        for _ in 0..rules.iterations {
            let (found, fresh) = match known.take() {
                Some(found) => (found, false),
                None => (self.compare::<P>(right, &at, &shape, rules)?, true),
            };
            let prior = normal.prior(2.0 * (1.0 - found.correlation));
            let deformed = SVector::from(model.parameters(&(begun * shape - Matrix2::identity())));
            let step = (normal.information + prior).cholesky()?.solve(&(found.gradient + prior * deformed));
            // W ← W ∘ ΔW⁻¹ with ΔW(x) = δ + (1 + Δ) x.
            let change = model.shape(&step.into());
            if change != Matrix2::zeros() {
                shape *= (Matrix2::identity() + change).try_inverse()?;
            }
            let moved = shape * step.fixed_rows::<2>(0);
            at -= moved;
            if !((at - start).norm() <= rules.reach) {
                return None;
            }
            // A first slant may turn the window about its centre, which does not move.
            if fresh && moved.norm() < rules.precision {
                return Some((at, shape, found));
            }
        }
        None
    }

    /// The correlations of the left window with those around each of `places` in the right image; −1 if the window is
    /// unavailable.
    pub(crate) fn survey(
        &mut self,
        left: &Image,
        right: &Image,
        centre: &Vector2<f64>,
        places: &[Vector2<f64>],
        rules: &Rules,
        correlations: &mut Vec<f64>,
    ) {
        correlations.clear();
        correlations.resize(places.len(), -1.0);
        self.grid.place(centre, rules.window / 2, rules.weight);
        if self.template.take(left, &self.grid, rules.beyond, &Translation).is_none() {
            return;
        }
        self.patch.resize(self.grid.weights.len(), 0.0);
        self.spline.forget();
        let here = Matrix2::identity();
        // One spline for positions close together.
        let size = [right.width() as f64, right.height() as f64];
        let inside = |at: &&Vector2<f64>| (0..2).all(|i| at[i] >= 0.0 && at[i] < size[i]);
        let corners = places.iter().filter(inside).map(|at| self.extent(at, &here));
        let corners = corners.reduce(|a, b| [a[0].inf(&b[0]), a[1].sup(&b[1])]);
        if let Some([first, last]) = corners.filter(|[first, last]| (last - first).product() < MAX_AT_ONCE) {
            self.load_between(right, &first, &last);
        }
        for (at, correlation) in places.iter().zip(correlations).filter(|(at, _)| inside(at)) {
            *correlation = self.compare::<2>(right, at, &here, rules).map_or(-1.0, |found| found.correlation);
        }
    }

    /// The alignment that ended here, if it is accepted.
    fn judge<const P: usize>(
        &self,
        at: &Vector2<f64>,
        shape: &Matrix2<f64>,
        normal: &Normal<P>,
        found: &Found<P>,
        rules: &Rules,
    ) -> Option<Aligned> {
        if !(found.correlation >= rules.min_correlation) {
            return None;
        }
        let own = covariance(normal, &self.residual(at, shape, found))?;
        let covariance = shape * own * shape.transpose();
        // A position of a larger variance than the reach is rejected.
        let known = covariance.trace() <= rules.reach * rules.reach;
        known.then_some(Aligned { at: *at, shape: *shape, covariance, correlation: found.correlation })
    }

    /// The corners of the warped window.
    fn extent(&self, at: &Vector2<f64>, shape: &Matrix2<f64>) -> [Vector2<f64>; 2] {
        let side = shape.abs() * Vector2::repeat(self.grid.reach());
        [at - side, at + side]
    }

    /// Loads the spline for the warped window with a margin.
    fn load(&mut self, image: &Image, at: &Vector2<f64>, shape: &Matrix2<f64>) -> Option<()> {
        let [first, last] = self.extent(at, shape);
        // An excessively stretched window is not worth its cost.
        if !((last - first).max() <= 4.0 * self.grid.side as f64 + 8.0) {
            return None;
        }
        self.load_between(image, &first, &last);
        Some(())
    }

    /// Loads the spline for windows between these corners with a margin.
    fn load_between(&mut self, image: &Image, first: &Vector2<f64>, last: &Vector2<f64>) {
        let fill = (self.grid.columns - self.grid.side) as f64;
        let full = |x: f64| x.floor() as isize;
        let (start, end) = ([full(first.x) - 2, full(first.y) - 2], [full(last.x + fill) + 5, full(last.y) + 5]);
        self.rounding = image.rounding();
        self.spline.load(image, start, end);
    }

    /// Compares the template with the warped window of the right image; `None` beyond the image.
    fn compare<const P: usize>(
        &mut self,
        right: &Image,
        at: &Vector2<f64>,
        shape: &Matrix2<f64>,
        rules: &Rules,
    ) -> Option<Found<P>> {
        let [first, last] = self.extent(at, shape);
        let size = [right.width(), right.height()];
        let inside = (0..2).all(|i| {
            let (first, last) = if rules.beyond { (at[i], at[i]) } else { (first[i] - 1.0, last[i] + 1.0) };
            first >= 0.0 && last <= (size[i] - 1) as f64
        });
        if !inside {
            return None;
        }
        let fill = (self.grid.columns - self.grid.side) as f64;
        let covers = |spline: &Spline| spline.covers([first.x, first.y], [last.x + fill, last.y + 1.0]);
        if !covers(&self.spline) {
            self.load(right, at, shape)?;
        }
        let Self { grid, template, spline, across, patch, rounding: _ } = self;
        if *shape == Matrix2::identity() {
            let first = [at.x + grid.first[0], at.y + grid.first[1]];
            spline.grid(first, grid.columns, grid.side, across, patch);
        } else if shape[(1, 0)] == 0.0 && shape[(1, 1)] == 1.0 {
            let [x, y] = grid.first;
            let first = [at.x + shape[(0, 0)] * x + shape[(0, 1)] * y, at.y + y];
            let steps = [shape[(0, 0)], shape[(0, 1)]];
            spline.sheared(first, steps, grid.columns, across, patch);
        } else {
            let corner = spline.corner();
            let base = [at.x - corner[0] as f64, at.y - corner[1] as f64];
            for (y, row) in patch.chunks_exact_mut(grid.columns).enumerate() {
                let y = grid.first[1] + y as f64;
                let begin = [0, 1].map(|i| (base[i] + shape[(i, 0)] * grid.first[0] + shape[(i, 1)] * y) as f32);
                let step = [shape[(0, 0)] as f32, shape[(1, 0)] as f32];
                for (x, out) in row[..grid.side].iter_mut().enumerate() {
                    *out = spline.at([begin[0] + step[0] * x as f32, begin[1] + step[1] * x as f32]);
                }
            }
        }
        let mut gradient = [0.0; P];
        let (variance, correlation) = sums(patch, &grid.weights, &template.values, &template.weighted, &mut gradient)?;
        let variance = f64::from(variance);
        let scale = 1.0 / variance.sqrt();
        Some(Found {
            gradient: SVector::from(gradient.map(f64::from)) * scale,
            variance,
            correlation: f64::from(correlation) * scale,
        })
    }

    /// The residual between the windows.
    fn residual<const P: usize>(&self, at: &Vector2<f64>, shape: &Matrix2<f64>, found: &Found<P>) -> Residual {
        let full = *shape == Matrix2::identity();
        let squares: f32 = self.grid.weights.iter().map(|w| w * w).sum();
        Residual {
            energy: 2.0 * (1.0 - found.correlation),
            variance: found.variance,
            fractions: full.then(|| [0, 1].map(|i| (at[i] + self.grid.first[i]).rem_euclid(1.0))),
            squared_weights: f64::from(squares),
            rounding: self.rounding,
        }
    }
}

/// The result of a comparison.
struct Found<const P: usize> {
    /// The gradient Σ w J̃ᵀ(Ĩ − T̃).
    gradient: SVector<f64, P>,
    /// The variance of the right window (squared grey levels).
    variance: f64,
    /// The correlation of the windows.
    correlation: f64,
}

impl Found<4> {
    /// The comparison with the gradient by translation alone.
    fn moving(&self) -> Found<2> {
        let Self { gradient, variance, correlation } = *self;
        Found { gradient: gradient.fixed_rows::<2>(0).into(), variance, correlation }
    }
}

/// Subtracts the mean of the patch; returns its variance and its product with T̃, and fills `gradient` with its
/// products with the columns of J̃.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn sums(
    patch: &mut [f32],
    weights: &[f32],
    template: &[f32],
    jacobian: &[f32],
    gradient: &mut [f32],
) -> Option<(f32, f32)> {
    let mean = dot(patch, weights);
    patch.iter_mut().for_each(|p| *p -= mean);
    let variance = dot3(patch, patch, weights);
    if !(f64::from(variance) > MIN_VARIANCE && variance.is_finite()) {
        return None;
    }
    for (sum, column) in gradient.iter_mut().zip(jacobian.chunks_exact(patch.len())) {
        *sum = dot(patch, column);
    }
    Some((variance, dot(patch, template)))
}
