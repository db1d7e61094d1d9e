//! The JSON form of a problem: types of its keys, and messages for invalid text.

use std::{fmt, marker::PhantomData, path::Path};

use seafix_component::{Fault, counted, nearest, place_at};
use serde::{
    Deserialize, Deserializer,
    de::{IgnoredAny, MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer},
};
use serde_json::value::RawValue;
use serde_path_to_error::Segment;

use super::edges::{RawEnd, RawLine};

/// The format of a problem of points.
pub const FORMAT: &str = "coherence-problem/1";
/// The format of a problem with straight edges; a problem of points may state it as well.
pub const FORMAT_WITH_EDGES: &str = "coherence-problem/1.1";

/// The keys of a problem before validation.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Raw {
    pub(super) format: String,
    #[serde(default)]
    pub(super) id: Option<String>,
    #[serde(default, rename = "family")]
    _family: IgnoredAny,
    #[serde(default, rename = "seed_set")]
    _seed_set: IgnoredAny,
    #[serde(default, rename = "seed")]
    _seed: IgnoredAny,
    pub(super) model: Vec<[f64; 3]>,
    pub(super) cloud: Vec<[f64; 3]>,
    pub(super) sigma: f64,
    #[serde(default)]
    pub(super) sigma_xyz: Option<Vec<[f64; 3]>>,
    pub(super) delta: f64,
    #[serde(default)]
    pub(super) prior: Option<InBraces<RawPrior>>,
    #[serde(default)]
    pub(super) putative: Option<Vec<[usize; 2]>>,
    #[serde(default)]
    pub(super) edges: Vec<[RawEnd; 2]>,
    #[serde(default)]
    pub(super) lines: Vec<InBraces<RawLine>>,
    #[serde(default)]
    pub(super) putative_edges: Option<Vec<[usize; 2]>>,
}

/// The keys of a prior before validation.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPrior {
    #[serde(rename = "T_cam_obj")]
    pub(super) t_cam_obj: [[f64; 4]; 4],
    pub(super) shell_half_m: f64,
}

/// A value read from an object only; serde would otherwise accept a list of the values without their keys.
pub(super) struct InBraces<T>(pub(super) T);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for InBraces<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Keys<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Keys<T> {
            type Value = T;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map))
            }
        }
        deserializer.deserialize_map(Keys(PhantomData)).map(Self)
    }
}

/// The text of a problem and its file, by which faults are located.
///
/// A path leads to a value: keys, and indices of lists, as in `["cloud", "3", "1"]`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Source<'a> {
    pub(super) text: &'a str,
    pub(super) file: &'a Path,
}

/// A path, and the reader's error at that value.
type Wrong = (Vec<String>, serde_json::Error);

impl<'a> Source<'a> {
    /// The keys of the problem.
    ///
    /// # Errors
    ///
    /// Another format, or the first place with invalid JSON or a value of another type.
    pub(super) fn read(self) -> Result<Raw, Fault> {
        // Tracking the path costs time, so only invalid text is read a second time with it.
        let read = serde_json::from_str(self.text).map(|InBraces(raw)| raw);
        let raw = read.or_else(|_| self.follow()).map_err(|(path, error)| {
            let path: Vec<&str> = path.iter().map(String::as_str).collect();
            // Another format has other keys.
            let format =
                value_at(self.text, &["format"]).and_then(|format| serde_json::from_str::<String>(format).ok());
            match format.filter(|format| ![FORMAT, FORMAT_WITH_EDGES].contains(&format.as_str())) {
                Some(other) => self.unknown_format(&other),
                None => self.wrong(&path, &error),
            }
        })?;
        let plain = raw.edges.is_empty() && raw.lines.is_empty() && raw.putative_edges.is_none();
        match raw.format.as_str() {
            FORMAT_WITH_EDGES => Ok(raw),
            FORMAT if plain => Ok(raw),
            FORMAT => {
                let fault = self.fault("edges in a problem of another format", &["format"]);
                Err(fault.remedy(format!("give `{FORMAT_WITH_EDGES}`")))
            }
            other => Err(self.unknown_format(other)),
        }
    }

