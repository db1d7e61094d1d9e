//! The files and folders that a plan reads.

use std::path::{Path, PathBuf};

use crate::experiment::Plan;

impl Plan {
    /// The existing files and folders that a setting names, relative to the experiment or to the current folder.
    ///
    /// Components define their own settings, so that every text counts that is the path of something.
    pub(super) fn inputs(&self) -> Vec<PathBuf> {
        let table = toml::Value::try_from(&self.experiment).ok();
        let mut texts = Vec::new();
        table.iter().for_each(|table| collect(table, &mut texts));
        let paths = texts.iter().filter(|text| !text.is_empty());
        let paths = paths.flat_map(|text| [self.folder.join(text), Path::new(text).to_owned()]);
        paths.filter(|path| path.exists()).collect()
    }
}

fn collect(value: &toml::Value, texts: &mut Vec<String>) {
    match value {
        toml::Value::String(text) => texts.push(text.clone()),
        toml::Value::Array(list) => list.iter().for_each(|value| collect(value, texts)),
        toml::Value::Table(table) => table.values().for_each(|value| collect(value, texts)),
        _ => {}
    }
}
