//! Parsing of an experiment file and its base, with all faults at once.

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use seafix_component::{Fault, Part, place_of, read_text};
use serde::Deserialize;
use toml::{
    Spanned,
    de::{DeTable, DeValue, Deserializer},
};

use crate::experiment::Experiment;

/// The texts of an experiment: its own, then that of its base, and the settings of the command line.
#[derive(Debug, Clone, Default)]
pub(crate) struct Texts {
    files: Vec<(PathBuf, String)>,
    /// The settings, `key=value`, which override those of the files.
    settings: Vec<String>,
}

impl Texts {
    /// The texts of a single file.
    pub(crate) fn of(file: &Path, text: &str) -> Self {
        Self { files: vec![(file.to_owned(), text.to_owned())], settings: Vec::new() }
    }

    /// The texts below these settings of the command line.
    pub(crate) fn below(&self, settings: &[String]) -> Self {
        Self { settings: settings.to_vec(), ..self.clone() }
    }

    /// The setting of the command line that set the setting at `path`, or the part of it that `what` names.
    fn set_by(&self, path: &[&str], what: &str) -> Option<&String> {
        let sets = |setting: &&String| {
            let key = setting.split_once('=').map_or(setting.as_str(), |(key, _)| key.trim());
            let steps: Vec<&str> = key.split('.').collect();
            let part = steps.last().is_some_and(|last| what.contains(last));
            path.starts_with(&steps) || (part && steps.starts_with(path))
        };
        // The last of several has priority.
        self.settings.iter().rev().find(sets)
    }

    /// The fault `what` for this part of the setting at `path`, in the file that contains it or on the command line.
    pub(crate) fn fault(&self, path: &[&str], part: Part, what: &str) -> Fault {
        if let Some(setting) = self.set_by(path, what) {
            return Fault::new(what, Path::new("--set")).value(setting);
        }
        let places = self.files.iter().map(|(file, text)| (file, place_of(text, path, part)));
        // If both files contain it, the experiment's own file, which is first, has priority.
        let best = places.reduce(|best, next| match (&best.1, &next.1) {
            (Some((depth, _)), Some((deeper, _))) if deeper > depth => next,
            (None, Some(_)) => next,
            _ => best,
        });
        match best {
            Some((file, place)) => Fault::new(what, file).at(place.map(|(_, place)| place)),
            None => Fault::new(what, Path::new("the experiment")),
        }
    }
}

/// The result of parsing an experiment.
pub(crate) struct Read {
    /// The experiment without faulty settings; `None` if nothing valid remains.
    pub(crate) experiment: Option<Experiment>,
    /// The faults.
    pub(crate) faults: Vec<Fault>,
    /// The texts, for the places of later faults.
    pub(crate) texts: Texts,
}

/// Parses the experiment in `text`, the content of `file`. `base = "other.toml"` names a file with settings that apply
/// where this one has none.
pub(crate) fn experiment(file: &Path, text: &str) -> Read {
    let mut texts = Texts::of(file, text);
    let Below { table: mut full, mut faults, all, files } = below(file, text);
    texts.files.extend(files);
    let (mut own, mut reported) = sifted(file, text, &full);
    if !all {
        reported.retain(|fault| !may_stand_below(fault));
    }
    own.remove("base");
    faults.splice(0..0, reported);
    overlay(&mut full, own);
    for (key, stand_in, remedy) in [
        ("question", "why?", "state the question of the experiment in one sentence"),
        ("source", "virtual-points", "choose a source: source = \"NAME\"; `seafix list sources` lists them"),
    ] {
        if !full.contains_key(key) {
            // A setting that is present but faulty, or hidden by a syntax error, is not reported as missing.
            let named = |(_, text): &(PathBuf, String)| place_of(text, &[key], Part::Key).is_some();
            if all && !texts.files.iter().any(named) {
                faults.push(Fault::new(format!("no `{key}`"), file).remedy(remedy));
            }
            full.insert(key.to_owned(), stand_in.into());
        }
    }
    let experiment = full.try_into().map_err(|error| faults.push(Fault::in_toml(file, "", &error))).ok();
    Read { experiment, faults, texts }
}

