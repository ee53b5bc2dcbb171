//! Reads columns from the device, block by block: while one is unpacked, the next is in transfer.

use std::ops::Range;

use glam::DVec3;

use super::buffers::{DeviceScalar, Place, STAGING, STAGING_BYTES, buffer};
use super::device::{Device, Refusal, Request};
use super::session::DeviceChunk;
use crate::bodies::Status;
use crate::bodies::columns::{STATE_COMPONENTS, STRIDE_UNIT, StateWords, state_columns, status_column};
use crate::error::Result;
use crate::math::parallel;
use crate::math::real::Scalar;
use crate::torque::force::carried::CENTRE_COMPONENTS;

/// Two buffers through which a session's columns are read.
pub(super) struct Reader {
    staging: [wgpu::Buffer; 2],
    /// The buffer that the next request uses.
    turn: usize,
    /// A request that was made ahead, and the bodies whose states it reads.
    ahead: Option<(Range<usize>, Request)>,
}

impl Reader {
    /// For a session of `bodies` bodies, from which at least `least` bytes can be read at a time.
    pub fn new<T: Scalar>(device: &Device, bodies: usize, least: u64) -> Result<Self, Refusal> {
        let row = state_columns::<T>() * size_of::<T>();
        // Rows are staged in multiples of the unit, and no more than there are.
        let rows = (STAGING_BYTES / row / STRIDE_UNIT * STRIDE_UNIT).min(bodies.next_multiple_of(STRIDE_UNIT));
        let staging = || buffer(device, "staging", ((rows * row) as u64).max(least), STAGING);
        Ok(Self { staging: [staging()?, staging()?], turn: 0, ahead: None })
    }

    /// The buffer for a read without a request; drops a request made ahead.
    pub fn staging(&mut self) -> &wgpu::Buffer {
        self.discard();
        &self.staging[self.turn]
    }

    /// The number of rows of `row_bytes` that are read at a time.
    pub fn block(&self, row_bytes: usize) -> usize {
        self.staging[0].size() as usize / row_bytes
    }

    /// Drops a request made ahead: the state has changed since, or changes now.
    pub fn discard(&mut self) {
        if let Some((_, request)) = self.ahead.take() {
            request.cancel();
        }
    }

