use super::*;
use seafix_component::Settings;
use serde::Deserialize;

trait Shape: std::fmt::Debug {
    fn area(&self) -> f64;
}

#[derive(Debug, Clone, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
struct Square {
    /// Length of a side (m).
    side_length: f64,
    /// Frame around the square.
    frame: Frame,
}

#[derive(Debug, Clone, Default, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
struct Frame {
    /// Width of the frame (m).
    width: f64,
    /// Frames within the frame.
    #[setting(form = Vec<toml::Value>)]
    holes: Vec<Frame>,
}

impl Default for Square {
    fn default() -> Self {
        Self { side_length: 1.0, frame: Frame::default() }
    }
}

impl Component for Square {
    const NAME: &'static str = "square";
    const SUMMARY: &'static str = "four equal sides";
    const SOURCE: &'static str = "Euclid, Elements";

    fn check(&self) -> Result<(), String> {
        in_range(self.side_length > 0.0, "side-length", self.side_length, "a positive length")
    }
}

impl Shape for Square {
    fn area(&self) -> f64 {
        self.side_length * self.side_length
    }
}

static SHAPES: Registry<dyn Shape> = Registry::new("shape", &[entry!(Square)]);

#[test]
fn defaults_printed_are_defaults_used() {
    let listing = &SHAPES.listings()[0];
    let printed = Choice { name: listing.name.to_owned(), settings: listing.table.defaults.clone() };
    assert_eq!(SHAPES.build(&printed).unwrap().area(), SHAPES.build(&Choice::named("square")).unwrap().area());
    assert_eq!(SHAPES.resolve(&Choice::named("square")).unwrap(), printed);
}

#[test]
fn an_unknown_key_is_answered_with_the_nearest() {
    let error = SHAPES.build(&Choice::named("square").with("side-lenght", 2.0)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "shape `square` has no setting `side-lenght`, did you mean `side-length`? There are side-length, frame"
    );
    assert_eq!(error.key(), Some("side-lenght"));
}

#[test]
fn a_value_out_of_range_is_rejected() {
    let error = SHAPES.build(&Choice::named("square").with("side-length", -1.0)).unwrap_err();
    assert_eq!(error.to_string(), "shape `square`: side-length = -1; give a positive length");
}

#[test]
fn a_wrong_type_names_its_key() {
    let error = SHAPES.build(&Choice::named("square").with("side-length", "long")).unwrap_err();
    assert_eq!(error.to_string(), "shape `square`: setting `side-length`: not a number: string \"long\"");
}

/// The test fails if the check stops at the first error.
#[test]
fn all_faults_are_reported_each_with_its_place() {
    let settings: toml::Table = toml::from_str(
            "side-length = -2.0\nside = 1\nframe = { widht = 1.0, width = 'wide', holes = [{ width = 1.0 }, { width = 'x' }] }",
        )
        .unwrap();
    let faults = SHAPES.faults(&Choice { name: "square".to_owned(), settings });
    let text: Vec<String> = faults.iter().map(ToString::to_string).collect();
    assert_eq!(text.len(), 5, "{text:?}");
    let keys: Vec<&str> = faults.iter().filter_map(BuildError::key).collect();
    for key in ["frame.widht", "frame.width", "frame.holes.1.width", "side", "side-length"] {
        assert!(keys.contains(&key), "no {key} in {text:?}");
    }
    let all = text.join("\n");
    for part in [
        "no setting `frame.widht`, did you mean `width`?",
        "`frame.width`: not a number: string \"wide\"",
        "side-length = -2; give",
    ] {
        assert!(all.contains(part), "no {part} in {all}");
    }
    assert!(SHAPES.faults(&Choice::named("square")).is_empty());
    let misspelt = SHAPES.faults(&Choice::named("sqare").with("side", 1));
    assert!(matches!(misspelt[..], [BuildError::UnknownName { .. }, BuildError::UnknownKey { .. }]), "{misspelt:?}");
    assert!(matches!(SHAPES.faults(&Choice::named("circle").with("side", 1))[..], [BuildError::UnknownName { .. }]));
}

