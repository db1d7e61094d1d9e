//! The blur of an edge from its mean profile.

use std::ops::Range;

use super::{step::Normal, trace::Crossing};

/// A grey level at a distance from the edge, in one column.
#[derive(Debug, Clone, Copy)]
pub(super) struct Level {
    pub(super) column: usize,
    pub(super) t: f64,
    pub(super) level: f64,
}

/// The blurs (px) that are compared: a lens in focus to a soft edge.
const BLURS: [f64; 14] = [0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.15, 1.3, 1.5, 1.75, 2.0, 2.4, 3.0];
/// The number of classes of distance, and their width (px).
const CLASSES: usize = 64;
const WIDTH: f64 = 0.25;

/// The blur (px) that explains the mean of the columns' profiles best; `before` without levels.
///
/// Every profile is scaled to its own contrast and shifted by its own offset.
pub(super) fn blur_of(
    levels: &[Level],
    crossings: &[Crossing],
    contrasts: &[f64],
    range: Range<usize>,
    before: f64,
) -> f64 {
    let (mut sums, mut weights) = ([0.0; CLASSES], [0.0; CLASSES]);
    for level in levels.iter().filter(|level| range.contains(&level.column)) {
        let Some(fitted) = crossings[level.column].fitted else { continue };
        let contrast = contrasts[level.column];
        if !(contrast > 0.0) {
            continue;
        }
        let t = level.t - (fitted.moment / contrast).clamp(-1.0, 1.0);
        let class = libm::floor(t / WIDTH) + (CLASSES / 2) as f64;
        if class >= 0.0 && class < CLASSES as f64 {
            sums[class as usize] += contrast * (level.level - fitted.level);
            weights[class as usize] += contrast * contrast;
        }
    }
    let normal = Normal::table();
    let cost = |blur: f64| {
        // The best level and contrast of the mean profile for this blur.
        let (mut n, mut x, mut xx, mut y, mut xy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for class in (0..CLASSES).filter(|&class| weights[class] > 0.0) {
            let t = (class as f64 - (CLASSES / 2) as f64 + 0.5) * WIDTH;
            let (w, value, model) = (weights[class], sums[class] / weights[class], normal.at(t / blur).0);
            n += w;
            x += w * model;
            xx += w * model * model;
            y += w * value;
            xy += w * model * value;
            yy += w * value * value;
        }
        let (sxx, sxy, syy) = (xx - x * x / n, xy - x * y / n, yy - y * y / n);
        if sxx > 0.0 { syy - sxy * sxy / sxx } else { f64::INFINITY }
    };
    let best = BLURS.iter().map(|&blur| (cost(blur), blur)).min_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|best| best.0.is_finite()).map_or(before, |best| best.1)
}
