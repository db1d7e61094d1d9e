//! A custom search in the default pipeline: `cargo run --release --example custom_search`.

#![allow(clippy::print_stdout)]

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand::Rng;
use seafix::{
    Localizer, Outcome, PosePrior, Rig, Site, StereoImages,
    geometry::Transform,
    referencing::{Correspondence, Identification, Problem, Rejected, Search},
};

/// A greedy search: each model point takes its first candidate that is coherent with the pairs taken before.
#[derive(Debug)]
struct Greedy;

impl Search for Greedy {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        let mut pairs: Vec<Correspondence> = Vec::new();
        for (model, list) in problem.candidates.lists.iter().enumerate() {
            let candidate = |&cloud: &usize| Correspondence { model, cloud };
            let coherent = |pair: &Correspondence| pairs.iter().all(|other| problem.coherent(*pair, *other));
            pairs.extend(list.iter().map(candidate).find(coherent));
        }
        let bound = problem.model.len();
        match pairs.len() {
            0..3 => Err(Rejected::NotFound { bound, needed: 3 }),
            _ => Ok(Identification::unproved(pairs, bound, 0)),
        }
    }
}

fn main() -> Result<(), seafix::Error> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample");
    let (rig, site) = (Rig::from_file(folder)?, Site::from_file(format!("{folder}/site.toml"))?);
    let images = StereoImages::open(format!("{folder}/left000.png"), format!("{folder}/right000.png"), &rig)?;
    let attitude = UnitQuaternion::from_quaternion(Quaternion::new(-0.31943, -0.10266, -0.03577, 0.94135));
    let world_from_camera = Transform::new(attitude, Vector3::new(-23.459, -5.727, 36.558));
    let prior = PosePrior::isotropic(world_from_camera, 0.5_f64.to_radians(), 0.1);
    let localizer = Localizer::new(&site, &rig)?.with_search(Box::new(Greedy));
    for target in localizer.localize(&images, &prior)? {
        match target.outcome {
            Outcome::Fix(fix) => println!("{}: {} points", target.name, fix.pairs.len()),
            rejected => println!("{}: {rejected}", target.name),
        }
    }
    Ok(())
}
