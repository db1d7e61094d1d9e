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
/// So many threes of the members are reflected.
const MOST_THREES: usize = 8;
/// What fits roughly what three noisy points say (χ²₃).
const LOOSE: f64 = 50.0;

/// The mirror image of the model that shares a flat part with the mode, where it explains the cloud better; such
/// a mode is what is left of that image, and no pose of the object.
///
/// The model is reflected in the plane that its members lie in best, and in those of some threes of them, in case that one of the
/// members is not the image's; from where most pairs fit, pairs are chosen and the
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
    let own = climb.from(&mode.members, &mode.motion, f64::NEG_INFINITY, |_| false)?;
    let image = |members: &[usize], motion: &Motion| {
        let image = climb.from(members, motion, f64::NEG_INFINITY, |_| false)?;
        (image.ln_evidence > own.ln_evidence + MARGIN).then_some(image)
    };
    let of_all = reflected(&mode.motion, &centre, &normal);
    image(&mode.members, &of_all).or_else(|| {
        let images = threes(&mode.members).filter_map(|three| {
            let model = three.map(|v| &terms.pairs[v].model);
            let motion = Motion::of_three(model, three.map(|v| &terms.pairs[v].cloud))?;
            let normal = (model[1] - model[0]).cross(&(model[2] - model[0])).try_normalize(0.0)?;
            let motion = reflected(&motion, model[0], &normal);
            Some((near(terms, graph, &motion), motion))
        });
        let (members, motion) = images.max_by_key(|(members, _)| members.len())?;
        if members.len() > mode.members.len() { image(&members, &motion) } else { None }
    })
}

/// A motion after a reflection of the model in the plane through a point with this normal.
fn reflected(motion: &Motion, through: &Vector3<f64>, normal: &Vector3<f64>) -> Motion {
    let rotation = motion.rotation * (Matrix3::identity() - normal * normal.transpose() * 2.0);
    Motion { rotation, translation: motion.apply(through) - rotation * through }
}

/// Some threes of the members.
fn threes(members: &[usize]) -> impl Iterator<Item = [usize; 3]> + '_ {
    let k = members.len();
    (0..k)
        .flat_map(move |i| [(1, 2), (k / 3, 2 * k / 3)].map(|(b, c)| [i, (i + b) % k, (i + c) % k]))
        .filter(|[a, b, c]| a != b && b != c && a != c)
        .take(MOST_THREES)
        .map(|three| three.map(|i| members[i]))
}

/// Of each model point the pair that fits a motion best, if it fits it roughly.
fn near(terms: &Terms, graph: &Graph, motion: &Motion) -> Vec<usize> {
    let of_rank = |range: &[usize]| {
        let fits = (range[0]..range[1]).map(|v| {
            let pair = &terms.pairs[v];
            (pair.distance(&(pair.cloud - motion.apply(&pair.model))), v)
        });
        fits.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(d2, _)| *d2 <= LOOSE).map(|(_, v)| v)
    };
    graph.starts.windows(2).filter_map(of_rank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threes_are_of_three_members() {
        assert_eq!(threes(&[4, 7]).count(), 0);
        assert_eq!(threes(&[4, 7, 9]).next(), Some([4, 7, 9]));
        for k in 4..30 {
            let members: Vec<usize> = (0..k).map(|v| 2 * v).collect();
            let all: Vec<_> = threes(&members).collect();
            assert_eq!(all.len(), MOST_THREES.min(all.len()), "of {k}");
            assert!(
                all.iter().all(|[a, b, c]| a != b && b != c && c != a && [a, b, c].iter().all(|v| members.contains(v)))
            );
        }
    }
}
