//! Bodies under torques, recomputed on the CPU in `f64`, with the work of the torques.
//!
//! The work ∫ τ·ω dt (with that of internal dissipation, ∫ ω·(m × slip) dt, and of changing moments, −½ ∫ ω·(dI/dt) ω
//! dt) and the angular momentum that the torques give, ∫ R τ dt, are integrated by `rk8` as further components of its
//! state: the torque at each of its stages is weighted like its slopes. So they are as accurate as the recomputed
//! motion itself, to order 8, in equal steps as in adaptive ones.

use std::cell::Cell;

use glam::DVec3;

use crate::bodies::Members;
use crate::bodies::columns::{STATE_COMPONENTS, state_columns, status_column};
use crate::bodies::{BodyFrame, BodyState, Status};
use crate::engine::Observer;
use crate::engine::batch::{AnyBatch, Batch, load_body, load_state, prepare_members, store_state};
use crate::engine::controlled::Controls;
use crate::engine::watch::{Watch, watched};
use crate::error::{Error, Result};
use crate::kernel::method::Step;
use crate::kernel::method::rk8::{Rk8, WEIGHTS};
use crate::kernel::method::rk8_adaptive::{Controller, LEAST_STEP, Limits, Timed, Trial, attempt};
use crate::kernel::rigid_body::{Body, Correction};
use crate::kernel::torque_kernel::{Motion, TorqueKernel, VelocityDependence};
use crate::math::Precision;
use crate::math::clock::Clock;
use crate::math::lanes::{LaneScalar, LaneTask};
use crate::math::parallel;
use crate::math::power_of_two::scaled_by_power_of_two;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::two_words;
use crate::math::vector::{TwoWords, Vector};
use crate::plan::rate_of_body;
use crate::plan::{Interval, steps_over};
use crate::scene::{AdaptiveSteps, Scene};
use crate::torque::Torque;
use crate::torque::sum::{Epoch, Source, StepStart, Torques};

/// The work and the angular momentum given by the torques from the start to the end, and the scales by which they are
/// measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Work {
    /// ∫ τ·ω dt, J.
    pub energy: f64,
    /// ∫ R τ dt, N m s, world axes.
    pub angular_momentum_world: DVec3,
    /// The greatest kinetic energy during the motion, J.
    pub greatest_energy: f64,
    /// The greatest |L| during the motion, N m s.
    pub greatest_angular_momentum: f64,
}

/// A recomputed body at the end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Recomputed {
    pub body: usize,
    pub state: BodyState,
    pub work: Work,
}

/// Bodies of one task: few, so that a small sample keeps all cores busy, and a multiple of every lane count.
const BLOCK: usize = 8;

/// Equal steps between two checks whether to continue.
const SLICE: u64 = 1 << 14;

/// Sums of a body: the work and the angular momentum given, with their residues, then the greatest T and |m|².
const SUMS: usize = 10;
const ENERGY: usize = 0;
const ANGULAR_MOMENTUM: usize = 2;
const GREATEST_ENERGY: usize = 8;
const GREATEST_SQUARE: usize = 9;

/// The part of a sample that one task advances.
struct Block {
    state: [[f64; BLOCK]; state_columns::<f64>()],
    sums: [[f64; BLOCK]; SUMS],
    /// The adaptive steps to try next, in the bodies' own units; 0 before the first.
    steps: [f64; BLOCK],
}

/// Bodies that take the same steps, interval by interval from time 0.
#[derive(Clone)]
pub(crate) struct Alike {
    pub members: Vec<u32>,
    pub intervals: Vec<Interval>,
    /// The end of the last interval, s.
    pub end: f64,
}

/// Steps bodies through their intervals by `rk8`.
pub(crate) fn recomputed(
    scene: &Scene,
    torques: &[Torque],
    all: Vec<Alike>,
    observer: &mut Observer<'_>,
) -> Result<Vec<Recomputed>> {
    let steps_of = |alike: &Alike| alike.intervals.iter().map(|interval| interval.steps).fold(0, u64::saturating_add);
    let total =
        all.iter().map(|alike| steps_of(alike).saturating_mul(alike.members.len() as u64)).fold(0, u64::saturating_add);
    // Bodies under sampled torques wait for each other at each change; in single blocks they do not hold up others.
    let of = |alike: Alike| match torques.iter().any(Torque::is_sampled) {
        true => alike.members.chunks(BLOCK).map(|some| Alike { members: some.to_vec(), ..alike.clone() }).collect(),
        false => vec![alike],
    };
    let started = all.into_iter().flat_map(of).map(|alike| Started::of(scene, torques, alike));
    let mut started = started.collect::<Result<Vec<_>>>()?;
    // Together, as each of them alone may be too little work for all cores.
    let work = |watch: &Watch| parallel::for_each_task(&mut started, |_, started| started.advance(watch));
    watched(work, total, observer).map_err(|steps| Error::Interrupted { steps })?;
    Ok(started.iter().flat_map(|started| started.finished(torques)).collect())
}

