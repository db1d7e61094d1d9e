//! Locators that fit a model of blurred corners.

use seafix_component::{Component, Settings};
use serde::{Deserialize, Serialize};

use super::{
    fit::{CornerFit, Fitter},
    locator::{Locator, UncertainPixel},
    model::Shape,
};
use crate::{
    image::Image,
    keypoint::Keypoint,
    workspace::{Threads, Workspace},
};

/// The source of the corner models.
pub(crate) const SOURCE: &str = "Rohr, Recognizing corners by fitting parametric models, IJCV 1992";

/// Defines a locator that fits the best of some shapes.
macro_rules! locator {
    ($(#[$doc:meta])* $name:ident, $kebab:literal, $shapes:expr, $summary:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Settings)]
        #[serde(transparent)]
        pub struct $name(pub CornerFit);

        impl Component for $name {
            const NAME: &'static str = $kebab;
            const SUMMARY: &'static str = $summary;
            const SOURCE: &'static str = SOURCE;

            fn check(&self) -> Result<(), String> {
                self.0.check()
            }
        }

        impl Locator for $name {
            fn locate_into(
                &self,
                image: &Image,
                keypoints: &[Keypoint],
                work: &mut Workspace,
                places: &mut Vec<Option<UncertainPixel>>,
            ) {
                fit_into(&self.0, &$shapes, image, keypoints, work, places);
            }
        }
    };
}

locator!(
    /// The better of the fits of [`XCorner`] and [`LCorner`]; key points in texture stay.
    Corner,
    "corner",
    [Shape::Wedge, Shape::Crossing],
    "the better fit of x-corner and l-corner; key points in texture stay"
);

locator!(
    /// The corner of a chequerboard: two crossing blurred edges, bright in two opposite sectors.
    ///
    /// Least squares on the residuals r = I − a − b·U fit seven parameters: centre, two directions, blur, two grey
    /// levels. The covariance of the centre comes from (JᵀJ)⁻¹, scaled by the residual variance.
    XCorner,
    "x-corner",
    [Shape::Crossing],
    "fit of two crossing blurred edges: the corner of a chequerboard"
);

locator!(
    /// The corner of a box: two blurred edges that end at their intersection, fitted as in [`XCorner`].
    LCorner,
    "l-corner",
    [Shape::Wedge],
    "fit of two blurred edges with a common end: the corner of a box"
);

/// The fitters, one for each piece of the work.
#[derive(Debug, Default)]
struct Fitters(Vec<Fitter>);

/// Fits the best of `shapes` at each key point.
pub(crate) fn fit_into(
    settings: &CornerFit,
    shapes: &[Shape],
    image: &Image,
    keypoints: &[Keypoint],
    work: &mut Workspace,
    places: &mut Vec<Option<UncertainPixel>>,
) {
    /// The number of key points in a piece of the work.
    const PIECE: usize = 64;
    let threads: Threads = work.threads();
    let Fitters(fitters) = work.get();
    places.clear();
    places.resize(keypoints.len(), None);
    threads.pieces(places, PIECE, fitters, |index, places, fitter| {
        for (place, keypoint) in places.iter_mut().zip(&keypoints[index * PIECE..]) {
            *place = fitter.near(settings, shapes, image, keypoint);
        }
    });
}

#[cfg(test)]
mod tests {
    use seafix_geometry::Pixel;

    use super::*;

    /// A bright quarter of the plane, x ≥ `x` and y ≥ `y`, blurred by a Gaussian of 0.8 px.
    ///
    /// The opposite quarter is bright as well with `chequer`.
    fn quarters(x: f64, y: f64, chequer: bool) -> Image {
        let cover = |i: usize, edge: f64| 0.5 * libm::erfc((edge - i as f64) / (0.8 * std::f64::consts::SQRT_2));
        let pixel = |i: usize| {
            let (a, b) = (cover(i % 41, x), cover(i / 41, y));
            50.0 + 100.0 * (a * b + if chequer { (1.0 - a) * (1.0 - b) } else { 0.0 })
        };
        Image::new(41, 41, (0..41 * 41).map(|i| pixel(i) as f32).collect()).unwrap()
    }

    fn keypoint(u: f64, v: f64) -> Keypoint {
        Keypoint { at: Pixel { u, v }, response: 1.0, scale: 2.0 }
    }

    #[test]
    fn each_kind_is_found_by_its_own_model_and_by_the_common_one() {
        let locators: [&dyn Locator; 3] = [&LCorner::default(), &XCorner::default(), &Corner::default()];
        for (x, y) in [(20.0, 20.0), (20.5, 19.5), (20.25, 20.7), (19.9, 20.3)] {
            for chequer in [false, true] {
                let image = quarters(x, y, chequer);
                let off = if chequer { 0.3 } else { 1.2 };
                let found = locators.map(|locator| locator.locate(&image, &[keypoint(x + off, y + off)])[0]);
                let [l, x_only, either] =
                    found.map(|place| place.map(|place| place.at.distance(&Pixel { u: x, v: y })));
                let (own, other) = if chequer { (x_only, l) } else { (l, x_only) };
                assert!(own.expect("the matching shape fits") < 1e-3, "{own:?} for {x}, {y}, {chequer}");
                assert_eq!(own, either);
                assert_eq!(other, None);
            }
        }
    }

    #[test]
    fn what_is_no_corner_stays() {
        let locator = Corner::default();
        let image = |value: &dyn Fn(usize, usize) -> f32| {
            Image::new(41, 41, (0..41 * 41).map(|i| value(i % 41, i / 41)).collect()).unwrap()
        };
        let hash = |x: usize, y: usize| ((((x * 7919 + y * 104_729) * 2_654_435_761_usize) >> 7) & 0xFF) as f32;
        let at = [keypoint(20.2, 20.4)];
        for (name, image) in [
            ("flat", image(&|_, _| 90.0)),
            ("an edge", image(&|x, _| if x < 20 { 40.0 } else { 160.0 })),
            ("noise", image(&hash)),
            ("faint", quarters(20.0, 20.0, true)),
        ] {
            let strict = Corner(CornerFit { contrast: 120.0, ..CornerFit::default() });
            let found = if name == "faint" { strict.locate(&image, &at) } else { locator.locate(&image, &at) };
            assert_eq!(found, [None], "{name}");
        }
        let tiny = Image::new(1, 1, vec![3.0]).unwrap();
        assert_eq!(locator.locate(&tiny, &[keypoint(0.0, 0.0)]), [None]);
        let border = quarters(5.0, 20.0, true);
        assert_eq!(locator.locate(&border, &[keypoint(5.0, 20.0)]), [None], "the window exceeds the image");
    }

    #[test]
    fn threads_change_nothing() {
        let image = quarters(20.3, 19.8, true);
        let points: Vec<Keypoint> = (0..150).map(|i| keypoint(19.0 + 0.02 * i as f64, 19.9)).collect();
        let mut pooled = Vec::new();
        Corner::default().locate_into(&image, &points, &mut Workspace::new(Threads::Pool), &mut pooled);
        assert_eq!(pooled, Corner::default().locate(&image, &points));
        assert!(pooled.iter().flatten().count() > 100);
    }
}
