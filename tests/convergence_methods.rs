//! The order of every method under every kind of torque, over five halvings of the step, against golden data.

mod support;

use glam::DVec3;
use polhode::Method;
use polhode::method::TorqueKind;
use polhode::method::splitting::{self, BM6, Composition, SRKN11B};
use polhode::quaternion::Quaternion;
use polhode::real::Scalar;
use polhode::torque::{Free, VelocityDependence};
use support::double_double::DoubleDouble;
use support::environment::{
    Acting, Moving, Torque, at_start, attitude, between, case, precise_error, start_of, stepped, stepped_by, two_words,
};
use support::inertia::{Changing, Law};
use support::{attitude_error, golden};

/// How far an observed order may lie from the claimed one.
const ORDER_TOLERANCE: f64 = 0.1;

/// Halvings of the step that an order is fitted over.
const HALVINGS: usize = 5;

/// Simulated time, s: 3 to 23 rad of rotation.
const SPAN: f64 = 10.0;

/// A free asymmetric body, a heavy top, a time-dependent torque, gravity gradient, and drag of three kinds.
const CASES: [(&str, &str, TorqueKind); 7] = [
    ("free_asymmetric", "asym_p01", TorqueKind::Free),
    ("forced_top", "heavy_asym0_p", TorqueKind::AttitudeOrTime),
    ("forced_torque", "sin_torque0_p", TorqueKind::AttitudeOrTime),
    ("forced_gg", "gg_circ_tumble0_p", TorqueKind::AttitudeOrTime),
    ("forced_drag", "lin_drag0_p", TorqueKind::AngularVelocity),
    ("forced_drag", "matrix_drag0_p", TorqueKind::AngularVelocity),
    ("forced_drag", "quad_drag1_p", TorqueKind::AngularVelocity),
];

/// Slope of log₂ error over log₂ dt by least squares.
fn fitted_order(errors: &[(f64, f64)]) -> f64 {
    let count = errors.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| errors.iter().map(f).sum::<f64>() / count;
    let (x, y) = (mean(&|p| p.0.log2()), mean(&|p| p.1.log2()));
    mean(&|p| (p.0.log2() - x) * (p.1.log2() - y)) / mean(&|p| (p.0.log2() - x).powi(2))
}

fn state_at(case: &golden::Case, time: f64) -> &serde_json::Value {
    let states = case.record["states"].as_array().expect("states");
    let found = states.iter().find(|state| golden::number(&state["t"]) == time);
    found.unwrap_or_else(|| panic!("{} has no state at {time} s", case.name))
}

/// dt = 2^-k and the error at [`SPAN`] with it, in f64.
fn error(method: Method, case: &golden::Case, k: i32) -> (f64, f64) {
    let torque = Torque::of(case);
    let moving = start_of::<f64>(case);
    let reference = golden::quaternion(&state_at(case, SPAN)["q"]);
    let dt = 2.0_f64.powi(-k);
    let steps = (SPAN / dt) as u64;
    let state = match torque {
        Torque::None => stepped_by(method, &moving, &Free, dt, steps),
        torque => stepped_by(method, &moving, &Acting::new(torque, dt), dt, steps),
    };
    (dt, attitude_error(attitude(&state), reference))
}

/// The finest steps of `candidates` (coarsest first) whose error is above `floor`, as many as five halvings take.
fn finest(candidates: impl Iterator<Item = (f64, f64)>, floor: f64) -> Vec<(f64, f64)> {
    let above: Vec<(f64, f64)> = candidates.take_while(|point| point.1 > floor).collect();
    above[above.len().saturating_sub(HALVINGS + 1)..].to_vec()
}