/// Steps bodies by adaptive `rk8`, each to its own end (s), the second of a pair; steps end at all of `times` (s), the last of which no end
/// exceeds. No torque is random or sampled.
pub(crate) fn recomputed_adaptively(
    scene: &Scene,
    torques: &[Torque],
    (mut members, times): (Vec<(u32, f64)>, &[f64]),
    steps: AdaptiveSteps,
    observer: &mut Observer<'_>,
) -> Result<Vec<Recomputed>> {
    // Bodies that need about as many steps side by side; the result of a body does not depend on its neighbours.
    let work = |&(body, end): &(u32, f64)| rate_of_body(scene, torques, body as usize).0 * end;
    members.sort_by_cached_key(|member| (work(member).to_bits(), member.0));
    let bodies = Members::Some(members.iter().map(|member| member.0).collect());
    let (frames, batch) = prepare_members(scene.ensemble(), torques, scene.end(), &bodies, Precision::F64)?;
    let AnyBatch::F64(batch) = batch else { unreachable!("columns in f64 were asked for") };
    let mut blocks: Vec<Block> = (0..batch.body_count).step_by(BLOCK).map(|first| Block::of(&batch, first)).collect();
    let work = |watch: &Watch| {
        parallel::for_each_task(blocks.iter_mut().zip(members.chunks(BLOCK)), |index, (block, members)| {
            let mut ends = [0.0; BLOCK];
            ends.iter_mut().zip(members).for_each(|(end, member)| *end = member.1);
            let (mut clock, mut begin) = (batch.torques.clock(), 0.0);
            for &time in times {
                let spans = &ends.map(|end| (end.min(time) - begin).max(0.0));
                let first = index * BLOCK;
                f64::dispatch(AdaptBlock { batch: &batch, first, block: &mut *block, clock, spans, steps, watch });
                (clock, begin) = (clock.at(time), time);
            }
            watch.add(members.len() as u64);
        });
    };
    watched(work, members.len() as u64, observer).map_err(|_| Error::Interrupted { steps: 0 })?;
    let finished = |(row, &(body, end)): (usize, &(u32, f64))| {
        let (block, lane) = (&blocks[row / BLOCK], row % BLOCK);
        let found = block.finished(lane, &frames[row].at(torques, body as usize, end), body as usize);
        let status = Status::from_code(block.state[status_column::<f64>()][lane]);
        Recomputed { state: BodyState { status, ..found.state }, ..found }
    };
    Ok(members.iter().enumerate().map(finished).collect())
}

/// Bodies that take the same steps, while they are stepped.
struct Started {
    members: Members,
    intervals: Vec<Interval>,
    end: f64,
    frames: Vec<BodyFrame>,
    batch: Batch<f64>,
    blocks: Vec<Block>,
    controls: Option<Controls>,
}

impl Started {
    fn of(scene: &Scene, torques: &[Torque], Alike { members, intervals, end }: Alike) -> Result<Self> {
        let members = Members::Some(members);
        let (frames, mut batch) = prepare_members(scene.ensemble(), torques, scene.end(), &members, Precision::F64)?;
        let controls = Controls::start(torques, &mut batch, &frames, |row| members.body(row));
        let AnyBatch::F64(batch) = batch else { unreachable!("columns in f64 were asked for") };
        let blocks = (0..batch.body_count).step_by(BLOCK).map(|first| Block::of(&batch, first)).collect();
        Ok(Self { members, intervals, end, frames, batch, blocks, controls })
    }

