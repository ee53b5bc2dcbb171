//! The torques on a tile: a few lane groups of bodies whose parameters, phases and torques stay in the first-level cache.
//!
//! A method goes through a step stage by stage, and a stage is one function for any combination of torques: it takes the lane groups in
//! turn and sums the torques on each with [`TileTorques::sum`], so that the number of kernels is the sum and not the product of methods and
//! torques.

mod expression;
mod kept;
mod time;

pub(crate) use time::{TileTime, start_of};

use expression::TileExpression;
use kept::Kept;
use time::EPOCH_NUMBERS;

use std::ops::Range;

use super::expressed::Given;
use super::formula::{Epoch, Following, Formula, FormulaTask, Role, Row};
use super::kind::Kind;
use super::linear_rotor::across_axis;
use super::sum::{Columns, Source, Torques};
use super::table::Instance;
use super::variable_inertia::ChangeAt;
use crate::bodies::columns::RATE_COLUMN;
use crate::kernel::rigid_body::{Body, Correction};
use crate::kernel::torque_kernel::Motion;
use crate::math::clock::MOST_LANES;
use crate::math::lanes::{Each, GROUPS};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, Scalar, outlined};
use crate::math::vector::Vector;

/// One instance of a torque on a tile.
#[derive(Clone, Copy, Debug)]
struct TileInstance {
    kind: Kind,
    /// Its first row of parameters.
    first: usize,
    /// The number of its first phase.
    first_phase: usize,
    /// The places in [`TileTorques::epoch_columns`] of the parameters that its time-dependent part reads.
    epoch_columns: [usize; 2],
    /// Whether that part reads the moments, which may differ by body.
    reads_moments: bool,
    /// Whether the time-dependent part is the same for all bodies of the tile.
    is_shared: bool,
}

/// The torques on the bodies of a tile.
pub(crate) struct TileTorques<'a, R: Real> {
    source: Source<'a, R::Scalar>,
    /// The first body of each lane group, if bodies are consecutive.
    bases: [usize; GROUPS],
    /// The row of each lane's body.
    rows: [[usize; MOST_LANES]; GROUPS],
    /// Whether bodies are consecutive.
    are_consecutive: bool,
    instances: Vec<TileInstance>,
    /// Columns of parameters that time-dependent parts read, each counted from the first of its instance.
    epoch_columns: Vec<usize>,
    parameters: Vec<Each<R>>,
    /// Rates of the phases, turns/s, or ramps/s.
    rates: Vec<Each<R>>,
    /// Phases at the start of a step, turns, or the progress of a ramp.
    starts: Vec<Each<R>>,
    /// One for each instance.
    epochs: Vec<Each<Epoch<R>>>,
    /// For each instance that [is shared](TileInstance::is_shared), values kept for the following tiles; and how many times the present
    /// tile has evaluated.
    kept: Vec<Kept<R::Scalar>>,
    time: usize,
    noise: Each<Vector<R>>,
    /// The reference rates, and seconds in the unit of later times; for adaptive steps a power of two.
    scale: Each<R>,
    seconds: Each<R>,
    /// Since the start of the step, s.
    elapsed: Each<R>,
    /// Torques that are expressions, and the sum of them, component by component.
    expressions: Vec<TileExpression<'a, R>>,
    sums: [Each<R>; 3],
    /// The change of the moments, if they change.
    change: Option<TileChange<'a, R>>,
}

/// How the moments of the bodies of a tile change.
struct TileChange<'a, R: Real> {
    /// The index of the instance.
    index: usize,
    /// The formula of the shares, if it is data.
    formula: Option<TileExpression<'a, R>>,
    at: Each<ChangeAt<R>>,
    /// I/I₀, axis by axis, if torques that are expressions read the moments.
    ratios: [Each<R>; 3],
}

