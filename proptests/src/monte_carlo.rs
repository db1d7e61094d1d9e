//! Monte Carlo of a layout: the errors of a solver against the Cramér–Rao bound.

use nalgebra::{Matrix4, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_component::Choice;
use seafix_evaluation::{
    Seen, attitude_error, cramer_rao, nees, nonlinearity, position_error, transfer_bound, transfer_rms,
};
use seafix_geometry::{Camera, Covariance6, MeasuredPoint, Object, Point, Transform};
use seafix_referencing::{Observation, Observations, SOLVERS, Solver, StereoReprojection};
use seafix_simulation::{Layout, Placed};

/// The statistics of one solver in one cell.
#[derive(Debug, Clone, Copy, Default)]
pub struct Cell {
    /// Number of layouts.
    pub layouts: u32,
    /// Number of draws with an answer.
    pub answered: u32,
    /// Number of draws without an answer.
    pub rejected: u32,
    /// Number of draws with an equally probable alternative, if alternatives are examined; they have no answer either.
    pub ambiguous: u32,
    /// Number of answers in another minimum than the truth's, with NEES above 100, if alternatives are examined. They
    /// are wrong and count in the coverage, but not in means, which a single one would dominate.
    pub elsewhere: u32,
    /// Ratio of the RMS target registration error to the RMS of its bound.
    pub tre: f64,
    /// Ratio of the RMS position error to the RMS of its bound.
    pub position: f64,
    /// Ratio of the RMS position error to the RMS of its prediction by [`foreseen`].
    pub position_foreseen: f64,
    /// Maximum [`bent`] of the layouts: deviation of the likelihood from the parabola that the bound assumes.
    pub bent: f64,
    /// RMS target registration error (m).
    pub tre_rms: f64,
    /// RMS position error (m).
    pub position_rms: f64,
    /// Length of the mean position error, relative to its standard deviation by the bound.
    pub bias: f64,
    /// Mean NEES.
    pub nees: f64,
    /// Fraction of draws with a NEES below the 95 % quantile of χ² with six degrees of freedom.
    pub coverage: f64,
    /// Maximum standard deviation of the attitude by the bound, over three axes together (rad).
    pub attitude_sigma: f64,
    /// RMS attitude error (rad).
    pub attitude_rms: f64,
}

/// The statistics of a solver over `draws` draws, distributed evenly over `layouts` layouts of these settings.
///
/// # Panics
/// If the settings describe no layout.
pub fn cell(solver: &dyn Solver, settings: &Layout, layouts: u64, draws: u64, covariance: bool) -> Cell {
    cell_where(solver, settings, layouts, draws, covariance, |_, _| true)
}

/// The same for the layouts that `keep` accepts, given the bound.
///
/// # Panics
/// If the settings describe no layout.
pub fn cell_where(
    solver: &dyn Solver,
    settings: &Layout,
    layouts: u64,
    draws: u64,
    covariance: bool,
    keep: impl Fn(&Placed, &Covariance6<Object, Camera>) -> bool,
) -> Cell {
    let mut placed = placed(settings, 1, layouts);
    placed.retain(|placed| keep(placed, &bound(placed, settings)));
    let asked = Asked { draws: draws / layouts, covariance, alternatives: None };
    cell_of(solver, settings, &placed, &asked)
}

/// The layouts of these settings and this seed.
///
/// # Panics
/// If the settings describe no layout.
pub fn placed(settings: &Layout, seed: u64, layouts: u64) -> Vec<Placed> {
    let place = |number| Layout { number, ..settings.clone() }.place(seed).expect("the layout can be placed");
    (0..layouts).map(place).collect()
}

/// The Cramér–Rao bound of a layout.
///
/// # Panics
/// If its points determine no pose.
pub fn bound(placed: &Placed, settings: &Layout) -> Covariance6<Object, Camera> {
    let pixels = Matrix4::identity() * settings.sigma_px.powi(2);
    let seen = placed.model.iter().map(|&at| Seen { at, model_sigma: settings.model_sigma, pixels });
    cramer_rao(&placed.rig, &placed.object_from_camera, &seen.collect::<Vec<_>>())
        .expect("three points and more determine a pose")
}

/// The experiment on every layout.
#[derive(Debug, Clone, Copy)]
pub struct Asked {
    /// Number of draws of each layout.
    pub draws: u64,
    /// Whether covariances are compared with errors.
    pub covariance: bool,
    /// Difference of χ² within which another pose makes a draw ambiguous; `None` ignores alternatives.
    pub alternatives: Option<f64>,
}

/// The statistics of a solver over the draws of these layouts.
pub fn cell_of(solver: &dyn Solver, settings: &Layout, placed: &[Placed], asked: &Asked) -> Cell {
    /// The 95 % quantile of χ²₆.
    const NINETY_FIVE: f64 = 12.591_587_243_743_977;
    let mut cell = Cell::default();
    let (mut tre, mut position, mut tre_crlb, mut position_crlb, mut counted, mut angle) =
        (0.0, 0.0, 0.0, 0.0, 0u32, 0.0);
    let mut position_foreseen = 0.0;
    for placed in placed {
        let bound = bound(placed, settings);
        cell.layouts += 1;
        cell.attitude_sigma = cell.attitude_sigma.max(bound.attitude_rms());
        cell.bent = cell.bent.max(bent(placed, settings.sigma_px, &bound));
        let curved = foreseen(placed, settings).map_or(f64::NAN, |covariance| covariance.position_rms());
        let (tre_limit, position_limit) =
            (transfer_bound(&bound, &placed.object_from_camera, &placed.model), bound.position_rms());
        let mut mean = Vector3::zeros();
        let mut here = 0u32;
        for draw in 0..asked.draws {
            let Some(points) = observations(placed, draw, settings.model_sigma) else { continue };
            let data = Observations { points, edges: Vec::new(), rig: Some(&placed.rig) };
            let Ok(pose) = solver.solve(&data) else {
                cell.rejected += 1;
                continue;
            };
            if asked.alternatives.is_some_and(|max| !solver.alternatives(&data, &pose, max).is_empty()) {
                cell.ambiguous += 1;
                continue;
            }
            let truth = &placed.object_from_camera;
            let covariance = if asked.covariance { solver.covariance(&data, &pose).ok() } else { None };
            let error = covariance.and_then(|covariance| {
                let used = solver.used(&data);
                let sum: Vector3<f64> = used.iter().map(|&i| data.points[i].measured.at.coords).sum();
                nees(&pose, truth, &covariance, &Point::from(sum / used.len() as f64))
            });
            if asked.alternatives.is_some() && error.is_some_and(|error| error > 100.0) {
                cell.elsewhere += 1;
                continue;
            }
            tre += transfer_rms(&pose, truth, &placed.model).expect("there are points").powi(2);
            position += position_error(&pose, truth).powi(2);
            angle += attitude_error(&pose, truth).powi(2);
            tre_crlb += tre_limit * tre_limit;
            position_crlb += position_limit * position_limit;
            position_foreseen += curved * curved;
            mean += pose.translation() - truth.translation();
            (cell.answered, here) = (cell.answered + 1, here + 1);
            if let Some(error) = error {
                counted += 1;
                cell.nees += error;
                cell.coverage += f64::from(u8::from(error <= NINETY_FIVE));
            }
        }
        cell.bias += mean.norm() / f64::from(here.max(1)) / position_limit;
    }
    cell.bias /= placed.len() as f64;
    let n = f64::from(cell.answered);
    (cell.tre, cell.position) = ((tre / tre_crlb).sqrt(), (position / position_crlb).sqrt());
    cell.position_foreseen = (position / position_foreseen).sqrt();
    (cell.tre_rms, cell.position_rms, cell.attitude_rms) =
        ((tre / n).sqrt(), (position / n).sqrt(), (angle / n).sqrt());
    (cell.nees, cell.coverage) = (cell.nees / f64::from(counted), cell.coverage / f64::from(counted + cell.elsewhere));
    cell
}

/// The observations of a draw for a solver.
pub fn observations(placed: &Placed, draw: u64, model_sigma: f64) -> Option<Vec<Observation>> {
    observations_of(placed, &placed.draw(draw)?, model_sigma)
}

fn observations_of(placed: &Placed, cloud: &[MeasuredPoint], model_sigma: f64) -> Option<Vec<Observation>> {
    let point = |(seen, &model): (&MeasuredPoint, _)| Observation {
        measured: seen.position,
        pixels: seen.pixels,
        model,
        model_sigma,
    };
    Some(cloud.iter().zip(&placed.model).map(point).collect())
}

/// Whether the Cramér–Rao bound is meaningful for a layout. It is linear and local to the minimum at the truth. The
/// layout must be [`bent`] by a tenth at most, and no pose in another minimum may be so near to the exact pixels (χ²
/// below 64) that noise prefers it more often than Q(√64 / 2) = 3e-5. Otherwise the maximum-likelihood pose itself is
/// sometimes wrong, fifty bounds away.
pub fn is_meaningful(placed: &Placed, sigma_px: f64, bound: &Covariance6<Object, Camera>) -> bool {
    bent(placed, sigma_px, bound) <= 0.1 && alternative(placed, sigma_px) >= 64.0
}

/// The [`nonlinearity`] of a layout's exact pixels within its bound: the relative curvature of Bates and Watts. It is
/// zero if the posterior is the bound's Gaussian, and infinite if a pose within the bound has a point out of view.
pub fn bent(placed: &Placed, sigma_px: f64, bound: &Covariance6<Object, Camera>) -> f64 {
    let pixels = Matrix4::identity() * sigma_px.powi(2);
    let seen: Vec<Seen> = placed.model.iter().map(|&at| Seen { at, model_sigma: 0.0, pixels }).collect();
    nonlinearity(&placed.rig, &placed.object_from_camera, &seen, bound).unwrap_or(f64::INFINITY)
}

/// The position error that the likelihood of the exact pixels predicts: the bound where it is linear, elsewhere the
/// second moment of its profile. It is a property of the layout, as the bound is. `None` if it has no value.
pub fn foreseen(placed: &Placed, settings: &Layout) -> Option<Covariance6<Object, Camera>> {
    let points = observations_of(placed, &placed.exact(settings.sigma_px), settings.model_sigma)?;
    let data = Observations { points, edges: Vec::new(), rig: Some(&placed.rig) };
    StereoReprojection::default().covariance(&data, &placed.object_from_camera).ok()
}

/// The minimum χ² of the exact pixels in any minimum except the truth's, from 64 starts rotated about the centroid;
/// infinite if all lead to the truth.
pub fn alternative(placed: &Placed, sigma_px: f64) -> f64 {
    let solver = SOLVERS.build(&Choice::named("stereo-reprojection").with("starts", 1)).expect("a solver");
    let Some(mut exact) = observations_of(placed, &placed.exact(sigma_px), 0.0) else { return f64::INFINITY };
    let truth = placed.object_from_camera;
    let places: Vec<Vector3<f64>> = placed.model.iter().map(|&p| (truth.inverse() * p).coords).collect();
    let centre = places.iter().sum::<Vector3<f64>>() / places.len() as f64;
    let mut rng = ChaCha8Rng::seed_from_u64(64);
    let mut min = f64::INFINITY;
    for _ in 0..64 {
        let q = nalgebra::Vector4::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let turn = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::from(q));
        for (point, place) in exact.iter_mut().zip(&places) {
            point.measured.at = Point::from(centre + turn * (place - centre));
        }
        let data = Observations { points: exact.clone(), edges: Vec::new(), rig: Some(&placed.rig) };
        let Ok(pose) = solver.solve(&data) else { continue };
        if let Some(chi2) = pixel_chi2(placed, &exact, &pose, sigma_px).filter(|chi2| *chi2 > 1e-6) {
            min = min.min(chi2);
        }
    }
    min
}

