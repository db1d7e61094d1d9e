//! The numbers of a problem before validation, from a file or from memory.

use nalgebra::Matrix3;
use seafix_component::{counted, number};
use seafix_geometry::{Camera, MeasuredPoint, Point, UncertainPoint};

use super::{
    duplicates::{firsts, merged},
    edges::EdgeParts,
    input::CoherenceProblem,
    invalid_part::{FARTHEST, InvalidPart, MAX_SIGMA, ROUNDING, invalid},
};
use crate::{
    problem::Prior,
    site::{
        bounding_box::BoundingBox,
        check::COINCIDENT,
        model::ModelPoint,
        target::{diameter, nearest_two},
    },
};

/// The largest cloud; it limits a problem to 500 MB of memory.
const MAX_POINTS: usize = 500_000;

/// The noise of the measured points.
#[derive(Debug, Clone, PartialEq)]
pub enum Noise {
    /// One standard deviation per axis (m) for all points, and one for each point and axis if they differ.
    Sigma(f64, Option<Vec<[f64; 3]>>),
    /// The covariance of each point (m²), camera axes.
    Covariances(Vec<Matrix3<f64>>),
}

/// The numbers of an identification problem before validation.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// The name.
    pub id: String,
    /// The feature points (m), object frame.
    pub model: Vec<[f64; 3]>,
    /// The measured points (m), camera frame.
    pub cloud: Vec<[f64; 3]>,
    /// The noise of the measured points.
    pub noise: Noise,
    /// The distance tolerance Δ (m); `None` for a tolerance in standard deviations of the two distances.
    pub delta: Option<f64>,
    /// The prior, if one is known.
    pub prior: Option<Prior>,
    /// The putative pairs (model, cloud), if no other pairs are to be considered.
    pub putative: Option<Vec<[usize; 2]>>,
    /// The straight edges and the measured lines, if there are any.
    pub edges: EdgeParts,
}

impl Parts {
    /// The validated problem.
    ///
    /// # Errors
    ///
    /// The first invalid value: too many points, a number that is not finite or out of its range, coincident model
    /// points, or an index out of range.
    pub fn checked(self) -> Result<CoherenceProblem, InvalidPart> {
        for (name, rows) in [("model", &self.model), ("cloud", &self.cloud)] {
            if rows.len() > MAX_POINTS {
                let remedy = format!("at most {MAX_POINTS} are accepted; reduce the points");
                let fault = invalid(format!("too many points in `{name}`"), name, None, remedy);
                return Err(fault.value(rows.len().to_string()));
            }
        }
        // A NaN is out of range as well.
        if let Some(index) = self.model.iter().position(|row| !row.iter().all(|x| x.abs() <= FARTHEST)) {
            let what = format!("model point {index} is out of range");
            return Err(invalid(what, "model", Some(index), format!("give metres, at most {FARTHEST:e}")));
        }
        if let Some(index) = self.cloud.iter().position(|row| !row.iter().all(|x| x.is_finite())) {
            let what = format!("cloud point {index} is not finite");
            return Err(invalid(what, "cloud", Some(index), "remove points without a position"));
        }
        self.noise_is_valid()?;
        let model: Vec<ModelPoint> = self
            .model
            .iter()
            .enumerate()
            .map(|(index, at)| ModelPoint::exact(index.to_string(), Point::from(*at)))
            .collect();
        // Key points listed anew for each putative pair are merged below.
        if self.putative.is_none()
            && let Some((i, k, _)) = nearest_two(&model, COINCIDENT)
        {
            let fault = invalid("coincident model points", "model", Some(k), "remove one");
            return Err(fault.value(format!("points {i} and {k}")));
        }
        if let Some(delta) = self.delta {
            delta_fits(delta, &model)?;
        }
        let putative = self.merged_pairs(&model)?;
        let edges = self.edges.checked(&model)?;
        let covariances: Vec<Matrix3<f64>> = match self.noise {
            Noise::Covariances(all) => all,
            Noise::Sigma(_, Some(rows)) => rows.into_iter().map(of_sigmas).collect(),
            Noise::Sigma(sigma, None) => vec![of_sigmas([sigma; 3]); self.cloud.len()],
        };
        let cloud = self.cloud.iter().zip(covariances).map(|(at, covariance)| MeasuredPoint {
            position: UncertainPoint { at: Point::from(*at), covariance },
            pixels: None,
        });
        let problem = CoherenceProblem {
            id: self.id,
            model,
            cloud: cloud.collect(),
            delta: self.delta.unwrap_or_default(),
            prior: self.prior,
            putative,
            edges,
        };
        let delta = self.delta.unwrap_or_else(|| 3.0 * 2f64.sqrt() * problem.typical_sigma());
        Ok(CoherenceProblem { delta, ..problem })
    }