impl<'a, R: Real> TileTorques<'a, R> {
    /// Working memory for the torques of a source; [`TileTorques::load`] fills it.
    pub fn new(source: Source<'a, R::Scalar>) -> Self {
        let zero = R::splat(0.0);
        let mut instances = Vec::new();
        let (mut parameters, mut phases) = (0, 0);
        let mut expressions = Vec::new();
        let mut change = None;
        let (mut kept, mut epoch_columns) = (Vec::new(), Vec::new());
        for &Instance { kind, index, parameters: own, phases: own_phases, .. } in source.table.list() {
            let expressed = (kind.role() == Role::Expression).then(|| source.table.expressed(index));
            let inputs = || expressed.into_iter().flat_map(|expressed| &expressed.epoch.inputs);
            let first_column = epoch_columns.len();
            epoch_columns.extend(inputs().filter_map(|given| match given {
                Given::Column(column) => Some(*column),
                _ => None,
            }));
            epoch_columns.extend((0..own).filter(|&column| kind.epoch_reads(column)));
            instances.push(TileInstance {
                kind,
                first: parameters,
                first_phase: phases,
                epoch_columns: [first_column, epoch_columns.len()],
                reads_moments: inputs().any(|given| matches!(given, Given::MomentRatio(_))),
                is_shared: false,
            });
            if let Some(expressed) = expressed {
                expressions.push(TileExpression::new(expressed, parameters, phases, instances.len() - 1));
                kept.push(Kept::new(expressed.epoch.program.output_count()));
            } else {
                kept.push(Kept::new(EPOCH_NUMBERS));
            }
            if kind.role() == Role::Moments {
                let formula = source.table.formula_of_moments();
                let formula = formula
                    .map(|of| TileExpression::new(of, parameters + kind.parameters(), phases, instances.len() - 1));
                let at = Each([ChangeAt::none(); GROUPS]);
                change = Some(TileChange {
                    index: instances.len() - 1,
                    formula,
                    at,
                    ratios: [Each([R::splat(1.0); GROUPS]); 3],
                });
            }
            parameters += own;
            phases += own_phases;
        }
        let places = source.table.start_places();
        Self {
            source,
            bases: [0; GROUPS],
            rows: [[0; MOST_LANES]; GROUPS],
            are_consecutive: false,
            epoch_columns,
            parameters: vec![Each([zero; GROUPS]); parameters],
            rates: vec![Each([zero; GROUPS]); phases],
            starts: vec![Each([zero; GROUPS]); places],
            elapsed: Each([zero; GROUPS]),
            expressions,
            sums: [Each([zero; GROUPS]); 3],
            epochs: vec![Each([Epoch::none(); GROUPS]); instances.len()],
            kept,
            time: 0,
            instances,
            noise: Each([Vector::zero(); GROUPS]),
            scale: Each([R::splat(1.0); GROUPS]),
            seconds: Each([R::splat(1.0); GROUPS]),
            change,
        }
    }

    /// The numbers of a column that belong to the bodies of a lane group.
    #[inline(always)]
    fn of_group(&self, column: &[R::Scalar], group: usize) -> R {
        // One load takes a fraction of the time of as many as there are lanes.
        if self.are_consecutive { R::load(&column[self.bases[group]..]) } else { gathered(column, &self.rows[group]) }
    }

