//! Corners by the structure tensor: what the detectors that rest on it share.

use super::{Keypoint, peaks, peaks::Peaks, select, select::Budget, tensor, tensor::Tensor};
use crate::{Image, Workspace};

/// The greatest responses of a structure tensor, to a fraction of a pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corners {
    pub(super) tensor: Tensor,
    /// The weakest response worth keeping, relative to the strongest of the image.
    pub(super) quality: f64,
    /// No corner has a stronger one within this distance (px).
    pub(super) radius: usize,
    pub(super) budget: Budget,
}

#[derive(Debug, Default)]
struct Scratch {
    response: Vec<f32>,
    tensor: tensor::Scratch,
    peaks: peaks::Scratch,
    selection: select::Scratch,
}

impl Corners {
    /// Replaces `found` by the corners, strongest first.
    pub(super) fn find(&self, image: &Image, work: &mut Workspace, found: &mut Vec<Keypoint>) {
        let threads = work.threads();
        let (width, height) = (image.width(), image.height());
        let Scratch { response, tensor, peaks, selection } = work.get::<Scratch>();
        let strongest = self.tensor.response_into(image, threads, tensor, response);
        let least = (f64::from(strongest) * self.quality) as f32;
        Peaks { least, radius: self.radius }.find(response, width, threads, peaks, found);
        self.budget.keep(found, [width, height], selection);
        for corner in found {
            peaks::to_vertex(corner, response, width);
            corner.scale = self.tensor.sigma as f32;
        }
    }
}
