//! Harris' corners, more of them where an object is expected.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    corners::{Corners, SIGMAS},
    detector::Detector,
    harris::Harris,
    select::{self, Budget, Selection},
    tensor::{Measure, Tensor},
};
use crate::{image::Image, keypoint::Keypoint, regions::Regions, workspace::Workspace};

/// Harris' corners at several scales where an object is expected, and fewer in the rest of the image.
///
/// The regions are the gates of the points that may be in view. There, the corners of all windows compete with their
/// response relative to the strongest of the image at that scale; of corners within the radius of suppression the
/// strongest stays. The rest of the image keeps a smaller budget of ordinary corners, the sample of clutter from which
/// the tests of absence learn its structure.
///
/// The selection depends on the region alone and not on the place within it, so the density of clutter in a gate is
/// even. Its effect on the rate of false fixes was not measured, and more corners in the gates are more clutter there too.
/// Without regions, `harris` selects.
///
/// Source: Harris and Stephens 1988; guided matching: Davison, *Active search for real-time vision*, ICCV 2005.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct GuidedCorners {
    /// The detector of images without regions; its window, response and radius of suppression hold everywhere.
    pub harris: Harris,
    /// Standard deviations of the windows inside the regions (px).
    pub sigmas: Vec<f64>,
    /// Minimum response inside the regions, relative to the strongest of the image.
    pub quality: f64,
    /// Maximum number of corners outside the regions; inside, that of `harris` holds.
    pub outside: usize,
}

impl Default for GuidedCorners {
    fn default() -> Self {
        Self { harris: Harris::default(), sigmas: vec![1.0, 1.8], quality: 1e-6, outside: 500 }
    }
}

impl Component for GuidedCorners {
    const NAME: &'static str = "guided";
    const SUMMARY: &'static str =
        "corners at several scales where the prior expects an object, and a sample of those elsewhere";
    const SOURCE: &'static str = "Davison, Active search for real-time vision, ICCV 2005";

    fn check(&self) -> Result<(), String> {
        let Self { harris, sigmas, quality, outside } = self;
        harris.check().map_err(|message| format!("harris.{message}"))?;
        let count = sigmas.len();
        in_range((1..=8).contains(&count), "sigmas", count, "1 to 8 standard deviations")?;
        for sigma in sigmas {
            in_range(SIGMAS.contains(sigma), "sigmas", sigma, "numbers from 0.3 to 100 (px)")?;
        }
        in_range((0.0..=1.0).contains(quality), "quality", quality, "a number from 0 to 1")?;
        in_range(*outside > 0, "outside", outside, "at least 1")
    }
}

#[derive(Debug, Default)]
struct Scratch {
    inside: Vec<Keypoint>,
    of_scale: Vec<Keypoint>,
    selection: select::Scratch,
}

impl GuidedCorners {
    /// All corners of one window, strongest first.
    fn corners(&self, sigma: f64, quality: f64) -> Corners {
        let Harris { window, k, radius, cells, .. } = self.harris;
        let tensor = Tensor { window, sigma, measure: Measure::Harris { k: k as f32 } };
        let budget = Budget { features: usize::MAX, selection: Selection::Strongest, cells };
        Corners { tensor, quality, radius, budget }
    }

    fn budget(&self, features: usize) -> Budget {
        Budget { features, selection: self.harris.selection, cells: self.harris.cells }
    }
}

impl Detector for GuidedCorners {
    fn detect_into(&self, image: &Image, work: &mut Workspace, found: &mut Vec<Keypoint>) {
        self.harris.detect_into(image, work, found);
    }

    fn is_guided(&self) -> bool {
        true
    }

    fn detect_guided_into(&self, image: &Image, regions: &Regions, work: &mut Workspace, found: &mut Vec<Keypoint>) {
        if regions.is_empty() {
            return self.detect_into(image, work, found);
        }
        let size = [image.width(), image.height()];
        let Scratch { inside, of_scale, .. } = work.get::<Scratch>();
        let (mut inside, mut of_scale) = (std::mem::take(inside), std::mem::take(of_scale));
        inside.clear();
        for &sigma in &self.sigmas {
            self.corners(sigma, self.quality).find(image, work, &mut of_scale);
            let strongest = of_scale.first().map_or(1.0, |first| first.response);
            // One scale for all, because descriptors of different sizes do not match.
            let relative = |corner: &Keypoint| Keypoint {
                response: corner.response / strongest,
                scale: self.harris.sigma as f32,
                ..*corner
            };
            inside.extend(of_scale.iter().filter(|corner| regions.contains(&corner.at)).map(relative));
        }
        self.corners(self.harris.sigma, self.harris.quality).find(image, work, found);
        found.retain(|corner| !regions.contains(&corner.at));
        let strongest = found.first().map_or(1.0, |first| first.response);
        found.iter_mut().for_each(|corner| corner.response /= strongest);
        let selection = &mut work.get::<Scratch>().selection;
        one_each(&mut inside, self.harris.radius as f64, size);
        self.budget(self.harris.features).keep(&mut inside, size, selection);
        self.budget(self.outside).keep(found, size, selection);
        found.extend_from_slice(&inside);
        found.sort_unstable_by(select::stronger);
        let scratch = work.get::<Scratch>();
        (scratch.inside, scratch.of_scale) = (inside, of_scale);
    }
}

