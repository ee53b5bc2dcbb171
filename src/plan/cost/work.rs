//! What a step costs under the torques that act, by the operations of their recorded graph.
//!
//! The table knows the time of a step of free bodies and under a constant torque and linear drag ([`super::COSTS`]). What other torques add
//! follows from the number of operations in one evaluation of the equations of motion or, for Taylor series, of multiplications in
//! the coefficients. Operations are counted, not timed, so that a plan that is made again is the same.

use std::collections::{BTreeMap, BTreeSet};

use super::Cost;
use crate::bodies::Ensemble;
use crate::bodies::columns::parameter_columns;
use crate::expression::jet::Lowered;
use crate::kernel::method::taylor::order_of;
use crate::math::Precision;
use crate::plan::{Group, Scheme, SkipName, TorqueSet};
use crate::scene::Scene;
use crate::torque::Torque;
use crate::torque::motion::{Operations, RecordedMotion};
use crate::torque::table::{Bodies, TorqueTable};

/// Time of one operation of a torque, s, in one lane of `f32` and `f64` of a core with AVX-512: in equal steps, where bodies share the
/// time, and in adaptive steps. It predicts steps of `rk8` of heavy tops, of gravity gradients and of *orbit* (DESIGN 8.4) to within a
/// fifth.
const OPERATION_IN_EQUAL_STEPS: [f64; 2] = [0.009e-9, 0.017e-9];
const OPERATION_IN_OWN_STEPS: [f64; 2] = [0.016e-9, 0.025e-9];
/// How much longer an interpreted operation takes.
const INTERPRETED: f64 = 2.7;
/// Operations of an evaluation under a constant torque and linear drag.
const DRIVEN_OPERATIONS: f64 = 18.0;

/// The time of a step by Taylor series, s, under the table's own torques at its tolerance ([`Lowered::step_seconds`]).
const TABULATED_SERIES: f64 = 8.518e-8;

/// What the torques cost that act together on bodies that are stepped.
pub(in crate::plan) type Works = BTreeMap<TorqueSet, Work>;

/// What the torques on the stepped bodies of these groups cost.
pub(in crate::plan) fn works_of(scene: &Scene, groups: &[Group]) -> Works {
    let stepped = groups.iter().filter(|group| group.treatment.precision_of_steps().is_some());
    let sets: BTreeSet<TorqueSet> = stepped.map(|group| group.class.torques).collect();
    sets.into_iter().map(|set| (set, Work::of(&set.of(scene.torques()), scene.ensemble()))).collect()
}

/// What the torques on a class of bodies cost.
#[derive(Clone, Debug)]
pub(in crate::plan) struct Work {
    is_free: bool,
    /// Operations of an evaluation beyond those of the driven problem, in equal steps and in adaptive steps.
    in_equal_steps: f64,
    in_own_steps: f64,
    /// The Taylor series of the motion under them.
    series: Option<Lowered>,
}

impl Work {
    /// The work of some of a scene's torques.
    pub fn of(torques: &[Torque], ensemble: &Ensemble) -> Self {
        let bodies = Bodies { have_linear_rotors: ensemble.has_linear_rotors(), axes: None };
        let table = |torques: &[Torque]| TorqueTable::new(torques, parameter_columns::<f64>(), 0, 0.0, bodies);
        let operations = |table: &TorqueTable| {
            RecordedMotion::new(table).map_or(Operations::default(), |motion| motion.operations(table))
        };
        let own = table(torques);
        let compiled: Vec<Torque> = torques.iter().filter(|torque| !torque.is_expressed()).cloned().collect();
        let all = operations(&own);
        let compiled = if compiled.len() < torques.len() { operations(&table(&compiled)) } else { all };
        let beyond_driven =
            |all: f64, compiled: f64| (compiled + INTERPRETED * (all - compiled) - DRIVEN_OPERATIONS).max(0.0);
        let series = RecordedMotion::for_series(&own).and_then(|motion| motion.lowered(false)).ok();
        Self {
            is_free: torques.is_empty(),
            in_equal_steps: beyond_driven(all.all - all.of_shared_time, compiled.all - compiled.of_shared_time),
            in_own_steps: beyond_driven(all.all, compiled.all),
            series,
        }
    }

    /// Whether a torque decides between cases, as far as its series are known.
    pub fn is_piecewise(&self) -> bool {
        self.series.as_ref().is_some_and(Lowered::has_switches)
    }

    /// Whether a torque may fade and come back unnoticed by steps that do not watch it, as only those of series do.
    pub fn may_fade(&self) -> bool {
        self.series.as_ref().is_some_and(Lowered::has_fading)
    }

    /// The skip for what the motion's Taylor series leave out.
    pub fn skip_of_series(&self) -> Option<SkipName> {
        match &self.series {
            Some(series) if series.has_orientation => None,
            Some(series) if series.has_directions() => Some(SkipName::Directions),
            _ => Some(SkipName::Attitude),
        }
    }

