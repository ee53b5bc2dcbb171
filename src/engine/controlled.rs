//! Bodies under sampled torques: sessions that stop at each change, have the host form the new values, and continue.
//!
//! The values of a law are formed here in `f64`, in lanes, whichever engine steps the bodies, and are written into the
//! torque's columns of parameters ([`super::Session::write_parameters`]). On a GPU the states are read at each change
//! and the columns are written back.

mod sessions;

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;

use super::batch::AnyBatch;
use crate::bodies::columns::StateWords;
use crate::bodies::{BodyFrame, BodyState};
use crate::error::Result;
use crate::expression::{Input, InputKind, Program};
use crate::math::parallel;
use crate::torque::control::{Control, Schedule};
use crate::torque::{Expressed, Kind, Torque, host_numbers, numbers_of_body, tensor_of, user_number};

/// Rows for which one task forms the values.
const PIECE: usize = 512;
/// With fewer rows than this, the calling thread forms all of them.
const FEW: usize = 128;

/// The values that sampled torques hold for some bodies, one in each row.
#[derive(Clone)]
pub struct Controls {
    laws: Vec<Law>,
    schedule: Schedule,
    rows: Rows,
    /// The time of the last change, s.
    time: f64,
}

/// The constants of the rows.
#[derive(Clone)]
struct Rows {
    torques: Vec<Torque>,
    varies: bool,
    frames: Vec<BodyFrame>,
    bodies: Vec<u32>,
}

/// One torque of a batch.
#[derive(Clone)]
struct Law {
    torque: Torque,
    expressed: Arc<Expressed>,
    /// The instance's first column.
    first_column: usize,
    /// The numbers of the host that its columns are formed from and that do not change: the index and the values of
    /// each.
    fixed: Vec<(usize, Vec<f64>)>,
    /// The numbers of the parameters, shape `[numbers][rows]`.
    numbers: Vec<Vec<f64>>,
    /// Values that were sampled and are not yet in effect, the oldest first, shape `[values][rows]`.
    pending: VecDeque<Vec<Vec<f64>>>,
    /// The last sample and the last effect.
    sampled: Option<u64>,
    effected: Option<u64>,
}

/// Columns of parameters that have changed, of some rows.
pub struct Written {
    /// The first of the columns.
    pub first_column: usize,
    /// The first of the rows.
    pub first_row: usize,
    /// Numbers, shape `[columns][rows]`.
    pub columns: Vec<Vec<f64>>,
}

impl Law {
    fn control(&self) -> &Control {
        self.torque.control().expect("a law is of a sampled torque")
    }
}

impl Controls {
    /// Forms the first values for the bodies of a batch under these torques and writes them into its columns; `None` if
    /// no torque is sampled. `body` gives the body of a row.
    pub(crate) fn start(
        torques: &[Torque],
        batch: &mut AnyBatch,
        frames: &[BodyFrame],
        body: impl Fn(usize) -> usize,
    ) -> Option<Self> {
        let schedule = Schedule::of(torques)?;
        let bodies: Vec<u32> = (0..batch.body_count()).map(|row| body(row) as u32).collect();
        let rows = Rows {
            varies: torques.iter().any(Torque::changes_inertia),
            torques: torques.to_vec(),
            frames: frames.to_vec(),
            bodies,
        };
        let formulas = torques.iter().filter(|torque| torque.kind() == Kind::Custom).enumerate();
        let laws = formulas.filter(|(_, torque)| torque.is_sampled()).map(|(index, torque)| {
            let table = batch.torques();
            let expressed = Arc::clone(&table.expressions()[index]);
            let instance = table.list().iter().find(|own| own.kind == Kind::Custom && own.index == index);
            Law::new(torque, expressed, instance.map_or(0, |instance| instance.first), &rows)
        });
        let laws: Vec<Law> = laws.collect();
        let mut controls = Self { laws, schedule, rows, time: 0.0 };
        let words = batch.states();
        let written = controls.change(0.0, &|frame, row| frame.state_of(&words, row));
        written.iter().for_each(|written| batch.write_parameters(written));
        Some(controls)
    }

    /// The first change after the last one.
    pub(crate) fn next_change(&self) -> f64 {
        self.schedule.next_after(self.time)
    }

    /// When it changes.
    pub(crate) fn schedule(&self) -> &Schedule {
        &self.schedule
    }

