//! The sentence of a setting of an experiment, by its dotted key.

use super::identity::components;
use crate::settings::experiment_settings;

/// The sentence and the unit of a setting, if `key` is one; `settings` choose the components.
///
/// A key below a component, such as `source.distance`, is a setting of the component that the key above it chooses.
pub(crate) fn sentence(key: &str, settings: &toml::Table) -> Option<(&'static str, Option<&'static str>)> {
    if let Some(found) = experiment_settings().sentence(key) {
        return Some(found);
    }
    let all = components().concat();
    let steps: Vec<&str> = key.split('.').collect();
    (1..steps.len()).rev().find_map(|split| {
        let chosen = steps[1..split].iter().try_fold(settings.get(steps[0])?, |at, step| at.get(*step))?;
        let name = chosen.get("name").unwrap_or(chosen).as_str()?;
        // The key names the kind, unless the component stands below another name, such as `odometry.solver`.
        let named = || all.iter().filter(|listing| listing.name == name);
        let listing = named().find(|listing| listing.kind == steps[split - 1]).or_else(|| named().next())?;
        listing.table.sentence(&steps[split..].join("."))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_has_the_sentence_of_its_component() {
        let text = "[source]\nname = 'virtual-images'\n[pipeline]\nsolver = 'kabsch'\n";
        let settings: toml::Table = toml::from_str(text).expect("two tables");
        let (doc, unit) = sentence("source.distance", &settings).expect("a setting of the source");
        assert!(doc.contains("istance") && unit == Some("m"), "{doc}: {unit:?}");
        let (doc, _) = sentence("pipeline.solver", &settings).expect("a setting of the pipeline");
        assert!(doc.to_lowercase().contains("solver"), "{doc}");
        let (_, unit) = sentence("pipeline.acceptance.alert-limit", &settings).expect("a setting of the acceptance");
        assert_eq!(unit, Some("m"));
        assert_eq!(sentence("method", &settings), None);
    }
}
