//! A model by hand: feature points that an operator marked in one stereo pair, as the paper measured its laboratory.
//!
//! A hand hits a corner to a pixel or two; the images know it to hundredths. Each left mark moves to the corner near it
//! where the locator finds one, the right place is aligned to the left window, and both are triangulated with their
//! covariance. The object's frame is that of three of the points by the Fig. 2 rule.

mod marks;

use std::path::Path;

use nalgebra::Matrix3;
use seafix_component::{Choice, Fault, nearest};
use seafix_geometry::{Camera, MeasuredPoint, Object, Pixel, Point, StereoRig, Transform, triad};
use seafix_referencing::{ModelPoint, Site, SiteObject};
use seafix_vision::{
    Descriptors, FrontEnd, Image, Keypoint, MATCHERS, Pair, Refinement, UncertainPixel, Unrefined, View,
};

pub use marks::Mark;

/// How marks become a model.
#[derive(Debug)]
pub struct ModelByHand<'a> {
    /// Detector, locator, alignment and triangulation.
    pub front_end: &'a FrontEnd,
    /// How far a mark may be off (px): the radius within which its corner is sought, and how far the right place may
    /// move along the epipolar line.
    pub reach: f64,
    /// Standard deviation of a mark that no corner was found for (px).
    pub mark_sigma: f64,
    /// The name of the object.
    pub object: String,
    /// P1, P2, P3 of the Fig. 2 rule; `None`: the widest triangle, for how well its corners are
    /// known, in the order of the marks.
    pub base: Option<[String; 3]>,
}

/// A model, and how each of its points came about.
#[derive(Debug)]
pub struct HandModel {
    /// One object that stands nowhere in the world.
    pub site: Site,
    /// Where the object was, seen from the left camera.
    pub object_from_camera: Transform<Object, Camera>,
    /// The points, in the order of the marks.
    pub points: Vec<HandPoint>,
    /// Right marks that the images contradict, a line each. An error along the epipolar line leaves no other trace: any two places
    /// on it are some point before the cameras.
    pub warnings: Vec<Fault>,
}

/// How one point of a model by hand came about.
#[derive(Debug)]
pub struct HandPoint {
    /// What the operator marked.
    pub mark: Mark,
    /// Whether a corner was found at the left mark; else the mark itself counts.
    pub corner: bool,
    /// Whether the right window could be aligned to the left one; else the mark itself counts.
    pub aligned: bool,
    /// The point, camera frame.
    pub measured: MeasuredPoint,
    /// Where it is in the object's frame.
    pub at: Point<Object>,
    /// Its covariance there (m²). The frame is taken as given: the errors of the three base points, which make it, are
    /// not taken off.
    pub covariance: Matrix3<f64>,
}

impl HandPoint {
    /// The root mean square of the three standard deviations (m): what `seafix-site/1` keeps.
    pub fn sigma(&self) -> f64 {
        (self.covariance.trace() / 3.0).sqrt()
    }
}

/// Points nearer to each other than this (m) are one: two marks that mean one corner.
const ONE_POINT: f64 = 1e-3;

/// The least sine of the angle at P1 that a base by hand should have.
const MIN_SINE: f64 = 0.1;
/// Model coordinates are written to this (m).
const GRAIN: f64 = 1e-7;

impl ModelByHand<'_> {
    /// The model of the marks in `text`, the content of `file`.
    ///
    /// # Errors
    /// The first line that is wrong, names no place in the images, or marks two things as one.
    pub fn model(&self, images: [&Image; 2], rig: &StereoRig, text: &str, file: &Path) -> Result<HandModel, Fault> {
        let sizes = [rig.left(), rig.right()].map(seafix_geometry::Pinhole::size);
        let marks = marks::read(text, file, sizes)?;
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
        let warnings = seen.iter().filter_map(|seen| self.doubt(seen, file)).collect();
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
            interest: Vec::new(),
        };
        let site = Site { name: self.object.clone(), frame: 0, objects: vec![object], warnings: Vec::new() };
        Ok(HandModel { site, object_from_camera, points, warnings })
    }

    fn see(
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
                    fault("the point is not found in the right image".to_owned())
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
            return Err(fault(format!(
                "the two marks are no single point before the cameras, {off:.1} px off the epipolar line"
            ))
            .remedy("mark the same corner in both images, or leave the right one empty and it is sought"));
        };
        let contradicted = sought.map(|sought| (sought, sought.distance(&pixels.at.right)));
        Ok(Seen { corner: corner.is_some(), aligned: aligned.is_some(), measured, contradicted, mark })
    }

    /// What the images say against a right mark: what is like the left place is further away than a hand errs.
    fn doubt(&self, seen: &Seen, file: &Path) -> Option<Fault> {
        let (sought, off) = seen.contradicted.filter(|(_, off)| *off > self.reach)?;
        let unaligned = if seen.aligned { "" } else { ", and the windows at the two marks are not alike" };
        let what = format!(
            "a right mark {off:.1} px from where the right image shows the left one best, {:.1}, {:.1}{unaligned}",
            sought.u, sought.v
        );
        let fault = Fault::new(what, file).on_line(seen.mark.line).value(format!("`{}`", seen.mark.id));
        Some(fault.remedy("look at it again; left empty, the right place is sought"))
    }

    /// The corner that a mark means: of those within reach the nearest.
    fn corner(&self, image: &Image, keypoints: &[Keypoint], mark: Pixel) -> Option<UncertainPixel> {
        let by_hand = Keypoint { at: mark, response: 0.0, scale: keypoints.first().map_or(1.0, |one| one.scale) };
        let near = keypoints.iter().filter(|keypoint| keypoint.at.distance(&mark) <= self.reach);
        let starts: Vec<Keypoint> = near.copied().chain([by_hand]).collect();
        let places = self.front_end.locator.locate(image, &starts).into_iter().flatten();
        let off = |place: &UncertainPixel| place.at.distance(&mark);
        places.filter(|place| off(place) <= self.reach).min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// The places of P1, P2, P3 among the points.
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
            .remedy("mark a point aside of them, or choose others with --base"))
    }
}

/// A mark, and the point it means.
struct Seen {
    mark: Mark,
    corner: bool,
    aligned: bool,
    measured: MeasuredPoint,
    /// Where the right place would be sought had none been marked, and how far that is from the one that was taken (px).
    contradicted: Option<(Pixel, f64)>,
}

/// Where the right image shows a place of the left one.
fn seek([left, right]: [&Image; 2], at: Pixel, rig: &StereoRig) -> Option<Pixel> {
    // Nothing tells it from its neighbours but the operator: the best place counts, clear or not.
    let matcher = MATCHERS.build(&Choice::named("zncc-band").with("ratio", 1.0)).expect("its settings are in range");
    let (keypoints, none) = ([Keypoint { at, response: 1.0, scale: 1.0 }], Descriptors::default());
    let view = |image, keypoints| View { image, keypoints, descriptors: &none };
    matcher.matches(&view(left, &keypoints), &view(right, &[]), rig).first().map(|found| found.right)
}