    /// Whether the motion has Taylor series.
    pub fn has_series(&self) -> bool {
        self.series.is_some()
    }

    /// Time of a step, s; that of adaptive ones depends on the tolerance.
    pub fn step_seconds(&self, cost: &Cost, precision: Precision, tolerance: f64) -> f64 {
        let tabulated = cost.step_seconds(precision, self.is_free);
        // Scaled by what the table's own problems take, as the table may be from another machine.
        tabulated
            * match (cost.scheme, &self.series) {
                (Scheme::TAYLOR, Some(series)) => series.step_seconds(order_of(tolerance)) / TABULATED_SERIES,
                (scheme, _) => {
                    let evaluations = f64::from(scheme.method().properties().evaluations);
                    let place = usize::from(precision == Precision::F64);
                    let shipped = Cost::shipped(scheme).step_seconds(precision, self.is_free);
                    let operations = match scheme {
                        Scheme::Equal(_) => self.in_equal_steps * OPERATION_IN_EQUAL_STEPS[place],
                        Scheme::Adaptive(_) => self.in_own_steps * OPERATION_IN_OWN_STEPS[place],
                    };
                    1.0 + evaluations * operations / shipped
                }
            }
    }
}

#[cfg(test)]
mod tests {
    use super::super::SERIES_TOLERANCE;
    use super::*;
    use glam::{DQuat, DVec3};

    fn work_of(torques: &[Torque]) -> Work {
        let rows = (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::X);
        Work::of(torques, &Ensemble::from_fn(3, |_| rows).expect("valid"))
    }

    #[test]
    fn the_tables_own_problem_costs_what_the_table_says() {
        let driven = [Torque::constant_body(DVec3::X), Torque::linear_drag(0.1)];
        for cost in super::super::COSTS {
            for precision in Precision::ALL {
                let within = if cost.scheme == Scheme::TAYLOR { 1e-3 } else { 0.0 };
                for (torques, is_free) in [(&driven[..], false), (&[], true)] {
                    let foretold = work_of(torques).step_seconds(cost, precision, SERIES_TOLERANCE);
                    let measured = cost.step_seconds(precision, is_free);
                    let agrees = foretold == measured || (foretold / measured - 1.0).abs() <= within;
                    assert!(agrees, "{}: {foretold:e} and {measured:e}", cost.scheme.name());
                }
            }
        }
        let taylor = Cost::shipped(Scheme::TAYLOR);
        for row in [taylor.free.seconds[1], taylor.driven.seconds[1]] {
            assert!(
                (TABULATED_SERIES / row - 1.0).abs() < 0.15,
                "the model says {TABULATED_SERIES:e}, the table {row:e}"
            );
        }
        let table = TorqueTable::new(
            &driven,
            parameter_columns::<f64>(),
            0,
            0.0,
            Bodies { have_linear_rotors: false, axes: None },
        );
        assert_eq!(RecordedMotion::new(&table).expect("a graph").operations(&table).all, DRIVEN_OPERATIONS);
    }

    #[test]
    fn what_bodies_share_of_the_time_costs_equal_steps_nothing() {
        use crate::torque::Orbit;
        let gradient = |axis: &[f64]| Torque::gravity_gradient(Orbit::kepler(1.0, axis.to_vec(), 0.3));
        let [shared, own] = [&[2.0; 3], &[2.0, 2.1, 2.2]].map(|axis| work_of(&[gradient(axis)]));
        let shared_axis = work_of(&[Torque::gravity_gradient(Orbit::kepler(1.0, 2.0, 0.3))]);
        let seconds = |work: &Work, scheme| work.step_seconds(Cost::shipped(scheme), Precision::F64, 1e-9);
        let equal = Scheme::Equal(crate::kernel::method::Method::Rk8);
        assert_eq!(seconds(&shared_axis, Scheme::ADAPTIVE_RK8), seconds(&own, Scheme::ADAPTIVE_RK8));
        assert!(seconds(&shared_axis, equal) < 0.7 * seconds(&own, equal));
        assert_eq!(seconds(&shared, equal), seconds(&own, equal), "numbers for each body, though they are equal");
    }

    #[test]
    fn more_torques_cost_more_and_interpreted_ones_most() {
        let drag = Torque::quadratic_drag(0.1);
        let top = Torque::heavy_top(1.0, DVec3::Z, DVec3::NEG_Z);
        let custom = Torque::custom("-0.1 * norm(angular_velocity) * angular_velocity", Default::default());
        let cost = Cost::shipped(Scheme::ADAPTIVE_RK8);
        let seconds = |torques: &[Torque]| work_of(torques).step_seconds(cost, Precision::F64, 1e-9);
        let one = seconds(std::slice::from_ref(&drag));
        assert!(seconds(&[drag, top]) > one);
        assert!(seconds(&[custom.expect("a formula")]) > one);
        let series = |tolerance| work_of(&[]).step_seconds(Cost::shipped(Scheme::TAYLOR), Precision::F64, tolerance);
        assert!(series(1e-12) > series(1e-6));
    }
}
