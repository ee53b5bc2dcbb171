//! A GPU whose clocks are up when it is timed.
//!
//! A GPU lowers its clocks within some tenths of a second without work, on an H100 from 1980 to 345 MHz, and raises them again only after
//! some tenths of a second of continuous work. A case is made ready on the host for about that time.

use std::time::Instant;

use super::ceiling::{WARM_UP, open};
use crate::engine::gpu::{Device, rates};
use crate::engine::{Description, EngineKind};
use crate::error::Result;

/// The device of the cases, opened once more to be warmed up. The CPU and software adapters need no warming up.
#[derive(Debug)]
pub(super) struct Warm {
    adapter: String,
    device: Option<Device>,
    /// The best rate of a device with its clocks up, operations/s.
    best: Option<f64>,
}

/// The part of the best rate at which a device counts as warm.
const NEARLY: f64 = 0.9;

impl Warm {
    /// For the device with this description.
    pub fn new(description: &Description) -> Result<Self> {
        let is_real = description.kind == EngineKind::Gpu && !description.software;
        let device = is_real.then(|| pollster::block_on(open(description))).transpose()?;
        Ok(Self { adapter: description.name.clone(), device, best: None })
    }

    /// Whether it is for the device with this description.
    pub fn is_for(&self, description: &Description) -> bool {
        self.adapter == description.name
    }

    /// Gives the device work until its clocks are up.
    pub fn up(&mut self) -> Result<()> {
        let Some(device) = &self.device else { return Ok(()) };
        let clock = Instant::now();
        let best = self.best;
        let reached = rates::warm_up(device, |rate| {
            best.is_some_and(|best| rate >= NEARLY * best) || clock.elapsed() >= WARM_UP
        })?;
        self.best = Some(best.map_or(reached, |best| best.max(reached)));
        Ok(())
    }
}
