//! The order of every method under every kind of torque, over five halvings of the step.
//!
//! The torques are the library's: up to order 4 steps are an engine's, and above it, where rounding in `f64` leaves too few halvings, they are
//! taken in 32 digits under the same sum of torques ([`polhode::engine::under_torques::under_torques`]).

use crate::common;
use crate::support;

use std::sync::OnceLock;

use common::torques::every_torque;
use glam::{DMat3, DQuat, DVec3};
use polhode::bodies::BodyFrame;
use polhode::engine::Engine;
use polhode::engine::batch::{AnyBatch, Batch, prepare_with};
use polhode::engine::under_torques::{UnderTorques, under_torques};
use polhode::kernel::method::rk8::Rk8;
use polhode::kernel::method::rk8_adaptive::Timed;
use polhode::kernel::method::splitting::{self, BM6, Composition, SRKN11B, Splitting};
use polhode::kernel::method::{Step, TorqueKind};
use polhode::kernel::rigid_body::{Body, Invariants, State};
use polhode::kernel::torque_kernel::VelocityDependence;
use polhode::math::Precision;
use polhode::math::quaternion::Quaternion;
use polhode::math::real::Scalar;
use polhode::math::vector::{TwoWords, Vector};
use polhode::scene::AdaptiveSteps;
use polhode::torque::Parameters;
use polhode::torque::variable_inertia::{InertiaChange, Law};
use polhode::{Ensemble, Method, Plan, Scene, Torque};
use support::double_double::DoubleDouble;
use support::torque_kernel::{Moving, between, case, stepped, two_words};
use support::{attitude_error, fitted_order, golden};

/// How far an observed order may lie from the claimed one.
const ORDER_TOLERANCE: f64 = 0.1;

/// Halvings of the step that an order is fitted over.
const HALVINGS: usize = 5;

/// The time at which a golden case is compared, s: after 3 to 23 rad of rotation.
const GOLDEN_SPAN: f64 = 10.0;
/// The same of the other problems, s: after some 3 rad.
const SPAN: f64 = 3.0;

/// How long moments change by a ramp, s, and after which time such a body is compared.
const RAMP: f64 = 5.11;
const CHANGED: f64 = 8.0;

/// A free asymmetric body, a heavy top, a time-dependent torque, gravity gradient, and drag of three kinds.
const CASES: [(&str, &str); 7] = [
    ("free_asymmetric", "asym_p01"),
    ("forced_top", "heavy_asym0_p"),
    ("forced_torque", "sin_torque0_p"),
    ("forced_gg", "gg_circ_tumble0_p"),
    ("forced_drag", "lin_drag0_p"),
    ("forced_drag", "matrix_drag0_p"),
    ("forced_drag", "quad_drag1_p"),
];

/// Torques of neither attitude nor time. Without its line here a torque is taken for one of them, and methods that lose order under such
/// torques seem to have a higher one than they claim.
const ROTATION_ALONE: [&str; 5] =
    ["constant-body", "linear-drag", "matrix-drag", "quadratic-drag", "internal-dissipation"];

/// One body under some torques.
struct Problem {
    name: String,
    ensemble: Ensemble,
    torques: Vec<Torque>,
    span: f64,
    truth: DQuat,
}

/// An asymmetric body that tumbles, as moments, orientation and spin (rad/s).
fn tumbling() -> (DVec3, DQuat, DVec3) {
    (DVec3::new(1.0, 1.6, 2.2), DQuat::from_xyzw(0.5, -0.25, 0.125, 1.0).normalize(), DVec3::new(0.5, 0.9, -0.4))
}

/// Every torque of the library alone, a formula of a user's, and moments that change. White noise has no order, and a torque without strength
/// none but the free body's; the logarithmic spring jumps at half a turn, so it pulls to where the body starts.
fn every_problem() -> Vec<(String, Vec<Torque>)> {
    let moments = [1.6];
    let smooth = |torque: Torque| match torque.name() {
        "log-spring" => Torque::log_spring(0.5, tumbling().1),
        _ => torque,
    };
    let all = every_torque(&moments).into_iter().filter(|torque| !torque.is_random()).map(smooth);
    let mut problems: Vec<(String, Vec<Torque>)> = all
        .filter(|torque| *torque != Torque::constant_body(DVec3::ZERO))
        .enumerate()
        .map(|(number, torque)| (format!("{} ({number})", torque.name()), vec![torque]))
        .collect();
    let text = "-0.2 * angular_velocity * exp(-0.2 * time) + 0.3 * cross(to_body(vec(0, 0, 1)), vec(0.3, 0, 1))";
    problems.push(("custom".into(), vec![Torque::custom(text, Parameters::new()).expect("a formula")]));
    // The ramp's ends lie within steps of every size.
    for (name, law) in [("ramp", Law::ramp(0.73, RAMP)), ("oscillation", Law::oscillation(1.3))] {
        problems.push((name.into(), vec![Torque::variable_inertia(InertiaChange::factor(0.6), law)]));
    }
    problems
}