    /// Samples the values that are sampled at `time`, s, puts into effect those that take effect then, and returns the
    /// columns that have changed. `state` gives the state of a row's body at that time from its frame.
    pub(crate) fn change(
        &mut self,
        time: f64,
        state: &(dyn Fn(&BodyFrame, usize) -> BodyState + Sync),
    ) -> Vec<Written> {
        self.time = time;
        let rows = &self.rows;
        let mut all = Vec::new();
        for law in &mut self.laws {
            let sampling = law.control().sampling();
            let new = |now: Option<u64>, last: Option<u64>| now.filter(|now| last.is_none_or(|last| *now > last));
            let (sample, effect) =
                (new(sampling.sample_at(time), law.sampled), new(sampling.effect_at(time), law.effected));
            (law.sampled, law.effected) = (sample.or(law.sampled), effect.or(law.effected));
            if sample.is_none() && effect.is_none() {
                continue;
            }
            let due = Due { sample: sample.is_some(), effect: effect.is_some(), delayed: sampling.delay > 0.0, time };
            let count = rows.bodies.len();
            let pieces = (0..count).step_by(PIECE).map(|start| start..count.min(start + PIECE));
            let form = |range: Range<usize>| law.formed(due, rows, range, state);
            let formed: Vec<Formed> = match count {
                ..=FEW => pieces.map(form).collect(),
                _ => parallel::map_tasks(pieces, |_, range| form(range)),
            };
            if due.effect {
                law.pending.pop_front();
            }
            if due.sample && due.delayed {
                let values = law.control().samples.program.output_count();
                law.pending.push_back(vec![vec![0.0; count]; values]);
            }
            let mut columns: Vec<Vec<f64>> = Vec::new();
            for formed in formed {
                let put = |all: &mut [Vec<f64>], some: &[Vec<f64>]| {
                    let pairs = all.iter_mut().zip(some);
                    pairs.for_each(|(own, numbers)| own[formed.range.clone()].copy_from_slice(numbers));
                };
                put(&mut law.numbers, &formed.numbers);
                if let (Some(pending), Some(last)) = (&formed.pending, law.pending.back_mut()) {
                    put(last, pending);
                }
                columns.resize_with(formed.columns.len(), || vec![0.0; count]);
                put(&mut columns, &formed.columns);
            }
            all.push(Written { first_column: law.first_column, first_row: 0, columns });
        }
        all
    }

    /// The changes when bodies reach `time`, s; `states` gives their states if anything changes.
    fn come_to(&mut self, time: f64, states: impl FnOnce() -> Result<StateWords>) -> Result<Vec<Written>> {
        if !self.schedule.changes_at(time) {
            return Ok(Vec::new());
        }
        let words = states()?;
        Ok(self.change(time, &|frame, row| frame.state_of(&words, row)))
    }

    /// Keeps only some rows, ascending, which are then counted from 0.
    pub(crate) fn keep(&mut self, kept: &[usize]) {
        let of = |column: &mut Vec<f64>| *column = kept.iter().map(|&row| column[row]).collect();
        for law in &mut self.laws {
            law.numbers.iter_mut().for_each(of);
            law.fixed.iter_mut().for_each(|(_, column)| of(column));
            law.pending.iter_mut().flatten().for_each(of);
        }
        self.rows.frames = kept.iter().map(|&row| self.rows.frames[row]).collect();
        self.rows.bodies = kept.iter().map(|&row| self.rows.bodies[row]).collect();
    }

    /// The controls of one row alone.
    pub(crate) fn of_row(&self, row: usize) -> Self {
        let of = |column: &Vec<f64>| vec![column[row]];
        let law = |law: &Law| Law {
            fixed: law.fixed.iter().map(|(number, column)| (*number, of(column))).collect(),
            numbers: law.numbers.iter().map(of).collect(),
            pending: law.pending.iter().map(|values| values.iter().map(of).collect()).collect(),
            ..law.without_rows()
        };
        let rows = Rows {
            torques: self.rows.torques.clone(),
            varies: self.rows.varies,
            frames: vec![self.rows.frames[row]],
            bodies: vec![self.rows.bodies[row]],
        };
        Self { laws: self.laws.iter().map(law).collect(), schedule: self.schedule.clone(), rows, time: self.time }
    }

    /// The row of a body.
    pub(crate) fn row_of(&self, body: usize) -> Option<usize> {
        match self.rows.bodies.binary_search(&(body as u32)) {
            Ok(row) => Some(row),
            // The bodies may be in another order.
            Err(_) => self.rows.bodies.iter().position(|&own| own as usize == body),
        }
    }

