//! Statistics of columns in the host's memory.
//!
//! In lanes, the quantities are formed in `f64` from both words of the state, whatever the columns' precision; one by one, by
//! the twin of the shader.

use std::ops::Range;

use crate::bodies::BodyFrame;
use crate::bodies::columns::{STATE_COMPONENTS, StateWords, status_column};
use crate::engine::batch::Batch;
use crate::engine::reduction::{BlockRows, Marked, merged};
use crate::kernel::observe::{
    Columns, Extreme, GROUP_BODIES, Kernel, ObservedRow, Partial, SCALE_COLUMN, Statistic, WORKGROUP, merge, merge_all,
    observe, quantity, without_axis,
};
use crate::math::Width;
use crate::math::lanes::{LaneScalar, LaneTask};
use crate::math::parallel;
use crate::math::real::{Real, Scalar};
use crate::math::vector::Vector;

/// Places that one task reduces.
const TASK: usize = 64 * WORKGROUP;

/// The statistics that a session watches, with their memory.
pub(super) struct Reducer<T> {
    statistics: Vec<Statistic>,
    blocks: BlockRows,
    /// By place.
    columns: Watched<T>,
}

enum Watched<T> {
    Lanes(Columns<f64>),
    Twin(Columns<T>),
}

impl<T: LaneScalar + Kernel> Reducer<T> {
    pub fn new(width: Width, statistics: &[Statistic], frames: &[BodyFrame], blocks: &BlockRows, fastest: f64) -> Self {
        let parts: Vec<Range<usize>> = (0..blocks.count()).map(|block| blocks.places(block)).collect();
        let (places, frame) = (blocks.len(), |place: usize| &frames[place]);
        let columns = match width {
            Width::Lanes => Watched::Lanes(Columns::new(statistics, places, frame, &parts, fastest)),
            Width::Scalar => Watched::Twin(Columns::new(statistics, places, frame, &parts, fastest)),
        };
        Self { statistics: statistics.to_vec(), blocks: blocks.clone(), columns }
    }

    pub fn reduce(&self, batch: &Batch<T>) -> Vec<Vec<Partial<f64>>> {
        match &self.columns {
            Watched::Lanes(columns) => self.in_lanes(columns, batch),
            Watched::Twin(columns) => self.one_by_one(columns, batch),
        }
    }

    fn in_lanes(&self, columns: &Columns<f64>, batch: &Batch<T>) -> Vec<Vec<Partial<f64>>> {
        let (statistics, blocks) = (&self.statistics, &self.blocks);
        let of_block = |places: Range<usize>| -> Vec<Partial<f64>> {
            let task = |start: usize| {
                let places = start..(start + TASK).min(places.end);
                f64::dispatch(ObservePlaces { statistics, columns, batch, blocks, places })
            };
            let tasks: Vec<Vec<Partial<f64>>> = places.clone().step_by(TASK).map(task).collect();
            let of_statistic = |index: usize| merge_all(&tasks.iter().map(|task| task[index]).collect::<Vec<_>>());
            (0..statistics.len()).map(of_statistic).collect()
        };
        parallel::map(blocks.count(), |block| widened(&of_block(blocks.places(block)), &columns.offsets[block]))
    }

    fn one_by_one(&self, columns: &Columns<T>, batch: &Batch<T>) -> Vec<Vec<Partial<f64>>> {
        let of_piece = |first: usize, end: usize, offsets: &[i32]| {
            let row = |offset| observed_row(columns, batch, (first + offset, self.blocks.row(first + offset)));
            widened(&observe(&self.statistics, row, (first as u32, GROUP_BODIES.min(end - first))), offsets)
        };
        let of_block = |(block, offsets): (usize, &Vec<i32>)| {
            let places = self.blocks.places(block);
            let pieces = places.clone().step_by(GROUP_BODIES).map(|first| of_piece(first, places.end, offsets));
            merged(&pieces.collect::<Vec<_>>(), self.statistics.len())
        };
        columns.offsets.iter().enumerate().map(of_block).collect()
    }

    pub fn marked(&self, batch: &Batch<T>) -> Marked {
        let mut marked = Marked::default();
        for place in 0..self.blocks.len() {
            let row = self.blocks.row(place);
            if !is_sound(batch, row) {
                marked.failed.push(place);
            } else if self.is_faster(batch, place, row) {
                marked.faster.push(place);
            }
        }
        marked
    }

