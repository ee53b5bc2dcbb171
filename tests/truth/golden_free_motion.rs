//! The closed form of torque-free bodies against 25 digits from two independent methods, at every listed time.
//!
//! Error means attitude angle in rad, and |Δω|/|ω|.

use crate::support;

use glam::{DQuat, DVec3};
use polhode::Ensemble;
use polhode::bodies::columns::STATE_COMPONENTS;
use polhode::bodies::{BodyFrame, BodyState};
use polhode::kernel::free_motion::{FreeMotion, FreeMotionRows};
use polhode::math::real::Scalar;
use polhode::plan::CLOSED_FORM_F32;
use support::golden::Case;
use support::{attitude_error, golden, relative_error};

/// `f64`: 2e-14 (1 + κ), κ = 0 but for a case whose inputs are themselves rounded.
const BOUND_F64: f64 = 2e-14;
/// `f64` at distant times.
const FAR_F64: f64 = 1e-13;
/// `f32`: constants of the row, two angles and some thirty operations, each rounded to 6e-8, magnified by 2 from
/// quaternion to angle.
const BOUND_F32: f64 = CLOSED_FORM_F32;
/// `f32` at distant times.
const FAR_F32: f64 = CLOSED_FORM_F32;

/// The time as a row's own scale sees the inputs: what rounding them to `f64` alone does to the state.
///
/// Inputs of all cases but `exactsep_123` are exact binary fractions. There the exact data lie on the separatrix and the
/// rounded ones beside it: a rounding of u in each component of ω, at most √3 u |ω| together, grows along the unstable
/// direction of the intermediate axis as exp(λt), λ = |ω₂| √((I₂ − I₁)(I₃ − I₂)/(I₁I₃)) (linearised Euler's equations
/// about the saddle), and at most by that factor elsewhere on the orbit.
fn inherent_error(case: &Case, time: f64) -> f64 {
    if case.name != "exactsep_123" {
        return 0.0;
    }
    let (moments, omega) = (DVec3::new(1.0, 2.0, 3.0), case.angular_velocity_body);
    // On the separatrix L² = 2 T I₂, so that the spin at the saddle is |L|/I₂.
    let at_saddle = (moments * omega).length() / moments.y;
    let growth = at_saddle * (1.0_f64 / 3.0).sqrt();
    3.0_f64.sqrt() * f64::UNIT_ROUNDOFF * (growth * time).exp()
}

/// Both errors of a state.
fn errors(found: &BodyState, expected: &golden::State) -> [f64; 2] {
    [
        attitude_error(found.orientation, expected.orientation),
        relative_error(found.angular_velocity_body, expected.angular_velocity_body),
    ]
}

/// Holds `states` of a case against the golden ones.
fn check(failures: &mut Vec<String>, case: &Case, bound: f64, at: impl Fn(f64) -> BodyState) {
    for expected in &case.states {
        let [attitude, spin] = errors(&at(expected.time), expected);
        let bound = bound + inherent_error(case, expected.time);
        if !(attitude <= bound && spin <= bound) {
            failures.push(format!(
                "{} at t = {}: attitude {attitude:.2e}, angular velocity {spin:.2e}, bound {bound:.2e}",
                case.name, expected.time
            ));
        }
    }
}

