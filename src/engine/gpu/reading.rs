//! States on their way from the device to the host.

use std::ops::Range;

use super::buffers::{Place, buffer};
use super::device::Device;
use crate::batch::{STATE_COMPONENTS, StateWords, state_columns, status_column};
use crate::error::Result;
use crate::method::Status;
use crate::real::Scalar;

/// Copies some rows of a chunk's state to the host and appends them to `words`; gives the bytes moved.
pub(super) fn read_block<T: Scalar>(
    device: &Device,
    state: &wgpu::Buffer,
    stride: usize,
    staging: &wgpu::Buffer,
    rows: Range<usize>,
    words: &mut StateWords,
) -> Result<u64> {
    let size = size_of::<T>();
    let bytes = (rows.len() * size) as u64;
    let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("read") });
    for column in 0..state_columns::<T>() {
        let from = ((column * stride + rows.start) * size) as u64;
        encoder.copy_buffer_to_buffer(state, from, staging, column as u64 * bytes, bytes);
    }
    let range = 0..state_columns::<T>() as u64 * bytes;
    let commands = device.scoped(|| encoder.finish()).map_err(|refusal| device.refused(refusal))?;
    device.read(commands, staging, range, |view| append_words::<T>(bytemuck::cast_slice(view), rows.len(), words))?;
    Ok(state_columns::<T>() as u64 * bytes)
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
