//! Reading an experiment file: all its faults at once, and the file it is based on.

use std::path::Path;

use seafix_component::{Fault, line_of, read_text};

use crate::Experiment;

/// The experiment that `file`, whose text is `text`, holds. `base = "other.toml"` names a file whose settings hold where
/// this one has none of its own.
pub(crate) fn experiment(file: &Path, text: &str) -> Result<Experiment, Vec<Fault>> {
    let own: toml::Table = toml::from_str(text).map_err(|error| vec![Fault::in_toml(file, text, &error)])?;
    let Some(base) = own.get("base") else { return parsed(file, text) };
    let fault = |what: &str| Fault::new(what, file).on_line(line_of(text, &["base"])).value(base);
    let name =
        base.as_str().ok_or_else(|| vec![fault("a base that is no file").remedy("write base = \"FILE.toml\"")])?;
    let path = file.parent().unwrap_or(Path::new("")).join(name);
    let below = read_text(&path).map_err(|error| vec![fault(&format!("no base ({error})"))])?;
    let mut whole: toml::Table = toml::from_str(&below).map_err(|error| vec![Fault::in_toml(&path, &below, &error)])?;
    if whole.contains_key("base") {
        let fault = Fault::new("a base that has a base of its own", &path).on_line(line_of(&below, &["base"]));
        return Err(vec![fault.remedy("an experiment has at most one")]);
    }
    let mut rest = own.clone();
    rest.remove("base");
    lay_over(&mut whole, rest);
    whole.try_into().map_err(|error| {
        // Each file tells its own faults, with their lines.
        let blank = blanked(text, line_of(text, &["base"]).unwrap_or(0));
        let faults: Vec<Fault> = faults(file, &blank).into_iter().chain(faults(&path, &below)).collect();
        if faults.is_empty() { vec![Fault::in_toml(file, "", &error)] } else { faults }
    })
}

fn parsed(file: &Path, text: &str) -> Result<Experiment, Vec<Fault>> {
    toml::from_str(text).map_err(|error| {
        let faults = faults(file, text);
        if faults.is_empty() { vec![Fault::in_toml(file, text, &error)] } else { faults }
    })
}

/// The settings of `over` in place of those of `whole`; tables one by one, all else as a whole.
fn lay_over(whole: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (whole.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(above)) if same_component(below, &above) => {
                lay_over(below, above);
            }
            (_, value) => {
                whole.insert(key, value);
            }
        }
    }
}

/// Whether the settings of `above` can belong to what `below` names: another component has settings of its own.
fn same_component(below: &toml::Table, above: &toml::Table) -> bool {
    above.get("name").is_none_or(|name| below.get("name").is_none_or(|known| known == name))
}

/// Every fault that the reader finds, line by line: a line with a fault is read as if it were empty. What is missing is
/// not among them.
fn faults(file: &Path, text: &str) -> Vec<Fault> {
    let (mut rest, mut faults) = (text.to_owned(), Vec::new());
    while let Err(error) = toml::from_str::<Experiment>(&rest) {
        let Some(span) = error.span().filter(|_| !error.message().starts_with("missing field")) else { break };
        let fault = Fault::in_toml(file, text, &error);
        let Some(line) = fault.line.filter(|_| !text[span].trim().is_empty()) else { break };
        let next = blanked(&rest, line);
        if next == rest || toml::from_str::<toml::Table>(&next).is_err() {
            faults.push(fault);
            break;
        }
        faults.push(fault);
        rest = next;
    }
    faults
}

/// The text with blanks for everything on one line (from 1).
fn blanked(text: &str, line: usize) -> String {
    let blank = |(index, content): (usize, &str)| match index + 1 == line {
        true => content.bytes().map(|b| if b == b'\n' { '\n' } else { ' ' }).collect(),
        false => content.to_owned(),
    };
    text.split_inclusive('\n').enumerate().map(blank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn said(file: &Path, text: &str) -> Vec<String> {
        experiment(file, text).unwrap_err().iter().map(ToString::to_string).collect()
    }

    #[test]
    fn all_faults_are_told_at_once() {
        let text = "question = 'why'\nsorce = 'dive'\nsource = 'dive'\n[pipeline]\nsolvr = 'kabsch'\nwindow = 'two'\n";
        let said = said(Path::new("e.toml"), text);
        assert_eq!(said.len(), 3, "{said:?}");
        assert!(said[0].contains("e.toml:2: `sorce`; did you mean `source`?"));
        assert!(said[1].contains("e.toml:5: `solvr`; did you mean `solver`?"));
        assert!(said[2].contains("e.toml:6"));
    }

    #[test]
    fn what_is_not_said_is_as_in_the_base() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let base = "question = 'how far?'\nseed = 3\nsource = { name = 'dive', frames = 9 }\n";
        fs::write(at("base.toml"), base).unwrap();
        let own = "base = 'base.toml'\nquestion = 'how near?'\n[source]\nrate = 2.0\n";
        let read = experiment(&at("e.toml"), own).unwrap();
        assert_eq!((read.question.as_str(), read.seed), ("how near?", 3));
        assert_eq!((&read.source.settings["frames"], &read.source.settings["rate"]), (&9.into(), &2.0.into()));
        // Another component keeps nothing of the base's.
        let other = experiment(&at("e.toml"), "base = 'base.toml'\nsource = { name = 'virtual-points' }\n").unwrap();
        assert!(other.source.settings.is_empty());

        assert!(said(&at("e.toml"), "base = 'bse.toml'\n")[0].contains("e.toml:1"));
        assert!(said(&at("e.toml"), "base = 'base.toml'\nseeds = 4\n")[0].contains("e.toml:2"));
        fs::write(at("base.toml"), "base = 'more.toml'\n").unwrap();
        assert!(said(&at("e.toml"), "base = 'base.toml'\n")[0].contains("base.toml:1"));
    }
}
