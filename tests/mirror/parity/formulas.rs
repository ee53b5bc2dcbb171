//! The functions of formulas.

use polhode::math::elementary::functions;
use polhode::math::real::Scalar;

use super::common::random::Random;
use super::{Case, REAL, ROWS, angles};

/// The functions of formulas, over their domains. Each side is within a function's stated error of the truth, which is all
/// that a driver that fuses and re-associates leaves certain; without that the sides agree nearly to the bit.
pub fn formula_cases<T: Scalar>() -> Vec<Case<T>> {
    /// Rows that begin with `edges` and go on at random.
    fn rows<T: Scalar>(seed: u64, edges: &[[f64; 2]], draw: impl Fn(&mut Random) -> [f64; 2]) -> Vec<Vec<T>> {
        let mut random = Random::new(11 + 1000 * seed);
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
    fn exp_rows<T: Scalar>(_: usize, seed: u64) -> Vec<Vec<T>> {
        let limit = exponents::<T>() * std::f64::consts::LN_2;
        let edges = around::<T>(&[0.0, 1e-30, 1.0, 0.5 * std::f64::consts::LN_2, 1.5 * std::f64::consts::LN_2, limit]);
        rows(seed, &edges, |random| [random.between(-limit, limit), 0.0])
    }
    fn ln_rows<T: Scalar>(_: usize, seed: u64) -> Vec<Vec<T>> {
        let limit = exponents::<T>();
        let mut edges = around::<T>(&[1.0, 2.0, 0.5, std::f64::consts::SQRT_2, 0.8125, 0.9375, 1.0625, 1.1875, 1.3125]);
        edges.retain(|row| 0.0 < row[0]);
        edges.extend([limit.exp2(), (-limit).exp2()].map(|x| [x, 0.0]));
        rows(seed, &edges, |random| [random.between(-limit, limit).exp2(), 0.0])
    }
    fn tan_rows<T: Scalar>(_: usize, seed: u64) -> Vec<Vec<T>> {
        angles::<T>(0, seed).into_iter().map(|row| vec![row[0], row[0]]).collect()
    }
    fn sine_rows<T: Scalar>(_: usize, seed: u64) -> Vec<Vec<T>> {
        let step = 2.0 * T::UNIT_ROUNDOFF;
        let mut edges = around::<T>(&[0.0, 1e-30, 1e-4, 0.5, std::f64::consts::FRAC_1_SQRT_2]);
        edges.extend([1.0, 1.0 - 0.5 * step, 1.0 + step, 1.0 + 4.0 * step].iter().flat_map(|&x| [[x, 0.0], [-x, 0.0]]));
        rows(seed, &edges, |random| [random.between(-1.0, 1.0), 0.0])
    }
    fn point_rows<T: Scalar>(_: usize, seed: u64) -> Vec<Vec<T>> {
        let large = exponents::<T>().exp2();
        let sizes = [0.0, 1.0, -1.0, 0.13, -0.36, 0.72, 1e-9, -1e9, large, -large];
        let edges: Vec<_> = sizes.iter().flat_map(|&y| sizes.map(|x| [y, x])).collect();
        // A quotient that is subnormal may be taken for zero.
        let edges: Vec<_> = edges.into_iter().filter(|[y, x]| y.abs() >= 1.0 || x.abs() < large || *y == 0.0).collect();
        rows(seed, &edges, |random| [random.between(-1.0, 1.0), random.between(-1.0, 1.0)])
    }
    fn pow_rows<T: Scalar>(_: usize, seed: u64) -> Vec<Vec<T>> {
        let limit = exponents::<T>();
        let edges = [0.0, 1.0, 2.0, 0.5, 1e-30, 7.3].map(|x| [0.0, 0.5, 1.0, 2.0, 1.0 / 3.0].map(|y| [x, y]));
        rows(seed, &edges.concat(), |random| {
            let exponent = random.between(-limit, limit);
            [exponent.exp2(), random.between(-limit, limit) / exponent.abs().max(1.0)]
        })
    }
    fn ratio_rows<T: Scalar>(_: usize, seed: u64) -> Vec<Vec<T>> {
        rows(seed, &[[0.0; 2], [0.04, 0.0], [1e-30, 0.0]], |random| [random.between(0.0, 0.04), 0.0])
    }
    let case = |name, line, stated: f64, twin, rows| Case {
        name,
        line,
        columns: 2,
        fields: &[REAL],
        twin,
        ulps: 2.0 * stated,
        sizes: Some(|_| vec![0.0]),
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
