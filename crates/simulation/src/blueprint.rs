//! The exact geometry of the virtual site, as data.

use serde::Deserialize;

/// The virtual production system: seven objects, fifty feature points.
const DRILL_CENTRE: &str = include_str!("../data/drill-centre.toml");

/// The exact geometry of a site.
///
/// Every object has a design frame with x forward, y to starboard and the origin on the mean seabed. Heights are
/// positive upwards from there. Lengths are in metres.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Blueprint {
    /// Name of the site.
    pub name: String,
    /// Id of the object whose frame is the site's frame.
    pub site_frame: String,
    /// Depth of the mean seabed below the world's origin.
    pub depth: f64,
    /// Number of rocks around each object.
    pub rocks: usize,
    /// The objects, in the order in which frames view them.
    #[serde(rename = "object")]
    pub objects: Vec<ObjectPlan>,
}

/// One object.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct ObjectPlan {
    /// Id of the object.
    pub id: String,
    /// North and east of the design frame's origin.
    pub at: [f64; 2],
    /// Heading of the x axis (degrees, from north over east).
    pub yaw_deg: f64,
    /// Roll and pitch of the settled object (degrees).
    pub tilt_deg: [f64; 2],
    /// Names of the base points P1, P2, P3 (the paper's Figure 2).
    pub base: [String; 3],
    /// Boxes.
    #[serde(rename = "box")]
    pub boxes: Vec<BoxPlan>,
    /// Painted areas on tops of boxes.
    #[serde(rename = "panel")]
    pub panels: Vec<PanelPlan>,
    /// Chequered markings on tops of boxes, whose corners are no feature points.
    #[serde(default, rename = "chequer")]
    pub chequers: Vec<ChequerPlan>,
    /// Pipes, whose ends are no feature points.
    #[serde(default, rename = "pipe")]
    pub pipes: Vec<PipePlan>,
    /// Feature points.
    #[serde(rename = "point")]
    pub points: Vec<PointPlan>,
}

/// An upright box.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct BoxPlan {
    /// Centre of the footprint.
    pub centre: [f64; 2],
    /// Length and width.
    pub size: [f64; 2],
    /// Height of the lower face.
    pub bottom: f64,
    /// Height of the upper face.
    pub top: f64,
    /// Rotation about the vertical (degrees).
    pub yaw_deg: f64,
    /// Albedo.
    pub albedo: f64,
}

/// A convex painted area.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct PanelPlan {
    /// Index of the box that carries it, from 0.
    #[serde(rename = "box")]
    pub carrier: usize,
    /// Corners on the upper face, from the face's centre along the box's axes.
    pub outline: Vec<[f64; 2]>,
    /// Albedo.
    pub albedo: f64,
}

/// A chequered marking.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct ChequerPlan {
    /// Index of the box that carries it, from 0.
    #[serde(rename = "box")]
    pub carrier: usize,
    /// First corner on the upper face.
    pub corner: [f64; 2],
    /// Rotation on that face (degrees).
    pub yaw_deg: f64,
    /// Side of a square.
    pub square: f64,
    /// Number of squares along and across.
    pub cells: [u32; 2],
    /// Albedo of the dark squares.
    pub albedo: f64,
}

/// A straight pipe.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct PipePlan {
    /// Start of the axis: x, y, height.
    pub from: [f64; 3],
    /// End of the axis: x, y, height.
    pub to: [f64; 3],
    /// Radius.
    pub radius: f64,
    /// Albedo.
    pub albedo: f64,
}

/// A feature point: a corner of a box's upper face or of a panel.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct PointPlan {
    /// Name of the point, unique on the site.
    pub id: String,
    /// Index of its panel, from 0, unless it lies on a box.
    #[serde(default)]
    pub panel: Option<usize>,
    /// Index of its box, from 0, unless it lies on a panel.
    #[serde(default, rename = "box")]
    pub carrier: Option<usize>,
    /// Index of the corner, from 0.
    pub corner: usize,
}