    #[inline(always)]
    fn columns(&self, group: usize) -> Columns<'_, R> {
        self.source.columns(self.bases[group % GROUPS])
    }

    /// Loads the parameters of the bodies of `groups` lane groups, starting at body `first`.
    #[inline(always)]
    pub fn load(&mut self, first: usize, groups: usize) {
        self.time = 0;
        self.are_consecutive = true;
        for group in 0..groups.min(GROUPS) {
            self.bases[group] = first + group * R::LANES;
            for (lane, row) in self.rows[group].iter_mut().enumerate() {
                *row = first + group * R::LANES + lane;
            }
        }
        outlined!(R, load(self, 0..groups.min(GROUPS)));
    }

    /// Loads the parameters of the bodies in these rows, lane by lane, for one lane group. Bodies that are not rigid must be
    /// consecutive.
    #[inline(always)]
    pub fn load_rows(&mut self, group: usize, rows: &[usize; MOST_LANES]) {
        (self.bases[group], self.rows[group]) = (rows[0], *rows);
        self.are_consecutive = false;
        outlined!(R, load(self, group..group + 1));
    }

    /// Computes what is constant over a step: phases at its start, random torques.
    #[inline(always)]
    pub fn start(&mut self, start: TileTime<'_, R>, active: &[usize]) {
        if !self.starts.is_empty() || self.source.table.instances(Kind::WhiteNoise).count > 0 {
            outlined!(R, time::start(self, start, active));
        }
    }

    /// Computes what depends on the time `elapsed` after the start of the step, in the unit of its start.
    #[inline(always)]
    pub fn at(&mut self, elapsed: &Each<R>, active: &[usize]) {
        if !self.starts.is_empty() {
            outlined!(R, time::at(self, elapsed, active));
        }
    }

    /// Whether any torques are expressions.
    #[inline(always)]
    pub fn has_expressions(&self) -> bool {
        !self.expressions.is_empty()
    }

    /// Whether all torques are expressions.
    #[inline(always)]
    pub fn has_expressions_only(&self) -> bool {
        self.expressions.len() == self.instances.len()
    }

    /// The result of the last [`TileTorques::form_expressions`] for a lane group.
    #[inline(always)]
    pub fn sum_of_expressions(&self, group: usize) -> Vector<R> {
        let group = group % GROUPS;
        Vector::new(self.sums[0][group], self.sums[1][group], self.sums[2][group])
    }

    /// Sets the state of a lane group for [`TileTorques::form_expressions`].
    #[inline(always)]
    pub fn place(&mut self, group: usize, orientation: Quaternion<R>, angular_velocity_principal: Vector<R>) {
        for expression in &mut self.expressions {
            expression.place(group % GROUPS, orientation, angular_velocity_principal);
        }
    }

    /// Forms the sum of all torques that are expressions, at the time of the last [`TileTorques::at`].
    #[inline(always)]
    pub fn form_expressions(&mut self) {
        self.sums = [Each([R::splat(0.0); GROUPS]); 3];
        for expression in &mut self.expressions {
            expression.add(&mut self.sums);
        }
    }

    /// The rotation of the bodies of a lane group, at the time of the last [`TileTorques::at`].
    #[inline(always)]
    pub fn motion(&self, group: usize, body: &Body<R>, correction: &Correction<R>, m: Vector<R>) -> Motion<R> {
        if self.source.table.is_rigid() {
            return Motion::rigid(body.angular_velocity(m, correction), body.gyroscopic_term(m, correction));
        }
        // A copy, so that m itself need not be in memory.
        let there = m;
        outlined!(R, {
            let share = self.change.as_ref().map_or(Vector::zero(), |change| change.at[group % GROUPS].share);
            Torques::new(self.columns(group)).motion_of(share, body, correction, there)
        })
    }

    /// The kind of the torque, if there is only one, on rigid bodies.
    #[inline(always)]
    pub fn only(&self) -> Option<Kind> {
        match self.instances[..] {
            [TileInstance { kind, .. }] if matches!(kind.role(), Role::Torque) => Some(kind),
            _ => None,
        }
    }

    /// The torque on a lane group if there is only one, of the formula's kind.
    #[inline(always)]
    pub fn only_torque<F: Formula>(&self, group: usize, q: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        let row = TileRow { rows: &self.parameters[..F::PARAMETERS], group };
        self.noise[group % GROUPS] + F::torque(&row, &self.epochs[0][group % GROUPS], q, omega)
    }

    /// The sum of the torques on a lane group, at the time of the last [`TileTorques::at`].
    ///
    /// It is inlined into loops over the lane groups of a tile, so that the partial sums stay in registers.
    #[inline(always)]
    pub fn sum(&self, group: usize, orientation: Quaternion<R>, angular_velocity_principal: Vector<R>) -> Vector<R> {
        let group = group % GROUPS;
        let mut sum = self.noise[group];
        if self.has_expressions() {
            sum = sum + self.sum_of_expressions(group);
        }
        for (instance, epochs) in self.instances.iter().zip(&self.epochs) {
            let added = Added { torques: self, instance, epochs, group, orientation, angular_velocity_principal, sum };
            sum = instance.kind.with(added);
        }
        sum
    }
}

/// Adds one more torque to a sum.
struct Added<'s, 'a, R: Real> {
    torques: &'s TileTorques<'a, R>,
    instance: &'s TileInstance,
    epochs: &'s Each<Epoch<R>>,
    group: usize,
    orientation: Quaternion<R>,
    angular_velocity_principal: Vector<R>,
    sum: Vector<R>,
}

