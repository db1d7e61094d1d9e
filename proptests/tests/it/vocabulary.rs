//! Replaced words of `GLOSSARY.md` do not occur in identifiers, file names and keys.
//!
//! A word is a part of a name between underscores, hyphens and changes of case: `max_pairs` has two. Comments and
//! strings are prose and are not tested; keys, flags and columns are identifiers.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

/// Words with a standard term.
#[rustfmt::skip]
const REPLACED: &[&str] = &[
    "astray", "bed", "belief", "beliefs", "bunched", "bunching", "chance", "chances", "considered", "crowd", "crowded",
    "crowds", "drawn", "errs", "explorer", "eye", "eyes", "fours", "glance", "glances", "glimpse", "glimpses", "haze",
    "hear", "heard", "hears", "helm", "imitate", "imitates", "imitation", "imitations", "journey", "journeys", "laid",
    "lasting", "lay", "lays", "least", "leg", "legs", "likelier", "likeliest", "look", "looked", "looks", "misfit", "misfits",
    "misnamed", "most", "passage", "passages", "realigned", "reckon", "reckoned", "reckoning", "recognise", "recogniser",
    "recognises", "referenced", "refound", "refusal", "refused", "refuses", "rival", "rivals", "rough", "roughs", "sailed", "says", "share", "shares", "shell",
    "shells", "sight", "sighting", "sightings", "sights", "standing", "standings", "station", "stations", "strain", "stretch", "stretched", "stretches", "teeth",
    "tell", "tells", "told", "tooth", "twin", "twins", "underway", "unfit", "unidentified", "unreferenced", "unrecognised",
    "voyage", "voyages", "way", "ways", "weighed", "whole", "wholes", "widen", "widened",
];

/// Permitted names, with reasons.
const EXCEPTIONS: &[(&str, &str)] = &[
    // Standard terms that contain one of the words.
    ("least_squares", "the method"),
    ("three_points_have_the_least_squares_motion", "the method"),
    ("the_covariance_of_kabsch_is_that_of_least_squares", "the method"),
    ("scipy_has_the_same_least_squares_solution", "the method"),
    ("DeadReckoning", "the method"),
    ("dead_reckoning", "the method"),
    ("dead_reckoning_grows_as_predicted", "the method"),
    ("pose_graphs_over_dead_reckoning_are_consistent", "the method"),
    ("FishEye", "a name that OpenCV's users write"),
    ("eye", "the identity matrix of a camera message"),
    ("shell", "of a command line"),
    ("Shell", "of a command line"),
    // Plain English.
    ("look_at", "where a camera points"),
    ("look_up", "in a table"),
    ("looks_like", "what a file seems to be"),
    ("looked_at", "plain verb"),
    ("looked_for", "plain verb"),
    ("look", "plain verb"),
    ("LOOK", "plain verb"),
    ("proposals_do_not_decide_between_modules_that_look_alike", "plain verb"),
    ("neighbours_decide_where_all_points_look_alike", "plain verb"),
    ("a_report_grows_with_its_rows_at_most", "plain English"),
    // Fields of `coherence-problem/1` and of the log's schema.
    ("shell_half_m", "coherence-problem/1"),
];

/// Keys of unchanged file formats, and file names.
const KEY_EXCEPTIONS: &[(&str, &str)] =
    &[("bed", "seafix-geometry/1"), ("dead_reckoning", "the method"), ("least_squares", "the method")];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace").to_owned()
}

/// All files below a folder, except built and generated ones.
fn files(folder: &Path, all: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = entry.file_name().unwrap().to_str().unwrap();
        if entry.is_dir() {
            if !["target", ".git", "proto"].contains(&name) {
                files(&entry, all);
            }
        } else {
            all.push(entry);
        }
    }
}

/// The words of a name, in lower case.
fn words(name: &str) -> Vec<String> {
    let mut words = Vec::new();
    for part in name.split(['_', '-', '.']) {
        let letters: Vec<char> = part.chars().collect();
        let mut word = String::new();
        for (k, &letter) in letters.iter().enumerate() {
            let begins = letter.is_uppercase()
                && k > 0
                && (letters[k - 1].is_lowercase() || letters.get(k + 1).is_some_and(|next| next.is_lowercase()));
            if begins && !word.is_empty() {
                words.push(std::mem::take(&mut word));
            }
            word.extend(letter.to_lowercase());
        }
        if !word.is_empty() {
            words.push(word);
        }
    }
    words
}

