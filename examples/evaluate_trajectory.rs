//! Absolute and relative pose errors (APE and RPE as in evo): `cargo run --release --example evaluate_trajectory`.

#![allow(clippy::print_stdout)]

use seafix_data::trajectory::Trajectory;
use seafix_evaluation::trajectory::{Delta, Relation, Summary, ape, associate, pairs, rpe};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample");
    let truth = Trajectory::read(format!("{folder}/truth.tum").as_ref())?;
    let prior = Trajectory::read(format!("{folder}/prior.tum").as_ref())?;

    // Poses are associated if their stamps differ by at most 10 ms.
    let (Some(stamps), Some(others)) = (&truth.stamps, &prior.stamps) else { return Err("no stamps".into()) };
    let matched = associate(stamps, others, 10_000_000, 0);
    let reference: Vec<_> = matched.iter().map(|&(index, _)| truth.poses[index]).collect();
    let estimate: Vec<_> = matched.iter().map(|&(_, index)| prior.poses[index]).collect();

    let absolute = Summary::of(&ape(&reference, &estimate, Relation::Translation));
    println!("APE: {:.3} m RMS over {} poses, at most {:.3} m", absolute.rmse, matched.len(), absolute.max);
    let steps = pairs(&reference, Delta::Frames(1), false, 0.1);
    let relative = Summary::of(&rpe(&reference, &estimate, &steps, Relation::AngleDeg));
    println!("RPE from frame to frame: {:.3}° RMS", relative.rmse);
    Ok(())
}
