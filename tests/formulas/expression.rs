//! Formulas through the public interface: random ones on every evaluator of the CPU, and the users' language.

use polhode::expression::{Dependence, Expression, Fault, InputKind, Program, Shape, Symbols};
use polhode::math::real::{Real, Scalar};
use proptest::prelude::*;
use proptest::test_runner::Config;

use crate::common::random::Random;
use crate::common::tree::{self, Tree, inputs, symbols};

/// Random formulas a test: `POLHODE_EXPRESSIONS=100000 cargo test --release --test formulas expression`.
fn cases() -> Config {
    let count = std::env::var("POLHODE_EXPRESSIONS").ok().and_then(|count| count.parse().ok());
    Config { failure_persistence: None, ..Config::with_cases(count.unwrap_or(1000)) }
}

/// A random formula and some rows of inputs; none where constants alone are at fault.
fn formula(seed: u64, size: usize) -> Option<(Tree, Expression, Vec<[f64; tree::INPUTS]>)> {
    let mut random = Random::new(seed);
    let tree = Tree::random(&mut random, size);
    let rows = (0..21).map(|_| inputs(&mut random)).collect();
    match tree.recorded() {
        Ok(expression) => Some((tree, expression, rows)),
        Err(Fault::NotFinite | Fault::DivisionByZero) => None,
        Err(fault) => panic!("{fault}: {tree:?}"),
    }
}

/// What a program reads of a row of parameters.
fn read<T: Scalar>(program: &Program, row: &[f64]) -> Vec<T> {
    program.inputs().iter().map(|input| T::from_f64(row[usize::from(input.index)])).collect()
}

