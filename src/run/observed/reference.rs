//! Event times of a sample of bodies, recomputed more accurately.

use super::evaluator::Evaluator;
use super::{EventWatch, number};
use crate::bodies::Members;
use crate::engine::Observer;
use crate::engine::cpu::Cpu;
use crate::error::Result;
use crate::kernel::free_motion::SetUp;
use crate::kernel::method::Method;
use crate::math::{Precision, Quantiles, Width};
use crate::plan::{Group, Plan, Treatment};
use crate::record::{EventErrors, EventRecord, OutputState, WallTime};
use crate::run::group_run::GroupRun;
use crate::scene::AdaptiveSteps;
use crate::torque::Torque;

/// What is asked of a step of bodies under torques.
const TOLERANCE: f64 = 1e-13;

/// Writes into the events of a run how far their times are from those of a sample of its bodies in closed form or by adaptive steps of
/// `rk8` in `f64` at a tolerance of 1e-13; nothing where random torques act.
pub(in crate::run) fn compare_events(
    plan: &Plan<'_>,
    sample: &[u32],
    records: &mut [EventRecord],
    observer: &mut Observer<'_>,
) -> Result<()> {
    if records.is_empty() || plan.scene().torques().iter().any(Torque::is_random) {
        return Ok(());
    }
    let references = recomputed(plan, sample, observer)?;
    for (record, reference) in records.iter_mut().zip(references) {
        let mut own: Vec<(usize, f64)> =
            record.occurrences.iter().map(|occurrence| (occurrence.body, occurrence.time)).collect();
        own.retain(|(body, _)| sample.binary_search(&(*body as u32)).is_ok());
        own.sort_by_key(|(body, _)| *body);
        let time = |body: usize| own.binary_search_by_key(&body, |(body, _)| *body).ok().map(|place| own[place].1);
        let mut errors: Vec<f64> = reference
            .occurrences
            .iter()
            .filter_map(|occurrence| Some((time(occurrence.body)? - occurrence.time).abs()))
            .collect();
        let compared = errors.len();
        let differing = own.len() + reference.occurrences.len() - 2 * compared;
        record.errors = EventErrors { compared, differing, time: Quantiles::of(&mut errors) };
    }
    Ok(())
}

/// The events of some bodies, as a run of them alone would find them.
fn recomputed(plan: &Plan<'_>, sample: &[u32], observer: &mut Observer<'_>) -> Result<Vec<EventRecord>> {
    let scene = plan.scene();
    let own = |group: &Group| {
        let is_own = |&body: &u32| !group.members.rows(body as usize..body as usize + 1).is_empty();
        let members: Vec<u32> = sample.iter().copied().filter(is_own).collect();
        let treatment = match group.treatment {
            Treatment::RegularPrecession => group.treatment,
            Treatment::ClosedForm { .. } => closed_form(),
            _ if group.class.torques.is_empty() => closed_form(),
            _ => Treatment::Adaptive {
                method: Method::Rk8,
                precision: Precision::F64,
                steps: AdaptiveSteps { tolerance: TOLERANCE, least_step: None },
            },
        };
        Group { members: Members::Some(members), treatment, ..group.clone() }
    };
    let groups: Vec<Group> = plan.groups().iter().map(own).filter(|group| !group.members.is_empty()).collect();
    let quantities = scene.observed().quantities();
    let of_events = scene.wanted_events().iter().map(|event| number(&quantities, event.quantity())).collect();
    let evaluator = Evaluator::new(scene, &quantities)?;
    let mut watch = EventWatch::new(plan, Members::Some(sample.to_vec()), of_events);
    let engine = Cpu::new(Width::Lanes);
    let mut wall_time = WallTime::default();
    let start = |group| GroupRun::start(&engine, scene, group, false, &mut wall_time);
    let mut runs: Vec<GroupRun<'_>> = groups.iter().map(start).collect::<Result<_>>()?;
    // Bodies of groups lie apart, and events are looked for body by body, in the sample's order.
    let place = |body: usize| sample.partition_point(|&other| (other as usize) < body);
    for (index, &time) in std::iter::once(&0.0).chain(plan.times()).enumerate() {
        for (run, group) in runs.iter_mut().zip(&groups) {
            let states = match index {
                0 => initial_states(run, group),
                _ => {
                    run.advance(time, plan.span_before(index - 1), true, observer)?;
                    run.output_states(&|_| None)?
                }
            };
            for (row, state) in states.iter().enumerate() {
                let body = group.members.body(row);
                let rows = place(body)..place(body) + 1;
                let states = std::slice::from_ref(state);
                let values = evaluator.values(body, time, states);
                match index {
                    0 => watch.begin(rows, states, &values),
                    _ => watch.push(rows, time, states, &values),
                }
            }
        }
        watch.finish_output(time, &evaluator, observer)?;
    }
    Ok(watch.finish())
}

fn closed_form() -> Treatment {
    Treatment::ClosedForm { precision: Precision::F64, set_up: SetUp::TwoWords }
}

fn initial_states(run: &GroupRun<'_>, group: &Group) -> Vec<OutputState> {
    let state = |row: usize| {
        let body = group.members.body(row);
        let mut states = [crate::bodies::BodyState::UNKNOWN];
        run.read_initial(&(body..body + 1), &mut states);
        OutputState { rotation: states[0], translation: None }
    };
    (0..group.members.len()).map(state).collect()
}
