//! A fix from a cloud of measured points: `cargo run --release --example fix_from_points`.

#![allow(clippy::print_stdout)]

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use seafix::{
    Localizer, Outcome, PosePrior, Rig, Site,
    geometry::{MeasuredPoint, Point, Transform, UncertainPoint},
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample");
    let rig = Rig::from_file(folder)?;
    let site = Site::from_file(format!("{folder}/site.toml")).map_err(seafix::Error::from)?;

    // Each line is a point: x, y, z in the camera frame and their standard deviation (m).
    let mut cloud = Vec::new();
    for line in include_str!("data/cloud.csv").lines().skip(1) {
        let numbers: Vec<f64> = line.split(',').map(str::parse).collect::<Result<_, _>>()?;
        let at = Point::from(Vector3::new(numbers[0], numbers[1], numbers[2]));
        let covariance = Matrix3::identity() * numbers[3].powi(2);
        cloud.push(MeasuredPoint { position: UncertainPoint { at, covariance }, pixels: None });
    }

    let attitude = UnitQuaternion::from_quaternion(Quaternion::new(-0.31943, -0.10266, -0.03577, 0.94135));
    let world_from_camera = Transform::new(attitude, Vector3::new(-23.459, -5.727, 36.558));
    let prior = PosePrior::isotropic(world_from_camera, 0.5_f64.to_radians(), 0.1);
    // The points have no pixels: this solver weights them by their covariances.
    let localizer = Localizer::from_toml(&site, &rig, "solver = 'mahalanobis'")?;
    for target in localizer.localize_points(&cloud, &prior) {
        match target.outcome {
            Outcome::Fix(fix) => {
                println!("{}: {} points, residual {:.1} mm", target.name, fix.pairs.len(), 1e3 * fix.residual_rms);
            }
            rejected => println!("{}: {rejected}", target.name),
        }
    }
    Ok(())
}