#[test]
fn settings_of_no_component_are_reported_one_by_one_too() {
    let check = |square: &Square| {
        in_range(square.side_length > 0.0, "side-length", square.side_length, "a length")?;
        in_range(square.frame.width >= 0.0, "frame.width", square.frame.width, "a width")
    };
    let wrong = Square { side_length: -1.0, frame: Frame { width: -2.0, holes: Vec::new() } };
    assert_eq!(each_invalid(&wrong, check), ["side-length = -1; give a length", "frame.width = -2; give a width"]);
    assert!(each_invalid(&Square::default(), check).is_empty());
    assert_eq!(each_invalid(&wrong, |_| Err("side-length = 0; give more".to_owned())).len(), 1);
}

#[test]
fn a_number_out_of_range_names_its_key() {
    assert_eq!(out_of_range("lamps[1].aim = [0.0]; give a place").as_deref(), Some("lamps[1].aim"));
    assert_eq!(out_of_range("two keys = 1; give one"), None);
    assert_eq!(out_of_range("no number"), None);
}

trait Saying: Send + Sync + std::fmt::Debug {
    fn greet(&self) -> String;
}

#[derive(Debug)]
struct Said(String);

impl Saying for Said {
    fn greet(&self) -> String {
        self.0.clone()
    }
}

fn greeting(name: &str, word: &'static str) -> Added<dyn Saying> {
    Added {
        name: name.to_owned(),
        summary: "says a word".to_owned(),
        source: String::new(),
        version: 3,
        defaults: toml::Table::from_iter([("times".to_owned(), 1.into())]),
        construct: Box::new(move |settings| {
            let times = settings["times"].as_integer().unwrap_or_default();
            usize::try_from(times)
                .map(|times| Box::new(Said(word.repeat(times))) as Box<dyn Saying>)
                .map_err(|_| format!("times = {times}; give 0 or more"))
        }),
    }
}

/// Fails if an added component is not found, keeps its first form, or takes settings that it does not have.
#[test]
fn an_added_component_is_chosen_by_name() {
    static GREETINGS: Registry<dyn Saying> = Registry::new("greeting", &[]);
    assert_eq!(GREETINGS.add(greeting("salve", "salve ")), Ok(()));
    let twice = Choice::named("salve").with("times", 2);
    assert_eq!(GREETINGS.build(&twice).unwrap().greet(), "salve salve ");
    assert_eq!(GREETINGS.resolve(&Choice::named("salve")).unwrap(), Choice::named("salve").with("times", 1));
    assert_eq!(GREETINGS.listings()[0].version, 3);
    assert_eq!(GREETINGS.add(greeting("salve", "ave ")), Ok(()));
    assert_eq!(GREETINGS.build(&twice).unwrap().greet(), "ave ave ");
    assert_eq!(GREETINGS.names().collect::<Vec<_>>(), ["salve"]);
    let error = |choice: &Choice| GREETINGS.build(choice).unwrap_err().to_string();
    let wrong = error(&Choice::named("salve").with("tims", 2));
    assert!(wrong.contains("`salve` has no setting `tims`, did you mean `times`?"), "{wrong}");
    let wrong = error(&Choice::named("salve").with("times", "two"));
    assert!(wrong.contains("expected integer, found string"), "{wrong}");
    let wrong = error(&Choice::named("salve").with("times", -1));
    assert!(wrong.contains("times = -1; give 0 or more"), "{wrong}");
}

#[test]
fn a_name_is_new_and_in_kebab_case() {
    static GREETINGS: Registry<dyn Saying> = Registry::new("greeting", &[]);
    for bad in ["", "Salve", "two words", "-salve", "salve-", "a--b", "a_b", "1st"] {
        assert!(matches!(GREETINGS.add(greeting(bad, "")), Err(NotAdded::Name { .. })), "{bad}");
    }
    assert_eq!(GREETINGS.add(greeting("salve-2", "")), Ok(()));
}
