//! The difference of two sites: a surveyed one and a built one.

use std::path::Path;

use nalgebra::{DMatrix, Vector3};
use seafix_component::Fault;
use seafix_evaluation::{ModelDifference, compare_models};
use seafix_referencing::{ModelPoint, Site, SiteObject};
use serde_json::{Value, json};

use crate::{
    exit::{DONE, Ended, Failure, INPUT, USAGE},
    terminal::{notify, print},
};

/// The difference of one object, with the points that both sites have.
struct Compared {
    object: String,
    points: Vec<String>,
    /// Points of one site alone.
    missing: usize,
    found: ModelDifference,
}

/// Whether a file is a site, by its name.
pub(super) fn is_site(path: &Path) -> bool {
    path.extension().is_some_and(|end| end == "toml")
}

/// Compares the sites and prints the differences.
pub(super) fn execute(reference: &Path, built: Option<&Path>, as_json: bool) -> Ended {
    let Some(built) = built.filter(|path| is_site(path)) else {
        let message = format!("cannot compare {}: no second site; give SURVEYED.toml BUILT.toml", reference.display());
        return Err(Failure::new(USAGE, message));
    };
    let read = |path| Site::from_file(path).map_err(|faults| Failure::faults(INPUT, &faults));
    let (first, second) = (read(reference)?, read(built)?);
    let pairs = partners(&first, &second);
    if pairs.is_empty() {
        let fault =
            Fault::new("no object of the other site", built).remedy("give the objects of both sites the same ids");
        return Err(Failure::new(INPUT, fault));
    }
    let compared = pairs.iter().map(|(a, b)| compare(a, b, built)).collect::<Result<Vec<_>, _>>()?;
    for compared in compared.iter().filter(|compared| compared.missing > 0) {
        notify(&format!(
            "warning: {} points of `{}` are in one site alone and are not compared",
            compared.missing, compared.object
        ));
    }
    print(&if as_json { json(&compared) } else { text(&compared) })?;
    Ok(DONE)
}

/// The objects that both sites have; two sites of one object each are sites of the same object.
fn partners<'a>(first: &'a Site, second: &'a Site) -> Vec<(&'a SiteObject, &'a SiteObject)> {
    if let ([a], [b]) = (&first.objects[..], &second.objects[..]) {
        return vec![(a, b)];
    }
    let only = second.objects.len() == 1;
    let partner = |object: &'a SiteObject| {
        let same = |other: &&SiteObject| other.id == object.id;
        Some((object, second.objects.iter().find(same)?))
    };
    let named: Vec<_> = first.objects.iter().filter_map(partner).collect();
    if !named.is_empty() || !only {
        return named;
    }
    // The object of which the built one has the largest number of points.
    let built = &second.objects[0];
    let common = |object: &&SiteObject| object.points.iter().filter(|point| find(built, point).is_some()).count();
    let best = first.objects.iter().rev().max_by_key(common).filter(|object| common(object) > 0);
    best.map(|object| (object, built)).into_iter().collect()
}

fn find<'a>(object: &'a SiteObject, point: &ModelPoint) -> Option<&'a ModelPoint> {
    object.points.iter().find(|other| other.id == point.id)
}

fn compare(surveyed: &SiteObject, built: &SiteObject, file: &Path) -> Result<Compared, Failure> {
    let both: Vec<(&ModelPoint, &ModelPoint)> =
        surveyed.points.iter().filter_map(|point| Some((point, find(built, point)?))).collect();
    let positions = |pick: fn(&(&ModelPoint, &ModelPoint)) -> Vector3<f64>| both.iter().map(pick).collect::<Vec<_>>();
    let (reference, estimate) = (positions(|(a, _)| a.at.coords), positions(|(_, b)| b.at.coords));
    let variance = |k: usize| both[k].0.sigma.powi(2) + both[k].1.sigma.powi(2);
    let count = both.len();
    let covariance = DMatrix::from_fn(3 * count, 3 * count, |i, j| if i == j { variance(i / 3) } else { 0.0 });
    let found = compare_models(&reference, &estimate, &covariance).map_err(|error| {
        let fault = Fault::new(format!("no alignment of `{}`: {error}", built.id), file);
        Failure::new(INPUT, fault.remedy("give the points of both sites the same ids, at least three off a line"))
    })?;
    let missing = surveyed.points.len() + built.points.len() - 2 * count;
    let points = both.iter().map(|(point, _)| point.id.clone()).collect();
    Ok(Compared { object: surveyed.id.clone(), points, missing, found })
}

/// The significance of a scale other than one, in standard deviations, that deserves a sentence.
const SIGNIFICANT: f64 = 3.0;

fn text(compared: &[Compared]) -> String {
    let line = |compared: &Compared| {
        let Compared { object, points, found, .. } = compared;
        let worst = found.differences[found.worst].norm() * 1e3;
        let chi2 = found
            .chi2
            .map_or_else(|| "no χ²: both sites are exact".to_owned(), |chi2| format!("χ² {chi2:.1} of {}", found.dof));
        let mut text = format!(
            "{object}: {} points, RMS {:.3} mm a coordinate, worst {} {worst:.3} mm, scale {:.5} ± {:.5}, {chi2}\n",
            points.len(),
            found.rms * 1e3,
            points[found.worst],
            found.scale,
            found.scale_sigma
        );
        let off = (found.scale - 1.0) / found.scale_sigma;
        if off.abs() > SIGNIFICANT {
            text += &format!(
                "{object}: the scale differs by {:+.3} %, {:.1} standard deviations: compare the baselines of the rigs\n",
                (found.scale - 1.0) * 100.0,
                off.abs()
            );
        }
        text
    };
    compared.iter().map(line).collect()
}

fn json(compared: &[Compared]) -> String {
    let object = |compared: &Compared| -> Value {
        let Compared { object, points, missing, found } = compared;
        json!({
            "object": object,
            "rms": found.rms,
            "worst": { "id": points[found.worst], "distance": found.differences[found.worst].norm() },
            "scale": found.scale,
            "scale_sigma": found.scale_sigma,
            "chi2": found.chi2,
            "dof": found.dof,
            "alignment": found.alignment.rows(),
            "points": points.iter().zip(&found.differences).map(|(id, difference)| json!({
                "id": id,
                "difference": <[f64; 3]>::from(*difference),
            })).collect::<Vec<_>>(),
            "not_compared": missing,
        })
    };
    json!({ "objects": compared.iter().map(object).collect::<Vec<_>>() }).to_string() + "\n"
}
