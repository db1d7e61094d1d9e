//! `seafix schema`.

use clap::ValueEnum;
use seafix::{Keyframes, Pipeline};
use seafix_experiment::Navigation;
use serde_json::{Map, Value, json};

use crate::{
    catalogue::kind_of,
    exit::{DONE, Ended},
    terminal::print,
};

/// The formats that have a schema.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum Format {
    /// An experiment file.
    Experiment,
}

pub(crate) fn execute(of: Format) -> Ended {
    let schema = match of {
        Format::Experiment => experiment(),
    };
    print(&format!("{schema:#}\n"))?;
    Ok(DONE)
}

/// The schema of an experiment file, with the registered components, their settings and defaults.
fn experiment() -> Value {
    let message = |what: &str, kind: &str| json!({ "type": kind, "description": what });
    let mut pipeline = properties(&toml::Table::try_from(Pipeline::default()).expect("settings are a table"));
    for stage in ["detector", "locator", "descriptor", "matcher", "search", "solver"] {
        pipeline.insert(stage.to_owned(), component(stage));
    }
    for stage in ["refinement", "triangulator"] {
        pipeline.insert(stage.to_owned(), with_default(stage));
    }
    pipeline.insert("filters".to_owned(), json!({ "type": "array", "items": component("filter") }));
    pipeline.insert("target".to_owned(), json!({ "enum": ["object", "joint", "site"], "default": "object" }));
    let mut navigation = properties(&toml::Table::try_from(Navigation::default()).expect("settings are a table"));
    for part in ["odometry", "policy", "fusion"] {
        navigation.insert(part.to_owned(), component(part));
    }
    navigation.insert("faults".to_owned(), message("failures of the odometry: kind, from, to, amount", "array"));
    let pose_graph = properties(&toml::Table::try_from(Keyframes::default()).expect("settings are a table"));
    navigation.insert(
        "pose-graph".to_owned(),
        json!({ "type": "object", "properties": pose_graph, "additionalProperties": false }),
    );
    let range = json!({
        "type": "object",
        "properties": {
            "from": { "type": "number" }, "to": { "type": "number" },
            "count": { "type": "integer", "minimum": 2 }, "step": { "type": "number" },
        },
        "required": ["from", "to"],
        "additionalProperties": false,
    });
    let case = json!({
        "type": "object",
        "properties": { "label": { "type": "string" }, "set": { "type": "object" } },
        "required": ["label", "set"],
        "additionalProperties": false,
    });
    let axis = json!({
        "type": "object",
        "description": "an axis of the grid of trials",
        "properties": {
            "key": message("the dotted path of the setting; with cases and zip, the name of the axis", "string"),
            "values": message("the values of the setting", "array"),
            "range": range, "log-range": range,
            "cases": { "type": "array", "items": case, "description": "labelled sets of settings that vary together" },
            "zip": message("lists of equal length by the paths of settings that vary together", "object"),
        },
        "required": ["key"],
        "additionalProperties": false,
    });
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "seafix experiment",
        "type": "object",
        "properties": {
            "question": message("the question of the experiment, one English sentence", "string"),
            "seed": { "type": "integer", "minimum": 0, "default": 0 },
            "repetitions": { "type": "integer", "minimum": 1, "default": 1 },
            "base": message("a file with the settings that this file omits", "string"),
            "source": component("source"),
            "pipeline": { "type": "object", "properties": pipeline, "additionalProperties": false },
            "navigation": { "type": "object", "properties": navigation, "additionalProperties": false },
            "log": {
                "type": "object",
                "properties": { "images": { "enum": ["all", "thumbnails", "none"], "default": "all" } },
                "additionalProperties": false,
            },
            "vary": { "type": "array", "items": axis },
        },
        "additionalProperties": false,
    })
}

/// The schema of a component: its name, or a table with name and settings.
fn component(kind: &str) -> Value {
    component_with(kind, &["name"])
}

/// The schema of a component whose table may omit the name of the default.
fn with_default(kind: &str) -> Value {
    component_with(kind, &[])
}

fn component_with(kind: &str, required: &[&str]) -> Value {
    let kind = kind_of(kind);
    let names: Vec<Value> =
        kind.listings.iter().map(|one| json!({ "const": one.name, "description": one.summary })).collect();
    let tables: Vec<Value> = kind
        .listings
        .iter()
        .map(|one| {
            let mut settings = properties(&one.defaults);
            settings.insert("name".to_owned(), json!({ "const": one.name }));
            // Settings without a default value are unknown here.
            json!({ "type": "object", "description": one.summary, "properties": settings, "required": required })
        })
        .collect();
    json!({ "anyOf": names.into_iter().chain(tables).collect::<Vec<_>>() })
}

fn properties(defaults: &toml::Table) -> Map<String, Value> {
    defaults.iter().map(|(key, value)| (key.clone(), setting(value))).collect()
}

/// The schema of a setting, by its default.
fn setting(default: &toml::Value) -> Value {
    match default {
        // A setting with several forms, as a component, is a table or a string.
        toml::Value::Table(table) => {
            json!({ "type": ["object", "string"], "properties": properties(table) })
        }
        toml::Value::String(text) => json!({ "type": ["string", "object"], "default": text }),
        toml::Value::Integer(number) => json!({ "type": "integer", "default": number }),
        toml::Value::Float(number) => json!({ "type": "number", "default": number }),
        toml::Value::Boolean(flag) => json!({ "type": "boolean", "default": flag }),
        toml::Value::Array(_) => json!({ "type": "array" }),
        toml::Value::Datetime(_) => json!({ "type": "string" }),
    }
}
