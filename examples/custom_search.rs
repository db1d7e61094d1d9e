//! A custom search with its property tests: `cargo run --release --example custom_search`.

#![allow(clippy::print_stdout)]

use std::cell::Cell;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use proptest::{prop_assert, prop_assume};
use rand::Rng;
use seafix::{
    Localizer, Outcome, PosePrior, Rig, Site, StereoImages,
    component::Added,
    geometry::Transform,
    referencing::{Correspondence, Identification, Problem, Rejected, SEARCHES, Search},
};
use seafix_proptests::{
    admissible::largest,
    law,
    problems::{SMALL, planted},
    search_laws::LAWS,
    searches::named,
};

/// A greedy search: the pairs with the largest number of coherent others first, as long as they agree with all before.
#[derive(Debug)]
struct Greedy;

impl Search for Greedy {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        let lists = problem.candidates.lists.iter().enumerate();
        let all: Vec<Correspondence> =
            lists.flat_map(|(model, list)| list.iter().map(move |&cloud| Correspondence { model, cloud })).collect();
        let support = |a: &Correspondence| all.iter().filter(|b| problem.coherent(*a, **b)).count();
        let mut ranked: Vec<(usize, Correspondence)> = all.iter().map(|pair| (support(pair), *pair)).collect();
        // Coordinates break ties, so that the order of the points does not matter.
        let coordinates = |pair: &Correspondence| -> [f64; 6] {
            let (p, c) = (problem.model[pair.model].at.coords, problem.cloud[pair.cloud].position.at.coords);
            [p.x, p.y, p.z, c.x, c.y, c.z]
        };
        ranked.sort_by(|(n, a), (m, b)| {
            let ties = coordinates(a).into_iter().zip(coordinates(b)).map(|(x, y)| x.total_cmp(&y));
            m.cmp(n).then(ties.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then))
        });
        let (mut pairs, mut mirrored): (Vec<Correspondence>, bool) = (Vec::new(), false);
        for (_, pair) in ranked {
            if pairs.iter().all(|other| problem.coherent(pair, *other)) {
                if mirrors(problem, &pairs, pair) {
                    mirrored = true;
                } else {
                    pairs.push(pair);
                }
            }
        }
        pairs.sort();
        let bound = problem.candidates.with_candidates();
        match pairs.len() {
            0..3 => Err(Rejected::NotFound { bound, needed: 3 }),
            // Three points have no orientation: these are the rest of a mirror image.
            3 if mirrored => Err(Rejected::Mirrored { best: 4, proved: false }),
            _ => Ok(Identification::unproved(pairs, bound, 0)),
        }
    }
}

/// Whether a pair and three others have volumes of opposite sign in model and cloud.
fn mirrors(problem: &Problem<'_>, pairs: &[Correspondence], pair: Correspondence) -> bool {
    let volume = |at: &dyn Fn(Correspondence) -> Vector3<f64>, [a, b, c]: [usize; 3]| {
        let [a, b, c] = [a, b, c].map(|k| at(pairs[k]) - at(pair));
        a.cross(&b).dot(&c)
    };
    let model = |pair: Correspondence| problem.model[pair.model].at.coords;
    let cloud = |pair: Correspondence| problem.cloud[pair.cloud].position.at.coords;
    let n = pairs.len();
    (0..n).any(|c| {
        (0..c).any(|b| {
            (0..b).any(|a| {
                let known = volume(&model, [a, b, c]);
                known.abs() > 1e-12 && known * volume(&cloud, [a, b, c]) <= 0.0
            })
        })
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample");
    let rig = Rig::from_file(folder)?;
    let site = Site::from_file(format!("{folder}/site.toml")).map_err(seafix::Error::from)?;
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

    // By name, as the searches of the library.
    SEARCHES.add(Added {
        name: "greedy".into(),
        summary: "the pairs with the most coherent others first".into(),
        source: "an example".into(),
        version: 1,
        defaults: toml::Table::new(),
        construct: Box::new(|_| Ok(Box::new(Greedy))),
    })?;

    // The laws of searches; a broken one ends the program with its smallest counterexample.
    for (statement, law) in LAWS {
        law(&named("greedy", 100_000));
        println!("holds: {statement}");
    }

    // A law of our own, with brute force as reference: no answer is larger than the largest admissible set.
    let searches = named("greedy", 100_000);
    let (found, possible) = (Cell::new(0), Cell::new(0));
    law(256, planted(SMALL), |planted| {
        let best = largest(&planted.problem(), true);
        prop_assume!(!best.doubtful && best.size >= 4);
        let size = searches[0].answer(&planted).map_or(0, |found| found.pairs.len());
        prop_assert!(size <= best.size, "{size} pairs, {} by brute force", best.size);
        possible.set(possible.get() + 1);
        found.set(found.get() + u32::from(size == best.size));
        Ok(())
    });
    println!("holds: no answer is larger; {} of {} answers are the largest set", found.get(), possible.get());
    Ok(())
}
