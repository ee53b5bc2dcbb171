//! Bodies that take single steps of `rk8` from states that the caller gives, each at its own time: for finding a time
//! between two outputs.

use std::ops::Range;

use super::CpuAdaptiveSession;
use crate::bodies::columns::{RATE_COLUMN, STATE_COMPONENTS, status_column};
use crate::bodies::{BodyFrame, Ensemble, Members, Status};
use crate::engine::Session;
use crate::engine::batch::{AnyBatch, prepare_members};
use crate::engine::controlled::{Controls, Written};
use crate::error::Result;
use crate::kernel::method::rk8_adaptive::Controller;
use crate::math::vector::TwoWords;
use crate::math::{Precision, Width};
use crate::scene::AdaptiveSteps;
use crate::torque::Torque;

/// Some bodies under torques between two times, in `f64`.
pub(crate) struct Trials {
    session: CpuAdaptiveSession<f64>,
    frames: Vec<BodyFrame>,
    controllers: Vec<Controller<f64>>,
    /// The values that sampled torques hold for them at the start of the scene.
    controls: Option<Controls>,
    /// The range of times of the steps, s.
    span: Range<f64>,
}

impl Trials {
    /// Bodies of an ensemble that is followed for `end` seconds; the caller must set their states. `tolerance` holds
    /// for each step.
    pub fn new(
        ensemble: &Ensemble,
        torques: &[Torque],
        end: f64,
        members: &Members,
        span: Range<f64>,
        tolerance: f64,
    ) -> Result<Self> {
        let (frames, batch) = prepare_members(ensemble, torques, end, members, Precision::F64)?;
        let mut batch = batch;
        let controls = Controls::start(torques, &mut batch, &frames, |row| members.body(row));
        let AnyBatch::F64(mut batch) = batch else { unreachable!("columns in f64 were asked for") };
        let clock = batch.torques.clock().at(span.start);
        batch.torques.start_at(clock);
        let controllers = vec![Controller::new(); batch.body_count];
        // A jump of a torque takes steps as short as times are known.
        let least_step = Some(f64::EPSILON * (span.end - span.start));
        let session = CpuAdaptiveSession::new(batch, AdaptiveSteps { tolerance, least_step }, Width::Lanes);
        Ok(Self { session, frames, controllers, controls, span })
    }

    /// The frame that converts the scaled state of a body to the user's axes, at the start of the scene.
    pub fn frame(&self, row: usize) -> &BodyFrame {
        &self.frames[row]
    }

    /// The values that sampled torques hold for a body, taken over from `before`.
    pub fn controls(&self, row: usize, before: Controls) -> Option<Controls> {
        let mut own = self.controls.as_ref()?.of_row(row);
        own.adopt(before);
        Some(own)
    }

    /// Writes the values that sampled torques hold for a body into its columns.
    pub fn hold(&mut self, row: usize, written: Vec<Written>) {
        for written in written {
            self.session.batch.write_parameters(&Written { first_row: row, ..written });
        }
    }

    /// The scaled state of a body.
    pub fn state(&self, row: usize) -> [f64; STATE_COMPONENTS] {
        let batch = &self.session.batch;
        std::array::from_fn(|component| batch.state[component * batch.stride + row])
    }

    /// Puts a body into a scaled state.
    pub fn set_state(&mut self, row: usize, state: &[f64; STATE_COMPONENTS]) {
        let batch = &mut self.session.batch;
        for (component, number) in state.iter().enumerate() {
            batch.state[component * batch.stride + row] = *number;
        }
        batch.state[status_column::<f64>() * batch.stride + row] = Status::Valid.code();
    }

    /// Lets the body's next attempt begin at `time`, s, with a step of `step` seconds, or with a size of its own choice
    /// if `step` is 0.
    pub fn set_step(&mut self, row: usize, time: f64, step: f64) {
        let rate = self.rate(row);
        // Twice the span, so that no step is the last one, which would be stretched to its end.
        let span = 2.0 * (self.span.end - self.span.start);
        let left = TwoWords { value: (span - (time - self.span.start)) * rate, residue: 0.0 };
        self.controllers[row] = Controller { step: step * rate, left, ..Controller::new() };
    }

    /// Lets the body rest in the next attempts.
    pub fn rest(&mut self, row: usize) {
        self.controllers[row] = Controller::new();
    }

    /// One attempt of every body that does not rest.
    pub fn attempt(&mut self) -> Result<()> {
        let end = self.span.start + 2.0 * (self.span.end - self.span.start);
        self.session.attempt(end, &mut self.controllers)
    }

    /// Whether the last attempt of a body was accepted, and the step that it would try next, s; `None` if the body was
    /// flagged.
    pub fn outcome(&self, row: usize) -> Option<(bool, f64)> {
        let batch = &self.session.batch;
        let status = batch.state[status_column::<f64>() * batch.stride + row];
        let Controller { step, accepted, .. } = self.controllers[row];
        (status == Status::Valid.code()).then_some((accepted > 0.0, step / self.rate(row)))
    }

    fn rate(&self, row: usize) -> f64 {
        let batch = &self.session.batch;
        batch.parameters[RATE_COLUMN * batch.stride + row]
    }
}
