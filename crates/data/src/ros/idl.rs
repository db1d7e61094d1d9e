//! Schemas in OMG's interface definition language (IDL), as ROS 2 writes them.

use super::definition::Definition;

/// The structures of a text by package and name, in `ros2msg` notation.
pub(super) fn definitions(text: &str) -> Vec<Definition> {
    let words = words(text);
    let (mut all, mut modules, mut at) = (Vec::new(), Vec::<&str>::new(), 0);
    while at < words.len() {
        match (words[at].as_str(), words.get(at + 1)) {
            ("module", Some(name)) => {
                modules.push(name);
                at += 3;
            }
            ("struct", Some(name)) => {
                let end = words[at..].iter().position(|word| word == "}").map_or(words.len(), |length| at + length);
                let package = modules.first().copied().unwrap_or_default();
                all.push((format!("{package}/{name}"), fields(&words[(at + 3).min(end)..end])));
                at = end + 2;
            }
            ("}", _) => {
                modules.pop();
                at += 1;
            }
            _ => at += 1,
        }
    }
    all
}

/// The fields between the braces of a structure.
fn fields(words: &[String]) -> Vec<(String, String)> {
    let one = |words: &[String]| {
        let (name, kind) = words.split_last()?;
        (!kind.is_empty()).then(|| (kind_of(kind), name.clone()))
    };
    words.split(|word| word == ";").filter_map(one).collect()
}

/// A type in `ros2msg` notation.
fn kind_of(words: &[String]) -> String {
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    match &words[..] {
        ["sequence", "<", rest @ .., ">"] => {
            let inner: Vec<String> =
                rest.iter().take_while(|word| **word != ",").map(|&word| word.to_owned()).collect();
            format!("{}[]", kind_of(&inner))
        }
        ["string", ..] => "string".to_owned(),
        ["octet"] => "uint8".to_owned(),
        ["boolean"] => "bool".to_owned(),
        ["double"] => "float64".to_owned(),
        ["float"] => "float32".to_owned(),
        ["long"] => "int32".to_owned(),
        ["unsigned", "long"] => "uint32".to_owned(),
        [array] if array.contains("__") => {
            // The name `double__9` denotes double[9].
            let (kind, count) = array.split_once("__").unwrap_or((array, ""));
            format!("{}[{count}]", kind_of(&[kind.to_owned()]))
        }
        [name] => name.rsplit("::").next().unwrap_or(name).to_owned(),
        other => other.join(" "),
    }
}

/// The words and signs of a text, without comments, directives and annotations.
fn words(text: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let skip_line = |rest: &str| rest.find('\n').map_or(rest.len(), |end| end + 1);
        if rest.starts_with("//") || first == '#' || rest.starts_with("====") || rest.starts_with("IDL:") {
            rest = &rest[skip_line(rest)..];
        } else if rest.starts_with("/*") {
            rest = &rest[rest.find("*/").map_or(rest.len(), |end| end + 2)..];
        } else if first == '@' {
            rest = behind_annotation(rest);
        } else if first.is_alphanumeric() || first == '_' {
            let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')).unwrap_or(rest.len());
            words.push(rest[..end].to_owned());
            rest = &rest[end..];
        } else {
            if !first.is_whitespace() {
                words.push(first.to_string());
            }
            rest = &rest[first.len_utf8()..];
        }
    }
    words
}

/// The text after an annotation, `@name` or `@name (…)` with quoted strings.
fn behind_annotation(text: &str) -> &str {
    let end = text[1..].find(|c: char| !(c.is_alphanumeric() || c == '_')).map_or(text.len(), |end| end + 1);
    let rest = text[end..].trim_start();
    if !rest.starts_with('(') {
        return &text[end..];
    }
    let (mut quoted, mut escaped) = (false, false);
    for (index, sign) in rest.char_indices() {
        match sign {
            _ if escaped => escaped = false,
            '\\' if quoted => escaped = true,
            '"' => quoted = !quoted,
            ')' if !quoted => return &rest[index + 1..],
            _ => {}
        }
    }
    ""
}

#[cfg(test)]
mod tests {
    use super::super::definition::differs;

    const INFO: &str = r#"
================================================================================
IDL: sensor_msgs/msg/CameraInfo
// generated
#include "std_msgs/msg/Header.idl"
module sensor_msgs { module msg {
  typedef double double__9[9];
  typedef double double__12[12];
  @verbatim (language="comment", text="A (strange) \"comment\"; struct" "next")
  struct CameraInfo {
    @verbatim (language="comment", text="Time")
    std_msgs::msg::Header header;
    uint32 height;
    uint32 width;
    string distortion_model;
    sequence<double> d;
    double__9 k;
    double__9 r;
    double__12 p;
    @unit (value="px")
    uint32 binning_x;
    uint32 binning_y;
    sensor_msgs::msg::RegionOfInterest roi;
  };
}; };
"#;

    #[test]
    fn structures_are_compared_field_by_field() {
        let of = |text: &str| differs("sensor_msgs/msg/CameraInfo", "ros2idl", text);
        assert_eq!(of(INFO), None);
        let message = of(&INFO.replace("sequence<double> d", "sequence<float> d")).unwrap();
        assert_eq!(message, "field 5 of sensor_msgs/CameraInfo is `float32[] d`, expected `float64[] d`");
    }
}
