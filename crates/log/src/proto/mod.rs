//! This project's own messages, generated from `proto/seafix` (see `tests/it/generated.rs`).

#[expect(unreachable_pub, reason = "generated")]
#[rustfmt::skip]
mod generated {
    include!("seafix.v1.rs");
}

pub(crate) use generated::*;

/// The descriptors of all of them, a serialised `FileDescriptorSet`.
pub(crate) const DESCRIPTORS: &[u8] = include_bytes!("seafix.v1.bin");

/// The package, with its version, as schema names begin.
pub(crate) const PACKAGE: &str = "seafix.v1";
