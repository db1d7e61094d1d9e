//! The ablation: the effect of each setting, pooled over all others.

use crate::{
    content::phrases,
    document::{Block, Head, Section, Table, text},
    format::{decimals, distinct, headed},
    number::{Key, Number},
    run::{Run, Trial},
    summary::{Row, RunSummary},
};

pub(crate) fn section(run: &Run, summary: &RunSummary) -> Option<Section> {
    let axes = &summary.rows.first()?.axes;
    let mut heads = vec![Head::words("Setting"), Head::words("value"), Head::numbers("trials"), Head::numbers("n")];
    heads.extend(
        ["fixes (%)", "wrong (%)", "TRE min (mm)", "TRE median (mm)", "TRE max (mm)", "total (ms)"].map(Head::numbers),
    );
    let caption = text![
        "Effect of each setting, pooled over all others. Fixes and wrong fixes are in % of all attempts. TRE: minimum, median and maximum, over the trials, of the median TRE of all attempts, with failures counted as infinite errors. Total: median of the trials’ median times."
    ];
    let mut table = Table::new("ablation", caption, heads);
    let all = summary.rows.iter().filter_map(|row| row.tre_of_all).map(|tre| tre * 1e3);
    let digits = decimals(all);
    for (place, axis) in axes.iter().enumerate() {
        let value = |row: &Row| row.axes[place].value.clone();
        let values = distinct(summary.rows.iter().map(value));
        if values.len() < 2 || values.len() > 12 {
            continue;
        }
        for (index, wanted) in values.iter().enumerate() {
            let own: Vec<usize> = (0..summary.rows.len()).filter(|&i| value(&summary.rows[i]) == *wanted).collect();
            let trials: Vec<&Trial> = own.iter().map(|&i| &run.trials[i]).collect();
            let total = |count: fn(&Row) -> usize| own.iter().map(|&i| count(&summary.rows[i])).sum::<usize>();
            let over = |topic: &str, what: &str| -> Key { phrases::over(&trials, topic, what.to_owned()) };
            let n = total(|row| row.attempted);
            let fraction = |group: &str, k: usize| {
                let key = over("/metrics/evaluation", &format!("percent {group} of attempted"));
                Number::new((n > 0).then(|| 100.0 * k as f64 / n as f64), 1, key)
            };
            let mut tre: Vec<f64> = own.iter().filter_map(|&i| summary.rows[i].tre_of_all).map(|m| m * 1e3).collect();
            let middle = (!tre.is_empty()).then(|| seafix_evaluation::median(&mut tre));
            let ends = tre.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &v| [a.min(v), b.max(v)]);
            let [min, max] = ends.map(|end| (!tre.is_empty()).then_some(end));
            let error = |which: &str, value| {
                Number::new(
                    value,
                    digits,
                    over("/metrics/evaluation", &format!("{which} all tre_rms of attempted in mm")),
                )
            };
            let mut times: Vec<f64> = own.iter().filter_map(|&i| summary.rows[i].times.total_ms).collect();
            let time = (!times.is_empty()).then(|| seafix_evaluation::median(&mut times));
            let first = index == 0;
            let name = if first { headed(&axis.key) } else { String::new() };
            table.line(
                first,
                vec![
                    name.into(),
                    wanted.clone().into(),
                    own.len().to_string().into(),
                    Number::count(n, over("/metrics/evaluation", "count attempted")).into(),
                    fraction("found", total(|row| row.found)).into(),
                    fraction("wrong", total(|row| row.wrong)).into(),
                    error("least", min).into(),
                    error("middle", middle).into(),
                    error("greatest", max).into(),
                    Number::new(time, 1, over("/metrics/timing", "middle median total_ms of attempted")).into(),
                ],
            );
        }
    }
    (!table.lines.is_empty()).then(|| Section::new("Ablation and sensitivity").with([Block::Table(table)]))
}
