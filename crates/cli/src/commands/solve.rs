//! `seafix solve`.

use std::path::PathBuf;

use clap::Args;
use rayon::prelude::*;
use seafix_component::{Choice, counted, decoded, undecodable};
use seafix_experiment::changed;
use seafix_referencing::{
    Acceptance, SEARCHES, SOLVERS, Search, Solver,
    problem_file::{Answer, Line, Method, Support, solve_file},
};
use seafix_simulation::{Purpose, Stream};
use serde::{Deserialize, Serialize};

use super::set::built;
use crate::{
    exit::{DONE, Ended, Failure, INPUT, OUTPUT, USAGE},
    terminal::{notify, print},
};

#[derive(Debug, Args)]
pub(crate) struct Solve {
    /// Problem files in the format coherence-problem/1, or coherence-problem/1.1 with edges.
    #[arg(required = true)]
    problems: Vec<PathBuf>,
    /// The search component.
    #[arg(long, default_value = "rigid-consensus")]
    search: String,
    /// The solver component; it must not need pixels, which these problems do not have.
    #[arg(long, default_value = "mahalanobis")]
    solver: String,
    /// Change a setting of the search, the solver or the acceptance: a dotted key and a TOML value,
    /// `search.budget=1000000`, `acceptance.max-p-wrong=1e-4`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Number of problems that are solved at the same time.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Repeat a search that found no pose with larger gates, then without gates, for a displaced object.
    #[arg(long)]
    expand_gates: bool,
    /// Print one JSON object a line.
    #[arg(long)]
    json: bool,
}

/// The settings of the method.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    search: Choice,
    solver: Choice,
    acceptance: Acceptance,
}

/// A search and a solver.
type Built = (Box<dyn Search>, Box<dyn Solver>);

impl Solve {
    /// The settings with their search and solver.
    fn settings(&self) -> Result<(Settings, Built), Failure> {
        let usage = |error| Failure::new(USAGE, error);
        let named = Settings {
            search: SEARCHES.resolve(&Choice::named(&self.search)).map_err(usage)?,
            solver: SOLVERS.resolve(&Choice::named(&self.solver)).map_err(usage)?,
            acceptance: Acceptance::default(),
        };
        let change = |set: &[String]| changed(&named, "--set", set, "search.budget=1000000");
        built(&self.set, change, |settings: &Settings| {
            settings.acceptance.check()?;
            let search = SEARCHES.build(&settings.search).map_err(|error| error.to_string())?;
            Ok::<_, String>((search, SOLVERS.build(&settings.solver).map_err(|error| error.to_string())?))
        })
    }

    pub(crate) fn execute(&self) -> Ended {
        let (settings, (search, solver)) = self.settings()?;
        if solver.needs_pixels() {
            let what = format!("cannot solve with `{}`: it needs pixels and a rig", settings.solver.name);
            return Err(Failure::new(USAGE, format!("{what}; use `mahalanobis`")));
        }
        let method = Method {
            search: (&settings.search.name, &*search),
            solver: (&settings.solver.name, &*solver),
            acceptance: &settings.acceptance,
            expand_gates: self.expand_gates,
        };
        let solve = |path: &PathBuf| {
            // Every problem has its own stream of the same seed, so that answers do not depend on each other.
            let solve = || Ok(solve_file(path, &method, Stream::new(0, 0, 0, Purpose::Search).rng()));
            // One damaged file must not end the others.
            let failed = |message| Line::Failed {
                file: path.display().to_string(),
                error: undecodable(path, message).to_string(),
            };
            decoded(solve, failed).unwrap_or_else(|failed| failed)
        };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(self.threads))
            .build()
            .map_err(|error| Failure::new(OUTPUT, format!("cannot start threads: {error}")))?;
        let groups = || {
            let mut ended = DONE;
            // Groups let answers appear early, in the order of the arguments.
            for group in self.problems.chunks(usize::from(self.threads)) {
                let lines: Vec<Line> = group.par_iter().map(solve).collect();
                for line in &lines {
                    match line {
                        Line::Failed { error, .. } => {
                            ended = INPUT;
                            if self.json { print(&json(line))? } else { notify(&format!("error: {error}")) }
                        }
                        Line::Answer(_) if self.json => print(&json(line))?,
                        Line::Answer(answer) => print(&text(answer))?,
                    }
                }
            }
            Ok(ended)
        };
        pool.install(groups)
    }
}

fn json(line: &Line) -> String {
    serde_json::to_string(line).expect("an answer is plain data") + "\n"
}

/// Minimum scale error (standard deviations) that is printed; with exact rigs and models one fix in fifteen thousand
/// exceeds it.
const REPORTED: f64 = 4.0;

