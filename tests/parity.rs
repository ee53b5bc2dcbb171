//! Every shader function against its Rust twin; `step_parity.rs` has whole steps.
//!
//! Drivers may fuse products with sums, re-associate sums and draw common factors out of them. What stands behind the
//! barrier, and what is a single operation, must agree to the bit all the same; elsewhere a result may differ by as
//! many roundings as the function has.

mod common;

use common::compare::{Field, compare_rows};
use common::kernel::{Harness, chunks};
use common::random::Random;
use polhode::batch::Precision;
use polhode::elementary::functions;
use polhode::engine::gpu::shader::{Chunk, Source};
use polhode::method::Method;
use polhode::quaternion::{Quaternion, norm_correction, norm_correction_of_step};
use polhode::real::{Scalar, sin_cos, sin_cos_eighth};
use polhode::rigid_body::{Body, Correction, State, angular_momentum_world, orientation_rate};
use polhode::vector::{TwoWords, Vector, accumulate};

/// Rows of a table: not a multiple of the workgroup size.
const ROWS: usize = 331;

/// What is a single operation, or whose every intermediate is rounded behind the barrier.
const EXACT: f64 = 0.0;
/// A sum of up to four products: each may be rounded at another place.
const FEW_ROUNDINGS: f64 = 4.0;
/// Two cross products and their sum, as in a rotation.
const MORE_ROUNDINGS: f64 = 8.0;
/// Each side is within one ulp of 1 of the truth.
const SIN_COS_ULPS: f64 = 2.0;

const REAL: Field = Field { name: "real", components: 1 };
const VECTOR: Field = Field { name: "vector", components: 3 };
const QUATERNION: Field = Field { name: "quaternion", components: 4 };

/// A function of the shaders and its twin.
struct Case<T> {
    name: &'static str,
    /// The kernel; `r`, `v`, `q` read a real, vector or quaternion from a column on.
    line: &'static str,
    /// Columns that it reads.
    columns: usize,
    fields: &'static [Field],
    twin: fn(&[T]) -> Vec<T>,
    /// Bound on the difference in ulps of the largest component, or of the magnitude.
    ulps: f64,
    /// Size of what cancels in a row.
    magnitude: fn(&[T]) -> f64,
    rows: fn(usize) -> Vec<Vec<T>>,
}

fn vector<T: Scalar>(row: &[T], first: usize) -> Vector<T> {
    Vector::new(row[first], row[first + 1], row[first + 2])
}

fn quaternion<T: Scalar>(row: &[T], first: usize) -> Quaternion<T> {
    Quaternion::new(row[first], row[first + 1], row[first + 2], row[first + 3])
}

fn v_out<T: Scalar>(v: Vector<T>) -> Vec<T> {
    vec![v.x, v.y, v.z]
}

fn q_out<T: Scalar>(q: Quaternion<T>) -> Vec<T> {
    vec![q.x, q.y, q.z, q.w]
}

fn two_vectors<T: Scalar>(v: TwoWords<Vector<T>>) -> Vec<T> {
    [v_out(v.value), v_out(v.residue)].concat()
}

/// Columns 0 to 5: 1/I in two words.
fn body<T: Scalar>(row: &[T]) -> Body<T> {
    Body::new(TwoWords { value: vector(row, 0), residue: vector(row, 3) })
}

/// Largest absolute value of a row, squared or more: the size of the products that cancel.
fn largest<T: Scalar>(row: &[T], power: i32) -> f64 {
    row.iter().fold(1.0_f64, |largest, x| largest.max(x.to_f64().abs())).powi(power)
}

/// Numbers at the edges: zeros of both signs, units, powers of two on both sides of one, the least normal number's
/// neighbourhood, numbers whose squares lose the smaller digit, halves and thirds.
const EDGES: [f64; 14] =
    [0.0, -0.0, 1.0, -1.0, 0.5, -2.0, 1.0 / 3.0, 1.0 + 1.2e-7, 1.0 - 6e-8, 1e-18, -1e-12, 4096.0, -1e5, 0.999_999_9];

