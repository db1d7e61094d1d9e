//! The columns of the varied settings: one for every axis, with one value for all rows of a trial.

use std::collections::BTreeMap;

use seafix_log::quantities::{Kind, Quantity, Value};
use serde::{Deserialize, Serialize};

use super::cell::write_cell;

/// The column of a varied setting.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct AxisColumn {
    /// The axis.
    pub(crate) key: String,
    /// The name of the column: the axis, with `vary.` before it if a quantity has its name.
    pub(crate) column: String,
    /// The unit; empty without one.
    pub(crate) unit: String,
    /// The sentence of the setting.
    pub(crate) description: String,
}

impl AxisColumn {
    /// The column of the axis `key`.
    pub(crate) fn new(key: &str, unit: &str, description: String) -> Self {
        let column = if Quantity::named(key).is_some() { format!("vary.{key}") } else { key.to_owned() };
        Self { key: key.to_owned(), column, unit: unit.to_owned(), description }
    }
}

/// The values of a trial by axis.
pub(crate) type AxisValues = BTreeMap<String, serde_json::Value>;

/// The columns of all axes with their types.
#[derive(Debug, Default)]
pub(crate) struct Axes {
    pub(crate) columns: Vec<(AxisColumn, Kind)>,
}

impl Axes {
    /// The columns, each of the narrowest type that holds its values in all trials.
    pub(crate) fn of<'a>(columns: &[AxisColumn], trials: impl Iterator<Item = &'a AxisValues> + Clone) -> Self {
        let typed = |column: &AxisColumn| {
            let values = trials.clone().filter_map(|values| values.get(&column.key));
            type Holds = fn(&serde_json::Value) -> bool;
            let kinds: [(Holds, Kind); 3] = [
                (serde_json::Value::is_i64, Kind::Integer),
                (serde_json::Value::is_number, Kind::Real),
                (serde_json::Value::is_boolean, Kind::Flag),
            ];
            let known = values.clone().next().is_some();
            let kind = kinds.into_iter().find(|(is, _)| known && values.clone().all(is)).map(|(_, kind)| kind);
            (column.clone(), kind.unwrap_or(Kind::Text))
        };
        Self { columns: columns.iter().map(typed).collect() }
    }

    /// The cells of a trial in all columns.
    pub(crate) fn cells(&self, values: &AxisValues) -> Vec<Value> {
        let cell = |(column, kind): &(AxisColumn, Kind)| {
            let value = values.get(&column.key);
            match kind {
                Kind::Integer => Value::Integer(value.and_then(serde_json::Value::as_i64)),
                Kind::Real => Value::Real(value.and_then(serde_json::Value::as_f64)),
                Kind::Flag => Value::Flag(value.and_then(serde_json::Value::as_bool)),
                Kind::Text => {
                    let text =
                        |value: &serde_json::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
                    Value::Text(value.map_or_else(String::new, text))
                }
            }
        };
        self.columns.iter().map(cell).collect()
    }
}

/// The cells of a trial as the end of each of its lines in a CSV table, with a comma before every cell.
pub(crate) fn csv_end(cells: &[Value]) -> String {
    let mut text = String::new();
    for cell in cells {
        text.push(',');
        write_cell(&mut text, cell);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_has_the_type_of_its_values() {
        let trial = |text: &str| serde_json::from_str::<AxisValues>(text).unwrap();
        let trials = [
            trial(r#"{"source.distance": 2.0, "frames": 3, "method": "a,b", "on": true, "navigation": "x"}"#),
            trial(r#"{"source.distance": 3, "frames": 4, "method": {"name": "c"}, "on": false, "navigation": "y"}"#),
        ];
        let keys = ["source.distance", "frames", "method", "on", "navigation"];
        let columns = keys.map(|key| AxisColumn::new(key, "", String::new()));
        let axes = Axes::of(&columns, trials.iter());
        let kinds: Vec<Kind> = axes.columns.iter().map(|(_, kind)| *kind).collect();
        assert_eq!(kinds, [Kind::Real, Kind::Integer, Kind::Text, Kind::Flag, Kind::Text]);
        // A quantity is called `navigation` already.
        assert_eq!(axes.columns[4].0.column, "vary.navigation");
        assert_eq!(csv_end(&axes.cells(&trials[0])), ",2,3,\"a,b\",true,x");
        assert_eq!(csv_end(&axes.cells(&trials[1])), ",3,4,\"{\"\"name\"\":\"\"c\"\"}\",false,y");
    }
}
