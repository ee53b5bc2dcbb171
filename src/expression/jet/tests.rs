//! Coefficients against series at 60 digits (`tests/golden/taylor.py`), and against systems whose series are known.

use super::super::graph::{Graph, Input, InputKind, Node};
use super::super::{Expression, Fault, Recorder, Shape, Symbol, Symbols};
use super::{Equations, Jets, Series, lowered, lowered_by_directions};
use crate::math::lanes::Each;
use crate::math::real::Real;

const ORDER: usize = 20;

/// The coefficients of an output, with rows initialised as `start` says: value and rate.
fn series(jets: &Jets, start: impl Fn(Input) -> [f64; 2], factors: &[f64]) -> Series<f64, 2> {
    let mut series = Series::new(jets);
    let parameters: Vec<f64> = jets.factors.inputs().iter().map(|input| factors[usize::from(input.index)]).collect();
    let factors = jets.factors.evaluate_one(&parameters);
    for group in 0..2 {
        let factors: Vec<Each<f64, 1>> = factors.iter().map(|&factor| Each([factor])).collect();
        series.set_factors(jets, group, &factors);
        for &(input, place) in &jets.given {
            let [value, rate] = start(input);
            series.set(place, 0, group, value);
            if matches!(input.kind, InputKind::Time | InputKind::Phase) {
                series.set(place, 1, group, rate);
            }
        }
    }
    series.form(jets);
    series
}

/// The coefficients of a graph's only result as a function of time, from `at` on.
fn of_time(graph: &Graph, output: Node, at: f64) -> Vec<f64> {
    let equations = Equations { outputs: vec![output], ..Equations::default() };
    let jets = lowered(graph, &equations).unwrap().up_to(ORDER);
    let series = series(&jets, |_| [at, 1.0], &[]);
    (0..ORDER).map(|k| series.at(jets.outputs[0], k)[1]).collect()
}

#[test]
fn coefficients_are_those_of_series_in_high_precision() {
    // Recurrences lose some digits, more the higher the order.
    const TOLERANCE: f64 = 4e-13;
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/taylor.json");
    let cases: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut checked = 0;
    for case in cases.as_array().unwrap() {
        let text = case["formula"].as_str().unwrap();
        let expected: Vec<f64> =
            case["coefficients"].as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect();
        let formula = Expression::parse(text, &Symbols::rotation(), Shape::Number).unwrap();
        let found = of_time(formula.graph(), formula.outputs()[0], case["at"].as_f64().unwrap());
        // The radius of convergence sets the scale of coefficients, odd and even ones together.
        let scale = |k: usize| expected[k.saturating_sub(1)..=k + 1].iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        for k in 0..ORDER {
            let error = (found[k] - expected[k]).abs() / scale(k).max(1e-8);
            assert!(error < TOLERANCE, "{text}: coefficient {k} is {:e}, {:e} expected", found[k], expected[k]);
            checked += 1;
        }
    }
    assert!(checked >= 13 * ORDER);
}

#[test]
fn a_wrong_coefficient_is_found() {
    // A wrong sign in the recurrence of a sine would show in the test above.
    let formula = Expression::parse("sin(time * time)", &Symbols::rotation(), Shape::Number).unwrap();
    let right = of_time(formula.graph(), formula.outputs()[0], 0.3);
    let formula = Expression::parse("sin(-time * time)", &Symbols::rotation(), Shape::Number).unwrap();
    let wrong = of_time(formula.graph(), formula.outputs()[0], 0.3);
    assert!((0..ORDER).all(|k| right[k] == -wrong[k] && right[k] != wrong[k]));
}

fn recorded(work: impl FnOnce(&Recorder) -> Vec<Symbol>) -> (Graph, Vec<Node>) {
    Graph::record::<Fault>(|recorder| Ok(work(recorder))).unwrap()
}

#[test]
fn a_system_gives_its_own_series() {
    // x' = a x (1 − x), x = 1/(1 + e^(−a t)) from ½ on: its series is that of the logistic function.
    let state = Input::new(InputKind::AngularMomentum, 0);
    let (graph, outputs) = recorded(|recorder| {
        let (x, a) = (recorder.input(state), recorder.input(Input::new(InputKind::Parameter, 0)));
        vec![a * x * (Symbol::splat(1.0) - x)]
    });
    let equations = Equations { rates: vec![(state, outputs[0])], ..Equations::default() };
    let jets = lowered(&graph, &equations).unwrap().up_to(ORDER);
    let a = 1.5_f64;
    let series = series(&jets, |_| [0.5, 0.0], &[a]);
    let place = jets.input(state).unwrap();
    // ½ + t/4 − t³/48 + t⁵/480 − 17 t⁷/80640 + …
    let expected = [0.5, 0.25, 0.0, -1.0 / 48.0, 0.0, 1.0 / 480.0, 0.0, -17.0 / 80640.0];
    for (k, expected) in expected.into_iter().enumerate() {
        let found = series.at(place, k)[0] / a.powi(k as i32);
        assert!((found - expected).abs() < 1e-16, "coefficient {k}: {found:e}, {expected:e} expected");
    }
}

