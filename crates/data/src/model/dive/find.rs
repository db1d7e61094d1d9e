//! The search for a feature where it is expected in a pair.

use nalgebra::{Matrix4, Vector2};
use seafix_geometry::{Camera, Pixel, Point, StereoPixels, StereoRig, Transform, UncertainPixels, UncertainPoint};
use seafix_vision::{Direct, Expected, FrontEnd, Image, Keypoint, Pair, UncertainPixel, Workspace};

use super::template::Template;

/// The expected pixels of a feature in a pair.
#[derive(Debug, Clone, Copy)]
pub(super) struct Expectation {
    /// The pixels.
    pub(super) pixels: StereoPixels,
    /// Their covariance (px²), from the uncertainties of pose and point.
    pub(super) covariance: Matrix4<f64>,
}

/// How a feature appears in a template's pair and where it is expected.
#[derive(Debug, Clone, Copy)]
pub(super) struct Appearance<'a> {
    /// The template.
    pub(super) template: &'a Template,
    /// The feature in the camera of the template.
    pub(super) here: Point<Camera>,
    /// The pose of the template's camera relative to the pair's.
    pub(super) there_from_here: Transform<Camera, Camera>,
}

/// A feature found in a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    /// The pixels with the covariance of their own errors.
    pub(super) pixels: UncertainPixels,
    /// The correlation with the template; `None` if its window did not align.
    pub(super) correlation: Option<f64>,
}

/// The reason why a feature was not found.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(super) enum Missed {
    /// A position that is too uncertain to search for.
    #[error("its position is uncertain by {0:.1} px")]
    Uncertain(f64),
    /// No corner near the expected position.
    #[error("no corner within {0:.1} px of its expected position")]
    NoCorner(f64),
    /// A neighbourhood that does not resemble the marked one.
    #[error("its surroundings do not align with those of the mark")]
    Unlike,
    /// No match in the right image.
    #[error("it does not align in the right image")]
    NoMatch,
    /// Pixels that contradict the expected ones.
    #[error("the nearest corner contradicts its expected position: χ² {0:.0}")]
    Elsewhere(f64),
    /// Pixels off the epipolar line.
    #[error("its pixels are {0:.1} px off the epipolar line")]
    Epipolar(f64),
}

/// The search for features in pairs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Finder<'a> {
    /// The front end: locator, refinement and the rules of the triangulator.
    pub(super) front_end: &'a FrontEnd,
    /// The rig.
    pub(super) rig: &'a StereoRig,
    /// The radius (px) within which a feature is searched around a certain position.
    pub(super) reach: f64,
}

/// The 99.99 % quantile of χ² with four degrees of freedom.
pub(super) const GATE: f64 = 23.512_7;
/// The largest radius of a search, in units of the reach: corners farther away are as likely others.
const MAX_RADIUS: f64 = 3.0;
/// The distance (px) of the starts of the locator; it moves farther than half of it.
pub(super) const SPACING: f64 = 3.0;
/// The distance (px) below which two located corners are one.
const SAME: f64 = 0.5;
/// The minimum correlation of a feature's neighbourhood with its template. Half of a window may show another background.
const MIN_CORRELATION: f64 = 0.6;
/// The maximum difference (px) between a forward and a backward alignment.
const RETURN: f64 = 0.5;

