//! A fix from one stereo pair: `cargo run --release --example fix_from_images`.

#![allow(clippy::print_stdout)]

use seafix::nalgebra::{Quaternion, UnitQuaternion, Vector3};
use seafix::{Localizer, Outcome, PosePrior, Rig, Site, StereoImages, geometry::Transform};

fn main() -> Result<(), seafix::Error> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample");
    let rig = Rig::from_file(format!("{folder}/dataset.toml"))?;
    let site = Site::from_file(format!("{folder}/site.toml"))?;
    let images = StereoImages::open(format!("{folder}/left000.png"), format!("{folder}/right000.png"), &rig)?;

    // The prior pose, as from acoustics and odometry, has standard deviations of 0.1 m and 0.5° per axis.
    let attitude = UnitQuaternion::from_quaternion(Quaternion::new(-0.31943, -0.10266, -0.03577, 0.94135));
    let world_from_camera = Transform::new(attitude, Vector3::new(-23.459, -5.727, 36.558));
    let prior = PosePrior::isotropic(world_from_camera, 0.5_f64.to_radians(), 0.1);

    let localizer = Localizer::new(&site, &rig)?;
    for target in localizer.localize(&images, &prior)? {
        match target.outcome {
            Outcome::Fix(fix) => {
                println!("{}: {}, ± {:.1} mm", target.name, fix.object_from_camera, 1e3 * fix.position_sigma());
            }
            rejected => println!("{}: {rejected}", target.name),
        }
    }
    Ok(())
}
