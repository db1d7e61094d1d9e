//! The tables of an experiment file and of a site file.

use seafix_component::{Form, Setting};
use seafix_experiment::experiment_settings;
use seafix_referencing::site_settings;

/// A table of settings that belongs to no component.
pub(crate) struct Section {
    /// The place in a file, and the sentence of the table.
    pub(crate) about: String,
    /// The settings, with keys below the table.
    pub(crate) settings: Vec<Setting>,
}

/// The name of the table of all settings of an experiment file.
const EXPERIMENT: &str = "experiment";
/// The name of the table of all settings of a site file.
const SITES: &str = "sites";

/// The names of all tables.
pub(crate) fn names() -> Vec<String> {
    let experiment = experiment_settings().settings();
    let inner = experiment.iter().filter(|setting| is_table(&setting.form)).map(name_of);
    let mut names: Vec<String> = [EXPERIMENT, SITES].map(str::to_owned).into_iter().chain(inner).collect();
    names.sort();
    names.dedup();
    names
}

/// The table with this name, and all tables below it.
pub(crate) fn section(name: &str) -> Option<Section> {
    let text = |about: &str| about.to_owned();
    if name == SITES {
        // The defaults are those of an example.
        let settings = site_settings().settings().into_iter().map(|setting| Setting { default: None, ..setting });
        let settings = settings.collect();
        return Some(Section { about: text("a site file (`seafix-site/1`)"), settings });
    }
    let experiment = experiment_settings().settings();
    if name == EXPERIMENT {
        let own = |setting: &Setting| !["pipeline.", "navigation."].iter().any(|below| setting.key.starts_with(below));
        let settings = experiment.into_iter().filter(own).collect();
        return Some(Section { about: text("an experiment file"), settings });
    }
    let table = experiment.iter().find(|setting| is_table(&setting.form) && name_of(setting) == name)?;
    let list = if matches!(table.form, Form::List { .. }) { "[]" } else { "" };
    let prefix = format!("{}{list}.", table.key);
    let about = format!("`{}` in an experiment file: {}", table.key, table.doc);
    let below = |setting: &Setting| {
        let key = setting.key.strip_prefix(&prefix)?.to_owned();
        Some(Setting { key, ..setting.clone() })
    };
    Some(Section { about, settings: experiment.iter().filter_map(below).collect() })
}

fn name_of(setting: &Setting) -> String {
    setting.key.rsplit('.').next().unwrap_or(&setting.key).to_owned()
}

/// Whether a value of the form has settings of its own.
fn is_table(form: &Form) -> bool {
    match form {
        Form::Table(_) => true,
        Form::List { of, .. } => is_table(of),
        Form::OneOf(forms) => forms.iter().any(is_table),
        _ => false,
    }
}
