//! Brings an ensemble's bodies into their principal axes, scales them and writes them as columns.

use std::ops::Range;

use glam::{DMat3, DQuat};

use super::{AnyBatch, Batch};
use crate::bodies::Ensemble;
use crate::bodies::blocks::cut;
use crate::bodies::columns::{
    ColumnPart, STATE_COMPONENTS, STRIDE_UNIT, column_parts, parameter_columns, state_columns, store_row, stride_of,
};
use crate::bodies::inertia::principal_axes;
use crate::bodies::memory;
use crate::bodies::{BodyFrame, Members};
use crate::engine::EngineKind;
use crate::error::Result;
use crate::math::Precision;
use crate::math::parallel;
use crate::math::real::Scalar;
use crate::torque::{self, Bodies, Torque, TorqueTable};

/// A body at the start.
pub(crate) struct Prepared {
    /// Its frame.
    pub frame: BodyFrame,
    /// The rate, rad/s, to which torques bring it ([`torque::rate_of`]).
    pub driven_rate: f64,
    /// Its initial state in its frame.
    pub initial: [f64; STATE_COMPONENTS],
}

fn prepare_body(ensemble: &Ensemble, torques: &[Torque], span: f64, body: usize) -> Prepared {
    let (frame, driven_rate) = frame_of(ensemble, torques, span, body);
    Prepared { frame, driven_rate, initial: frame.initial(ensemble, body) }
}

/// The frame of one body at the start of a motion of `span` seconds, and the rate, rad/s, to which torques bring the body. As torques that are
/// weak at the start may grow, a driven body has a unit of time that is not longer than the span.
pub(crate) fn frame_of(ensemble: &Ensemble, torques: &[Torque], span: f64, body: usize) -> (BodyFrame, f64) {
    let least = if torques.is_empty() || span <= 0.0 { 0.0 } else { span.recip() };
    let mut driven_rate = 0.0;
    let frame = BodyFrame::of_body(ensemble, body, |middle_moment| {
        driven_rate = torque::rate_of(torques, body, middle_moment);
        least.max(driven_rate)
    });
    (frame, driven_rate)
}

/// Brings an ensemble without torques into principal axes and scales it, in `f64`, and writes it as columns of
/// `precision`.
///
/// # Errors
///
/// [`crate::Error::TooManyBodies`] where the memory does not suffice.
pub fn prepare(ensemble: &Ensemble, precision: Precision) -> Result<(Vec<BodyFrame>, AnyBatch)> {
    prepare_with(ensemble, &[], 0.0, precision)
}

/// As [`prepare`], with torques that act over a span of `span` seconds. The torques' parameters must be valid.
pub fn prepare_with(
    ensemble: &Ensemble,
    torques: &[Torque],
    span: f64,
    precision: Precision,
) -> Result<(Vec<BodyFrame>, AnyBatch)> {
    prepare_members(ensemble, torques, span, &Members::All(ensemble.len()), precision)
}

/// As [`prepare_with`], for some bodies of the ensemble, one for each row. A body's row does not depend on the others.
pub fn prepare_members(
    ensemble: &Ensemble,
    torques: &[Torque],
    span: f64,
    members: &Members,
    precision: Precision,
) -> Result<(Vec<BodyFrame>, AnyBatch)> {
    prepare_acting(ensemble, torques, torques, span, members, precision)
}

/// As [`prepare_members`], in the units that follow from `torques`, while the torques of `acting` act.
pub(crate) fn prepare_acting(
    ensemble: &Ensemble,
    torques: &[Torque],
    acting: &[Torque],
    span: f64,
    members: &Members,
    precision: Precision,
) -> Result<(Vec<BodyFrame>, AnyBatch)> {
    let as_they_are = |_: usize, prepared: &[Prepared]| (0..prepared.len()).collect();
    let cuts = cut(members.len(), ordered_together(EngineKind::Cpu), &[]);
    prepare_columns_of(ensemble, (torques, acting), span, members, precision, (&cuts, as_they_are))
}

/// The most members that are ordered among themselves and read at once: on the host few enough that their states stay
/// in its second-level cache, from a device enough that a transfer takes longer than its start.
pub(crate) fn ordered_together(engine: EngineKind) -> usize {
    match engine {
        EngineKind::Cpu => 1 << 13,
        EngineKind::Gpu => 1 << 15,
    }
}

/// As [`prepare_members`], with the rows of each range of `cuts` of the members in an order of its own: `order` receives the
/// range's first member and its prepared members, and returns the indices among them in the order wanted. Chunks end
/// where ranges do. Frames are in the order of the members.
pub(crate) fn prepare_ordered(
    ensemble: &Ensemble,
    torques: &[Torque],
    span: f64,
    members: &Members,
    precision: Precision,
    (cuts, order): (&[Range<usize>], impl FnMut(usize, &[Prepared]) -> Vec<usize>),
) -> Result<(Vec<BodyFrame>, AnyBatch)> {
    let (frames, mut batch) =
        prepare_columns_of(ensemble, (torques, torques), span, members, precision, (cuts, order))?;
    batch.cut_at(cuts.iter().map(|cut| cut.end).collect());
    Ok((frames, batch))
}

fn prepare_columns_of(
    ensemble: &Ensemble,
    torques: (&[Torque], &[Torque]),
    span: f64,
    members: &Members,
    precision: Precision,
    order: (&[Range<usize>], impl FnMut(usize, &[Prepared]) -> Vec<usize>),
) -> Result<(Vec<BodyFrame>, AnyBatch)> {
    Ok(match precision {
        Precision::F32 => {
            let (frames, batch) = prepare_columns::<f32>(ensemble, torques, span, members, order)?;
            (frames, AnyBatch::F32(batch))
        }
        Precision::F64 => {
            let (frames, batch) = prepare_columns::<f64>(ensemble, torques, span, members, order)?;
            (frames, AnyBatch::F64(batch))
        }
    })
}

