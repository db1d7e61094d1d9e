//! The gradient field of an image for segment detectors.

use crate::image::Image;

/// The gradient of a binned image, at the corners between its pixels.
#[derive(Debug, Default)]
pub(super) struct Gradients {
    pub(super) width: usize,
    pub(super) height: usize,
    /// The unit gradient; zero where the magnitude is below the threshold.
    pub(super) unit: Vec<[f32; 2]>,
    /// The magnitude (grey levels per binned pixel).
    pub(super) size: Vec<f32>,
    /// The places above the threshold, the steepest first.
    pub(super) order: Vec<u32>,
    binned: Vec<f32>,
    counts: Vec<u32>,
}

/// The number of classes of magnitude for the median and the order.
const CLASSES: usize = 1024;

impl Gradients {
    /// The gradient of `image`, averaged over squares of `binning` pixels.
    ///
    /// It is the operator of von Gioi et al. on four neighbouring pixels. Places below the larger of `least` (grey
    /// levels per binned pixel) and `factor` times the median magnitude are left out.
    pub(super) fn fill(&mut self, image: &Image, binning: usize, minimum: f32, factor: f32) {
        let (columns, rows) = (image.width() / binning, image.height() / binning);
        self.bin(image, binning, columns, rows);
        (self.width, self.height) = (columns.saturating_sub(1), rows.saturating_sub(1));
        let count = self.width * self.height;
        self.unit.resize(count, [0.0; 2]);
        self.size.resize(count, 0.0);
        self.order.clear();
        if count == 0 {
            return;
        }
        for y in 0..self.height {
            let (above, below) = (&self.binned[y * columns..][..columns], &self.binned[(y + 1) * columns..][..columns]);
            let unit = &mut self.unit[y * self.width..][..self.width];
            let size = &mut self.size[y * self.width..][..self.width];
            for x in 0..unit.len() {
                let (falling, rising) = (below[x + 1] - above[x], above[x + 1] - below[x]);
                let g = [0.5 * (falling + rising), 0.5 * (falling - rising)];
                let length = (g[0] * g[0] + g[1] * g[1]).sqrt();
                let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
                (unit[x], size[x]) = ([g[0] * scale, g[1] * scale], length);
            }
        }
        self.sort(minimum, factor);
    }

    fn bin(&mut self, image: &Image, binning: usize, columns: usize, rows: usize) {
        self.binned.clear();
        self.binned.resize(columns * rows, 0.0);
        let scale = 1.0 / (binning * binning) as f32;
        for (y, out) in self.binned.chunks_exact_mut(columns.max(1)).enumerate() {
            for line in 0..binning {
                let row = &image.row(y * binning + line)[..columns * binning];
                for (sum, cell) in out.iter_mut().zip(row.chunks_exact(binning)) {
                    *sum += cell.iter().sum::<f32>();
                }
            }
            out.iter_mut().for_each(|sum| *sum *= scale);
        }
    }

    /// Orders the places above the threshold by classes of magnitude, and clears the others.
    fn sort(&mut self, minimum: f32, factor: f32) {
        let steepest = self.size.iter().copied().fold(0.0, f32::max);
        let scale = if steepest > 0.0 { (CLASSES - 1) as f32 / steepest } else { 0.0 };
        let class = |size: f32| (size * scale) as usize;
        self.counts.clear();
        self.counts.resize(CLASSES, 0);
        self.size.iter().for_each(|&size| self.counts[class(size)] += 1);
        let half = self.size.len() as u32 / 2;
        let mut below = 0;
        let median = self.counts.iter().position(|&count| {
            below += count;
            below > half
        });
        let median = median.unwrap_or(0) as f32 / scale.max(f32::MIN_POSITIVE);
        let threshold = minimum.max(factor * median);
        // Counting sort with the largest class first.
        let (mut start, first) = (0, class(threshold));
        for count in self.counts[first.min(CLASSES - 1)..].iter_mut().rev() {
            let own = *count;
            *count = start;
            start += own;
        }
        self.order.resize(start as usize, u32::MAX);
        for (place, (&size, unit)) in self.size.iter().zip(&mut self.unit).enumerate() {
            if size > threshold {
                let next = &mut self.counts[class(size)];
                self.order[*next as usize] = place as u32;
                *next += 1;
            } else {
                *unit = [0.0; 2];
            }
        }
        self.order.retain(|&place| place != u32::MAX);
    }

    /// The image coordinate (px) of a place's coordinate along one axis.
    pub(super) fn image_coordinate(place: f32, binning: usize) -> f64 {
        let binning = binning as f64;
        binning * (f64::from(place) + 0.5) + 0.5 * (binning - 1.0)
    }
}
