//! The median filter.

use multiversion::multiversion;
use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::image_filter::Filter;
use crate::{image::Image, workspace::Workspace};

/// The median filter of 3×3 or 5×5 pixels.
///
/// It removes single bright or dark pixels, drifting particles among them. Edges keep their positions; corners are
/// rounded a little. The nearest pixel is repeated beyond the border. The median comes from Batcher's sorting network,
/// reduced to the comparators that lead to it, for sixteen pixels at a time.
///
/// Source: Tukey, *Exploratory data analysis*, 1977; Batcher, *Sorting networks and their applications*, AFIPS 1968.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Median {
    /// Half the side of the window (px): 1 is 3×3, 2 is 5×5.
    pub radius: usize,
}

impl Default for Median {
    fn default() -> Self {
        Self { radius: 1 }
    }
}

impl Component for Median {
    const NAME: &'static str = "median";
    const SUMMARY: &'static str = "the median of 3×3 or 5×5 pixels: removal of isolated pixels";
    const SOURCE: &'static str = "Tukey, Exploratory data analysis, 1977";

    fn check(&self) -> Result<(), String> {
        in_range((1..=2).contains(&self.radius), "radius", self.radius, "1 (3×3) or 2 (5×5)")
    }
}

/// The number of pixels that are sorted side by side.
const LANES: usize = 16;
/// The number of wires of the largest network, a power of two.
const WIRES: usize = 32;

#[derive(Debug, Default)]
struct Scratch {
    network: Vec<[u8; 2]>,
    rows: Vec<()>,
    out: Vec<f32>,
}

impl Filter for Median {
    fn apply(&self, image: &mut Image, work: &mut Workspace) {
        let threads = work.threads();
        let Scratch { network, rows, out } = work.get();
        let (width, radius) = (image.width(), self.radius);
        let wires = (2 * radius + 1) * (2 * radius + 1);
        median_network(wires, network);
        out.resize(image.pixels().len(), 0.0);
        let band = 16;
        let source = image.pixels();
        threads.pieces(out, band * width, rows, |index, out, ()| {
            for (row, out) in out.chunks_exact_mut(width).enumerate() {
                median_row(source, width, index * band + row, radius, network, out);
            }
        });
        image.swap_pixels(out);
    }
}

/// Replaces `network` by the comparators (lower wire, upper wire) that bring the median of `wires` values to the
/// middle.
///
/// It is Batcher's odd–even merge sort without the comparators that do not lead there.
fn median_network(wires: usize, network: &mut Vec<[u8; 2]>) {
    network.clear();
    let full = wires.next_power_of_two();
    let mut sorted = 1;
    while sorted < full {
        let mut apart = sorted;
        while apart >= 1 {
            for start in (apart % sorted..full - apart).step_by(2 * apart) {
                for low in start..start + apart.min(full - start - apart) {
                    let high = low + apart;
                    // Wires beyond the last carry +∞, which never moves.
                    if low / (2 * sorted) == high / (2 * sorted) && high < wires {
                        network.push([low as u8, high as u8]);
                    }
                }
            }
            apart /= 2;
        }
        sorted *= 2;
    }
    let mut leads = [false; WIRES];
    leads[wires / 2] = true;
    for pair in network.iter_mut().rev() {
        let [low, high] = pair.map(usize::from);
        if leads[low] || leads[high] {
            (leads[low], leads[high]) = (true, true);
        } else {
            *pair = [0, 0];
        }
    }
    network.retain(|[low, high]| low != high);
}

/// Computes the medians of row `y`.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn median_row(source: &[f32], width: usize, y: usize, radius: usize, network: &[[u8; 2]], out: &mut [f32]) {
    let side = 2 * radius + 1;
    let last = source.len() / width - 1;
    let row = |j: usize| &source[(y + j).saturating_sub(radius).min(last) * width..][..width];
    let single = |x: usize| {
        let mut values = [[0.0; 1]; WIRES];
        for (i, value) in values[..side * side].iter_mut().enumerate() {
            value[0] = row(i / side)[(x + i % side).saturating_sub(radius).min(width - 1)];
        }
        sort(&mut values, network);
        values[side * side / 2][0]
    };
    let inner = width.saturating_sub(2 * radius);
    if inner < LANES {
        (0..width).for_each(|x| out[x] = single(x));
        return;
    }
    for x in (0..radius).chain(width - radius..width) {
        out[x] = single(x);
    }
    for block in 0..inner.div_ceil(LANES) {
        // The first column of the windows; the last block may overlap the one before.
        let x = (block * LANES).min(inner - LANES);
        let mut values = [[0.0; LANES]; WIRES];
        for j in 0..side {
            let row = row(j);
            for i in 0..side {
                values[j * side + i].copy_from_slice(&row[x + i..x + i + LANES]);
            }
        }
        sort(&mut values, network);
        out[x + radius..][..LANES].copy_from_slice(&values[side * side / 2]);
    }
}

#[inline(always)]
fn sort<const N: usize>(values: &mut [[f32; N]; WIRES], network: &[[u8; 2]]) {
    for &[low, high] in network {
        let (low, high) = (usize::from(low) % WIRES, usize::from(high) % WIRES);
        let (a, b) = (values[low], values[high]);
        for lane in 0..N {
            values[low][lane] = if a[lane] < b[lane] { a[lane] } else { b[lane] };
            values[high][lane] = if a[lane] < b[lane] { b[lane] } else { a[lane] };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_median() {
        for (width, height) in [(50, 21), (17, 9), (20, 3), (5, 1), (1, 7), (2, 2)] {
            let pixel = |i: usize| ((i * 7919 + (i / width) * 104_729) % 1009) as f32 - 300.0;
            let image = Image::new(width, height, (0..width * height).map(pixel).collect()).unwrap();
            for radius in [1, 2] {
                let out = Median { radius }.filtered(&image);
                for (i, value) in out.pixels().iter().enumerate() {
                    let side = 2 * radius + 1;
                    let at = |base: usize, step: usize, n: usize| (base + step).saturating_sub(radius).min(n - 1);
                    let around = |k: usize| image.row(at(i / width, k / side, height))[at(i % width, k % side, width)];
                    let mut window: Vec<f32> = (0..side * side).map(around).collect();
                    window.sort_by(f32::total_cmp);
                    assert_eq!(*value, window[side * side / 2], "{width}×{height}, {radius}, {i}");
                }
            }
        }
    }

    #[test]
    fn every_order_of_ones_and_zeros_has_its_median() {
        // A network that sorts all sequences of zeros and ones sorts everything (Knuth's 0–1 principle).
        let mut network = Vec::new();
        median_network(9, &mut network);
        for bits in 0..512_u32 {
            let mut values = [[0.0; 1]; WIRES];
            (0..9).for_each(|i| values[i][0] = f32::from(u8::from(bits >> i & 1 == 1)));
            sort(&mut values, &network);
            assert_eq!(values[4][0] > 0.5, bits.count_ones() >= 5, "{bits:b}");
        }
    }
}