    /// Brings its bodies to the end, unless the watch stops it.
    fn advance(&mut self, watch: &Watch) {
        if let Some(controls) = self.controls.take() {
            return self.advance_through(controls, watch);
        }
        let Self { intervals, batch, blocks, .. } = self;
        parallel::for_each_task(blocks, |index, block| {
            let first = index * BLOCK;
            let mut clock = batch.torques.clock();
            for &Interval { dt, steps } in &*intervals {
                for first_step in (0..steps).step_by(SLICE as usize) {
                    if !watch.goes_on() {
                        return;
                    }
                    let slice = SLICE.min(steps - first_step);
                    let block = &mut *block;
                    f64::dispatch(RecomputeBlock { batch, first, block, clock, dt, first_step, steps: slice });
                    watch.add(slice * BLOCK.min(batch.body_count - first) as u64);
                }
                clock = clock.after(dt, steps);
            }
        });
    }

    /// The same under sampled torques: a step ends at each change of their values.
    fn advance_through(&mut self, mut controls: Controls, watch: &Watch) {
        let Self { intervals, batch, blocks, end, .. } = self;
        let (mut clock, mut time) = (batch.torques.clock(), 0.0);
        let last = intervals.len();
        for (index, &Interval { dt, steps }) in intervals.iter().enumerate() {
            let target = if index + 1 == last { *end } else { time + dt * steps as f64 };
            while time < target {
                let next = controls.schedule().part(time, target);
                let part = steps_over(next - time, dt);
                for first_step in (0..part.steps).step_by(SLICE as usize) {
                    if !watch.goes_on() {
                        return;
                    }
                    let steps = SLICE.min(part.steps - first_step);
                    for (index, block) in blocks.iter_mut().enumerate() {
                        let first = index * BLOCK;
                        f64::dispatch(RecomputeBlock { batch, first, block, clock, dt: part.dt, first_step, steps });
                        watch.add(steps * BLOCK.min(batch.body_count - first) as u64);
                    }
                }
                clock = clock.after(part.dt, part.steps);
                time = next;
                if controls.schedule().changes_at(time) {
                    let blocks = &*blocks;
                    let written = controls.change(time, &|frame, row| {
                        let lane = |component: usize| blocks[row / BLOCK].state[component][row % BLOCK];
                        frame.body_state(std::array::from_fn(lane))
                    });
                    written.iter().for_each(|written| batch.write_parameters(written));
                }
            }
        }
    }

    fn finished(&self, torques: &[Torque]) -> impl Iterator<Item = Recomputed> {
        (0..self.batch.body_count).map(move |row| {
            let body = self.members.body(row);
            self.blocks[row / BLOCK].finished(row % BLOCK, &self.frames[row].at(torques, body, self.end), body)
        })
    }
}

impl Block {
    fn of(batch: &Batch<f64>, first: usize) -> Self {
        let column = |column: usize| {
            let start = column * batch.stride + first;
            std::array::from_fn(|lane| batch.state[start + lane])
        };
        Self { state: std::array::from_fn(column), sums: [[0.0; BLOCK]; SUMS], steps: [0.0; BLOCK] }
    }

    /// The body in one lane in SI units.
    fn finished(&self, lane: usize, frame: &BodyFrame, body: usize) -> Recomputed {
        let sum = |index: usize| self.sums[index][lane] + self.sums[index + 1][lane];
        let (energy_exponent, momentum_exponent) =
            (frame.moment_exponent + 2 * frame.rate_exponent, frame.moment_exponent + frame.rate_exponent);
        let energy = |x: f64| scaled_by_power_of_two(x, energy_exponent);
        let momentum = |x: f64| scaled_by_power_of_two(x, momentum_exponent);
        let given = [0, 2, 4].map(|axis| momentum(sum(ANGULAR_MOMENTUM + axis)));
        let scaled: [f64; STATE_COMPONENTS] = std::array::from_fn(|component| self.state[component][lane]);
        let state = frame.body_state(scaled);
        Recomputed {
            body,
            state,
            work: Work {
                energy: energy(sum(ENERGY)),
                angular_momentum_world: DVec3::from_array(given),
                greatest_energy: energy(self.sums[GREATEST_ENERGY][lane]).max(state.kinetic_energy),
                greatest_angular_momentum: momentum(self.sums[GREATEST_SQUARE][lane].sqrt())
                    .max(state.angular_momentum_world.length()),
            },
        }
    }
}

/// Advances one block, lane group by lane group.
struct RecomputeBlock<'a> {
    batch: &'a Batch<f64>,
    /// First body of the block.
    first: usize,
    block: &'a mut Block,
    /// The clock at step 0 of the interval.
    clock: Clock,
    dt: f64,
    first_step: u64,
    steps: u64,
}

