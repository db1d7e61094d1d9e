//! Zero-normalised cross-correlation (ZNCC) of one window with many.

use multiversion::multiversion;

use crate::image::Image;

/// The number of windows that are compared side by side.
pub(crate) const LANES: usize = 16;
/// The largest side of a window.
pub(crate) const WIDEST: usize = 51;

/// A normalised window of one image, for comparison with windows of another.
#[derive(Debug, Default)]
pub(crate) struct Template {
    half: usize,
    /// The values in row-major order, less their mean and of unit norm.
    values: Vec<f32>,
    /// The mean.
    level: f32,
    patch: Vec<[f32; LANES + WIDEST - 1]>,
}

impl Template {
    /// Takes the window of (2 `half` + 1)² pixels around (x, y); `None` if it leaves the image or is flat.
    pub(crate) fn take(&mut self, image: &Image, [x, y]: [usize; 2], half: usize) -> Option<()> {
        if !fits(image, [x, y], half) {
            return None;
        }
        let side = 2 * half + 1;
        self.half = half;
        self.values.clear();
        (y - half..=y + half).for_each(|row| self.values.extend_from_slice(&image.row(row)[x - half..][..side]));
        let count = (side * side) as f32;
        self.level = self.values.iter().sum::<f32>() / count;
        self.values.iter_mut().for_each(|value| *value -= self.level);
        let length = self.values.iter().map(|value| value * value).sum::<f32>().sqrt();
        self.values.iter_mut().for_each(|value| *value /= length);
        // A norm of rounding errors alone means a flat window.
        (length.is_finite() && length > 1e-4 * self.level.abs().max(f32::MIN_POSITIVE) * count.sqrt()).then_some(())
    }

    /// The correlations with the windows around (x, y) and the next pixels of that row.
    ///
    /// A window that leaves the image or is flat gives −1.
    pub(crate) fn compare(&mut self, image: &Image, [x, y]: [usize; 2]) -> [f32; LANES] {
        let half = self.half;
        if !fits(image, [x, y], half) {
            return [-1.0; LANES];
        }
        let count = LANES.min(image.width() - half - x);
        let wide = count + 2 * half;
        self.patch.clear();
        self.patch.extend((y - half..=y + half).map(|row| {
            let mut values = [0.0; LANES + WIDEST - 1];
            values[..wide].copy_from_slice(&image.row(row)[x - half..][..wide]);
            values[..wide].iter_mut().for_each(|value| *value -= self.level);
            values
        }));
        let [products, sums, squares] = sums(&self.values, &self.patch);
        let n = self.values.len() as f32;
        std::array::from_fn(|lane| {
            let square = squares[lane] - sums[lane] * sums[lane] / n;
            // A difference below the rounding error means a flat window.
            let correlation = if square > 1e-6 * squares[lane] { products[lane] / square.sqrt() } else { -1.0 };
            if lane < count && correlation.is_finite() { correlation } else { -1.0 }
        })
    }
}

fn fits(image: &Image, [x, y]: [usize; 2], half: usize) -> bool {
    x >= half && y >= half && x + half < image.width() && y + half < image.height()
}

/// The sums Σ t v, Σ v and Σ v² over the windows that begin at each lane of `patch`.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn sums(template: &[f32], patch: &[[f32; LANES + WIDEST - 1]]) -> [[f32; LANES]; 3] {
    let side = patch.len();
    let [mut products, mut sums, mut squares] = [[0.0_f32; LANES]; 3];
    // Columns are summed first, since neighbouring windows share them.
    let [mut down, mut down_squares] = [[0.0_f32; LANES + WIDEST - 1]; 2];
    let wide = LANES + side - 1;
    for (weights, row) in template.chunks_exact(side).zip(patch) {
        for ((down, down_square), value) in down[..wide].iter_mut().zip(&mut down_squares[..wide]).zip(&row[..wide]) {
            *down += value;
            *down_square += value * value;
        }
        for (i, weight) in weights.iter().enumerate() {
            let values = row[i..].first_chunk::<LANES>().expect("a window of at most WIDEST columns");
            for lane in 0..LANES {
                products[lane] += weight * values[lane];
            }
        }
    }
    for i in 0..side {
        let window = |row: &[f32; LANES + WIDEST - 1]| *row[i..].first_chunk::<LANES>().expect("as above");
        let (down, down_squares) = (window(&down), window(&down_squares));
        for lane in 0..LANES {
            sums[lane] += down[lane];
            squares[lane] += down_squares[lane];
        }
    }
    [products, sums, squares]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::random_image;

    #[test]
    fn it_is_the_definition() {
        let (one, other, half) = (random_image(40, 30), random_image(37, 31), 3);
        let window = |image: &Image, x: usize, y: usize| -> Vec<f64> {
            let rows = (y - half..=y + half).flat_map(|row| image.row(row)[x - half..=x + half].to_vec());
            let values: Vec<f64> = rows.map(f64::from).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let length = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>().sqrt();
            values.iter().map(|v| (v - mean) / length).collect()
        };
        let mut template = Template::default();
        template.take(&one, [20, 14], half).unwrap();
        for (x, y) in [(3, 3), (10, 20), (25, 27)] {
            for (lane, found) in template.compare(&other, [x, y]).into_iter().enumerate() {
                if x + lane + half < 37 {
                    let dot = |a: Vec<f64>, b: Vec<f64>| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                    let expected = dot(window(&one, 20, 14), window(&other, x + lane, y));
                    assert!((f64::from(found) - expected).abs() < 1e-5, "{x} {y} {lane}");
                } else {
                    assert_eq!(found, -1.0);
                }
            }
        }
        assert_eq!(template.compare(&other, [2, 10]), [-1.0; LANES]);
        assert_eq!(template.compare(&Image::new(30, 30, vec![7.0; 900]).unwrap(), [9, 9]), [-1.0; LANES]);
        assert_eq!(template.take(&Image::new(30, 30, vec![7.0; 900]).unwrap(), [9, 9], 3), None);
        assert_eq!(template.take(&one, [38, 14], 3), None);
    }
}
