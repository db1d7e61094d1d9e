//! The conditions of trials: axes, identifying columns, source and camera.

pub(crate) mod axes;
pub(crate) mod columns;
pub(crate) mod labels;
pub(crate) mod setup;
