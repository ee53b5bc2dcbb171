//! The cross product as a matrix.

use glam::{DMat3, DVec3};

/// \[v\]×, the matrix with \[v\]× p = v × p (the derivation's equation (1)).
///
/// Its identities, each a test: \[v\]×ᵀ = −\[v\]×, \[v\]× p = −\[p\]× v, \[v × p\]× = \[v\]×\[p\]× − \[p\]×\[v\]×
/// (Jacobi), and d(w × v)/dv = \[w\]× (equation (2)).
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::toolkit::{cross_product_matrix, vector_of_cross_product_matrix};
///
/// let (w, p) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(-4.0, 0.5, 2.0));
/// assert_eq!(cross_product_matrix(w) * p, w.cross(p));
/// assert_eq!(vector_of_cross_product_matrix(cross_product_matrix(w)), w);
/// ```
pub fn cross_product_matrix(v: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, v.z, -v.y), DVec3::new(-v.z, 0.0, v.x), DVec3::new(v.y, -v.x, 0.0))
}

/// The vector v of the antisymmetric part \[v\]× of a matrix: the inverse of [`cross_product_matrix`].
pub fn vector_of_cross_product_matrix(matrix: DMat3) -> DVec3 {
    0.5 * DVec3::new(
        matrix.y_axis.z - matrix.z_axis.y,
        matrix.z_axis.x - matrix.x_axis.z,
        matrix.x_axis.y - matrix.y_axis.x,
    )
}