    fn noise_is_valid(&self) -> Result<(), InvalidPart> {
        let is_sigma = |sigma: f64| (0.0..=MAX_SIGMA).contains(&sigma);
        let of_sigma = || format!("give metres, zero to {MAX_SIGMA:e}");
        let length = |name: &str, rows: usize| {
            let value = format!("{} for {}", counted(rows, "row"), counted(self.cloud.len(), "cloud point"));
            let fault = invalid(format!("`{name}` has the wrong length"), name, None, "give one row per cloud point");
            if rows == self.cloud.len() { Ok(()) } else { Err(fault.value(value)) }
        };
        match &self.noise {
            Noise::Sigma(sigma, _) if !is_sigma(*sigma) => {
                Err(invalid("`sigma` is out of range", "sigma", None, of_sigma()))
            }
            Noise::Sigma(_, None) => Ok(()),
            Noise::Sigma(_, Some(rows)) => {
                length("sigma_xyz", rows.len())?;
                let wrong = rows.iter().position(|row| !row.iter().all(|&sigma| is_sigma(sigma)));
                wrong.map_or(Ok(()), |index| {
                    let what = format!("row {index} of `sigma_xyz` is out of range");
                    Err(invalid(what, "sigma_xyz", Some(index), of_sigma()))
                })
            }
            Noise::Covariances(all) => {
                length("covariances", all.len())?;
                let wrong = all.iter().position(|covariance| !is_covariance(covariance));
                wrong.map_or(Ok(()), |index| {
                    let what = format!("covariance {index} is not symmetric and positive semidefinite");
                    Err(invalid(what, "covariances", Some(index), "give variances in square metres"))
                })
            }
        }
    }

    /// The putative pairs, with every repeated point replaced by its first.
    fn merged_pairs(&self, model: &[ModelPoint]) -> Result<Option<Vec<(usize, usize)>>, InvalidPart> {
        let Some(pairs) = &self.putative else { return Ok(None) };
        let out = pairs.iter().position(|[i, j]| *i >= self.model.len() || *j >= self.cloud.len());
        if let Some(index) = out {
            let what = format!("putative pair {index} is out of range");
            let points = counted(self.cloud.len(), "cloud point");
            let remedy = format!("there are {} model and {points}; count from 0", self.model.len());
            return Err(invalid(what, "putative", Some(index), remedy));
        }
        let models = firsts(model.iter().map(|point| point.at));
        let clouds = firsts(self.cloud.iter().map(|at| Point::<Camera>::from(*at)));
        Ok(Some(merged(pairs.iter().map(|[i, j]| (*i, *j)), &models, &clouds)))
    }
}

/// Checks that Δ is above 0 and at most half the model's diameter.
fn delta_fits(delta: f64, model: &[ModelPoint]) -> Result<(), InvalidPart> {
    // Models of up to two points are answered `too-few` for every Δ. The diameter is at least the diagonal of the
    // bounding box over √3: it is computed only if that bound does not suffice.
    let bounding_box = BoundingBox::around(model.iter().map(|point| point.at));
    let settled = bounding_box.map_or(0.0, |bounding_box| bounding_box.max.distance(&bounding_box.min)) / 12f64.sqrt();
    let large = model.len() > 2 && delta > settled && delta > diameter(model) / 2.0;
    if delta > 0.0 && !large {
        return Ok(());
    }
    let greatest = number(diameter(model) / 2.0);
    let remedy = format!("allowed: above 0, at most half the model's diameter, {greatest} m");
    Err(invalid("`delta` is out of range", "delta", None, remedy))
}

