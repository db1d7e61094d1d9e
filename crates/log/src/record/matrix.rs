//! Matrices of numbers, row by row.

/// Three rows of three numbers.
pub type Matrix3 = [[f64; 3]; 3];

/// Four rows of four numbers; a rigid motion `a_from_b` for column vectors.
pub type Matrix4 = [[f64; 4]; 4];

/// Six rows of six numbers; a covariance of ξ = (φ, ρ), rotation first.
pub type Matrix6 = [[f64; 6]; 6];
