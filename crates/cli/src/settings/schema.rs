//! The JSON schema of an experiment file.

use std::collections::BTreeMap;

use seafix_component::{Bound, Field, Form, Setting, SettingsTable};
use seafix_experiment::experiment_settings;
use serde_json::{Map, Value, json};

use super::text::limits;
use crate::catalogue::{Kind, kinds};

/// The schema of an experiment file, with the registered components and all of their settings.
///
/// A file with a `base` may omit the question, the source and the names of components.
pub(crate) fn experiment() -> Value {
    let table = experiment_settings();
    let alone = Writer::new(&table, false);
    let above = Writer::new(&table, true);
    let mut definitions = Map::new();
    for kind in kinds() {
        components(&kind, &mut definitions);
    }
    definitions.insert("setting".to_owned(), Value::Object(paths(&table, &alone)));
    let Form::Table(fields) = &table.form else { unreachable!("an experiment is a table") };
    let (own, base): (Vec<Field>, Vec<Field>) = fields.iter().cloned().partition(|field| field.key != "base");
    let with_base: Vec<Field> = base
        .iter()
        .cloned()
        .map(|field| Field { required: true, ..field })
        .chain(own.iter().cloned().map(|field| Field { required: false, ..field }))
        .collect();
    let mut alone = alone.table(&own, "");
    let mut above = above.table(&with_base, "");
    for schema in [&mut alone, &mut above] {
        schema["properties"]["vary"] = json!({ "type": "array", "items": { "$ref": "#/$defs/axis" },
            "description": schema["properties"]["vary"]["description"] });
    }
    definitions.insert("axis".to_owned(), axis(&table, &definitions));
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "seafix experiment",
        "anyOf": [alone, above],
        "$defs": definitions,
    })
}

/// The writer of the schemas of one table's settings.
struct Writer {
    /// All settings by their dotted keys.
    settings: BTreeMap<String, Setting>,
    /// Whether a base may supply what a component's table omits.
    has_base: bool,
}

impl Writer {
    fn new(table: &SettingsTable, has_base: bool) -> Self {
        let settings = table.settings().into_iter().map(|setting| (setting.key.clone(), setting)).collect();
        Self { settings, has_base }
    }

    /// The schema of a table with these settings at `key`.
    fn table(&self, fields: &[Field], key: &str) -> Value {
        let properties: Map<String, Value> =
            fields.iter().map(|field| (field.key.to_owned(), self.setting(field, &below(key, field.key)))).collect();
        let required: Vec<&str> = fields.iter().filter(|field| field.required).map(|field| field.key).collect();
        json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
    }

    /// The schema of one setting, with its sentence, unit, range and default.
    fn setting(&self, field: &Field, key: &str) -> Value {
        let mut schema = self.form(&field.form, key);
        let setting = &self.settings[key];
        let limits = if matches!(field.form, Form::Table(_)) { String::new() } else { format!(" {}", limits(setting)) };
        schema["description"] = format!("{}{limits}", field.doc).into();
        if let (Some(default), false) = (&setting.default, matches!(field.form, Form::Table(_))) {
            schema["default"] = json!(default);
        }
        schema
    }

    fn form(&self, form: &Form, key: &str) -> Value {
        let range = self.settings.get(key).map(|setting| &setting.range);
        match form {
            Form::Any => json!({}),
            Form::Flag => json!({ "type": "boolean" }),
            Form::Text if range.is_some_and(|range| range.filled) => json!({ "type": "string", "minLength": 1 }),
            Form::Text => json!({ "type": "string" }),
            Form::Integer { .. } | Form::Number => {
                let name = if matches!(form, Form::Number) { "number" } else { "integer" };
                let mut schema = json!({ "type": name });
                let integer = name == "integer";
                let limits = range.map(|range| (range.min, range.max)).unwrap_or_default();
                for (limit, included, excluded) in
                    [(limits.0, "minimum", "exclusiveMinimum"), (limits.1, "maximum", "exclusiveMaximum")]
                {
                    match limit {
                        Some(Bound::Included(limit)) => schema[included] = number(limit, integer),
                        Some(Bound::Excluded(limit)) => schema[excluded] = number(limit, integer),
                        None => {}
                    }
                }
                schema
            }
            Form::Words(words) => {
                let one = |(word, meaning): &(&str, &str)| json!({ "const": word, "description": meaning });
                json!({ "anyOf": words.iter().map(one).collect::<Vec<_>>() })
            }
            Form::List { of, length } => {
                // The settings of a table in a list have keys of their own; the range of numbers is that of the list.
                let inner = matches!(**of, Form::Table(_) | Form::OneOf(_));
                let entry = if inner { format!("{key}[]") } else { key.to_owned() };
                let mut schema = json!({ "type": "array", "items": self.form(of, &entry) });
                if let Some(length) = length {
                    (schema["minItems"], schema["maxItems"]) = (json!(length), json!(length));
                }
                schema
            }
            Form::Table(fields) => self.table(fields, key),
            Form::OneOf(forms) => json!({ "anyOf": forms.iter().map(|form| self.form(form, key)).collect::<Vec<_>>() }),
            Form::Component { kind, nameless } => {
                let name = if self.has_base || *nameless { format!("{kind}-above-base") } else { (*kind).to_owned() };
                json!({ "$ref": format!("#/$defs/{name}") })
            }
        }
    }
}

