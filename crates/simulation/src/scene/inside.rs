//! Point-in-body test, which distances to surfaces cannot replace.

use nalgebra::Vector3;

use super::Scene;

/// Ray directions, which meet no edge of an upright box lengthwise.
const DIRECTIONS: [[f64; 3]; 3] = [[0.31, 0.23, -1.0], [-1.0, 0.37, -0.41], [0.29, 1.0, 0.53]];
/// Maximum number of surfaces that a ray crosses.
const MAX: usize = 256;

impl Scene {
    /// Whether bodies enclose a place: rays in all directions leave more bodies than they enter. An open sheet encloses
    /// nothing.
    pub(crate) fn encloses(&self, place: &Vector3<f64>) -> bool {
        DIRECTIONS.iter().all(|along| self.left_behind(place, &Vector3::from(*along)) > 0)
    }

    /// The number of bodies that a ray leaves, minus those that it enters.
    fn left_behind(&self, place: &Vector3<f64>, along: &Vector3<f64>) -> i32 {
        let triangles = &self.mesh.triangles;
        let (mut from, mut sum) = (*place, 0);
        for _ in 0..MAX {
            let Some(hit) = self.bvh.hit(triangles, &from, along, f64::INFINITY) else { break };
            let triangle = &triangles[hit.triangle];
            // Paint lies on a face and encloses nothing.
            if triangle.layer == 0 {
                let [a, b, c] = triangle.at;
                sum += if (b - a).cross(&(c - a)).dot(along) > 0.0 { 1 } else { -1 };
            }
            from += along * (hit.t + 1e-9);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        scene::{builtin::built_in, change::Changes},
        survey::SurveyErrors,
    };

    #[test]
    fn what_is_inside_is_reported_from_what_is_near() {
        let plan = built_in("drill-centre").unwrap();
        let none = SurveyErrors { model: 0.0, survey: 0.0 };
        let scene = Scene::new(&plan, &Changes::default(), none, 1);
        let mut inside = 0;
        for shape in &plan.geometry.objects {
            let index = scene.nominal.objects.iter().position(|object| object.id == shape.id).unwrap();
            let world = scene.world_from_object[index];
            for body in &shape.boxes {
                let at = world * seafix_geometry::Point::from(Vector3::from(body.centre));
                inside += usize::from(scene.encloses(&at.coords));
                assert!(!scene.encloses(&(at.coords - Vector3::new(0.0, 0.0, 3.0))), "above");
            }
        }
        let boxes: usize = plan.geometry.objects.iter().map(|o| o.boxes.len()).sum();
        assert_eq!(inside, boxes);
    }
}
