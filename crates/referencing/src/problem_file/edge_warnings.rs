//! Warnings about the edges and lines of valid but implausible problems.

use seafix_component::{counted, number};

use super::{duplicates::first_lines, edges::is_behind, input::CoherenceProblem, warnings::Hints};
use crate::site::check::SUSPICIOUS;

impl CoherenceProblem {
    /// Whether edges take part: there are edges and lines.
    pub(super) fn has_edges(&self) -> bool {
        !self.edges.model.is_empty() && !self.edges.lines.is_empty()
    }

    pub(super) fn of_the_edges(&self, reported: &mut Hints<'_>) {
        let (edges, lines) = (&self.edges.model, &self.edges.lines);
        if !edges.is_empty() && lines.is_empty() {
            let remedy = "the points alone take part; add the measured `lines`";
            reported.warn("edges without lines", counted(edges.len(), "edge"), remedy);
        } else if edges.is_empty() && !lines.is_empty() {
            let remedy = "the points alone take part; add the `edges` of the model";
            reported.warn("lines without edges", counted(lines.len(), "line"), remedy);
        }
        let length = |[from, to]: [seafix_geometry::Point<_>; 2]| from.distance(&to);
        let longest = edges.iter().map(|edge| length(edge.places(&self.model))).fold(0.0, f64::max);
        if longest > SUSPICIOUS[1] {
            let value = format!("the longest edge has {} m", number(longest));
            reported.warn("implausible units", value, "give coordinates in metres");
        }
        self.some_lines(reported, "lines behind the camera (z ≤ 0)", "remove them, or give z forward", |line| {
            is_behind(&lines[line])
        });
        let sigma = |line: usize| lines[line].offsets.diagonal().max().sqrt();
        let remedy = "give the covariance of the offsets in square metres";
        self.some_lines(reported, "lines with more noise than length", remedy, |line| {
            sigma(line) > lines[line].ends[0].distance(&lines[line].ends[1])
        });
        let firsts = first_lines(lines);
        let remedy = "equal ends are one line; each takes part as its first";
        self.some_lines(reported, "repeated lines", remedy, |line| firsts[line] != line);
    }

    /// Warns of the lines of a kind, if there are any.
    fn some_lines(&self, reported: &mut Hints<'_>, what: &str, remedy: &str, of_the_kind: impl Fn(usize) -> bool) {
        let all = self.edges.lines.len();
        let mut some = (0..all).filter(|line| of_the_kind(*line));
        if let Some(first) = some.next() {
            reported.warn(what, format!("{} of {all}, e.g. line {first}", 1 + some.count()), remedy);
        }
    }
}