impl<R: Real> FormulaTask for Added<'_, '_, R> {
    type Output = Vector<R>;
    #[inline(always)]
    fn run<F: Formula>(self) -> Vector<R> {
        let Self { torques, orientation: q, angular_velocity_principal: omega, sum, .. } = self;
        let group = self.group % GROUPS;
        let row = TileRow { rows: &torques.parameters[self.instance.first..][..F::PARAMETERS], group };
        match F::ROLE {
            Role::Projection => across_axis(row.number(0), sum),
            Role::Torque => {
                if F::FOLLOWS_MOMENTS
                    && let Some(change) = &torques.change
                {
                    let following = Following { row: &row, gained: change.at[group].gained };
                    return sum + F::torque(&following, &self.epochs[group], q, omega);
                }
                sum + F::torque(&row, &self.epochs[group], q, omega)
            }
            // Those that are expressions were evaluated before.
            Role::Noise | Role::Slip | Role::Moments | Role::Expression => sum,
        }
    }
}

/// The parameters of one instance for one lane group.
struct TileRow<'s, R> {
    rows: &'s [Each<R>],
    group: usize,
}

impl<R: Real> Row<R> for TileRow<'_, R> {
    #[inline(always)]
    fn number(&self, column: usize) -> R {
        self.rows[column][self.group % GROUPS]
    }
}

/// A column's numbers in some rows.
#[inline(always)]
pub(crate) fn gathered<R: Real>(column: &[R::Scalar], rows: &[usize; MOST_LANES]) -> R {
    let mut numbers = [R::Scalar::default(); MOST_LANES];
    for lane in 0..R::LANES {
        numbers[lane] = column[rows[lane]];
    }
    R::load(&numbers)
}

/// Loads the parameters of some lane groups, whose rows are set.
#[inline(always)]
fn load<R: Real>(torques: &mut TileTorques<'_, R>, groups: Range<usize>) {
    let source = torques.source;
    let (table, stride) = (source.table, source.stride);
    for group in groups.clone() {
        torques.scale[group] = torques.of_group(&source.parameters[RATE_COLUMN * stride..], group);
    }
    for index in 0..torques.instances.len() {
        let TileInstance { first, first_phase, epoch_columns, reads_moments, .. } = torques.instances[index];
        let instance = table.list()[index];
        for column in 0..instance.parameters {
            let numbers = &source.parameters[(instance.first + column) * stride..];
            for group in groups.clone() {
                torques.parameters[first + column][group] = torques.of_group(numbers, group);
            }
        }
        let mut is_shared = source.dt > 0.0 && !reads_moments;
        for phase in 0..instance.phases {
            let numbers = &source.parameters[instance.rate_column(phase) * stride..];
            for group in groups.clone() {
                torques.rates[first_phase + phase][group] = torques.of_group(numbers, group);
            }
            is_shared = is_shared && table.rate_is_shared(first_phase + phase);
        }
        for place in epoch_columns[0]..epoch_columns[1] {
            let column = &torques.parameters[first + torques.epoch_columns[place]];
            is_shared = is_shared && are_equal(column, groups.end);
        }
        torques.instances[index].is_shared = is_shared;
        if is_shared {
            let body = torques.rows[0][0];
            let columns = torques.epoch_columns[epoch_columns[0]..epoch_columns[1]].iter();
            let number = |&column: &usize| source.parameters[(instance.first + column) * stride + body];
            torques.kept[index].begin(columns.map(number));
        }
    }
    for expression in &mut torques.expressions {
        expression.load(&torques.parameters);
    }
    if let Some(formula) = torques.change.as_mut().and_then(|change| change.formula.as_mut()) {
        formula.load(&torques.parameters);
    }
}

/// Whether all lanes of the groups before `end` hold the same number.
#[inline(always)]
fn are_equal<R: Real>(groups: &Each<R>, end: usize) -> bool {
    let mut lanes = [<R::Scalar as Default>::default(); MOST_LANES];
    groups[0].store(&mut lanes);
    let first = R::splat(lanes[0].to_f64());
    let mut differ = first.less_than(first);
    for group in 0..end.min(GROUPS) {
        differ = differ | groups[group].less_than(first) | first.less_than(groups[group]);
    }
    !R::any(differ)
}
