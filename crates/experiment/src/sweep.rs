//! Parameter sweeps: axes, their grid, and changed settings.

use std::{borrow::Cow, collections::HashSet, path::Path};

use seafix::PipelineSettings;
use seafix_component::{Fault, Part, Settings};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::range::Range;

/// An axis `[[vary]]` of the grid; exactly one of its lists of values is given.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Axis {
    /// The setting as a dotted path: `source.distance`, `pipeline.solver`. With `cases` and `zip` it is only the name
    /// of the axis.
    pub key: String,
    /// The values.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub values: Vec<toml::Value>,
    /// Numbers in equal steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<Range>,
    /// Numbers in equal ratios.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_range: Option<Range>,
    /// Named cases that set several settings together.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cases: Vec<Case>,
    /// Lists of equal length, each by the dotted path of its setting: point k of the axis takes the k-th value of every
    /// list.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub zip: toml::Table,
}

/// A named set of settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// The name in tables.
    pub label: String,
    /// The value of each setting, by its dotted path.
    pub set: toml::Table,
}

/// The value of a trial on one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisValue {
    /// The axis.
    pub key: String,
    /// The value, or the name of the case.
    pub value: toml::Value,
    /// The settings by dotted path.
    pub(crate) set: Vec<(String, toml::Value)>,
    /// The index of the value on the axis.
    number: usize,
}

impl Axis {
    /// An axis of listed values.
    pub(crate) fn listed(key: &str, values: Vec<toml::Value>) -> Self {
        Self { key: key.to_owned(), values, ..Self::default() }
    }

    fn places(&self) -> Vec<AxisValue> {
        let one = |(number, value): (usize, &toml::Value)| AxisValue {
            key: self.key.clone(),
            value: value.clone(),
            set: vec![(self.key.clone(), value.clone())],
            number,
        };
        let several = |(number, case): (usize, &Case)| AxisValue {
            key: self.key.clone(),
            value: case.label.clone().into(),
            set: case.set.iter().map(|(key, value)| (key.clone(), value.clone())).collect(),
            number,
        };
        let ranges = self.range.iter().flat_map(Range::even).chain(self.log_range.iter().flat_map(Range::geometric));
        let numbers: Vec<toml::Value> = ranges.collect();
        let listed = self.values.iter().enumerate().chain(numbers.iter().enumerate()).map(one);
        listed.chain(self.cases.iter().enumerate().map(several)).chain(self.zipped()).collect()
    }

    fn zipped(&self) -> Vec<AxisValue> {
        let lists: Vec<(&String, &[toml::Value])> =
            self.zip.iter().filter_map(|(key, list)| Some((key, list.as_array()?.as_slice()))).collect();
        let length = lists.iter().map(|(_, list)| list.len()).min().unwrap_or(0);
        let place = |k: usize| {
            let set: Vec<(String, toml::Value)> =
                lists.iter().map(|(key, list)| ((*key).clone(), list[k].clone())).collect();
            let words = set.iter().map(|(_, value)| value.as_str().map_or_else(|| value.to_string(), str::to_owned));
            AxisValue { key: self.key.clone(), value: words.collect::<Vec<_>>().join(", ").into(), set, number: k }
        };
        (0..length).map(place).collect()
    }

    /// The settings that the axis varies.
    fn keys(&self) -> impl Iterator<Item = &str> {
        let own = (self.cases.is_empty() && self.zip.is_empty()).then_some(&self.key);
        own.into_iter()
            .chain(self.cases.iter().flat_map(|case| case.set.keys()))
            .chain(self.zip.keys())
            .map(String::as_str)
    }

    /// Whether the axis varies this setting or one below it.
    pub(crate) fn touches(&self, path: &str) -> bool {
        self.keys().any(|key| key == path || key.strip_prefix(path).is_some_and(|below| below.starts_with('.')))
    }

