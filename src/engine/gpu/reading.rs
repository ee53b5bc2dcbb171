//! Columns on the device brought to the host, block by block.

use std::ops::Range;

use glam::DVec3;

use super::buffers::{Columns, DeviceScalar, Place, buffer};
use super::device::Device;
use crate::bodies::Status;
use crate::bodies::columns::{STATE_COMPONENTS, StateWords, state_columns, status_column};
use crate::error::Result;
use crate::math::real::Scalar;
use crate::torque::force::carried::CENTRE_COMPONENTS;

impl Columns {
    /// The raw state of a range of bodies, through the staging buffer block by block.
    pub fn read<T: DeviceScalar>(&mut self, device: &Device, bodies: Range<usize>) -> Result<StateWords> {
        let mut words = StateWords::default();
        words.value.reserve_exact(bodies.len());
        words.residue.reserve_exact(bodies.len());
        words.status.reserve_exact(bodies.len());
        let Some(staging) = &self.staging else { return Ok(words) };
        let block = staging.size() as usize / (state_columns::<T>() * size_of::<T>());
        for chunk in &self.chunks {
            let start = bodies.start.max(chunk.first);
            let end = bodies.end.min(chunk.first + chunk.bodies);
            for first in (start..end.max(start)).step_by(block) {
                let rows = first - chunk.first..block.min(end - first) + first - chunk.first;
                self.bytes_read += read_block::<T>(device, &chunk.state, chunk.stride, staging, rows, &mut words)?;
            }
        }
        Ok(words)
    }

    /// Positions (m) and velocities (m/s) of a range of bodies, where their columns stand behind those of the state.
    pub fn read_centres<T: DeviceScalar>(
        &mut self,
        device: &Device,
        bodies: Range<usize>,
    ) -> Result<Vec<(DVec3, DVec3)>> {
        let mut centres = Vec::with_capacity(bodies.len());
        let Some(staging) = &self.staging else { return Ok(centres) };
        let columns = state_columns::<T>()..state_columns::<T>() + CENTRE_COMPONENTS * T::WORDS;
        let block = staging.size() as usize / (columns.len() * size_of::<T>());
        for chunk in &self.chunks {
            let start = bodies.start.max(chunk.first);
            let end = bodies.end.min(chunk.first + chunk.bodies);
            for first in (start..end.max(start)).step_by(block) {
                let rows = first - chunk.first..block.min(end - first) + first - chunk.first;
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
                self.bytes_read +=
                    read_columns(device, &chunk.state, chunk.stride, staging, (columns.clone(), rows), read)?;
            }
        }
        Ok(centres)
    }
}

/// Copies some rows of a chunk's state to the host and appends them to `words`; gives the bytes moved.
pub(super) fn read_block<T: Scalar>(
    device: &Device,
    state: &wgpu::Buffer,
    stride: usize,
    staging: &wgpu::Buffer,
    rows: Range<usize>,
    words: &mut StateWords,
) -> Result<u64> {
    read_columns(device, state, stride, staging, (0..state_columns::<T>(), rows.clone()), |numbers: &[T]| {
        append_words(numbers, rows.len(), words);
    })
}

/// Copies some rows of some columns to the host and shows them to `look`, column after column; gives the bytes moved.
pub(super) fn read_columns<T: bytemuck::Pod>(
    device: &Device,
    source: &wgpu::Buffer,
    stride: usize,
    staging: &wgpu::Buffer,
    (columns, rows): (Range<usize>, Range<usize>),
    look: impl FnOnce(&[T]),
) -> Result<u64> {
    let size = size_of::<T>();
    let bytes = (rows.len() * size) as u64;
    let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("read") });
    for (index, column) in columns.clone().enumerate() {
        let from = ((column * stride + rows.start) * size) as u64;
        encoder.copy_buffer_to_buffer(source, from, staging, index as u64 * bytes, bytes);
    }
    let all = columns.len() as u64 * bytes;
    let commands = device.scoped(|| encoder.finish()).map_err(|refusal| device.refused(refusal))?;
    device.read(commands, staging, 0..all, |view| look(bytemuck::cast_slice(view)))?;
    Ok(all)
}

/// Copies single rows, each after the other, to the host; gives their state and the bytes moved.
pub(super) fn read_single_rows<T: Scalar>(
    device: &Device,
    places: &[Place<'_>],
    rows: &[usize],
) -> Result<(StateWords, u64)> {
    let mut words = StateWords::default();
    if rows.is_empty() {
        return Ok((words, 0));
    }
    let (size, count) = (size_of::<T>() as u64, rows.len() as u64);
    let bytes = state_columns::<T>() as u64 * count * size;
    let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let staging = buffer(device, "rows", bytes, usage).map_err(|refusal| device.refused(refusal))?;
    let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("rows") });
    for (index, &row) in rows.iter().enumerate() {
        // Chunks are in the order of their bodies.
        let place = &places[places.partition_point(|place| place.first + place.bodies <= row)];
        for column in 0..state_columns::<T>() {
            let from = (column * place.stride + row - place.first) as u64 * size;
            let to = (column as u64 * count + index as u64) * size;
            encoder.copy_buffer_to_buffer(place.state, from, &staging, to, size);
        }
    }
    let commands = device.scoped(|| encoder.finish()).map_err(|refusal| device.refused(refusal))?;
    let look = |view: &[u8]| append_words::<T>(bytemuck::cast_slice(view), rows.len(), &mut words);
    let read = device.read(commands, &staging, 0..bytes, look);
    staging.destroy();
    read.map(|()| (words, bytes))
}

/// Appends the state of `count` bodies, by column, to `words`.
fn append_words<T: Scalar>(numbers: &[T], count: usize, words: &mut StateWords) {
    let at = |row: usize, first: usize| -> [f64; STATE_COMPONENTS] {
        std::array::from_fn(|component| numbers[(first + component) * count + row].to_f64())
    };
    for row in 0..count {
        words.value.push(at(row, 0));
        words.residue.push(if T::WORDS == 2 { at(row, STATE_COMPONENTS) } else { [0.0; STATE_COMPONENTS] });
        words.status.push(Status::from_code(numbers[status_column::<T>() * count + row].to_f64()));
    }
}
