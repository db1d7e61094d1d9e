//! Wording of messages: counts, numbers and type names.

use crate::suggest::nearest;

/// A count with its noun: `1 point`, `2 points`.
///
/// ```
/// assert_eq!([0, 1, 2].map(|n| seafix_component::counted(n, "point")), ["0 points", "1 point", "2 points"]);
/// ```
pub fn counted(n: usize, one: &str) -> String {
    format!("{n} {one}{}", if n == 1 { "" } else { "s" })
}

/// A number with at most four decimals or significant digits and no trailing zeros.
///
/// Very large and very small numbers have a power of ten.
///
/// ```
/// assert_eq!([0.0, -3.0, 1.23456, 0.04, 0.0034921].map(seafix_component::number), ["0", "-3", "1.2346", "0.04", "0.003492"]);
/// assert_eq!([1e300, 0.00012345, f64::NAN].map(seafix_component::number), ["1e300", "1.2345e-4", "NaN"]);
/// ```
pub fn number(x: f64) -> String {
    let short = |text: String| text.trim_end_matches('0').trim_end_matches('.').to_owned();
    match x.abs() {
        size if size == 0.0 || (0.1..1e6).contains(&size) => return short(format!("{x:.4}")),
        size if (1e-3..0.1).contains(&size) => return short(format!("{x:.6}")),
        _ => {}
    }
    let text = format!("{x:.4e}");
    text.split_once('e').map_or(text.clone(), |(digits, power)| format!("{}e{power}", short(digits.to_owned())))
}

/// The message of a deserialiser without Rust's type names: `expected u64` becomes `not a whole number of at least 0`.
///
/// ```
/// assert_eq!(
///     seafix_component::plain("invalid type: string \"many\", expected u64"),
///     "not a whole number of at least 0: string \"many\""
/// );
/// assert_eq!(
///     seafix_component::plain("unknown variant `reed`, expected one of `red`, `green`"),
///     "unknown word `reed`, did you mean `red`? There are `red`, `green`"
/// );
/// ```
pub fn plain(message: &str) -> String {
    let message = message.trim_end().lines().next().unwrap_or_default();
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    if let Some((word, known)) = quoted.split_first().filter(|_| message.starts_with("unknown variant")) {
        let all = known.iter().map(|word| format!("`{word}`")).collect::<Vec<_>>().join(", ");
        return match nearest(word, known.iter().copied()) {
            Some(near) => format!("unknown word `{word}`, did you mean `{near}`? There are {all}"),
            None => format!("unknown word `{word}`; there are {all}"),
        };
    }
    if let (Some(field), true) = (quoted.first(), message.starts_with("missing field")) {
        return format!("`{field}` is missing");
    }
    if message.starts_with("data did not match any variant") {
        return "a value of an unsupported form".to_owned();
    }
    let kinds = ["invalid type: ", "invalid value: ", "invalid length "];
    let found = kinds.iter().find_map(|kind| message.strip_prefix(kind)?.rsplit_once(", expected "));
    match found {
        Some((found, expected)) => {
            let found = found.replace("floating point", "number").replace("integer", "number");
            let found = found.replace("sequence", "a list").replace("map", "a table");
            let found = match found.strip_suffix(" variant") {
                Some("unit") => "a value without quotes".to_owned(),
                Some(_) => "a word with a value".to_owned(),
                None => found,
            };
            let values = if message.starts_with("invalid length") { " values" } else { "" };
            format!("not {}: {found}{values}", kind(expected))
        }
        None => message.to_owned(),
    }
}

/// The description of an expected type, by the deserialiser's name for it.
fn kind(expected: &str) -> String {
    let length = |start: &str, end: &str| expected.strip_prefix(start)?.strip_suffix(end).map(str::to_owned);
    let many = length("an array of length ", "").or_else(|| length("a tuple of size ", ""));
    if let Some(many) = many.or_else(|| length("array of ", " elements")) {
        return format!("a list of {many} values");
    }
    let known = match expected {
        "u8" => "a whole number from 0 to 255",
        "u16" => "a whole number from 0 to 65535",
        "u32" => "a whole number from 0 to 4294967295",
        "u64" | "u128" | "usize" => "a whole number of at least 0",
        "i8" | "i16" | "i32" | "i64" | "i128" | "isize" => "a whole number",
        "f32" | "f64" => "a number",
        "a boolean" => "true or false",
        "a string" | "string" | "string only" | "str" => "a text in quotes",
        "a sequence" => "a list",
        "a map" | "any TOML table" => "a table",
        other if other.starts_with("struct ") => "a table",
        other if other.starts_with("tuple struct ") => "a list",
        other if other.starts_with("a nonzero ") => "a whole number of at least 1",
        // Such as `enum Gate` or `unit variant Gate::Open`.
        other if other.contains("enum ") || other.contains("variant ") => "one of the accepted words",
        other => other,
    };
    known.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    #[expect(dead_code, reason = "only their errors matter")]
    enum Lens {
        Pinhole,
        FishEye { order: u8 },
    }

    #[derive(Debug, Deserialize)]
    #[expect(dead_code, reason = "only their errors matter")]
    struct Settings {
        budget: u64,
        size: [u32; 2],
        lens: Lens,
        on: bool,
        name: String,
    }

    /// The message for an invalid value of one setting among valid ones.
    fn said(key: &str, wrong: &str) -> String {
        let mut all: toml::Table =
            toml::from_str("budget = 1\nsize = [1, 2]\nlens = 'pinhole'\non = true\nname = 'n'").unwrap();
        let wrong: toml::Table = toml::from_str(&format!("x = {wrong}")).unwrap();
        all.insert(key.to_owned(), wrong["x"].clone());
        plain(all.try_into::<Settings>().unwrap_err().message())
    }

    #[test]
    fn no_type_of_rust_is_named() {
        assert_eq!(said("budget", "-1"), "not a whole number of at least 0: number `-1`");
        assert_eq!(said("budget", "1.5"), "not a whole number of at least 0: number `1.5`");
        assert_eq!(said("budget", "[1]"), "not a whole number of at least 0: a list");
        assert_eq!(said("size", "[1]"), "not a list of 2 values: 1 values");
        assert_eq!(said("size", "[1, -2]"), "not a whole number from 0 to 4294967295: number `-2`");
        assert_eq!(said("on", "1"), "not true or false: number `1`");
        assert_eq!(said("name", "1"), "not a text in quotes: number `1`");
        assert_eq!(
            said("lens", "'pinhol'"),
            "unknown word `pinhol`, did you mean `pinhole`? There are `pinhole`, `fish-eye`"
        );
        for wrong in ["7", "{ fish-eye = 3 }", "{ fish-eye = { order = 999 } }", "{ fish-eye = {} }"] {
            let said = said("lens", wrong);
            let types = ["u8", "struct", "enum", "variant", "Lens", "Settings", "invalid"];
            assert!(types.iter().all(|name| !said.contains(name)), "{wrong}: {said}");
        }
    }
}
