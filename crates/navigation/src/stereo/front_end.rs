//! The processed images of one pair: points, key points and descriptors.

use seafix_geometry::{MeasuredPoint, Pixel, StereoRig};
use seafix_vision::{Descriptors, FrontEndOutput, Image, Keypoint, Match, Matcher, View, Workspace};

use super::settings::StereoStages;
use crate::odometry::StereoPair;

/// The processed images of one pair.
#[derive(Debug)]
pub(crate) struct Seen {
    pub(super) stamp_ns: u64,
    /// The filtered images.
    pub(super) images: [Image; 2],
    /// The measured points, each with its key point and descriptor.
    pub(super) cloud: Vec<MeasuredPoint>,
    keypoints: Vec<Keypoint>,
    descriptors: Descriptors,
}

impl Seen {
    pub(crate) fn new(
        pair: &StereoPair<'_>,
        stages: &StereoStages,
        rig: &StereoRig,
        output: &mut FrontEndOutput,
        work: &mut Workspace,
    ) -> Self {
        stages.front_end.run(pair.left, pair.right, rig, output);
        let filtered = output.filtered();
        let images = [filtered[0].unwrap_or(pair.left).clone(), filtered[1].unwrap_or(pair.right).clone()];
        let cloud = std::mem::take(&mut output.cloud);
        // Both lists are in the order of the key points; a left pixel equals its key point's.
        let mut rest = output.keypoints()[0].iter().enumerate();
        let indices: Vec<usize> = cloud
            .iter()
            .filter_map(|point| {
                let left = point.pixels?.at.left;
                rest.find(|(_, keypoint)| keypoint.at == left).map(|(index, _)| index)
            })
            .collect();
        let keypoints: Vec<Keypoint> = indices.iter().map(|&index| output.keypoints()[0][index]).collect();
        debug_assert_eq!(keypoints.len(), cloud.len(), "every point has its key point");
        let mut descriptors = Descriptors::default();
        if stages.front_end.matcher.compares_descriptors() {
            pick(output.descriptors()[0], &indices, &mut descriptors);
        } else {
            stages.descriptor.describe_into(&images[0], &keypoints, work, &mut descriptors);
        }
        Self { stamp_ns: pair.stamp_ns, images, cloud, keypoints, descriptors }
    }

    /// The `max` strongest points with their key points and descriptors.
    pub(crate) fn strongest(self, max: usize) -> (Vec<MeasuredPoint>, Vec<Keypoint>, Descriptors) {
        let mut order: Vec<usize> = (0..self.cloud.len()).collect();
        order.sort_by(|&a, &b| self.keypoints[b].response.total_cmp(&self.keypoints[a].response).then(a.cmp(&b)));
        order.truncate(max);
        order.sort_unstable();
        let mut descriptors = Descriptors::default();
        pick(&self.descriptors, &order, &mut descriptors);
        let cloud = order.iter().map(|&index| self.cloud[index]).collect();
        let keypoints = order.iter().map(|&index| self.keypoints[index]).collect();
        (cloud, keypoints, descriptors)
    }

    fn view(&self) -> View<'_> {
        View { image: &self.images[0], keypoints: &self.keypoints, descriptors: &self.descriptors }
    }

    /// The matches of `earlier` and `self`, as pairs of indices.
    pub(super) fn in_common(
        &self,
        earlier: &Self,
        stages: &StereoStages,
        rig: &StereoRig,
        work: &mut Workspace,
    ) -> Vec<(usize, usize)> {
        in_common(&earlier.view(), &self.view(), &*stages.between, rig, work)
    }
}

/// The matches of the key points of `earlier` and `later`, as pairs of indices.
pub(crate) fn in_common(
    earlier: &View<'_>,
    later: &View<'_>,
    between: &dyn Matcher,
    rig: &StereoRig,
    work: &mut Workspace,
) -> Vec<(usize, usize)> {
    let mut found: Vec<Match> = Vec::new();
    between.match_into(earlier, later, rig, work, &mut found);
    let key = |at: &Pixel| (at.u.to_bits(), at.v.to_bits());
    let mut places: Vec<((u64, u64), usize)> =
        later.keypoints.iter().enumerate().map(|(index, keypoint)| (key(&keypoint.at), index)).collect();
    places.sort_unstable();
    let index = |at: &Pixel| {
        let place = places.binary_search_by(|(other, _)| other.cmp(&key(at))).ok()?;
        Some(places[place].1)
    };
    found.iter().filter_map(|found| Some((found.left, index(&found.right)?))).collect()
}

/// The rows of `all` at `indices`.
fn pick(all: &Descriptors, indices: &[usize], picked: &mut Descriptors) {
    match all {
        Descriptors::Numbers(table) => {
            let length = table.length();
            let rows = picked.numbers_mut(indices.len(), length);
            for (row, &index) in rows.chunks_exact_mut(length).zip(indices) {
                row.copy_from_slice(table.row(index));
            }
        }
        Descriptors::Bits(table) => {
            let length = table.length();
            let rows = picked.bits_mut(indices.len(), length);
            for (row, &index) in rows.chunks_exact_mut(length).zip(indices) {
                row.copy_from_slice(table.row(index));
            }
        }
    }
}