/// Keeps the strongest of the corners within `radius` (px) of each other, which lie in an image of this size.
fn one_each(corners: &mut Vec<Keypoint>, radius: f64, [width, height]: [usize; 2]) {
    corners.sort_unstable_by(select::stronger);
    let side = radius.max(1.0);
    let columns = (width as f64 / side) as usize + 1;
    let rows = (height as f64 / side) as usize + 1;
    let cell = |x: f64, n: usize| ((x.max(0.0) / side) as usize).min(n - 1);
    let mut taken: Vec<Vec<Keypoint>> = vec![Vec::new(); columns * rows];
    corners.retain(|corner| {
        let (column, row) = (cell(corner.at.u, columns), cell(corner.at.v, rows));
        let near = |row: usize| {
            let cells =
                &taken[row * columns + column.saturating_sub(1)..=row * columns + (column + 1).min(columns - 1)];
            cells.iter().flatten().any(|other| other.at.distance(&corner.at) <= radius)
        };
        let free = !(row.saturating_sub(1)..=(row + 1).min(rows - 1)).any(near);
        if free {
            taken[row * columns + column].push(*corner);
        }
        free
    });
}

#[cfg(test)]
mod tests {
    use seafix_geometry::Pixel;

    use super::*;
    use crate::{regions::Disc, workspace::Threads};

    /// Cells of 9 px of random grey levels; the right half has a twentieth of the contrast.
    fn cells(width: usize, height: usize) -> Image {
        let value = |x: usize, y: usize| {
            let mut h = ((x / 9) as u32).wrapping_mul(0x9E37_79B1) ^ ((y / 9) as u32).wrapping_mul(0x85EB_CA77);
            h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
            let level = ((h ^ (h >> 13)) % 200) as f32;
            if 2 * x < width { level } else { 90.0 + 0.05 * level }
        };
        Image::new(width, height, (0..width * height).map(|i| value(i % width, i / width)).collect()).unwrap()
    }

    fn guided(detector: &GuidedCorners, regions: &Regions) -> Vec<Keypoint> {
        let mut found = Vec::new();
        detector.detect_guided_into(&cells(360, 240), regions, &mut Workspace::new(Threads::One), &mut found);
        found
    }

    fn disc() -> Regions {
        Regions::new(vec![Disc { centre: Pixel { u: 270.0, v: 120.0 }, radius: 60.0 }])
    }

    /// Fails if the ordinary threshold holds inside the regions.
    #[test]
    fn faint_corners_are_found_where_they_are_expected() {
        let detector = GuidedCorners::default();
        let (ordinary, regions) = (detector.detect(&cells(360, 240)), disc());
        let inside = |found: &[Keypoint]| found.iter().filter(|corner| regions.contains(&corner.at)).count();
        let found = guided(&detector, &regions);
        assert_eq!(inside(&ordinary), 0);
        // A twentieth of the contrast is 6e-6 of the response: those with a sixth of the strongest remain.
        assert!(inside(&found) > 30, "{}", inside(&found));
        assert_eq!(guided(&detector, &Regions::NONE), ordinary);
    }

    /// Fails if the budget of the regions is spent in order of distance from their centre.
    #[test]
    fn the_density_is_even_within_a_region_and_the_budgets_are_kept() {
        let harris = Harris { features: 30, ..Harris::default() };
        let detector = GuidedCorners { harris, outside: 40, ..GuidedCorners::default() };
        let regions = disc();
        let found = guided(&detector, &regions);
        let (inside, outside): (Vec<Keypoint>, Vec<Keypoint>) =
            found.iter().partition(|corner| regions.contains(&corner.at));
        assert_eq!((inside.len(), outside.len()), (30, 40));
        // The inner disc of half the radius has a quarter of the area; σ = √(30 · ¼ · ¾) = 2.4.
        let centre = Pixel { u: 270.0, v: 120.0 };
        let near = inside.iter().filter(|corner| corner.at.distance(&centre) <= 30.0).count();
        assert!((1..=15).contains(&near), "{near}");
        assert!(found.windows(2).all(|w| w[0].response >= w[1].response));
    }

    #[test]
    fn corners_of_several_scales_are_one_each() {
        let detector = GuidedCorners { sigmas: vec![1.0, 1.4, 2.0], ..GuidedCorners::default() };
        let found = guided(&detector, &disc());
        let inside: Vec<_> = found.iter().filter(|corner| disc().contains(&corner.at)).collect();
        for (i, a) in inside.iter().enumerate() {
            assert!(inside[..i].iter().all(|b| a.at.distance(&b.at) > 4.0), "{a:?}");
        }
    }
}