fn report(failures: &[String]) {
    assert!(failures.is_empty(), "{} states:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn a_motion_follows_the_golden_bodies() {
    let mut failures = Vec::new();
    let cases = golden::load_free();
    assert_eq!(cases.len(), 59, "golden cases");
    for case in &cases {
        let motion = FreeMotion::new(case.inertia, case.orientation, case.angular_velocity_body).expect("valid");
        check(&mut failures, case, BOUND_F64, |time| motion.at(time));
    }
    report(&failures);
}

#[test]
fn a_motion_follows_the_golden_bodies_at_distant_times() {
    let mut failures = Vec::new();
    for case in &golden::load("free_far") {
        let motion = FreeMotion::new(case.inertia, case.orientation, case.angular_velocity_body).expect("valid");
        check(&mut failures, case, FAR_F64, |time| motion.at(time));
    }
    report(&failures);
}

/// All cases beside each other in rows.
struct Rows<T> {
    frames: Vec<BodyFrame>,
    rows: FreeMotionRows<T>,
}

impl<T: Scalar> Rows<T> {
    fn state(&self, columns: &[T], body: usize) -> BodyState {
        let stride = self.rows.stride;
        let row: [f64; STATE_COMPONENTS] = std::array::from_fn(|c| columns[c * stride + body].to_f64());
        self.frames[body].body_state(row)
    }
}

macro_rules! rows_follow {
    ($name:ident, $scalar:ty, $evaluate:ident, $bound:expr, $far:expr) => {
        #[test]
        fn $name() {
            let mut failures = Vec::new();
            for (cases, bound) in [(golden::load_free(), $bound), (golden::load("free_far"), $far)] {
                let ensemble = Ensemble::from_fn(cases.len(), |body| {
                    (cases[body].inertia, cases[body].orientation, cases[body].angular_velocity_body)
                })
                .expect("golden bodies are valid");
                let (frames, rows) = FreeMotionRows::<$scalar>::prepare(&ensemble).expect("there is memory");
                let rows = Rows { frames, rows };
                let mut times: Vec<f64> = cases.iter().flat_map(|case| case.states.iter().map(|s| s.time)).collect();
                times.sort_by(f64::total_cmp);
                times.dedup();
                let mut columns = vec![<$scalar>::NAN; STATE_COMPONENTS * <$scalar>::WORDS * rows.rows.stride];
                for time in times {
                    rows.rows.$evaluate(time, &mut columns);
                    for (body, case) in cases.iter().enumerate() {
                        let states: Vec<_> = case.states.iter().filter(|state| state.time == time).collect();
                        for expected in states {
                            let [attitude, spin] = errors(&rows.state(&columns, body), expected);
                            let bound = bound + inherent_error(case, time);
                            if !(attitude <= bound && spin <= bound) {
                                failures.push(format!(
                                    "{} at t = {time}: attitude {attitude:.2e}, angular velocity {spin:.2e}, bound {bound:.2e}",
                                    case.name
                                ));
                            }
                        }
                    }
                }
            }
            report(&failures);
        }
    };
}

rows_follow!(rows_in_f64_lanes_follow_the_golden_bodies, f64, evaluate, BOUND_F64, FAR_F64);
rows_follow!(rows_in_f64_one_by_one_follow_the_golden_bodies, f64, evaluate_one_by_one, BOUND_F64, FAR_F64);
rows_follow!(rows_in_f32_lanes_follow_the_golden_bodies, f32, evaluate, BOUND_F32, FAR_F32);
rows_follow!(rows_in_f32_one_by_one_follow_the_golden_bodies, f32, evaluate_one_by_one, BOUND_F32, FAR_F32);

/// A planted fault: the comparator rejects a body whose spin has the wrong sign, and one that is a few ulps off.
#[test]
fn the_comparison_rejects_a_wrong_motion() {
    let case = &golden::load("free_asymmetric")[0];
    let mut failures = Vec::new();
    let wrong = FreeMotion::new(case.inertia, case.orientation, -case.angular_velocity_body).expect("valid");
    check(&mut failures, case, BOUND_F64, |time| wrong.at(time));
    assert_eq!(failures.len(), case.states.len(), "a reversed spin");
    failures.clear();
    let motion = FreeMotion::new(case.inertia, case.orientation, case.angular_velocity_body).expect("valid");
    let turn = DQuat::from_rotation_x(4.0 * BOUND_F64);
    check(&mut failures, case, BOUND_F64, |time| {
        let state = motion.at(time);
        BodyState { orientation: state.orientation * turn, ..state }
    });
    assert_eq!(failures.len(), case.states.len(), "an orientation that is 8e-14 off");
}
