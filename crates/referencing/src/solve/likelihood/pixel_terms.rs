//! The pixel terms of the normal equations, with prepared weights.

use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};
use seafix_geometry::StereoRig;
use smallvec::SmallVec;

use crate::{
    observations::{Observation, Observations},
    solve::{
        degeneracy::Degenerate,
        likelihood::{
            descent::Term,
            point_terms::{FEW, information},
            stereo_cameras::StereoCameras,
            whitened::Whitener,
        },
    },
};

/// The observed quantity that is compared with a point's projection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TermTarget {
    /// The observed pixels.
    Pixels,
    /// The pixels of the triangulated point, as in 3D–3D fits with covariances at the fitted point.
    Triangulated,
}

/// The rig, if it and the pixels of every point are given.
pub(crate) fn pixels_and_rig<'a>(data: &Observations<'a>) -> Result<&'a StereoRig, Degenerate> {
    data.rig.filter(|_| data.points.iter().all(|point| point.pixels.is_some())).ok_or(Degenerate::NoPixels)
}

/// The rig, if it and the pixels of some point are given.
pub(crate) fn rig_of_pixels<'a>(data: &Observations<'a>) -> Option<&'a StereoRig> {
    data.rig.filter(|_| data.points.iter().any(|point| point.pixels.is_some()))
}

/// The observed points of one problem.
pub(crate) struct PixelTerms<'a> {
    cameras: StereoCameras<'a>,
    all: SmallVec<[PixelTerm; FEW]>,
    /// Whether a model point is uncertain, so that weights depend on the pose.
    pub(crate) weights_move: bool,
}

enum PixelTerm {
    /// Pixels with their weights; `frozen` includes the model's error as projected at the measured point.
    Seen { at: Vector4<f64>, weight: Whitener, frozen: Whitener, model_variance: f64 },
    /// A point without pixels, with its information matrix.
    Bare { at: Vector3<f64>, information: Matrix3<f64> },
}

/// Lower bound of pixel noise (px); exact pixels would have infinite weight.
pub(crate) const PIXEL_FLOOR: f64 = 1e-6;

impl<'a> PixelTerms<'a> {
    /// An empty set of terms; [`see`](Self::see) fills it in place, as it is large.
    #[inline]
    pub(crate) fn new(rig: &'a StereoRig) -> Self {
        Self { cameras: StereoCameras::of(rig), all: SmallVec::new(), weights_move: false }
    }

    /// # Errors
    ///
    /// The first point whose covariance is not invertible, or whose measured position a camera cannot see.
    pub(crate) fn see(&mut self, points: &[Observation], target: TermTarget) -> Result<(), Degenerate> {
        for (index, point) in points.iter().enumerate() {
            let pixel_term = self.pixel_term(point, index, target)?;
            self.weights_move |= matches!(pixel_term, PixelTerm::Seen { model_variance, .. } if model_variance > 0.0);
            self.all.push(pixel_term);
        }
        Ok(())
    }

    fn pixel_term(&self, point: &Observation, index: usize, target: TermTarget) -> Result<PixelTerm, Degenerate> {
        let Some(pixels) = &point.pixels else {
            return Ok(PixelTerm::Bare { at: point.measured.at.coords, information: information(point) });
        };
        let noise = pixels.covariance + Matrix4::identity() * (PIXEL_FLOOR * PIXEL_FLOOR);
        let weight = Whitener::of(&noise).ok_or(Degenerate::Noise { index })?;
        let model_variance = point.model_sigma * point.model_sigma;
        let (mut at, mut frozen) = (pixels.at.coordinates(), weight);
        if target == TermTarget::Triangulated || model_variance > 0.0 {
            let place = &point.measured.at.coords;
            let (seen, j) = self.cameras.project(place).ok_or(Degenerate::Hidden { index, depth: place.z })?;
            if target == TermTarget::Triangulated {
                at = seen;
            }
            if model_variance > 0.0 {
                frozen =
                    Whitener::of(&(noise + j * j.transpose() * model_variance)).ok_or(Degenerate::Noise { index })?;
            }
        }
        Ok(PixelTerm::Seen { at, weight, frozen, model_variance })
    }

    /// The term of the k-th point, with weights at the position where the pose puts it.
    ///
    /// S = Σ_px + σ_model² J Jᵀ, with J at that position. With A = Jᵀ Σ_px⁻¹ J and g = Jᵀ Σ_px⁻¹ r, marginalisation of
    /// the model's error gives (I + σ² A)⁻¹ A and (I + σ² A)⁻¹ g (Woodbury).
    #[inline]
    pub(crate) fn live(&self, k: usize, place: &Vector3<f64>) -> Option<Term> {
        match &self.all[k] {
            PixelTerm::Seen { at, weight, model_variance, .. } => {
                let term = self.seen(at, weight, place)?;
                if *model_variance == 0.0 {
                    return Some(term);
                }
                let blur = (Matrix3::identity() + term.information * *model_variance).try_inverse()?;
                let pull = blur * term.pull;
                let cost = term.cost - *model_variance * term.pull.dot(&pull);
                Some(Term { information: blur * term.information, pull, cost })
            }
            PixelTerm::Bare { at, information } => Some(Term::of(*information, &(at - place))),
        }
    }

    /// The term of the k-th point, with weights at the measured point.
    ///
    /// The weights do not depend on the pose, so that costs are comparable.
    #[inline]
    pub(crate) fn frozen(&self, k: usize, place: &Vector3<f64>) -> Option<Term> {
        match &self.all[k] {
            PixelTerm::Seen { at, frozen, .. } => self.seen(at, frozen, place),
            PixelTerm::Bare { at, information } => Some(Term::of(*information, &(at - place))),
        }
    }

    #[inline]
    fn seen(&self, at: &Vector4<f64>, weight: &Whitener, place: &Vector3<f64>) -> Option<Term> {
        let (expected, j) = self.cameras.project(place)?;
        Some(weight.term(&j, &(at - expected)))
    }
}
