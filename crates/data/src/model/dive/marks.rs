//! Marks of an operator in the pairs of a dive: `stamp_ns,id,left_u,left_v,right_u,right_v`.

use std::{
    collections::{HashMap, HashSet},
    path::Path,
};

use seafix_component::Fault;

use crate::{
    formats::named::{number, rows},
    model::marks::{Mark, mark},
};

/// A mark in the pair of a stamp.
#[derive(Debug, Clone, PartialEq)]
pub struct DiveMark {
    /// The stamp of the pair (ns).
    pub stamp_ns: u64,
    /// The mark in that pair.
    pub mark: Mark,
}

/// Reads the marks of `text`, the content of `file`, in images of these sizes (px).
///
/// # Errors
/// The first invalid line, or fewer than three points.
pub(super) fn read(text: &str, file: &Path, sizes: [[u32; 2]; 2]) -> Result<Vec<DiveMark>, Fault> {
    let header = ["stamp_ns", "id", "left_u", "left_v", "right_u", "right_v"];
    let mut marks: Vec<DiveMark> = Vec::new();
    let mut known: HashMap<(u64, String), usize> = HashMap::new();
    for (line, [stamp, id, left_u, left_v, right_u, right_v]) in rows(text, file, header)? {
        let stamp_ns = number(&stamp, line, file)?;
        let mark = mark(line, id, [left_u, left_v, right_u, right_v], sizes, file)?;
        if let Some(first) = known.insert((stamp_ns, mark.id.clone()), line) {
            return Err(Fault::new("a point marked twice in one pair", file)
                .on_line(line)
                .value(format!("`{}`", mark.id))
                .remedy(format!("it is already on line {first}; delete one of the lines")));
        }
        marks.push(DiveMark { stamp_ns, mark });
    }
    let points = marks.iter().map(|mark| mark.mark.id.as_str()).collect::<HashSet<_>>().len();
    if points < 3 {
        return Err(Fault::new("too few marked points for a model", file)
            .value(points)
            .remedy("mark at least three points that are not on a line"));
    }
    Ok(marks)
}

/// The order of names in which numbers count as numbers: P2 before P10.
pub(super) fn natural(a: &str, b: &str) -> std::cmp::Ordering {
    fn parts(name: &str) -> Vec<(&str, Option<u64>)> {
        let mut parts = Vec::new();
        let mut rest = name;
        while let Some(first) = rest.chars().next() {
            let digit = first.is_ascii_digit();
            let end = rest.find(|c: char| c.is_ascii_digit() != digit).unwrap_or(rest.len());
            let (part, after) = rest.split_at(end);
            parts.push((part, part.parse().ok()));
            rest = after;
        }
        parts
    }
    for ((left, m), (right, n)) in parts(a).into_iter().zip(parts(b)) {
        let order = m.zip(n).map_or_else(|| left.cmp(right), |(m, n)| m.cmp(&n));
        if order.is_ne() {
            return order;
        }
    }
    a.len().cmp(&b.len()).then_with(|| a.cmp(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(lines: &str) -> String {
        let text = format!("stamp_ns,id,left_u,left_v,right_u,right_v\n{lines}");
        read(&text, Path::new("marks.csv"), [[640, 480]; 2]).unwrap_err().to_string()
    }

    #[test]
    fn a_point_may_be_marked_in_several_pairs_but_once_in_each() {
        let text = "stamp_ns,id,left_u,left_v,right_u,right_v\n5,A,1,2,,\n9,A,3,4,2,4\n5,B,1,8,,\n5,C,7,2,,\n";
        let marks = read(text, Path::new("marks.csv"), [[640, 480]; 2]).unwrap();
        assert_eq!((marks.len(), marks[1].stamp_ns, marks[1].mark.line), (4, 9, 3));
        assert!(message("5,A,1,2,,\n5,A,3,4,,\n").starts_with("a point marked twice in one pair in marks.csv:3: `A`"));
        assert!(message("5,A,1,2,,\n9,A,1,2,,\n9,B,1,2,,\n").starts_with("too few marked points for a model"));
        assert!(message("now,A,1,2,,\n").starts_with("not a number in marks.csv:2: now"));
        assert!(message("5,A,640,2,,\n").starts_with("a mark outside the left image in marks.csv:2: `A` at 640, 2"));
    }

    #[test]
    fn numbers_in_names_count() {
        let mut names = ["P10", "P2", "a", "P2b", "P1"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(names, ["P1", "P2", "P2b", "P10", "a"]);
    }
}