fn columns<T: Scalar>(program: &Program, rows: &[[f64; tree::INPUTS]]) -> Vec<Vec<T>> {
    let rows: Vec<Vec<T>> = rows.iter().map(|row| read(program, row)).collect();
    (0..program.inputs().len()).map(|column| rows.iter().map(|row| row[column]).collect()).collect()
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn a_program_has_the_bits_of_a_naive_evaluation(seed in any::<u64>(), size in 1_usize..80) {
        if let Some((tree, expression, rows)) = formula(seed, size) {
            let program = expression.program();
            for row in &rows {
                // Where an intermediate result is infinite, zero times it is not what is recorded.
                if tree.bounded(row, f64::EPSILON).is_some() {
                    let found = program.evaluate_one(&read::<f64>(&program, row))[0];
                    prop_assert_eq!((found + 0.0).to_bits(), (tree.call(row.as_slice()) + 0.0).to_bits(), "{:?}", tree);
                }
            }
        }
    }

    #[test]
    fn lanes_and_f32_agree_with_f64_to_rounding(seed in any::<u64>(), size in 1_usize..80) {
        if let Some((tree, expression, rows)) = formula(seed, size) {
            let program = expression.program();
            let (wide, narrow) = (columns::<f64>(&program, &rows), columns::<f32>(&program, &rows));
            let wide: Vec<&[f64]> = wide.iter().map(Vec::as_slice).collect();
            let narrow: Vec<&[f32]> = narrow.iter().map(Vec::as_slice).collect();
            let lanes = program.evaluate_columns(&wide, rows.len());
            let narrow_lanes = program.evaluate_columns(&narrow, rows.len());
            for (body, row) in rows.iter().enumerate() {
                if let Some((value, error)) = tree.bounded(row, f64::UNIT_ROUNDOFF) {
                    // Both are off by that.
                    let bound = 2.0 * error * f64::UNIT_ROUNDOFF;
                    prop_assert!((lanes[0][body] - value).abs() <= bound, "{} {value} {bound:e} {tree:?}", lanes[0][body]);
                }
                if let Some((value, error)) = tree.bounded(row, f32::UNIT_ROUNDOFF) {
                    let bound = 1.01 * error * f32::UNIT_ROUNDOFF;
                    let alone = program.evaluate_one(&read::<f32>(&program, row))[0];
                    for found in [alone, narrow_lanes[0][body]] {
                        prop_assert!((f64::from(found) - value).abs() <= bound, "{found} {value} {bound:e} {tree:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_text_is_the_formula_that_it_spells(seed in any::<u64>(), size in 1_usize..80) {
        if let Some((tree, ..)) = formula(seed, size) {
            let spoken = tree.spoken();
            let parsed = Expression::parse(&spoken.text(), &symbols(), Shape::Number);
            match (parsed, spoken.recorded()) {
                (Ok(parsed), Ok(recorded)) => prop_assert_eq!(parsed, recorded),
                (Err(error), Err(fault)) => prop_assert_eq!(error.fault, fault),
                (parsed, recorded) => prop_assert!(false, "{parsed:?} {recorded:?}"),
            }
        }
    }

    #[test]
    fn no_text_makes_the_parser_panic(text in "[a-z0-9 .,;()*+/^<>=!&|\n#-]{0,80}") {
        if let Err(error) = Expression::parse(&text, &symbols(), Shape::Number) {
            prop_assert!(!error.picture().is_empty() && !error.to_string().contains('\n'));
        }
    }
}

#[test]
fn most_random_formulas_are_compared() {
    let (mut rows_compared, mut rows_in_all) = (0, 0);
    for (tree, _, rows) in (0..500).filter_map(|seed| formula(seed, 1 + seed as usize % 79)) {
        rows_in_all += rows.len();
        rows_compared += rows.iter().filter(|row| tree.bounded(*row, f32::UNIT_ROUNDOFF).is_some()).count();
    }
    assert!(rows_in_all > 400 * 21 && 2 * rows_compared > rows_in_all, "{rows_compared} of {rows_in_all}");
}

/// What a torque in a test may name.
fn offered() -> Symbols {
    let with = |symbols: Symbols, name: &str, shape| symbols.parameter(name, shape).unwrap();
    let symbols = with(Symbols::rotation(), "k", Shape::Number);
    with(with(symbols, "moment", Shape::Vector), "target", Shape::Quaternion)
}

fn torque(text: &str) -> Expression {
    Expression::parse(text, &offered(), Shape::Vector).unwrap_or_else(|error| panic!("{error}\n{}", error.picture()))
}

#[test]
fn a_text_records_what_a_closure_does() {
    let text = "# a pendulum with drag\nlet up = to_body(vec(0, 0, 1)); // body axes\n\
                -k * cross(moment, up) - k * angular_velocity * norm(angular_velocity)";
    let closure = Expression::record(&offered(), |s| {
        use polhode::math::vector::Vector;
        let c = polhode::expression::Symbol::splat;
        let up = s.to_body(Vector::new(c(0.0), c(0.0), c(1.0)));
        let (k, omega) = (s.number("k"), s.angular_velocity());
        s.vector("moment").cross(up) * -k - omega * k * omega.dot(omega).sqrt()
    })
    .unwrap();
    assert_eq!(torque(text), closure);
    assert_eq!(closure.dependence(), Dependence::PARAMETERS | Dependence::ATTITUDE | Dependence::VELOCITY);
}

#[test]
fn inertia_is_a_tensor() {
    let text = "cross(inertia * angular_velocity, angular_velocity) * inertia.xx";
    assert_eq!(torque(text).graph().inputs(torque(text).outputs()).len(), 6);
    let full = Expression::parse("inertia * angular_velocity", &offered().with_full_inertia(), Shape::Vector).unwrap();
    let elements = full.graph().inputs(full.outputs()).into_iter().filter(|input| input.kind == InputKind::Inertia);
    assert_eq!(elements.count(), 6);
}

#[test]
fn operators_and_functions_have_their_values() {
    let symbols = Symbols::parameters_only().parameter("x", Shape::Number).unwrap();
    let at = |text: &str, x: f64| {
        let formula =
            Expression::parse(text, &symbols, Shape::Number).unwrap_or_else(|error| panic!("{text}: {error}"));
        let program = formula.program();
        program.evaluate_one(&vec![x; program.inputs().len()])[0]
    };
    let cases: [(&str, f64, f64); 34] = [
        ("1 + 2 * 3 - 4 / 8", 0.0, 6.5),
        ("-x^2", 3.0, -9.0),
        ("2 ^ 3 ^ 2", 0.0, 64.0),
        ("x^-2", 4.0, 0.0625),
        ("x^0 + x^1", 4.0, 5.0),
        ("x^16", 2.0, 65536.0),
        ("8 - 4 - 2", 0.0, 2.0),
        ("8 / 4 / 2", 0.0, 1.0),
        ("- - x", 3.0, 3.0),
        ("1.5e-3 + .5 + 2.", 0.0, 2.5015),
        ("dot(vec(1, 2, x), vec(4, 5, 6))", 3.0, 32.0),
        ("cross(vec(1, 0, 0), vec(0, x, 0)).z", 2.0, 2.0),
        ("norm(vec(x, 4, 0))", 3.0, 5.0),
        ("norm(quat(x, 1, 1, 1))", 1.0, 2.0),
        ("normalize(vec(x, 0, 4)).x", 3.0, 0.6000000000000001),
        ("normalize(quat(0, 0, 0, x)).w", 2.0, 1.0),
        ("(vec(x, 2, 3) / x).x", 4.0, 1.0),
        ("rotate(quat(0, 0, 1, 0), vec(x, 2, 3)).x", 1.0, -1.0),
        ("rotate_inverse(conjugate(quat(0, 0, 1, 0)), vec(x, 2, 3)).y", 1.0, -2.0),
        ("(quat(1, 0, 0, 0) * quat(0, x, 0, 0)).z", 1.0, 1.0),
        ("min(x, 2) + max(x, 2)", 3.0, 5.0),
        ("clamp(x, -1, 1)", -7.0, -1.0),
        ("step(1, x)", 1.0, 1.0),
        ("step(1, x)", 0.9, 0.0),
        ("smoothstep(0, 2, x)", 1.0, 0.5),
        ("abs(x) + sqrt(4)", -3.0, 5.0),
        ("select(x < 1 && x > 0 || !(x <= 5), 1, 2)", 0.5, 1.0),
        ("select(x < 1 && x > 0 || !(x <= 5), 1, 2)", 6.0, 1.0),
        ("select(x >= 1, vec(1, 2, 3), vec(4, 5, 6)).y", 1.0, 2.0),
        ("let b = x > 0; select(b, 1, 2);", -1.0, 2.0),
        ("sin(x)^2 + cos(x)^2", 0.3, 1.0),
        ("tau / pi", 0.0, 2.0),
        ("kepler_sin(x, 0)", 0.5, 0.479425538604203),
        ("atan2(x, 0) - pi / 2", 2.0, 0.0),
    ];
    for (text, x, expected) in cases {
        assert_eq!(at(text, x), expected, "{text}");
    }
    // Functions of which no more is promised than a small error.
    let near: [(&str, f64); 11] = [
        ("tan(x)", 0.7_f64.tan()),
        ("asin(x)", 0.7_f64.asin()),
        ("acos(x)", 0.7_f64.acos()),
        ("exp(x)", 0.7_f64.exp()),
        ("ln(x)", 0.7_f64.ln()),
        ("pow(x, 2.5)", 0.7_f64.powf(2.5)),
        ("pow(-x, 3)", (-0.7_f64).powi(3)),
        ("pow(-x, -2)", 0.7_f64.powi(-2)),
        ("pow(-x, 16)", 0.7_f64.powi(16)),
        ("atan2(x, -x)", 0.75 * std::f64::consts::PI),
        ("exp(1) * x", 0.7 * std::f64::consts::E),
    ];
    for (text, expected) in near {
        assert!((at(text, 0.7) / expected - 1.0).abs() < 1e-14, "{text}: {} {expected}", at(text, 0.7));
    }
}

fn refusal(text: &str) -> String {
    Expression::parse(text, &offered(), Shape::Vector).expect_err(text).to_string()
}

#[test]
fn refusals_name_the_place_and_the_reason() {
    let cases = [
        (
            "let u = k;\nlet omega = u;\nangular_velocity * omga",
            "line 3, column 20: unknown name `omga`; nearest: `omega`",
        ),
        ("momnet", "line 1, column 1: unknown name `momnet`; nearest: `moment`"),
        ("zzz * moment", "line 1, column 1: unknown name `zzz`"),
        ("crss(moment, moment)", "line 1, column 1: unknown name `crss`; nearest: `cross`"),
        ("position", "line 1, column 1: `position` is not known where this formula is used"),
        ("k", "line 1, column 1: the result: found a number, needed a vector"),
        ("k < 1", "line 1, column 1: the result: found a truth value, needed a vector"),
        (
            "moment + k",
            "line 1, column 8: `+`: found a vector and a number, needed two numbers, two vectors or two rotations",
        ),
        ("moment * moment", "line 1, column 8: `*`: found a vector and a vector, needed `dot(a, b)` or `cross(a, b)`"),
        (
            "attitude * moment",
            "line 1, column 10: `*`: found a rotation and a vector, needed `rotate(q, v)` or `rotate_inverse(q, v)` \
             (with the attitude: `to_world(v)`, `to_body(v)`)",
        ),
        ("moment / moment", "line 1, column 8: the divisor of `/`: found a vector, needed a number"),
        (
            "moment * inertia",
            "line 1, column 8: `*`: found a vector and the inertia, needed `inertia * v` with a vector v, or \
             elements as `inertia.xx`",
        ),
        ("inertia", "line 1, column 1: the result: found the inertia, needed a vector"),
        ("inertia.xy * moment", "line 1, column 9: no component `xy`; there are xx, yy, zz"),
        ("moment.w", "line 1, column 8: no component `w`; there are x, y, z"),
        ("k.x", "line 1, column 3: `.x`: found a number, needed a vector or a rotation"),
        ("cross(moment, k)", "line 1, column 1: argument 2 of `cross`: found a number, needed a vector"),
        ("norm(k)", "line 1, column 1: `norm`: found a number, needed a vector"),
        ("cross(moment)", "line 1, column 1: `cross` takes 2 arguments, not 1"),
        ("to_body()", "line 1, column 1: `to_body` takes 1 argument, not 0"),
        (
            "select(k, moment, moment)",
            "line 1, column 1: argument 1 of `select`: found a number, needed a truth value, as `a < b`",
        ),
        (
            "select(k < 1, moment, k)",
            "line 1, column 1: argument 3 of `select`: found a number, needed a vector, as argument 2",
        ),
        ("moment^2", "line 1, column 7: `^`: found a vector, needed a number; |v|² is `dot(v, v)`"),
        (
            "moment * k^2.5",
            "line 1, column 12: expected a whole number from -16 to 16 after `^`; otherwise use `pow(x, y)`, for x ≥ 0",
        ),
        (
            "moment * k^17",
            "line 1, column 12: expected a whole number from -16 to 16 after `^`; otherwise use `pow(x, y)`, for x ≥ 0",
        ),
        ("!k", "line 1, column 1: `!`: found a number, needed a truth value"),
        ("-(k < 1)", "line 1, column 1: `-`: found a truth value, needed a number, a vector or a rotation"),
        ("k < moment", "line 1, column 3: `<`: found a vector, needed numbers"),
        ("k < 1 < 2", "line 1, column 7: found `<`, needed `&&` between two comparisons"),
        ("k && k", "line 1, column 3: `&&`: found a number, needed truth values"),
        ("k == 1", "line 1, column 3: found `==`, needed an operator or the end"),
        ("moment / 0", "line 1, column 8: division by zero"),
        ("moment * k / (2 - 2)", "line 1, column 12: division by zero"),
        ("moment * 1e999", "line 1, column 10: this constant is not a finite number"),
        ("moment * sqrt(-1)", "line 1, column 10: this constant is not a finite number"),
        ("moment * (1e300 * 1e300)", "line 1, column 17: this constant is not a finite number"),
        ("let k = 1; moment", "line 1, column 5: `k` is defined twice"),
        ("let a = 1; let a = 2; moment", "line 1, column 16: `a` is defined twice"),
        ("let time = 1; moment", "line 1, column 5: `time` has a meaning already; choose another name"),
        ("let sin = 1; moment", "line 1, column 5: `sin` has a meaning already; choose another name"),
        ("let a = a; moment", "line 1, column 9: `a` is used before it is defined"),
        ("let a = b; let b = a; moment", "line 1, column 9: `b` is used before it is defined"),
        ("let = 1; moment", "line 1, column 5: found `=`, needed a name"),
        ("let a 1; moment", "line 1, column 7: found the number 1.0, needed `=`"),
        ("let a = 1 moment", "line 1, column 11: found `moment`, needed `;`"),
        ("let a = 1;", "line 1, column 11: found the end, needed a value"),
        ("", "line 1, column 1: found the end, needed a value"),
        ("moment moment", "line 1, column 8: found `moment`, needed an operator or the end"),
        ("moment; let a = 1;", "line 1, column 9: found `let`, needed an operator or the end"),
        ("(moment", "line 1, column 8: found the end, needed `)`"),
        ("cross(moment; moment)", "line 1, column 13: found `;`, needed `,` or `)`"),
        ("moment * sin", "line 1, column 10: found `sin` without arguments, needed `sin(...)`"),
        ("moment * 2x", "line 1, column 10: found `2x`, needed a number"),
        ("moment * 1_000", "line 1, column 10: found `1_000`, needed a number"),
        ("moment $ 2", "line 1, column 8: found `$`, needed a number, a name or an operator"),
        ("moment * μ", "line 1, column 10: found `μ`, needed a number, a name or an operator"),
        ("moment *", "line 1, column 9: found the end, needed a value"),
        ("1 + let", "line 1, column 5: found `let`, needed a value; definitions stand before the formula"),
    ];
    for (text, message) in cases {
        assert_eq!(refusal(text), message, "{text}");
    }
}

#[test]
fn a_picture_shows_the_place() {
    let error = Expression::parse("let a = k;\n\ta * momnet + 1", &offered(), Shape::Vector).unwrap_err();
    assert_eq!((error.line, error.column, error.length), (2, 6, 6));
    assert_eq!(error.picture(), "\ta * momnet + 1\n\t    ^^^^^^");
    let long = format!("{} momnet", "k * ".repeat(200));
    let error = Expression::parse(&long, &offered(), Shape::Vector).unwrap_err();
    let picture = error.picture();
    let (line, carets) = picture.split_once('\n').unwrap();
    assert_eq!((line.len(), carets.len()), (66, 66));
}

#[test]
fn texts_have_limits() {
    let number = |text: &str| Expression::parse(text, &offered(), Shape::Number).map_err(|error| error.fault);
    let nested = |levels: usize| number(&format!("{}k{}", "(".repeat(levels), ")".repeat(levels)));
    assert!(nested(199).is_ok());
    assert_eq!(nested(200), Err(Fault::TooDeep { limit: 200 }));
    assert_eq!(nested(30_000), Err(Fault::TooDeep { limit: 200 }));
    assert_eq!(number(&"-".repeat(60_000)), Err(Fault::TooDeep { limit: 200 }));
    assert_eq!(number(&"abs(".repeat(10_000)), Err(Fault::TooDeep { limit: 200 }));
    assert_eq!(number(&" ".repeat(70_000)), Err(Fault::TooLong { length: 70_000, limit: 65_536 }));
    // Every turn is two nodes: sin and a sum; the text is short enough.
    let steps = |count: usize| {
        let mut text = String::from("let a0 = k;");
        for step in 1..=count {
            text += &format!("let a{step}=sqrt(a{});", step - 1);
        }
        number(&format!("{text}a{count}"))
    };
    assert!(steps(2_000).is_ok());
    let long = "k/3*3".to_owned() + &"/3*3".repeat(6_000);
    assert_eq!(number(&long), Err(Fault::TooManyNodes));
}

#[test]
fn parameters_have_names_of_their_own() {
    let named = |name: &str| offered().parameter(name, Shape::Number).map(|_| ());
    assert_eq!(named("k"), Err(Fault::DuplicateName { name: "k".to_owned() }));
    assert_eq!(named("dot"), Err(Fault::ReservedName { name: "dot".to_owned() }));
    assert_eq!(named("2k"), Err(Fault::InvalidName { name: "2k".to_owned() }));
    assert_eq!(named("position"), Err(Fault::ReservedName { name: "position".to_owned() }));
    assert_eq!(named("k_2"), Ok(()));
}

#[test]
fn stages_together_are_the_formula() {
    let text = "let rate = k * sqrt(abs(k) + 1);
        let wave = sin(rate * time) * normalize(moment);
        wave * norm(angular_velocity) + cross(moment * exp(-k), angular_velocity) - 2 * wave";
    let whole = torque(text);
    let stages = whole.stages();
    // k √(|k| + 1), the normalised moment, and m exp(−k): seven columns; the wave and twice the wave: six epoch values.
    assert_eq!((stages.derived.outputs.len(), stages.epoch.outputs.len()), (7, 6));
    let value = |kind: InputKind, index: u16| match kind {
        InputKind::Time => 1.75,
        InputKind::Parameter => [0.7, 0.3, -0.4, 1.1, 0.0, 0.0, 0.0, 1.0][usize::from(index)],
        _ => [0.2, -1.3, 0.8][usize::from(index)],
    };
    let mut known: [Vec<f64>; 2] = Default::default();
    let run = |part: &polhode::expression::Part, known: &[Vec<f64>; 2]| {
        let program = Program::new(&part.graph, &part.outputs);
        let inputs: Vec<f64> = program
            .inputs()
            .iter()
            .map(|input| match input.kind {
                InputKind::Derived => known[0][usize::from(input.index)],
                InputKind::Epoch => known[1][usize::from(input.index)],
                kind => value(kind, input.index),
            })
            .collect();
        program.evaluate_one(&inputs)
    };
    known[0] = run(&stages.derived, &known);
    known[1] = run(&stages.epoch, &known);
    let program = whole.program();
    let inputs: Vec<f64> = program.inputs().iter().map(|input| value(input.kind, input.index)).collect();
    assert_eq!(run(&stages.rest, &known), program.evaluate_one(&inputs));
}
