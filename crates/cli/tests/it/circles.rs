//! The circles of modules: files of a crate that import each other.
//!
//! A circle stays within one folder and has two files at most. An import through a crate's `lib.rs` or a folder's
//! `mod.rs` is an import of that file, so a module imports its siblings by their path.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

/// A module's path below its crate.
type Module = Vec<String>;

/// The modules of a crate: their files with the source text, below `src`.
fn modules(src: &Path, folder: &Path, found: &mut BTreeMap<Module, (String, String)>) {
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            modules(src, &entry, found);
        } else if entry.extension().is_some_and(|end| end == "rs") && !entry.ends_with("tests.rs") {
            let file = entry.strip_prefix(src).unwrap();
            let mut module: Module = file.with_extension("").iter().map(|part| part.to_str().unwrap().into()).collect();
            if module.last().is_some_and(|last| last == "mod") || ["lib", "main"].contains(&module.join("/").as_str()) {
                module.pop();
            }
            let text = without_tests(&code(&fs::read_to_string(&entry).unwrap())).replace("$crate", "crate");
            let names: Vec<&str> = file.iter().map(|part| part.to_str().unwrap()).collect();
            found.insert(module, (names.join("/"), text));
        }
    }
}

/// The text without comments and without the contents of literals.
fn code(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    let named = |c: char| c.is_alphanumeric() || c == '_';
    while let Some(first) = rest.chars().next() {
        let hashes = rest.strip_prefix('r').map_or(0, |raw| raw.len() - raw.trim_start_matches('#').len());
        let skipped = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").unwrap() + 2
        } else if first == 'r' && rest[1 + hashes..].starts_with('"') && !out.ends_with(named)
            || rest.starts_with("br\"")
        {
            let open = rest.find('"').unwrap() + 1;
            let close = format!("\"{}", "#".repeat(hashes));
            open + rest[open..].find(&close).unwrap() + close.len()
        } else if first == '"' {
            let mut escaped = false;
            let ends = |c: char| {
                let ends = c == '"' && !escaped;
                escaped = c == '\\' && !escaped;
                ends
            };
            rest[1..].find(ends).unwrap() + 2
        } else if let Some(escape) = rest.strip_prefix("'\\") {
            // The escaped character may be a quote itself.
            let escaped = escape.chars().next().unwrap().len_utf8();
            3 + escaped + escape[escaped..].find('\'').unwrap()
        } else if first == '\'' && rest.chars().nth(2) == Some('\'') {
            rest.char_indices().nth(3).map_or(rest.len(), |(at, _)| at)
        } else {
            out.push(first);
            rest = &rest[first.len_utf8()..];
            continue;
        };
        out.push(' ');
        rest = &rest[skipped..];
    }
    out
}

/// The code without items for tests alone.
fn without_tests(code: &str) -> String {
    const MARK: &str = "#[cfg(test)]";
    let mut text = code.to_owned();
    while let Some(start) = text.find(MARK) {
        let mut depth = 0;
        let ends = |(at, c): (usize, char)| {
            depth += i32::from("{[(".contains(c)) - i32::from("}])".contains(c));
            (depth == 0 && (c == ';' || c == '}') || depth < 0).then_some(at + 1)
        };
        let item = start + MARK.len();
        let import = text[item..].trim_start().split(';').next().is_some_and(|item| item.contains("use "));
        let end = match import && !text[item..].trim_start().starts_with("mod") {
            true => text[item..].find(';').map(|at| at + 1),
            false => text[item..].char_indices().find_map(ends),
        };
        text.replace_range(start..item + end.unwrap_or(text.len() - item), "");
    }
    text
}

/// The paths of a tree of imports.
fn leaves(tree: &str, before: &[String], found: &mut Vec<Vec<String>>) {
    let names = |path: &str| -> Vec<String> {
        let path = path.split(" as ").next().unwrap();
        let names = path.split("::").map(|name| name.trim().to_owned());
        before
            .iter()
            .cloned()
            .chain(names.filter(|name| !name.is_empty() && name != "self" || path == "self"))
            .collect()
    };
    let tree = tree.trim();
    let Some(open) = tree.find('{') else {
        let mut path = names(tree);
        // `{self}` names what stands before it.
        if !before.is_empty() && path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        found.extend(Some(path).filter(|path| !path.is_empty()));
        return;
    };
    let before = names(&tree[..open]);
    let inner = &tree[open + 1..tree.rfind('}').unwrap()];
    let mut depth = 0;
    let parts = inner.split(|c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        c == ',' && depth == 0
    });
    parts.filter(|part| !part.trim().is_empty()).for_each(|part| leaves(part, &before, found));
}

