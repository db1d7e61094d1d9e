//! Object models from the marks of an operator in one stereo pair, as the paper measured its laboratory objects.
//!
//! A mark has an error of a pixel or two; the images locate a corner to hundredths. Each left mark moves to a corner
//! close to it if the locator finds one. The right position is aligned to the left window, and both are triangulated
//! with their covariance. Three of the points define the object's frame by the rule of Fig. 2.

use std::path::Path;

use nalgebra::Matrix3;
use seafix_component::{Choice, Fault, nearest};
use seafix_geometry::{Camera, MeasuredPoint, Object, Pixel, Point, StereoRig, Transform, triad};
use seafix_referencing::{ModelPoint, Site, SiteObject};
use seafix_vision::{
    Descriptors, FrontEnd, Image, Keypoint, LOCATORS, Locator, MATCHERS, Pair, Refinement, UncertainPixel, Unrefined,
    View,
};

use super::marks::{self, Mark};

/// The settings for a model from marks.
#[derive(Debug)]
pub struct ModelByHand<'a> {
    /// The front end: detector, locator, refinement and triangulator.
    pub front_end: &'a FrontEnd,
    /// The maximum error of a mark (px): the radius within which a corner is searched, and the maximum displacement of
    /// the right position along the epipolar line.
    pub reach: f64,
    /// The standard deviation of a mark without a corner (px).
    pub mark_sigma: f64,
    /// The name of the object.
    pub object: String,
    /// The base points P1, P2, P3 of the Fig. 2 rule, by name. `None` selects the triangle with the largest ratio of
    /// area to the points' errors, in the order of the marks.
    pub base: Option<[String; 3]>,
}

/// An object model with the details of each point.
#[derive(Debug)]
pub struct HandModel {
    /// The object, without a pose in the world.
    pub site: Site,
    /// The pose of the object relative to the left camera.
    pub object_from_camera: Transform<Object, Camera>,
    /// The points, in the order of the marks.
    pub points: Vec<HandPoint>,
    /// One warning for each right mark that contradicts the images. An error along the epipolar line shows in no other
    /// way, because any two positions on it triangulate to a point.
    pub warnings: Vec<Fault>,
}

/// A model point with its marks and its measurement.
#[derive(Debug)]
pub struct HandPoint {
    /// The mark of the operator.
    pub mark: Mark,
    /// Whether a corner was found at the left mark; otherwise the mark itself is used.
    pub corner: bool,
    /// Whether the right window was aligned to the left one; otherwise the mark itself is used.
    pub aligned: bool,
    /// The point in the camera frame.
    pub measured: MeasuredPoint,
    /// The position in the object's frame.
    pub at: Point<Object>,
    /// The covariance in the object's frame (m²). The frame is taken as exact, without the errors of the base points
    /// that define it.
    pub covariance: Matrix3<f64>,
}

impl HandPoint {
    /// The RMS of the three standard deviations (m), the `sigma` of `seafix-site/1`.
    pub fn sigma(&self) -> f64 {
        (self.covariance.trace() / 3.0).sqrt()
    }
}

/// The distance (m) below which two marks denote the same corner.
pub(super) const ONE_POINT: f64 = 1e-3;

/// The minimum sine of the angle at P1 of a base that an operator chooses.
pub(super) const MIN_SINE: f64 = 0.1;
/// The resolution of written model coordinates (m).
pub(super) const GRAIN: f64 = 1e-7;

