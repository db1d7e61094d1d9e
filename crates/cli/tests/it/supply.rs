//! Licences, forbidden crates and sources of all dependencies, by the lists of `deny.toml`.

use std::{path::Path, process::Command};

use serde_json::Value;

fn root() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A list of texts of `deny.toml`; of tables, their `crate`.
fn listed(rules: &toml::Table, section: &str, key: &str) -> Vec<String> {
    let text = |value: &toml::Value| {
        let name = value.get("crate").unwrap_or(value);
        name.as_str().unwrap().to_owned()
    };
    rules[section][key].as_array().unwrap().iter().map(text).collect()
}

/// Whether a licence expression (SPDX) can be satisfied by these licences. `/` is an old form of `OR`.
fn permits(expression: &str, allowed: &[String]) -> bool {
    let expression = expression.replace('/', " OR ");
    let mut rest: Vec<String> =
        expression.replace('(', " ( ").replace(')', " ) ").split_whitespace().rev().map(str::to_owned).collect();
    let permitted = any(&mut rest, allowed);
    rest.is_empty() && permitted
}

/// A disjunction: terms of conjunctions.
fn any(rest: &mut Vec<String>, allowed: &[String]) -> bool {
    let mut found = all(rest, allowed);
    while rest.pop_if(|word| word == "OR").is_some() {
        found |= all(rest, allowed);
    }
    found
}

fn all(rest: &mut Vec<String>, allowed: &[String]) -> bool {
    let mut found = one(rest, allowed);
    while rest.pop_if(|word| word == "AND").is_some() {
        found &= one(rest, allowed);
    }
    found
}

fn one(rest: &mut Vec<String>, allowed: &[String]) -> bool {
    let Some(mut word) = rest.pop() else { return false };
    if word == "(" {
        let found = any(rest, allowed);
        return rest.pop().is_some_and(|word| word == ")") && found;
    }
    if rest.pop_if(|next| next == "WITH").is_some() {
        word = format!("{word} WITH {}", rest.pop().unwrap_or_default());
    }
    allowed.contains(&word)
}

/// Fails where a list lacks a licence in use, or where an added dependency is forbidden or comes from another source.
#[test]
fn every_dependency_is_permitted() {
    let rules: toml::Table = toml::from_str(&std::fs::read_to_string(root().join("deny.toml")).unwrap()).unwrap();
    let (licences, sources) = (listed(&rules, "licenses", "allow"), listed(&rules, "sources", "allow-registry"));
    let banned = listed(&rules, "bans", "deny");
    let arguments = ["metadata", "--locked", "--offline", "--all-features", "--format-version", "1"];
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let output = Command::new(cargo).current_dir(root()).args(arguments).output().unwrap();
    if !output.status.success() {
        // Crates of other platforms are downloaded by `cargo fetch` only.
        println!("skipped: {}", String::from_utf8_lossy(&output.stderr));
        return;
    }
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 100);
    let mut faults = Vec::new();
    for package in packages {
        let (name, licence) = (package["name"].as_str().unwrap(), package["license"].as_str().unwrap_or_default());
        if !permits(licence, &licences) {
            faults.push(format!("{name}: licence `{licence}`"));
        }
        if banned.iter().any(|banned| banned == name) {
            faults.push(format!("{name}: a forbidden crate"));
        }
        // The workspace's own packages have no source.
        let source = package["source"].as_str().map(|source| source.trim_start_matches("registry+"));
        if source.is_some_and(|source| !sources.iter().any(|known| known == source)) {
            faults.push(format!("{name}: source `{}`", source.unwrap_or_default()));
        }
        let wild = |dependency: &&Value| dependency["req"] == "*" && dependency["path"].is_null();
        if package["source"].is_null()
            && let Some(dependency) = package["dependencies"].as_array().unwrap().iter().find(wild)
        {
            faults.push(format!("{name}: any version of {}", dependency["name"]));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn expressions_of_licences() {
    let allowed: Vec<String> = ["MIT", "Apache-2.0", "IJG"].map(str::to_owned).to_vec();
    for (expression, permitted) in [
        ("MIT", true),
        ("MIT/GPL-3.0", true),
        ("GPL-3.0", false),
        ("(MIT OR GPL-3.0) AND IJG", true),
        ("MIT AND GPL-3.0", false),
        ("MIT OR GPL-3.0 AND LGPL-2.1", true),
        ("GPL-3.0 AND (MIT", false),
        ("Apache-2.0 WITH LLVM-exception", false),
        ("", false),
    ] {
        assert_eq!(permits(expression, &allowed), permitted, "{expression}");
    }
}