/// The definitions of the components of a kind: each by itself, the choice of one, and the choice that may omit its
/// name.
fn components(kind: &Kind, definitions: &mut Map<String, Value>) {
    let singular = kind.singular;
    let mut names = Vec::new();
    let mut tables = Vec::new();
    let mut loose = Vec::new();
    let mut shared: BTreeMap<&str, Vec<Value>> = BTreeMap::new();
    for listing in &kind.listings {
        let place = format!("{singular}.{}", listing.name);
        let Form::Table(fields) = &listing.table.form else { unreachable!("settings are a table") };
        let mut own = Writer::new(&listing.table, false).table(fields, "");
        own["description"] = listing.summary.into();
        own["properties"]["name"] = json!({ "const": listing.name, "description": listing.summary });
        let required = listing.table.required();
        let required: Vec<&str> = ["name"].into_iter().chain(required.iter().map(String::as_str)).collect();
        // A component that needs a setting is no name alone.
        if required.len() == 1 {
            names.push(json!({ "const": listing.name, "description": listing.summary }));
        }
        for field in fields {
            shared
                .entry(field.key)
                .or_default()
                .push(json!({ "$ref": format!("#/$defs/{place}/properties/{}", field.key) }));
        }
        tables.push(json!({ "$ref": format!("#/$defs/{place}"), "required": required }));
        loose.push(json!({ "$ref": format!("#/$defs/{place}"), "required": ["name"] }));
        own["required"] = json!([]);
        definitions.insert(place, own);
    }
    let merged: Map<String, Value> =
        shared.into_iter().map(|(key, forms)| (key.to_owned(), json!({ "anyOf": forms }))).collect();
    let nameless = json!({ "type": "object", "properties": merged, "additionalProperties": false });
    let strict: Vec<&Value> = names.iter().chain(&tables).collect();
    definitions.insert(singular.to_owned(), json!({ "anyOf": strict }));
    let all: Vec<Value> = names.iter().chain(&loose).cloned().chain([nameless]).collect();
    definitions.insert(format!("{singular}-above-base"), json!({ "anyOf": all }));
}

/// The schema of every setting that an axis can vary, by its dotted path.
fn paths(table: &SettingsTable, writer: &Writer) -> Map<String, Value> {
    fn visit(writer: &Writer, field: &Field, key: &str, all: &mut Map<String, Value>) {
        all.insert(key.to_owned(), writer.setting(field, key));
        match &field.form {
            Form::Table(fields) => fields.iter().for_each(|inner| visit(writer, inner, &below(key, inner.key), all)),
            Form::OneOf(forms) => {
                let fields =
                    forms.iter().filter_map(|form| if let Form::Table(fields) = form { Some(fields) } else { None });
                fields.flatten().for_each(|inner| visit(writer, inner, &below(key, inner.key), all));
            }
            Form::Component { kind, .. } => {
                let kind = crate::catalogue::kind_of(kind);
                let names: Vec<&str> = kind.listings.iter().map(|listing| listing.name).collect();
                all.insert(below(key, "name"), json!({ "enum": names }));
                for listing in &kind.listings {
                    let Form::Table(fields) = &listing.table.form else { continue };
                    inner(&format!("{}.{}", kind.singular, listing.name), fields, key, all);
                }
            }
            _ => {}
        }
    }
    /// The settings of a component at `key`, whose definition is at `place`.
    fn inner(place: &str, fields: &[Field], key: &str, all: &mut Map<String, Value>) {
        for field in fields {
            let (key, place) = (below(key, field.key), format!("{place}/properties/{}", field.key));
            let schema = json!({ "$ref": format!("#/$defs/{place}") });
            match all.get_mut(&key).and_then(|known| known.get_mut("anyOf")).and_then(Value::as_array_mut) {
                Some(known) => known.push(schema),
                None => drop(all.insert(key.clone(), json!({ "anyOf": [schema] }))),
            }
            if let Form::Table(fields) = &field.form {
                inner(&place, fields, &key, all);
            }
        }
    }
    let mut all = Map::new();
    let Form::Table(fields) = &table.form else { return all };
    let varied = |field: &&Field| !["base", "vary", "published", "question"].contains(&field.key);
    fields.iter().filter(varied).for_each(|field| visit(writer, field, field.key, &mut all));
    all
}

