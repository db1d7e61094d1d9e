//! Axes: scales and ticks.

use crate::format;

/// An axis of a panel.
#[derive(Debug, Clone, Default)]
pub(crate) struct Axis {
    /// The quantity and its unit.
    pub(crate) label: String,
    pub(crate) logarithmic: bool,
    /// The ticks; chosen automatically if empty.
    pub(crate) ticks: Vec<f64>,
    /// The labels of the ticks 0, 1, 2, … of an axis of names.
    pub(crate) names: Vec<String>,
    /// The range; that of the values for `None`.
    pub(crate) range: Option<[f64; 2]>,
}

/// An axis with its range, mapped to an interval of the sheet.
#[derive(Debug, Clone)]
pub(crate) struct Scale {
    pub(crate) axis: Axis,
    ends: [f64; 2],
    place: [f64; 2],
}

impl Axis {
    pub(crate) fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    pub(crate) fn logarithmic(label: impl Into<String>) -> Self {
        Self { label: label.into(), logarithmic: true, ..Self::default() }
    }

    pub(crate) fn within(mut self, range: [f64; 2]) -> Self {
        self.range = Some(range);
        self
    }

    pub(crate) fn at(mut self, ticks: Vec<f64>) -> Self {
        self.ticks = ticks;
        self
    }

    pub(crate) fn named(label: impl Into<String>, names: Vec<String>) -> Self {
        let range = Some([-0.6, names.len() as f64 - 0.4]);
        Self { label: label.into(), names, range, ..Self::default() }
    }

    /// The range of `values` with a margin.
    pub(crate) fn ends(&self, values: impl Iterator<Item = f64>) -> [f64; 2] {
        if let Some(range) = self.range {
            return if self.logarithmic { range.map(f64::log10) } else { range };
        }
        let usable =
            values.chain(self.ticks.iter().copied()).filter(|v| v.is_finite() && (!self.logarithmic || *v > 0.0));
        let usable = usable.map(|v| if self.logarithmic { v.log10() } else { v });
        let [low, high] = usable.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
        if low > high {
            return [0.0, 1.0];
        }
        let margin = if high > low {
            0.06 * (high - low)
        } else if self.logarithmic {
            // With this half range two of the ticks 1, 2, 5 of the decades are always in view.
            0.36
        } else {
            0.5
        };
        [low - margin, high + margin]
    }
}

impl Scale {
    pub(crate) fn new(axis: Axis, ends: [f64; 2], place: [f64; 2]) -> Self {
        Self { axis, ends, place }
    }

    /// The position of `value` on the sheet; values out of range are clamped.
    pub(crate) fn at(&self, value: f64) -> f64 {
        let value = if self.axis.logarithmic { if value > 0.0 { value.log10() } else { self.ends[0] } } else { value };
        let fraction = ((value - self.ends[0]) / (self.ends[1] - self.ends[0])).clamp(0.0, 1.0);
        self.place[0] + fraction * (self.place[1] - self.place[0])
    }

    /// The interval on the sheet.
    pub(crate) fn interval(&self) -> [f64; 2] {
        self.place
    }

    /// Whether `value` is within the range.
    pub(crate) fn holds(&self, value: f64) -> bool {
        let value = if self.axis.logarithmic { value.log10() } else { value };
        value >= self.ends[0] - 1e-9 && value <= self.ends[1] + 1e-9
    }

    /// The ticks in view.
    pub(crate) fn ticks(&self) -> Vec<f64> {
        let max = (self.place[1] - self.place[0]).abs() / 32.0;
        let ticks = if !self.axis.names.is_empty() {
            (0..self.axis.names.len()).map(|i| i as f64).collect()
        } else if !self.axis.ticks.is_empty() {
            self.axis.ticks.clone()
        } else if self.axis.logarithmic {
            let decades = decades(self.ends);
            // A range with fewer than two decade ticks gets linear ticks.
            let few = decades.iter().filter(|tick| self.holds(**tick)).count() < 2;
            if few { steps(self.ends.map(|end| 10_f64.powf(end)), max) } else { decades }
        } else {
            steps(self.ends, max)
        };
        ticks.into_iter().filter(|tick| self.holds(*tick)).collect()
    }

    /// The label of a tick.
    pub(crate) fn label(&self, tick: f64) -> String {
        match self.axis.names.get(tick as usize) {
            Some(name) if !self.axis.names.is_empty() => name.clone(),
            _ => tick_text(tick),
        }
    }
}

/// The ticks 1, 2, 5 of every decade in view, or powers of ten only for many decades.
fn decades([low, high]: [f64; 2]) -> Vec<f64> {
    let steps: &[f64] = match high - low {
        width if width > 2.2 => &[1.0],
        width if width > 1.1 => &[1.0, 3.0],
        _ => &[1.0, 2.0, 5.0],
    };
    let decades = low.floor() as i32..=high.ceil() as i32;
    let every = if high - low > 6.5 { 2 } else { 1 };
    decades
        .filter(|decade| decade.rem_euclid(every) == 0)
        .flat_map(|decade| steps.iter().map(move |step| step * 10_f64.powi(decade)))
        .collect()
}

/// At most `max` ticks with a round step: 1, 2 or 5 times a power of ten.
fn steps([low, high]: [f64; 2], max: f64) -> Vec<f64> {
    let wanted = (high - low) / max.max(2.0);
    let power = 10_f64.powi(wanted.log10().floor() as i32);
    let step = [1.0, 2.0, 5.0, 10.0].map(|s| s * power).into_iter().find(|s| *s >= wanted).unwrap_or(wanted);
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    (first..=last).map(|i| i as f64 * step).collect()
}

/// The text of a tick without trailing zeros.
///
/// Very large and very small values have a power of ten.
pub(crate) fn tick_text(tick: f64) -> String {
    let size = tick.abs();
    if size >= 1e5 || (size > 0.0 && size < 1e-4) {
        let power = size.log10().floor();
        let lead = tick / 10_f64.powf(power);
        return format!("{lead:.0}e{power:.0}").replace('-', "−");
    }
    let text = format!("{tick:.5}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    format::number(text.parse().ok(), text.split_once('.').map_or(0, |(_, decimals)| decimals.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round() {
        assert_eq!(steps([0.1, 9.7], 5.0), [2.0, 4.0, 6.0, 8.0]);
        assert_eq!(decades([0.0, 1.0]), [1.0, 2.0, 5.0, 10.0, 20.0, 50.0]);
        assert_eq!([0.02, 100.0, -3.5, 1e6].map(tick_text), ["0.02", "100", "−3.5", "1e6"]);
    }

    #[test]
    fn a_narrow_logarithmic_axis_has_numbers_too() {
        let scale = Scale::new(Axis::logarithmic("x"), [0.62_f64, 0.88].map(f64::log10), [0.0, 160.0]);
        let labels: Vec<_> = scale.ticks().into_iter().map(|tick| scale.label(tick)).collect();
        assert_eq!(labels, ["0.7", "0.8"]);
    }

    #[test]
    fn values_beyond_the_ends_stand_on_them() {
        let scale = Scale::new(Axis::logarithmic("x"), [0.0, 2.0], [0.0, 100.0]);
        assert_eq!([10.0, 1e9, 0.0, f64::INFINITY].map(|v| scale.at(v)), [50.0, 100.0, 0.0, 100.0]);
    }
}
