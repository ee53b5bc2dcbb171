//! A GPU with the CPU beside it: classes side by side, interrupts, and which of the two costs are those of.

use std::ops::ControlFlow;

use glam::{DQuat, DVec3};
use polhode::engine::gpu::{Gpu, GpuOptions};
use polhode::engine::{Backend, Progress};
use polhode::run::{run, run_into};
use polhode::{Accuracy, Engine, Ensemble, Error, Plan, Precision, Scene, Torque};

use crate::common;
use crate::common::Nowhere;

/// Any adapter for `f32`, the CPU for `f64`.
fn paired() -> Engine {
    let options = GpuOptions { on_host: Some(vec![Precision::F64]), ..common::any_adapter() };
    Engine::paired(pollster::block_on(Gpu::open(options)).expect("tests need a Vulkan driver"))
}

/// Free bodies, whose closed form is within 1e-5 rad in `f32`, and fast ones under drag, whose angle is too large for that.
fn scene() -> Scene {
    let is_free = |body: usize| body.is_multiple_of(2);
    let spin = |body: usize| DVec3::new(1.0, 0.5, -0.2) * if is_free(body) { 0.1 } else { 30.0 };
    let bodies = Ensemble::from_fn(200, |body| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, spin(body)));
    let drag: Vec<f64> = (0..200).map(|body| if is_free(body) { 0.0 } else { 1e-3 }).collect();
    Scene::new(bodies.expect("valid")).torque(Torque::linear_drag(drag)).until(100.0).accuracy(Accuracy::attitude(1e-5))
}

#[test]
fn classes_run_side_by_side_on_the_gpu_and_the_cpu() {
    let (engine, scene) = (paired(), scene());
    let plan = Plan::new(&scene, &engine).expect("planned");
    assert_eq!(engine.description().on_host.as_deref(), Some("f64 on the CPU, as asked for"));
    assert!(plan.explain().to_string().contains("f64 on the CPU, as asked for"));
    let mut greatest = Progress { done: 0, total: 1 };
    let trust = run_into(&engine, &plan, &mut Nowhere, &mut |progress| {
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
    let [paired, alone] =
        [&engine, &Engine::cpu()].map(|engine| run(engine, &plan).expect("runs").final_state().clone());
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
    let stopped = run_into(&engine, &plan, &mut Nowhere, &mut |_| ControlFlow::Break(()));
    assert!(matches!(stopped, Err(Error::Interrupted { .. })), "{:?}", stopped.map(|trust| trust.body_steps));
}

#[test]
fn series_are_formed_on_the_cpu_and_costs_follow_where_work_runs() {
    let (engine, cpu) = (paired(), Engine::cpu());
    assert_eq!(engine.speed(Precision::F64), cpu.speed(Precision::F64));
    assert_eq!(engine.speed_of_series(), cpu.speed_of_series());
    assert_eq!(Precision::ALL.map(|precision| engine.runs_shaders(precision)), [true, false]);
    let narrow = engine.speed(Precision::F32).expect("measured");
    assert!(narrow > 0.0 && narrow.is_finite(), "{narrow}");
    assert_eq!(engine.speed(Precision::F32), Some(narrow), "measured once");
    assert!(!engine.carries_centres());
}