impl ModelByHand<'_> {
    /// Builds a model from the marks in `text`, the content of `file`.
    ///
    /// # Errors
    /// The first invalid line, a mark outside the images, or two marks of one corner.
    pub fn model(&self, images: [&Image; 2], rig: &StereoRig, text: &str, file: &Path) -> Result<HandModel, Fault> {
        let sizes = [rig.left(), rig.right()].map(seafix_geometry::Pinhole::size);
        self.of_marks(images, rig, marks::read(text, file, sizes)?, file)
    }

    /// Builds a model from the marks that `file` has for this pair of images.
    ///
    /// # Errors
    /// Marks without a match, two marks of one corner, or base points on a line.
    pub fn of_marks(
        &self,
        images: [&Image; 2],
        rig: &StereoRig,
        marks: Vec<Mark>,
        file: &Path,
    ) -> Result<HandModel, Fault> {
        let keypoints = images.map(|image| self.front_end.detector.detect(image));
        let seen: Vec<Seen> =
            marks.into_iter().map(|mark| self.see(mark, images, &keypoints, rig, file)).collect::<Result<_, _>>()?;
        for (k, one) in seen.iter().enumerate() {
            let same = |other: &&Seen| one.measured.position.at.distance(&other.measured.position.at) < ONE_POINT;
            if let Some(other) = seen[..k].iter().find(same) {
                return Err(Fault::new(format!("a mark of the same corner as `{}`", other.mark.id), file)
                    .on_line(one.mark.line)
                    .value(format!("`{}`", one.mark.id))
                    .remedy("mark every corner once"));
            }
        }
        let doubted = seen.iter().filter_map(|seen| self.doubt(seen, file));
        let missed = seen.iter().filter(|seen| !seen.corner);
        let warnings = doubted.chain(missed.map(|seen| self.missed(&seen.mark, images[0], &keypoints[0], file)));
        let warnings = warnings.collect();
        let base = self.base(&seen, file)?;
        let corner = base.map(|index| seen[index].measured.position.at);
        let camera_from_object: Transform<Camera, Object> = triad(&corner[0], &corner[1], &corner[2])
            .map_err(|error| Fault::new(error.to_string(), file).remedy("choose other base points with --base"))?;
        let object_from_camera = camera_from_object.inverse();
        let turn = object_from_camera.rotation_matrix();
        let points: Vec<HandPoint> = seen
            .into_iter()
            .map(|Seen { mark, corner, aligned, measured, .. }| {
                let at = object_from_camera * measured.position.at;
                let at = Point::from(at.coords.map(|x| (x / GRAIN).round() * GRAIN));
                let covariance = turn * measured.position.covariance * turn.transpose();
                HandPoint { mark, corner, aligned, measured, at, covariance }
            })
            .collect();
        let object = SiteObject {
            id: self.object.clone(),
            base,
            base_in_world: None,
            survey_sigma: 0.0,
            world_from_object: None,
            points: points
                .iter()
                .map(|point| ModelPoint { sigma: point.sigma(), ..ModelPoint::exact(&point.mark.id, point.at) })
                .collect(),
            edges: Vec::new(),
            interest: Vec::new(),
        };
        let site = Site { name: self.object.clone(), frame: 0, objects: vec![object], warnings: Vec::new() };
        Ok(HandModel { site, object_from_camera, points, warnings })
    }

    /// Locates a mark in both images and triangulates it.
    pub(super) fn see(
        &self,
        mark: Mark,
        [left, right]: [&Image; 2],
        keypoints: &[Vec<Keypoint>; 2],
        rig: &StereoRig,
        file: &Path,
    ) -> Result<Seen, Fault> {
        let fault = |what: String| Fault::new(what, file).on_line(mark.line).value(format!("`{}`", mark.id));
        let corner = self.corner(left, &keypoints[0], mark.left);
        let place = corner.unwrap_or_else(|| UncertainPixel::independent(mark.left, self.mark_sigma));
        let start = match mark.right {
            Some(marked) => self
                .corner(right, &keypoints[1], marked)
                .unwrap_or_else(|| UncertainPixel::independent(marked, self.mark_sigma)),
            None => {
                let sought = seek([left, right], place.at, rig).ok_or_else(|| {
                    fault("the point has no match in the right image".to_owned())
                        .remedy("mark it there too: right_u, right_v")
                })?;
                UncertainPixel::independent(sought, 1.0)
            }
        };
        let sought = mark.right.and_then(|_| seek([left, right], place.at, rig));
        let pair = Pair { left: place, right: start };
        let aligned = self.front_end.refinement.refine(&[pair], left, right, rig).first().copied();
        let unaligned = || Unrefined::default().refine(&[pair], left, right, rig)[0];
        let pixels = aligned.unwrap_or_else(unaligned);
        let mut cloud = Vec::new();
        self.front_end.triangulator.triangulate_into(&[pixels], rig, &mut cloud);
        let Some(&measured) = cloud.first() else {
            let off = rig.epipolar_distance(&pixels.at).unwrap_or(f64::INFINITY);
            return Err(fault(format!("the two marks do not triangulate, {off:.1} px off the epipolar line"))
                .remedy("mark the same corner in both images, or leave the right mark empty to match it"));
        };
        let contradicted = sought.map(|sought| (sought, sought.distance(&pixels.at.right)));
        Ok(Seen { corner: corner.is_some(), aligned: aligned.is_some(), measured, contradicted, mark })
    }

    /// A warning for a right mark far from the best match of the left position. The limit is the error of an operator.
    fn doubt(&self, seen: &Seen, file: &Path) -> Option<Fault> {
        let (sought, off) = seen.contradicted.filter(|(_, off)| *off > self.reach)?;
        let unaligned = if seen.aligned { "" } else { ", and the windows at the two marks differ" };
        let what = format!(
            "a right mark {off:.1} px from the best match of the left mark, {:.1}, {:.1}{unaligned}",
            sought.u, sought.v
        );
        let fault = Fault::new(what, file).on_line(seen.mark.line).value(format!("`{}`", seen.mark.id));
        Some(fault.remedy("check the mark; an empty right mark is matched"))
    }

    /// The warning for a left mark without a corner, with the locators that find one there.
    fn missed(&self, mark: &Mark, image: &Image, keypoints: &[Keypoint], file: &Path) -> Fault {
        let finds = |name: &&str| {
            let locator = LOCATORS.build(&Choice::named(name)).ok();
            locator.is_some_and(|locator| self.corner_by(&*locator, image, keypoints, mark.left).is_some())
        };
        let others: Vec<String> =
            LOCATORS.names().filter(finds).map(|name| format!("`--set locator.name={name}`")).collect();
        let remedy = match others.is_empty() {
            true => "no other locator finds one; correct the mark, or raise --reach".to_owned(),
            false => format!("find one with {}", others.join(" or ")),
        };
        let what = format!("no corner within {} px of the left mark, which is used as it is", self.reach);
        Fault::new(what, file).on_line(mark.line).value(format!("`{}`", mark.id)).remedy(remedy)
    }

    /// The corner nearest to a mark, within the mark's error.
    fn corner(&self, image: &Image, keypoints: &[Keypoint], mark: Pixel) -> Option<UncertainPixel> {
        self.corner_by(&*self.front_end.locator, image, keypoints, mark)
    }

    fn corner_by(
        &self,
        locator: &dyn Locator,
        image: &Image,
        keypoints: &[Keypoint],
        mark: Pixel,
    ) -> Option<UncertainPixel> {
        let by_hand = Keypoint { at: mark, response: 0.0, scale: keypoints.first().map_or(1.0, |one| one.scale) };
        let near = keypoints.iter().filter(|keypoint| keypoint.at.distance(&mark) <= self.reach);
        let starts: Vec<Keypoint> = near.copied().chain([by_hand]).collect();
        let places = locator.locate(image, &starts).into_iter().flatten();
        let off = |place: &UncertainPixel| place.at.distance(&mark);
        places.filter(|place| off(place) <= self.reach).min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// The indices of P1, P2, P3 among the points.
    fn base(&self, seen: &[Seen], file: &Path) -> Result<[usize; 3], Fault> {
        let at = |index: usize| seen[index].measured.position.at;
        let base = match &self.base {
            Some(names) => {
                let ids = || seen.iter().map(|point| point.mark.id.as_str());
                let mut base = [0; 3];
                for (place, name) in base.iter_mut().zip(names) {
                    *place = ids().position(|id| id == name).ok_or_else(|| {
                        let near = nearest(name, ids()).map(|near| format!("did you mean `{near}`?"));
                        Fault::new("a base point is not marked", file)
                            .value(format!("`{name}`"))
                            .remedy(near.unwrap_or_else(|| "name three of the marked points".to_owned()))
                    })?;
                }
                base
            }
            None => {
                let all = (0..seen.len()).flat_map(|i| (0..i).flat_map(move |j| (0..j).map(move |k| [k, j, i])));
                let area = |[i, j, k]: [usize; 3]| (at(j) - at(i)).cross(&(at(k) - at(i))).norm();
                let variance =
                    |base: [usize; 3]| base.map(|i| seen[i].measured.position.covariance.trace()).iter().sum();
                let worth = |base: &[usize; 3]| area(*base) / f64::sqrt(variance(*base));
                all.max_by(|a, b| worth(a).total_cmp(&worth(b))).expect("there are three marks")
            }
        };
        let (a, b) = (at(base[1]) - at(base[0]), at(base[2]) - at(base[0]));
        let sine = a.cross(&b).norm() / (a.norm() * b.norm());
        if sine >= MIN_SINE {
            return Ok(base);
        }
        let names = base.map(|index| seen[index].mark.id.clone()).join(", ");
        Err(Fault::new("the base points are nearly on a line", file)
            .value(format!("{names}: sine {sine:.3}, at least {MIN_SINE} is needed"))
            .remedy("mark a point off their line, or choose others with --base"))
    }
}

/// A mark and its measured point.
pub(super) struct Seen {
    mark: Mark,
    /// Whether a corner was found at the left mark.
    pub(super) corner: bool,
    aligned: bool,
    /// The point in the camera frame.
    pub(super) measured: MeasuredPoint,
    /// The best match of the left position, and its distance (px) from the one used.
    contradicted: Option<(Pixel, f64)>,
}

/// The match of a left position in the right image.
fn seek([left, right]: [&Image; 2], at: Pixel, rig: &StereoRig) -> Option<Pixel> {
    // The operator decides in place of the ratio test: the best match counts, ambiguous or not.
    let matcher = MATCHERS.build(&Choice::named("zncc-band").with("ratio", 1.0)).expect("its settings are in range");
    let (keypoints, none) = ([Keypoint { at, response: 1.0, scale: 1.0 }], Descriptors::default());
    let view = |image, keypoints| View { image, keypoints, descriptors: &none };
    matcher.matches(&view(left, &keypoints), &view(right, &[]), rig).first().map(|found| found.right)
}