    /// Whether its ranges are valid and so finite.
    pub(crate) fn is_bounded(&self) -> bool {
        let fits = |range: &Option<Range>, ratios| range.as_ref().is_none_or(|range| range.check(ratios).is_ok());
        fits(&self.range, false) && fits(&self.log_range, true)
    }

    /// The places of `key` and of its value in the file, for point `number` of the axis.
    fn written(&self, number: usize, key: &str) -> ((Vec<String>, Part), Vec<String>) {
        let path = |steps: &[&str]| steps.iter().map(|&step| step.to_owned()).collect::<Vec<_>>();
        let number = number.to_string();
        if !self.cases.is_empty() {
            let case = path(&["cases", &number, "set", key]);
            return ((case.clone(), Part::Key), case);
        }
        if !self.zip.is_empty() {
            return ((path(&["zip", key]), Part::Key), path(&["zip", key, &number]));
        }
        let value = match (&self.range, &self.log_range) {
            (Some(_), _) => path(&["range"]),
            (_, Some(_)) => path(&["log-range"]),
            _ => path(&["values", &number]),
        };
        // The name of the axis is the value of its key.
        ((path(&["key"]), Part::Value), value)
    }
}

/// The place in the file of the setting at `path`, if an axis sets it at this grid point.
pub(crate) fn written(axes: &[Axis], cell: &[AxisValue], path: &[String], part: Part) -> Option<(Vec<String>, Part)> {
    // The last axis has priority.
    for place in cell.iter().rev() {
        let Some((index, axis)) = axes.iter().enumerate().find(|(_, axis)| axis.key == place.key) else { continue };
        for (key, _) in &place.set {
            let steps: Vec<&str> = key.split('.').collect();
            let shared = steps.iter().zip(path).take_while(|(own, step)| *own == step).count();
            if shared < steps.len().min(path.len()) {
                continue;
            }
            let ((own, what), value) = axis.written(place.number, key);
            let is_key = part == Part::Key && path.len() <= steps.len();
            let (inside, part) = if is_key { (own, what) } else { (value, part) };
            let below = path.iter().skip(steps.len()).cloned();
            let full = ["vary".to_owned(), index.to_string()].into_iter().chain(inside).chain(below).collect();
            return Some((full, part));
        }
    }
    None
}

/// A point of the grid: one value on each axis, in the order of the axes.
pub(crate) type Cell = Vec<AxisValue>;

/// The number of points of the grid, of an experiment that is repeated; `None` beyond [`MAX_TRIALS`].
pub(crate) fn size(axes: &[Axis], repetitions: u32) -> Option<usize> {
    let lengths = axes.iter().map(|axis| axis.places().len()).chain([repetitions as usize]);
    lengths.into_iter().try_fold(1_usize, usize::checked_mul).filter(|size| *size <= MAX_TRIALS)
}

/// The maximum number of trials of an experiment. Each occupies some kilobytes, so that all fit into some hundred
/// megabytes.
pub(crate) const MAX_TRIALS: usize = 50_000;

/// All points of the grid, with the last axis fastest; one empty point without axes.
pub(crate) fn grid(axes: &[Axis]) -> Vec<Cell> {
    axes.iter().fold(vec![Vec::new()], |cells, axis| {
        cells
            .iter()
            .flat_map(|cell| {
                axis.places().into_iter().map(move |place| {
                    let mut longer = cell.clone();
                    longer.push(place);
                    longer
                })
            })
            .collect()
    })
}

