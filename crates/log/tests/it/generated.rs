//! The committed message code and descriptors are what `proto/seafix/*.proto` say.
//!
//! After a change of a `.proto`: `UPDATE_PROTO=1 cargo test -p seafix-log generated`.

use std::{fs, path::Path};

use prost::Message as _;

#[test]
fn committed_code_is_what_the_protos_say() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut protos: Vec<_> = fs::read_dir(root.join("proto/seafix"))
        .unwrap()
        .map(|entry| format!("seafix/{}", entry.unwrap().file_name().into_string().unwrap()))
        .collect();
    protos.sort();
    let mut compiler = protox::Compiler::new([root.join("proto")]).unwrap();
    compiler.include_source_info(true).include_imports(true).open_files(&protos).unwrap();
    let described = compiler.file_descriptor_set();

    let out = tempfile::tempdir().unwrap();
    prost_build::Config::new().out_dir(out.path()).compile_fds(described.clone()).unwrap();
    let code = fs::read_to_string(out.path().join("seafix.v1.rs")).unwrap();

    let mut bare = described;
    bare.file.iter_mut().for_each(|file| file.source_code_info = None);
    let descriptors = bare.encode_to_vec();

    let (code_path, bare_path) = (root.join("src/proto/seafix.v1.rs"), root.join("src/proto/seafix.v1.bin"));
    if std::env::var_os("UPDATE_PROTO").is_some() {
        fs::write(&code_path, &code).unwrap();
        fs::write(&bare_path, &descriptors).unwrap();
    }
    let help = "differs from proto/seafix: run UPDATE_PROTO=1 cargo test -p seafix-log generated";
    assert!(fs::read_to_string(&code_path).unwrap_or_default() == code, "{} {help}", code_path.display());
    assert!(fs::read(&bare_path).unwrap_or_default() == descriptors, "{} {help}", bare_path.display());
}
