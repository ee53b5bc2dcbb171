//! A GPU with the CPU beside it: each kind of work runs where it is faster, or where it can run at all.

use super::adaptive_session::AdaptiveSession;
use super::batch::AnyBatch;
use super::cpu::Cpu;
use super::gpu::Gpu;
use super::{Backend, Description, FreeSession, Link, SteppedSession, Traffic};
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

    fn start(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn SteppedSession>> {
        self.place(batch.precision()).start(batch, method)
    }

    fn start_projected(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn SteppedSession>> {
        self.place(Precision::F64).start_projected(batch, method)
    }

    fn start_free(&self, rows: AnyRows) -> Result<Box<dyn FreeSession>> {
        self.place(rows.precision()).start_free(rows)
    }

    fn start_adaptive(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn AdaptiveSession>> {
        self.place(batch.precision()).start_adaptive(batch, steps)
    }

    fn start_taylor(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn AdaptiveSession>> {
        self.cpu.start_taylor(batch, steps)
    }

    fn start_tapped(&self, batch: AnyBatch, method: Method) -> Result<Option<Box<dyn SteppedSession>>> {
        self.place(batch.precision()).start_tapped(batch, method)
    }

    fn start_adaptive_tapped(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Option<Box<dyn AdaptiveSession>>> {
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
    ) -> Result<Box<dyn SteppedSession>> {
        self.gpu.start_carrying(batch, method, centres, parts)
    }

    fn traffic(&self) -> Traffic {
        self.gpu.traffic()
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use glam::{DQuat, DVec3};

    use super::*;
    use crate::engine::Progress;
    use crate::engine::gpu::GpuOptions;
    use crate::record::Memory;
    use crate::run::{run, run_into};
    use crate::scene::Accuracy;
    use crate::torque::Torque;
    use crate::{Ensemble, Error, Plan, Scene};

    /// A software adapter for `f32`, the CPU for `f64`.
    fn paired() -> Paired {
        let options = GpuOptions { software: true, ..GpuOptions::default() };
        let gpu = pollster::block_on(Gpu::open(options)).expect("tests need a Vulkan driver");
        let on_host = [None, Some("f64 on the CPU, as this test has it".to_owned())];
        Paired { gpu, cpu: Cpu::new(Width::Lanes), on_host }
    }

    /// Free bodies, whose closed form is within 1e-5 rad in `f32`, and fast ones under drag, whose angle is too large for that.
    fn scene() -> Scene {
        let is_free = |body: usize| body.is_multiple_of(2);
        let spin = |body: usize| DVec3::new(1.0, 0.5, -0.2) * if is_free(body) { 0.1 } else { 30.0 };
        let bodies = Ensemble::from_fn(200, |body| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, spin(body)));
        let drag: Vec<f64> = (0..200).map(|body| if is_free(body) { 0.0 } else { 1e-3 }).collect();
        Scene::new(bodies.expect("valid"))
            .torque(Torque::linear_drag(drag))
            .until(100.0)
            .accuracy(Accuracy::attitude(1e-5))
    }

    #[test]
    fn classes_run_side_by_side_on_the_gpu_and_the_cpu() {
        let (engine, scene) = (paired(), scene());
        let plan = Plan::new(&scene, &engine).expect("planned");
        assert!(plan.explain().to_string().contains("f64 on the CPU, as this test has it"));
        let mut greatest = Progress { done: 0, total: 1 };
        let mut memory = Memory { keeps_states: true, body_count: 200, ..Memory::default() };
        let trust = run_into(&engine, &plan, &mut memory, &mut |progress| {
            assert!(progress.done >= greatest.done, "{progress:?} after {greatest:?}");
            greatest = progress;
            ControlFlow::Continue(())
        });
        let trust = trust.expect("runs");
        let bodies_in = |precision| -> usize {
            trust.parts.iter().filter(|part| part.precision == precision).map(|part| part.bodies).sum()
        };
        assert_eq!([bodies_in(Precision::F32), bodies_in(Precision::F64)], [100, 100], "{:?}", trust.parts);
        assert!(trust.traffic.dispatches > 0, "{:?}", trust.traffic);
        assert_eq!(greatest.done, greatest.total);
        assert!(trust.recomputed_sample.attitude.p99 <= 1e-5, "{}", trust.recomputed_sample);
        // Results from the CPU beside the GPU have the same bits as those of the CPU alone, under the same plan.
        let [paired, alone] = [&engine as &dyn Backend, &Cpu::new(Width::Lanes)]
            .map(|engine| run(engine, &plan).expect("runs").final_state().clone());
        for body in 0..200 {
            let (q, expected) = (paired.orientation(body), alone.orientation(body));
            if body.is_multiple_of(2) {
                assert!(q.dot(expected).abs() > 1.0 - 1e-10, "body {body}: {q} and {expected}");
            } else {
                assert_eq!(q, expected, "body {body}");
            }
        }
    }

    #[test]
    fn an_interrupt_ends_what_runs_on_both() {
        let (engine, scene) = (paired(), scene());
        let plan = Plan::new(&scene, &engine).expect("planned");
        let mut memory = Memory { keeps_states: true, body_count: 200, ..Memory::default() };
        let stopped = run_into(&engine, &plan, &mut memory, &mut |_| ControlFlow::Break(()));
        assert!(matches!(stopped, Err(Error::Interrupted { .. })), "{:?}", stopped.map(|trust| trust.body_steps));
    }

    #[test]
    fn series_are_formed_on_the_cpu_and_costs_follow_where_work_runs() {
        let engine = paired();
        assert_eq!(engine.speed(Precision::F64), engine.cpu.speed(Precision::F64));
        assert_eq!(engine.speed_of_series(), engine.cpu.speed_of_series());
        let narrow = engine.speed(Precision::F32).expect("measured");
        assert!(narrow > 0.0 && narrow.is_finite(), "{narrow}");
        assert_eq!(engine.speed(Precision::F32), Some(narrow), "measured once");
        assert!(!engine.carries_centres());
    }
}
