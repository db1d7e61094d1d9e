//! Constants of the normal distribution.

use nalgebra::{Cholesky, Const};

/// ½ ln 2π. The maximum of a Gaussian of d dimensions is exp(−d·½ ln 2π − ½ ln det Σ); a maximum of a density with the
/// information H has the volume exp(d·½ ln 2π − ½ ln det H).
pub(in crate::search) const HALF_LN_2PI: f64 = 0.918_938_533_204_672_7;

/// ½ ln det of a matrix.
pub(in crate::search) fn half_ln_det<const N: usize>(chol: &Cholesky<f64, Const<N>>) -> f64 {
    chol.l_dirty().diagonal().iter().map(|&x| libm::log(x)).sum()
}
