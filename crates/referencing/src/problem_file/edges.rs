//! The straight edges of a problem.

use nalgebra::{Matrix4, Vector3};
use seafix_component::{counted, number};
use seafix_geometry::{MeasuredLine, Point};
use serde::Deserialize;

use super::{
    duplicates::first_lines,
    invalid_part::{FARTHEST, InvalidPart, MAX_SIGMA, ROUNDING, invalid},
};
use crate::{
    candidates::Gate,
    edge_candidates::edge_candidates,
    problem::Prior,
    site::{
        check::COINCIDENT,
        check_edges::{MAX_EDGES, MIN_LENGTH},
        edge::{End, ModelEdge},
        model::ModelPoint,
    },
};

/// Maximum number of measured lines.
const MAX_LINES: usize = 8000;
/// Minimum variance of a line's offset (m²), a nanometre's; no measurement is more precise.
const MIN_VARIANCE: f64 = 1e-18;
/// Minimum eigenvalue of the correlations of a line's offsets, above the rounding errors of their inverse.
const SINGULAR: f64 = 1e-12;

/// The straight edges of a problem: those of the model, and the measured lines. Empty for a problem of points alone.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ProblemEdges {
    /// The edges of the model, object frame.
    pub model: Vec<ModelEdge>,
    /// The measured lines, camera frame.
    pub lines: Vec<MeasuredLine>,
    /// The putative pairs (edge, line), if given; no other pairs are considered.
    ///
    /// A line that the file lists more than once takes part as its first.
    pub putative: Option<Vec<(usize, usize)>>,
}

impl ProblemEdges {
    /// Stage 1: the lines that each edge may correspond to; empty for a problem of points alone.
    pub fn candidates(&self, model: &[ModelPoint], prior: Option<&Prior>) -> Vec<Vec<usize>> {
        if self.model.is_empty() || self.lines.is_empty() {
            return Vec::new();
        }
        let mut lists = match &self.putative {
            None => edge_candidates(&self.model, model, &self.lines, prior, &Gate::default(), None),
            Some(pairs) => {
                let mut lists = vec![Vec::new(); self.model.len()];
                pairs.iter().for_each(|&(edge, line)| lists[edge].push(line));
                lists
            }
        };
        // Two edges must not share one line: each would count as evidence.
        let firsts = first_lines(&self.lines);
        for list in &mut lists {
            list.iter_mut().for_each(|line| *line = firsts[*line]);
            list.sort_unstable();
            list.dedup();
        }
        lists
    }
}

/// Whether an end of a line is behind the camera.
pub(super) fn is_behind(line: &MeasuredLine) -> bool {
    !line.ends.iter().all(|end| end.coords.z > 0.0)
}

/// An end of an edge before validation: a place (m), or the index of a model point.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum RawEnd {
    /// The index of a model point.
    Point(usize),
    /// A place (m), object frame.
    At([f64; 3]),
}

/// A measured line before validation.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawLine {
    /// Two places on the line (m), camera frame, as far apart as it was seen.
    pub ends: [[f64; 3]; 2],
    /// The covariance (m²) of the offsets of the first end along the two directions
    /// [`MeasuredLine::across`], and of the second end.
    pub covariance: [[f64; 4]; 4],
}

/// The numbers of a problem's edges before validation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct EdgeParts {
    /// The ends of each edge.
    pub edges: Vec<[RawEnd; 2]>,
    /// The measured lines.
    pub lines: Vec<RawLine>,
    /// The putative pairs (edge, line), if no other pairs are to be considered.
    pub putative: Option<Vec<[usize; 2]>>,
}

