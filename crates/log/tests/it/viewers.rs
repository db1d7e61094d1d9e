//! The layouts of viewers show topics that logs have.

use std::{fs, path::Path};

fn viewers(name: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/viewers").join(name)).unwrap()
}

/// The quoted paths that begin with a slash.
fn paths(text: &str) -> Vec<String> {
    text.split('"')
        .skip(1)
        .step_by(2)
        .filter(|word| word.starts_with('/') && word.len() > 1)
        .map(str::to_owned)
        .collect()
}

/// The topics of the table in the documentation of the crate.
fn documented() -> Vec<String> {
    let source = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")).unwrap();
    let rows = source.lines().filter(|line| line.starts_with("//! | `/"));
    let first = rows.map(|line| line.split('|').nth(1).unwrap().to_owned());
    first.flat_map(|cell| cell.split('`').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>()).collect()
}

/// Fails if a topic is renamed and a layout keeps its old name.
#[test]
fn a_layout_shows_topics_of_a_log() {
    let topics = documented();
    assert!(topics.contains(&"/camera/left/image".to_owned()), "{topics:?}");
    for name in ["foxglove.json", "blueprint.py"] {
        let shown = paths(&viewers(name));
        assert!(shown.len() > 4, "{name}: {shown:?}");
        for path in shown {
            // A plot names a field of a message, a blueprint the folder of several topics.
            let topic = path.split('.').next().unwrap().trim_end_matches("/**");
            assert!(topics.iter().any(|known| known.starts_with(topic)), "{name} shows {path}");
        }
    }
    let _: serde_json::Value = serde_json::from_str(&viewers("foxglove.json")).unwrap();
}