impl LaneTask<f64> for RecomputeBlock<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real<Scalar = f64>>(self) {
        let Batch { parameters, stride, torques, .. } = self.batch;
        let source = Source { table: torques, parameters, stride: *stride, clock: self.clock, dt: self.dt };
        let workspace = source.workspace();
        let bodies = BLOCK.min(self.batch.body_count - self.first);
        for offset in (0..bodies).step_by(R::LANES) {
            let columns = source.group(self.first + offset, &workspace);
            let (body, rate) = load_body(|column| columns.column(column));
            let given = Given::new();
            let acting = Torques::<R>::new(columns);
            let recorded = Recorded { acting, given: &given };
            let words = two_words::<f64>(self.dt);
            let dt = TwoWords { value: R::splat(words.value) * rate, residue: R::splat(0.0) };
            let mut state = load_state(|column| R::load(&self.block.state[column][offset..]));
            let mut sums: [R; SUMS] = std::array::from_fn(|index| R::load(&self.block.sums[index][offset..]));
            for step in 0..self.steps {
                let m = state.angular_momentum_principal.value;
                sums[GREATEST_SQUARE] = sums[GREATEST_SQUARE].max(m.dot(m));
                state = Rk8::step(&body, &(), &recorded, self.first_step + step, dt, state);
                sums[GREATEST_ENERGY] = sums[GREATEST_ENERGY].max(given.energy.get());
                let (power, torque) = given.taken();
                for (index, rate) in [power, torque.x, torque.y, torque.z].into_iter().enumerate() {
                    add(&mut sums, 2 * index, rate * dt.value);
                }
            }
            store_state(&state, |column, number: R| number.store(&mut self.block.state[column][offset..]));
            for (index, sum) in sums.into_iter().enumerate() {
                sum.store(&mut self.block.sums[index][offset..]);
            }
        }
    }
}

/// Advances one block through an interval, lane group by lane group.
struct AdaptBlock<'a> {
    batch: &'a Batch<f64>,
    /// First body of the block.
    first: usize,
    block: &'a mut Block,
    /// The clock at the start of the interval, and the part of it over which each body is followed, s.
    clock: Clock,
    spans: &'a [f64; BLOCK],
    steps: AdaptiveSteps,
    watch: &'a Watch,
}

impl LaneTask<f64> for AdaptBlock<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real<Scalar = f64>>(self) {
        let Batch { parameters, stride, torques, .. } = self.batch;
        let source = Source { table: torques, parameters, stride: *stride, clock: self.clock, dt: 0.0 };
        let workspace = source.workspace();
        let bodies = BLOCK.min(self.batch.body_count - self.first);
        let zero = R::splat(0.0);
        for offset in (0..bodies).step_by(R::LANES) {
            let columns = source.group(self.first + offset, &workspace);
            let (body, rate) = load_body(|column| columns.column(column));
            let given = Given::new();
            let recorded = Recorded { acting: Torques::<R>::new(columns), given: &given };
            let limits = Limits { tolerance: R::splat(self.steps.tolerance), least_step: R::splat(LEAST_STEP) };
            // Rows without a body have the rate 0, so that nothing is left to do in them.
            let span = TwoWords { value: R::load(&self.spans[offset..]) * rate, residue: zero };
            let mut controller =
                Controller { step: R::load(&self.block.steps[offset..]), ..Controller::new() }.over(span);
            let mut state = load_state(|column| R::load(&self.block.state[column][offset..]));
            let mut sums: [R; SUMS] = std::array::from_fn(|index| R::load(&self.block.sums[index][offset..]));
            while R::any(controller.under_way(&state)) && self.watch.goes_on() {
                let m = state.angular_momentum_principal.value;
                sums[GREATEST_SQUARE] = sums[GREATEST_SQUARE].max(m.dot(m));
                let h = Trial::new(&body, span, &limits, &controller, &state).h.value;
                let accepted = controller.accepted;
                (state, controller) = attempt(&body, &recorded, span, &limits, controller, state);
                let is_taken = accepted.less_than(controller.accepted);
                sums[GREATEST_ENERGY] = sums[GREATEST_ENERGY].max(given.energy.get());
                let (power, torque) = given.taken();
                for (index, rate) in [power, torque.x, torque.y, torque.z].into_iter().enumerate() {
                    add(&mut sums, 2 * index, R::select(is_taken, rate * h, zero));
                }
            }
            controller.step.store(&mut self.block.steps[offset..]);
            store_state(&state, |column, number: R| number.store(&mut self.block.state[column][offset..]));
            for (index, sum) in sums.into_iter().enumerate() {
                sum.store(&mut self.block.sums[index][offset..]);
            }
        }
    }
}