/// The base of an experiment.
#[derive(Default)]
struct Below {
    /// The settings of the base.
    table: toml::Table,
    /// The faults in the base.
    faults: Vec<Fault>,
    /// Whether the complete base was parsed.
    all: bool,
    /// The base and its text, then those of its own base.
    files: Vec<(PathBuf, String)>,
}

/// The base of the experiment in `file`. A base of the base is a fault, but is parsed too, so that its settings are not
/// reported as missing.
fn below(file: &Path, text: &str) -> Below {
    let Some(base) = written_base(text) else { return Below { all: true, ..Below::default() } };
    let (path, own) = match base_of(file, base.as_deref()) {
        Ok(found) => found,
        Err((what, remedy)) => {
            let value = base.map(|base| format!("\"{base}\"")).unwrap_or_default();
            let fault = Texts::of(file, text).fault(&["base"], Part::Value, &what).value(value).remedy(remedy);
            return Below { faults: vec![fault], ..Below::default() };
        }
    };
    let (mut faults, mut lowest, mut all) = (Vec::new(), toml::Table::new(), true);
    let mut files = vec![(path.clone(), own.clone())];
    if let Some(second) = written_base(&own) {
        let fault = Texts::of(&path, &own).fault(&["base"], Part::Value, "a base that has a base of its own");
        faults.push(fault.remedy("remove one; an experiment has at most one base"));
        let below = base_of(&path, second.as_deref()).ok();
        all = below.as_ref().is_some_and(|(_, text)| written_base(text).is_none());
        if let Some((path, text)) = below {
            lowest = sifted(&path, &text, &toml::Table::new()).0;
            lowest.remove("base");
            files.push((path, text));
        }
    }
    let (mut table, mut reported) = sifted(&path, &own, &lowest);
    if !all {
        reported.retain(|fault| !may_stand_below(fault));
    }
    faults.extend(reported);
    table.remove("base");
    overlay(&mut lowest, table);
    Below { table: lowest, faults, all, files }
}

/// The value of `base` in a text, if there is one; the inner value is `None` if it is no string.
fn written_base(text: &str) -> Option<Option<String>> {
    let document = DeTable::parse_recoverable(text).0;
    document.get_ref().get("base").map(|base| base.get_ref().as_str().map(str::to_owned))
}

/// Whether the missing part may be in a base that could not be parsed.
fn may_stand_below(fault: &Fault) -> bool {
    fault.what.contains("needs a `name`")
}

/// The file named by `base`, and its text.
fn base_of(file: &Path, base: Option<&str>) -> Result<(PathBuf, String), (String, &'static str)> {
    let name = base.ok_or_else(|| ("a base that is not a file".to_owned(), "write base = \"FILE.toml\""))?;
    let path = file.parent().unwrap_or(Path::new("")).join(name);
    match read_text(&path) {
        Ok(text) => Ok((path, text)),
        Err(error) => Err((format!("cannot read the base ({error})"), "give a path relative to the experiment file")),
    }
}

/// Replaces the settings of `full` by those of `over`; tables are merged, all other values replaced.
fn overlay(full: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (full.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(above)) if same_component(below, &above) => {
                overlay(below, above);
            }
            (_, value) => {
                full.insert(key, value);
            }
        }
    }
}

/// Whether the settings of `above` can apply to the component in `below`: another component has other settings.
fn same_component(below: &toml::Table, above: &toml::Table) -> bool {
    above.get("name").is_none_or(|name| below.get("name").is_none_or(|known| known == name))
}

/// The valid settings of a file and its faults. A faulty setting is removed and the rest parsed again. A table over one
/// in `below` may inherit the component's name.
fn sifted(file: &Path, text: &str, below: &toml::Table) -> (toml::Table, Vec<Fault>) {
    let (mut document, errors) = DeTable::parse_recoverable(text);
    let mut faults: Vec<Fault> = errors.iter().map(|error| Fault::in_toml(file, text, error)).collect();
    let broken: Vec<Option<usize>> = faults.iter().map(|fault| fault.line).collect();
    loop {
        let mut settings = document.clone();
        settings.get_mut().remove("base");
        name(settings.get_mut(), below);
        for (key, value) in stand_ins().into_inner() {
            if settings.get_ref().get(&**key.get_ref()).is_none() {
                settings.get_mut().insert(key, value);
            }
        }
        let Err(error) = Experiment::deserialize(Deserializer::from(settings)) else { break };
        let fault = Fault::in_toml(file, text, &error);
        let path = error.span().and_then(|span| smallest(document.get_ref(), &span));
        // Consequences of a syntax error are not reported.
        if !broken.contains(&fault.line) || broken.is_empty() {
            faults.push(fault);
        }
        let Some(path) = path else { break };
        if !without(&mut document, &path) {
            break;
        }
    }
    let table = toml::Table::deserialize(Deserializer::from(document)).unwrap_or_default();
    (table, faults)
}

