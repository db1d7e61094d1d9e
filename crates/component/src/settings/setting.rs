//! All settings of a table, with their sentences, units, ranges and defaults.

use std::{fmt, sync::Arc};

use super::{
    error::Refusals,
    form::{Field, Form},
    probe::{Probe, Step},
    range::{Range, range},
    unit::unit,
};

/// A table of settings with its check.
#[derive(Clone)]
pub struct SettingsTable {
    /// The form of the table.
    pub form: Form,
    /// The settings with their default values.
    pub defaults: toml::Table,
    /// The check.
    pub refusals: Arc<Refusals>,
}

impl fmt::Debug for SettingsTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SettingsTable").field("defaults", &self.defaults).finish_non_exhaustive()
    }
}

/// A setting of a table, or of a table below it.
#[derive(Debug, Clone)]
pub struct Setting {
    /// The dotted key: `fit.radius`, and `lamps[].power` in a list of tables.
    pub key: String,
    /// The sentence: meaning, unit, and the reason of the default.
    pub doc: &'static str,
    /// The unit; `1` for a pure number, empty if it is no number, `None` if the sentence states none.
    pub unit: Option<&'static str>,
    /// The range.
    pub range: Range,
    /// The form of the value.
    pub form: Form,
    /// The default value, if there is one.
    pub default: Option<toml::Value>,
}

impl SettingsTable {
    /// All settings of the table, those of an inner table after its own setting.
    pub fn settings(&self) -> Vec<Setting> {
        let base = self.base();
        let mut all = Vec::new();
        self.visit(&base, &self.form, &mut Vec::new(), Some(&self.defaults.clone().into()), &mut all);
        all
    }

    /// The sentence and the unit of the setting with this dotted key; `None` if the table has no such setting.
    ///
    /// It tries no values, so that a unit that only the range states is unknown.
    pub fn sentence(&self, key: &str) -> Option<(&'static str, Option<&'static str>)> {
        let steps: Vec<&str> = key.split('.').collect();
        let field = below(&self.form, &steps)?;
        Some((field.doc, unit(&field.form, field.doc, "")))
    }

    /// The settings without a valid default.
    pub fn required(&self) -> Vec<String> {
        self.base().keys().cloned().collect()
    }

    /// Values for the settings whose default is invalid, such as the path of a data set.
    fn base(&self) -> toml::Table {
        let mut base = toml::Table::new();
        let Form::Table(fields) = &self.form else { return base };
        base.extend(
            fields.iter().filter(|field| field.required).map(|field| (field.key.to_owned(), field.form.sample())),
        );
        for _ in 0..fields.len() {
            let invalid = (self.refusals)(&base).into_iter().filter_map(|error| error.key).next();
            let Some(field) = fields.iter().find(|field| Some(field.key) == invalid.as_deref()) else { break };
            if base.contains_key(field.key) {
                break;
            }
            base.insert(field.key.to_owned(), field.form.sample());
        }
        base
    }

    fn visit(
        &self,
        base: &toml::Table,
        form: &Form,
        path: &mut Vec<Step>,
        default: Option<&toml::Value>,
        all: &mut Vec<Setting>,
    ) {
        match form {
            Form::Table(fields) => {
                for field in fields {
                    path.push(Step::Key(field.key));
                    self.one(base, field, fields, path, default.and_then(|table| table.get(field.key)), all);
                    path.pop();
                }
            }
            Form::List { of, .. } => {
                path.push(Step::Entry);
                self.visit(base, of, path, default.and_then(|list| list.get(0)), all);
                path.pop();
            }
            Form::OneOf(forms) => {
                for form in forms {
                    let Form::Table(fields) = form else { continue };
                    for field in fields {
                        path.push(Step::Only(field.key));
                        self.one(base, field, &[], path, default.and_then(|table| table.get(field.key)), all);
                        path.pop();
                    }
                }
            }
            _ => {}
        }
    }

    fn one(
        &self,
        base: &toml::Table,
        field: &Field,
        siblings: &[Field],
        path: &mut Vec<Step>,
        default: Option<&toml::Value>,
        all: &mut Vec<Setting>,
    ) {
        let (form, refusals) = (&self.form, &*self.refusals);
        let probe = Probe { form, base, defaults: &self.defaults, refusals, path };
        let others: Vec<Field> = siblings.iter().filter(|other| other.key != field.key).cloned().collect();
        let range = range(&probe, &field.form, &others);
        let unit = unit(&field.form, field.doc, &range.words);
        let key = dotted(path);
        all.push(Setting { key, doc: field.doc, unit, range, form: field.form.clone(), default: default.cloned() });
        self.visit(base, &field.form, path, default, all);
    }
}

/// The setting at the end of `steps` in a value of this form.
fn below<'a>(form: &'a Form, steps: &[&str]) -> Option<&'a Field> {
    match form {
        Form::Table(fields) => {
            let (first, rest) = steps.split_first()?;
            let field = fields.iter().find(|field| field.key == *first)?;
            if rest.is_empty() { Some(field) } else { below(&field.form, rest) }
        }
        Form::List { of, .. } => below(of, steps),
        Form::OneOf(forms) => forms.iter().find_map(|form| below(form, steps)),
        _ => None,
    }
}

fn dotted(path: &[Step]) -> String {
    let mut key = String::new();
    for step in path {
        match step {
            Step::Key(name) | Step::Only(name) => {
                if !key.is_empty() {
                    key.push('.');
                }
                key += name;
            }
            Step::Entry => key += "[]",
        }
    }
    key
}