/// Kahan's sum at `index`, with its residue at the next index: over 1e7 steps a plain sum would lose four digits.
#[inline(always)]
fn add<R: Real>(sums: &mut [R; SUMS], index: usize, increment: R) {
    let corrected = increment + sums[index + 1];
    let sum = sums[index] + corrected;
    sums[index + 1] = corrected - (sum - sums[index]);
    sums[index] = sum;
}

/// Sums up the work and the angular momentum of the torques in a step, stage by stage of `rk8`.
struct Given<R> {
    stage: Cell<usize>,
    angular_velocity: Cell<Vector<R>>,
    inner_power: Cell<R>,
    power: Cell<R>,
    /// T at the start of the step.
    energy: Cell<R>,
    torque_world: Cell<Vector<R>>,
}

impl<R: Real> Given<R> {
    #[inline(always)]
    fn new() -> Self {
        let zero = R::splat(0.0);
        Self {
            stage: Cell::new(0),
            angular_velocity: Cell::new(Vector::zero()),
            inner_power: Cell::new(zero),
            power: Cell::new(zero),
            energy: Cell::new(zero),
            torque_world: Cell::new(Vector::zero()),
        }
    }

    /// Returns the weighted sums over a step's stages and resets them.
    #[inline(always)]
    fn taken(&self) -> (R, Vector<R>) {
        self.stage.set(0);
        (self.power.replace(R::splat(0.0)), self.torque_world.replace(Vector::zero()))
    }
}

/// Torques that record their power and their value in world axes at each evaluation.
#[derive(Clone, Copy)]
struct Recorded<'a, R: Real> {
    acting: Torques<'a, R>,
    given: &'a Given<R>,
}

impl<'a, R: Real> TorqueKernel<R> for Recorded<'a, R> {
    type Start = StepStart<'a, R>;
    type Epoch = Epoch<'a, R>;
    const FREE: bool = false;

    #[inline(always)]
    fn start(&self, step: u64) -> StepStart<'a, R> {
        self.acting.start(step)
    }

    #[inline(always)]
    fn epoch(&self, start: &StepStart<'a, R>, fraction: f64) -> Epoch<'a, R> {
        self.acting.epoch(start, fraction)
    }

    #[inline(always)]
    fn torque(&self, epoch: &Epoch<'a, R>, body: &Body<R>, q: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        let torque = self.acting.torque(epoch, body, q, omega);
        let given = self.given;
        let weight = R::splat(WEIGHTS[given.stage.get()]);
        given.stage.set(given.stage.get() + 1);
        let power = torque.dot(given.angular_velocity.get()) + given.inner_power.get();
        given.power.set(power.mul_add(weight, given.power.get()));
        given.torque_world.set(q.rotate(torque).axpy(weight, given.torque_world.get()));
        torque
    }

    #[inline(always)]
    fn velocity_dependence(&self) -> VelocityDependence {
        self.acting.velocity_dependence()
    }

    /// Called before [`TorqueKernel::torque`] at every stage; records ω = I⁻¹ m and the power of processes inside the
    /// body.
    #[inline(always)]
    fn motion(&self, epoch: &Epoch<'a, R>, body: &Body<R>, correction: &Correction<R>, m: Vector<R>) -> Motion<R> {
        let motion = self.acting.motion_at(epoch, body, correction, m);
        let omega = motion.angular_velocity;
        self.given.angular_velocity.set(omega);
        if self.given.stage.get() == 0 {
            self.given.energy.set(R::splat(0.5) * m.dot(omega));
        }
        let slip_power = omega.dot(m.cross(motion.axes_rate - omega));
        self.given.inner_power.set(slip_power + self.acting.change_power(epoch, body, omega));
        motion
    }
}

impl<'a, R: Real> Timed<R> for Recorded<'a, R> {
    #[inline(always)]
    fn start_at(&self, time: TwoWords<R>) -> StepStart<'a, R> {
        self.acting.start_at(time)
    }

    #[inline(always)]
    fn epoch_after(&self, start: &StepStart<'a, R>, elapsed: R) -> Epoch<'a, R> {
        self.acting.epoch_after(start, elapsed)
    }
}
