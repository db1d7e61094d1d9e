//! Means over square windows, at a cost that does not depend on their size.

use crate::workspace::Threads;

/// The number of rows that one thread processes at a time.
const BAND: usize = 128;

/// The memory of [`mean_into`] between calls.
#[derive(Debug, Default)]
pub(super) struct Means {
    along: Vec<f32>,
    rows: Vec<()>,
    columns: Vec<Vec<f64>>,
}

/// Replaces `out` by the means of `source` (rows of `width` pixels) over windows of (2 `radius` + 1)² pixels.
///
/// At the border the mean is over the window's part in the image. Sums are in double precision, exact for 8 to 16 bits.
pub(super) fn mean_into(
    source: &[f32],
    width: usize,
    radius: usize,
    threads: Threads,
    means: &mut Means,
    out: &mut Vec<f32>,
) {
    let height = source.len() / width;
    let Means { along, rows, columns } = means;
    along.resize(source.len(), 0.0);
    threads.pieces(along, BAND * width, rows, |band, along, ()| {
        let first = band * BAND * width;
        let source = &source[first..first + along.len()];
        for (along, source) in along.chunks_exact_mut(width).zip(source.chunks_exact(width)) {
            mean_row(source, radius, along);
        }
    });
    out.resize(source.len(), 0.0);
    threads.pieces(out, BAND * width, columns, |band, out, sums| {
        let along = |y: usize| &along[y * width..][..width];
        sums.clear();
        sums.resize(width, 0.0);
        let top = band * BAND;
        // All but the lowest row of the first window, which the loop below adds.
        for y in top.saturating_sub(radius)..(top + radius).min(height) {
            sums.iter_mut().zip(along(y)).for_each(|(sum, &value)| *sum += f64::from(value));
        }
        for (row, out) in out.chunks_exact_mut(width).enumerate() {
            let y = top + row;
            if y + radius < height {
                sums.iter_mut().zip(along(y + radius)).for_each(|(sum, &value)| *sum += f64::from(value));
            }
            let count = (y + radius).min(height - 1) + 1 - y.saturating_sub(radius);
            let count = count as f64;
            out.iter_mut().zip(&*sums).for_each(|(out, &sum)| *out = (sum / count) as f32);
            if let Some(leaves) = y.checked_sub(radius) {
                sums.iter_mut().zip(along(leaves)).for_each(|(sum, &value)| *sum -= f64::from(value));
            }
        }
    });
}

/// Computes the means along one row.
fn mean_row(source: &[f32], radius: usize, out: &mut [f32]) {
    let width = source.len();
    let mut sum: f64 = source[..radius.min(width)].iter().map(|&value| f64::from(value)).sum();
    for (x, out) in out.iter_mut().enumerate() {
        let (enters, leaves) = (source.get(x + radius), x.checked_sub(radius + 1).map(|x| source[x]));
        sum += f64::from(enters.copied().unwrap_or(0.0)) - f64::from(leaves.unwrap_or(0.0));
        let count = (x + radius).min(width - 1) + 1 - x.saturating_sub(radius);
        *out = (sum / count as f64) as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_mean_of_what_there_is() {
        for (width, height, radius) in [(7, 300, 2), (40, 9, 5), (5, 4, 50), (1, 1, 0), (1, 1, 3), (130, 131, 1)] {
            let source: Vec<f32> = (0..width * height).map(|i| ((i * 7919) % 251) as f32).collect();
            let means = |threads| {
                let mut out = vec![f32::NAN; 5];
                mean_into(&source, width, radius, threads, &mut Means::default(), &mut out);
                out
            };
            let out = means(Threads::One);
            assert_eq!(means(Threads::Pool), out);
            for (i, value) in out.iter().enumerate() {
                let range = |at: usize, n: usize| at.saturating_sub(radius)..(at + radius + 1).min(n);
                let (columns, rows) = (range(i % width, width), range(i / width, height));
                let count = (columns.len() * rows.len()) as f32;
                let sum: f32 =
                    rows.flat_map(|y| columns.clone().map(move |x| (x, y))).map(|(x, y)| source[y * width + x]).sum();
                assert!((value - sum / count).abs() < 1e-4, "{width}×{height}, {radius} at {i}");
            }
        }
    }
}
