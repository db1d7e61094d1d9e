//! Foreign formats of tables and trajectories, one a file.

pub(crate) mod colmap_images;
pub(crate) mod columns;
mod compass;
pub(crate) mod layout;
pub(crate) mod named;
pub(crate) mod pose_rows;
pub(crate) mod stamp;
pub(crate) mod table;
mod units;