/// Applies `settings` to `full`: each is `key=value` with a dotted key and a TOML value.
///
/// A setting of the pipeline may have the prefix `pipeline.` or not, whatever `full` is, so that the remedies of
/// rejected attempts hold for every command.
///
/// # Errors
/// The invalid setting, with `example` as a valid one.
pub fn changed<T: Serialize + DeserializeOwned>(
    full: &T,
    flag: &str,
    settings: &[String],
    example: &str,
) -> Result<T, Vec<Fault>> {
    let fault = |what: String, setting: &str| {
        let fault = Fault::new(what, Path::new(flag)).value(setting);
        vec![fault.remedy(format!("write key=value, for instance {example}"))]
    };
    let mut table = toml::Table::try_from(full).expect("settings are a table of plain values");
    for setting in settings {
        let (key, value) = setting.split_once('=').ok_or_else(|| fault("no `=`".to_owned(), setting))?;
        let value = toml::from_str::<toml::Table>(&format!("value = {value}"))
            .ok()
            .and_then(|mut table| table.remove("value"))
            .unwrap_or_else(|| value.trim().into());
        let key = placed(&table, key.trim());
        set(&mut table, &key, value).map_err(|message| fault(message, setting))?;
    }
    table.try_into().map_err(|error: toml::de::Error| {
        // The first change after which the settings are wrong.
        let earlier = (1..settings.len()).find_map(|count| changed(full, flag, &settings[..count], example).err());
        earlier.unwrap_or_else(|| {
            let fault = Fault::in_toml(Path::new(flag), "", &error);
            let setting = settings.last().filter(|_| fault.value.is_empty());
            vec![setting.map_or_else(|| fault.clone(), |setting| fault.clone().value(setting))]
        })
    })
}

/// The path of a setting of the pipeline: with `pipeline.` if `table` has a pipeline, else without.
fn placed<'k>(table: &toml::Table, key: &'k str) -> Cow<'k, str> {
    let first = |key: &'k str| key.split('.').next().unwrap_or(key);
    match table.get("pipeline").and_then(toml::Value::as_table) {
        Some(pipeline) if !table.contains_key(first(key)) && pipeline.contains_key(first(key)) => {
            Cow::Owned(format!("pipeline.{key}"))
        }
        None => Cow::Borrowed(key.strip_prefix("pipeline.").unwrap_or(key)),
        Some(_) => Cow::Borrowed(key),
    }
}

/// Applies `settings` to a pipeline.
///
/// # Errors
/// The invalid setting.
pub fn changed_pipeline(pipeline: &PipelineSettings, settings: &[String]) -> Result<PipelineSettings, Vec<Fault>> {
    changed(&pipeline.resolved().unwrap_or_else(|_| pipeline.clone()), "--set", settings, "detector.sigma=1.5")
}

/// Sets `value` at the dotted path `key`. A component given by its bare name becomes a table first, so that one of its
/// settings can vary.
///
/// # Errors
/// A part of the path that is neither a table nor a component's name.
pub(crate) fn set(table: &mut toml::Table, key: &str, value: toml::Value) -> Result<(), String> {
    let (path, last) = key.rsplit_once('.').unwrap_or(("", key));
    let mut here = table;
    for step in path.split('.').filter(|step| !step.is_empty()) {
        let entry = here.entry(step.to_owned()).or_insert_with(|| toml::Table::new().into());
        if let toml::Value::String(name) = entry {
            let mut component = toml::Table::new();
            component.insert("name".to_owned(), name.clone().into());
            *entry = component.into();
        }
        here = entry.as_table_mut().ok_or_else(|| format!("`{step}` in `{key}` is not a table"))?;
    }
    here.insert(last.to_owned(), value);
    Ok(())
}

/// The name of a trial: its number and its axis values, valid as a file name.
pub(crate) fn name(number: usize, cell: &Cell) -> String {
    let mut name = format!("{number:03}");
    for AxisValue { key, value, .. } in cell {
        let key = key.rsplit('.').next().unwrap_or(key);
        let value = match value {
            toml::Value::String(text) => text.clone(),
            toml::Value::Table(table) => table.get("name").and_then(|n| n.as_str()).unwrap_or("table").to_owned(),
            other => other.to_string(),
        };
        name += &format!("-{key}-{value}");
    }
    name.chars().map(|c| if c.is_ascii_alphanumeric() || ".-_".contains(c) { c } else { '_' }).take(120).collect()
}

