//! A GPU with the CPU beside it: each kind of work runs where it is faster, or where it can run at all.

use super::batch::AnyBatch;
use super::cpu::Cpu;
use super::gpu::Gpu;
use super::{Backend, Description, Link, Session, Traffic};
use crate::error::Result;
use crate::kernel::free_motion::AnyRows;
use crate::kernel::method::Method;
use crate::math::{Precision, Width};
use crate::scene::AdaptiveSteps;
use crate::torque::force::carried::Carried;

/// A GPU, and the CPU for the arithmetic that the GPU lacks or is slower in. Taylor series are formed on the CPU.
#[derive(Debug)]
pub(super) struct Paired {
    gpu: Gpu,
    cpu: Cpu,
    /// Whether work in `f32` and `f64` runs on the CPU, and why.
    on_host: [Option<String>; 2],
}

impl Paired {
    pub fn new(gpu: Gpu) -> Self {
        let cpu = Cpu::new(Width::Lanes);
        let on_host = Precision::ALL.map(|precision| {
            if !gpu.precisions().contains(&precision) {
                return Some(format!("{precision} on the CPU, as the adapter cannot compute in it"));
            }
            if let Some(asked) = &gpu.options().on_host {
                return asked.contains(&precision).then(|| format!("{precision} on the CPU, as asked for"));
            }
            let [of_gpu, of_cpu] = [gpu.speed(precision)?, cpu.speed(precision)?];
            (of_gpu < of_cpu).then(|| {
                format!("{precision} on the CPU, as the adapter does as much in it as {of_gpu:.1} of {of_cpu} threads")
            })
        });
        Self { gpu, cpu, on_host }
    }

    /// The engine on which work in a precision runs.
    fn place(&self, precision: Precision) -> &dyn Backend {
        let is_on_host = self.on_host[usize::from(precision == Precision::F64)].is_some();
        if is_on_host { &self.cpu } else { &self.gpu }
    }
}

impl Backend for Paired {
    fn description(&self) -> Description {
        let notes: Vec<&str> = self.on_host.iter().flatten().map(String::as_str).collect();
        let on_host = (!notes.is_empty()).then(|| notes.join("; "));
        Description { on_host, ..self.gpu.description() }
    }

    fn precisions(&self) -> &[Precision] {
        &Precision::ALL
    }

    fn runs_shaders(&self, precision: Precision) -> bool {
        self.place(precision).runs_shaders(precision)
    }

    fn speed(&self, precision: Precision) -> Option<f64> {
        self.place(precision).speed(precision)
    }

    fn link(&self) -> Option<Link> {
        self.gpu.link()
    }

    fn speed_of_series(&self) -> Option<f64> {
        self.cpu.speed_of_series()
    }

    fn start(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        self.place(batch.precision()).start(batch, method)
    }

    fn start_projected(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        self.place(Precision::F64).start_projected(batch, method)
    }

    fn start_free(&self, rows: AnyRows) -> Result<Box<dyn Session>> {
        self.place(rows.precision()).start_free(rows)
    }

    fn start_adaptive(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Session>> {
        self.place(batch.precision()).start_adaptive(batch, steps)
    }

    fn start_dense_taylor(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Session>> {
        self.cpu.start_dense_taylor(batch, steps)
    }

    fn start_taylor(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Session>> {
        self.cpu.start_taylor(batch, steps)
    }

    fn start_tapped(&self, batch: AnyBatch, method: Method) -> Result<Option<Box<dyn Session>>> {
        self.place(batch.precision()).start_tapped(batch, method)
    }

    fn start_adaptive_tapped(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Option<Box<dyn Session>>> {
        self.place(batch.precision()).start_adaptive_tapped(batch, steps)
    }

    /// Only if all work runs on the GPU: the caller asks before it knows the precision of a batch.
    fn carries_centres(&self) -> bool {
        self.on_host.iter().all(Option::is_none) && self.gpu.carries_centres()
    }

    fn start_carrying(
        &self,
        batch: AnyBatch,
        method: Method,
        centres: &[Carried],
        parts: u32,
    ) -> Result<Box<dyn Session>> {
        self.gpu.start_carrying(batch, method, centres, parts)
    }

    fn traffic(&self) -> Traffic {
        self.gpu.traffic()
    }
}