    /// Reads the problem again, tracking the path to the error.
    fn follow(self) -> Result<Raw, Wrong> {
        let mut reader = serde_json::Deserializer::from_str(self.text);
        let InBraces(raw) = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
            let steps = error.path().iter().map_while(|step| match step {
                Segment::Seq { index } => Some(index.to_string()),
                Segment::Map { key } => Some(key.clone()),
                _ => None,
            });
            (steps.collect(), error.into_inner())
        })?;
        reader.end().map_err(|error| (Vec::new(), error))?;
        Ok(raw)
    }

    /// The fault `what` of the value at `path`, with its place and its text.
    pub(super) fn fault(self, what: impl Into<String>, path: &[&str]) -> Fault {
        let fault = Fault::new(what, self.file);
        match value_at(self.text, path) {
            Some(value) => fault.at(Some(self.place(value))).value(shortened(value)),
            None => fault,
        }
    }

    fn unknown_format(self, format: &str) -> Fault {
        let fault = self.fault("unknown format", &["format"]).value(format!("`{format}`"));
        fault.remedy(format!("this reader supports `{FORMAT}` and `{FORMAT_WITH_EDGES}`"))
    }

    /// The line and column of a part of the text.
    fn place(self, part: &str) -> (usize, usize) {
        place_at(self.text, part.as_ptr() as usize - self.text.as_ptr() as usize)
    }

    /// The fault for the reader's error at `path`.
    fn wrong(self, path: &[&str], error: &serde_json::Error) -> Fault {
        let full = error.to_string();
        let tail = format!(" at line {} column {}", error.line(), error.column());
        let message = full.strip_suffix(&tail).unwrap_or(&full);
        let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
        let about = |what: &str| message.starts_with(what);
        // An unknown key may contain backticks; the known keys do not.
        let unknown = message.strip_prefix("unknown field `").and_then(|rest| rest.rsplit_once("`, expected "));
        if let Some((key, known)) = unknown {
            let known: Vec<&str> = known.split('`').skip(1).step_by(2).collect();
            let remedy = match nearest(key, known.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("there are {}", known.join(", ")),
            };
            return self.of_key("unknown key", key, error).value(format!("`{key}`")).remedy(remedy);
        }
        if let (true, Some(key)) = (about("duplicate field"), quoted.first()) {
            return self.of_key("duplicate key", key, error).value(format!("`{key}`")).remedy("keep one");
        }
        if let (true, Some(key)) = (about("missing field"), quoted.first()) {
            let path = [path, &[*key]].concat();
            let within = value_at(self.text, &path[..path.len() - 1]).unwrap_or(self.text);
            let fault = Fault::new(format!("`{}` is missing", name(&path)), self.file);
            return fault.at(Some(self.place(within))).remedy(form(&path).1);
        }
        let value = value_at(self.text, path);
        let length = |value: &str| serde_json::from_str::<Vec<IgnoredAny>>(value).map_or(0, |values| values.len());
        if let (true, Some(value)) = (about("invalid length") || about("trailing characters"), value)
            && !path.is_empty()
        {
            let what = format!("`{}` has {}", name(path), counted(length(value), "value"));
            return self.fault(what, path).remedy(form(path).1);
        }
        // serde's message for an end of an edge, a place or an index, that is neither.
        let typed = ["invalid type", "invalid value", "invalid length", "number out of range", "data did not match"];
        if typed.iter().any(|start| about(start)) {
            let (noun, remedy) = form(path);
            let what = match path {
                [] => format!("expected {noun}"),
                path if about("number out of range") => format!("`{}` is too large for a number", name(path)),
                path => format!("`{}` is not {noun}", name(path)),
            };
            // If the text is invalid JSON further on, the value is the last one read.
            let read = value.is_none() || path.is_empty();
            return if read { self.near(what, error) } else { self.fault(what, path) }.remedy(remedy);
        }
        self.no_json(path, message, error)
    }

    /// The fault for invalid JSON.
    fn no_json(self, path: &[&str], message: &str, error: &serde_json::Error) -> Fault {
        let (noun, remedy) = form(path);
        let at = |what: &str| match path {
            [] => what.to_owned(),
            path => format!("`{}`: {what}", name(path)),
        };
        let near = |what: &str| self.near(at(what), error);
        if self.text.trim().is_empty() {
            return Fault::new("empty file", self.file).remedy(remedy);
        }
        match message {
            "expected value" | "expected ident" | "invalid number" => {
                let word = self.word(error);
                if ["nan", "inf", "infinity"].contains(&word.trim_start_matches(['+', '-']).to_lowercase().as_str()) {
                    let fault = Fault::new(at(&format!("{word} is not a JSON number")), self.file);
                    return fault.at(Some(self.place(word))).remedy(remedy);
                }
                near(if noun == "a number" { "invalid JSON number" } else { "invalid JSON value" }).remedy(remedy)
            }
            message if message.starts_with("EOF") => {
                near("unexpected end of file").value("").remedy("the file may be truncated; write it again")
            }
            message if message.starts_with("control character") => {
                near("a line break, tab or other control character in a string")
                    .remedy("write it as `\\n`, `\\t` or `\\u` and four digits")
            }
            "invalid escape"
            | "invalid unicode code point"
            | "unexpected end of hex escape"
            | "lone leading surrogate in hex escape" => {
                near("invalid JSON escape").remedy("write letters unescaped, and a backslash twice")
            }
            "trailing comma" => near("trailing comma").remedy("remove it"),
            "key must be a string" => near("key without double quotes").remedy("put it in double quotes"),
            "trailing characters" if path.is_empty() => {
                near("trailing characters after the problem").remedy("give one problem per file")
            }
            "trailing characters" => near("expected `,` or `]`").remedy(remedy),
            message if message.starts_with("expected `,`") => {
                near(message).remedy("separate values by commas, and give numbers without units")
            }
            message => near(message).remedy(format!("give `{FORMAT}` as JSON")),
        }
    }

    /// The fault `what` of a key that was just read.
    fn of_key(self, what: &str, key: &str, error: &serde_json::Error) -> Fault {
        let end = self.offset(error);
        let start = end.saturating_sub(key.len() + 1);
        let opens = self.text.as_bytes().get(start) == Some(&b'"');
        Fault::new(what, self.file).at(Some(place_at(self.text, if opens { start } else { end })))
    }

    /// The fault `what` of the word at which the reader stopped.
    fn near(self, what: String, error: &serde_json::Error) -> Fault {
        let word = self.word(error);
        Fault::new(what, self.file).at(Some(self.place(word))).value(shortened(word))
    }

    /// The byte offset at which the reader stopped.
    fn offset(self, error: &serde_json::Error) -> usize {
        let before = self.text.split_inclusive('\n').take(error.line().saturating_sub(1)).map(str::len).sum::<usize>();
        let mut at = (before + error.column().saturating_sub(1)).min(self.text.len());
        while !self.text.is_char_boundary(at) {
            at -= 1;
        }
        at
    }

    /// The word or number at which the reader stopped, or else the character.
    fn word(self, error: &serde_json::Error) -> &'a str {
        let (before, after) = self.text.split_at(self.offset(error));
        let in_word = |c: char| c.is_alphanumeric() || "+-._".contains(c);
        let start = before.trim_end_matches(in_word).len();
        let end = self.text.len() - after.trim_start_matches(in_word).len();
        let letter = after.chars().next().map_or(0, char::len_utf8);
        &self.text[start..if end > start { end } else { start + letter }]
    }
}