impl EdgeParts {
    /// The validated edges of a problem with this model.
    ///
    /// # Errors
    ///
    /// The first invalid value: too many edges or lines, an edge that is too short or given twice, an index out of range,
    /// a number that is not finite, or a covariance that is implausibly small, or not symmetric and positive definite.
    pub(super) fn checked(self, model: &[ModelPoint]) -> Result<ProblemEdges, InvalidPart> {
        for (name, count, max) in [("edges", self.edges.len(), MAX_EDGES), ("lines", self.lines.len(), MAX_LINES)] {
            if count > max {
                let fault = invalid(format!("too many {name}"), name, None, format!("at most {max} are accepted"));
                return Err(fault.value(count.to_string()));
            }
        }
        let edges = self.edges.iter().enumerate().map(|(index, ends)| edge(index, ends, model));
        let lines = self.lines.iter().enumerate().map(|(index, raw)| line(index, raw));
        let (edges, lines): (Vec<ModelEdge>, Vec<_>) =
            (edges.collect::<Result<_, _>>()?, lines.collect::<Result<_, _>>()?);
        for (index, edge) in edges.iter().enumerate() {
            let [from, to] = edge.places(model);
            let same = |other: &&ModelEdge| {
                let [a, b] = other.places(model);
                let near = |c: &Point<_>, d: &Point<_>| a.distance(c) < COINCIDENT && b.distance(d) < COINCIDENT;
                near(&from, &to) || near(&to, &from)
            };
            if let Some(other) = edges[..index].iter().find(same) {
                let what = format!("edge {index} is edge {} again", other.id);
                return Err(invalid(what, "edges", Some(index), "give each edge once".to_owned()));
            }
        }
        if let Some(pairs) = &self.putative
            && let Some(index) = pairs.iter().position(|&[i, j]| i >= edges.len() || j >= lines.len())
        {
            let (edges, lines) = (counted(edges.len(), "edge"), counted(lines.len(), "line"));
            let what = format!("putative pair {index} of edges is out of range");
            let remedy = format!("there are {edges} and {lines}; count from 0");
            return Err(invalid(what, "putative_edges", Some(index), remedy));
        }
        let putative = self.putative.map(|pairs| pairs.into_iter().map(|[i, j]| (i, j)).collect());
        Ok(ProblemEdges { model: edges, lines, putative })
    }
}

fn edge(index: usize, ends: &[RawEnd; 2], model: &[ModelPoint]) -> Result<ModelEdge, InvalidPart> {
    let wrong = |what: &str, remedy: String| invalid(format!("edge {index} {what}"), "edges", Some(index), remedy);
    let end = |end: &RawEnd| match *end {
        RawEnd::Point(point) if point < model.len() => Ok(End::Point(point)),
        RawEnd::Point(_) => {
            let points = counted(model.len(), "model point");
            Err(wrong("ends at no model point", format!("there are {points}; count from 0")))
        }
        // A NaN is out of range as well.
        RawEnd::At(at) if at.iter().all(|x| x.abs() <= FARTHEST) => Ok(End::At(Point::from(at))),
        RawEnd::At(_) => Err(wrong("is out of range", format!("give metres, at most {FARTHEST:e}"))),
    };
    let edge =
        ModelEdge { id: index.to_string(), ends: [end(&ends[0])?, end(&ends[1])?], sigma: 0.0, faces: Vec::new() };
    let [from, to] = edge.places(model);
    let length = from.distance(&to);
    match length >= MIN_LENGTH {
        true => Ok(edge),
        false => {
            let remedy = format!("give edges of {MIN_LENGTH} m and more");
            Err(wrong("is too short", remedy).value(format!("{} m", number(length))))
        }
    }
}