/// Rows over the edges, each column running through them at a pace of its own, then random ones.
fn numbers<T: Scalar>(columns: usize) -> Vec<Vec<T>> {
    let mut random = Random::new(columns as u64);
    let edge = |row: usize, column: usize| EDGES[(row / (column % 3 + 1) + 5 * column) % EDGES.len()];
    (0..ROWS)
        .map(|row| {
            (0..columns)
                .map(|column| T::from_f64(if row < 130 { edge(row, column) } else { random.between(-2.0, 2.0) }))
                .collect()
        })
        .collect()
}

/// 1/I and m, each followed by residues below half an ulp, which are zero where one word is carried.
fn bodies<T: Scalar>(_: usize) -> Vec<Vec<T>> {
    let mut random = Random::new(9);
    let mut with_residue = |value: &[T]| -> Vec<T> {
        let roundoff = if T::WORDS == 2 { T::UNIT_ROUNDOFF } else { 0.0 };
        let residues = value.iter().map(|x| T::from_f64(x.to_f64() * random.between(-0.5, 0.5) * roundoff));
        value.iter().copied().chain(residues.collect::<Vec<_>>()).collect()
    };
    numbers::<T>(6).iter().map(|row| [with_residue(&row[..3]), with_residue(&row[3..])].concat()).collect()
}

/// Angles: multiples of π/8 and their neighbours (every border between quadrants and roundings), zeros, small and
/// large ones up to the end of the stated range, and random ones.
fn angles<T: Scalar>(_: usize) -> Vec<Vec<T>> {
    let mut random = Random::new(7);
    let limit = if T::WORDS == 2 { 1024.0 } else { 1_048_576.0 };
    let mut rows: Vec<f64> = vec![0.0, -0.0, 1e-10, -1e-4, limit, -limit];
    for n in -24..=24 {
        let border = f64::from(n) * std::f64::consts::FRAC_PI_8;
        rows.extend([border, border * (1.0 + 2.0 * T::UNIT_ROUNDOFF), border * (1.0 - 2.0 * T::UNIT_ROUNDOFF)]);
    }
    rows.resize_with(ROWS, || random.between(-limit, limit));
    rows.into_iter().map(|x| vec![T::from_f64(x)]).collect()
}

/// Angles within an eighth of a turn.
fn small_angles<T: Scalar>(_: usize) -> Vec<Vec<T>> {
    let mut random = Random::new(8);
    let limit = std::f64::consts::FRAC_PI_4;
    let mut rows = vec![0.0, -0.0, limit, -limit, 1e-10, -1e-4];
    rows.resize_with(ROWS, || random.between(-limit, limit));
    rows.into_iter().map(|x| vec![T::from_f64(x)]).collect()
}

