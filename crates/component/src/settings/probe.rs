//! Trial values of one setting.

use super::{
    error::Refusals,
    form::{Field, Form},
};

/// A step from a table to a setting.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Step {
    /// A key of a table.
    Key(&'static str),
    /// The only key of a table, as in `{ sigmas = 3.0 }`.
    Only(&'static str),
    /// The entries of a list.
    Entry,
}

/// A setting whose values are tried; all others keep their defaults.
#[derive(Clone, Copy)]
pub(super) struct Probe<'a> {
    /// The form of the table.
    pub(super) form: &'a Form,
    /// Settings without a valid default, with a value of their form.
    pub(super) base: &'a toml::Table,
    /// The defaults of the table.
    pub(super) defaults: &'a toml::Table,
    /// The check of the table.
    pub(super) refusals: &'a Refusals,
    /// The path of the setting.
    pub(super) path: &'a [Step],
}

impl Probe<'_> {
    /// The message by which a value of the setting is refused; `other` is a further setting of its table.
    pub(super) fn rejected(&self, value: &toml::Value, other: Option<(&'static str, toml::Value)>) -> Option<String> {
        let mut table = toml::Value::Table(self.base.clone());
        let default = toml::Value::Table(self.defaults.clone());
        if let (Some((key, value)), Some((_, above))) = (other, self.path.split_last()) {
            let mut path = above.to_vec();
            path.push(Step::Key(key));
            put(&mut table, self.form, Some(&default), &path, &value);
        }
        put(&mut table, self.form, Some(&default), self.path, value);
        let toml::Value::Table(table) = table else { return None };
        let concerns = |key: &Option<String>| key.as_ref().is_none_or(|key| self.is_below(key));
        (self.refusals)(&table).into_iter().find(|error| concerns(&error.key)).map(|error| error.message)
    }

    /// Whether the setting is the one at `key` or below it.
    fn is_below(&self, key: &str) -> bool {
        let steps = key.split(['.', '[', ']']).filter(|step| !step.is_empty());
        let mut own = self.path.iter();
        let found = steps.into_iter().all(|step| match own.next() {
            Some(Step::Key(key) | Step::Only(key)) => *key == step,
            Some(Step::Entry) => step.parse::<usize>().is_ok(),
            // The only key of a table may be named by the table, as in `gate`.
            None => false,
        });
        found || key == self.path.last().map_or("", |step| if let Step::Only(key) = step { key } else { "" })
    }
}

/// Puts `value` at `path` of a table of this form, with the tables and lists that it needs.
fn put(here: &mut toml::Value, form: &Form, default: Option<&toml::Value>, path: &[Step], value: &toml::Value) {
    let Some((step, rest)) = path.split_first() else {
        *here = value.clone();
        return;
    };
    match step {
        Step::Key(key) | Step::Only(key) => {
            let inner = field(form, key).map_or(&Form::Any, |field| &field.form);
            let default = default.and_then(|value| value.get(key));
            let toml::Value::Table(table) = here else {
                *here = toml::Table::new().into();
                return put(here, form, default, path, value);
            };
            if *step == Step::Only(key) {
                table.clear();
            }
            let entry = table.entry((*key).to_owned()).or_insert_with(|| start(inner, default));
            put(entry, inner, default, rest, value);
        }
        Step::Entry => {
            let inner = entry(form).unwrap_or(&Form::Any);
            let default = default.and_then(|list| list.get(0));
            let toml::Value::Array(list) = here else { return };
            if list.is_empty() {
                list.push(start(inner, default));
            }
            // A table is tried in the first entry, because names must differ; numbers are tried in all.
            let tried = if matches!(inner, Form::Table(_)) { 1 } else { list.len() };
            list.iter_mut().take(tried).for_each(|one| put(one, inner, default, rest, value));
        }
    }
}

/// The value below which a setting is tried.
fn start(form: &Form, default: Option<&toml::Value>) -> toml::Value {
    match (form, default) {
        // Absent settings of a table have their defaults.
        (Form::List { .. }, Some(list)) => list.clone(),
        _ => form.sample(),
    }
}

/// The setting `key` of a table of this form.
fn field<'a>(form: &'a Form, key: &str) -> Option<&'a Field> {
    match form {
        Form::Table(fields) => fields.iter().find(|field| field.key == key),
        Form::OneOf(forms) => forms.iter().find_map(|form| field(form, key)),
        _ => None,
    }
}

/// The form of the entries of a list.
fn entry(form: &Form) -> Option<&Form> {
    match form {
        Form::List { of, .. } => Some(of),
        Form::OneOf(forms) => forms.iter().find_map(entry),
        _ => None,
    }
}