fn line(index: usize, raw: &RawLine) -> Result<MeasuredLine, InvalidPart> {
    let wrong = |what: &str, remedy: &str| invalid(format!("line {index} {what}"), "lines", Some(index), remedy);
    let ends = raw.ends.map(Vector3::from);
    if !ends.iter().flatten().all(|x| x.abs() <= FARTHEST) {
        return Err(wrong("is out of range", "give metres"));
    }
    let length = (ends[1] - ends[0]).norm();
    if !(length > 0.0) {
        return Err(wrong("has one place twice", "give two places on the line").value("0 m"));
    }
    let covariance = Matrix4::from_fn(|r, c| raw.covariance[r][c]);
    let largest = covariance.amax();
    let valid = largest <= MAX_SIGMA * MAX_SIGMA
        && (covariance - covariance.transpose()).amax() <= ROUNDING * largest
        && covariance.cholesky().is_some();
    if !valid {
        let what = "has a covariance that is not symmetric and positive definite";
        return Err(wrong(what, "give variances of the four offsets in square metres"));
    }
    let variances = covariance.diagonal();
    if variances.min() < MIN_VARIANCE {
        let remedy = "no measurement is more precise than a nanometre; give variances in square metres";
        return Err(wrong("has an implausibly small variance", remedy).value(format!("{} m²", number(variances.min()))));
    }
    let sigmas = variances.map(f64::sqrt);
    let correlations = covariance.component_div(&(sigmas * sigmas.transpose()));
    if (correlations - Matrix4::identity() * SINGULAR).cholesky().is_none() {
        let remedy = "give four offsets none of which follows from the others";
        return Err(wrong("has a singular covariance", remedy));
    }
    Ok(MeasuredLine { ends: ends.map(Point::from), offsets: covariance, segments: None, depth: true })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts() -> EdgeParts {
        let mut covariance = [[0.0; 4]; 4];
        (0..4).for_each(|i| covariance[i][i] = 1e-6);
        EdgeParts {
            edges: vec![[RawEnd::Point(0), RawEnd::At([1.0, 0.0, 0.0])]],
            lines: vec![RawLine { ends: [[0.0, 0.0, 3.0], [1.0, 0.0, 3.0]], covariance }],
            putative: Some(vec![[0, 0]]),
        }
    }

    #[test]
    fn edges_of_a_problem_are_checked() {
        let model = [ModelPoint::exact("0", Point::origin())];
        let fault = |change: fn(&mut EdgeParts)| {
            let mut parts = parts();
            change(&mut parts);
            parts.checked(&model).unwrap_err().to_string()
        };
        assert_eq!(parts().checked(&model).unwrap().candidates(&model, None), [[0]]);
        assert_eq!(
            fault(|it| it.edges[0][0] = RawEnd::Point(1)),
            "edge 0 ends at no model point; there are 1 model point; count from 0"
        );
        assert_eq!(
            fault(|it| it.edges[0][1] = RawEnd::At([0.01, 0.0, 0.0])),
            "edge 0 is too short: 0.01 m; give edges of 0.02 m and more"
        );
        assert!(fault(|it| it.edges[0][1] = RawEnd::At([f64::NAN; 3])).starts_with("edge 0 is out of range"));
        assert_eq!(
            fault(|it| it.edges.push([it.edges[0][1], it.edges[0][0]])),
            "edge 1 is edge 0 again; give each edge once"
        );
        let nearly = fault(|it| it.edges.push([RawEnd::At([1.0, 0.0, 1e-7]), RawEnd::Point(0)]));
        assert!(nearly.starts_with("edge 1 is edge 0 again"), "{nearly}");
        assert!(fault(|it| it.lines[0].ends[1] = it.lines[0].ends[0]).starts_with("line 0 has one place twice"));
        assert!(fault(|it| it.lines[0].covariance[3][3] = 0.0).contains("positive definite"));
        assert!(fault(|it| it.lines[0].covariance[0][1] = 1e-7).contains("symmetric"));
        assert_eq!(
            fault(|it| it.lines[0].covariance[3][3] = 1e-30),
            "line 0 has an implausibly small variance: 1e-30 m²; no measurement is more precise than a nanometre; give \
             variances in square metres"
        );
        let singular = |it: &mut EdgeParts| {
            for (i, k) in [(0, 1), (1, 0)] {
                it.lines[0].covariance[i][k] = 1e-6 * (1.0 - 1e-14);
            }
        };
        assert!(fault(singular).starts_with("line 0 has a singular covariance"));
        assert!(fault(|it| it.lines[0].ends[0][2] = f64::INFINITY).contains("out of range"));
        assert!(fault(|it| it.putative = Some(vec![[0, 1]])).contains("there are 1 edge and 1 line"));
    }

    /// With or without putative pairs, and with its ends in either order.
    #[test]
    fn a_repeated_line_takes_part_as_its_first() {
        let model = [ModelPoint::exact("0", Point::origin())];
        let mut repeated = parts();
        let RawLine { ends: [from, to], covariance } = repeated.lines[0].clone();
        repeated.lines.push(RawLine { ends: [to, from], covariance });
        for putative in [Some(vec![[0, 1]]), None] {
            let problem = EdgeParts { putative, ..repeated.clone() }.checked(&model).unwrap();
            assert_eq!(problem.candidates(&model, None), [[0]]);
        }
    }
}