    /// Requests the state of bodies ahead of [`Reader::read`].
    pub fn prefetch<T: Scalar>(&mut self, device: &Device, places: &[Place<'_>], bodies: &Range<usize>) -> Result<()> {
        self.discard();
        if let Some(piece) = self.piece::<T>(places, bodies) {
            self.ahead = Some((piece.clone(), self.request::<T>(device, places, &piece)?));
        }
        Ok(())
    }

    /// The state of a range of bodies.
    pub fn read<T: DeviceScalar>(
        &mut self,
        device: &Device,
        places: &[Place<'_>],
        bodies: Range<usize>,
    ) -> Result<StateWords> {
        let mut words = StateWords::default();
        words.value.reserve_exact(bodies.len());
        words.residue.reserve_exact(if T::WORDS == 2 { bodies.len() } else { 0 });
        words.status.reserve_exact(bodies.len());
        let mut next = self.piece::<T>(places, &bodies);
        while let Some(piece) = next {
            let request = match self.ahead.take() {
                Some((ahead, request)) if ahead == piece => request,
                stale => {
                    self.ahead = stale;
                    self.discard();
                    self.request::<T>(device, places, &piece)?
                }
            };
            next = self.piece::<T>(places, &(piece.end..bodies.end));
            if let Some(next) = &next {
                self.ahead = Some((next.clone(), self.request::<T>(device, places, next)?));
            }
            device.fulfil(request, |view| append_words::<T>(bytemuck::cast_slice(view), piece.len(), &mut words))?;
        }
        Ok(words)
    }

    /// The first of some bodies, as many as are in one place and fit.
    fn piece<T: Scalar>(&self, places: &[Place<'_>], bodies: &Range<usize>) -> Option<Range<usize>> {
        let place = places.iter().find(|place| bodies.start < place.first + place.bodies)?;
        let end = bodies.end.min(place.first + place.bodies);
        let block = self.block(state_columns::<T>() * size_of::<T>());
        (bodies.start < end).then(|| bodies.start..end.min(bodies.start + block))
    }

    fn request<T: Scalar>(&mut self, device: &Device, places: &[Place<'_>], piece: &Range<usize>) -> Result<Request> {
        let place = &places[places.partition_point(|place| place.first + place.bodies <= piece.start)];
        let rows = piece.start - place.first..piece.end - place.first;
        let columns = (0..state_columns::<T>(), rows);
        let request = request_columns::<T>(device, place.state, place.stride, &self.staging[self.turn], columns);
        self.turn = 1 - self.turn;
        request
    }

    /// Positions (m) and velocities (m/s) of a range of bodies, if their columns follow those of the state.
    pub fn read_centres<T: DeviceScalar>(
        &mut self,
        device: &Device,
        places: &[Place<'_>],
        bodies: Range<usize>,
    ) -> Result<Vec<(DVec3, DVec3)>> {
        let mut centres = Vec::with_capacity(bodies.len());
        let columns = state_columns::<T>()..state_columns::<T>() + CENTRE_COMPONENTS * T::WORDS;
        let block = self.block(columns.len() * size_of::<T>());
        for place in places {
            let rows = place.rows(&bodies);
            for first in rows.clone().step_by(block) {
                let rows = first..(first + block).min(rows.end);
                let count = rows.len();
                let read = |numbers: &[T]| {
                    let number = |column: usize, row: usize| numbers[column * count + row].to_f64();
                    let words = |column: usize, row: usize| {
                        let residue = if T::WORDS == 2 { number(CENTRE_COMPONENTS + column, row) } else { 0.0 };
                        number(column, row) + residue
                    };
                    let vector =
                        |first: usize, row: usize| DVec3::from_array([0, 1, 2].map(|axis| words(first + axis, row)));
                    centres.extend((0..count).map(|row| (vector(0, row), vector(3, row))));
                };
                read_columns(device, place.state, place.stride, self.staging(), (columns.clone(), rows), read)?;
            }
        }
        Ok(centres)
    }

    /// Frees the memory.
    pub fn release(&mut self) {
        self.discard();
        self.staging.iter().for_each(wgpu::Buffer::destroy);
    }
}

/// Requests some rows of some columns, column after column.
fn request_columns<T>(
    device: &Device,
    source: &wgpu::Buffer,
    stride: usize,
    staging: &wgpu::Buffer,
    (columns, rows): (Range<usize>, Range<usize>),
) -> Result<Request> {
    let size = size_of::<T>();
    let bytes = (rows.len() * size) as u64;
    let commands = device.encoded("read", |encoder| {
        for (index, column) in columns.clone().enumerate() {
            let from = ((column * stride + rows.start) * size) as u64;
            encoder.copy_buffer_to_buffer(source, from, staging, index as u64 * bytes, bytes);
        }
    })?;
    device.request(commands, staging, 0..columns.len() as u64 * bytes)
}

/// Copies some rows of some columns to the host and passes them to `look`, column after column.
pub(super) fn read_columns<T: bytemuck::Pod>(
    device: &Device,
    source: &wgpu::Buffer,
    stride: usize,
    staging: &wgpu::Buffer,
    place: (Range<usize>, Range<usize>),
    look: impl FnOnce(&[T]),
) -> Result<()> {
    let request = request_columns::<T>(device, source, stride, staging, place)?;
    device.fulfil(request, |view| look(bytemuck::cast_slice(view)))
}

/// Moves some rows, ascending, of all columns of a buffer to the front, in their order, by way of the host; `of` is the
/// number of rows with bodies. The rows after them do not change.
pub(super) fn keep_rows<T: bytemuck::Pod>(
    device: &Device,
    source: &wgpu::Buffer,
    (stride, of): (usize, usize),
    staging: &wgpu::Buffer,
    rows: &[usize],
) -> Result<()> {
    let columns = source.size() as usize / (stride * size_of::<T>());
    // The staging buffer holds at least one column of a chunk.
    let together = (staging.size() as usize / (of * size_of::<T>())).max(1);
    for first in (0..columns).step_by(together) {
        let some = first..(first + together).min(columns);
        let mut kept: Vec<T> = Vec::with_capacity(some.len() * rows.len());
        read_columns(device, source, stride, staging, (some.clone(), 0..of), |numbers: &[T]| {
            kept.extend(numbers.chunks_exact(of).flat_map(|column| rows.iter().map(|&row| column[row])));
        })?;
        device.checked(|| {
            for (column, numbers) in some.clone().zip(kept.chunks_exact(rows.len())) {
                device.write(source, (column * stride * size_of::<T>()) as u64, bytemuck::cast_slice(numbers));
            }
        })?;
    }
    Ok(())
}

/// Keeps only some bodies of a session, ascending; chunks without any are freed.
pub(super) fn keep_bodies<T: DeviceScalar, C: DeviceChunk>(
    device: &Device,
    reader: &mut Reader,
    chunks: &mut Vec<C>,
    bodies: &[usize],
) -> Result<()> {
    let (mut kept, mut done) = (0, Ok(()));
    chunks.retain_mut(|chunk| {
        let Place { first, bodies: count, .. } = chunk.place();
        let among = |body: usize| bodies.partition_point(|&other| other < body);
        let rows: Vec<usize> = bodies[among(first)..among(first + count)].iter().map(|body| body - first).collect();
        if rows.is_empty() {
            chunk.destroy();
            return false;
        }
        if done.is_ok() && rows.len() < count {
            done = chunk.move_rows::<T>(device, reader, &rows);
        }
        chunk.set_bodies(kept..kept + rows.len());
        kept += rows.len();
        true
    });
    done
}

/// Copies single rows, one after the other, to the host; returns their state.
pub(super) fn read_single_rows<T: Scalar>(device: &Device, places: &[Place<'_>], rows: &[usize]) -> Result<StateWords> {
    let mut words = StateWords::default();
    if rows.is_empty() {
        return Ok(words);
    }
    let (size, count) = (size_of::<T>() as u64, rows.len() as u64);
    let bytes = state_columns::<T>() as u64 * count * size;
    let staging = buffer(device, "rows", bytes, STAGING).map_err(|refusal| device.refused(refusal))?;
    let commands = device.encoded("rows", |encoder| {
        for (index, &row) in rows.iter().enumerate() {
            // Chunks are in the order of their bodies.
            let place = &places[places.partition_point(|place| place.first + place.bodies <= row)];
            for column in 0..state_columns::<T>() {
                let from = (column * place.stride + row - place.first) as u64 * size;
                let to = (column as u64 * count + index as u64) * size;
                encoder.copy_buffer_to_buffer(place.state, from, &staging, to, size);
            }
        }
    })?;
    let look = |view: &[u8]| append_words::<T>(bytemuck::cast_slice(view), rows.len(), &mut words);
    let read = device.read(commands, &staging, 0..bytes, look);
    staging.destroy();
    read.map(|()| words)
}

/// Rows that one thread unpacks at a time.
const ROWS_OF_A_THREAD: usize = 4096;

/// Appends the state of `count` bodies, by column, to `words`.
fn append_words<T: Scalar>(numbers: &[T], count: usize, words: &mut StateWords) {
    let at = |row: usize, first: usize| -> [f64; STATE_COMPONENTS] {
        std::array::from_fn(|component| numbers[(first + component) * count + row].to_f64())
    };
    parallel::extend_by_rows(&mut words.value, count, ROWS_OF_A_THREAD, &|row| at(row, 0));
    if T::WORDS == 2 {
        parallel::extend_by_rows(&mut words.residue, count, ROWS_OF_A_THREAD, &|row| at(row, STATE_COMPONENTS));
    }
    let status = |row: usize| Status::from_code(numbers[status_column::<T>() * count + row].to_f64());
    parallel::extend_by_rows(&mut words.status, count, ROWS_OF_A_THREAD, &status);
}