    /// Takes the values that are held elsewhere for the same bodies under the same torques, whose columns may be
    /// arranged differently there.
    pub(crate) fn adopt(&mut self, other: Self) {
        self.time = other.time;
        for (law, other) in self.laws.iter_mut().zip(other.laws) {
            (law.numbers, law.pending) = (other.numbers, other.pending);
            (law.sampled, law.effected) = (other.sampled, other.effected);
        }
    }

    /// The present columns of all laws, for a session that has those of another time.
    pub(crate) fn columns(&self) -> Vec<Written> {
        let count = self.rows.bodies.len();
        let of_law = |law: &Law| Written {
            first_column: law.first_column,
            first_row: 0,
            columns: law.columns(&law.numbers, 0..count),
        };
        self.laws.iter().map(of_law).collect()
    }

    /// Passes the numbers of each torque's own state at `time`, s, not before the last change, to `take`: the torque's
    /// place among the sampled ones, the number's place in that state, the body, and the number.
    pub(crate) fn own_state(&self, time: f64, take: &mut dyn FnMut((usize, usize), usize, f64)) {
        for (place, law) in self.laws.iter().enumerate() {
            let mut numbers = law.numbers.clone();
            advance_states(law.control(), &mut numbers, time);
            let own = law.control().states.iter().flat_map(|(_, own)| own.clone());
            for (index, number) in own.enumerate() {
                let rows = numbers[number].iter().zip(&self.rows.bodies);
                rows.for_each(|(&value, &body)| take((place, index), body as usize, value));
            }
        }
    }
}

impl Law {
    fn new(torque: &Torque, expressed: Arc<Expressed>, first_column: usize, rows: &Rows) -> Self {
        let fixed: Vec<usize> =
            expressed.host_numbers_read().into_iter().filter(|&number| user_number(number).is_none()).collect();
        let column = |number: usize| rows.frames.iter().map(|frame| host_numbers(frame)[number]).collect();
        let fixed = fixed.into_iter().map(|number| (number, column(number))).collect();
        let of_bodies: Vec<Vec<f64>> =
            parallel::rows(rows.bodies.len(), 1, &|row| numbers_of_body(torque.values(), rows.bodies[row] as usize));
        let count = of_bodies.first().map_or(0, Vec::len);
        let numbers = (0..count).map(|number| of_bodies.iter().map(|of_body| of_body[number]).collect()).collect();
        let torque = torque.clone();
        let pending = VecDeque::new();
        Self { torque, expressed, first_column, fixed, numbers, pending, sampled: None, effected: None }
    }

    fn without_rows(&self) -> Self {
        Self {
            torque: self.torque.clone(),
            expressed: Arc::clone(&self.expressed),
            fixed: Vec::new(),
            numbers: Vec::new(),
            pending: VecDeque::new(),
            ..*self
        }
    }

    /// The columns of some rows, formed from their numbers.
    fn columns(&self, numbers: &[Vec<f64>], rows: Range<usize>) -> Vec<Vec<f64>> {
        let count = rows.len();
        let host = |number: usize| -> &[f64] {
            match user_number(number) {
                Some(number) => &numbers[number],
                None => {
                    let fixed = self.fixed.iter().find(|(own, _)| *own == number);
                    fixed.map_or(&[], |(_, column)| &column[rows.clone()])
                }
            }
        };
        self.expressed.rows(host, count)
    }

    /// Carries out a change in some rows.
    fn formed(
        &self,
        due: Due,
        rows: &Rows,
        range: Range<usize>,
        state: &(dyn Fn(&BodyFrame, usize) -> BodyState + Sync),
    ) -> Formed {
        let control = self.control();
        let mut numbers: Vec<Vec<f64>> = self.numbers.iter().map(|column| column[range.clone()].to_vec()).collect();
        advance_states(control, &mut numbers, due.time);
        let states = StatesOf::new(rows, range.clone(), due.time, state, self);
        let take = |numbers: &mut Vec<Vec<f64>>, targets: &mut dyn Iterator<Item = usize>, found: Vec<Vec<f64>>| {
            targets.zip(found).for_each(|(target, column)| numbers[target] = column);
        };
        if due.effect {
            let oldest = self.pending.front().into_iter().flatten();
            let found = oldest.map(|column| column[range.clone()].to_vec()).collect();
            take(&mut numbers, &mut control.samples.targets(), found);
        }
        let mut pending = None;
        if due.sample {
            let found = states.results(&control.samples.program, &numbers);
            let mut as_sampled = numbers.clone();
            take(&mut as_sampled, &mut control.samples.targets(), found.clone());
            let next = states.results(&control.next.program, &as_sampled);
            if due.delayed {
                pending = Some(found);
            } else {
                numbers = as_sampled;
            }
            take(&mut numbers, &mut control.next.targets(), next);
        }
        // At the start the rates are those of zero values.
        if due.effect || !due.delayed || due.time <= 0.0 {
            let found = states.results(&control.rates.program, &numbers);
            take(&mut numbers, &mut control.rates.targets(), found);
        }
        let columns = self.columns(&numbers, range.clone());
        Formed { range, numbers, pending, columns }
    }
}