/// Says what is wrong with an observed order, if anything.
fn judged(what: &str, errors: &[(f64, f64)], claim: u32) -> Option<String> {
    let order = fitted_order(errors);
    println!("{what}: order {order:.3} over {} halvings, from {errors:?}", errors.len() - 1);
    let enough = errors.len() > HALVINGS;
    let near = (order - f64::from(claim)).abs() <= ORDER_TOLERANCE;
    (!(enough && near)).then(|| format!("{what}: order {order:.3}, {claim} claimed, from {errors:?}"))
}

#[test]
fn methods_up_to_order_4_show_their_order_under_every_kind_of_torque() {
    // Rounding of the state after some thousand steps, u √n, is 1e-14; errors above this follow the order.
    const FLOOR: f64 = 3e-13;
    let mut failures = Vec::new();
    for (file, name, kind) in CASES {
        let case = case(file, name);
        for method in Method::ALL {
            let claim = method.properties().order_under(kind);
            // The free flow of splitting4 is of order 6 and its error the larger one down to small steps; its order, and
            // those above, have tests of their own.
            let range = match claim {
                1 => 7..=12,
                2 => 4..=9,
                4 if method != Method::Splitting4 => 1..=9,
                _ => continue,
            };
            let errors = finest(range.map(|k| error(method, &case, k)), FLOOR);
            failures.extend(judged(&format!("{method} on {name}"), &errors, claim));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// `steps` steps of one of the methods of high order, in 32 digits.
fn stepped_precisely(
    method: Method,
    moving: &Moving<DoubleDouble>,
    torque: Torque,
    dt: f64,
    steps: u64,
) -> polhode::rigid_body::State<DoubleDouble> {
    use polhode::method::{rk8::Rk8, splitting::Splitting};
    let acting = Acting::new(torque, dt);
    match (method, torque) {
        (Method::Rk8, Torque::None) => stepped::<_, Rk8, _>(moving, &Free, dt, steps),
        (Method::Rk8, _) => stepped::<_, Rk8, _>(moving, &acting, dt, steps),
        (_, Torque::None) => stepped::<_, Splitting<6>, _>(moving, &Free, dt, steps),
        (Method::Splitting4, _) => stepped::<_, Splitting<4>, _>(moving, &acting, dt, steps),
        (Method::Splitting6, _) => stepped::<_, Splitting<6>, _>(moving, &acting, dt, steps),
        (other, _) => panic!("{other} is of low order"),
    }
}

/// The finest step is 2^-FINEST s.
const FINEST: i32 = 11;

/// How far the limit for small steps may lie from the truth, rad: the coefficients are f64 numbers, whose roundings (1e-16
/// of a slope of up to 3 rad/s, over 10 s) move it.
const ROUNDED_COEFFICIENTS: f64 = 3e-15;

/// What a method's attitude tends to for small steps h: the parabola in h through those of the three finest steps.
///
/// The roundings of the coefficients violate the order conditions by some 1e-17, which leaves an error a + b h + c h² + …
/// beside that of truncation.
struct Tendency {
    finest: f64,
    attitudes: [Quaternion<DoubleDouble>; 3],
}

impl Tendency {
    /// The angle between an attitude with steps of h and the tendency, rad.
    fn error(&self, h: f64, q: Quaternion<DoubleDouble>) -> f64 {
        let [first, second, third] = self.attitudes;
        // Lagrange's polynomials of the nodes 1, 2, 4.
        let x = h / self.finest;
        let by = |difference, weight: f64| difference * DoubleDouble::from(weight);
        let tendency =
            first + by(second - first, -0.5 * (x - 1.0) * (x - 4.0)) + by(third - first, (x - 1.0) * (x - 2.0) / 6.0);
        2.0 * (q - tendency).norm_squared().to_f64().sqrt()
    }
}

#[test]
fn rk8_and_splitting6_show_their_order_under_every_kind_of_torque() {
    let mut failures = Vec::new();
    for (file, name, kind) in CASES {
        let case = case(file, name);
        let moving = start_of::<DoubleDouble>(&case);
        for method in [Method::Rk8, Method::Splitting6] {
            let claim = method.properties().order_under(kind);
            // In 32 digits. Below the floor lies what the parabola leaves of the roundings and, times (h/finest)², of the
            // truncation at the finest steps.
            let floor = if method == Method::Rk8 { 3e-21 } else { 1e-17 };
            let run = |k: i32| {
                let dt = 2.0_f64.powi(-k);
                stepped_precisely(method, &moving, Torque::of(&case), dt, (SPAN / dt) as u64)
            };
            let fine = [FINEST, FINEST - 1, FINEST - 2].map(run);
            let tendency =
                Tendency { finest: 2.0_f64.powi(-FINEST), attitudes: fine.map(|state| state.orientation.value) };
            let off = precise_error(&fine[0], state_at(&case, SPAN));
            println!("{method} on {name}: the finest step is off by {off:e}");
            if off > ROUNDED_COEFFICIENTS {
                failures.push(format!("{method} on {name}: the finest step is off by {off:e}"));
            }
            let error = |k: i32| {
                let h = 2.0_f64.powi(-k);
                (h, tendency.error(h, run(k).orientation.value))
            };
            let errors = finest((-1..FINEST - 2).map(error), floor);
            failures.extend(judged(&format!("{method} on {name}"), &errors, claim));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// An asymmetric body whose moments change by a ramp, whose ends lie within steps of every size, and by an oscillation.
const CHANGES: [Changing; 2] =
    [Changing { law: Law::Ramp { start: 0.73, duration: 5.11 }, ..OSCILLATING }, OSCILLATING];
const OSCILLATING: Changing = Changing {
    before: DVec3::new(1.0, 1.6, 2.2),
    after: DVec3::new(0.7, 1.1, 0.9),
    law: Law::Oscillation { rate: 1.3 },
    dt: 0.0,
};
/// rad/s
const TUMBLE: DVec3 = DVec3::new(0.5, 0.9, -0.4);
/// After the ramp's end, s.
const CHANGED: f64 = 8.0;

#[test]
fn methods_keep_their_order_while_moments_of_inertia_change() {
    const IDENTITY: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
    let mut failures = Vec::new();
    for change in CHANGES {
        let (moving, precise) = (
            at_start::<f64>(change.before, IDENTITY, TUMBLE),
            at_start::<DoubleDouble>(change.before, IDENTITY, TUMBLE),
        );
        let run = |k: i32| {
            let dt = 2.0_f64.powi(-k);
            stepped::<_, polhode::method::rk8::Rk8, _>(&precise, &Changing { dt, ..change }, dt, (CHANGED / dt) as u64)
        };
        let fine = [FINEST, FINEST - 1, FINEST - 2].map(run);
        let finest_step = 2.0_f64.powi(-FINEST);
        let tendency = Tendency { finest: finest_step, attitudes: fine.map(|state| state.orientation.value) };
        let error = |k: i32| {
            let h = 2.0_f64.powi(-k);
            (h, tendency.error(h, run(k).orientation.value))
        };
        // As in the test above.
        let errors = finest((0..FINEST - 2).map(error), 3e-21);
        failures.extend(judged(&format!("rk8 under {:?}", change.law), &errors, 8));

        let [x, y, z, w] = {
            use polhode::real::Scalar;
            let q = fine[0].orientation.value;
            [q.x, q.y, q.z, q.w].map(|component| component.to_f64())
        };
        let truth = glam::DQuat::from_xyzw(x, y, z, w).normalize();
        for method in [Method::Rk4, Method::Cf4] {
            let errors = (4..=4 + HALVINGS as i32).map(|k| {
                let dt = 2.0_f64.powi(-k);
                let state = stepped_by(method, &moving, &Changing { dt, ..change }, dt, (CHANGED / dt) as u64);
                (dt, attitude_error(attitude(&state), truth))
            });
            failures.extend(judged(&format!("{method} under {:?}", change.law), &errors.collect::<Vec<_>>(), 4));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Torques sixteen times those of the golden cases, so that what the composition does stands out from the error of the
/// free flow; the truth is `rk8` at a much smaller step.
fn strong(torque: Torque) -> Torque {
    match torque {
        Torque::HeavyTop { com, weight } => Torque::HeavyTop { com, weight: 16.0 * weight },
        Torque::Sinusoidal { sin, cos, rate } => Torque::Sinusoidal { sin: 16.0 * sin, cos: 16.0 * cos, rate },
        Torque::LinearDrag { coefficient } => Torque::LinearDrag { coefficient: 16.0 * coefficient },
        Torque::QuadraticDrag { coefficient } => Torque::QuadraticDrag { coefficient: 16.0 * coefficient },
        other => other,
    }
}

#[test]
fn splitting4_shows_its_order_where_the_torque_is_strong() {
    // As above, for twice as many substeps.
    const FLOOR: f64 = 1e-15;
    let mut failures = Vec::new();
    for (file, name, _) in [CASES[1], CASES[3], CASES[4], CASES[6]] {
        let case = case(file, name);
        let moving = start_of::<DoubleDouble>(&case);
        let torque = strong(Torque::of(&case));
        let truth = stepped_precisely(Method::Rk8, &moving, torque, 1.0 / 512.0, 1024).orientation.value;
        let candidates = (3..=10).map(|k| {
            let dt = 2.0_f64.powi(-k);
            let state = stepped_precisely(Method::Splitting4, &moving, torque, dt, (2.0 / dt) as u64);
            (dt, between(truth, state.orientation.value))
        });
        let errors = finest(candidates, FLOOR);
        failures.extend(judged(&format!("splitting4 on {name}"), &errors, 4));
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Errors of a composition of order 6 under strong linear drag, after 2 s.
fn under_drag(composition: &Composition) -> Vec<(f64, f64)> {
    let case = case("forced_drag", "lin_drag1_p");
    let moving = start_of::<DoubleDouble>(&case);
    let torque = strong(Torque::of(&case));
    let truth = stepped_precisely(Method::Rk8, &moving, torque, 1.0 / 512.0, 1024).orientation.value;
    (2..=2 + HALVINGS as i32)
        .map(|k| {
            let step = 2.0_f64.powi(-k);
            let acting = Acting { claimed: Some(VelocityDependence::LinearDrag), ..Acting::new(torque, step) };
            let dt = two_words::<DoubleDouble>(step);
            use polhode::method::Step;
            let prepared =
                splitting::Splitting::<6>::prepare::<DoubleDouble, Acting>(&moving.body, &moving.invariants, dt);
            let mut state = moving.state;
            for index in 0..(2.0 / step) as u64 {
                state = splitting::composed::<DoubleDouble, Acting, 6>(
                    composition,
                    &moving.body,
                    &prepared,
                    &acting,
                    index,
                    dt,
                    state,
                );
            }
            (step, between(truth, state.orientation.value))
        })
        .collect()
}

#[test]
fn the_nystrom_composition_loses_order_under_drag_and_the_general_one_does_not() {
    let nystrom = under_drag(&SRKN11B);
    let general = under_drag(&BM6);
    println!("SRKN11b {nystrom:?}\nBM6 {general:?}");
    let last = |errors: &[(f64, f64)]| fitted_order(&errors[errors.len() - 3..]);
    assert!(last(&nystrom) < 5.0, "SRKN11b: order {:.2} from {nystrom:?}", last(&nystrom));
    assert!((fitted_order(&general[..4]) - 6.0).abs() <= 0.3, "BM6: {general:?}");
    // Which is why the method takes the general one there.
    assert_eq!(splitting::composition::<6>(VelocityDependence::LinearDrag).drift_ends, BM6.drift_ends);
    assert_eq!(splitting::composition::<6>(VelocityDependence::None).drift_ends, SRKN11B.drift_ends);
}