fn of_sigmas(sigmas: [f64; 3]) -> Matrix3<f64> {
    Matrix3::from_diagonal(&sigmas.map(|sigma| sigma * sigma).into())
}

/// Whether a matrix is finite, symmetric and positive semidefinite, to rounding.
fn is_covariance(matrix: &Matrix3<f64>) -> bool {
    let largest = matrix.amax();
    // The principal minors of a positive semidefinite matrix are not negative.
    let minor = |i: usize, k: usize| matrix[(i, i)] * matrix[(k, k)] - matrix[(i, k)] * matrix[(k, i)];
    let not_negative = |value: f64, scale: f64| value >= -ROUNDING * scale;
    largest <= MAX_SIGMA * MAX_SIGMA
        && (matrix - matrix.transpose()).amax() <= ROUNDING * largest
        && (0..3).all(|i| not_negative(matrix[(i, i)], largest))
        && [(0, 1), (0, 2), (1, 2)].iter().all(|&(i, k)| not_negative(minor(i, k), largest * largest))
        && not_negative(matrix.determinant(), largest * largest * largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts() -> Parts {
        let model = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let cloud = model.iter().map(|[x, y, z]| [*x, *y, z + 3.0]).collect();
        let noise = Noise::Sigma(0.01, None);
        Parts {
            id: String::new(),
            model,
            cloud,
            noise,
            delta: None,
            prior: None,
            putative: None,
            edges: EdgeParts::default(),
        }
    }

    /// Fails if a value that no file can hold, a NaN or an infinity, passes.
    #[test]
    fn numbers_in_memory_are_checked_as_those_of_a_file() {
        let fault = |change: fn(&mut Parts)| {
            let mut parts = parts();
            change(&mut parts);
            parts.checked().unwrap_err()
        };
        assert_eq!(fault(|it| it.model[2][1] = f64::NAN).path, ["model", "2"]);
        assert_eq!(fault(|it| it.cloud[1][0] = f64::INFINITY).path, ["cloud", "1"]);
        assert_eq!(fault(|it| it.noise = Noise::Sigma(f64::NAN, None)).path, ["sigma"]);
        assert_eq!(fault(|it| it.delta = Some(f64::NAN)).path, ["delta"]);
        assert_eq!(fault(|it| it.delta = Some(0.9)).path, ["delta"]);
        assert_eq!(fault(|it| it.putative = Some(vec![[0, 0], [0, 4]])).path, ["putative", "1"]);
        assert_eq!(
            fault(|it| it.model[3] = [0.0; 3]).to_string(),
            "coincident model points: points 0 and 3; remove one"
        );
    }

    #[test]
    fn covariances_are_symmetric_and_positive_semidefinite() {
        let rejected = |matrix: Matrix3<f64>| {
            let mut parts = parts();
            parts.noise = Noise::Covariances(vec![matrix; 4]);
            parts.checked().err().map(|fault| fault.path)
        };
        let good = Matrix3::new(4.0, 2.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 0.0) * 1e-4;
        assert_eq!(rejected(good), None, "a singular covariance is one");
        let mut skewed = good;
        skewed[(0, 1)] *= 1.01;
        for bad in [skewed, -Matrix3::identity(), Matrix3::from_diagonal(&[1.0, f64::NAN, 1.0].into())] {
            assert_eq!(rejected(bad), Some(vec!["covariances".to_owned(), "0".to_owned()]), "{bad}");
        }
        // Its eigenvalues are 1 and ±√2.
        assert!(rejected(Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, -1.0)).is_some());
        let mut short = parts();
        short.noise = Noise::Covariances(vec![good; 3]);
        assert_eq!(short.checked().unwrap_err().value.as_deref(), Some("3 rows for 4 cloud points"));
    }

    /// Without a Δ the problem states the one at which nearly all true pairs agree, 3√2 σ.
    #[test]
    fn the_distance_tolerance_follows_from_the_noise() {
        let problem = parts().checked().unwrap();
        assert!((problem.delta - 3.0 * 2f64.sqrt() * 0.01).abs() < 1e-15);
    }
}
