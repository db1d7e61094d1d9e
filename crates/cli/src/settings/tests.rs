//! Every setting is described, and the schema accepts and rejects the files that `seafix check` does.

use std::{
    fs,
    path::{Path, PathBuf},
};

use seafix_component::{Form, Setting};
use seafix_experiment::{Plan, experiment_settings};
use seafix_referencing::site_settings;
use serde_json::Value;

use crate::catalogue::kinds;

/// All settings, with the name of their table.
fn all() -> Vec<(String, Setting)> {
    let named = |name: &str, settings: Vec<Setting>| {
        let name = name.to_owned();
        settings.into_iter().map(move |setting| (name.clone(), setting)).collect::<Vec<_>>()
    };
    let mut all = named("experiment", experiment_settings().settings());
    all.extend(named("site", site_settings().settings()));
    for listing in kinds().iter().flat_map(|kind| &kind.listings) {
        all.extend(named(&format!("{} {}", listing.kind, listing.name), listing.table.settings()));
    }
    all
}

/// What a setting lacks.
fn lacks(setting: &Setting) -> Vec<&'static str> {
    let sentence = setting.doc.len() >= 10 && setting.doc.ends_with('.') && !setting.doc.contains("](");
    let range = !setting.range.words.is_empty() && setting.range.words != "any number";
    let mut lacks = Vec::new();
    lacks.extend((!sentence).then_some("sentence"));
    lacks.extend(setting.unit.is_none().then_some("unit"));
    lacks.extend((!range).then_some("range"));
    lacks
}

#[test]
fn every_setting_has_a_sentence_a_unit_and_a_range() {
    let all = all();
    let bad: Vec<String> = all
        .iter()
        .filter(|(_, setting)| !lacks(setting).is_empty())
        .map(|(table, setting)| {
            format!("{table}: {} lacks {}: {}", setting.key, lacks(setting).join(", "), setting.doc)
        })
        .collect();
    assert!(bad.is_empty(), "{} of {}:\n{}", bad.len(), all.len(), bad.join("\n"));
    // The count falls if a table or a registry is left out.
    assert!(all.len() > 500, "{}", all.len());
}

/// The numbers are those of the checks in `acceptance.rs` and `virtual-images`.
#[test]
fn limits_are_those_of_the_check() {
    let schema = super::experiment();
    let at = |path: &str| schema.pointer(path).unwrap_or_else(|| panic!("no {path}"));
    let acceptance = |key: &str| at("/$defs/setting")[format!("pipeline.acceptance.{key}")].clone();
    assert_eq!(acceptance("min-points")["minimum"], 3);
    assert_eq!(acceptance("confidence")["exclusiveMinimum"], 0.0);
    assert_eq!(acceptance("confidence")["exclusiveMaximum"], 1.0);
    assert_eq!(acceptance("wrong-match-rate")["maximum"], 1.0);
    assert_eq!(acceptance("alert-limit").get("maximum"), None);
    assert!(acceptance("alert-limit")["description"].as_str().unwrap().contains("Unit: m."));
}

/// A kind that a setting names is in the catalogue.
#[test]
fn every_choice_is_of_a_known_kind() {
    fn kinds_of(form: &Form, found: &mut Vec<&'static str>) {
        match form {
            Form::Component { kind, .. } => found.push(kind),
            Form::List { of, .. } => kinds_of(of, found),
            _ => {}
        }
    }
    let known: Vec<&str> = kinds().iter().map(|kind| kind.singular).collect();
    let mut found = Vec::new();
    all().iter().for_each(|(_, setting)| kinds_of(&setting.form, &mut found));
    assert!(found.len() > 20 && found.iter().all(|kind| known.contains(kind)), "{found:?}");
}

