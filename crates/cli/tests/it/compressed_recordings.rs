//! Recordings that are compressed as a file or message by message, as rosbag2 writes them.

use std::fs;

use tempfile::TempDir;

use crate::{ended_with, program, recordings::sample_recording};

fn packed(bytes: &[u8]) -> Vec<u8> {
    zstd::encode_all(bytes, 3).unwrap()
}

/// A folder with the sample as `bag.mcap`.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    sample_recording(&folder.path().join("bag.mcap"));
    folder
}

fn check(folder: &TempDir, name: &str, code: i32) -> String {
    ended_with(code, program().current_dir(folder.path()).args(["check", name])).out
}

/// A compressed file, a folder of rosbag2 that lists it with or without its ending, and the plain file say the same.
/// Fails where only names that end in .mcap are recordings.
#[test]
fn a_compressed_file_is_read_like_a_plain_one() {
    let folder = folder();
    let plain = check(&folder, "bag.mcap", 0);
    let bytes = fs::read(folder.path().join("bag.mcap")).unwrap();
    let pairs = plain.lines().find(|line| line.starts_with("note: 5 pairs")).unwrap();
    for (place, listed) in
        [("bag.mcap.zstd", None), ("a/a_0.mcap.zstd", Some("a_0.mcap.zstd")), ("b/b_0.mcap.zst", Some("b_0.mcap"))]
    {
        let file = folder.path().join(place);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, packed(&bytes)).unwrap();
        let name = place.split('/').next().unwrap();
        if let Some(listed) = listed {
            let text = format!(
                "rosbag2_bagfile_information:\n  storage_identifier: mcap\n  relative_file_paths:\n    - {listed}\n  \
                 compression_format: zstd\n  compression_mode: FILE\n"
            );
            fs::write(folder.path().join(name).join("metadata.yaml"), text).unwrap();
        }
        assert!(check(&folder, name, 0).contains(pairs), "{place}");
    }
    // An experiment that names it is checked with it; as an experiment it is refused by name.
    let experiment = "question = 'Where?'\nsource = { name = 'mcap', path = 'bag.mcap.zstd', site = 'site.toml' }\n";
    fs::write(folder.path().join("e.toml"), experiment).unwrap();
    let site = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample/site.toml");
    fs::copy(site, folder.path().join("site.toml")).unwrap();
    assert!(check(&folder, "e.toml", 0).contains("in order"));
    let said = ended_with(2, program().current_dir(folder.path()).args(["run", "bag.mcap.zstd"])).error;
    assert!(said.contains("not an experiment in bag.mcap.zstd: a file compressed with zstd"), "{said}");
}

/// A file that unpacks to far more than images do ends at the limit; one that was cut off is damaged, and what was
/// unpacked of it is recovered.
#[test]
fn a_bomb_and_a_piece_are_rejected_and_the_piece_is_recovered() {
    let folder = folder();
    let mut bomb = b"\x89MCAP0\r\n".to_vec();
    bomb.resize(64 << 20, 0);
    fs::write(folder.path().join("bomb.mcap.zstd"), packed(&bomb)).unwrap();
    let said = check(&folder, "bomb.mcap.zstd", 1);
    assert!(said.contains("exceeds a limit") && said.contains("`zstd -d` it"), "{said}");
    let complete = packed(&fs::read(folder.path().join("bag.mcap")).unwrap());
    fs::write(folder.path().join("cut.mcap.zstd"), &complete[..complete.len() * 3 / 4]).unwrap();
    let said = check(&folder, "cut.mcap.zstd", 1);
    assert!(said.contains("is damaged: zstd: ") && said.contains("seafix recover"), "{said}");
    let saved = ended_with(0, program().current_dir(folder.path()).args(["recover", "cut.mcap.zstd"])).out;
    assert!(saved.starts_with("cut-recovered.mcap: "), "{saved}");
    assert!(check(&folder, "cut-recovered.mcap", 0).contains("in order"));
}

/// Files of other recorders are named although they are no text.
#[test]
fn a_binary_bag_is_named_with_its_conversion() {
    let folder = TempDir::new().unwrap();
    for (name, start, part) in [
        ("dive.bag", &b"#ROSBAG V2.0\n"[..], "a ROS 1 bag; PyPI's `rosbags-convert"),
        ("dive.db3", b"SQLite format 3\0", "a ROS 2 bag in SQLite"),
    ] {
        fs::write(folder.path().join(name), [start, &[0xFF, 0x80, 0x00]].concat()).unwrap();
        let said = check(&folder, name, 1);
        assert!(said.contains(part), "{said}");
    }
}
