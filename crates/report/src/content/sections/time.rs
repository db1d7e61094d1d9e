//! The section on run time: the stages, and the search over the size of its problem.

use crate::{
    content::{
        conditions::columns,
        figures::cost,
        phrases::{self, Unit},
    },
    document::{Block, Cell, Head, Section, Table, text},
    field::Field,
    number::{Key, Number},
    run::Run,
    summary::RunSummary,
};

pub(crate) fn section(run: &Run, summary: &RunSummary) -> Section {
    let caption = text![
        "Median times (ms): per frame for the front end and odometry, per attempt for candidates, search and solve. Total: from the images (or points, without images) to the outcome for one target; p95: its 95 % quantile. Wall-clock times differ between runs and machines."
    ];
    let stages: Vec<&str> = summary
        .rows
        .iter()
        .flat_map(|row| row.times.stages())
        .filter(|(_, time)| time.is_some())
        .map(|(stage, _)| stage)
        .collect();
    let shown: Vec<&str> = summary.rows[0]
        .times
        .stages()
        .map(|(stage, _)| stage)
        .into_iter()
        .filter(|stage| stages.contains(stage))
        .collect();
    if shown.is_empty() {
        let mut section = Section::new("Run time");
        section.say(text!["No durations were logged, so that every run of the configuration gives identical files."]);
        section.blocks.extend(cost::search_cost(run).map(Block::Figure));
        return section;
    }
    let mut heads = columns::heads(summary);
    heads.extend(shown.iter().map(|stage| Head::numbers(*stage)));
    heads.push(Head::numbers("total, p95"));
    let mut table = Table::new("times", caption, heads);
    for (index, (row, trial)) in summary.rows.iter().zip(&run.trials).enumerate() {
        let mut line = columns::cells(row);
        for (stage, time) in row.times.stages().into_iter().filter(|(stage, _)| shown.contains(stage)) {
            let what = format!("median {stage}_ms of attempted");
            let decimals = if time.is_some_and(|t| t < 1.0) { 3 } else { 1 };
            line.push(Number::new(time, decimals, Key::of(trial, "/metrics/timing", what)).into());
        }
        let max = phrases::statistic(trial, "q95", Field::TotalTime, "attempted", row.total_p95, (Unit::Plain, 1));
        line.push(Cell::minor(max));
        table.line(columns::breaks(summary, index), line);
    }
    let mut section = Section::new("Run time");
    if let Some(shared) = summary.shared_times() {
        section.say(text![shared]);
    }
    section.with([Block::Table(table)]).with(cost::search_cost(run).map(Block::Figure))
}
