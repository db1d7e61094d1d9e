//! The marked features in the pairs of their marks.

use std::path::Path;

use nalgebra::{Matrix2, Matrix4};
use seafix_component::Fault;
use seafix_geometry::{Camera, UncertainPixels, UncertainPoint};
use seafix_vision::Image;

use super::{
    find::Found,
    marks::{DiveMark, natural},
    template::Template,
};
use crate::{
    model::by_hand::{ModelByHand, Seen},
    stereo_pairs::StereoPairs,
};

/// A mark, located in its pair.
#[derive(Debug, Clone)]
pub(super) struct Located {
    /// The index of the pair.
    pub(super) pair: usize,
    /// The mark.
    pub(super) mark: DiveMark,
    /// Whether a corner was found at the mark.
    pub(super) corner: bool,
    /// The pixels with their own errors, and the point in the camera of the pair; `None` without a match in the right
    /// image.
    pub(super) measured: Option<(Found, UncertainPoint<Camera>)>,
    /// Its surroundings.
    pub(super) template: Template,
}

/// A marked feature: its name and its located marks, the one that defines it first.
#[derive(Debug, Clone)]
pub(super) struct Marked {
    pub(super) id: String,
    pub(super) marks: Vec<Located>,
}

/// The marked features, and the marks without a match in the right image of their pair.
#[derive(Debug, Default)]
pub(super) struct Marks {
    /// The features, in the order of their names.
    pub(super) features: Vec<Marked>,
    /// The faults of marks without a match in the right image.
    pub(super) unmatched: Vec<Fault>,
}

/// The standard deviation (px) of the place that a mark defines: zero, but for the rounding of an alignment.
const BY_DEFINITION: f64 = 0.02;

/// The pair of each mark.
///
/// # Errors
/// All marks whose stamp is that of no pair.
pub(super) fn pairs_of(dive: &StereoPairs, marks: &[DiveMark], file: &Path) -> Result<Vec<usize>, Vec<Fault>> {
    let mut faults = Vec::new();
    let mut pairs = Vec::new();
    for mark in marks {
        match dive.stamps().binary_search(&mark.stamp_ns) {
            Ok(pair) => pairs.push(pair),
            Err(after) => {
                let around = &dive.stamps()[after.saturating_sub(1)..dive.stamps().len().min(after + 1)];
                let nearest = around.iter().min_by_key(|stamp| stamp.abs_diff(mark.stamp_ns));
                let remedy = nearest.map_or_else(
                    || "the dive has no pair".to_owned(),
                    |stamp| format!("give the stamp of a pair; the nearest is {stamp}"),
                );
                let fault = Fault::new("a mark at the stamp of no pair", file).on_line(mark.mark.line);
                faults.push(fault.value(mark.stamp_ns).remedy(remedy));
            }
        }
    }
    if faults.is_empty() { Ok(pairs) } else { Err(faults) }
}

impl ModelByHand<'_> {
    /// Locates all marks in their pairs.
    ///
    /// A left mark without a match has no point yet. A right mark that does not fit is the operator's error.
    ///
    /// # Errors
    /// An image that cannot be read, and pairs of marks that do not triangulate.
    pub(super) fn located(&self, dive: &StereoPairs, marks: Vec<DiveMark>, file: &Path) -> Result<Marks, Vec<Fault>> {
        let pairs = pairs_of(dive, &marks, file)?;
        let mut all: Vec<(usize, DiveMark)> = pairs.into_iter().zip(marks).collect();
        all.sort_by_key(|(pair, mark)| (*pair, mark.mark.line));
        let (mut faults, mut located, mut unmatched) = (Vec::new(), Vec::new(), Vec::new());
        for same_pair in all.chunk_by(|a, b| a.0 == b.0) {
            let pair = same_pair[0].0;
            match dive.pair(pair) {
                Err(fault) => faults.push(fault),
                Ok((left, right)) => {
                    let keypoints = [&left, &right].map(|image| self.front_end.detector.detect(image));
                    for (_, mark) in same_pair {
                        let seen = match self.see(mark.mark.clone(), [&left, &right], &keypoints, &dive.rig, file) {
                            Ok(seen) => Some(seen),
                            Err(fault) if mark.mark.right.is_none() => {
                                unmatched.push(fault);
                                None
                            }
                            Err(fault) => {
                                faults.push(fault);
                                continue;
                            }
                        };
                        match self.located_mark(pair, mark, seen.as_ref(), &left, file) {
                            Ok(mark) => located.push(mark),
                            Err(fault) => faults.push(fault),
                        }
                    }
                }
            }
        }
        if faults.is_empty() { Ok(Marks { features: by_feature(located), unmatched }) } else { Err(faults) }
    }

    fn located_mark(
        &self,
        pair: usize,
        mark: &DiveMark,
        seen: Option<&Seen>,
        left: &Image,
        file: &Path,
    ) -> Result<Located, Fault> {
        let calibration = self.front_end.triangulator.rules().calibration_px;
        let measured = seen.map(|seen| {
            let given = seen.measured.pixels.expect("the triangulator keeps the pixels");
            // All pairs have one calibration error, which is treated apart.
            let own = given.covariance - Matrix4::identity() * (calibration * calibration);
            let covariance = if seen.corner { own } else { by_definition(&own) };
            let found = Found { pixels: UncertainPixels { at: given.at, covariance }, correlation: None };
            (found, seen.measured.position)
        });
        let place = measured.map_or(mark.mark.left, |(found, _)| found.pixels.at.left);
        let template = Template::cut(pair, left, place).ok_or_else(|| {
            Fault::new("a mark outside the left image", file).on_line(mark.mark.line).remedy("move the mark inside")
        })?;
        let corner = seen.is_some_and(|seen| seen.corner);
        Ok(Located { pair, mark: mark.clone(), corner, measured, template })
    }
}

/// The covariance of pixels whose left place defines the point: the right one has the error of its alignment.
fn by_definition(own: &Matrix4<f64>) -> Matrix4<f64> {
    let block = |row, column| own.fixed_view::<2, 2>(row, column).into_owned();
    let (place, across, right): (Matrix2<f64>, Matrix2<f64>, Matrix2<f64>) = (block(0, 0), block(2, 0), block(2, 2));
    let aligned = place.try_inverse().map_or(right, |inverse| right - across * inverse * across.transpose());
    let mut covariance = Matrix4::identity() * (BY_DEFINITION * BY_DEFINITION);
    let mut corner = covariance.fixed_view_mut::<2, 2>(2, 2);
    corner += aligned;
    covariance
}

/// The marks by features, in the order of names; of one feature corners come first, and marks without a match last.
fn by_feature(located: Vec<Located>) -> Vec<Marked> {
    let mut features: Vec<Marked> = Vec::new();
    for mark in located {
        match features.iter_mut().find(|feature| feature.id == mark.mark.mark.id) {
            Some(feature) => feature.marks.push(mark),
            None => features.push(Marked { id: mark.mark.mark.id.clone(), marks: vec![mark] }),
        }
    }
    features
        .iter_mut()
        .for_each(|feature| feature.marks.sort_by_key(|mark| (!mark.corner, mark.measured.is_none(), mark.pair)));
    features.sort_by(|a, b| natural(&a.id, &b.id));
    features
}
