//! YAML files of calibrations and recordings.

use std::path::Path;

use seafix_component::{Fault, read_text};
use yaml_rust2::Yaml;

use crate::bounded_yaml;

/// The first document of a YAML file; OpenCV's first line `%YAML:1.0` and its type names are passed over.
///
/// # Errors
/// A file that cannot be read, invalid YAML, aliases that repeat too many values, values nested too deeply.
pub fn read(file: &Path) -> Result<Yaml, Fault> {
    parse(&read_text(file)?, file)
}

/// The first document in `text`, the content of `file`.
///
/// # Errors
/// As [`read`], except for the reading.
pub fn parse(text: &str, file: &Path) -> Result<Yaml, Fault> {
    // OpenCV's first line is not valid YAML, and its type names have a colon that other parsers reject.
    let body = if text.starts_with("%YAML:") { text.split_once('\n').map_or("", |(_, rest)| rest) } else { text };
    let offset = usize::from(text.len() > body.len());
    let mut body = body.replace("!!opencv-matrix", "");
    if offset > 0 {
        // OpenCV reads `data:[1, 2]`, as hand-written settings have it; YAML wants a blank.
        body = body.replace(":[", ": [");
    }
    let documents = bounded_yaml::load(&body).map_err(|(what, line)| {
        let format = if file.extension().is_some_and(|end| end == "json") { "invalid JSON" } else { "invalid YAML" };
        Fault::new(format, file).on_line(line + offset).value(what).remedy("correct the line")
    })?;
    Ok(documents.into_iter().next().unwrap_or(Yaml::Null))
}

/// The number of a value, whole or not.
pub fn number(value: &Yaml) -> Option<f64> {
    let number = value.as_f64().or_else(|| value.as_i64().map(|integer| integer as f64));
    number.filter(|number| number.is_finite())
}

/// The numbers of a list, also of a list of lists, row by row.
pub fn numbers(value: &Yaml) -> Option<Vec<f64>> {
    list(value, number)
}

/// The numbers of a list as [`numbers`], with NaN and infinity as YAML, OpenCV (`.Nan`) and NumPy (`NaN`) write them.
pub fn any_numbers(value: &Yaml) -> Option<Vec<f64>> {
    // Some of these are words to the parser.
    let word = |value: &Yaml| value.as_str()?.replacen('.', "", 1).parse().ok();
    list(value, |value| number(value).or_else(|| value.as_f64()).or_else(|| word(value)))
}

fn list(value: &Yaml, number: impl Fn(&Yaml) -> Option<f64> + Copy) -> Option<Vec<f64>> {
    let mut all = Vec::new();
    for value in value.as_vec()? {
        match number(value) {
            Some(number) => all.push(number),
            None => all.extend(list(value, number)?),
        }
    }
    Some(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opencv_s_first_line_is_passed_over_and_aliases_are_bounded() {
        let file = Path::new("a.yaml");
        let text = "%YAML:1.0\n---\nM1: !!opencv-matrix\n   rows: 1\n   data: [ 1., 2, -3.5e-1 ]\n";
        assert_eq!(numbers(&parse(text, file).unwrap()["M1"]["data"]), Some(vec![1.0, 2.0, -0.35]));
        assert_eq!(
            numbers(&parse("%YAML:1.0\nD:\n   data:[1, 2]\n", file).unwrap()["D"]["data"]),
            Some(vec![1.0, 2.0])
        );
        let json = "{\n\t\"K\": {\"rows\": 1, \"data\": [1., 2.0, 3e-1]}, \"a\": \"x\"\n}\n";
        let json = parse(json, Path::new("a.json")).unwrap();
        assert!(numbers(&json["K"]["data"]) == Some(vec![1.0, 2.0, 0.3]) && json["a"].as_str() == Some("x"));
        assert_eq!(numbers(&parse("a: &a [1, 2]\nb: *a\n", file).unwrap()["b"]), Some(vec![1.0, 2.0]));
        let nested = parse(&("%YAML:1.0\n".to_owned() + &"[".repeat(200)), file).unwrap_err().to_string();
        assert!(nested.starts_with("invalid YAML in a.yaml:2") && nested.contains("nested"), "{nested}");
        assert_eq!(numbers(&parse("T:\n- [1, 0]\n- [0, 1]\n", file).unwrap()["T"]), Some(vec![1.0, 0.0, 0.0, 1.0]));
        let any = any_numbers(&parse("a: [.Nan, NaN, -.Inf, .inf, 1]\n", file).unwrap()["a"]).unwrap();
        assert!(any[..4].iter().all(|number| !number.is_finite()) && any[2] < 0.0 && any[4] == 1.0, "{any:?}");
        assert!(parse("a: [1\n", file).unwrap_err().to_string().starts_with("invalid YAML in a.yaml"));
    }
}