fn one_body((moments, orientation, spin): (DVec3, DQuat, DVec3)) -> Ensemble {
    Ensemble::from_columns(&[moments], &[orientation], &[spin]).expect("a valid body")
}

/// The attitude at the end of a scene of one body.
fn attitude_at_end(scene: Scene) -> DQuat {
    let engine = Engine::cpu();
    let plan = Plan::new(&scene, &engine).expect("the plan is valid");
    let record = engine.run(&plan).expect("the run succeeds");
    assert_eq!(record.trust().failed_bodies, Vec::<usize>::new());
    record.final_state().orientation(0)
}

impl Problem {
    /// A golden case.
    fn golden(file: &str, name: &str) -> Self {
        let case = case(file, name);
        let ensemble =
            Ensemble::from_columns(&[case.inertia], &[case.orientation], &[case.angular_velocity_body]).expect("valid");
        let state = case.states.iter().find(|state| state.time == GOLDEN_SPAN).expect("a golden state");
        let torques = golden::torques(&case.record["model"], 1.0);
        Self { name: name.to_owned(), ensemble, torques, span: GOLDEN_SPAN, truth: state.orientation }
    }

    /// The tumbling body under some torques; the truth is that of Taylor series, which adaptive steps of `rk8` must agree with.
    fn tumbling((name, torques): (String, Vec<Torque>)) -> Self {
        let steps = AdaptiveSteps { tolerance: 2e-15, least_step: None };
        let span = if torques[0].name() == "variable-inertia" { CHANGED } else { SPAN };
        let problem = Self { name, ensemble: one_body(tumbling()), torques, span, truth: DQuat::IDENTITY };
        let truth = attitude_at_end(problem.scene().taylor(steps));
        let other = attitude_at_end(problem.scene().adaptive(steps, Some(Precision::F64)));
        let off = attitude_error(truth, other);
        assert!(off <= 0.3 * FLOOR, "{}: the truth is known to {off:e}", problem.name);
        Self { truth, ..problem }
    }

    fn scene(&self) -> Scene {
        let scene = Scene::new(self.ensemble.clone()).until(self.span).skipping(false);
        self.torques.iter().fold(scene, |scene, torque| scene.torque(torque.clone()))
    }

    fn prepared(&self) -> (Vec<BodyFrame>, AnyBatch) {
        prepare_with(&self.ensemble, &self.torques, self.span, Precision::F64).expect("enough memory")
    }

    fn batch(&self) -> Batch<f64> {
        match self.prepared().1 {
            AnyBatch::F64(batch) => batch,
            AnyBatch::F32(_) => panic!("f64 was asked for"),
        }
    }

    /// The order that a method claims under the torques: the lowest of those of the kinds that they are of.
    fn claim(&self, method: Method) -> u32 {
        let order = |kind| method.properties().order_under(kind);
        if self.torques.is_empty() {
            return order(TorqueKind::Free);
        }
        let of_body = |torque: &Torque| ROTATION_ALONE.contains(&torque.name());
        let of_velocity = self.batch().torques.velocity_dependence() != VelocityDependence::None;
        let of_attitude_or_time = !self.torques.iter().all(of_body);
        let kinds = [(of_velocity, TorqueKind::AngularVelocity), (of_attitude_or_time, TorqueKind::AttitudeOrTime)];
        kinds.into_iter().filter(|kind| kind.0).map(|kind| order(kind.1)).min().unwrap_or(method.order())
    }

    fn can_be_followed_by(&self, method: Method) -> bool {
        !method.properties().rigid_only || self.torques.iter().all(Torque::leaves_rigid)
    }