/// The text of the value at `path` of a JSON text.
fn value_at<'t>(text: &'t str, path: &[&str]) -> Option<&'t str> {
    let Some((step, rest)) = path.split_first() else { return Some(text.trim()) };
    let value = serde_json::Deserializer::from_str(text).deserialize_any(Step(step)).ok()??;
    value_at(value.get(), rest)
}

/// A visitor for one step of a path: the first value of a key, or a list element.
struct Step<'p>(&'p str);

impl<'de> Visitor<'de> for Step<'_> {
    type Value = Option<&'de RawValue>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list or an object")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let before = self.0.parse().unwrap_or(usize::MAX);
        for _ in 0..before {
            if list.next_element::<IgnoredAny>()?.is_none() {
                return Ok(None);
            }
        }
        let found = list.next_element()?;
        while list.next_element::<IgnoredAny>()?.is_some() {}
        Ok(found)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Self::Value, A::Error> {
        let mut found = None;
        while let Some(key) = object.next_key::<String>()? {
            if key == self.0 && found.is_none() {
                found = Some(object.next_value()?);
            } else {
                object.next_value::<IgnoredAny>()?;
            }
        }
        Ok(found)
    }
}

/// A value on one line; only its start is copied, since printing truncates it.
fn shortened(value: &str) -> String {
    let start: String = value.chars().take(1000).collect();
    start.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A path in messages, as in `cloud[3][1]`.
fn name(path: &[&str]) -> String {
    path.iter().fold(String::new(), |name, step| match step.parse::<usize>() {
        Ok(index) => format!("{name}[{index}]"),
        Err(_) if name.is_empty() => (*step).to_owned(),
        Err(_) => format!("{name}.{step}"),
    })
}

/// The type of the value at `path`, and the remedy for another.
fn form(path: &[&str]) -> (&'static str, &'static str) {
    match path {
        ["format"] => ("a string", "give \"coherence-problem/1\", or \"coherence-problem/1.1\" with edges"),
        ["id"] => ("a string", "give a name in double quotes, or null"),
        ["model"] => {
            ("a list of points", "give the feature points in the object frame, three numbers x y z each, in metres")
        }
        ["cloud"] => {
            ("a list of points", "give the measured points in the camera frame, three numbers x y z each, in metres")
        }
        ["model" | "cloud", _] => ("a point", "give three numbers x y z, in metres"),
        ["model" | "cloud" | "sigma_xyz", _, _] => ("a number", "give a number, in metres"),
        ["sigma"] => ("a number", "give the standard deviation of a measured coordinate, a number in metres"),
        ["sigma_xyz"] => ("a list of rows", "give null, or one row of three numbers per cloud point, in metres"),
        ["sigma_xyz", _] => ("a row of three numbers", "give three numbers, one per camera axis, in metres"),
        ["delta"] => ("a number", "give the distance tolerance, a number in metres"),
        ["prior"] => ("an object", "give null, or `T_cam_obj` and `shell_half_m` in braces"),
        ["prior", "T_cam_obj"] => ("a matrix", "give a 4×4 matrix: four rows of four numbers"),
        ["prior", "T_cam_obj", _] => ("a row of four numbers", "give four numbers; the matrix is 4×4"),
        ["prior", "T_cam_obj", ..] => ("a number", "give a number; the matrix is 4×4"),
        ["prior", "shell_half_m"] => ("a number", "give the half-size of the gates, a number in metres"),
        ["putative"] => ("a list of pairs", "give null, or a list of pairs [model, cloud]"),
        ["putative", _] => ("a pair", "give two indices [model, cloud], counted from 0"),
        ["putative", ..] => ("an index", "give a whole number, counted from 0"),
        ["edges"] => ("a list of edges", "give the straight edges of the object, two ends each"),
        ["edges", _] => ("an edge", "give two ends in brackets"),
        ["edges", _, _] => {
            ("an end of an edge", "give three numbers x y z in metres, or the index of a model point, counted from 0")
        }
        ["lines"] => ("a list of lines", "give the measured lines, `ends` and `covariance` in braces each"),
        ["lines", _] => ("a line", "give `ends` and `covariance` in braces"),
        ["lines", _, "ends"] => ("two places", "give two places on the line, three numbers x y z each, in metres"),
        ["lines", _, "ends", _] => ("a place", "give three numbers x y z, in metres"),
        ["lines", _, "covariance"] => {
            ("a matrix", "give the covariance of the four offsets in square metres: four rows of four numbers")
        }
        ["lines", _, "covariance", _] => ("a row of four numbers", "give four numbers; the matrix is 4×4"),
        ["lines", _, _, ..] => ("a number", "give a number"),
        ["putative_edges"] => ("a list of pairs", "give null, or a list of pairs [edge, line]"),
        ["putative_edges", _] => ("a pair", "give two indices [edge, line], counted from 0"),
        ["putative_edges", ..] => ("an index", "give a whole number, counted from 0"),
        _ => ("a problem", "give one `coherence-problem/1` as JSON, in braces"),
    }
}