/// All paths of a file: its imports, and paths in its code.
fn paths(text: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let named = |c: char| c.is_alphanumeric() || c == '_';
    let mut rest = String::new();
    let mut last = 0;
    for (at, _) in text.match_indices("use ") {
        if at >= last && !text[..at].ends_with(named) {
            let end = at + text[at..].find(';').unwrap_or(text.len() - at);
            leaves(&text[at + 4..end], &[], &mut found);
            rest.push_str(&text[last..at]);
            last = end;
        }
    }
    rest.push_str(&text[last..]);
    // A visibility is no import.
    let mut parts = rest.split("pub(in ");
    let first = parts.next().unwrap_or_default().to_owned();
    let rest = parts.fold(first, |rest, part| rest + part.split_once(')').map_or("", |(_, after)| after));
    let paths =
        rest.split(|c: char| !named(c) && c != ':').filter(|path| path.contains("::") && !path.starts_with(':'));
    found.extend(paths.map(|path| path.split("::").map(str::to_owned).collect()));
    found
}

/// The module that `path` in `module` names; `None` for another crate's.
fn target(module: &Module, path: &[String], known: &dyn Fn(&[String]) -> bool) -> Option<Module> {
    let child = |name: &String| known(&[module.as_slice(), std::slice::from_ref(name)].concat());
    let (mut at, mut rest) = match path.first()?.as_str() {
        "crate" => (Vec::new(), &path[1..]),
        "super" => (module.clone(), path),
        _ if child(&path[0]) => (module.clone(), path),
        _ => return None,
    };
    while rest.first().is_some_and(|name| name == "super") {
        at.pop();
        rest = &rest[1..];
    }
    for name in rest {
        at.push(name.clone());
        if !known(&at) {
            at.pop();
            break;
        }
    }
    Some(at)
}

/// The circles of a crate, each as the files it is made of.
fn circles(src: &Path) -> Vec<BTreeSet<String>> {
    let mut all = BTreeMap::new();
    modules(src, src, &mut all);
    let known = |module: &[String]| all.contains_key(module);
    let imports: BTreeMap<&Module, BTreeSet<Module>> = all
        .iter()
        .map(|(module, (_, text))| {
            let paths = paths(text);
            let found = paths.iter().filter_map(|path| target(module, path, &known));
            (module, found.filter(|found| found != module && known(found)).collect())
        })
        .collect();
    let reached: BTreeMap<&Module, BTreeSet<&Module>> = imports
        .keys()
        .map(|module| {
            let (mut seen, mut open) = (BTreeSet::new(), vec![*module]);
            while let Some(next) = open.pop() {
                open.extend(imports[next].iter().filter(|other| seen.insert(*other)));
            }
            (*module, seen)
        })
        .collect();
    let circle = |module: &Module| -> BTreeSet<String> {
        let mutual = reached[module].iter().filter(|other| reached[**other].contains(module));
        mutual.map(|other| all[*other].0.clone()).collect()
    };
    let found: BTreeSet<BTreeSet<String>> = all.keys().map(circle).filter(|circle| circle.len() > 1).collect();
    found.into_iter().collect()
}

/// The folders of files.
fn folders(files: &BTreeSet<String>) -> Vec<String> {
    let folders = files.iter().map(|file| file.rsplit_once('/').map_or("", |(folder, _)| folder).to_owned());
    folders.collect::<BTreeSet<_>>().into_iter().collect()
}

#[test]
fn a_circle_of_modules_is_a_pair_in_one_folder() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut new = String::new();
    for entry in fs::read_dir(crates).unwrap().map(|entry| entry.unwrap()) {
        let name = entry.file_name().to_str().unwrap().to_owned();
        let src = entry.path().join("src");
        if !src.is_dir() {
            continue;
        }
        for circle in circles(&src) {
            let folders = folders(&circle);
            if folders.len() == 1 && circle.len() == 2 {
                continue;
            }
            let files: Vec<&str> = circle.iter().map(String::as_str).collect();
            new += &format!("\n{name}, {} files in {folders:?}: {}", circle.len(), files.join(" "));
        }
    }
    assert!(new.is_empty(), "circles of modules; let what they share lie below them:{new}");
}

#[test]
fn paths_are_read_from_code_alone() {
    let text = "use crate::{a::{self, B}, c::D as E};\n// use crate::f;\nfn g() -> char { crate::h::i(\"crate::j\"); '\"' }\n\
                #[cfg(test)]\nmod tests { use crate::k; }\n";
    let found = paths(&without_tests(&code(text)));
    let found: Vec<String> = found.iter().map(|path| path.join("::")).collect();
    assert_eq!(found, ["crate::a", "crate::a::B", "crate::c::D", "crate::h::i"]);
}
