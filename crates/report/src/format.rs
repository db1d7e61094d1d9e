//! Numbers and names as people read them.

/// The last part of a dotted key: `source.distance` is the distance.
pub(crate) fn short(key: &str) -> &str {
    key.rsplit('.').next().unwrap_or(key)
}

/// The unit of an axis that has a known one.
pub(crate) fn unit(key: &str) -> Option<&'static str> {
    match short(key) {
        "distance" | "baseline" => Some("m"),
        "sigma-px" | "sigma_px" | "pixel-sigma" => Some("px"),
        _ => None,
    }
}

/// A key with its unit, as the head of a column.
pub(crate) fn headed(key: &str) -> String {
    match unit(key) {
        Some(unit) => format!("{} ({unit})", short(key)),
        None => short(key).to_owned(),
    }
}

/// A number with this many decimals; a dash where there is none, ∞ beyond all bounds.
pub(crate) fn number(value: Option<f64>, decimals: usize) -> String {
    match value {
        None => "–".to_owned(),
        Some(value) if value == f64::INFINITY => "∞".to_owned(),
        Some(value) => format!("{value:.decimals$}").replace('-', "−"),
    }
}

/// As many decimals as the smallest of `values` needs for two digits, the same for a whole column.
pub(crate) fn decimals(values: impl IntoIterator<Item = f64>) -> usize {
    let least = values.into_iter().filter(|x| x.is_finite() && *x > 0.0).fold(f64::INFINITY, f64::min);
    match least {
        x if x < 0.1 => 3,
        x if x < 1.0 => 2,
        x if x < 100.0 => 1,
        _ => usize::from(least == f64::INFINITY),
    }
}

/// `k` of `n` in percent.
pub(crate) fn percent(k: usize, n: usize) -> String {
    if n == 0 { "–".to_owned() } else { format!("{:.1}", 100.0 * k as f64 / n as f64) }
}

/// The exact 95 % interval of the rate `k` of `n`, in percent.
pub(crate) fn interval(k: usize, n: usize) -> String {
    if n == 0 {
        return "–".to_owned();
    }
    let (low, high) = seafix_evaluation::clopper_pearson(k, n, 0.95);
    format!("[{:.1}, {:.1}]", 100.0 * low, 100.0 * high)
}

/// A word for a count.
pub(crate) fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_keep_two_digits_of_their_least() {
        assert_eq!(decimals([0.4, 12.0]), 2);
        assert_eq!(decimals([4.0, 12.0]), 1);
        assert_eq!(decimals([f64::INFINITY]), 1);
        assert_eq!(decimals([140.0]), 0);
        assert_eq!(number(Some(-0.5), 1), "−0.5");
        assert_eq!(number(Some(f64::INFINITY), 1), "∞");
    }
}
