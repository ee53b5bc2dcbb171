//! Centres of mass of a sample, recomputed more accurately.
//!
//! If positions have a closed form, it is used. Otherwise they are stepped like the run's
//! ([`crate::torque::force::stepped`]), in shorter steps: along the closed form of a torque-free rotation, or along a
//! rotation that is recomputed by `rk8` in `f64` on the CPU. If they are part of the motion itself, they are recomputed
//! with it, by finer series.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::bodies::Members;
use crate::engine::Observer;
use crate::engine::cpu::Cpu;
use crate::error::Result;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::math::Width;
use crate::plan::{Group, Plan, TorqueSet, Treatment};
use crate::record::WallTime;
use crate::run::group_run::GroupRun;
use crate::run::recomputed_sample::finer_series;
use crate::run::stepped_translation::SteppedTranslation;
use crate::torque::Torque;
use crate::torque::force::{Force, accelerations, closed_form};

/// The factor by which steps of centres of mass are shorter than the run's: their error, of order 4, is then an eightieth of the run's.
pub(super) const FINER: f64 = 3.0;

/// Position (m) and velocity (m/s), world axes, of a sample's bodies at the end, or at the times (s) in `stops` for
/// those that were stopped; empty if bodies do not translate.
pub(super) fn recomputed_centres(
    plan: &Plan<'_>,
    sample: &[u32],
    stops: &BTreeMap<u32, f64>,
    observer: &mut Observer<'_>,
) -> Result<BTreeMap<usize, (DVec3, DVec3)>> {
    let scene = plan.scene();
    let Some(translation) = scene.ensemble().translation() else { return Ok(BTreeMap::new()) };
    if scene.forces().iter().all(Force::has_closed_form) {
        let at_end = |&body: &u32| {
            let end = stops.get(&body).copied().unwrap_or(scene.end());
            let body = body as usize;
            let forces = accelerations(scene.forces(), body, translation.mass[body]);
            (body, closed_form(&forces, translation.position[body], translation.velocity[body], end))
        };
        return Ok(sample.iter().map(at_end).collect());
    }
    let turns = scene.forces().iter().any(Force::needs_attitude);
    let mut found = BTreeMap::new();
    for group in plan.groups() {
        let members =
            sample.iter().copied().filter(|&body| !group.members.rows(body as usize..body as usize + 1).is_empty());
        if scene.coupling().is_some() {
            found.extend(with_rotation(plan, group, members.collect(), observer)?);
            continue;
        }
        let is_driven = |body: &u32| turns && !TorqueSet::acting_on(scene.torques(), *body as usize).is_empty();
        let (driven, free): (Vec<u32>, Vec<u32>) = members.partition(is_driven);
        found.extend(alone(plan, free, observer)?);
        found.extend(along_rotation(plan, group, driven, observer)?);
    }
    Ok(found)
}

/// Bodies whose rotation does not matter or has a closed form.
fn alone(plan: &Plan<'_>, bodies: Vec<u32>, observer: &mut Observer<'_>) -> Result<Vec<(usize, (DVec3, DVec3))>> {
    let (scene, members) = (plan.scene(), Members::Some(bodies));
    let Some(stepped_translation) = SteppedTranslation::start(scene, &members, false)? else { return Ok(Vec::new()) };
    let mut stepped_translation = stepped_translation.in_steps_shorter_by(FINER);
    stepped_translation.advance(0.0, scene.end(), observer)?;
    Ok(stepped_translation.centres().collect())
}

/// Bodies of one of the plan's groups whose rotation depends on their centres of mass.
fn with_rotation(
    plan: &Plan<'_>,
    group: &Group,
    bodies: Vec<u32>,
    observer: &mut Observer<'_>,
) -> Result<Vec<(usize, (DVec3, DVec3))>> {
    let Treatment::Adaptive { steps, .. } = group.treatment else { return Ok(Vec::new()) };
    if bodies.is_empty() {
        return Ok(Vec::new());
    }
    let (treatment, times) = finer_series(plan, &steps);
    let group = Group { members: Members::Some(bodies), treatment, ..group.clone() };
    let mut group_run =
        GroupRun::start(&Cpu::new(Width::Lanes), plan.scene(), &group, false, &mut WallTime::default())?;
    let mut last = 0.0;
    for time in times {
        group_run.advance(time, time - std::mem::replace(&mut last, time), false, observer)?;
    }
    let states = group_run.output_states(&|_| None)?;
    let centres = states.into_iter().enumerate();
    Ok(centres.filter_map(|(row, state)| Some((group.members.body(row), state.translation?))).collect())
}

/// Bodies of one of the plan's groups under a thrust that turns with them.
fn along_rotation(
    plan: &Plan<'_>,
    group: &Group,
    bodies: Vec<u32>,
    observer: &mut Observer<'_>,
) -> Result<Vec<(usize, (DVec3, DVec3))>> {
    let Treatment::Stepped { longest_step, .. } = group.treatment else { return Ok(Vec::new()) };
    let scene = plan.scene();
    // A random torque is drawn for the run's own steps.
    let finer = if scene.torques().iter().any(Torque::is_random) { 1.0 } else { FINER };
    let treatment = Treatment::Stepped {
        method: Method::Rk8,
        precision: Precision::F64,
        longest_step: longest_step / finer,
        projected: false,
    };
    let group = Group { members: Members::Some(bodies), treatment, ..group.clone() };
    if group.members.is_empty() {
        return Ok(Vec::new());
    }
    let mut group_run = GroupRun::start(&Cpu::new(Width::Lanes), scene, &group, false, &mut WallTime::default())?;
    for (index, &time) in plan.advance_times().iter().enumerate() {
        group_run.advance(time, plan.span_before(index), false, observer)?;
    }
    Ok(group_run.own_centres())
}
