//! The figure of the trajectory: true and estimated camera positions.

use seafix_log::TrialHeader;

use crate::{
    content::figures::layout::{self, caption},
    document::{Cell, Figure, Head, Table, text},
    figure::{Axis, Chart, Entry, Layer, Panel},
    number::{Key, Number},
    place::matrix,
    proportion,
    run::{Run, Trial},
};

/// Maximum number of plotted frames; the positions of more would overlap.
const PLACES: usize = 1000;

/// The figure of the first trial's trajectory, from above and from the side.
///
/// It shows true positions, fixes, navigated and odometry-only trajectories, feature points and bounding boxes.
pub(crate) fn figure(run: &Run) -> Option<Figure> {
    let trial = &run.trials[0];
    if !proportion::is_trajectory(&trial.header) {
        return None;
    }
    let every = trial.sample().count().div_ceil(PLACES).max(1);
    let frames = || trial.sample().step_by(every);
    let truth: Vec<[f64; 3]> = frames().filter_map(|frame| frame.truth).collect();
    let fixes: Vec<(u64, u64, String, [f64; 3])> = frames()
        .flat_map(|frame| trial.attempts_of(frame).map(move |row| (frame, row)))
        .filter(|(_, row)| row.found() && row.estimate[0].is_finite())
        .map(|(frame, row)| (frame.number, frame.stamp_ns, trial.object(row).to_owned(), row.estimate))
        .collect();
    let objects = objects(&trial.header);
    if truth.is_empty() || fixes.is_empty() || objects.is_empty() {
        return None;
    }
    // With a navigator there are two trajectories: navigated, and odometry only from the first fix.
    let navigated = || frames().filter_map(|frame| Some((frame, frame.navigated.as_ref()?)));
    let navigates = navigated().next().is_some();
    let carried = |which: usize| {
        let places = navigated().map(move |(frame, navigated)| (frame, navigated.places[which]));
        places.filter(|(_, at)| at[0].is_finite())
    };
    let heads = [Head::words("what"), Head::words("name"), Head::numbers("frame")];
    let heads = heads.into_iter().chain(["north (m)", "east (m)", "down (m)"].map(Head::numbers));
    let mut data = Table::new("trajectory", text!["The data of the figure of the trajectory."], heads.collect());
    for (frame, at) in frames().filter_map(|frame| Some((frame, frame.truth?))) {
        data.line(false, line(trial, "truth", "", (frame.number, frame.stamp_ns), at));
    }
    for (which, what) in ["navigated", "odometry"].into_iter().enumerate() {
        for (frame, at) in carried(which) {
            data.line(false, line(trial, what, "", (frame.number, frame.stamp_ns), at));
        }
    }
    for (number, stamp, object, at) in &fixes {
        data.line(false, line(trial, "fix", object, (*number, *stamp), *at));
    }
    let panel = |(a, b): (usize, usize), labels: [&str; 2], down: bool| {
        let flat = |p: &[f64; 3]| [p[a], if down { -p[b] } else { p[b] }];
        let mut layers = Vec::new();
        for points in &objects {
            let reach = |of: usize| {
                points
                    .iter()
                    .map(|p| flat(p)[of])
                    .fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)])
            };
            let ([l, r], [lo, hi]) = (reach(0), reach(1));
            layers.push(Layer::Line { series: 2, points: vec![[l, lo], [r, lo], [r, hi], [l, hi], [l, lo]] });
        }
        layers.push(Layer::Marks { series: 6, points: objects.iter().flatten().map(flat).collect(), radius: 0.9 });
        let truth: Vec<[f64; 2]> = truth.iter().map(flat).collect();
        if navigates {
            let path = |which: usize| carried(which).map(|(_, at)| flat(&at)).collect();
            layers.push(Layer::Line { series: 0, points: truth });
            layers.push(Layer::Line { series: 3, points: path(1) });
            layers.push(Layer::Line { series: 4, points: path(0) });
        } else {
            layers.push(Layer::Marks { series: 0, points: truth, radius: 2.4 });
        }
        layers.push(Layer::Marks { series: 1, points: fixes.iter().map(|fix| flat(&fix.3)).collect(), radius: 1.4 });
        Panel { x: Axis::linear(labels[0]), y: Axis::linear(labels[1]), layers, equal: true, ..Panel::default() }
    };
    let mut legend = vec![
        if navigates { Entry::line("true camera positions", 0) } else { Entry::mark("true camera positions", 0) },
        Entry::mark("fixes", 1),
        Entry::mark("feature points", 6),
        Entry::line("bounding boxes", 2),
    ];
    if navigates {
        legend.extend([Entry::line("odometry only, from the first fix", 3), Entry::line("navigated", 4)]);
    }
    let chart = Chart {
        panels: vec![panel((0, 1), ["north (m)", "east (m)"], false), panel((0, 2), ["north (m)", "height (m)"], true)],
        columns: 2,
        page: true,
        shape: 0.8,
        legend,
    };
    let message = format!(
        "Trajectory from above and from the side, on equal scales: true positions of the left camera, positions by the fixes and the survey,{} feature points and the bounding boxes of the objects. {}Log {}.",
        if navigates { " the navigated trajectory, the trajectory by odometry only from the first fix," } else { "" },
        if every > 1 { format!("One frame in {every} is shown. ") } else { String::new() },
        trial.file()
    );
    layout::figure("trajectory", caption(&message), &chart, data)
}

fn line(trial: &Trial, what: &str, name: &str, (frame, stamp): (u64, u64), at: [f64; 3]) -> Vec<Cell> {
    let number = |axis: usize| {
        let what = format!("place-{} {what} of {name} at {frame}", ["x", "y", "z"][axis]);
        let key = Key { what, topic: "/referencing/frame".to_owned(), span: [stamp; 2], logs: vec![trial.file()] };
        Number::new(Some(at[axis]), 4, key).into()
    };
    let frame = Number::count(
        frame as usize,
        Key {
            what: "frame".to_owned(),
            topic: "/referencing/frame".to_owned(),
            span: [stamp; 2],
            logs: vec![trial.file()],
        },
    );
    vec![what.into(), name.to_owned().into(), frame.into(), number(0), number(1), number(2)]
}

/// The surveyed positions of the feature points in the world, by object.
fn objects(header: &TrialHeader) -> Vec<Vec<[f64; 3]>> {
    let Some(site) = header.world_from_site else { return Vec::new() };
    let of = |target: &seafix_log::TargetModel| {
        let world = matrix(&site) * matrix(&target.site_from_object?);
        let place = |at: [f64; 3]| world.transform_point(&at.into()).coords.into();
        Some(target.points.iter().map(|point| place(point.at)).collect())
    };
    header.targets.iter().filter_map(of).collect()
}