impl Blueprint {
    /// The built-in virtual production system.
    pub fn drill_centre() -> Self {
        toml::from_str(DRILL_CENTRE).expect("the built-in geometry is read by a test")
    }
}

impl BoxPlan {
    /// A place on the upper face in the design frame: x, y, height.
    ///
    /// `place` is measured from the face's centre along the box's axes.
    pub fn on_top(&self, place: [f64; 2]) -> [f64; 3] {
        let (sine, cosine) = libm::sincos(self.yaw_deg.to_radians());
        [
            self.centre[0] + cosine * place[0] - sine * place[1],
            self.centre[1] + sine * place[0] + cosine * place[1],
            self.top,
        ]
    }

    /// Corners of the upper face from its centre, in order.
    pub fn corners(&self) -> [[f64; 2]; 4] {
        let [x, y] = [0.5 * self.size[0], 0.5 * self.size[1]];
        [[-x, -y], [x, -y], [x, y], [-x, y]]
    }
}

impl ObjectPlan {
    /// The design-frame position of a feature point: x, y, height.
    pub fn place(&self, point: &PointPlan) -> [f64; 3] {
        match (point.panel, point.carrier) {
            (Some(panel), _) => {
                let panel = &self.panels[panel];
                self.boxes[panel.carrier].on_top(panel.outline[point.corner])
            }
            (None, Some(carrier)) => {
                let carrier = &self.boxes[carrier];
                carrier.on_top(carrier.corners()[point.corner])
            }
            (None, None) => {
                unreachable!("the built-in geometry names a panel or a box for each point; a test reads all")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All distances within an object, sorted.
    fn distances(object: &ObjectPlan) -> Vec<f64> {
        let places: Vec<_> = object.points.iter().map(|p| nalgebra::Vector3::from(object.place(p))).collect();
        let mut all: Vec<f64> = (0..places.len())
            .flat_map(|i| (0..i).map(|j| (places[i] - places[j]).norm()).collect::<Vec<_>>())
            .collect();
        all.sort_by(f64::total_cmp);
        all
    }

    #[test]
    fn seven_objects_carry_fifty_points() {
        let site = Blueprint::drill_centre();
        assert_eq!(site.objects.len(), 7);
        assert_eq!(site.objects.iter().map(|o| o.points.len()).sum::<usize>(), 50);
        let mut ids: Vec<_> = site.objects.iter().flat_map(|o| o.points.iter().map(|p| &p.id)).collect();
        ids.sort();
        ids.dedup();
        assert_eq!(ids.len(), 50);
        for object in &site.objects {
            for id in &object.base {
                assert!(object.points.iter().any(|p| p.id == *id), "{id}");
            }
        }
    }

    #[test]
    fn the_route_has_short_segments_over_a_site_of_fifty_metres() {
        let at: Vec<_> = Blueprint::drill_centre().objects.iter().map(|o| nalgebra::Vector2::from(o.at)).collect();
        assert!(at.windows(2).all(|w| (w[1] - w[0]).norm() <= 15.0));
        let span = at.iter().flat_map(|a| at.iter().map(move |b| (a - b).norm())).fold(0.0, f64::max);
        assert!((40.0..=55.0).contains(&span), "{span}");
    }

    #[test]
    fn distances_within_an_object_distinguish_its_points() {
        for object in &Blueprint::drill_centre().objects {
            let all = distances(object);
            let min = all.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
            assert!(min > 0.045, "{}: {min}", object.id);
            assert!(all[0] > 0.25);
            assert!(object.boxes.iter().all(|b| b.top < 1.5));
        }
    }

    #[test]
    fn base_points_span_a_metre_and_no_line() {
        for object in &Blueprint::drill_centre().objects {
            let [p1, p2, p3] = object
                .base
                .clone()
                .map(|id| nalgebra::Vector3::from(object.place(object.points.iter().find(|p| p.id == id).unwrap())));
            let (a, b) = (p2 - p1, p3 - p1);
            assert!(a.norm() >= 1.0 && b.norm() >= 1.0);
            assert!(a.cross(&b).norm() / (a.norm() * b.norm()) > 0.5);
        }
    }
}
