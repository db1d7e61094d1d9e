//! Solvers: the rigid motion that maps measured points onto model points.

use seafix_component::{Registry, entry};

pub(crate) mod closed_form;
pub(crate) mod covariance;
pub(crate) mod degeneracy;
mod fast_local_matrix;
mod gnc_tls;
mod horn;
mod irls;
pub(crate) mod kabsch;
mod l_bfgs;
pub(crate) mod likelihood;
pub(crate) mod line_frames;
pub(crate) mod mahalanobis;
mod nelder_mead;
mod optimiser;
mod p3p_stereo;
pub(crate) mod solver;
pub(crate) mod stereo_reprojection;
#[cfg(test)]
mod tests;
mod triad;
mod umeyama;
mod weighted_kabsch;

pub use degeneracy::Degenerate;
pub(crate) use gnc_tls::GncTls;
pub use kabsch::Kabsch;
pub use likelihood::{initial_poses::AlternativePose, scale_error::ScaleError};
pub use mahalanobis::Mahalanobis;
pub use solver::Solver;
pub use stereo_reprojection::StereoReprojection;
pub use triad::{Choose, Triad};

/// The registry of solvers.
pub static SOLVERS: Registry<dyn Solver> = Registry::new(
    "solver",
    &[
        entry!(fast_local_matrix::FastLocalMatrix),
        entry!(gnc_tls::GncTls),
        entry!(horn::Horn),
        entry!(irls::Irls),
        entry!(Kabsch),
        entry!(l_bfgs::LBfgs),
        entry!(Mahalanobis),
        entry!(nelder_mead::NelderMead),
        entry!(p3p_stereo::P3pStereo),
        entry!(StereoReprojection),
        entry!(Triad),
        entry!(umeyama::Umeyama),
        entry!(weighted_kabsch::WeightedKabsch),
    ],
);
