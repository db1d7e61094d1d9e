//! The messages of a log, generated (see `tests/it/generated.rs`): this project's own from `proto/seafix`, the well-known ones
//! that Foxglove and Rerun display from the descriptors in `proto/foxglove`.

#[expect(unreachable_pub, reason = "generated")]
#[rustfmt::skip]
mod generated {
    pub mod seafix {
        include!("seafix.v2.rs");
    }
    pub mod foxglove {
        #![allow(clippy::all, rustdoc::all, reason = "generated")]
        include!("foxglove.rs");
    }
    pub mod google {
        pub mod protobuf {
            #![allow(clippy::all, rustdoc::all, reason = "generated")]
            include!("google.protobuf.rs");
        }
    }
}

pub(crate) use generated::{
    foxglove,
    google::protobuf::{Duration, Timestamp},
    seafix::*,
};

/// The descriptors of this project's messages, a serialised `FileDescriptorSet`.
pub(crate) const DESCRIPTORS: &[u8] = include_bytes!("seafix.v2.bin");

/// The package, with its version, as schema names begin.
pub(crate) const PACKAGE: &str = "seafix.v2.";
