//! The keys of a site file, with their sentences and ranges.

use std::{path::Path, sync::Arc};

use seafix_component::{Settings, SettingsError, SettingsTable};

use super::{
    file::{AXES, SiteFile},
    model::Site,
};

/// An object of three points with an edge and a point of interest, in which one key at a time is tried.
const OBJECT: &str = r#"
[[object]]
id = "box"
base = ["A", "B", "C"]
base_in_world = [[0.0, 0.0, 0.0], [0.0, -1.0, 0.0], [2.0, 0.0, 0.0]]
survey_sigma = 0.0
point = [
    { id = "A", at = [0.0, 0.0, 0.0], sigma = 0.0, normal = [0.0, 0.0, 1.0] },
    { id = "B", at = [0.0, -1.0, 0.0] },
    { id = "C", at = [2.0, 0.0, 0.0] },
]
edge = [{ id = "AB", from = "A", to = "B", sigma = 0.0 }]
interest = [{ id = "I", at = [1.0, 1.0, 0.0] }]
"#;

/// The keys of a site file.
pub fn site_settings() -> SettingsTable {
    SettingsTable {
        form: SiteFile::form(),
        defaults: toml::from_str(OBJECT).expect("an object"),
        refusals: Arc::new(refusals),
    }
}

fn refusals(given: &toml::Table) -> Vec<SettingsError> {
    let head = format!("format = 'seafix-site/1.1'\nname = 'site'\naxes = '{AXES}'\nsite_frame = 'box'\n{OBJECT}");
    let mut site: toml::Table = toml::from_str(&head).expect("a site");
    // The texts at the head have no range.
    site.extend(given.iter().filter(|(key, _)| *key == "object").map(|(key, value)| (key.clone(), value.clone())));
    let text = toml::to_string(&site).expect("a table of plain values");
    let faults = Site::parse(&text, Path::new("site.toml")).err().unwrap_or_default();
    let message = |fault: seafix_component::Fault| format!("{}; {}", fault.what, fault.remedy);
    faults.into_iter().map(|fault| SettingsError { key: None, message: message(fault) }).collect()
}