/// The χ² of the pixels at a pose; `None` if a point is behind a camera.
pub fn pixel_chi2(
    placed: &Placed,
    points: &[Observation],
    pose: &Transform<Object, Camera>,
    sigma_px: f64,
) -> Option<f64> {
    let of = |point: &Observation| {
        let expected = placed.rig.project(&(pose.inverse() * point.model))?.coordinates();
        Some((point.pixels?.at.coordinates() - expected).norm_squared() / sigma_px.powi(2))
    };
    points.iter().map(of).sum()
}

/// Mean over standard error of the paired differences of squared target registration errors, and of squared position
/// errors; positive if `solver` has larger errors than `other` on the same draws.
///
/// # Panics
/// If the settings describe no layout.
pub fn paired(solver: &dyn Solver, other: &dyn Solver, settings: &Layout, layouts: u64, draws: u64) -> [f64; 2] {
    let mut differences: [Vec<f64>; 2] = Default::default();
    for number in 0..layouts {
        let placed = Layout { number, ..settings.clone() }.place(1).expect("the layout can be placed");
        for draw in 0..draws / layouts {
            let Some(points) = observations(&placed, draw, settings.model_sigma) else { continue };
            let data = Observations { points, edges: Vec::new(), rig: Some(&placed.rig) };
            let (Ok(a), Ok(b)) = (solver.solve(&data), other.solve(&data)) else { continue };
            let truth = &placed.object_from_camera;
            let tre = |pose| transfer_rms(pose, truth, &placed.model).expect("there are points").powi(2);
            differences[0].push(tre(&a) - tre(&b));
            differences[1].push(position_error(&a, truth).powi(2) - position_error(&b, truth).powi(2));
        }
    }
    differences.map(|all| {
        let n = all.len() as f64;
        let mean = all.iter().sum::<f64>() / n;
        let variance = all.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0);
        mean / (variance / n).sqrt()
    })
}