#[test]
fn the_attitude_of_a_steady_rotation_is_sine_and_cosine() {
    let part = |index| Input::new(InputKind::Orientation, index);
    let (graph, outputs) = recorded(|recorder| {
        let _ = recorder.input(part(0));
        let q: Vec<Symbol> = (0..4).map(|index| recorder.input(part(index))).collect();
        let rate = Symbol::splat(2.0);
        // With the square of a component, so that products of components are formed.
        let squares = [q[0] * q[0], q[1] * q[1] + q[0] * q[3], q[2] * q[2], q[3] * q[3]];
        [&[Symbol::splat(0.0), Symbol::splat(0.0), rate][..], &squares].concat()
    });
    let equations = Equations {
        rates: vec![],
        angular_velocity: Some([outputs[0], outputs[1], outputs[2]]),
        has_orientation: true,
        outputs: outputs[3..].to_vec(),
    };
    let jets = lowered(&graph, &equations).unwrap().up_to(ORDER);
    let series = series(&jets, |input| [if input == part(3) { 1.0 } else { 0.0 }, 0.0], &[]);
    let mut factorial = 1.0;
    for k in 0..ORDER {
        factorial *= if k > 0 { k as f64 } else { 1.0 };
        let sign = if k % 4 < 2 { 1.0 } else { -1.0 };
        let (z, w) = (series.at(jets.input(part(2)).unwrap(), k)[0], series.at(jets.input(part(3)).unwrap(), k)[0]);
        let expected = sign / factorial;
        assert!((if k % 2 == 1 { z } else { w } - expected).abs() < 1e-15, "coefficient {k}");
        assert_eq!(if k % 2 == 1 { w } else { z }, 0.0);
        // z² + w² = 1.
        let sum = series.at(jets.outputs[5], k)[0] + series.at(jets.outputs[6], k)[0];
        assert!((sum - if k == 0 { 1.0 } else { 0.0 }).abs() < 1e-15, "the sum of squares, coefficient {k}: {sum:e}");
    }
}

#[test]
fn products_are_shared_and_factors_pulled_out() {
    // R(q)ᵀ d for a direction that turns: ten products of the attitude in one operation and nine by the direction.
    let (graph, outputs) = recorded(|recorder| {
        let part = |index| recorder.input(Input::new(InputKind::Orientation, index));
        let q = crate::math::quaternion::Quaternion::new(part(0), part(1), part(2), part(3));
        let time = recorder.input(Input::new(InputKind::Time, 0));
        let (sin, cos) = crate::math::real::sin_cos(time);
        let parameter = |index| recorder.input(Input::new(InputKind::Parameter, index));
        let direction = crate::math::vector::Vector::new(sin * parameter(0), cos * parameter(1), sin + cos);
        let u = q.rotate_inverse(direction);
        vec![u.x, u.y, u.z, time]
    });
    let equations = Equations {
        rates: vec![],
        angular_velocity: Some([outputs[3]; 3]),
        has_orientation: true,
        outputs: outputs[..3].to_vec(),
    };
    let jets = lowered(&graph, &equations).unwrap().up_to(ORDER);
    let count = |kind| jets.operations.iter().filter(|operation| operation.kind == kind).count();
    assert_eq!(count(super::Kind::Rotation), 1);
    // Sine and cosine with three components each.
    assert_eq!(count(super::Kind::VectorProducts), 1);
    assert_eq!(count(super::Kind::Products) + count(super::Kind::Product), 0);
}

/// Rᵀ v of a vector that is fixed, of one that turns evenly and of one with another function of time.
fn three_directions() -> (Graph, Vec<Node>) {
    recorded(|recorder| {
        let part = |index| recorder.input(Input::new(InputKind::Orientation, index));
        let q = crate::math::quaternion::Quaternion::new(part(0), part(1), part(2), part(3));
        let time = recorder.input(Input::new(InputKind::Time, 0));
        let parameter = |index| recorder.input(Input::new(InputKind::Parameter, index));
        let vector =
            |first| crate::math::vector::Vector::new(parameter(first), parameter(first + 1), parameter(first + 2));
        let (sin, cos) = crate::math::real::sin_cos(time * parameter(9) + parameter(10));
        let fixed = q.rotate_inverse(vector(0));
        let turning = q.rotate_inverse(vector(3) * cos + vector(6) * sin);
        let other = q.rotate_inverse(vector(0) * (time * time));
        // The rate, and products that the directions are in.
        let rate = [0.3, -0.2, 0.9].map(Symbol::splat);
        let found = [-fixed.y, turning.x * turning.y, fixed.z * turning.z, other.x];
        [&rate[..], &found].concat()
    })
}