/// The faults of axes: without values, or setting something twice.
pub(crate) fn check(axes: &[Axis], fault: impl Fn(&[&str], Part, &str) -> Fault) -> Vec<Fault> {
    let mut faults = Vec::new();
    for (index, axis) in axes.iter().enumerate() {
        let place = index.to_string();
        let given: Vec<&str> = [
            ("values", !axis.values.is_empty()),
            ("range", axis.range.is_some()),
            ("log-range", axis.log_range.is_some()),
            ("cases", !axis.cases.is_empty()),
            ("zip", !axis.zip.is_empty()),
        ]
        .into_iter()
        .filter_map(|(name, given)| given.then_some(name))
        .collect();
        match given[..] {
            [] => {
                let fault = fault(&["vary", &place, "values"], Part::Key, "an axis without values");
                faults.push(fault.remedy("give values, range, log-range, cases or zip"));
            }
            [_] => {}
            [.., last] => {
                let what = format!("an axis with {}", given.join(" and "));
                faults.push(fault(&["vary", &place, last], Part::Key, &what).remedy("give each an axis of its own"));
            }
        }
        for (name, range, log) in [("range", &axis.range, false), ("log-range", &axis.log_range, true)] {
            if let Some(Err((key, what))) = range.as_ref().map(|range| range.check(log)) {
                faults.push(fault(&["vary", &place, name, key], Part::Value, &what));
            }
        }
        faults.extend(zip_fault(axis).map(|(key, what)| fault(&["vary", &place, "zip", key], Part::Value, &what)));
        let labels: Vec<&str> = axis.cases.iter().map(|case| case.label.as_str()).collect();
        for twice in (1..labels.len()).filter(|&k| labels[..k].contains(&labels[k])) {
            let path = ["vary", &place, "cases", &twice.to_string(), "label"];
            let fault = fault(&path, Part::Value, "two cases with the same name").value(labels[twice]);
            faults.push(fault.remedy("give each case a name of its own"));
        }
        faults.extend(twice(axis).into_iter().map(|(inside, value)| {
            let path: Vec<&str> = ["vary", &place].into_iter().chain(inside.iter().map(String::as_str)).collect();
            let fault = fault(&path, Part::Value, "a duplicate value").value(value);
            fault.remedy("remove it; `repetitions` repeats all trials with other seeds")
        }));
        if axes[..index].iter().any(|other| other.key == axis.key) {
            faults.push(
                fault(&["vary", &place, "key"], Part::Value, "a duplicate axis")
                    .value(&axis.key)
                    .remedy("merge the values of both"),
            );
        } else if let Some(key) =
            axis.keys().find(|&key| axes[..index].iter().any(|other| other.keys().any(|k| k == key)))
        {
            let what = format!("an axis that sets `{key}`, as another axis does");
            faults.push(fault(&["vary", &place, "key"], Part::Value, &what).remedy("remove `{key}` from one of them"));
        }
    }
    faults
}

/// The repeated values of an axis, with their paths in it.
fn twice(axis: &Axis) -> Vec<(Vec<String>, String)> {
    /// A normal form in which equal numbers and equal components compare equal.
    fn plain(value: &toml::Value) -> toml::Value {
        match value {
            toml::Value::Integer(full) => (*full as f64).into(),
            toml::Value::Float(zero) if *zero == 0.0 => 0.0.into(),
            toml::Value::Array(list) => toml::Value::Array(list.iter().map(plain).collect()),
            toml::Value::Table(table) => match table.get("name") {
                Some(name) if table.len() == 1 => name.clone(),
                _ => toml::Value::Table(table.iter().map(|(key, value)| (key.clone(), plain(value))).collect()),
            },
            other => other.clone(),
        }
    }
    if !axis.is_bounded() {
        return Vec::new();
    }
    let places = axis.places();
    let mut known = HashSet::new();
    let values = |place: &AxisValue| -> String {
        let values: toml::Table = place.set.iter().map(|(key, value)| (key.clone(), plain(value))).collect();
        values.to_string()
    };
    let again = (0..places.len()).filter(|&k| !known.insert(values(&places[k])));
    let reported = again.filter_map(|k| {
        let place = &places[k];
        let (key, _) = place.set.first()?;
        let at = match axis.cases.get(place.number) {
            Some(_) => vec!["cases".to_owned(), place.number.to_string(), "set".to_owned()],
            None => axis.written(place.number, key).1,
        };
        Some((at, place.value.to_string()))
    });
    reported.collect()
}

