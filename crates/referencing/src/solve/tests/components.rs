//! The independence of the solvers: no file of `solve/` imports the file of a solver.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::solve::SOLVERS;

/// A source file below `solve/`.
struct Source {
    /// The path of its module, such as `crate::solve::kabsch`.
    module: String,
    /// The code without line comments and tests; tests may compare solvers.
    code: String,
}

fn sources(folder: &Path, module: &str, all: &mut Vec<Source>) {
    for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let stem = path.file_stem().unwrap().to_str().unwrap();
        let module = if stem == "mod" { module.to_owned() } else { format!("{module}::{stem}") };
        if module == "crate::solve" || module == "crate::solve::tests" {
            continue; // the registry names every solver, and so do the tests
        }
        if path.is_dir() {
            sources(&path, &module, all);
        } else {
            let text = fs::read_to_string(&path).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap_or_default().lines();
            let code = code.filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
            all.push(Source { module, code });
        }
    }
}

/// The paths of a use tree: `a::{b, c::d}` has `a::b` and `a::c::d`.
fn expand(tree: &str, prefix: &str, all: &mut Vec<String>) {
    let Some((head, rest)) = tree.split_once('{') else {
        let path = tree.split(" as ").next().unwrap_or_default().trim();
        return all.push(format!("{prefix}{path}"));
    };
    let prefix = format!("{prefix}{}", head.trim());
    let (mut depth, mut from) = (0, 0);
    for (i, c) in rest.char_indices() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        if (c == ',' && depth == 0) || depth < 0 {
            if !rest[from..i].trim().is_empty() {
                expand(&rest[from..i], &prefix, all);
            }
            from = i + 1;
        }
    }
}

impl Source {
    /// The solver that the file defines.
    fn component(&self) -> Option<&str> {
        let (_, rest) = self.code.split_once("impl Component for ")?;
        rest.split_whitespace().next()
    }

    /// The paths from `crate` that the file names, in `use` declarations and elsewhere.
    fn paths(&self) -> Vec<String> {
        let mut all = Vec::new();
        let path = |c: char| c.is_alphanumeric() || c == '_' || c == ':' || c == '*';
        for statement in self.code.split(';') {
            if let Some((_, tree)) = statement.rsplit_once("use ")
                && tree.chars().all(|c| path(c) || "{}, \n".contains(c))
            {
                expand(tree, "", &mut all);
            } else {
                all.extend(statement.split(|c| !path(c)).map(str::to_owned));
            }
        }
        all.into_iter().filter_map(|path| self.absolute(&path)).collect()
    }

    fn absolute(&self, mut path: &str) -> Option<String> {
        let mut module = self.module.as_str();
        if path.starts_with("crate::") {
            return Some(path.to_owned());
        }
        if let Some(rest) = path.strip_prefix("self::") {
            return Some(format!("{module}::{rest}"));
        }
        let mut relative = false;
        while let Some(rest) = path.strip_prefix("super::") {
            (module, path, relative) = (module.rsplit_once("::")?.0, rest, true);
        }
        relative.then(|| format!("{module}::{path}"))
    }
}

/// Each solver can be removed with its file and its line in the registry.
///
/// Fails if a file imports another solver's module or type, or everything of `solve` or the crate.
#[test]
fn no_file_imports_a_solver() {
    let mut all = Vec::new();
    sources(&PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src/solve"), "crate::solve", &mut all);
    let components: Vec<_> =
        all.iter().filter_map(|source| Some((source.module.as_str(), source.component()?))).collect();
    assert_eq!(components.len(), SOLVERS.names().count(), "one file for each solver: {components:?}");
    let mut imports = Vec::new();
    for source in &all {
        for path in source.paths() {
            let other = |&(module, name): &(&str, &str)| {
                let inside = path.strip_prefix(module).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"));
                let face = ["crate", "crate::solve"].iter().any(|face| {
                    path.strip_prefix(face).is_some_and(|rest| {
                        let first = rest.trim_start_matches("::").split("::").next();
                        first == Some(name) || first == Some("*")
                    })
                });
                module != source.module && (inside || face)
            };
            if components.iter().any(other) {
                imports.push(format!("{} imports {path}", source.module));
            }
        }
    }
    assert!(imports.is_empty(), "move what is shared out of the solver's file: {imports:#?}");
}

#[test]
fn use_trees_are_read_as_the_compiler_does() {
    let source = |module: &str, code: &str| Source { module: module.to_owned(), code: code.to_owned() };
    let code = "use crate::{\n    a::B,\n    solve::{C as D, e::{self, F}, g::*},\n};\npub(crate) use super::h;\nfn i() { super::j::k() }";
    let paths = source("crate::solve::x", code).paths();
    let expected = [
        "crate::a::B",
        "crate::solve::C",
        "crate::solve::e::self",
        "crate::solve::e::F",
        "crate::solve::g::*",
        "crate::solve::h",
        "crate::solve::j::k",
    ];
    assert_eq!(paths, expected);
    let nested = source("crate::solve::likelihood::x", "use super::super::irls::Irls;\nuse self::y;");
    assert_eq!(nested.paths(), ["crate::solve::irls::Irls", "crate::solve::likelihood::x::y"]);
}