/// Whether `value` is valid; a keyword of the schema that is not known here is an error.
fn valid(root: &Value, schema: &Value, value: &Value) -> bool {
    let number = || value.as_f64();
    let length = || value.as_array().map(Vec::len);
    let size = |limit: &Value| limit.as_u64().unwrap() as usize;
    schema.as_object().unwrap().iter().all(|(keyword, rule)| match keyword.as_str() {
        "description" | "default" | "title" | "$schema" | "$defs" | "properties" => true,
        "$ref" => valid(root, root.pointer(&rule.as_str().unwrap()[1..]).unwrap_or_else(|| panic!("{rule}")), value),
        "type" => match rule.as_str().unwrap() {
            "object" => value.is_object(),
            "array" => value.is_array(),
            "string" => value.is_string(),
            "boolean" => value.is_boolean(),
            "integer" => value.is_i64() || value.is_u64(),
            "number" => value.is_number(),
            other => panic!("type {other}"),
        },
        "const" => value == rule,
        "enum" => rule.as_array().unwrap().contains(value),
        "anyOf" => rule.as_array().unwrap().iter().any(|one| valid(root, one, value)),
        "required" => value
            .as_object()
            .is_none_or(|table| rule.as_array().unwrap().iter().all(|key| table.contains_key(key.as_str().unwrap()))),
        "additionalProperties" => {
            assert_eq!(*rule, false);
            value.as_object().is_none_or(|table| {
                let known = &schema["properties"];
                table.iter().all(|(key, value)| known.get(key).is_some_and(|inner| valid(root, inner, value)))
            })
        }
        "items" => value.as_array().is_none_or(|list| list.iter().all(|one| valid(root, rule, one))),
        "minItems" => length().is_none_or(|length| length >= size(rule)),
        "maxItems" => length().is_none_or(|length| length <= size(rule)),
        "minProperties" => value.as_object().is_none_or(|table| table.len() >= size(rule)),
        "minLength" => value.as_str().is_none_or(|text| text.len() >= size(rule)),
        "minimum" => number().is_none_or(|number| number >= rule.as_f64().unwrap()),
        "maximum" => number().is_none_or(|number| number <= rule.as_f64().unwrap()),
        "exclusiveMinimum" => number().is_none_or(|number| number > rule.as_f64().unwrap()),
        "exclusiveMaximum" => number().is_none_or(|number| number < rule.as_f64().unwrap()),
        other => panic!("the keyword {other} is not in the validator"),
    })
}

fn accepts(schema: &Value, text: &str) -> bool {
    let file: toml::Table = toml::from_str(text).unwrap();
    valid(schema, schema, &serde_json::to_value(file).unwrap())
}

/// The experiments of the repository.
fn experiments() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments");
    let folders = [root.clone(), root.join("paper"), root.join("studies")];
    let files = folders.iter().flat_map(|folder| fs::read_dir(folder).unwrap()).map(|entry| entry.unwrap().path());
    files.filter(|path| path.extension().is_some_and(|end| end == "toml") && !path.ends_with("reports.toml")).collect()
}

#[test]
fn the_schema_accepts_every_experiment() {
    let schema = super::experiment();
    let files = experiments();
    let rejected: Vec<&PathBuf> =
        files.iter().filter(|path| !accepts(&schema, &fs::read_to_string(path).unwrap())).collect();
    assert!(rejected.is_empty() && files.len() > 20, "{rejected:?}");
}

#[test]
fn the_schema_rejects_the_files_that_check_rejects() {
    let schema = super::experiment();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("experiment.toml");
    let head = "question = 'How far?'\nsource = 'virtual-images'\n";
    fs::write(folder.path().join("base.toml"), head).unwrap();
    let checked = |text: &str| {
        fs::write(&file, text).unwrap();
        Plan::read(&file, &[]).is_ok()
    };
    let mut disagree = Vec::new();
    for good in GOOD {
        let text = format!("{head}{good}");
        if !(checked(&text) && accepts(&schema, &text)) {
            disagree.push(text);
        }
    }
    let (complete, below): (Vec<&str>, Vec<&str>) = BAD.iter().partition(|text| text.starts_with('#'));
    let bad: Vec<String> =
        complete.into_iter().map(str::to_owned).chain(below.iter().map(|text| format!("{head}{text}"))).collect();
    assert!(bad.len() >= 40);
    for text in bad {
        if checked(&text) || accepts(&schema, &text) {
            disagree.push(text);
        }
    }
    assert!(disagree.is_empty(), "{}", disagree.join("\n---\n"));
}

/// Valid experiments below a question and a source.
const GOOD: [&str; 8] = [
    "",
    "repetitions = 2\n",
    "[pipeline]\nsolver = 'kabsch'\nrefinement = { window = 15 }\n",
    "[pipeline]\ngate = { box = 0.5 }\ntolerance = { fixed = 0.02 }\nacceptance = { max-p-wrong = 'strict' }\n",
    "[[vary]]\nkey = 'pipeline.solver'\nvalues = ['kabsch', { name = 'triad' }]\n",
    "[[vary]]\nkey = 'source.frames'\nrange = { from = 1, to = 3, step = 1 }\n",
    "[[vary]]\nkey = 'both'\nzip = { 'source.frames' = [1, 2], 'pipeline.window' = [1, 2] }\n",
    "[navigation]\nfaults = [{ kind = 'off', from = 1, to = 2.0 }]\n",
];

