//! Time-dependent values on a tile: phases at the start of a step, and what torques compute from them at each stage.

use super::super::PER_TICK;
use super::super::formula::{Epoch, Formula, FormulaTask, MOST_PHASES};
use super::super::sum::{Columns, Source, StepTime, ticks_from};
use super::super::variable_inertia::{Change, ChangeAt, ramp_progress};
use super::kept::Kept;
use super::{TileInstance, TileRow, TileTorques};
use crate::math::clock::{MOST_LANES, Ticks, phase_after, phases_at, seconds_at};
use crate::math::lanes::{Each, GROUPS};
use crate::math::real::{Real, Scalar};
use crate::math::vector::{TwoWords, Vector};

/// The start of a step for the bodies of a tile.
#[derive(Clone, Copy, Debug)]
pub(crate) enum TileTime<'s, R> {
    /// The start of the interval's equal step with this number.
    Equal(u64),
    /// This long after the clock, lane by lane, in units of each body's own scale.
    Own(&'s Each<TwoWords<R>>),
}

/// [`TileTorques::start`] where something depends on the time.
#[inline(always)]
pub(super) fn start<R: Real>(torques: &mut TileTorques<'_, R>, start: TileTime<'_, R>, active: &[usize]) {
    for &group in active {
        let group = group % GROUPS;
        let source = torques.source;
        let columns: Columns<'_, R> = source.columns(torques.bases[group]);
        let ticks = match start {
            TileTime::Equal(step) => {
                torques.noise[group] = columns.noise(step);
                columns.ticks(StepTime::Equal(step))
            }
            TileTime::Own(times) => {
                let (seconds, time) = (R::splat(1.0) / torques.scale[group], times[group]);
                torques.seconds[group] = seconds;
                let time = TwoWords { value: time.value * seconds, residue: time.residue * seconds };
                columns.ticks(StepTime::Own(&time))
            }
        };
        let per_tick = torques.change.as_ref().map_or(0, |change| torques.instances[change.index].first + PER_TICK);
        for (number, phase) in torques.starts.iter_mut().enumerate() {
            let is_ramp = torques.change.is_some() && source.table.ramp_of(number).is_some();
            let per_tick = if is_ramp { Some(torques.parameters[per_tick][group]) } else { None };
            phase[group] = start_of(&source, number, &torques.rows[group], &ticks, per_tick);
        }
    }
}

/// A phase by its number in the table, in turns, for the bodies in these rows; for a ramp, whose progress per tick is given, its
/// progress, not clamped. The number after the last phase means the time, s.
#[inline(always)]
pub(crate) fn start_of<R: Real>(
    source: &Source<'_, R::Scalar>,
    number: usize,
    rows: &[usize; MOST_LANES],
    ticks: &Ticks,
    per_tick: Option<R>,
) -> R {
    let (table, mut room) = (source.table, [0; MOST_LANES]);
    if number == table.phase_count() {
        return seconds_at(ticks, source.clock.ticks_per_second());
    }
    let fractions = table.fractions(number, &rows[..R::LANES], &mut room);
    match per_tick {
        Some(per_tick) => ticks_from::<R>(fractions, ticks) * per_tick,
        None => phases_at(fractions, ticks),
    }
}

/// [`TileTorques::at`] where something depends on the time.
#[inline(always)]
pub(super) fn at<R: Real>(torques: &mut TileTorques<'_, R>, elapsed: &Each<R>, active: &[usize]) {
    for &group in active {
        let group = group % GROUPS;
        torques.elapsed[group] = elapsed[group] * torques.seconds[group];
    }
    let elapsed = &torques.elapsed;
    for (index, instance) in torques.instances.iter().enumerate() {
        instance.kind.with(EpochOf {
            instance,
            parameters: &torques.parameters,
            starts: &torques.starts,
            rates: &torques.rates,
            epochs: &mut torques.epochs[index],
            kept: &mut torques.kept[index],
            time: torques.time,
            elapsed,
            active,
        });
    }
    let mut ratios = None;
    if let Some(change) = &mut torques.change {
        let rows = &torques.parameters[torques.instances[change.index].first..];
        let mut shares = [Each([R::splat(0.0); GROUPS]); 3];
        if let Some(formula) = &mut change.formula {
            formula.form_epoch(&torques.starts, &torques.rates, elapsed, None, None);
            formula.add(&mut shares);
        }
        for &group in active {
            let group = group % GROUPS;
            let row = TileRow { rows, group };
            let at = match change.formula {
                Some(_) => {
                    let share = Vector::new(shares[0][group], shares[1][group], shares[2][group]);
                    ChangeAt::by_formula(&row, share)
                }
                None => ChangeAt::by_law(&row, torques.epochs[change.index][group].number),
            };
            change.at[group] = at;
            if !torques.expressions.is_empty() {
                let ratio = Change::of_row(&row).moment_ratio(at.share);
                [change.ratios[0][group], change.ratios[1][group], change.ratios[2][group]] =
                    [ratio.x, ratio.y, ratio.z];
            }
        }
        ratios = Some(&change.ratios);
    }
    for expression in &mut torques.expressions {
        let index = expression.index;
        let kept = torques.instances[index].is_shared.then(|| (&mut torques.kept[index], torques.time));
        expression.form_epoch(&torques.starts, &torques.rates, &torques.elapsed, ratios, kept);
    }
    torques.time += 1;
}

/// The time-dependent values of one instance.
struct EpochOf<'s, R: Real> {
    instance: &'s TileInstance,
    parameters: &'s [Each<R>],
    starts: &'s [Each<R>],
    rates: &'s [Each<R>],
    epochs: &'s mut Each<Epoch<R>>,
    kept: &'s mut Kept<R::Scalar>,
    time: usize,
    elapsed: &'s Each<R>,
    active: &'s [usize],
}

/// Number of components of an [`Epoch`].
pub(super) const EPOCH_NUMBERS: usize = 4;

impl<R: Real> FormulaTask for EpochOf<'_, R> {
    type Output = ();
    #[inline(always)]
    fn run<F: Formula>(self) {
        if F::PHASES.is_empty() {
            return;
        }
        let Self { instance: &TileInstance { first, first_phase, is_shared, .. }, active, .. } = self;
        let rows = &self.parameters[first..][..F::PARAMETERS];
        let starts = &self.starts[first_phase..][..F::PHASES.len()];
        let rates = &self.rates[first_phase..][..F::PHASES.len()];
        if is_shared && let Some(&[x, y, z, number]) = self.kept.at(self.time) {
            let [x, y, z, number] = [x, y, z, number].map(|number| R::splat(number.to_f64()));
            for &group in active {
                self.epochs[group % GROUPS] = Epoch { vector: Vector::new(x, y, z), number };
            }
            return;
        }
        for (place, &group) in active.iter().enumerate() {
            let group = group % GROUPS;
            if is_shared && place > 0 {
                self.epochs[group] = self.epochs[active[0] % GROUPS];
                continue;
            }
            let elapsed = self.elapsed[group];
            let mut phases = [R::splat(0.0); MOST_PHASES];
            for phase in 0..F::PHASES.len() {
                let (start, rate) = (starts[phase][group], rates[phase][group]);
                phases[phase] = if F::IS_PROGRESS {
                    ramp_progress(start, rate, elapsed)
                } else {
                    phase_after(start, rate, elapsed)
                };
            }
            self.epochs[group] = F::epoch(&TileRow { rows, group }, phases);
        }
        if is_shared {
            let Epoch { vector: Vector { x, y, z }, number } = self.epochs[active[0] % GROUPS];
            self.kept.keep(self.time, [x, y, z, number].into_iter());
        }
    }
}
