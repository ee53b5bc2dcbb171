//! `matrix-drag`: a torque that is linear in the angular velocity, with a symmetric matrix.

use super::formula::{Column, Epoch, Formula, Row};
use crate::math::quaternion::Quaternion;
use std::sync::LazyLock;

use glam::{DMat3, DQuat};

use super::{Declaration, Frame, Model, Parameter, ParameterDeclaration, Torque, Validity, Value, Values};
use crate::bodies::BodyFrame;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// τ = −C ω with C symmetric and without negative eigenvalues (J. Happel, H. Brenner, *Low Reynolds Number
/// Hydrodynamics*, 1965, section 5.2: the rotation tensor of a body of any shape). Several instances merge into one.
pub struct MatrixDrag;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let source = "J. Happel, H. Brenner, Low Reynolds Number Hydrodynamics, 1965, section 5.2";
    let matrix =
        ParameterDeclaration::matrix("matrix", "N m s", Frame::Body, "the symmetric matrix C with eigenvalues ≥ 0");
    Declaration::new("matrix-drag", "τ = −C ω", source)
        .dissipative()
        .parameters([matrix.valid(Validity::PositiveSemidefinite).factor()])
});
const MATRIX: usize = 0;

impl Torque {
    /// τ = −C ω, C in N m s, body axes; see [`MatrixDrag`].
    pub fn matrix_drag(matrix_body: impl Into<Parameter<DMat3>>) -> Self {
        Self::built(&MatrixDrag, [Value::Matrix(matrix_body.into())])
    }
}

impl Model for MatrixDrag {
    declared!(MatrixDrag);

    fn damping(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        // The trace is at least the greatest eigenvalue.
        let matrix = values.matrix(MATRIX).at(body);
        (matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z) / middle_moment
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let to_body = DMat3::from_quat(frame.principal_to_body);
        let matrix = to_body.transpose() * values.matrix(MATRIX).at(body) * to_body;
        let mean = |a: f64, b: f64| 0.5 * (a + b);
        let elements = [
            matrix.x_axis.x,
            matrix.y_axis.y,
            matrix.z_axis.z,
            mean(matrix.x_axis.y, matrix.y_axis.x),
            mean(matrix.x_axis.z, matrix.z_axis.x),
            mean(matrix.y_axis.z, matrix.z_axis.y),
        ];
        for (column, element) in out.iter_mut().zip(elements) {
            *column += frame.scaled(element, 1, 1);
        }
    }
}

impl Formula for MatrixDrag {
    const STEM: &'static str = "matrix_drag";
    const COLUMNS: &'static [Column] = &[Column::vector("diagonal"), Column::vector("off_diagonal")];
    const MERGES: bool = true;

    /// −C ω; C by its diagonal and its elements yx, zx, zy.
    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, _: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        let (d, o, w) = (row.vector(0), row.vector(3), omega);
        -Vector::new(
            d.x.mul_add(w.x, o.x.mul_add(w.y, o.y * w.z)),
            o.x.mul_add(w.x, d.y.mul_add(w.y, o.z * w.z)),
            o.y.mul_add(w.x, o.z.mul_add(w.y, d.z * w.z)),
        )
    }
}
