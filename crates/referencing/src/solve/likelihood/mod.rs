//! The likelihood of the observations: its terms, its maxima and their normal equations.

pub(crate) mod descent;
mod edge_rows;
pub(crate) mod initial_poses;
pub(crate) mod leave_out;
pub(crate) mod mixed;
pub(crate) mod moved_part;
pub(crate) mod normal;
mod p3p;
pub(crate) mod pixel_cost;
pub(crate) mod pixel_terms;
pub(crate) mod point_fit;
pub(crate) mod point_terms;
pub(crate) mod profile;
pub(crate) mod residuals;
pub(crate) mod roots;
pub(crate) mod scale_error;
pub(crate) mod stereo_cameras;
mod whitened;

pub(crate) use residuals::maximum;