/// The fault of an axis whose lists do not match.
fn zip_fault(axis: &Axis) -> Option<(&str, String)> {
    let mut lengths = axis.zip.iter().map(|(key, list)| (key, list.as_array().map(Vec::len)));
    let first = lengths.next()?;
    let reported = |(key, length): (&'_ String, Option<usize>)| match (length, first.1) {
        (None, _) => Some(format!("`{key}` is not a list; give one value for each point")),
        (Some(0), _) => Some(format!("`{key}` has no values")),
        (Some(n), Some(m)) if n != m => {
            Some(format!("`{}` has {m} values and `{key}` {n}; give lists of equal length", first.0))
        }
        _ => None,
    };
    std::iter::once(first).chain(lengths).find_map(|(key, length)| Some((key.as_str(), reported((key, length))?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(key: &str, values: &[i64]) -> Axis {
        Axis::listed(key, values.iter().map(|&v| v.into()).collect())
    }

    #[test]
    fn the_grid_has_the_last_axis_fastest() {
        let cells = grid(&[axis("a", &[1, 2]), axis("b", &[3, 4])]);
        let values: Vec<Vec<i64>> =
            cells.iter().map(|cell| cell.iter().map(|place| place.value.as_integer().unwrap()).collect()).collect();
        assert_eq!(values, [[1, 3], [1, 4], [2, 3], [2, 4]]);
        assert_eq!(grid(&[]), [Vec::new()]);
    }

    #[test]
    fn lists_that_go_together_are_one_axis() {
        let axis: Axis = toml::from_str("key = 'camera'\nzip = { 'a.b' = [1, 2], c = ['x', 'y'] }").unwrap();
        let places = axis.places();
        assert_eq!(places[1].value.as_str(), Some("2, y"));
        assert_eq!(places[1].set, [("a.b".to_owned(), 2.into()), ("c".to_owned(), "y".into())]);
        let faults = |text: &str| {
            let axis: Axis = toml::from_str(text).unwrap();
            check(&[axis], |_, _, what| Fault::new(what, Path::new("e.toml")))
        };
        assert!(faults("key = 'k'\nzip = { a = [1], b = [1, 2] }")[0].what.contains("equal length"));
        assert!(faults("key = 'k'\nzip = { a = 1 }")[0].what.contains("not a list"));
        assert!(faults("key = 'k'\nvalues = [3]\nrange = { from = 0, to = 1, count = 2 }").len() == 1);
        assert!(faults("key = 'k'\nlog-range = { from = 0, to = 1, count = 3 }")[0].what.contains("above zero"));
    }

    #[test]
    fn a_bare_name_opens_for_its_settings() {
        let mut table: toml::Table = toml::from_str("source = 'virtual-images'").unwrap();
        set(&mut table, "source.distance", 3.0.into()).unwrap();
        assert_eq!(table["source"]["name"].as_str(), Some("virtual-images"));
        assert_eq!(table["source"]["distance"].as_float(), Some(3.0));
        set(&mut table, "pipeline.solver", "triad".into()).unwrap();
        assert_eq!(table["pipeline"]["solver"].as_str(), Some("triad"));
        assert!(set(&mut table, "source.distance.deeper", 1.into()).is_err());
    }

    #[test]
    fn names_are_fit_for_files() {
        let place =
            |key: &str, value: toml::Value| AxisValue { key: key.to_owned(), value, set: Vec::new(), number: 0 };
        let cell = vec![place("source.distance", 2.5.into()), place("pipeline.solver", "../triad".into())];
        assert_eq!(name(3, &cell), "003-distance-2.5-solver-.._triad");
    }
}