    fn is_faster(&self, batch: &Batch<T>, place: usize, row: usize) -> bool {
        match &self.columns {
            Watched::Lanes(columns) => {
                let column = |column: usize| columns.columns[column * columns.stride + place];
                let inverse_moments = Vector::new(column(0), column(1), column(2));
                let [x, y, z] = angular_momentum(batch, row);
                let m = without_axis(inverse_moments, Vector::new(x, y, z));
                quantity(Statistic::SpinRate, inverse_moments, m) > column(3)
            }
            Watched::Twin(columns) => observed_row(columns, batch, (place, row)).is_some_and(|row| row.is_faster()),
        }
    }
}

/// The state of some rows.
pub(super) fn read_rows<T: Scalar>(batch: &Batch<T>, rows: &[usize]) -> StateWords {
    let mut words = StateWords::default();
    for &row in rows {
        let one = batch.read(row..row + 1);
        words.value.extend(one.value);
        words.residue.extend(one.residue);
        words.status.extend(one.status);
    }
    words
}

/// Whether all components of a body are finite and no step has failed on it.
#[inline(always)]
fn is_sound<T: Scalar>(batch: &Batch<T>, row: usize) -> bool {
    let at = |column: usize| batch.state[column * batch.stride + row].to_f64();
    (0..STATE_COMPONENTS).all(|column| at(column).is_finite()) && at(status_column::<T>()) == 0.0
}

/// A body's angular momentum, both words.
#[inline(always)]
fn angular_momentum<T: Scalar>(batch: &Batch<T>, row: usize) -> [f64; 3] {
    let at = |column: usize| batch.state[column * batch.stride + row].to_f64();
    [4, 5, 6].map(|column| if T::WORDS == 2 { at(column) + at(column + STATE_COMPONENTS) } else { at(column) })
}

fn observed_row<T: Kernel>(
    columns: &Columns<T>,
    batch: &Batch<T>,
    (place, row): (usize, usize),
) -> Option<ObservedRow<T>> {
    if !is_sound(batch, row) {
        return None;
    }
    let column = |column: usize| columns.columns[column * columns.stride + place];
    let state = |column: usize| batch.state[column * batch.stride + row];
    let statistics = columns.columns.len() / columns.stride - SCALE_COLUMN;
    let scale = |index: usize| if index < statistics { column(SCALE_COLUMN + index) } else { T::default() };
    Some(ObservedRow {
        inverse_moments: Vector::new(column(0), column(1), column(2)),
        limit: column(3),
        m: Vector::new(state(4), state(5), state(6)),
        scales: std::array::from_fn(scale),
    })
}

/// The same partial results in `f64`, with exponents counted from the offsets.
fn widened<T: Kernel>(found: &[Partial<T>], offsets: &[i32]) -> Vec<Partial<f64>> {
    found.iter().zip(offsets).map(|(found, &offset)| found.widened(offset)).collect()
}

/// Reduces the rows of some places, workgroup by workgroup.
struct ObservePlaces<'a, T> {
    statistics: &'a [Statistic],
    columns: &'a Columns<f64>,
    batch: &'a Batch<T>,
    blocks: &'a BlockRows,
    places: Range<usize>,
}

impl<T: Scalar> LaneTask<f64> for ObservePlaces<'_, T> {
    type Output = Vec<Partial<f64>>;

    #[inline(always)]
    fn run<R: Real<Scalar = f64>>(self) -> Self::Output {
        let mut found = vec![Partial::none(); self.statistics.len()];
        for first in self.places.clone().step_by(WORKGROUP) {
            let bodies = WORKGROUP.min(self.places.end - first);
            let (mut sound, mut m) = ([0.0; WORKGROUP], [[0.0; WORKGROUP]; 3]);
            for place in 0..bodies {
                let row = self.blocks.row(first + place);
                if is_sound(self.batch, row) {
                    sound[place] = 1.0;
                    let own = angular_momentum(self.batch, row);
                    (m[0][place], m[1][place], m[2][place]) = (own[0], own[1], own[2]);
                }
            }
            let block = MomentumBlock { columns: self.columns, m: &m, first };
            let mut values = [0.0; WORKGROUP];
            block.quantities::<R>(Statistic::SpinRate, &mut values);
            let limits = &self.columns.columns[3 * self.columns.stride + first..][..WORKGROUP];
            let faster = (0..bodies).filter(|&row| sound[row] > 0.0 && values[row] > limits[row]).count() as u32;
            for (index, &statistic) in self.statistics.iter().enumerate() {
                block.quantities::<R>(statistic, &mut values);
                let scales = &self.columns.columns[(SCALE_COLUMN + index) * self.columns.stride + first..];
                for (value, scale) in values.iter_mut().zip(scales) {
                    *value *= scale;
                }
                let of_block = Partial { faster, ..of_block(&values, &sound, first as u32) };
                found[index] = merge(found[index], of_block);
            }
        }
        found
    }
}

