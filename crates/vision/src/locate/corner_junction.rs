//! The fit of a corner, or the junction of the edges around it.

use seafix_component::{Component, Settings};
use serde::{Deserialize, Serialize};

use super::{
    corner::fit_into,
    fit::CornerFit,
    junction::Junction,
    locator::{Locator, UncertainPixel},
    model::Shape,
};
use crate::{image::Image, keypoint::Keypoint, workspace::Workspace};

/// The fit of [`Corner`](super::Corner); where none is accepted, the [`Junction`].
///
/// A corner of a textured box has more than two grey levels around it, so that neither corner model explains its
/// neighbourhood, but its edges still meet in one point. Key points that are neither stay, with the larger error of a
/// detector's maximum.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct CornerJunction {
    /// The fit of a corner model.
    pub fit: CornerFit,
    /// The junction of the key points whose fit is rejected.
    pub junction: Junction,
}

impl Component for CornerJunction {
    const NAME: &'static str = "corner-junction";
    const SUMMARY: &'static str = "the fit of corner; where it is rejected, the junction of the edges";
    const SOURCE: &'static str = "Rohr, IJCV 1992; Förstner and Gülch, ISPRS 1987";

    fn check(&self) -> Result<(), String> {
        let Self { fit, junction } = self;
        fit.check().map_err(|message| format!("fit.{message}"))?;
        junction.check().map_err(|message| format!("junction.{message}"))
    }
}

impl Locator for CornerJunction {
    fn locate_into(
        &self,
        image: &Image,
        keypoints: &[Keypoint],
        work: &mut Workspace,
        places: &mut Vec<Option<UncertainPixel>>,
    ) {
        fit_into(&self.fit, &[Shape::Wedge, Shape::Crossing], image, keypoints, work, places);
        self.junction.fill(image, keypoints, work, places);
    }
}

#[cfg(test)]
mod tests {
    use seafix_geometry::Pixel;

    use super::*;

    /// Two edges that meet at (x, y), between three grey levels: a bright and a darker face before the background.
    fn three_faces(x: f64, y: f64) -> Image {
        let cover = |i: usize, edge: f64| 0.5 * libm::erfc((edge - i as f64) / (0.8 * std::f64::consts::SQRT_2));
        let pixel = |i: usize| {
            let (a, b) = (cover(i % 41, x), cover(i / 41, y));
            50.0 + a * (90.0 * b + 40.0 * (1.0 - b))
        };
        Image::new(41, 41, (0..41 * 41).map(|i| pixel(i) as f32).collect()).unwrap()
    }

    #[test]
    fn a_corner_between_three_levels_is_located_by_its_edges() {
        for (x, y) in [(20.0, 20.0), (20.4, 19.6)] {
            let image = three_faces(x, y);
            let at = [Keypoint { at: Pixel { u: x + 1.0, v: y + 0.8 }, response: 1.0, scale: 2.0 }];
            assert_eq!(super::super::Corner::default().locate(&image, &at), [None], "more than two levels");
            let found = CornerJunction::default().locate(&image, &at)[0].expect("the edges meet");
            assert!(found.at.distance(&Pixel { u: x, v: y }) < 0.3, "{:?}", found.at);
        }
    }
}
