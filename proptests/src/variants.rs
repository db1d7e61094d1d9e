//! Every component of a registry, with its defaults and with every value of every switch.

use seafix_component::{Choice, Listing, Registry};
use toml::Value;

/// A component built from a choice.
#[derive(Debug)]
pub struct Variant<T: ?Sized> {
    /// The choice with all settings.
    choice: Choice,
    /// The name for failures: component and chosen settings.
    pub name: String,
    /// The component.
    pub component: Box<T>,
}

impl<T: ?Sized> Variant<T> {
    /// Whether the component has a setting of this name.
    pub fn has(&self, key: &str) -> bool {
        self.choice.settings.contains_key(key)
    }

    /// The value of a switch of this name; `None` if the component has none.
    pub fn switch(&self, key: &str) -> Option<bool> {
        self.choice.settings.get(key)?.as_bool()
    }
}

/// All components of a registry with every combination of their switches (boolean settings, and settings with a few
/// words). The `given` settings replace the default of every component that has them.
///
/// # Panics
/// If a listed component cannot be built from its own settings.
pub fn variants<T: ?Sized>(registry: &Registry<T>, given: &[(&str, i64)]) -> Vec<Variant<T>> {
    let variants_of = |listing: &Listing| {
        let has = |(key, _): &&(&str, i64)| listing.table.defaults.contains_key(*key);
        let first =
            given.iter().filter(has).fold(Choice::named(listing.name), |choice, (key, value)| choice.with(key, *value));
        let mut choices = vec![first];
        for (key, default) in listing.table.defaults.iter().filter(|(_, default)| default.is_bool() || default.is_str())
        {
            let values = values_of(registry, listing.name, key, default);
            choices = choices
                .iter()
                .flat_map(|choice| values.iter().map(|value| choice.clone().with(key, value.clone())))
                .collect();
        }
        choices
    };
    let build = |chosen: Choice| Variant {
        component: registry.build(&chosen).expect("the registry listed the settings"),
        name: format!("{} {{ {} }}", chosen.name, chosen.settings.to_string().trim_end().replace('\n', ", ")),
        choice: registry.resolve(&chosen).expect("the registry listed the settings"),
    };
    registry.listings().iter().flat_map(variants_of).map(build).collect()
}

/// The values of a switch; for any other setting only its type.
fn values_of<T: ?Sized>(registry: &Registry<T>, name: &str, key: &str, default: &Value) -> Vec<Value> {
    match default {
        Value::Boolean(_) => vec![true.into(), false.into()],
        // The error of an invalid word lists all valid ones.
        Value::String(_) => match registry.build(&Choice::named(name).with(key, "\u{1}")) {
            Ok(_) => vec![default.clone()],
            Err(rejection) => {
                let message = rejection.to_string();
                let quoted = message.split('`').skip(1).step_by(2).map(Value::from);
                quoted.filter(|word| registry.build(&Choice::named(name).with(key, word.clone())).is_ok()).collect()
            }
        },
        _ => vec![default.clone()],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_referencing::{SEARCHES, SOLVERS};

    #[test]
    fn every_value_of_every_switch_is_built() {
        let names: Vec<String> = variants(&SOLVERS, &[]).into_iter().map(|variant| variant.name).collect();
        for word in ["first", "largest-area", "smallest-covariance"] {
            assert!(names.contains(&format!("triad {{ choose = \"{word}\" }}")), "{names:?}");
        }
        let searches = variants(&SEARCHES, &[("budget", 5)]);
        let oriented = |value| searches.iter().filter(|variant| variant.switch("orientation") == Some(value)).count();
        assert_eq!(oriented(true), oriented(false));
        assert!(
            searches.iter().all(|variant| variant
                .choice
                .settings
                .get("budget")
                .is_none_or(|b| b.as_integer() == Some(5)))
        );
    }
}
