//! Functions of a body, with what is added up in each.

use glam::DVec3;
use polhode::kernel::rigid_body::{Body, Correction, State};
use polhode::math::quaternion::Quaternion;
use polhode::math::real::Scalar;
use polhode::math::vector::{TwoWords, Vector};

use super::{Case, FEW_ROUNDINGS, REAL, VECTOR, bodies, two_vectors, v_out, vector};

/// Columns 0 to 5: 1/I in two words.
fn body<T: Scalar>(row: &[T]) -> Body<T> {
    Body::new(TwoWords { value: vector(row, 0), residue: vector(row, 3) })
}

/// Functions of a body: columns are 1/I, its residue, m, its residue.
pub fn body_cases<T: Scalar>() -> Vec<Case<T>> {
    fn state<T: Scalar>(row: &[T]) -> State<T> {
        let zero = T::from_f64(0.0);
        let q = Quaternion::new(zero, zero, zero, zero);
        State {
            orientation: TwoWords { value: q, residue: q },
            angular_momentum_principal: TwoWords { value: vector(row, 6), residue: vector(row, 9) },
            status: zero,
        }
    }
    /// The body with half of 1/I, and the correction carried to it.
    fn carried<T: Scalar>(row: &[T], correction: Correction<T>) -> (Body<T>, Correction<T>) {
        let half = T::from_f64(0.5);
        let changed = Body::new(TwoWords { value: vector(row, 0) * half, residue: vector(row, 3) * half });
        let ratio = Vector::new(half, half, half);
        (changed, changed.carried_correction(&body(row), &correction, ratio, vector(row, 6)))
    }
    /// |a| |b|, component by component.
    fn products<T: Scalar>(a: Vector<T>, b: Vector<T>) -> DVec3 {
        plain(a).abs() * plain(b).abs()
    }
    fn plain<T: Scalar>(v: Vector<T>) -> DVec3 {
        DVec3::new(v.x.to_f64(), v.y.to_f64(), v.z.to_f64())
    }
    /// The differences of 1/I are exact, and the second words are sums of what is lost in them and of two residues.
    fn of_differences<T: Scalar>(row: &[T]) -> Vec<f64> {
        let gyroscopic = body(row).gyroscopic;
        let lost = plain(gyroscopic.value).abs() * T::UNIT_ROUNDOFF;
        let residues = plain(vector(row, 3)).abs();
        let residue = lost + DVec3::new(residues.z + residues.y, residues.x + residues.z, residues.y + residues.x);
        [plain(gyroscopic.value).to_array(), residue.to_array()].concat()
    }
    fn of_velocity<T: Scalar>(row: &[T]) -> Vec<f64> {
        let [inverse, residue, m, m_residue] = [0, 3, 6, 9].map(|first| vector(row, first));
        (products(inverse, m) + products(inverse, m_residue) + products(residue, m)).to_array().to_vec()
    }
    fn of_gyroscopic_term<T: Scalar>(row: &[T]) -> Vec<f64> {
        let (gyroscopic, m) = (body(row).gyroscopic, vector(row, 6));
        let pairs = Vector::new(m.y * m.z, m.z * m.x, m.x * m.y);
        (products(gyroscopic.value, pairs) + products(gyroscopic.residue, pairs)).to_array().to_vec()
    }
    /// Products of a residue and a value, which is all that a correction of the angular velocity consists of.
    fn of_residues<T: Scalar>(row: &[T]) -> Vec<f64> {
        let [inverse, residue, m, m_residue] = [0, 3, 6, 9].map(|first| vector(row, first));
        // What m lacks, and twice what 1/I does, of which one goes again.
        (products(inverse, m_residue) + 2.0 * products(residue, m)).to_array().to_vec()
    }
    fn of_energy<T: Scalar>(row: &[T]) -> Vec<f64> {
        let [inverse, m] = [0, 6].map(|first| vector(row, first));
        vec![0.5 * products(inverse, m).dot(plain(m).abs())]
    }
    macro_rules! with_body {
        ($line:literal) => {
            concat!(
                "let body = body_new(TwoWordsVector(v(0u), v(3u))); let m = TwoWordsVector(v(6u), v(9u));",
                "let zero = quaternion(0.0, 0.0, 0.0, 0.0);",
                "let c = correction(body, State(TwoWordsQuaternion(zero, zero), m, 0.0));",
                $line
            )
        };
    }
    let case = |name, line, fields, twin, sizes: fn(&[T]) -> Vec<f64>| Case {
        name,
        line,
        columns: 12,
        fields,
        twin,
        ulps: FEW_ROUNDINGS,
        sizes: Some(sizes),
        rows: bodies::<T>,
    };
    vec![
        case(
            "body_new",
            with_body!("put_v(0u, body.gyroscopic.value); put_v(3u, body.gyroscopic.residue);"),
            &[VECTOR, VECTOR],
            |row| two_vectors(body(row).gyroscopic),
            of_differences::<T>,
        ),
        case(
            "correction and angular_velocity",
            with_body!("put_v(0u, angular_velocity(body, m.value, c));"),
            &[VECTOR],
            |row| {
                let body = body(row);
                v_out(body.angular_velocity(vector(row, 6), &body.correction(&state(row))))
            },
            of_velocity::<T>,
        ),
        case(
            "correction and gyroscopic_term",
            with_body!("put_v(0u, gyroscopic_term(body, m.value, c));"),
            &[VECTOR],
            |row| {
                let body = body(row);
                v_out(body.gyroscopic_term(vector(row, 6), &body.correction(&state(row))))
            },
            of_gyroscopic_term::<T>,
        ),
        case(
            "carried_correction and gyroscopic_term",
            with_body!(
                "let changed = body_new(TwoWordsVector(v(0u) * 0.5, v(3u) * 0.5));
                 let carried = carried_correction(changed, body, c, vector(0.5, 0.5, 0.5), m.value);
                 put_v(0u, gyroscopic_term(changed, m.value, carried));"
            ),
            &[VECTOR],
            |row| {
                let (changed, carried) = carried(row, body(row).correction(&state(row)));
                v_out(changed.gyroscopic_term(vector(row, 6), &carried))
            },
            of_gyroscopic_term::<T>,
        ),
        case(
            "carried_correction of the angular velocity",
            with_body!(
                "let changed = body_new(TwoWordsVector(v(0u) * 0.5, v(3u) * 0.5));
                     let carried = carried_correction(changed, body, c, vector(0.5, 0.5, 0.5), m.value);
                     put_v(0u, angular_velocity(changed, vector(0.0, 0.0, 0.0), carried));"
            ),
            &[VECTOR],
            |row| {
                let (changed, carried) = carried(row, body(row).correction(&state(row)));
                v_out(changed.angular_velocity(Vector::zero(), &carried))
            },
            of_residues::<T>,
        ),
        case(
            "kinetic_energy",
            with_body!("put_r(0u, kinetic_energy(body, m.value));"),
            &[REAL],
            |row| vec![body(row).kinetic_energy(vector(row, 6))],
            of_energy::<T>,
        ),
    ]
}
