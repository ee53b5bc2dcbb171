//! The way to a device in plans: how often steps wait for it, and what the time on the way is foretold to be.

use glam::{DQuat, DVec3};
use polhode::bench::accuracy;
use polhode::bench::row::{Row, Table};
use polhode::engine::batch::AnyBatch;
use polhode::engine::{Backend, Description, EngineKind, Link, Session};
use polhode::kernel::free_motion::AnyRows;
use polhode::plan::cost::COSTS;
use polhode::plan::{Costs, Scheme, Treatment};
use polhode::scene::AdaptiveSteps;
use polhode::{Accuracy, Engine, Ensemble, Method, Outputs, Plan, Precision, Result, Scene, Torque};

/// Bytes a second to the device and back.
const RATE: f64 = 1e10;

/// A long wait for it, s.
const WAIT: f64 = 0.25;

const BODIES: usize = 2000;
const OUTPUTS: usize = 20;

/// A device that is reached in `wait` s, and computes as the CPU does.
struct Far {
    cpu: Engine,
    wait: f64,
}

impl Far {
    fn reached_in(wait: f64) -> Self {
        Self { cpu: Engine::cpu(), wait }
    }
}

impl Backend for Far {
    fn inner(&self) -> Option<&dyn Backend> {
        Some(&self.cpu)
    }
    fn description(&self) -> Description {
        Description { kind: EngineKind::Gpu, name: "far".into(), ..self.cpu.description() }
    }
    fn precisions(&self) -> &[Precision] {
        self.cpu.precisions()
    }
    fn runs_shaders(&self, _: Precision) -> bool {
        true
    }
    fn link(&self) -> Option<Link> {
        Some(Link::new(self.wait, RATE, RATE))
    }
    fn start(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        self.cpu.start(batch, method)
    }
    fn start_projected(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        self.cpu.start_projected(batch, method)
    }
    fn start_free(&self, rows: AnyRows) -> Result<Box<dyn Session>> {
        self.cpu.start_free(rows)
    }
    fn start_adaptive(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Session>> {
        self.cpu.start_adaptive(batch, steps)
    }
}

/// As measured on the device: adaptive steps of `rk8`, ten times as fast as on a core, and equal ones, which are twenty times as dear as they
/// should be. Other methods, which were not measured, are no candidates.
fn costs() -> Costs {
    let folder = tempfile::tempdir().expect("a folder");
    let mut table = Table::open(folder.path(), accuracy::TABLE).expect("a table");
    for cost in COSTS.iter().filter(|cost| cost.scheme.method() == Method::Rk8) {
        let slower = if cost.scheme.is_adaptive() { 0.1 } else { 2.0 };
        for (problem, is_free) in [("free", true), ("forced", false)] {
            for precision in Precision::ALL {
                let row = Row::new()
                    .with("engine", "gpu")
                    .with("adapter", "far")
                    .with("problem", problem)
                    .with("method", cost.scheme.name())
                    .with("precision", precision.name())
                    .with("body_steps_per_second", 1.0 / (slower * cost.step_seconds(precision, is_free)))
                    .with("valid", true);
                table.append(&row).expect("written");
            }
        }
    }
    let costs = Costs::measured(folder.path(), &Far::reached_in(0.0).description()).expect("costs");
    assert_eq!(costs.rows().len(), 2);
    costs
}

/// Bodies under drag, followed for a few turns and read twenty times.
fn scene() -> Scene {
    let row = (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::new(0.3, 1.0, -0.2));
    let bodies = Ensemble::from_fn(BODIES, |_| row);
    Scene::new(bodies.expect("valid"))
        .torque(Torque::quadratic_drag(0.01))
        .until(10.0)
        .outputs(Outputs::Every(10.0 / OUTPUTS as f64))
        .accuracy(Accuracy::attitude(1e-9))
}

#[test]
fn candidates_that_wait_more_often_for_a_device_lose_where_a_wait_is_long() {
    let (scene, costs) = (scene(), costs());
    let schemes = |wait| -> Vec<Scheme> {
        let plan = Plan::with_costs(&scene, &Far::reached_in(wait), &costs).expect("planned");
        let scheme = |treatment| match treatment {
            Treatment::Stepped { method, .. } => Some(Scheme::Equal(method)),
            Treatment::Adaptive { method, .. } => Some(Scheme::Adaptive(method)),
            Treatment::RegularPrecession | Treatment::ClosedForm { .. } => None,
        };
        plan.groups().iter().filter_map(|group| scheme(group.treatment)).collect()
    };
    assert_eq!(schemes(1e-9), [Scheme::Adaptive(Method::Rk8)]);
    assert_eq!(schemes(1.0), [Scheme::Equal(Method::Rk8)]);
}

#[test]
fn the_time_of_waiting_and_of_the_upload_is_foretold() {
    let (scene, cpu) = (scene(), Engine::cpu());
    let pinned = scene.clone().pinned(Method::Rk8, 0.05, None);
    // Where steps are given, the waits alone; where they are chosen, also what the equal ones take, which are dearer and wait less often.
    for (scene, costs, within) in [(&scene, costs(), 0.5), (&pinned, Costs::shipped(), 1e-9)] {
        let explained = |wait| Plan::with_costs(scene, &Far::reached_in(wait), &costs).expect("planned").explain();
        let (near, far) = (explained(0.0), explained(WAIT));
        // One before each output, as equal steps are chosen.
        let longer = far.seconds().expect("known") - near.seconds().expect("known");
        assert!((longer - OUTPUTS as f64 * WAIT).abs() < within, "{longer} s longer");
        let link = far.link.expect("on a device");
        assert_eq!((link.wait, link.seconds), (WAIT, link.bytes as f64 / RATE));
        assert!(link.bytes > (BODIES * 100) as u64, "{link:?}");
        // Twenty times eight numbers of 4 or 8 bytes, in two words if narrow.
        let states = (OUTPUTS * BODIES) as u64;
        assert!((states * 60..=states * 64).contains(&link.read), "{link:?}");
        assert_eq!(link.read_seconds, link.read as f64 / RATE);
        assert_eq!(Plan::new(scene, &cpu).expect("planned").explain().link, None);
    }
}
