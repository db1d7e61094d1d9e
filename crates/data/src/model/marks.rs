//! Marks of an operator in a stereo pair: `id,left_u,left_v,right_u,right_v`.

use std::{collections::HashMap, path::Path};

use seafix_component::Fault;
use seafix_geometry::Pixel;

use crate::formats::named::{number, rows};

/// A feature point marked by an operator.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// The line in the file.
    pub line: usize,
    /// The name of the point.
    pub id: String,
    /// The position in the left image, to a few pixels.
    pub left: Pixel,
    /// The position in the right image; `None` to match it automatically.
    pub right: Option<Pixel>,
}

/// Reads the marks of `text`, the content of `file`, in images of these sizes (px).
///
/// # Errors
/// The first invalid line.
pub(super) fn read(text: &str, file: &Path, sizes: [[u32; 2]; 2]) -> Result<Vec<Mark>, Fault> {
    let mut marks: Vec<Mark> = Vec::new();
    let mut known: HashMap<String, usize> = HashMap::new();
    for (line, [id, left_u, left_v, right_u, right_v]) in
        rows(text, file, ["id", "left_u", "left_v", "right_u", "right_v"])?
    {
        let mark = mark(line, id, [left_u, left_v, right_u, right_v], sizes, file)?;
        if let Some(first) = known.insert(mark.id.clone(), line) {
            return Err(Fault::new("a point marked twice", file)
                .on_line(line)
                .value(format!("`{}`", mark.id))
                .remedy(format!("it is already on line {first}; give each point its own id")));
        }
        marks.push(mark);
    }
    if marks.len() < 3 {
        return Err(Fault::new("too few marks for a model", file)
            .value(marks.len())
            .remedy("mark at least three points that are not on a line"));
    }
    Ok(marks)
}

/// The mark of one line: its name and the cells `left_u`, `left_v`, `right_u`, `right_v`.
///
/// # Errors
/// A mark without a name, or outside an image.
pub(super) fn mark(
    line: usize,
    id: String,
    [left_u, left_v, right_u, right_v]: [String; 4],
    sizes: [[u32; 2]; 2],
    file: &Path,
) -> Result<Mark, Fault> {
    let fault = |what: &str| Fault::new(what, file).on_line(line);
    if id.is_empty() {
        return Err(fault("a mark without a name").remedy("give every point its id"));
    }
    let pixel = |u: &str, v: &str, [width, height]: [u32; 2], side: &str| {
        let at = Pixel { u: number(u, line, file)?, v: number(v, line, file)? };
        let [right, bottom] = [width, height].map(|n| f64::from(n) - 0.5);
        let inside = (-0.5..=right).contains(&at.u) && (-0.5..=bottom).contains(&at.v);
        if inside {
            return Ok(at);
        }
        Err(fault(&format!("a mark outside the {side} image"))
            .value(format!("`{id}` at {u}, {v}"))
            .remedy(format!("the image has {width}×{height} pixels; the first has its centre at 0, 0")))
    };
    let right = match [right_u.as_str(), right_v.as_str()] {
        ["", ""] => None,
        [u, v] => Some(pixel(u, v, sizes[1], "right")?),
    };
    let left = pixel(&left_u, &left_v, sizes[0], "left")?;
    Ok(Mark { line, id, left, right })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(lines: &str) -> String {
        let text = format!("id,left_u,left_v,right_u,right_v\n{lines}");
        read(&text, Path::new("clicks.csv"), [[640, 480]; 2]).unwrap_err().to_string()
    }

    #[test]
    fn marks_are_read_and_what_is_wrong_is_reported_with_its_line() {
        let text = "id,left_u,left_v,right_u,right_v\nA,1,2,3,4.5\nB,639.5,0,,\nC,-0.5,9,8,7\n";
        let marks = read(text, Path::new("clicks.csv"), [[640, 480]; 2]).unwrap();
        assert_eq!(marks[0].right, Some(Pixel { u: 3.0, v: 4.5 }));
        assert_eq!((marks[1].line, marks[1].right), (3, None));
        let quoted = "id;left_v;left_u;right_u;right_v\n\"A\";2,5;1;;\n\"B\";0,0;9;;\n\"C\";9;8;;\n;;;;\n";
        let marks = read(quoted, Path::new("clicks.csv"), [[640, 480]; 2]).unwrap();
        assert_eq!((marks[0].id.as_str(), marks[0].left), ("A", Pixel { u: 1.0, v: 2.5 }));
        assert_eq!(marks.len(), 3);
        assert!(message("A,1,2,3,4\nA,1,2,3,4\n").starts_with("a point marked twice in clicks.csv:3: `A`"));
        assert!(message("A,640,2,3,4\n").starts_with("a mark outside the left image in clicks.csv:2: `A` at 640, 2"));
        assert!(message("A,1,2,3,NaN\n").starts_with("a mark outside the right image"));
        assert!(message("A,1,2,3,\n").starts_with("not a number in clicks.csv:2"));
        assert!(message(",1,2,3,4\n").starts_with("a mark without a name"));
        assert!(message("A,1,2,3,4\n").starts_with("too few marks for a model in clicks.csv: 1"));
    }
}