/// Invalid experiments: complete ones begin with a comment, the others stand below a question and a source.
const BAD: [&str; 54] = [
    "# empty\n",
    "# no question\nsource = 'virtual-images'\n",
    "# no source\nquestion = 'How far?'\n",
    "# an empty question\nquestion = ''\nsource = 'virtual-images'\n",
    "# a question that is no text\nquestion = 3\nsource = 'virtual-images'\n",
    "# an unknown source\nquestion = 'How far?'\nsource = 'virtual-image'\n",
    "# no name\nquestion = 'How far?'\nsource = { frames = 3 }\n",
    "# no path\nquestion = 'How far?'\nsource = 'dataset'\n",
    "# no path\nquestion = 'How far?'\nsource = { name = 'dataset', target = 'object' }\n",
    "# frames\nquestion = 'How far?'\nsource = { name = 'virtual-images', frames = -3 }\n",
    "# frames\nquestion = 'How far?'\nsource = { name = 'virtual-images', frames = 'many' }\n",
    "# frames\nquestion = 'How far?'\nsource = { name = 'virtual-images', frames = 2.5 }\n",
    "# an unknown setting\nquestion = 'How far?'\nsource = { name = 'virtual-images', frame = 3 }\n",
    "# a setting of another source\nquestion = 'How far?'\nsource = { name = 'virtual-points', path = 'a' }\n",
    "# an unknown key over a base\nbase = 'base.toml'\nsed = 3\n",
    "# an invalid setting over a base\nbase = 'base.toml'\nsource = { frames = -3 }\n",
    "# a base that is no text\nbase = 3\n",
    "sorce = 'virtual-images'\n",
    "seed = -1\n",
    "seed = 'one'\n",
    "repetitions = 0\n",
    "repetitions = 1.5\n",
    "pipeline = 'default'\n",
    "[pipeline]\nsolvr = 'kabsch'\n",
    "[pipeline]\nsolver = 'kabsh'\n",
    "[pipeline]\nsolver = { name = 'kabsch', size = 3 }\n",
    "[pipeline]\nsolver = { name = 'kabsch', min-sine = -1 }\n",
    "[pipeline]\ndetector = { name = 'harris', features = 0 }\n",
    "[pipeline]\nfilters = 'clahe'\n",
    "[pipeline]\nfilters = ['clahee']\n",
    "[pipeline]\nwindow = 0\n",
    "[pipeline]\nwindow = 1001\n",
    "[pipeline]\ntarget = 'objects'\n",
    "[pipeline]\nexpand-gates = 'yes'\n",
    "[pipeline]\ngate = { chi-square = 1.5 }\n",
    "[pipeline]\ngate = { sphere = 1.5 }\n",
    "[pipeline]\ntolerance = { sigmas = -1 }\n",
    "[pipeline.acceptance]\nmin-points = 2\n",
    "[pipeline.acceptance]\nmax-p-wrong = 'lax'\n",
    "[pipeline.acceptance]\nmax-p-wrong = 0\n",
    "[pipeline.acceptance]\nconfidence = 1.0\n",
    "[navigation]\nodometer = 'stereo'\n",
    "[navigation]\nodometry = 'stero'\n",
    "[navigation]\nfaults = [{ kind = 'broken', from = 1, to = 2 }]\n",
    "[navigation]\nfaults = [{ kind = 'off', to = 2 }]\n",
    "[log]\nimages = 'some'\n",
    "[[vary]]\nvalues = [1, 2]\n",
    "[[vary]]\nkey = 'pipeline.solvr'\nvalues = ['kabsch']\n",
    "[[vary]]\nkey = 'pipeline.solver'\nvalues = ['kabsch', 'kabsh']\n",
    "[[vary]]\nkey = 'source.frames'\nvalues = [3, -3]\n",
    "[[vary]]\nkey = 'solver'\ncases = [{ label = 'a', set = { 'pipeline.solver' = 'kabsh' } }]\n",
    "[[vary]]\nkey = 'source.frames'\nvalues = [1]\nrange = { from = 1, to = 2, count = 2 }\n",
    "[[vary]]\nkey = 'pipeline.gate.chi-square'\nlog-range = { from = 0, to = 0.9, count = 3 }\n",
    "[[published]]\nsource = 'a paper'\nquantity = 'error'\nrange = [0.0, 1.0]\n",
];
