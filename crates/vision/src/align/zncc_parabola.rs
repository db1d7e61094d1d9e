//! Subpixel refinement by the paraboloid through nine correlations.

use nalgebra::Matrix2;
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{Pixel, StereoRig, UncertainPixels};
use serde::{Deserialize, Serialize};

use super::refinement::{Refinement, Unaligned, apart, together};
use crate::{
    detect::vertex,
    image::Image,
    locate::{Pair, UncertainPixel},
    matching::correlate::{Template, WIDEST},
    workspace::Workspace,
};

/// The vertex of the paraboloid through nine correlations at integer pixels, as in most stereo programs.
///
/// The window around the left pixel is compared with those around the integer pixels near the right one, by
/// zero-normalised cross-correlation c. The right pixel becomes the vertex of the paraboloid through the nine
/// correlations around the maximum.
///
/// The covariance, for n pixels in the window and H = −∂²c, is that of a least-squares fit, 2 (1 − c) / n · H⁻¹, plus
/// `floor-px`². The latter covers a bias: correlations are no paraboloid, which pulls the vertex towards integer
/// pixels, and windows are not deformed, whatever the rig. That error is the same in every frame and does not average
/// out.
///
/// A pair is most often a false match if its maximum lies at the edge of the search or is below `min-correlation`.
///
/// Source: Tian and Huhns, *Algorithms for subpixel registration*, CVGIP 1986; its bias: Shimizu and Okutomi, *Precise
/// sub-pixel estimation on area-based matching*, ICCV 2001.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ZnccParabola {
    /// Side of the window (px); odd, 3 to 51.
    pub window: usize,
    /// Half-width of the search around the right pixel (integer px along each axis), 1 to 7.
    pub reach: usize,
    /// Minimum zero-normalised cross-correlation.
    pub min_correlation: f64,
    /// Standard deviation of the paraboloid's bias (px); the default is for the slants of boxes and walls.
    pub floor_px: f64,
    /// Treatment of a pair whose refinement fails.
    pub unaligned: Unaligned,
}

impl Default for ZnccParabola {
    fn default() -> Self {
        Self { window: 11, reach: 2, min_correlation: 0.8, floor_px: 0.05, unaligned: Unaligned::Drop }
    }
}

impl Component for ZnccParabola {
    const NAME: &'static str = "zncc-parabola";
    const SUMMARY: &'static str = "the vertex of the paraboloid through nine correlations at integer pixels";
    const SOURCE: &'static str = "Tian and Huhns, Algorithms for subpixel registration, CVGIP 1986";

    fn check(&self) -> Result<(), String> {
        let Self { window, reach, min_correlation, floor_px, unaligned: _ } = *self;
        let odd = window % 2 == 1 && (3..=WIDEST).contains(&window);
        in_range(odd, "window", window, "an odd number of pixels from 3 to 51")?;
        in_range((1..=MAX_REACH).contains(&reach), "reach", reach, "a number from 1 to 7 (px)")?;
        let correlated = (-1.0..=1.0).contains(&min_correlation);
        in_range(correlated, "min-correlation", min_correlation, "a number from -1 to 1")?;
        in_range((0.0..=10.0).contains(&floor_px), "floor-px", floor_px, "a number from 0 to 10 (px)")
    }
}

/// The largest half-width of a search: a row with one pixel beyond either end is compared at once.
const MAX_REACH: usize = 7;
/// The number of matches in a piece of the work.
const PIECE: usize = 64;

#[derive(Debug, Default)]
struct Memory {
    templates: Vec<Template>,
    refined: Vec<Option<UncertainPixels>>,
}

impl Refinement for ZnccParabola {
    fn refine_into(
        &self,
        pairs: &[Pair],
        left: &Image,
        right: &Image,
        _: &StereoRig,
        work: &mut Workspace,
        pixels: &mut Vec<UncertainPixels>,
    ) {
        let threads = work.threads();
        let Memory { templates, refined } = work.get();
        refined.clear();
        refined.resize(pairs.len(), None);
        threads.pieces(refined, PIECE, templates, |index, piece, template| {
            for (refined, pair) in piece.iter_mut().zip(&pairs[index * PIECE..]) {
                let found = self.place(left, right, pair, template);
                *refined = found.map(|found| together(&pair.left, &found, &Matrix2::identity()));
            }
        });
        pixels.clear();
        let stays = |pair| (self.unaligned == Unaligned::Keep).then(|| apart(pair));
        pixels.extend(refined.iter().zip(pairs).filter_map(|(refined, pair)| refined.or_else(|| stays(pair))));
    }
}

impl ZnccParabola {
    /// The right position of the left pixel, given that pixel.
    fn place(&self, left: &Image, right: &Image, pair: &Pair, template: &mut Template) -> Option<UncertainPixel> {
        let full = |at: f64| (0.0..1e9).contains(&at.round()).then(|| at.round() as usize);
        let begin = [full(pair.left.at.u)?, full(pair.left.at.v)?];
        // The left position has an offset from its integer pixel; the right one has the same offset from another.
        let beside = [pair.left.at.u - begin[0] as f64, pair.left.at.v - begin[1] as f64];
        let around = [full(pair.right.at.u - beside[0])?, full(pair.right.at.v - beside[1])?];
        template.take(left, begin, self.window / 2)?;
        // One pixel more than the search, for the nine correlations around the best.
        let (wide, side) = (self.reach + 1, 2 * self.reach + 3);
        let corner = [around[0].checked_sub(wide)?, around[1].checked_sub(wide)?];
        let mut rows = [[-1.0_f32; 2 * MAX_REACH + 3]; 2 * MAX_REACH + 3];
        for (y, row) in rows[..side].iter_mut().enumerate() {
            // Sixteen at once, and perhaps one more.
            let mut compare = |x: usize| template.compare(right, [corner[0] + x, corner[1] + y]);
            for (x, correlation) in compare(0).into_iter().enumerate().take(side) {
                row[x] = correlation;
            }
            if side > 16 {
                row[16] = compare(16)[0];
            }
        }
        let inner = (1..side - 1).flat_map(|y| (1..side - 1).map(move |x| [x, y]));
        let [x, y] = inner.max_by(|a, b| rows[a[1]][a[0]].total_cmp(&rows[b[1]][b[0]]).then(b.cmp(a)))?;
        let nine = [y - 1, y, y + 1].map(|y| [rows[y][x - 1], rows[y][x], rows[y][x + 1]]);
        let correlation = f64::from(nine[1][1]);
        let peaks = nine.iter().flatten().all(|c| *c > -1.0 && f64::from(*c) <= correlation);
        if !peaks || correlation < self.min_correlation {
            return None;
        }
        let [dx, dy] = vertex(nine);
        let at = |i: usize, step: f64| (corner[i] + [x, y][i]) as f64 + step + beside[i];
        Some(UncertainPixel { at: Pixel { u: at(0, dx), v: at(1, dy) }, covariance: self.covariance(nine)? })
    }

    fn covariance(&self, nine: [[f32; 3]; 3]) -> Option<Matrix2<f64>> {
        let [[nw, n, ne], [w, centre, e], [sw, s, se]] = nine.map(|row| row.map(f64::from));
        let across = -0.25 * ((se + nw) - (ne + sw));
        let curvature = Matrix2::new(2.0 * centre - e - w, across, across, 2.0 * centre - n - s);
        let inverse = curvature.cholesky()?.inverse();
        let pixels = (self.window * self.window) as f64;
        let noise = 2.0 * (1.0 - centre).max(0.0) / pixels;
        Some(inverse * noise + Matrix2::identity() * (self.floor_px * self.floor_px))
    }
}
