//! Settings as they are described, against the checks that enforce them.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use seafix_derive::Settings;

use super::{Bound, Form, Setting, Settings, SettingsTable};
use crate::registry::{Component, in_range, settings};

#[derive(Debug, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
struct Lamp {
    /// Path of the [calibration](super::Form); see [`near_m`](Self::near_m).
    path: String,
    /// Electric power (W).
    power: f64,
    /// Width of the beam (degrees).
    beam: f64,
    /// Nearest distance (m).
    near_m: f64,
    /// Farthest distance (m).
    far: f64,
    /// Number of lamps.
    count: usize,
    /// Colour of the light.
    colour: Colour,
    /// Rings around the lamp.
    rings: Vec<Ring>,
}

#[derive(Debug, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
enum Colour {
    /// White light.
    #[default]
    White,
    /// Light of this wavelength (m).
    Single(f64),
}

#[derive(Debug, Serialize, Deserialize, Settings)]
struct Ring {
    /// Radius (m).
    radius: f64,
    /// Fraction of the light that it reflects.
    #[serde(default)]
    fraction: f64,
}

impl Default for Lamp {
    fn default() -> Self {
        let (path, colour, rings) = (String::new(), Colour::White, Vec::new());
        Self { path, power: 5.0, beam: 40.0, near_m: 0.5, far: 9.0, count: 2, colour, rings }
    }
}

impl Component for Lamp {
    const NAME: &'static str = "lamp";
    const SUMMARY: &'static str = "a lamp";
    const SOURCE: &'static str = "none";

    fn check(&self) -> Result<(), String> {
        let Self { power, beam, near_m, far, count, .. } = *self;
        in_range(!self.path.is_empty(), "path", "''", "the file of a calibration")?;
        in_range((0.0..=1e3).contains(&power), "power", power, "a number from 0 to 1000")?;
        in_range(beam > 0.0 && beam < 180.0, "beam", beam, "more than 0, less than 180")?;
        in_range(near_m > 0.0, "near-m", near_m, "a positive distance")?;
        in_range(far > near_m && far < 1e6, "far", far, &format!("a distance beyond near-m = {near_m}, below 1e6"))?;
        in_range((1..=16).contains(&count), "count", count, "1 to 16")?;
        self.rings.iter().enumerate().try_for_each(|(k, ring)| {
            in_range(ring.radius >= 0.25, &format!("rings[{k}].radius"), ring.radius, "at least 0.25")
        })
    }
}

fn table() -> SettingsTable {
    SettingsTable {
        form: Lamp::form(),
        defaults: toml::Table::try_from(Lamp::default()).unwrap(),
        refusals: Arc::new(|given| settings::<Lamp>(given.clone()).err().unwrap_or_default()),
    }
}

fn setting(key: &str) -> Setting {
    let all = table().settings();
    let keys: Vec<String> = all.iter().map(|setting| setting.key.clone()).collect();
    all.into_iter().find(|setting| setting.key == key).unwrap_or_else(|| panic!("no {key} in {keys:?}"))
}

/// Fails if a limit of a check is given to another setting, or moved by one step.
#[test]
fn limits_are_the_numbers_at_which_the_check_begins_to_refuse() {
    let limits = |key: &str| (setting(key).range.min, setting(key).range.max);
    assert_eq!(limits("power"), (Some(Bound::Included(0.0)), Some(Bound::Included(1e3))));
    assert_eq!(limits("beam"), (Some(Bound::Excluded(0.0)), Some(Bound::Excluded(180.0))));
    assert_eq!(limits("near-m"), (Some(Bound::Excluded(0.0)), None));
    assert_eq!(limits("count"), (Some(Bound::Included(1.0)), Some(Bound::Included(16.0))));
    assert_eq!(limits("rings[].radius"), (Some(Bound::Included(0.25)), None));
}

/// The limit 0.5 of `far` is the default of another setting.
#[test]
fn a_limit_that_depends_on_another_setting_is_in_the_words_only() {
    let far = setting("far").range;
    assert_eq!((far.min, far.max), (None, Some(Bound::Excluded(1e6))));
    assert!(far.words.contains("near-m"), "{}", far.words);
}

#[test]
fn a_setting_has_its_sentence_unit_and_default() {
    let power = setting("power");
    assert_eq!((power.doc, power.unit, power.default), ("Electric power (W).", Some("W"), Some(5.0.into())));
    assert_eq!(setting("path").doc, "Path of the calibration; see `near-m`.");
    assert!(setting("path").range.filled);
    assert_eq!((setting("count").unit, setting("rings[].fraction").unit), (Some("1"), Some("1")));
    assert_eq!(table().required(), ["path"]);
    let Form::OneOf(forms) = setting("colour").form else { panic!("a word or a table") };
    assert_eq!(forms[0], Form::Words(vec![("white", "White light.")]));
    assert_eq!(setting("colour.single").unit, Some("m"));
}
