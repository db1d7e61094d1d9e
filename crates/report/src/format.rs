//! The printed form of numbers and names.

/// The value of an axis; a number is preceded by the name of the axis.
pub(crate) fn condition(axis: &seafix_log::Axis) -> String {
    match axis.value.parse::<f64>() {
        Ok(_) => placed(&axis.key, &axis.value),
        Err(_) => axis.value.clone(),
    }
}

/// A value of an axis with the name of the axis, and its unit if that is known.
pub(crate) fn placed(key: &str, value: &str) -> String {
    match unit(key) {
        Some(unit) => format!("{} {value} {unit}", short(key)),
        None => format!("{} {value}", short(key)),
    }
}

/// The short name of a dotted key: `distance` for `source.distance`, `tolerance` for `pipeline.tolerance.fixed`.
pub(crate) fn short(key: &str) -> &str {
    let kind = [".fixed", ".sigmas"].into_iter().find_map(|kind| key.strip_suffix(kind));
    let key = kind.filter(|key| key.ends_with("tolerance")).unwrap_or(key);
    match key.rsplit('.').next().unwrap_or(key) {
        // The policy's name of the time between fixes, which is no name of a quantity.
        "seconds" => "interval",
        last => last,
    }
}

/// The unit of an axis; `None` if it has no known unit.
pub(crate) fn unit(key: &str) -> Option<&'static str> {
    match short(key) {
        "tolerance" => key.ends_with(".fixed").then_some("m"),
        "distance" | "baseline" | "altitude" | "shift" => Some("m"),
        "attenuation" => Some("1/m"),
        "speed" => Some("m/s"),
        "interval" => Some("s"),
        "outliers" => Some("%"),
        "sigma-px" | "sigma_px" | "pixel-sigma" => Some("px"),
        _ => None,
    }
}

/// A name in a sentence: one of several words in quotation marks, so that it is read as one.
pub(crate) fn quoted(name: &str) -> String {
    if name.contains(' ') { format!("“{name}”") } else { name.to_owned() }
}

/// Whether a larger value of an axis makes the task harder.
///
/// Such axes describe the environment, not the settings of the method.
pub(crate) fn harder(key: &str) -> bool {
    let name = short(key);
    let words =
        ["clutter", "outliers", "noise", "attenuation", "turbidity", "distance", "altitude", "speed", "occlusion"];
    words.contains(&name) || matches!(unit(key), Some("px"))
}

/// The head of a column: the short name of a key with its unit.
pub(crate) fn headed(key: &str) -> String {
    match unit(key) {
        Some(unit) => format!("{} ({unit})", short(key)),
        None => short(key).to_owned(),
    }
}

/// A number with `decimals` decimals; a dash for `None` and NaN, ∞ for infinity.
pub(crate) fn number(value: Option<f64>, decimals: usize) -> String {
    match value {
        None => "–".to_owned(),
        Some(value) if value.is_nan() => "–".to_owned(),
        Some(value) if value == f64::INFINITY => "∞".to_owned(),
        Some(value) if value == f64::NEG_INFINITY => "−∞".to_owned(),
        Some(value) => {
            let text = format!("{value:.decimals$}");
            // A number that rounds to zero has no sign.
            let zero = text.trim_start_matches('-').chars().all(|c| matches!(c, '0' | '.'));
            if zero { text.trim_start_matches('-').to_owned() } else { text.replace('-', "−") }
        }
    }
}

/// A probability with four decimals, or with an exponent below 0.001.
pub(crate) fn probability(value: f64) -> String {
    if value > 0.0 && value < 1e-3 { format!("{value:.1e}").replace('-', "−") } else { number(Some(value), 4) }
}

/// The number of decimals of a column: enough for two digits of the smallest positive value.
pub(crate) fn decimals(values: impl IntoIterator<Item = f64>) -> usize {
    let min = values.into_iter().filter(|x| x.is_finite() && *x > 0.0).fold(f64::INFINITY, f64::min);
    match min {
        x if x < 0.1 => 3,
        x if x < 1.0 => 2,
        x if x < 100.0 => 1,
        _ => usize::from(min == f64::INFINITY),
    }
}

/// A number without trailing zeros.
pub(crate) fn trimmed(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').replace('-', "−")
}

/// A count with its noun in singular or plural.
pub(crate) fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// The distinct texts in the order of their first appearance.
pub(crate) fn distinct(texts: impl IntoIterator<Item = String>) -> Vec<String> {
    let mut seen = Vec::new();
    for text in texts {
        if !seen.contains(&text) {
            seen.push(text);
        }
    }
    seen
}

/// `text` with a capital first letter.
pub(crate) fn sentence_case(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_keep_two_digits_of_their_smallest() {
        assert_eq!(decimals([0.4, 12.0]), 2);
        assert_eq!(decimals([4.0, 12.0]), 1);
        assert_eq!(decimals([f64::INFINITY]), 1);
        assert_eq!(decimals([140.0]), 0);
        assert_eq!(number(Some(-0.5), 1), "−0.5");
        assert_eq!(number(Some(f64::INFINITY), 1), "∞");
        assert_eq!(
            [0.0, 1.14e-5, 9.6e-4, 1e-3, 1.0].map(probability),
            ["0.0000", "1.1e−5", "9.6e−4", "0.0010", "1.0000"]
        );
    }
}
