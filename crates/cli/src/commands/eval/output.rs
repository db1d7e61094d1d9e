//! Output of the errors as text and as JSON.

use seafix_evaluation::trajectory::{DriftSegment, Summary};
use serde_json::{Value, json};

use super::{Errors, Eval, Name, Unit, matched::Matched};

impl Eval {
    pub(super) fn text(&self, matched: &Matched, found: &Errors) -> String {
        let Name(relation) = self.relation;
        let n = matched.reference.len();
        let mut text = format!(
            "matched    {n} poses: {:.1} % of {} in {}, {:.1} % of {} in {}\n",
            100.0 * n as f64 / matched.of.0 as f64,
            matched.of.0,
            self.reference.display(),
            100.0 * n as f64 / matched.of.1 as f64,
            matched.of.1,
            self.estimate().display(),
        );
        text += &match &found.alignment {
            None => "alignment  none\n".to_owned(),
            Some(_) if self.align_origin => "alignment  first poses\n".to_owned(),
            Some(alignment) if !self.align => format!("alignment  scale only, {:.6}\n", alignment.scale),
            Some(alignment) if self.scale => format!("alignment  similarity, scale {:.6}\n", alignment.scale),
            Some(_) => "alignment  rigid\n".to_owned(),
        };
        text += &match matched.sections.len() {
            1 => String::new(),
            count => format!("segments   {count}, with breaks between them\n"),
        };
        text += &format!("path       {:.3} m of reference", found.path);
        if let Some(end) = found.end {
            text += &format!(", {end:.4} m apart at its end");
            if found.path > 0.0 {
                text += &format!(" ({:.3} %)", 100.0 * end / found.path);
            }
        }
        text += "\n\n";
        text += &format!("{:32}", format!("{} ({})", relation.name(), relation.unit()));
        text += &columns(&["rmse", "mean", "median", "std", "min", "max", "sse", "p95", "pairs"].map(str::to_owned));
        let mut row = |name: String, summary: &Summary| {
            let numbers = [
                summary.rmse,
                summary.mean,
                summary.median,
                summary.std,
                summary.min,
                summary.max,
                summary.sse,
                summary.p95,
            ];
            let mut cells: Vec<String> = numbers.iter().map(|x| significant(*x)).collect();
            cells.push(summary.pairs.to_string());
            text += &format!("{name:32}{}", columns(&cells));
        };
        if let Some(ape) = &found.ape {
            row("APE".to_owned(), ape);
        }
        let unit = match self.delta_unit {
            Unit::F if self.delta == 1.0 => "frame",
            Unit::F => "frames",
            Unit::M => "m",
            Unit::D => "deg",
            Unit::R => "rad",
        };
        let kind = if self.all_pairs { "all pairs" } else { "consecutive" };
        let of = if found.relation == relation { "" } else { "point_distance " };
        row(format!("RPE {of}over {} {unit}, {kind}", self.delta), &found.rpe);
        let heads = ["mean %", "rms %", "median %", "p95 %", "deg/m", "segments"].map(str::to_owned);
        text += &format!("\n{:32}{}", "drift over", columns(&heads));
        for (length, fraction, turn) in self.segments(found) {
            let mut cells: Vec<String> = [fraction.mean, fraction.rmse, fraction.median, fraction.p95]
                .iter()
                .map(|x| significant(100.0 * x))
                .collect();
            cells.push(significant(turn.mean.to_degrees()));
            cells.push(fraction.pairs.to_string());
            text += &format!("{:32}{}", format!("{length} m"), columns(&cells));
        }
        text
    }

    /// The drift for each length: translation as a fraction, rotation in rad/m.
    fn segments(&self, found: &Errors) -> Vec<(f64, Summary, Summary)> {
        let of = |length: f64| {
            let segments: Vec<&DriftSegment> =
                found.segments.iter().filter(|segment| segment.length == length).collect();
            let summary = |error: fn(&DriftSegment) -> f64| {
                Summary::of(&segments.iter().map(|segment| error(segment)).collect::<Vec<_>>())
            };
            (length, summary(|segment| segment.translation), summary(|segment| segment.rotation))
        };
        self.segments.iter().map(|&length| of(length)).collect()
    }

    pub(super) fn json(&self, matched: &Matched, found: &Errors) -> String {
        let segments: Vec<Value> = self
            .segments(found)
            .iter()
            .map(|(length, fraction, turn)| {
                json!({
                    "length_m": length,
                    "segments": fraction.pairs,
                    "translation_percent": {
                        "mean": 100.0 * fraction.mean, "rmse": 100.0 * fraction.rmse,
                        "median": 100.0 * fraction.median, "p95": 100.0 * fraction.p95,
                    },
                    "rotation_deg_per_m": { "mean": turn.mean.to_degrees(), "rmse": turn.rmse.to_degrees() },
                })
            })
            .collect();
        let Name(relation) = self.relation;
        let value = json!({
            "relation": relation.name(),
            "unit": relation.unit(),
            "ape": found.ape.as_ref().map(summary),
            "rpe": summary(&found.rpe),
            "rpe_relation": found.relation.name(),
            "segments": segments,
            "breaks": matched.sections[1..].iter().map(|&at| match &matched.stamps {
                Some(stamps) => json!({ "pose": at, "stamp_ns": stamps[at] }),
                None => json!({ "pose": at }),
            }).collect::<Vec<Value>>(),
            "path_m": found.path,
            "end_m": found.end,
            "matched": {
                "poses": matched.reference.len(), "reference": matched.of.0, "estimate": matched.of.1,
                "fraction": matched.fraction(), "covered": matched.covered,
            },
            "alignment": found.alignment.as_ref().map(|alignment| json!({
                "matrix": alignment.rows(), "scale": alignment.scale,
            })),
        });
        format!("{value}\n")
    }
}

fn summary(of: &Summary) -> Value {
    json!({
        "rmse": of.rmse, "mean": of.mean, "median": of.median, "std": of.std, "min": of.min, "max": of.max,
        "sse": of.sse, "p75": of.p75, "p95": of.p95, "p99": of.p99, "pairs": of.pairs,
    })
}

fn columns(cells: &[String]) -> String {
    cells.iter().map(|cell| format!("{cell:>11}")).collect::<String>() + "\n"
}

/// A number with five significant digits.
fn significant(x: f64) -> String {
    if x.is_nan() {
        "–".to_owned()
    } else if x == 0.0 || (1e-3..1e5).contains(&x.abs()) {
        let digits = if x == 0.0 { 0 } else { x.abs().log10().floor() as i32 };
        format!("{x:.*}", usize::try_from(4 - digits).unwrap_or(0).min(7))
    } else {
        format!("{x:.4e}")
    }
}