#[test]
fn directions_as_states_give_the_series_that_the_attitude_gives() {
    let (graph, outputs) = three_directions();
    let equations = Equations {
        rates: vec![],
        angular_velocity: Some([outputs[0], outputs[1], outputs[2]]),
        has_orientation: true,
        outputs: outputs[3..].to_vec(),
    };
    let parameters = [0.4, -0.7, 0.2, 0.9, 0.1, -0.3, 0.2, 0.8, 0.5, 1.7, 0.6];
    let attitude = crate::math::quaternion::Quaternion::new(0.5, -0.1, 0.7, 0.5);
    let at = 0.3;
    let by_attitude = lowered(&graph, &equations).unwrap().up_to(ORDER);
    let q = [attitude.x, attitude.y, attitude.z, attitude.w];
    let start = |input: Input| match input.kind {
        InputKind::Orientation => [q[usize::from(input.index)], 0.0],
        _ => [at, 1.0],
    };
    let expected = series(&by_attitude, start, &parameters);

    let jets = lowered_by_directions(&graph, &equations).unwrap().expect("only directions are asked for").up_to(ORDER);
    // One that is fixed, and one that turns with its partner.
    assert_eq!(jets.directions.len(), 2);
    assert_eq!(jets.directions.iter().filter(|state| state.turning.is_some()).count(), 1);
    let factors: Vec<f64> = jets.factors.inputs().iter().map(|input| parameters[usize::from(input.index)]).collect();
    let factors = jets.factors.evaluate_one(&factors);
    let mut found = Series::<f64, 2>::new(&jets);
    for group in 0..2 {
        found.set_factors(&jets, group, &factors.iter().map(|&factor| Each([factor])).collect::<Vec<_>>());
        for &(input, place) in &jets.given {
            found.set(place, 0, group, start(input)[0]);
            found.set(place, 1, group, start(input)[1]);
        }
        for state in &jets.directions {
            let world = |numbers: [usize; 3]| {
                let [x, y, z] = numbers.map(|number| factors[number]);
                crate::math::vector::Vector::new(x, y, z)
            };
            let mut set = |rows: [super::Place; 3], vector: crate::math::vector::Vector<f64>| {
                let direction = attitude.rotate_inverse(vector);
                for (place, number) in rows.into_iter().zip([direction.x, direction.y, direction.z]) {
                    found.set(place, 0, group, number);
                }
            };
            let own = world(state.world);
            let Some(turning) = &state.turning else {
                set(state.rows, own);
                continue;
            };
            let (_, factor, offset) = turning.angle;
            let (sin, cos) = (factors[factor] * at + factors[offset]).sin_cos();
            let ahead = world(turning.world);
            set(state.rows, own * cos + ahead * sin);
            set(turning.rows, ahead * cos - own * sin);
        }
    }
    found.form(&jets);
    for (output, (&place, &known)) in jets.outputs.iter().zip(&by_attitude.outputs).enumerate().skip(3) {
        for k in 0..ORDER {
            let (found, expected) = (found.at(place, k)[1], expected.at(known, k)[1]);
            assert!((found - expected).abs() < 1e-13, "output {output}, coefficient {k}: {found}, not {expected}");
        }
    }
}

#[test]
fn what_asks_for_more_of_the_attitude_than_directions_keeps_it() {
    let (graph, outputs) = recorded(|recorder| {
        let part = |index| recorder.input(Input::new(InputKind::Orientation, index));
        let q = crate::math::quaternion::Quaternion::new(part(0), part(1), part(2), part(3));
        let down = q.rotate_inverse(crate::math::vector::Vector::new(
            Symbol::splat(0.0),
            Symbol::splat(0.0),
            Symbol::splat(1.0),
        ));
        vec![down.x, down.y, part(0)]
    });
    let equations = |outputs: &[Node]| Equations {
        rates: vec![],
        angular_velocity: Some([outputs[0]; 3]),
        has_orientation: true,
        outputs: outputs.to_vec(),
    };
    assert!(lowered_by_directions(&graph, &equations(&outputs)).unwrap().is_none());
    assert!(lowered_by_directions(&graph, &equations(&outputs[..2])).unwrap().is_some());
}