impl Finder<'_> {
    /// The radius (px) of the search around an expectation.
    ///
    /// # Errors
    /// [`Missed::Uncertain`] if three standard deviations exceed the largest radius.
    pub(super) fn radius(&self, expectation: &Expectation) -> Result<f64, Missed> {
        let c = &expectation.covariance;
        let sigma = (c[(0, 0)] + c[(1, 1)]).sqrt().max((c[(2, 2)] + c[(3, 3)]).sqrt());
        if 3.0 * sigma <= MAX_RADIUS * self.reach {
            Ok(self.reach.max(3.0 * sigma))
        } else {
            Err(Missed::Uncertain(sigma))
        }
    }

    /// Finds a corner: the fitted one that agrees best with the expectation.
    ///
    /// # Errors
    /// [`Missed`].
    pub(super) fn corner(
        &self,
        [left, right]: [&Image; 2],
        expectation: &Expectation,
        appearance: Option<Appearance<'_>>,
    ) -> Result<Found, Missed> {
        let radius = self.radius(expectation)?;
        let corners = self.corners_near(left, expectation.pixels.left, radius);
        if corners.is_empty() {
            return Err(Missed::NoCorner(radius));
        }
        let mut missed = Missed::NoMatch;
        let mut best: Option<(f64, Found)> = None;
        for corner in corners {
            let pixels = match self.matched([left, right], &expectation.pixels, &corner) {
                Ok(pixels) => pixels,
                Err(why) => {
                    missed = why;
                    continue;
                }
            };
            let chi2 = disagreement(expectation, &pixels);
            if best.is_none_or(|(lowest, _)| chi2 < lowest) {
                best = Some((chi2, Found { pixels, correlation: None }));
            }
        }
        let (chi2, found) = best.ok_or(missed)?;
        if chi2 > GATE {
            return Err(Missed::Elsewhere(chi2));
        }
        let correlation = appearance.and_then(|appearance| {
            let seen = self.aligned(left, &appearance, found.pixels.at.left, self.reach)?;
            Some(seen.1)
        });
        Ok(Found { correlation, ..found })
    }

    /// The corners within [`SPACING`] px of `places`, each once, in the camera of the pair.
    pub(super) fn corners_along(
        &self,
        [left, right]: [&Image; 2],
        places: impl Iterator<Item = Point<Camera>>,
    ) -> Vec<UncertainPoint<Camera>> {
        let mut corners: Vec<UncertainPixel> = Vec::new();
        let (mut pixels, mut cloud) = (Vec::new(), Vec::new());
        for place in places {
            let Some(expected) = self.rig.project(&place) else { continue };
            for corner in self.corners_near(left, expected.left, SPACING) {
                if corners.iter().all(|other| other.at.distance(&corner.at) >= SAME) {
                    corners.push(corner);
                    pixels.extend(self.matched([left, right], &expected, &corner));
                }
            }
        }
        self.front_end.triangulator.triangulate_into(&pixels, self.rig, &mut cloud);
        cloud.into_iter().map(|measured| measured.position).collect()
    }

    /// Finds a feature that is no corner: its template's window, forward and backward.
    ///
    /// # Errors
    /// [`Missed`].
    pub(super) fn patch(
        &self,
        [left, right]: [&Image; 2],
        expectation: &Expectation,
        appearance: Appearance<'_>,
    ) -> Result<Found, Missed> {
        let radius = self.radius(expectation)?;
        let (place, correlation) =
            self.aligned(left, &appearance, expectation.pixels.left, radius).ok_or(Missed::Unlike)?;
        let pixels = self.matched([left, right], &expectation.pixels, &place)?;
        let chi2 = disagreement(expectation, &pixels);
        if chi2 > GATE {
            return Err(Missed::Elsewhere(chi2));
        }
        Ok(Found { pixels, correlation: Some(correlation) })
    }

    /// The position of a template's feature in a left image with its covariance, and the correlation; `None` unless the
    /// backward alignment returns.
    pub(super) fn aligned(
        &self,
        left: &Image,
        appearance: &Appearance<'_>,
        start: Pixel,
        reach: f64,
    ) -> Option<(UncertainPixel, f64)> {
        let Appearance { template, here, there_from_here } = appearance;
        let expected = template.expected(self.rig, here, there_from_here, start)?;
        let direct = Direct { reach, min_correlation: MIN_CORRELATION, ..Direct::default() };
        let (mut work, mut tracks) = (Workspace::default(), Vec::new());
        direct.follow_into(&template.image, left, &[expected], &mut work, &mut tracks);
        let track = tracks.pop()??;
        let back = Expected {
            place: track.at,
            start: expected.place,
            shape: expected.shape.try_inverse()?,
            along: (expected.shape * expected.along).try_normalize(1e-9).unwrap_or_else(Vector2::x),
        };
        direct.follow_into(left, &template.image, &[back], &mut work, &mut tracks);
        let returned = tracks.pop()??;
        (returned.at.distance(&expected.place) <= RETURN)
            .then_some((UncertainPixel { at: track.at, covariance: track.covariance }, track.correlation))
    }

    /// The corners that the locator fits within `radius` of `at`.
    fn corners_near(&self, image: &Image, at: Pixel, radius: f64) -> Vec<UncertainPixel> {
        let count = (radius / SPACING).floor() as i32;
        let starts: Vec<Keypoint> = (-count..=count)
            .flat_map(|i| (-count..=count).map(move |j| (f64::from(i) * SPACING, f64::from(j) * SPACING)))
            .filter(|(u, v)| u * u + v * v <= radius * radius)
            .map(|(u, v)| Keypoint { at: Pixel { u: at.u + u, v: at.v + v }, response: 0.0, scale: 1.0 })
            .collect();
        let mut corners: Vec<UncertainPixel> = Vec::new();
        for place in self.front_end.locator.locate(image, &starts).into_iter().flatten() {
            let known = |other: &UncertainPixel| other.at.distance(&place.at) < SAME;
            if place.at.distance(&at) <= radius && !corners.iter().any(known) {
                corners.push(place);
            }
        }
        corners
    }

    /// The pixels of a position in the left image and its match in the right one.
    fn matched(
        &self,
        [left, right]: [&Image; 2],
        expected: &StereoPixels,
        place: &UncertainPixel,
    ) -> Result<UncertainPixels, Missed> {
        let start = Pixel {
            u: expected.right.u + place.at.u - expected.left.u,
            v: expected.right.v + place.at.v - expected.left.v,
        };
        let pair = Pair { left: *place, right: UncertainPixel::independent(start, 1.0) };
        let refined = self.front_end.refinement.refine(&[pair], left, right, self.rig);
        let pixels = *refined.first().ok_or(Missed::NoMatch)?;
        let off = self.rig.epipolar_distance(&pixels.at).unwrap_or(f64::INFINITY);
        if off > self.front_end.triangulator.rules().epipolar_px {
            return Err(Missed::Epipolar(off));
        }
        Ok(pixels)
    }
}

/// The squared Mahalanobis distance of pixels from their expectation.
fn disagreement(expectation: &Expectation, pixels: &UncertainPixels) -> f64 {
    let r = pixels.at.coordinates() - expectation.pixels.coordinates();
    let covariance = expectation.covariance + pixels.covariance;
    covariance.cholesky().map_or(f64::INFINITY, |factor| r.dot(&factor.solve(&r)))
}