fn cases<T: Scalar>() -> Vec<Case<T>> {
    fn two<T>(row: &[T]) -> f64
    where
        T: Scalar,
    {
        largest(row, 2)
    }
    fn three<T: Scalar>(row: &[T]) -> f64 {
        largest(row, 3)
    }
    /// |q|² |v| of the largest components.
    fn rotation<T: Scalar>(row: &[T]) -> f64 {
        largest(&row[..4], 2) * largest(&row[4..], 1)
    }
    fn one<T: Scalar>(row: &[T]) -> f64 {
        largest(row, 1)
    }
    let case = |name, line, columns, fields, twin, ulps, magnitude: fn(&[T]) -> f64| Case {
        name,
        line,
        columns,
        fields,
        twin,
        ulps,
        magnitude,
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
            two::<T>,
        ),
        case("rounded", "put_r(0u, rounded(r(0u)));", 1, &[REAL], |row| vec![row[0]], EXACT, one::<T>),
        case("separated", "put_r(0u, separated(r(0u)));", 1, &[REAL], |row| vec![row[0]], EXACT, one::<T>),
        case("rounded_vector", "put_v(0u, rounded_vector(v(0u)));", 3, &[VECTOR], |row| row.to_vec(), EXACT, one::<T>),
        case(
            "rounded_quaternion",
            "put_q(0u, rounded_quaternion(q(0u)));",
            4,
            &[QUATERNION],
            |row| row.to_vec(),
            EXACT,
            one::<T>,
        ),
        case(
            "dot_vector",
            "put_r(0u, dot_vector(v(0u), v(3u)));",
            6,
            &[REAL],
            |row| vec![vector(row, 0).dot(vector(row, 3))],
            FEW_ROUNDINGS,
            two::<T>,
        ),
        case(
            "cross_vector",
            "put_v(0u, cross_vector(v(0u), v(3u)));",
            6,
            &[VECTOR],
            |row| v_out(vector(row, 0).cross(vector(row, 3))),
            FEW_ROUNDINGS,
            two::<T>,
        ),
        case(
            "axpy_vector",
            "put_v(0u, axpy_vector(v(0u), r(3u), v(4u)));",
            7,
            &[VECTOR],
            |row| v_out(vector(row, 0).axpy(row[3], vector(row, 4))),
            FEW_ROUNDINGS,
            two::<T>,
        ),
        case(
            "axpy_quaternion",
            "put_q(0u, axpy_quaternion(q(0u), r(4u), q(5u)));",
            9,
            &[QUATERNION],
            |row| q_out(quaternion(row, 0).axpy(row[4], quaternion(row, 5))),
            FEW_ROUNDINGS,
            two::<T>,
        ),
        case(
            "norm_squared",
            "put_r(0u, norm_squared(q(0u)));",
            4,
            &[REAL],
            |row| vec![quaternion(row, 0).norm_squared()],
            FEW_ROUNDINGS,
            two::<T>,
        ),
        case(
            "product",
            "put_q(0u, product(q(0u), q(4u)));",
            8,
            &[QUATERNION],
            |row| q_out(quaternion(row, 0).product(quaternion(row, 4))),
            FEW_ROUNDINGS,
            two::<T>,
        ),
        case(
            "product_vector",
            "put_q(0u, product_vector(q(0u), v(4u)));",
            7,
            &[QUATERNION],
            |row| q_out(quaternion(row, 0).product_vector(vector(row, 4))),
            FEW_ROUNDINGS,
            two::<T>,
        ),
        case(
            "conjugate",
            "put_q(0u, conjugate(q(0u)));",
            4,
            &[QUATERNION],
            |row| q_out(quaternion(row, 0).conjugate()),
            EXACT,
            one::<T>,
        ),
        case(
            "rotate",
            "put_v(0u, rotate(q(0u), v(4u)));",
            7,
            &[VECTOR],
            |row| v_out(quaternion(row, 0).rotate(vector(row, 4))),
            MORE_ROUNDINGS,
            rotation::<T>,
        ),
        case(
            "rotate_inverse",
            "put_v(0u, rotate_inverse(q(0u), v(4u)));",
            7,
            &[VECTOR],
            |row| v_out(quaternion(row, 0).rotate_inverse(vector(row, 4))),
            MORE_ROUNDINGS,
            rotation::<T>,
        ),
        case(
            "norm_correction",
            "put_q(0u, norm_correction(q(0u)));",
            4,
            &[QUATERNION],
            |row| q_out(norm_correction(quaternion(row, 0))),
            FEW_ROUNDINGS,
            three::<T>,
        ),
        case(
            "norm_correction_of_step",
            "put_q(0u, norm_correction_of_step(q(0u), q(4u)));",
            8,
            &[QUATERNION],
            |row| q_out(norm_correction_of_step(quaternion(row, 0), quaternion(row, 4))),
            FEW_ROUNDINGS,
            three::<T>,
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
            one::<T>,
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
            one::<T>,
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
            one::<T>,
        ),
        case(
            "pair_products",
            "put_v(0u, pair_products(v(0u)));",
            3,
            &[VECTOR],
            |row| vec![row[1] * row[2], row[2] * row[0], row[0] * row[1]],
            EXACT,
            two::<T>,
        ),
        case(
            "orientation_rate",
            "put_q(0u, orientation_rate(q(0u), v(4u)));",
            7,
            &[QUATERNION],
            |row| q_out(orientation_rate(quaternion(row, 0), vector(row, 4))),
            FEW_ROUNDINGS,
            two::<T>,
        ),
        case(
            "angular_momentum_world",
            "put_v(0u, angular_momentum_world(q(0u), v(4u)));",
            7,
            &[VECTOR],
            |row| v_out(angular_momentum_world(quaternion(row, 0), vector(row, 4))),
            MORE_ROUNDINGS,
            rotation::<T>,
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
        magnitude: |_| 1.0,
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
        magnitude: |_| 1.0,
        rows: small_angles::<T>,
    });
    cases
}

