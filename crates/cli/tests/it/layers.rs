//! The layers of the workspace and the permitted dependencies of its packages.

use std::{collections::BTreeMap, fs, path::Path};

/// The packages from the lowest layer to the highest. A package depends on packages of lower layers only, never on one
/// of its own layer. `ARCHITECTURE.md` explains the layers.
const LAYERS: &[&[&str]] = &[
    &["seafix-derive"],
    &["seafix-component"],
    &["seafix-geometry"],
    &["seafix-vision", "seafix-referencing", "seafix-evaluation", "seafix-log"],
    &["seafix-io", "seafix-navigation", "seafix-simulation"],
    &["seafix"],
    &["seafix-data"],
    &["seafix-experiment", "seafix-report", "seafix-proptests"],
    &["seafix-cli"],
];

/// Dependencies that are forbidden although the layers permit them, with reasons.
const FORBIDDEN: &[(&str, &str, &str)] = &[
    ("seafix", "seafix-evaluation", "the library does not depend on truth"),
    ("seafix", "seafix-log", "the library writes no log"),
    ("seafix-evaluation", "seafix-referencing", "no error measure depends on the method that is measured"),
    ("seafix-report", "seafix-experiment", "a report reads logs only"),
    ("seafix-report", "seafix-data", "a report reads logs only"),
    ("seafix-report", "seafix-simulation", "a report reads logs only"),
];

/// The dependencies of each package in the workspace, without those of tests.
fn dependencies() -> BTreeMap<String, Vec<String>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let crates = fs::read_dir(root.join("crates")).unwrap().map(|entry| entry.unwrap().path());
    let packages = crates.chain([root.join("proptests")]);
    let read = |folder: std::path::PathBuf| {
        let text = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        let manifest: toml::Table = toml::from_str(&text).unwrap();
        let name = manifest["package"]["name"].as_str().unwrap().to_owned();
        let used = manifest.get("dependencies").and_then(toml::Value::as_table).into_iter().flat_map(toml::Table::keys);
        (name, used.filter(|name| name.starts_with("seafix")).cloned().collect())
    };
    packages.map(read).collect()
}

#[test]
fn every_dependency_points_to_a_lower_layer() {
    let layer = |name: &str| LAYERS.iter().position(|layer| layer.contains(&name));
    for (name, used) in dependencies() {
        let own = layer(&name).unwrap_or_else(|| panic!("`{name}` has no layer; add it to LAYERS"));
        for other in used {
            assert!(layer(&other).is_some_and(|other| other < own), "`{name}` depends on `{other}`");
            let forbidden = FORBIDDEN.iter().find(|(from, to, _)| *from == name && *to == other);
            assert!(forbidden.is_none(), "`{name}` depends on `{other}`: {}", forbidden.unwrap().2);
        }
    }
}
