//! The section on data: source, targets, cameras, priors, noise, seeds and hashes.

use hmac_sha256::Hash as Sha256;
use seafix_log::{CameraRecord, TrialHeader};

use crate::{
    content::{conditions::setup::baseline, phrases},
    document::{self, Block, Cell, Head, Section, Table, Text, code, text},
    format::{counted, distinct, number, trimmed},
    number::Number,
    run::Run,
    summary::RunSummary,
};

pub(crate) fn section(run: &Run, summary: &RunSummary, small: bool) -> Section {
    let of = |say: fn(&TrialHeader) -> String| distinct(run.trials.iter().map(|trial| say(&trial.header))).join("; ");
    let mut table = Table::new(
        "data",
        text!["Conditions of the run. If trials differ, all their values are listed."],
        vec![Head::words(""), Head::words("")],
    );
    let mut line = |name: &str, value: Text| {
        if !value.iter().all(|span| span.plain().is_empty()) {
            let name = Cell { text: vec![document::italic(name)], ..Cell::default() };
            table.line(false, vec![name, Cell::prose(value)]);
        }
    };
    line("Source", text![of(|header| header.source.clone())]);
    let frames = distinct(run.trials.iter().map(|trial| trial.count().to_string())).join(", ");
    line("Frames", text![format!("{frames} per trial, {}", counted(run.trials.len(), "trial", "trials"))]);
    if let Some(trial) = run.trials.iter().find(|trial| trial.every() > 1) {
        let mut message = text!["every "];
        message.push(phrases::header(trial, "every", Some(trial.every() as f64), 0).into());
        message.push(
            "th frame, and more failures up to a limit; medians and quantiles are over the former, counts over all frames"
                .into(),
        );
        line("Frames logged", message);
    }
    line("Targets", text![of(targets)]);
    line("Left camera", text![of(|header| camera(&header.rig.left))]);
    line("Right camera", text![of(|header| camera(&header.rig.right))]);
    line("Rig", text![of(rig)]);
    line("Prior, 1 σ", text![of(prior)]);
    line(
        "Assumed corner noise",
        text![of(|header| header.pixel_sigma.map_or(String::new(), |s| format!("σ = {s} px per axis and image")))],
    );
    line("Measured disparity noise", disparity(run, summary));
    line(
        "Model points",
        text![of(|header| {
            let sigmas = header.targets.iter().flat_map(|target| &target.points);
            let sigmas = distinct(sigmas.map(|point| format!("{} mm", number(Some(point.sigma * 1e3), 2))));
            if sigmas.is_empty() { String::new() } else { format!("σ = {} per axis", sigmas.join(", ")) }
        })],
    );
    line("Seeds", text![of(|header| pairs(header.seeds.iter().map(|(name, seed)| (name, seed.to_string()))))]);
    // A kept run serves every version with the same results, so a small report omits the version.
    if !small {
        let versions =
            |header: &TrialHeader| pairs(header.versions.iter().map(|(name, version)| (name, version.clone())));
        line("Versions", text![of(versions)]);
    }
    Section::new("Data").with([Block::Table(table), Block::Table(hashes(run))])
}

fn pairs<'a>(of: impl Iterator<Item = (&'a String, String)>) -> String {
    of.map(|(name, value)| format!("{name} {value}")).collect::<Vec<_>>().join(", ")
}

/// The table of hashes that identify configuration, site and results.
fn hashes(run: &Run) -> Table {
    let caption = text![
        "First 16 digits of the SHA-256 of the resolved configuration, of the site, and of all results of a log except times. The same configuration gives the same results on every machine and with any number of threads."
    ];
    let heads = ["Log", "configuration", "site", "results"].map(Head::words).to_vec();
    let mut table = Table::new("hashes", caption, heads);
    for trial in &run.trials {
        let hash = |text: &str| code(hex(&Sha256::hash(text.as_bytes())));
        // A source with another object in every frame has no site.
        let site = match trial.header.site.as_str() {
            "" => "–".into(),
            site => hash(site).into(),
        };
        let [file, configuration, results] =
            [code(trial.file()), hash(&trial.header.configuration), code(hex(&trial.digest))].map(Cell::from);
        table.line(false, vec![file, configuration, site, results]);
    }
    table
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}

fn disparity(run: &Run, summary: &RunSummary) -> Text {
    let with: Vec<usize> = (0..run.trials.len()).filter(|&i| summary.rows[i].disparity_sigma.is_some()).collect();
    let sigmas = || with.iter().filter_map(|&i| summary.rows[i].disparity_sigma);
    let [low, high] = sigmas().fold([f64::INFINITY, 0.0], |[a, b]: [f64; 2], s| [a.min(s), b.max(s)]);
    if with.is_empty() {
        return Vec::new();
    }
    let trials: Vec<_> = with.iter().map(|&i| &run.trials[i]).collect();
    let end = |which: &str, value: f64| {
        Number::new(Some(value), 2, phrases::over(&trials, "/referencing/frame", format!("{which} disparity")))
    };
    let mut message = text!["σ = ", end("least", low)];
    if number(Some(low), 2) != number(Some(high), 2) {
        message.extend(text!["–", end("greatest", high)]);
    }
    message.push(" px, RMS over the identified points within 2 px of the true projection, so a lower bound; targets with several objects excluded".into());
    message
}

fn targets(header: &TrialHeader) -> String {
    const LABELLED: usize = 12;
    if header.targets.is_empty() {
        return "another object in every frame, recorded in the log".to_owned();
    }
    let sizes = || header.targets.iter().map(|target| target.points.len());
    let points: usize = sizes().sum();
    let who = match (sizes().min(), sizes().max()) {
        (Some(min), Some(max)) if header.targets.len() > LABELLED => {
            format!("{} of {min} to {max} points", header.targets.len())
        }
        _ => {
            let each = header.targets.iter().map(|target| format!("{} ({})", target.id, target.points.len()));
            each.collect::<Vec<_>>().join(", ")
        }
    };
    format!("{who}: {points} feature points")
}

fn camera(camera: &CameraRecord) -> String {
    let k = camera.matrix;
    let distortion = if camera.equidistant {
        "equidistant"
    } else if camera.distortion.iter().all(|k| *k == 0.0) {
        "no distortion"
    } else {
        "with distortion"
    };
    format!("{} × {} px, f = {:.1}, {:.1} px, {distortion}", camera.size[0], camera.size[1], k[0][0], k[1][1])
}

fn rig(header: &TrialHeader) -> String {
    format!("baseline {:.3} m, {}", baseline(header), if header.rig.rectified { "rectified" } else { "general" })
}

fn prior(header: &TrialHeader) -> String {
    match (header.prior_position_sigma, header.prior_attitude_sigma) {
        (None, None) => "none".to_owned(),
        (position, attitude) => format!(
            "{} m per world axis, {}° per camera axis",
            position.map_or("–".to_owned(), trimmed),
            number(attitude.map(f64::to_degrees), 2)
        ),
    }
}
