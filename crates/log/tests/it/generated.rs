//! The committed message code and descriptors are what `proto/` says.
//!
//! `proto/seafix/*.proto` are this project's. `proto/foxglove/*.bin` are the schemas of the Foxglove SDK 0.30.3 (MIT licence),
//! one `FileDescriptorSet` a message, the bytes that stand in a log.
//!
//! After a change of either: `UPDATE_PROTO=1 cargo test -p seafix-log generated`.

use std::{fs, path::Path};

use prost::Message as _;
use protox::prost_reflect::prost_types::FileDescriptorSet;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

#[test]
fn committed_code_is_generated_from_the_protos() {
    let root = Path::new(ROOT);
    let mut compiler = protox::Compiler::new([root.join("proto")]).unwrap();
    let protos = names(&root.join("proto/seafix")).map(|name| format!("seafix/{name}"));
    compiler.include_source_info(true).include_imports(true).open_files(protos).unwrap();
    let described = compiler.file_descriptor_set();
    let mut bare = described.clone();
    bare.file.iter_mut().for_each(|file| file.source_code_info = None);
    committed("seafix.v2.bin", &bare.encode_to_vec());

    let folder = root.join("proto/foxglove");
    let schemas =
        names(&folder).map(|name| FileDescriptorSet::decode(&fs::read(folder.join(name)).unwrap()[..]).unwrap());
    let mut file: Vec<_> = schemas.flat_map(|schema| schema.file).collect();
    file.sort_by(|a, b| a.name().cmp(b.name()));
    file.dedup_by(|a, b| a.name() == b.name());

    let out = tempfile::tempdir().unwrap();
    for set in [described, FileDescriptorSet { file }] {
        let mut config = prost_build::Config::new();
        config.compile_well_known_types().bytes([".foxglove"]).out_dir(out.path()).compile_fds(set).unwrap();
    }
    for name in ["seafix.v2.rs", "foxglove.rs", "google.protobuf.rs"] {
        committed(name, &fs::read(out.path().join(name)).unwrap());
    }
}

/// The names of the files of a folder, in their order.
fn names(folder: &Path) -> impl Iterator<Item = String> + use<> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names.into_iter()
}

/// Compares a file of `src/proto` with what it should be, or writes it.
fn committed(name: &str, expected: &[u8]) {
    let path = Path::new(ROOT).join("src/proto").join(name);
    if std::env::var_os("UPDATE_PROTO").is_some() {
        fs::write(&path, expected).unwrap();
    }
    let help = "differs from proto/: run UPDATE_PROTO=1 cargo test -p seafix-log generated";
    assert!(fs::read(&path).unwrap_or_default() == expected, "{} {help}", path.display());
}
