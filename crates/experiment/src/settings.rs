//! The settings of an experiment file, with their sentences and ranges.

use std::sync::Arc;

use seafix::KeyframeSettings;
use seafix_component::{Field, Form, Settings, SettingsError, SettingsTable};

use crate::{experiment::Experiment, navigation::Navigation};

/// The settings of an experiment file, without those of components.
pub fn experiment_settings() -> SettingsTable {
    let Form::Table(mut fields) = Experiment::form() else { unreachable!("an experiment is a table") };
    let base =
        "File with the settings that this file omits, relative to this file; none by default. A base has no base.";
    fields.push(Field::new("base", base, Form::Text, false));
    SettingsTable { form: Form::Table(fields), defaults: defaults(), refusals: Arc::new(refusals) }
}

/// The smallest experiment with all defaults written out.
fn defaults() -> toml::Table {
    let smallest: toml::Table = toml::from_str("question = 'why?'\nsource = 'virtual-points'\n").expect("two settings");
    let experiment: Experiment = smallest.try_into().expect("the required settings");
    let mut all = toml::Table::try_from(&experiment).expect("an experiment is a table of plain values");
    let navigation = Navigation { pose_graph: Some(KeyframeSettings::default()), ..Navigation::default() };
    let omitted = [
        ("repetitions", toml::Value::Integer(experiment.repetitions.into())),
        ("log", toml::Value::try_from(experiment.log).expect("a table")),
        ("navigation", toml::Value::try_from(navigation).expect("a table")),
    ];
    all.extend(omitted.map(|(key, value)| (key.to_owned(), value)));
    ["question", "source"].iter().for_each(|key| drop(all.remove(*key)));
    all
}

fn refusals(given: &toml::Table) -> Vec<SettingsError> {
    let mut table: toml::Table = [("question", "why?"), ("source", "virtual-points")]
        .map(|(key, value)| (key.to_owned(), value.into()))
        .into_iter()
        .collect();
    table.extend(given.iter().filter(|(key, _)| *key != "base").map(|(key, value)| (key.clone(), value.clone())));
    match table.try_into::<Experiment>() {
        Err(error) => vec![SettingsError { key: None, message: error.message().to_owned() }],
        Ok(experiment) => experiment
            .rejected()
            .into_iter()
            .map(|(path, message)| SettingsError { key: Some(path), message })
            .collect(),
    }
}
