//! A custom solver in the default pipeline: `cargo run --release --example custom_solver`.

#![allow(clippy::print_stdout)]

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use seafix::{
    Localizer, Outcome, Rig, Site, StereoImages,
    geometry::{Camera, Object, Transform},
    referencing::{Degenerate, Observations, Solver},
};

/// The method of Kabsch (1976): the least-squares rotation about the centroids by singular value decomposition.
#[derive(Debug)]
struct MyKabsch;

impl Solver for MyKabsch {
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        let pairs: Vec<(Vector3<f64>, Vector3<f64>)> =
            data.points.iter().map(|pair| (pair.measured.at.coords, pair.model.coords)).collect();
        let centroid = pairs.iter().fold((Vector3::zeros(), Vector3::zeros()), |sum, (c, o)| (sum.0 + c, sum.1 + o));
        let (camera, object) = (centroid.0 / pairs.len() as f64, centroid.1 / pairs.len() as f64);
        let h: Matrix3<f64> = pairs.iter().map(|(c, o)| (o - object) * (c - camera).transpose()).sum();
        let svd = h.svd(true, true);
        let (u, vt) = (svd.u.expect("computed by svd(true, true)"), svd.v_t.expect("computed by svd(true, true)"));
        let sign = Vector3::new(1.0, 1.0, (u * vt).determinant().signum());
        let rotation = Rotation3::from_matrix_unchecked(u * Matrix3::from_diagonal(&sign) * vt);
        let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
        Ok(Transform::new(rotation, object - rotation * camera))
    }
}

fn main() -> Result<(), seafix::Error> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample");
    let (rig, site) = (Rig::from_file(folder)?, Site::from_file(format!("{folder}/site.toml"))?);
    let images = StereoImages::open(format!("{folder}/left000.png"), format!("{folder}/right000.png"), &rig)?;
    let localizer = Localizer::new(&site, &rig)?.with_solver(Box::new(MyKabsch));
    for target in localizer.localize(&images, None)? {
        match target.outcome {
            // The covariance of a custom solver is computed by numerical derivatives.
            Outcome::Fix(fix) => println!("{}: ± {:.1} mm", target.name, 1e3 * fix.position_sigma()),
            rejected => println!("{}: {rejected}", target.name),
        }
    }
    Ok(())
}