/// Bytes that [`prepare`] takes for one body, frames included.
pub fn bytes_per_body(precision: Precision) -> usize {
    let columns = match precision {
        Precision::F32 => (state_columns::<f32>() + parameter_columns::<f32>()) * size_of::<f32>(),
        Precision::F64 => (state_columns::<f64>() + parameter_columns::<f64>()) * size_of::<f64>(),
    };
    columns + size_of::<BodyFrame>()
}

/// Bytes that [`prepare_with`] takes for one body under some torques, frames included.
pub(crate) fn bytes_per_body_under(precision: Precision, torques: &[Torque], span: f64) -> usize {
    let bodies = Bodies { have_linear_rotors: false, axes: None };
    let of_torques = match precision {
        Precision::F32 => torque::bytes_per_body::<f32>(&TorqueTable::new(torques, 0, STRIDE_UNIT, span, bodies)),
        Precision::F64 => torque::bytes_per_body::<f64>(&TorqueTable::new(torques, 0, STRIDE_UNIT, span, bodies)),
    };
    bytes_per_body(precision) + of_torques
}

/// Bodies that one task writes.
const TASK: usize = 512;

/// The rotation from principal to body axes, if all members have the same and it only permutes axes and changes their
/// signs. With any other, constants would be rounded differently from columns, and a body's result would depend on
/// those beside it.
fn shared_axes(ensemble: &Ensemble, members: &Members) -> Option<DQuat> {
    let axes = |row: usize| principal_axes(&ensemble.inertia()[members.body(row)]).principal_to_body;
    let first = (!members.is_empty()).then(|| axes(0))?;
    let is_exact = |axes: DQuat| DMat3::from_quat(axes).to_cols_array().iter().all(|x| [-1.0, 0.0, 1.0].contains(x));
    let differs = || {
        parallel::map_tasks(parallel::pieces(members.len()), |_, rows| rows.into_iter().any(|row| axes(row) != first))
    };
    let is_shared = is_exact(first) && !differs().contains(&true);
    is_shared.then_some(first)
}

/// The columns under the second list of torques, in units that follow from the first.
fn prepare_columns<T: Scalar>(
    ensemble: &Ensemble,
    (of_units, torques): (&[Torque], &[Torque]),
    span: f64,
    members: &Members,
    (cuts, mut order): (&[Range<usize>], impl FnMut(usize, &[Prepared]) -> Vec<usize>),
) -> Result<(Vec<BodyFrame>, Batch<T>)> {
    for (index, torque) in torques.iter().enumerate().filter(|(_, torque)| torque.needs().position) {
        // The scene has replaced positions by functions of time where it can.
        torque.validate(index, ensemble)?;
    }
    let body_count = members.len();
    let has_linear_rotors =
        ensemble.has_linear_rotors() && (0..body_count).any(|row| ensemble.is_linear_rotor(members.body(row)));
    let stride = stride_of(body_count);
    let axes = if torques.iter().any(Torque::is_expressed) { shared_axes(ensemble, members) } else { None };
    let bodies = Bodies { have_linear_rotors: has_linear_rotors, axes };
    let table = TorqueTable::new(torques, parameter_columns::<T>(), stride, span, bodies);
    let row = bytes_per_body(T::PRECISION) + torque::bytes_per_body::<T>(&table);
    memory::require(body_count, body_count.saturating_mul(row), "the columns of the kernels")?;
    let mut batch = Batch::<T>::at_rest_with(body_count, table);
    let coupled = ensemble.translation().filter(|_| batch.torques.is_coupled());
    let (mut frames, mut bodies) = (Vec::with_capacity(body_count), Vec::new());
    for &Range { start, end } in cuts {
        let prepared: Vec<Prepared> = parallel::rows(end - start, parallel::OF_A_STEP, &|row| {
            prepare_body(ensemble, of_units, span, members.body(start + row))
        });
        let order = order(start, &prepared);
        let Batch { parameters, state, torques: table, .. } = &mut batch;
        let layout = &*table;
        let parts = column_parts(parameters, stride, start..end, TASK).into_iter().zip(column_parts(
            state,
            stride,
            start..end,
            TASK,
        ));
        let tasks: Vec<_> = parts.zip(order.chunks(TASK)).collect();
        let write = |((mut parameters, mut state), order): ((ColumnPart<'_, T>, ColumnPart<'_, T>), &[usize])| {
            let (mut memory, mut rates) = (Vec::new(), Vec::new());
            for (row, &place) in order.iter().enumerate() {
                let Prepared { frame, initial, .. } = &prepared[place];
                let store = |column: usize, number: T| parameters[column][row] = number;
                store_row(&frame.parameters(), initial, store, |column, number| state[column][row] = number);
                let orientation = DQuat::from_xyzw(initial[0], initial[1], initial[2], initial[3]);
                let body = members.body(start + place);
                layout.write_body(torques, body, (frame, orientation), (&mut memory, &mut rates), |column, number| {
                    parameters[column][row] = T::from_f64(number)
                });
            }
            rates
        };
        let rates: Vec<Vec<u128>> = parallel::map_tasks(tasks, |_, task| write(task));
        table.set_rates(start, &rates.concat());
        frames.extend(prepared.iter().map(|prepared| prepared.frame));
        if coupled.is_some() {
            bodies.extend(order.iter().map(|&place| members.body(start + place)));
        }
    }
    if let Some(translation) = coupled {
        batch.append_integrated_centres(translation, &bodies);
    }
    Ok((frames, batch))
}