/// Adds the component names that only the tables below have.
fn name(settings: &mut DeTable<'_>, below: &toml::Table) {
    for (key, value) in settings.iter_mut() {
        let (DeValue::Table(own), Some(toml::Value::Table(below))) = (value.get_mut(), below.get(&**key.get_ref()))
        else {
            continue;
        };
        if let (Some(known), None) = (below.get("name").and_then(toml::Value::as_str), own.get("name")) {
            let known = DeValue::String(known.to_owned().into());
            own.insert(Spanned::new(0..0, "name".into()), Spanned::new(0..0, known));
        }
        name(own, below);
    }
}

/// Placeholders for required settings, for a file that inherits them from its base.
fn stand_ins() -> Spanned<DeTable<'static>> {
    DeTable::parse("question = 'why?'\nsource = 'virtual-points'\n").expect("two settings")
}

/// The path to the innermost setting that contains `span`.
fn smallest(table: &DeTable<'_>, span: &Range<usize>) -> Option<Vec<String>> {
    fn visit(
        path: &mut Vec<String>,
        (at, value): (Range<usize>, &Spanned<DeValue<'_>>),
        span: &Range<usize>,
        best: &mut Option<(usize, Vec<String>)>,
    ) {
        for place in [at, value.span()] {
            let holds = place.start <= span.start && span.end <= place.end;
            if holds && best.as_ref().is_none_or(|(length, _)| place.len() <= *length) {
                *best = Some((place.len(), path.clone()));
            }
        }
        match value.get_ref() {
            DeValue::Table(table) => {
                for (key, value) in table {
                    path.push(key.get_ref().to_string());
                    visit(path, (key.span(), value), span, best);
                    path.pop();
                }
            }
            DeValue::Array(list) => {
                for (k, value) in list.iter().enumerate() {
                    path.push(k.to_string());
                    visit(path, (value.span(), value), span, best);
                    path.pop();
                }
            }
            _ => {}
        }
    }
    let mut best = None;
    for (key, value) in table {
        visit(&mut vec![key.get_ref().to_string()], (key.span(), value), span, &mut best);
    }
    best.map(|(_, path)| path)
}

/// Removes the setting at `path` from the document; `false` if it is absent.
fn without(document: &mut Spanned<DeTable<'_>>, path: &[String]) -> bool {
    fn out(value: &mut DeValue<'_>, path: &[String]) -> bool {
        match (value, path) {
            (DeValue::Table(table), path) => out_of(table, path),
            (DeValue::Array(list), [step]) => {
                let Ok(k) = step.parse::<usize>() else { return false };
                let rest = list.clone().into_iter().enumerate().filter(|(i, _)| *i != k);
                *list = rest.map(|(_, value)| value).collect();
                true
            }
            (DeValue::Array(list), [step, rest @ ..]) => {
                let place = step.parse::<usize>().ok().and_then(|k| list.get_mut(k));
                place.is_some_and(|value| out(value.get_mut(), rest))
            }
            _ => false,
        }
    }
    fn out_of(table: &mut DeTable<'_>, path: &[String]) -> bool {
        let Some((step, rest)) = path.split_first() else { return false };
        if rest.is_empty() {
            return table.remove(step.as_str()).is_some();
        }
        let mut entries = table.iter_mut();
        entries.find(|(key, _)| key.get_ref() == step.as_str()).is_some_and(|(_, value)| out(value.get_mut(), rest))
    }
    out_of(document.get_mut(), path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn message(file: &Path, text: &str) -> Vec<String> {
        experiment(file, text).faults.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn all_faults_are_reported_at_once() {
        let text =
            "question = 'why'\nsorce = 'dive'\nsource = 'dive'\n[pipeline]\nsolvr = 'kabsch'\n  window = 'two'\n";
        let message = message(Path::new("e.toml"), text);
        assert_eq!(message.len(), 3, "{message:?}");
        assert!(message[0].contains("e.toml:2:1: `sorce`; did you mean `source`?"));
        assert!(message[1].contains("e.toml:5:1: `solvr`; did you mean `solver`?"));
        assert!(message[2].contains("e.toml:6:12"));
        assert!(message[2].starts_with("not a whole number of at least 0: string \"two\""), "{message:?}");
    }

    #[test]
    fn several_faults_may_stand_on_one_line_and_in_one_list() {
        let text = "source = { nam = 'dive' }\nseed = -1\nseed = 2\nrepetitions = 'x\n[[vary]]\nvalues = [1]\n\
                    [[vary]]\nkey = 'seed'\nvalus = 3\nvalues = [1]\n[log]\nimages = 'al'\nx = 1\n";
        let message = message(Path::new("e.toml"), text);
        let parts = [
            "no `question`",
            "e.toml:1:10",
            "e.toml:2:8",
            "e.toml:3:1",
            "e.toml:4:",
            "e.toml:5:1: ",
            "`key` is missing",
            "e.toml:9:1: `valus`; did you mean `values`?",
            "did you mean `all`?",
            "e.toml:13:1",
        ];
        for part in parts {
            assert!(message.iter().any(|line| line.contains(part)), "no {part} in {message:#?}");
        }
    }

    /// The place in the file is not reported for a value of the command line.
    #[test]
    fn a_value_of_the_command_line_is_at_fault_there() {
        let texts = Texts::of(Path::new("e.toml"), "[pipeline]\nsolver = 'kabsch'\n");
        let texts = texts.below(&["pipeline.solver=x".to_owned(), "source.frames=-3".to_owned()]);
        let fault = |path: &[&str], what: &str| texts.fault(path, Part::Value, what).to_string();
        assert_eq!(fault(&["pipeline", "solver", "name"], "no solver"), "no solver in --set: pipeline.solver=x");
        assert_eq!(fault(&["source"], "setting `frames`"), "setting `frames` in --set: source.frames=-3");
        assert!(fault(&["pipeline", "window"], "not a number").contains("e.toml:1"), "a value of the file");
        assert!(fault(&["source"], "setting `rate`").starts_with("setting `rate` in e.toml"), "another setting");
    }

    #[test]
    fn what_is_not_stated_is_as_in_the_base() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let base = "question = 'how far?'\nseed = 3\nsource = { name = 'dive', frames = 9 }\n";
        fs::write(at("base.toml"), base).unwrap();
        let own = "base = 'base.toml'\nquestion = 'how near?'\n[source]\nrate = 2.0\n";
        let read = experiment(&at("e.toml"), own).experiment.unwrap();
        assert_eq!((read.question.as_str(), read.seed), ("how near?", 3));
        assert_eq!((&read.source.settings["frames"], &read.source.settings["rate"]), (&9.into(), &2.0.into()));
        // Another component inherits nothing from the base's.
        let other = experiment(&at("e.toml"), "base = 'base.toml'\nsource = { name = 'virtual-points' }\n");
        let other = other.experiment.unwrap();
        assert!(other.source.settings.is_empty());

        let missing = message(&at("e.toml"), "base = 'bse.toml'\n[source]\nframes = 2\n");
        assert!(missing.len() == 1 && missing[0].contains("e.toml:1:8: \"bse.toml\""), "{missing:?}");
        assert!(message(&at("e.toml"), "base = 'base.toml'\nseeds = 4\n")[0].contains("e.toml:2"));
        fs::write(at("base.toml"), "base = 'more.toml'\n").unwrap();
        let own = "base = 'base.toml'\nsource.frames = 2\n";
        fs::write(at("more.toml"), base).unwrap();
        for lowest in ["more.toml", "base.toml", "none.toml"] {
            fs::write(at("base.toml"), format!("base = '{lowest}'\nsource = {{ rate = 2.0 }}\nsede = 2\n")).unwrap();
            let message = message(&at("e.toml"), own);
            assert!(message.len() == 2, "{message:?}");
            assert!(message[0].contains("a base of its own in") && message[0].contains("base.toml:1:8"), "{message:?}");
            assert!(message[1].contains("base.toml:3:1: `sede`; did you mean `seed`?"), "{message:?}");
        }
    }
}