/// Advances the numbers that have a rate to `time`, s.
fn advance_states(control: &Control, numbers: &mut [Vec<f64>], time: f64) {
    for (state, rate) in &control.slopes {
        for (state, rate) in state.clone().zip(rate.clone()) {
            for row in 0..numbers[state].len() {
                let elapsed = time - numbers[control.since][row];
                numbers[state][row] = elapsed.mul_add(numbers[rate][row], numbers[state][row]);
            }
        }
    }
    numbers[control.since].fill(time);
}

/// The tasks of a change.
#[derive(Clone, Copy)]
struct Due {
    sample: bool,
    effect: bool,
    delayed: bool,
    time: f64,
}

/// The results of a change in some rows.
struct Formed {
    range: Range<usize>,
    numbers: Vec<Vec<f64>>,
    pending: Option<Vec<Vec<f64>>>,
    columns: Vec<Vec<f64>>,
}

/// The columns that formulas read, for some rows.
struct StatesOf {
    columns: Vec<(Input, Vec<f64>)>,
    count: usize,
}

impl StatesOf {
    fn new(
        rows: &Rows,
        range: Range<usize>,
        time: f64,
        state: &(dyn Fn(&BodyFrame, usize) -> BodyState + Sync),
        law: &Law,
    ) -> Self {
        let control = law.control();
        let programs = [&control.samples.program, &control.next.program, &control.rates.program];
        let mut read: Vec<Input> = programs.iter().flat_map(|program| program.inputs().iter().copied()).collect();
        read.retain(|input| input.kind != InputKind::Parameter);
        read.sort_unstable();
        read.dedup();
        let mut columns: Vec<(Input, Vec<f64>)> =
            read.into_iter().map(|input| (input, Vec::with_capacity(range.len()))).collect();
        let needs_tensor =
            columns.iter().any(|(input, _)| matches!(input.kind, InputKind::Inertia | InputKind::AngularMomentum));
        let rows_read = if columns.is_empty() { range.end..range.end } else { range.clone() };
        for row in rows_read {
            let mut frame = rows.frames[row];
            if rows.varies {
                frame = frame.at(&rows.torques, rows.bodies[row] as usize, time);
            }
            let state = state(&frame, row);
            let tensor = if needs_tensor { tensor_of(&frame) } else { Default::default() };
            let momentum = if needs_tensor { tensor * state.angular_velocity_body } else { glam::DVec3::ZERO };
            for (input, column) in &mut columns {
                let index = usize::from(input.index);
                column.push(match input.kind {
                    InputKind::Orientation => state.orientation.to_array()[index],
                    InputKind::AngularVelocity => state.angular_velocity_body.to_array()[index],
                    InputKind::AngularMomentum => momentum.to_array()[index],
                    InputKind::Inertia => tensor.to_array()[index],
                    InputKind::Time => time,
                    // The scene has replaced positions by functions of time.
                    _ => f64::NAN,
                });
            }
        }
        Self { columns, count: range.len() }
    }

    fn results(&self, program: &Program, numbers: &[Vec<f64>]) -> Vec<Vec<f64>> {
        if program.output_count() == 0 {
            return Vec::new();
        }
        let column = |input: &Input| -> &[f64] {
            match input.kind {
                InputKind::Parameter => &numbers[usize::from(input.index)],
                _ => self.columns.iter().find(|(own, _)| own == input).map_or(&[], |(_, column)| column),
            }
        };
        program.evaluate_columns(&program.inputs().iter().map(column).collect::<Vec<_>>(), self.count)
    }
}
