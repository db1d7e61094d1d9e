//! A custom solver with its property tests: `cargo run --release --example custom_solver`.

#![allow(clippy::print_stdout)]

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use seafix::{
    Localizer, Outcome, Rig, Site, StereoImages,
    component::{Added, Choice},
    geometry::{Camera, Object, Transform},
    referencing::{Degenerate, Observations, SOLVERS, Solver},
};
use seafix_experiment::{Existing, Options, Plan, Silent, run};
use seafix_proptests::solver_laws::{LAWS, named};
use seafix_report::{Forms, report};

/// The least-squares motion by singular value decomposition (Arun, Huang and Blostein 1987).
#[derive(Debug)]
struct Arun {
    /// Minimum ratio of second to first extent of the points; below it they count as collinear.
    min_ratio: f64,
}

impl Solver for Arun {
    fn minimum(&self) -> usize {
        3
    }

    fn least_squares(&self) -> bool {
        true
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        let points = &data.points;
        if points.len() < self.minimum() {
            return Err(Degenerate::TooFew { found: points.len(), needed: self.minimum() });
        }
        if points.iter().any(|point| !point.is_finite()) {
            return Err(Degenerate::NotFinite);
        }
        let count = points.len() as f64;
        let camera = points.iter().map(|point| point.measured.at.coords).sum::<Vector3<f64>>() / count;
        let object = points.iter().map(|point| point.model.coords).sum::<Vector3<f64>>() / count;
        // M = Σ (P − P̄)(C − C̄)ᵀ, and the scatter of the measured points.
        let (mut m, mut scatter) = (Matrix3::zeros(), Matrix3::zeros());
        for point in points {
            let (c, p) = (point.measured.at.coords - camera, point.model.coords - object);
            m += p * c.transpose();
            scatter += c * c.transpose();
        }
        // Points on a line leave the rotation about it undetermined.
        let mut extents: [f64; 3] = scatter.symmetric_eigenvalues().map(|value| value.max(0.0).sqrt()).into();
        extents.sort_by(f64::total_cmp);
        let ratio = if extents[2] > 0.0 { extents[1] / extents[2] } else { 0.0 };
        if ratio < self.min_ratio {
            return Err(Degenerate::Collinear { ratio, min: self.min_ratio });
        }
        let svd = m.svd(true, true);
        let (u, vt) = (svd.u.expect("computed by svd(true, true)"), svd.v_t.expect("computed by svd(true, true)"));
        // The sign excludes reflections.
        let sign = Vector3::new(1.0, 1.0, (u * vt).determinant().signum());
        let rotation = Rotation3::from_matrix_unchecked(u * Matrix3::from_diagonal(&sign) * vt);
        let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
        Ok(Transform::new(rotation, object - rotation * camera))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample");

    // In the default pipeline. The covariance follows by numerical derivatives.
    let rig = Rig::from_file(folder)?;
    let site = Site::from_file(format!("{folder}/site.toml")).map_err(seafix::Error::from)?;
    let images = StereoImages::open(format!("{folder}/left000.png"), format!("{folder}/right000.png"), &rig)?;
    let localizer = Localizer::new(&site, &rig)?.with_solver(Box::new(Arun { min_ratio: 1e-3 }));
    for target in localizer.localize(&images, None)? {
        match target.outcome {
            Outcome::Fix(fix) => println!("{}: ± {:.1} mm", target.name, 1e3 * fix.position_sigma()),
            rejected => println!("{}: {rejected}", target.name),
        }
    }

    // By name, as the solvers of the library.
    SOLVERS.add(Added {
        name: "arun".into(),
        summary: "unweighted least squares by singular values".into(),
        source: "Arun, Huang and Blostein, Least-squares fitting of two 3-D point sets, 1987".into(),
        version: 1,
        defaults: toml::toml! { min-ratio = 1e-3 },
        construct: Box::new(|settings| {
            let min_ratio = settings["min-ratio"].as_float().unwrap_or(1e-3);
            Ok(Box::new(Arun { min_ratio }))
        }),
    })?;
    assert!(SOLVERS.build(&Choice::named("arun").with("min-ratio", 0.01)).is_ok());

    // The laws of solvers; a broken one ends the program with its smallest counterexample.
    for (statement, law) in LAWS {
        law(&named("arun"));
        println!("holds: {statement}");
    }

    // In an experiment, beside `kabsch`.
    let plan = Plan::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/data/own-solver.toml").as_ref(), &[])
        .map_err(|faults| faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))?;
    let out = std::env::temp_dir().join("seafix-own-solver");
    let options = Options { existing: Existing::Overwrite, ..Options::into(&out) };
    let finished = run(&plan, &options, &Silent)?;
    let report = report(&finished.folder, &finished.folder.join("report"), Forms::ALL)?;
    println!("{}", report.summary);
    Ok(())
}
