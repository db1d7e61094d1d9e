//! Executors of the shards of a sweep. Seafix partitions and merges; the engine schedules, retries and distributes.

mod array;
mod hyperqueue;
mod local;
mod slurm;

pub(crate) use array::{Array, Executor};
pub(crate) use hyperqueue::HyperQueue;
pub(crate) use local::Local;
pub(crate) use slurm::Slurm;