/// The angular momenta of a workgroup's rows.
struct MomentumBlock<'a> {
    columns: &'a Columns<f64>,
    m: &'a [[f64; WORKGROUP]; 3],
    first: usize,
}

impl MomentumBlock<'_> {
    /// A quantity of all rows, in their own scales.
    #[inline(always)]
    fn quantities<R: Real<Scalar = f64>>(&self, statistic: Statistic, values: &mut [f64; WORKGROUP]) {
        for offset in (0..WORKGROUP).step_by(R::LANES) {
            let column =
                |column: usize| R::load(&self.columns.columns[column * self.columns.stride + self.first + offset..]);
            let inverse_moments = Vector::new(column(0), column(1), column(2));
            let own = |axis: usize| R::load(&self.m[axis][offset..]);
            let m = without_axis(inverse_moments, Vector::new(own(0), own(1), own(2)));
            quantity(statistic, inverse_moments, m).store(&mut values[offset..]);
        }
    }
}

/// The statistics, in two passes, of those values of one workgroup for which `sound` is 1 and not 0.
#[inline(always)]
fn of_block(values: &[f64; WORKGROUP], sound: &[f64; WORKGROUP], first: u32) -> Partial<f64> {
    let count = tree_sum(*sound);
    if count == 0.0 {
        return Partial::none();
    }
    let mean = tree_sum(std::array::from_fn(|row| values[row] * sound[row])) / count;
    let squares = tree_sum(std::array::from_fn(|row| {
        let deviation = (values[row] - mean) * sound[row];
        deviation * deviation
    }));
    let (mut least, mut greatest) = (usize::MAX, usize::MAX);
    for row in 0..WORKGROUP {
        if sound[row] > 0.0 {
            if least == usize::MAX || values[row] < values[least] {
                least = row;
            }
            if greatest == usize::MAX || values[greatest] < values[row] {
                greatest = row;
            }
        }
    }
    let extreme = |row: usize| Extreme { mantissa: values[row], exponent: 0, body: first + row as u32 };
    Partial {
        count: count as u32,
        faster: 0,
        exponent: 0,
        mean,
        residue: 0.0,
        squares,
        least: extreme(least),
        greatest: extreme(greatest),
    }
}

/// The pairwise sum of all values.
#[inline(always)]
fn tree_sum(mut values: [f64; WORKGROUP]) -> f64 {
    let mut half = WORKGROUP / 2;
    while half > 0 {
        for row in 0..half {
            values[row] += values[row + half];
        }
        half /= 2;
    }
    values[0]
}

/// The methods by which a session reports its bodies, whose columns are in the field of that name.
macro_rules! bodies_in {
    ($columns:ident) => {
        fn body_count(&self) -> usize {
            self.$columns.body_count
        }

        fn read(&mut self, bodies: std::ops::Range<usize>) -> Result<StateWords> {
            Ok(self.$columns.read(bodies))
        }

        fn read_rows(&mut self, rows: &[usize]) -> Result<StateWords> {
            Ok($crate::engine::cpu::observe::read_rows(&self.$columns, rows))
        }

        fn watch(
            &mut self,
            statistics: &[$crate::kernel::observe::Statistic],
            frames: &[$crate::bodies::BodyFrame],
            blocks: &$crate::engine::reduction::BlockRows,
            fastest: f64,
        ) -> Result<()> {
            self.reducer = Some(Reducer::new(self.width, statistics, frames, blocks, fastest));
            Ok(())
        }

        fn reduce(&mut self) -> Result<Vec<Vec<$crate::kernel::observe::Partial<f64>>>> {
            Ok(self.reducer.as_ref().map(|reducer| reducer.reduce(&self.$columns)).unwrap_or_default())
        }

        fn marked(&mut self) -> Result<$crate::engine::reduction::Marked> {
            Ok(self.reducer.as_ref().map(|reducer| reducer.marked(&self.$columns)).unwrap_or_default())
        }
    };
}

pub(super) use bodies_in;
