//! What several test files share: golden cases, attitude errors.
#![allow(dead_code)] // each test file uses a part of it

use glam::{DMat3, DQuat, DVec3};

pub mod double_double;
pub mod golden;
pub mod meshes;
pub mod stepped;
pub mod torque_kernel;

/// The angle of the rotation between two orientations, rad, in [0, π]; both are unit quaternions.
pub fn attitude_error(a: DQuat, b: DQuat) -> f64 {
    let between = a.conjugate() * b;
    2.0 * between.xyz().length().atan2(between.w.abs())
}

/// |a − b| / |b|, or |a − b| where b vanishes.
pub fn relative_error(a: DVec3, b: DVec3) -> f64 {
    let length = b.length();
    (a - b).length() / if length > 0.0 { length } else { 1.0 }
}

/// The matrix with these rows.
pub fn from_rows(rows: [[f64; 3]; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(&rows).transpose()
}

/// The observed order from steps and errors: the slope of log₂ error over log₂ dt by least squares.
pub fn fitted_order(errors: &[(f64, f64)]) -> f64 {
    let count = errors.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| errors.iter().map(f).sum::<f64>() / count;
    let (x, y) = (mean(&|p| p.0.log2()), mean(&|p| p.1.log2()));
    mean(&|p| (p.0.log2() - x) * (p.1.log2() - y)) / mean(&|p| (p.0.log2() - x).powi(2))
}
