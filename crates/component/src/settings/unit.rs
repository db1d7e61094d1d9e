//! The unit of a setting, from its sentence.

use super::form::Form;

/// The units of settings, as they stand in parentheses.
const UNITS: &[&str] = &[
    "px",
    "px²",
    "binned pixels",
    "m",
    "mm",
    "m²",
    "1/m",
    "m/s",
    "m/s²",
    "m/√s",
    "m/√m",
    "m/s/√s",
    "s",
    "ms",
    "1/s",
    "1/s²",
    "1/s³",
    "Hz",
    "rad",
    "rad/s",
    "rad/√s",
    "rad/s/√s",
    "degrees",
    "degrees/s",
    "degrees/h",
    "degrees/√h",
    "degrees/s/√s",
    "W",
    "%",
    "grey levels",
    "grey levels²",
    "electrons",
    "bits",
    "bytes",
    "samples",
];

/// Words that denote a number without unit.
const PURE: &[&str] = &[
    "fraction",
    "probability",
    "ratio",
    "factor",
    "confidence",
    "relative",
    "number",
    "gain",
    "albedo",
    "correlation",
    "weight",
    "multiple",
    "coefficients",
    "logarithm",
    "sine",
    "cosine",
    "direction",
    "directions",
    "normals",
    "index",
    "constant",
    "cos",
    "tangent",
];

/// The unit of a setting with this sentence and range: a unit, `1` for a pure number, `None` if none is stated.
pub(super) fn unit(form: &Form, doc: &str, range: &str) -> Option<&'static str> {
    let form = match form {
        Form::List { of, .. } => of,
        Form::OneOf(forms) => {
            forms.iter().find(|form| matches!(form, Form::Number | Form::Integer { .. })).unwrap_or(form)
        }
        form => form,
    };
    if !matches!(form, Form::Number | Form::Integer { .. } | Form::List { .. }) {
        return Some("");
    }
    let stated = [doc, range].into_iter().find_map(|text| parentheses(text).find_map(known));
    let pure = || {
        let words = |text: &str| text.split(|c: char| !c.is_alphanumeric()).map(str::to_lowercase).collect::<Vec<_>>();
        let is_pure = words(doc).iter().chain(&words(range)).any(|word| PURE.contains(&word.as_str()));
        (is_pure || matches!(form, Form::Integer { .. })).then_some("1")
    };
    stated.or_else(pure)
}

fn known(text: &str) -> Option<&'static str> {
    // `(m, one standard deviation)` begins with the unit.
    let first = text.split([',', ';']).next().unwrap_or(text).trim();
    UNITS.iter().find(|unit| first == **unit).copied()
}

/// The parts of a text in parentheses.
fn parentheses(text: &str) -> impl Iterator<Item = &str> {
    text.split('(').skip(1).filter_map(|rest| rest.split_once(')').map(|(inside, _)| inside))
}
