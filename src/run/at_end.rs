//! What the end of a run shows: drift, balance, and bodies that turn too far in a step.

use super::balance::total_energy_change;
use super::group_run::GroupRun;
use crate::bodies::{BodyState, Status};
use crate::error::Result;
use crate::math::parallel;
use crate::plan::{ActingTorques, Plan};
use crate::record::{BalanceGatherer, BodyDrift, Conserved, DriftGatherer, OutputState};
use crate::scene::{Scene, Stepping};
use crate::torque::Torque;

/// What the end of a run shows.
#[derive(Default)]
pub(super) struct AtEnd {
    pub drift: DriftGatherer,
    pub balance: BalanceGatherer,
    /// Bodies that turn too far in a given step.
    pub outside_usable_region: usize,
}

impl AtEnd {
    /// Compares the end with the start, body by body from `first_body` on; bodies that have failed are left out.
    pub fn gather(
        &mut self,
        (scene, acting, usable_rate): (&Scene, &ActingTorques<'_>, f64),
        first_body: usize,
        initial: &[BodyState],
        states: &[OutputState],
    ) {
        let too_fast = |state: &BodyState| state.angular_velocity_body.length() > usable_rate;
        let compared = |(task, (initial, states)): (usize, (&[BodyState], &[OutputState]))| {
            let mut found = Self::default();
            found.drift.begin_part(states.len());
            for (row, (initial, state)) in initial.iter().zip(states).enumerate() {
                let (body, state) = (first_body + task * COMPARED + row, &state.rotation);
                found.conserved(state.is_sound().then(|| Kept::of((scene, acting), body, initial, state)));
                found.outside_usable_region += usize::from(too_fast(initial) || too_fast(state));
            }
            found
        };
        let tasks = initial.chunks(COMPARED).zip(states.chunks(COMPARED));
        let found = parallel::map_tasks(tasks, |task, of_task| compared((task, of_task)));
        found.into_iter().for_each(|found| self.append(found));
    }

    /// Adds the results of further bodies.
    fn append(&mut self, found: Self) {
        self.drift.append(found.drift);
        self.balance.append(found.balance);
        self.outside_usable_region += found.outside_usable_region;
    }

    /// The same if states are not read: drift and balance of a sample, whose states it returns, and the rest from marks
    /// set where the states are. `failed` is called with each body that has failed and the reason.
    pub fn gather_sample(
        &mut self,
        (scene, acting, usable_rate): (&Scene, &ActingTorques<'_>, f64),
        group_runs: &mut [GroupRun<'_>],
        sample: &[u32],
        failed: &mut dyn FnMut(usize, Status),
    ) -> Result<Vec<BodyState>> {
        let mut states = Vec::with_capacity(sample.len());
        let mut faster = Vec::new();
        for group_run in &mut *group_runs {
            states.extend(group_run.read_bodies(sample)?);
            let marked = group_run.marked(usable_rate)?;
            group_run.reasons(marked.failed)?.into_iter().for_each(|(body, reason)| failed(body, reason));
            faster.extend(marked.faster);
        }
        faster.sort_unstable();
        if usable_rate.is_finite() {
            let start = |&body: &usize| scene.ensemble().angular_velocity_body()[body].length() > usable_rate;
            let at_start = (0..scene.ensemble().len()).filter(start);
            self.outside_usable_region =
                faster.len() + at_start.filter(|body| faster.binary_search(body).is_err()).count();
        }
        states.sort_unstable_by_key(|&(body, _)| body);
        for (body, state) in &states {
            let mut initial = [BodyState::UNKNOWN];
            group_runs.iter().for_each(|group_run| group_run.read_initial(&(*body..body + 1), &mut initial));
            self.conserved(state.is_sound().then(|| Kept::of((scene, acting), *body, &initial[0], state)));
        }
        Ok(states.into_iter().map(|(_, state)| state).collect())
    }

    /// Adds how well a body kept its conserved quantities.
    fn conserved(&mut self, kept: Option<Kept>) {
        let Some(kept) = kept else { return };
        self.drift.push(kept.drift);
        if let Some(total_energy) = kept.total_energy {
            self.balance.push_total(total_energy);
        }
    }
}

/// Bodies that one task compares.
const COMPARED: usize = 1 << 10;

/// How well a body kept its conserved quantities.
struct Kept {
    drift: BodyDrift,
    /// The change of its total energy, if all torques on it have a potential.
    total_energy: Option<f64>,
}

impl Kept {
    /// Compares two states of a body, both finite.
    fn of((scene, acting): (&Scene, &ActingTorques<'_>), body: usize, initial: &BodyState, state: &BodyState) -> Self {
        let torques = scene.torques();
        let acting = acting.on(body);
        let from_outside =
            |(index, torque): (usize, &Torque)| acting.contains(index) && !torque.keeps_angular_momentum();
        let conserved = Conserved {
            kinetic_energy: acting.is_empty(),
            angular_momentum: !torques.iter().enumerate().any(from_outside),
        };
        Self {
            drift: BodyDrift::between(initial, state, conserved),
            total_energy: total_energy_change(scene, acting, body, initial, state),
        }
    }
}

/// The spin rate, rad/s, above which a body is outside the usable region of the pinned method in the longest step that is taken.
pub(super) fn usable_rate(plan: &Plan<'_>) -> f64 {
    match plan.scene().stepping() {
        Stepping::Pinned { method, .. } => method.properties().usable_angle / plan.longest_equal_step(),
        Stepping::Accuracy(_) | Stepping::Statistics(_) | Stepping::Adaptive { .. } => f64::INFINITY,
    }
}