    /// dt = 2^-k and the error at the end with it, in f64.
    fn error(&self, method: Method, k: i32) -> (f64, f64) {
        let dt = 2.0_f64.powi(-k);
        let (frames, batch) = self.prepared();
        let words = common::advanced(&Engine::cpu(), &batch, method, dt, (self.span / dt) as u64);
        (dt, attitude_error(frames[0].body_state(words.combined(0)).orientation, self.truth))
    }
}

/// The problems, with their truths formed once.
fn problems() -> &'static [Problem] {
    static PROBLEMS: OnceLock<Vec<Problem>> = OnceLock::new();
    PROBLEMS.get_or_init(|| {
        let golden = CASES.into_iter().map(|(file, name)| Problem::golden(file, name));
        golden.chain(every_problem().into_iter().map(Problem::tumbling)).collect()
    })
}

/// The finest steps of `candidates` (coarsest first) whose error is above `floor`, as many as the halvings take.
fn finest(candidates: impl Iterator<Item = (f64, f64)>, floor: f64, halvings: usize) -> Vec<(f64, f64)> {
    let above: Vec<(f64, f64)> = candidates.take_while(|point| point.1 > floor).collect();
    above[above.len().saturating_sub(halvings + 1)..].to_vec()
}

/// The order where the next term of the error counts: p of log₂ error = a + p log₂ dt + c dt by least squares.
fn fitted_order_with_next_term(errors: &[(f64, f64)]) -> f64 {
    let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for &(h, error) in errors {
        let basis = DVec3::new(1.0, h.log2(), h);
        normal += DMat3::from_cols(basis * basis.x, basis * basis.y, basis * basis.z);
        right += basis * error.log2();
    }
    (normal.inverse() * right).y
}

/// Says what is wrong with an observed order, if anything.
fn judged(what: &str, errors: &[(f64, f64)], claim: u32) -> Option<String> {
    let order = if claim == 8 { fitted_order_with_next_term(errors) } else { fitted_order(errors) };
    println!("{what}: order {order:.3} over {} halvings, from {errors:?}", errors.len().saturating_sub(1));
    let (halvings, tolerance) =
        if claim == 8 { (HALVINGS_OF_ORDER_8, TOLERANCE_OF_ORDER_8) } else { (HALVINGS, ORDER_TOLERANCE) };
    let enough = errors.len() > halvings;
    let near = (order - f64::from(claim)).abs() <= tolerance;
    (!(enough && near)).then(|| format!("{what}: order {order:.3}, {claim} claimed, from {errors:?}"))
}

/// Rounding of the state after some thousand steps, u √n, is 1e-14; errors above this follow the order.
const FLOOR: f64 = 3e-13;

/// The free flow of the splittings is of order 6 and its error the larger one down to small steps; their orders, and those above 4, have
/// tests of their own.
const WITH_TESTS_OF_THEIR_OWN: [Method; 4] = [Method::Rk8, Method::Splitting2, Method::Splitting4, Method::Splitting6];

