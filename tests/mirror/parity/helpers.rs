//! Arithmetic of vectors and quaternions, sums in two words, sines and cosines.

use polhode::kernel::rigid_body::{Body, angular_momentum_world, orientation_rate};
use polhode::math::quaternion::{norm_correction, norm_correction_of_step};
use polhode::math::real::{Scalar, finite_or, sin_cos, sin_cos_eighth};
use polhode::math::vector::{TwoWords, Vector, accumulate};

use super::bodies::body_cases;
use super::{
    Case, EXACT, FEW_ROUNDINGS, MORE_ROUNDINGS, QUATERNION, REAL, SIN_COS_ULPS, VECTOR, angles, numbers, q_out,
    quaternion, small_angles, two_vectors, v_out, vector,
};

pub fn cases<T: Scalar>() -> Vec<Case<T>> {
    let case = |name, line, columns, fields, twin, ulps| Case {
        name,
        line,
        columns,
        fields,
        twin,
        ulps,
        sizes: None,
        rows: numbers::<T>,
    };
    let mut cases = vec![
        case(
            "mul_add",
            "put_r(0u, mul_add(r(0u), r(1u), r(2u)));",
            3,
            &[REAL],
            |row| vec![row[0].mul_add(row[1], row[2])],
            FEW_ROUNDINGS,
        ),
        case(
            "finite_or",
            // A power that overflows for a part of the rows, the root of a negative number for another.
            "var x = abs(r(0u)) + 1e30; for (var n = 0u; n < 6u; n += 1u) { x = x * x; } \
             x = select(select(r(0u), x, r(1u) < 0.0), sqrt(-1.0 - abs(r(0u))), r(2u) < 0.0); put_r(0u, finite_or(x, 7.0));",
            3,
            &[REAL],
            |row| {
                let (zero, seven) = (T::from_f64(0.0), T::from_f64(7.0));
                let overflow = T::from_f64(f64::INFINITY);
                let x = if row[1] < zero { overflow } else { row[0] };
                vec![finite_or(if row[2] < zero { (-T::from_f64(1.0)).sqrt() } else { x }, seven)]
            },
            EXACT,
        ),
        case("rounded", "put_r(0u, rounded(r(0u)));", 1, &[REAL], |row| vec![row[0]], EXACT),
        case("separated", "put_r(0u, separated(r(0u)));", 1, &[REAL], |row| vec![row[0]], EXACT),
        case("rounded_vector", "put_v(0u, rounded_vector(v(0u)));", 3, &[VECTOR], |row| row.to_vec(), EXACT),
        case(
            "rounded_quaternion",
            "put_q(0u, rounded_quaternion(q(0u)));",
            4,
            &[QUATERNION],
            |row| row.to_vec(),
            EXACT,
        ),
        case(
            "dot_vector",
            "put_r(0u, dot_vector(v(0u), v(3u)));",
            6,
            &[REAL],
            |row| vec![vector(row, 0).dot(vector(row, 3))],
            FEW_ROUNDINGS,
        ),
        case(
            "cross_vector",
            "put_v(0u, cross_vector(v(0u), v(3u)));",
            6,
            &[VECTOR],
            |row| v_out(vector(row, 0).cross(vector(row, 3))),
            FEW_ROUNDINGS,
        ),
        case(
            "axpy_vector",
            "put_v(0u, axpy_vector(v(0u), r(3u), v(4u)));",
            7,
            &[VECTOR],
            |row| v_out(vector(row, 0).axpy(row[3], vector(row, 4))),
            FEW_ROUNDINGS,
        ),
        case(
            "axpy_quaternion",
            "put_q(0u, axpy_quaternion(q(0u), r(4u), q(5u)));",
            9,
            &[QUATERNION],
            |row| q_out(quaternion(row, 0).axpy(row[4], quaternion(row, 5))),
            FEW_ROUNDINGS,
        ),
        case(
            "norm_squared",
            "put_r(0u, norm_squared(q(0u)));",
            4,
            &[REAL],
            |row| vec![quaternion(row, 0).norm_squared()],
            FEW_ROUNDINGS,
        ),
        case(
            "product",
            "put_q(0u, product(q(0u), q(4u)));",
            8,
            &[QUATERNION],
            |row| q_out(quaternion(row, 0).product(quaternion(row, 4))),
            FEW_ROUNDINGS,
        ),
        case(
            "product_vector",
            "put_q(0u, product_vector(q(0u), v(4u)));",
            7,
            &[QUATERNION],
            |row| q_out(quaternion(row, 0).product_vector(vector(row, 4))),
            FEW_ROUNDINGS,
        ),
        case(
            "conjugate",
            "put_q(0u, conjugate(q(0u)));",
            4,
            &[QUATERNION],
            |row| q_out(quaternion(row, 0).conjugate()),
            EXACT,
        ),
        case(
            "rotate",
            "put_v(0u, rotate(q(0u), v(4u)));",
            7,
            &[VECTOR],
            |row| v_out(quaternion(row, 0).rotate(vector(row, 4))),
            MORE_ROUNDINGS,
        ),
        case(
            "rotate_inverse",
            "put_v(0u, rotate_inverse(q(0u), v(4u)));",
            7,
            &[VECTOR],
            |row| v_out(quaternion(row, 0).rotate_inverse(vector(row, 4))),
            MORE_ROUNDINGS,
        ),
        case(
            "norm_correction",
            "put_q(0u, norm_correction(q(0u)));",
            4,
            &[QUATERNION],
            |row| q_out(norm_correction(quaternion(row, 0))),
            FEW_ROUNDINGS,
        ),
        case(
            "norm_correction_of_step",
            "put_q(0u, norm_correction_of_step(q(0u), q(4u)));",
            8,
            &[QUATERNION],
            |row| q_out(norm_correction_of_step(quaternion(row, 0), quaternion(row, 4))),
            FEW_ROUNDINGS,
        ),
        case(
            "accumulate_vector",
            "let s = accumulate_vector(TwoWordsVector(v(0u), v(3u)), v(6u)); put_v(0u, s.value); put_v(3u, s.residue);",
            9,
            &[VECTOR, VECTOR],
            |row| {
                let sum = TwoWords { value: vector(row, 0), residue: vector(row, 3) };
                two_vectors(accumulate::<T, _>(sum, vector(row, 6)))
            },
            EXACT,
        ),
        case(
            "accumulate_quaternion",
            "let s = accumulate_quaternion(TwoWordsQuaternion(q(0u), q(4u)), q(8u)); put_q(0u, s.value); \
             put_q(4u, s.residue);",
            12,
            &[QUATERNION, QUATERNION],
            |row| {
                let sum = TwoWords { value: quaternion(row, 0), residue: quaternion(row, 4) };
                let sum = accumulate::<T, _>(sum, quaternion(row, 8));
                [q_out(sum.value), q_out(sum.residue)].concat()
            },
            EXACT,
        ),
        // two_difference is private in Rust; with residues of zero the gyroscopic coefficients are its two words.
        case(
            "two_difference",
            "let a = v(0u); let d = two_difference(a.zxy, a.yzx); put_v(0u, d.value); put_v(3u, d.residue);",
            3,
            &[VECTOR, VECTOR],
            |row| {
                let inverse_moments = TwoWords { value: vector(row, 0), residue: Vector::zero() };
                two_vectors(Body::new(inverse_moments).gyroscopic)
            },
            EXACT,
        ),
        case(
            "pair_products",
            "put_v(0u, pair_products(v(0u)));",
            3,
            &[VECTOR],
            |row| vec![row[1] * row[2], row[2] * row[0], row[0] * row[1]],
            EXACT,
        ),
        case(
            "orientation_rate",
            "put_q(0u, orientation_rate(q(0u), v(4u)));",
            7,
            &[QUATERNION],
            |row| q_out(orientation_rate(quaternion(row, 0), vector(row, 4))),
            FEW_ROUNDINGS,
        ),
        case(
            "angular_momentum_world",
            "put_v(0u, angular_momentum_world(q(0u), v(4u)));",
            7,
            &[VECTOR],
            |row| v_out(angular_momentum_world(quaternion(row, 0), vector(row, 4))),
            MORE_ROUNDINGS,
        ),
    ];
    cases.extend(body_cases());
    cases.push(Case {
        name: "sin_cos",
        line: "let s = sin_cos(r(0u)); put_r(0u, s.sin); put_r(1u, s.cos);",
        columns: 1,
        fields: &[REAL, REAL],
        twin: |row| {
            let (sin, cos) = sin_cos(row[0]);
            vec![sin, cos]
        },
        ulps: SIN_COS_ULPS,
        sizes: Some(|_| vec![1.0; 2]),
        rows: angles::<T>,
    });
    cases.push(Case {
        name: "sin_eighth and cos_eighth",
        line: "put_r(0u, sin_eighth(r(0u))); put_r(1u, cos_eighth(r(0u)));",
        columns: 1,
        fields: &[REAL, REAL],
        twin: |row| {
            let (sin, cos) = sin_cos_eighth(row[0]);
            vec![sin, cos]
        },
        ulps: SIN_COS_ULPS,
        sizes: Some(|_| vec![1.0; 2]),
        rows: small_angles::<T>,
    });
    cases
}
