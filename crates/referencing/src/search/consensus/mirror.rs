//! Whether the object's mirror image explains more than a pose does.

use std::{cell::Cell, collections::BTreeSet};

use nalgebra::{Matrix3, Vector3};

use super::{
    Motion,
    graph::Graph,
    likelihood::{Mode, Terms},
    modes::Climb,
    rough::Rough,
};
use crate::ModelPoint;

/// An image must be likelier than the pose by this much (nats): a flat object is its own image.
const MARGIN: f64 = 3.0;

/// The mirror image of the model that shares a flat part with the mode, where it explains the cloud better; such
/// a mode is what is left of that image, and no pose of the object.
///
/// The model is reflected in the plane that its members lie in best, and from there the pairs are chosen and the
/// motion is fitted as for any pose. The prior says nothing of images: both are weighed without.
pub(in crate::search) fn mirror_image(
    model: &[ModelPoint],
    (terms, rough, graph): (&Terms, &Rough, &Graph),
    mode: &Mode,
) -> Option<Mode> {
    let rough = Rough { known: None, centroid: rough.centroid, ln_peak: rough.ln_peak };
    let taken = BTreeSet::new();
    let climb = Climb { model, terms, rough: &rough, graph, taken: &taken, compared: Cell::new(0) };
    let count = mode.members.len() as f64;
    let centre = mode.members.iter().map(|&v| terms.pairs[v].model).sum::<Vector3<f64>>() / count;
    let step = |v: &usize| terms.pairs[*v].model - centre;
    let spread: Matrix3<f64> = mode.members.iter().map(|v| step(v) * step(v).transpose()).sum();
    let eigen = spread.symmetric_eigen();
    let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let rotation = mode.motion.rotation * (Matrix3::identity() - normal * normal.transpose() * 2.0);
    let reflected = Motion { rotation, translation: mode.motion.apply(&centre) - rotation * centre };
    let own = climb.from(&mode.members, &mode.motion, f64::NEG_INFINITY, |_| false)?;
    let image = climb.from(&mode.members, &reflected, f64::NEG_INFINITY, |_| false)?;
    (image.ln_evidence > own.ln_evidence + MARGIN).then_some(image)
}