#[test]
fn methods_up_to_order_4_show_their_order_under_every_torque() {
    let mut failures = Vec::new();
    let mut fitted = 0;
    for problem in problems() {
        for method in Method::ALL.into_iter().filter(|&method| problem.can_be_followed_by(method)) {
            let claim = problem.claim(method);
            let range = match claim {
                1 => 6..=11,
                2 => 4..=9,
                4 if method != Method::Splitting4 => 1..=9,
                _ if WITH_TESTS_OF_THEIR_OWN.contains(&method) => continue,
                other => panic!(
                    "{method} claims order {other}: give steps for it here, or test it apart as {WITH_TESTS_OF_THEIR_OWN:?}"
                ),
            };
            let errors = finest(range.map(|k| problem.error(method, k)), FLOOR, HALVINGS);
            failures.extend(judged(&format!("{method} on {}", problem.name), &errors, claim));
            fitted += 1;
        }
    }
    println!("{fitted} orders");
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// A body of a batch at its start, in its own units.
fn moving(batch: &Batch<f64>) -> Moving<DoubleDouble> {
    let state = batch.read(0..1).combined(0).map(DoubleDouble::from);
    let zero = DoubleDouble::default();
    let [x, y, z] = [0, 1, 2].map(|axis| DoubleDouble::from(batch.parameters[axis * batch.stride]));
    let body = Body::new(TwoWords { value: Vector::new(x, y, z), residue: Vector::zero() });
    let [qx, qy, qz, qw, a, b, c] = state;
    let m = Vector::new(a, b, c);
    let omega = Vector::new(x, y, z).scaled_by(m);
    Moving {
        body,
        invariants: Invariants {
            angular_momentum_squared: m.dot(m),
            kinetic_energy: DoubleDouble::from(0.5) * m.dot(omega),
        },
        state: State {
            orientation: TwoWords {
                value: Quaternion::new(qx, qy, qz, qw),
                residue: Quaternion::new(zero, zero, zero, zero),
            },
            angular_momentum_principal: TwoWords { value: m, residue: Vector::zero() },
            status: zero,
        },
    }
}

/// Equal steps in 32 digits.
struct Precisely {
    method: Method,
    moving: Moving<DoubleDouble>,
    /// In units of the body's own scale.
    dt: f64,
    steps: u64,
}

impl UnderTorques<DoubleDouble> for Precisely {
    type Output = Quaternion<DoubleDouble>;
    fn run<E: Timed<DoubleDouble>>(self, torques: &E) -> Quaternion<DoubleDouble> {
        let Self { method, moving, dt, steps } = self;
        let state = match method {
            Method::Rk8 => stepped::<_, Rk8, E>(&moving, torques, dt, steps),
            Method::Splitting4 => stepped::<_, Splitting<4>, E>(&moving, torques, dt, steps),
            Method::Splitting6 => stepped::<_, Splitting<6>, E>(&moving, torques, dt, steps),
            other => panic!("{other} is of low order"),
        };
        state.orientation.value
    }
}

/// The column of a body's reference rate.
const RATE: usize = 3;

/// The attitude after `span` in steps of 2^-k s.
fn precisely(batch: &Batch<f64>, method: Method, span: f64, k: i32) -> Quaternion<DoubleDouble> {
    let dt = 2.0_f64.powi(-k);
    let rate = batch.parameters[RATE * batch.stride];
    under_torques(batch, 0, dt, Precisely { method, moving: moving(batch), dt: dt * rate, steps: (span / dt) as u64 })
}

/// The finest step is 2^-k s with this k, after the longer span of golden cases with one more.
const FINEST: i32 = 9;

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

/// Of order 8 five halvings would span 1e12, from errors that are not yet in proportion to h⁸ to those that rounding hides.
const HALVINGS_OF_ORDER_8: usize = 4;
/// How far the order may then lie from 8, fitted with the next term of the error: measured 0.2 where a planet's field turns fast, below 0.1
/// under most torques.
const TOLERANCE_OF_ORDER_8: f64 = 0.25;
/// Below it roundings of phases, and of the coefficients in the second power of h, show in an error.
const FLOOR_WITH_PHASES: f64 = 5e-19;

/// Models whose phases or times are rounded to 2⁻⁶⁴ turn at the start of each step.
fn has_phases(torque: &Torque) -> bool {
    let name = torque.name();
    name.starts_with("orbiting") || ["sinusoidal", "gravity-gradient", "variable-inertia", "custom"].contains(&name)
}

/// The errors of a method with steps of 1 s, ½ s, … as many as halvings are asked for: against what it tends to.
///
/// Under torques of time phases are rounded as well, by turns of 2⁻⁶⁴ at the start of each step and by those of their rates within
/// it, which leaves an error in proportion to h and one at random, which a parabola would enlarge: against a line then, and above what
/// the middle one of the three finest steps lies off it.
fn precise_errors(problem: &Problem, method: Method, halvings: usize) -> Vec<(f64, f64)> {
    let batch = problem.batch();
    let run = |k: i32| precisely(&batch, method, problem.span, k);
    let last = FINEST + i32::from(problem.span == GOLDEN_SPAN);
    let tendency = Tendency { finest: 2.0_f64.powi(-last), attitudes: [last, last - 1, last - 2].map(run) };
    if method != Method::Rk8 || !problem.torques.iter().any(has_phases) {
        let floor = if method == Method::Rk8 { 1e-20 } else { 1e-17 };
        let error = |k: i32| (2.0_f64.powi(-k), tendency.error(2.0_f64.powi(-k), run(k)));
        return finest((0..last - 2).map(error), floor, halvings);
    }
    let [first, second, third] = tendency.attitudes;
    // From the finest step to four times it.
    let of_line = |h: f64| (h / tendency.finest - 1.0) / 3.0;
    let from_line = |h: f64, q: Quaternion<DoubleDouble>| {
        let off = q - (first + (third - first) * DoubleDouble::from(of_line(h)));
        2.0 * off.norm_squared().to_f64().sqrt()
    };
    let noise = from_line(2.0 * tendency.finest, second);
    let candidates = (0..last - 2).map(|k| (2.0_f64.powi(-k), from_line(2.0_f64.powi(-k), run(k))));
    let above = candidates.take_while(|&(h, error)| error > FLOOR_WITH_PHASES.max(20.0 * noise * of_line(h)));
    finest(above, 0.0, halvings)
}

#[test]
fn rk8_and_splitting6_show_their_order_under_every_torque() {
    let mut failures = Vec::new();
    for problem in problems() {
        for method in [Method::Rk8, Method::Splitting6].into_iter().filter(|&m| problem.can_be_followed_by(m)) {
            let claim = problem.claim(method);
            let halvings = if claim == 8 { HALVINGS_OF_ORDER_8 } else { HALVINGS };
            let errors = precise_errors(problem, method, halvings);
            failures.extend(judged(&format!("{method} on {}", problem.name), &errors, claim));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// After this time strong torques are compared, s.
const STRONG_SPAN: f64 = 2.0;

/// A golden case under torques sixteen times as strong, so that what a composition does stands out from the error of the free flow, and
/// the attitude at the end: by `rk8` at a much smaller step.
fn strong(file: &str, name: &str) -> (Batch<f64>, Quaternion<DoubleDouble>) {
    let model = case(file, name).record["model"].clone();
    let problem = Problem { torques: golden::torques(&model, 16.0), span: STRONG_SPAN, ..Problem::golden(file, name) };
    let batch = problem.batch();
    let truth = precisely(&batch, Method::Rk8, STRONG_SPAN, 9);
    (batch, truth)
}

#[test]
fn splitting4_shows_its_order_where_the_torque_is_strong() {
    // As above, for twice as many substeps.
    const FLOOR: f64 = 1e-15;
    let mut failures = Vec::new();
    for (file, name) in [CASES[1], CASES[3], CASES[4], CASES[6]] {
        let (batch, truth) = strong(file, name);
        let candidates =
            (3..=10).map(|k| (2.0_f64.powi(-k), between(truth, precisely(&batch, Method::Splitting4, STRONG_SPAN, k))));
        let errors = finest(candidates, FLOOR, HALVINGS);
        failures.extend(judged(&format!("splitting4 on {name}"), &errors, 4));
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Equal steps of a composition of order 6.
struct Composed<'a> {
    composition: &'a Composition,
    moving: Moving<DoubleDouble>,
    dt: f64,
    steps: u64,
}

impl UnderTorques<DoubleDouble> for Composed<'_> {
    type Output = Quaternion<DoubleDouble>;
    fn run<E: Timed<DoubleDouble>>(self, torques: &E) -> Quaternion<DoubleDouble> {
        let Self { composition, moving: Moving { body, invariants, mut state }, dt, steps } = self;
        assert_eq!(torques.velocity_dependence(), VelocityDependence::LinearDrag);
        let dt = two_words::<DoubleDouble>(dt);
        let prepared = Splitting::<6>::prepare::<DoubleDouble, E>(&body, &invariants, dt);
        for index in 0..steps {
            state = splitting::composed::<DoubleDouble, E, 6>(composition, &body, &prepared, torques, index, dt, state);
        }
        state.orientation.value
    }
}

/// Errors of a composition of order 6 under strong linear drag.
fn under_drag(composition: &Composition) -> Vec<(f64, f64)> {
    let (batch, truth) = strong("forced_drag", "lin_drag1_p");
    let rate = batch.parameters[RATE * batch.stride];
    (2..=2 + HALVINGS as i32)
        .map(|k| {
            let dt = 2.0_f64.powi(-k);
            let steps = (STRONG_SPAN / dt) as u64;
            let composed = Composed { composition, moving: moving(&batch), dt: dt * rate, steps };
            (dt, between(truth, under_torques(&batch, 0, dt, composed)))
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