/// The difference of two poses of the object, as text.
fn apart(pose: Option<&[[f64; 4]; 4]>, other: &[[f64; 4]; 4]) -> String {
    let Some(pose) = pose else { return "which is not accepted either".to_owned() };
    let square: f64 = (0..3).map(|k| (pose[k][3] - other[k][3]).powi(2)).sum();
    // The trace of RᵀS is 1 + 2 cos of the turn between R and S.
    let trace: f64 = (0..3).flat_map(|i| (0..3).map(move |k| pose[i][k] * other[i][k])).sum();
    let turn = ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees();
    format!("whose origin is {:.2} m off, turned by {turn:.0}°", square.sqrt())
}

/// The numbers of points and of edges, as text; of the points alone without edges.
fn features(points: usize, edges: usize, name: &str) -> String {
    let points = counted(points, name);
    if edges == 0 { points } else { format!("{points} and {}", counted(edges, "edge")) }
}

/// The output as text: outcome, then pose.
fn text(answer: &Answer) -> String {
    let mut text = format!("{}: {}", answer.file, answer.outcome);
    if let Some(pairs) = &answer.pairs {
        let proved = match (answer.optimal, answer.evidence_gap) {
            (true, None) => ", proved maximum",
            (true, Some(_)) => ", proved best",
            (false, _) => "",
        };
        text += &format!(", {}{proved}", features(pairs.len(), answer.edges.len(), "point"));
    }
    if !answer.behind.is_empty() {
        text += &format!(", cloud points behind the camera (z ≤ 0): {:?}", answer.behind);
    }
    if !answer.lines_behind.is_empty() {
        text += &format!(", lines behind the camera (z ≤ 0): {:?}", answer.lines_behind);
    }
    if let Some(scale) = answer.scale {
        text += &format!(", scale {scale:.6}");
    }
    if let Some(scale_error) = answer.integrity.as_ref().and_then(|it| it.scale_error)
        && scale_error.value.abs() > REPORTED * scale_error.sigma
    {
        let (by, sigma) = (100.0 * scale_error.value.abs(), 100.0 * scale_error.sigma);
        let longer = if scale_error.value > 0.0 { "longer" } else { "shorter" };
        text += &format!(
            ", measured distances {by:.1} ± {sigma:.1} % {longer} than the model's: rig or survey has a scale error"
        );
    }
    // A known cause has a remedy of its own, which that of the search would contradict.
    text += &match (&answer.explanation, &answer.diagnosis) {
        (Some(why), Some(cause)) => format!(": {cause} ({why})"),
        (Some(why), None) => format!(": {why}; {}", answer.remedy.as_deref().unwrap_or_default()),
        (None, Some(cause)) => format!("; {cause}"),
        (None, None) => String::new(),
    };
    text += &match (&answer.runner_up, answer.margin) {
        (Some(other), Some(margin)) => {
            format!("; score {margin:.1} above the next pose, {}", apart(answer.t_cam_obj.as_ref(), &other.t_cam_obj))
        }
        _ if answer.t_cam_obj.is_some() => "; no other pose found".to_owned(),
        _ => String::new(),
    };
    text += &format!(" ({:.1} ms)\n", answer.time_ms);
    for row in answer.t_cam_obj.iter().flatten().take(3) {
        text += &format!("  {:10.6} {:10.6} {:10.6} {:10.4}\n", row[0], row[1], row[2], row[3]);
    }
    if let Some(best) = answer.best.as_ref().filter(|_| answer.t_cam_obj.is_none()) {
        text += &format!("  best pose, not accepted, of {}:\n", features(best.pairs.len(), best.edges.len(), "pair"));
        for row in best.t_cam_obj.iter().take(3) {
            text += &format!("  {:10.6} {:10.6} {:10.6} {:10.4}\n", row[0], row[1], row[2], row[3]);
        }
    }
    text += &answer.integrity.as_ref().map_or_else(String::new, |support| format!("  {}\n", protected(support)));
    text
}

/// The protection level of a fix and its alert limit, as text.
fn protected(support: &Support) -> String {
    let limit = format!("the alert limit of {:.3} m", support.alert_limit);
    match (support.protection, support.misidentified) {
        (None, Some(mistaken)) if !(mistaken < support.risk) => {
            let risk = support.risk;
            format!(
                "no protection level: probability of a misidentification {mistaken:.1e} above the risk {risk:.0e}; not protected within {limit}"
            )
        }
        (None, _) => {
            format!("no protection level: too few points, or an indispensable one; not protected within {limit}")
        }
        (Some(level), _) => {
            let is = if level.position <= support.alert_limit { "within" } else { "beyond" };
            let (position, attitude) = (level.position, level.attitude.to_degrees());
            format!("protection level {position:.3} m, {attitude:.2}°; {is} {limit}")
        }
    }
}