/// The schema of an axis: a key with exactly one of its lists of values.
fn axis(table: &SettingsTable, definitions: &Map<String, Value>) -> Value {
    let writer = Writer::new(table, false);
    let settings = definitions["setting"].as_object().expect("the settings by their paths");
    let find = |key: &str| &writer.settings[&format!("vary[].{key}")];
    let describe = |key: &str, mut schema: Value| {
        schema["description"] = find(key).doc.into();
        schema
    };
    let at = |path: &String| json!({ "$ref": format!("#/$defs/setting/{path}") });
    let set: Map<String, Value> = settings.keys().map(|path| (path.clone(), at(path))).collect();
    let lists: Map<String, Value> = settings
        .keys()
        .map(|path| (path.clone(), json!({ "type": "array", "minItems": 1, "items": at(path) })))
        .collect();
    let named = |key: &str, values: Value| {
        json!({
            "type": "object",
            "properties": { "key": describe("key", json!({ "type": "string" })), key: describe(key, values) },
            "required": ["key", key],
            "additionalProperties": false,
        })
    };
    let case = json!({
        "type": "object",
        "properties": {
            "label": { "type": "string", "description": writer.settings["vary[].cases[].label"].doc },
            "set": { "type": "object", "description": writer.settings["vary[].cases[].set"].doc, "properties": set, "additionalProperties": false },
        },
        "required": ["label", "set"],
        "additionalProperties": false,
    });
    let zip = json!({ "type": "object", "properties": lists, "additionalProperties": false, "minProperties": 1 });
    let mut forms = vec![named("cases", json!({ "type": "array", "minItems": 1, "items": case })), named("zip", zip)];
    let number = json!({ "type": "number" });
    let range = |key: &str, ends: &Value, steps: &[&str]| {
        let one = |step: &&str| {
            let count = json!({ "type": "integer", "minimum": 2, "maximum": 10000 });
            json!({
                "type": "object",
                "properties": { "from": ends, "to": ends, *step: if *step == "count" { &count } else { &number } },
                "required": ["from", "to", step],
                "additionalProperties": false,
            })
        };
        describe(key, json!({ "anyOf": steps.iter().map(one).collect::<Vec<_>>() }))
    };
    let positive = json!({ "type": "number", "exclusiveMinimum": 0 });
    let ranges = [
        ("range", range("range", &number, &["count", "step"])),
        ("log-range", range("log-range", &positive, &["count"])),
    ];
    forms.extend(settings.keys().map(|path| {
        let key = json!({ "const": path, "description": find("key").doc });
        let values = describe("values", json!({ "type": "array", "minItems": 1, "items": at(path) }));
        json!({
            "type": "object",
            "properties": { "key": key, "values": values },
            "required": ["key", "values"],
            "additionalProperties": false,
        })
    }));
    let keys: Vec<&String> = settings.keys().collect();
    for (key, range) in ranges {
        forms.push(json!({
            "type": "object",
            "properties": { "key": { "enum": keys, "description": find("key").doc }, key: range },
            "required": ["key", key],
            "additionalProperties": false,
        }));
    }
    json!({ "anyOf": forms })
}

/// A limit as JSON.
fn number(limit: f64, integer: bool) -> Value {
    if integer { json!(limit as i64) } else { json!(limit) }
}

fn below(key: &str, inner: &str) -> String {
    if key.is_empty() { inner.to_owned() } else { format!("{key}.{inner}") }
}