/// The identifiers of a Rust source, without comments, strings and characters.
fn identifiers(source: &str) -> Vec<&str> {
    let (mut found, bytes, mut at) = (Vec::new(), source.as_bytes(), 0);
    let ident = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_';
    let find = |from: usize, what: &str| source[from..].find(what).map_or(bytes.len(), |end| from + end + what.len());
    while at < bytes.len() {
        let rest = &source[at..];
        if rest.starts_with("//") {
            at = find(at, "\n");
        } else if rest.starts_with("/*") {
            at = find(at + 2, "*/");
        } else if bytes[at] == b'"' {
            at += 1;
            while at < bytes.len() && bytes[at] != b'"' {
                at += if bytes[at] == b'\\' { 2 } else { 1 };
            }
            at += 1;
        } else if bytes[at] == b'\'' {
            // A character, or a lifetime.
            let character =
                rest[1..].chars().next().is_some_and(|c| c == '\\' || rest[1 + c.len_utf8()..].starts_with('\''));
            if character {
                at += 1;
                while at < bytes.len() && bytes[at] != b'\'' {
                    at += if bytes[at] == b'\\' { 2 } else { 1 };
                }
            }
            at += 1;
        } else if bytes[at].is_ascii_alphabetic() || bytes[at] == b'_' {
            let end = (at..bytes.len()).find(|&k| !ident(bytes[k])).unwrap_or(bytes.len());
            let name = &source[at..end];
            let hashes = bytes[end..].iter().take_while(|&&byte| byte == b'#').count();
            if ["r", "br", "cr"].contains(&name) && bytes.get(end + hashes) == Some(&b'"') {
                at = find(end + hashes + 1, &format!("\"{}", "#".repeat(hashes)));
            } else {
                found.push(name);
                at = end;
            }
        } else if bytes[at].is_ascii_digit() {
            at = (at..bytes.len()).find(|&k| !ident(bytes[k])).unwrap_or(bytes.len());
        } else {
            at += rest.chars().next().map_or(1, char::len_utf8);
        }
    }
    found
}

/// The keys of a TOML file, tables included.
fn keys(source: &str) -> Vec<String> {
    fn of(value: &toml::Value, all: &mut Vec<String>) {
        match value {
            toml::Value::Table(table) => table.iter().for_each(|(key, value)| {
                all.extend(key.split('.').map(str::to_owned));
                of(value, all);
            }),
            toml::Value::Array(list) => list.iter().for_each(|value| of(value, all)),
            _ => {}
        }
    }
    let mut all = Vec::new();
    of(&source.parse::<toml::Table>().map(toml::Value::Table).expect("TOML"), &mut all);
    all
}

fn replaced(name: &str, exceptions: &[(&str, &str)]) -> bool {
    !exceptions.iter().any(|(known, _)| *known == name)
        && words(name).iter().any(|word| REPLACED.contains(&word.as_str()))
}

/// Seen to fail with a local called `told`.
#[test]
fn no_replaced_word_is_left() {
    let mut all = Vec::new();
    ["crates", "proptests", "experiments", "examples"]
        .map(|folder| root().join(folder))
        .iter()
        .filter(|at| at.is_dir())
        .for_each(|folder| files(folder, &mut all));
    let mut left: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for path in &all {
        let place = path.strip_prefix(root()).unwrap().display().to_string();
        let mut note = |what: String| left.entry(what).or_default().push(place.clone());
        if place.ends_with("tests/it/vocabulary.rs") {
            continue;
        }
        let stem = path.file_stem().unwrap().to_str().unwrap();
        if replaced(stem, KEY_EXCEPTIONS) {
            note(format!("file {stem}"));
        }
        match path.extension().and_then(|end| end.to_str()) {
            Some("rs") => {
                let source = fs::read_to_string(path).unwrap();
                let names = identifiers(&source).into_iter().filter(|name| replaced(name, EXCEPTIONS));
                names.for_each(|name| note(name.to_owned()));
            }
            Some("toml") if place.starts_with("experiments") || place.contains("/data/") => {
                let source = fs::read_to_string(path).unwrap();
                keys(&source)
                    .iter()
                    .filter(|key| replaced(key, KEY_EXCEPTIONS))
                    .for_each(|key| note(format!("key {key}")));
            }
            _ => {}
        }
    }
    let lines: Vec<String> =
        left.iter().map(|(name, places)| format!("{name}: {} × in {}", places.len(), places[0])).collect();
    assert!(lines.is_empty(), "words that GLOSSARY.md replaces:\n{}", lines.join("\n"));
}

#[test]
fn names_fall_into_words() {
    assert_eq!(words("maxPairs_of-ICPSearch"), ["max", "pairs", "of", "icp", "search"]);
    assert_eq!(identifiers("let told = 'a'; // share\n\"way\" r#\"most\"# b'x' &'a x"), ["let", "told", "b", "a", "x"]);
}
