//! What a lane group reads for its torques.

use std::cell::{Cell, RefCell};

use crate::expression::Scratch;
use crate::math::clock::{Clock, Fraction, MOST_LANES, Ticks, phases_at, seconds_at, ticks_in};
use crate::math::real::{Real, Scalar, outlined};
use crate::math::vector::{TwoWords, Vector};
use crate::torque::variable_inertia::ticks_since;
use crate::torque::{PER_TICK, TorqueTable};

/// Locates the bodies and torques of a batch's lane groups, and the time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Source<'a, T> {
    pub table: &'a TorqueTable,
    /// Shape `[columns, stride]`.
    pub parameters: &'a [T],
    pub stride: usize,
    /// At the start of the interval.
    pub clock: Clock,
    /// An equal step, s; 0 for adaptive steps.
    pub dt: f64,
}

impl<T: Scalar> Source<'_, T> {
    /// Working memory for a lane group.
    #[inline(always)]
    pub fn workspace<R: Real<Scalar = T>>(&self) -> Workspace<R> {
        let expressions = self.table.expressions().iter();
        let slopes = self.table.formula_of_moments().map(|formula| &formula.slopes.program);
        let programs = expressions.map(|expressed| &expressed.whole.instructions.program).chain(slopes);
        let scratches = programs.map(Scratch::new);
        Workspace {
            start_phases: vec![Cell::new(R::splat(0.0)); self.table.start_places()],
            scratches: RefCell::new(scratches.collect()),
        }
    }

    /// What the lane group starting at body `first` reads.
    #[inline(always)]
    pub fn group<'g, R: Real<Scalar = T>>(&'g self, first: usize, workspace: &'g Workspace<R>) -> Columns<'g, R> {
        let units = self.clock.units(self.dt);
        let Workspace { start_phases, scratches } = workspace;
        Columns { source: *self, first, units, start_phases, scratches: Some(scratches) }
    }

    /// The columns alone, for tasks that form no phases and evaluate no expressions.
    #[inline(always)]
    pub fn columns<'g, R: Real<Scalar = T>>(&'g self, first: usize) -> Columns<'g, R> {
        Columns { source: *self, first, units: self.clock.units(self.dt), start_phases: &[], scratches: None }
    }
}

/// Working memory for a lane group.
#[derive(Debug)]
pub(crate) struct Workspace<R: Real> {
    /// Phases at the start of a step, by number, followed by the time if it is read.
    start_phases: Vec<Cell<R>>,
    /// Scratch memory for expressions, in the order of the table, followed by that for the rates of the moments if these have a formula.
    scratches: RefCell<Vec<Scratch<R, 1>>>,
}

/// The columns of one lane group.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Columns<'a, R: Real> {
    pub source: Source<'a, R::Scalar>,
    /// First body of the lane group.
    pub first: usize,
    /// An equal step in the clock's units.
    units: u128,
    pub start_phases: &'a [Cell<R>],
    pub scratches: Option<&'a RefCell<Vec<Scratch<R, 1>>>>,
}

/// The start of a step.
#[derive(Clone, Copy, Debug)]
pub(crate) enum StepTime<'s, R> {
    /// The start of the interval's equal step with this number.
    Equal(u64),
    /// This many seconds after the clock, lane by lane.
    Own(&'s TwoWords<R>),
}

impl<R: Real> Columns<'_, R> {
    /// One column of a body or a torque.
    #[inline(always)]
    pub fn column(&self, column: usize) -> R {
        R::load(&self.source.parameters[column * self.source.stride + self.first..])
    }

    /// Three columns.
    #[inline(always)]
    pub fn vector(&self, column: usize) -> Vector<R> {
        Vector::new(self.column(column), self.column(column + 1), self.column(column + 2))
    }

    /// The ticks at the start of a step.
    #[inline(always)]
    pub fn ticks(&self, start: StepTime<'_, R>) -> Ticks {
        match start {
            StepTime::Equal(step) => {
                let now = self.source.clock.now().wrapping_add(self.units.wrapping_mul(u128::from(step)));
                Ticks::Equal((now >> 64) as u64)
            }
            StepTime::Own(time) => {
                let mut words = [[R::Scalar::default(); MOST_LANES]; 2];
                time.value.store(&mut words[0]);
                time.residue.store(&mut words[1]);
                let mut ticks = [0; MOST_LANES];
                for (lane, ticks) in ticks[..R::LANES].iter_mut().enumerate() {
                    let time = TwoWords { value: words[0][lane], residue: words[1][lane] };
                    *ticks =
                        self.source.clock.ticks().wrapping_add(ticks_in(time, self.source.clock.ticks_per_second()));
                }
                Ticks::Own(ticks)
            }
        }
    }

    /// Forms all phases, in turns; for a ramp its progress, not clamped.
    #[inline(always)]
    pub fn form_start_phases(&self, start: StepTime<'_, R>) {
        if !self.start_phases.is_empty() {
            outlined!(R, {
                let ticks = self.ticks(start);
                for (number, phase) in self.start_phases.iter().enumerate() {
                    phase.set(self.start_phase(number, &ticks));
                }
            });
        }
    }

    /// A phase by its number in the table, in turns; for a ramp its progress, not clamped. The number after the last phase means the time,
    /// s.
    #[inline(always)]
    pub fn start_phase(&self, number: usize, ticks: &Ticks) -> R {
        if number == self.source.table.phase_count() {
            return seconds_at(ticks, self.source.clock.ticks_per_second());
        }
        let fraction = self.source.table.fraction(number, self.first);
        match self.source.table.ramp_of(number) {
            Some(first) => self.progress_at(fraction, ticks, first),
            None => phases_at(fraction, ticks),
        }
    }

    /// The progress of the ramp with columns from `first` on, not clamped.
    #[inline(always)]
    fn progress_at(&self, start: Fraction<'_>, ticks: &Ticks, first: usize) -> R {
        ticks_from::<R>(start, ticks) * self.column(first + PER_TICK)
    }
}

/// Ticks since the start of a ramp.
#[inline(always)]
pub(crate) fn ticks_from<R: Real>(start: Fraction<'_>, ticks: &Ticks) -> R {
    match (start, ticks) {
        (Fraction::Shared(start), &Ticks::Equal(ticks)) => {
            let ticks = ticks_since::<R::Scalar>(ticks, start as u64);
            R::from_lanes(|_| ticks)
        }
        (Fraction::Shared(start), _) => R::from_lanes(|lane| ticks_since(ticks.of_lane(lane), start as u64)),
        (Fraction::PerBody(starts), _) => {
            let starts = &starts[..R::LANES];
            R::from_lanes(|lane| ticks_since(ticks.of_lane(lane), starts[lane] as u64))
        }
    }
}