/// Functions of a body: columns are 1/I, its residue, m, its residue.
fn body_cases<T: Scalar>() -> Vec<Case<T>> {
    /// Products of three numbers, of which the differences of 1/I enter squared.
    fn four<T: Scalar>(row: &[T]) -> f64 {
        largest(row, 4)
    }
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
    /// Products of a residue and a value, which is all that a correction of the angular velocity consists of.
    fn of_residues<T: Scalar>(row: &[T]) -> f64 {
        let size = |first: usize| (first..first + 3).map(|column| row[column].to_f64().abs()).fold(0.0, f64::max);
        size(3) * size(6) + size(0) * size(9)
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
    let case = |name, line, fields, twin| Case {
        name,
        line,
        columns: 12,
        fields,
        twin,
        ulps: FEW_ROUNDINGS,
        magnitude: four::<T>,
        rows: bodies::<T>,
    };
    vec![
        case(
            "body_new",
            with_body!("put_v(0u, body.gyroscopic.value); put_v(3u, body.gyroscopic.residue);"),
            &[VECTOR, VECTOR],
            |row| two_vectors(body(row).gyroscopic),
        ),
        case(
            "correction and angular_velocity",
            with_body!("put_v(0u, angular_velocity(body, m.value, c));"),
            &[VECTOR],
            |row| {
                let body = body(row);
                v_out(body.angular_velocity(vector(row, 6), &body.correction(&state(row))))
            },
        ),
        case(
            "correction and gyroscopic_term",
            with_body!("put_v(0u, gyroscopic_term(body, m.value, c));"),
            &[VECTOR],
            |row| {
                let body = body(row);
                v_out(body.gyroscopic_term(vector(row, 6), &body.correction(&state(row))))
            },
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
        ),
        Case {
            magnitude: of_residues::<T>,
            ..case(
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
            )
        },
        case("kinetic_energy", with_body!("put_r(0u, kinetic_energy(body, m.value));"), &[REAL], |row| {
            vec![body(row).kinetic_energy(vector(row, 6))]
        }),
    ]
}

fn precision_of<T: Scalar>() -> Precision {
    if T::WORDS == 2 { Precision::F32 } else { Precision::F64 }
}

fn to_f64<T: Scalar>(row: &[T]) -> Vec<f64> {
    row.iter().map(|x| x.to_f64()).collect()
}

/// The functions of formulas, over their domains. Each side is within a function's stated error of the truth, which is all
/// that a driver that fuses and re-associates leaves certain; without that the sides agree nearly to the bit.
fn formula_cases<T: Scalar>() -> Vec<Case<T>> {
    /// Rows that begin with `edges` and go on at random.
    fn rows<T: Scalar>(edges: &[[f64; 2]], draw: impl Fn(&mut Random) -> [f64; 2]) -> Vec<Vec<T>> {
        let mut random = Random::new(11);
        let mut rows = edges.to_vec();
        rows.resize_with(ROWS.max(edges.len()), || draw(&mut random));
        rows.into_iter().map(|row| row.map(T::from_f64).to_vec()).collect()
    }
    /// The borders and their neighbours, of both signs.
    fn around<T: Scalar>(borders: &[f64]) -> Vec<[f64; 2]> {
        let step = 2.0 * T::UNIT_ROUNDOFF;
        let near = |x: f64| [x, x * (1.0 + step), x * (1.0 - step), -x, -x * (1.0 + step), -x * (1.0 - step)];
        borders.iter().flat_map(|&x| near(x)).map(|x| [x, 0.0]).collect()
    }
    fn single<T: Scalar>() -> bool {
        T::WORDS == 2
    }
    /// Exponents that results and arguments may have.
    fn exponents<T: Scalar>() -> f64 {
        if single::<T>() { 125.0 } else { 1021.0 }
    }
    fn exp_rows<T: Scalar>(_: usize) -> Vec<Vec<T>> {
        let limit = exponents::<T>() * std::f64::consts::LN_2;
        let edges = around::<T>(&[0.0, 1e-30, 1.0, 0.5 * std::f64::consts::LN_2, 1.5 * std::f64::consts::LN_2, limit]);
        rows(&edges, |random| [random.between(-limit, limit), 0.0])
    }
    fn ln_rows<T: Scalar>(_: usize) -> Vec<Vec<T>> {
        let limit = exponents::<T>();
        let mut edges = around::<T>(&[1.0, 2.0, 0.5, std::f64::consts::SQRT_2, 0.8125, 0.9375, 1.0625, 1.1875, 1.3125]);
        edges.retain(|row| 0.0 < row[0]);
        edges.extend([limit.exp2(), (-limit).exp2()].map(|x| [x, 0.0]));
        rows(&edges, |random| [random.between(-limit, limit).exp2(), 0.0])
    }
    fn tan_rows<T: Scalar>(_: usize) -> Vec<Vec<T>> {
        angles::<T>(0).into_iter().map(|row| vec![row[0], row[0]]).collect()
    }
    fn sine_rows<T: Scalar>(_: usize) -> Vec<Vec<T>> {
        let step = 2.0 * T::UNIT_ROUNDOFF;
        let mut edges = around::<T>(&[0.0, 1e-30, 1e-4, 0.5, std::f64::consts::FRAC_1_SQRT_2]);
        edges.extend([1.0, 1.0 - 0.5 * step, 1.0 + step, 1.0 + 4.0 * step].iter().flat_map(|&x| [[x, 0.0], [-x, 0.0]]));
        rows(&edges, |random| [random.between(-1.0, 1.0), 0.0])
    }
    fn point_rows<T: Scalar>(_: usize) -> Vec<Vec<T>> {
        let large = exponents::<T>().exp2();
        let sizes = [0.0, 1.0, -1.0, 0.13, -0.36, 0.72, 1e-9, -1e9, large, -large];
        let edges: Vec<_> = sizes.iter().flat_map(|&y| sizes.map(|x| [y, x])).collect();
        // A quotient that is subnormal may be taken for zero.
        let edges: Vec<_> = edges.into_iter().filter(|[y, x]| y.abs() >= 1.0 || x.abs() < large || *y == 0.0).collect();
        rows(&edges, |random| [random.between(-1.0, 1.0), random.between(-1.0, 1.0)])
    }
    fn pow_rows<T: Scalar>(_: usize) -> Vec<Vec<T>> {
        let limit = exponents::<T>();
        let edges = [0.0, 1.0, 2.0, 0.5, 1e-30, 7.3].map(|x| [0.0, 0.5, 1.0, 2.0, 1.0 / 3.0].map(|y| [x, y]));
        rows(&edges.concat(), |random| {
            let exponent = random.between(-limit, limit);
            [exponent.exp2(), random.between(-limit, limit) / exponent.abs().max(1.0)]
        })
    }
    fn ratio_rows<T: Scalar>(_: usize) -> Vec<Vec<T>> {
        rows(&[[0.0; 2], [0.04, 0.0], [1e-30, 0.0]], |random| [random.between(0.0, 0.04), 0.0])
    }
    let case = |name, line, stated: f64, twin, rows| Case {
        name,
        line,
        columns: 2,
        fields: &[REAL],
        twin,
        ulps: 2.0 * stated,
        magnitude: |_| 0.0,
        rows,
    };
    vec![
        case("exp", "put_r(0u, exp(r(0u)));", 1.5, |row| vec![functions::exp(row[0])], exp_rows::<T>),
        case("ln", "put_r(0u, ln(r(0u)));", 1.0, |row| vec![functions::ln(row[0])], ln_rows::<T>),
        case("tan", "put_r(0u, tan(r(0u)));", 3.0, |row| vec![functions::tan(row[0])], tan_rows::<T>),
        case("asin", "put_r(0u, asin(r(0u)));", 1.5, |row| vec![functions::asin(row[0])], sine_rows::<T>),
        case("acos", "put_r(0u, acos(r(0u)));", 1.5, |row| vec![functions::acos(row[0])], sine_rows::<T>),
        case(
            "atan2",
            "put_r(0u, atan2(r(0u), r(1u)));",
            1.0,
            |row| vec![functions::atan2(row[0], row[1])],
            point_rows::<T>,
        ),
        case("pow", "put_r(0u, pow(r(0u), r(1u)));", 2.0, |row| vec![functions::pow(row[0], row[1])], pow_rows::<T>),
        case(
            "arctangent_ratio",
            "put_r(0u, arctangent_ratio(r(0u)));",
            1.0,
            |row| vec![functions::arctangent_ratio(row[0])],
            ratio_rows::<T>,
        ),
    ]
}

fn with_formulas(precision: Precision) -> Vec<Chunk> {
    [Source::functions(precision), Source::elementary_functions(precision)].concat()
}

#[test]
fn functions_of_formulas_agree_with_their_twins() {
    check::<f32>(&with_formulas(Precision::F32), formula_cases());
    check::<f64>(&with_formulas(Precision::F64), formula_cases());
}

#[test]
fn results_outside_a_domain_are_seen_by_their_bits() {
    fn check_bits<T: Scalar>() {
        let line = "put_r(0u, exp(r(0u))); put_r(1u, ln(-r(0u))); put_r(2u, asin(r(0u))); put_r(3u, acos(r(0u))); \
                    put_r(4u, pow(-r(0u), 2.0)); put_r(5u, pow(r(1u), -1.0)); put_r(6u, exp(-r(0u))); \
                    put_r(7u, pow(r(0u), r(1u)));";
        let rows = vec![[1e4, 0.0].map(T::from_f64).to_vec()];
        let found = Harness::new().run(&with_formulas(precision_of::<T>()), line, &rows, 8);
        let beyond = found[0][..6].iter().all(|x| (x.to_bits() >> 52) & 0x7ff == 0x7ff);
        assert!(beyond && found[0][6..] == [0.0, 1.0], "{:?}", found[0]);
    }
    check_bits::<f32>();
    check_bits::<f64>();
}

fn check_helpers<T: Scalar>() {
    check::<T>(&chunks(precision_of::<T>(), Method::Rk4), cases::<T>());
}

fn check<T: Scalar>(chunks: &[Chunk], cases: Vec<Case<T>>) {
    let harness = Harness::new();
    for case in cases {
        let rows = (case.rows)(case.columns);
        let expected: Vec<_> = rows.iter().map(|row| to_f64(&(case.twin)(row))).collect();
        let found = harness.run(chunks, case.line, &rows, expected[0].len());
        let compared = compare_rows::<T>(case.fields, &expected, &found, |row| (case.magnitude)(&rows[row]), case.ulps);
        if let Err(mismatch) = compared {
            panic!("{}: {mismatch}; inputs {:?}", case.name, to_f64(&rows[mismatch.body]));
        }
    }
}

#[test]
fn every_f32_helper_agrees_with_its_twin() {
    check_helpers::<f32>();
}

#[test]
fn every_f64_helper_agrees_with_its_twin() {
    check_helpers::<f64>();
}

#[test]
fn every_shared_function_of_the_shaders_is_compared() {
    let lines: String = cases::<f32>().iter().chain(&formula_cases::<f32>()).map(|case| case.line).collect();
    // Within others: the argument reduction of sin_cos, and what the steps of cf4 and of the uncompensated methods use.
    let mut covered_within = vec!["reduced_by_quarters", "exponential_less_one", "plain_vector", "plainly_normalised"];
    // What the functions of formulas are made of; infinity and what is not a number have a test of their own.
    covered_within.extend([
        "infinity",
        "not_a_number",
        "upper_half",
        "quick_sum",
        "exact_sum",
        "quotient",
        "complement",
    ]);
    covered_within.extend(["digit_taken", "raised", "lowered", "scaled", "resolved", "expanded_beyond"]);
    covered_within.extend(["exp_of_words", "exp_series", "logarithm", "logarithm_series", "logarithm_expansion"]);
    covered_within.extend(["arctangent", "angle_series", "angle_expansion"]);
    for chunk in with_formulas(Precision::F32) {
        for line in chunk.text.lines().filter_map(|line| line.strip_prefix("fn ")) {
            let name = line.split('(').next().expect("a name");
            assert!(
                covered_within.contains(&name) || lines.contains(&format!("{name}(")),
                "{}: {name} has no case",
                chunk.file
            );
        }
    }
}

#[test]
fn an_output_that_no_kernel_writes_does_not_pass() {
    let rows = numbers::<f32>(3);
    let expected: Vec<_> = rows.iter().map(|row| to_f64(row)).collect();
    let line = "if (row == 7u) { return; } put_v(0u, v(0u));";
    let found = Harness::new().run(&chunks(Precision::F32, Method::Rk4), line, &rows, 3);
    let mismatch = compare_rows::<f32>(&[VECTOR], &expected, &found, |_| 0.0, 1e9).expect_err("NaN must not pass");
    assert_eq!((mismatch.body, mismatch.field, mismatch.component), (7, "vector", 0));
}
