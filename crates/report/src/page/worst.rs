//! The ten worst frames, with the place in the log where to look.

use maud::{Markup, html};
use seafix_log::{Evaluation, Outcome, TargetRecord};

use crate::{
    format::{decimals, number},
    run::{Frame, Run, Trial},
};

/// How many are listed.
const LISTED: usize = 10;

/// The head of a column and what stands in it.
type Column = (&'static str, fn(&Evaluation) -> Option<f64>);

pub(super) fn section(run: &Run) -> Markup {
    let mut fixes: Vec<(&Trial, &Frame, &TargetRecord)> = run
        .trials
        .iter()
        .flat_map(|trial| trial.attempts().map(move |(frame, target)| (trial, frame, target)))
        .filter(|(.., target)| target.outcome == Outcome::Referenced)
        .collect();
    let error =
        |fix: &TargetRecord| fix.evaluation.m2_rms.or(fix.evaluation.m1_rms).or(fix.residual_rms).unwrap_or(0.0);
    let wrong = |fix: &TargetRecord| fix.evaluation.wrong == Some(true);
    fixes.sort_by(|(.., a), (.., b)| wrong(b).cmp(&wrong(a)).then(error(b).total_cmp(&error(a))));
    fixes.truncate(LISTED);
    let columns: [Column; 5] = [
        ("m1 (mm)", |fix| fix.m1_rms.map(|m| m * 1e3)),
        ("m2 (mm)", |fix| fix.m2_rms.map(|m| m * 1e3)),
        ("m3 (mm)", |fix| fix.m3_position.map(|m| m * 1e3)),
        ("m3 (°)", |fix| fix.m3_attitude.map(f64::to_degrees)),
        ("NEES", |fix| fix.nees),
    ];
    let digits = columns.map(|(_, value)| decimals(fixes.iter().filter_map(|(.., fix)| value(&fix.evaluation))));
    html! {
        h2 { "Worst fixes" }
        @if fixes.is_empty() {
            p { "There is no fix." }
        } @else {
            figure.table.wide {
                figcaption { "The fixes with the largest m2, wrong ones first; the stamp leads to the frame in its log." }
                table {
                    thead { tr {
                        th { "Log" } th.n { "frame" } th.n { "stamp (ns)" } th { "target" } th { "judged" } th.n { "points" }
                        @for (name, _) in columns { th.n { (name) } }
                    } }
                    tbody {
                        @for (trial, frame, fix) in fixes {
                            @let it = &fix.evaluation;
                            tr {
                                td.nowrap { code { (trial.file()) } } td.n { (frame.number) } td.n { (frame.stamp_ns) } td { (fix.object) }
                                td { (match it.wrong { Some(true) => "wrong", Some(false) => "found", None => "–" }) }
                                td.n { (fix.pairs.len()) }
                                @for ((_, value), digits) in columns.into_iter().zip(digits) { td.n { (number(value(it), digits)) } }
                            }
                        }
                    }
                }
            }
        }
    }
}
