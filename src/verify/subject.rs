//! The bodies that are compared, under all their torques or only some, at any time of their motion.

use glam::DVec3;

use crate::bodies::BodyFrame;
use crate::bodies::Members;
use crate::bodies::columns::StateWords;
use crate::engine::batch::{AnyBatch, prepare_acting};
use crate::engine::controlled::Controls;
use crate::engine::{Backend, EngineKind};
use crate::error::Result;
use crate::math::Precision;
use crate::math::Width;
use crate::math::clock::Clock;
use crate::math::lanes;
use crate::plan::Group;
use crate::scene::Scene;
use crate::torque::Torque;

/// The twin of every engine: one body at a time, without fused multiply-add.
pub(super) const TWIN: Width = Width::Scalar;

/// Some bodies of one group of a plan.
pub(super) struct Subject<'a> {
    pub scene: &'a Scene,
    pub members: Members,
    /// The torques that act on the group, by their indices in the scene.
    pub torques: Vec<usize>,
    /// The twin's torques, one for each torque of the scene.
    twin_torques: &'a [Torque],
    pub precision: Precision,
    pub frames: Vec<BodyFrame>,
    /// The bodies at the start: for the engine, for its twin, and in `f64`.
    pub batch: AnyBatch,
    pub twin: AnyBatch,
    pub reference: AnyBatch,
}

impl<'a> Subject<'a> {
    pub fn new(
        scene: &'a Scene,
        group: &Group,
        members: Members,
        precision: Precision,
        twin_torques: &'a [Torque],
    ) -> Result<Self> {
        let torques = (0..scene.torques().len()).filter(|&torque| group.class.torques.contains(torque)).collect();
        let prepare = |of: &[Torque], precision| -> Result<(Vec<BodyFrame>, AnyBatch)> {
            let units = group.class.torques.of(scene.torques());
            let (frames, mut batch) = prepare_acting(scene.ensemble(), &units, of, scene.end(), &members, precision)?;
            // The first values of sampled torques are held throughout.
            Controls::start(of, &mut batch, &frames, |row| members.body(row));
            Ok((frames, batch))
        };
        let (own, twins) = (group.class.torques.of(scene.torques()), group.class.torques.of(twin_torques));
        let (frames, batch) = prepare(&own, precision)?;
        let (twin, reference) = (prepare(&twins, precision)?.1, prepare(&twins, Precision::F64)?.1);
        Ok(Self { scene, members, torques, twin_torques, precision, frames, batch, twin, reference })
    }

    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// One body under some of the torques, for the engine and for its twin, in the units belonging to all torques.
    pub fn alone(&self, row: usize, acting: &[usize]) -> Result<[AnyBatch; 2]> {
        self.alone_in(row, acting, false)
    }

    /// The same in a kernel with torques: if none act, under one of zero strength.
    pub fn driven_alone(&self, row: usize, acting: &[usize]) -> Result<[AnyBatch; 2]> {
        self.alone_in(row, acting, true)
    }

    fn alone_in(&self, row: usize, acting: &[usize], driven: bool) -> Result<[AnyBatch; 2]> {
        let body = Members::Some(vec![self.members.body(row) as u32]);
        let of = |torques: &[Torque], which: &[usize]| -> Vec<Torque> {
            which.iter().map(|&torque| torques[torque].clone()).collect()
        };
        let units = of(self.scene.torques(), &self.torques);
        let prepare = |acting: &[Torque]| -> Result<AnyBatch> {
            let (ensemble, span) = (self.scene.ensemble(), self.scene.end());
            let (frames, mut batch) = prepare_acting(ensemble, &units, acting, span, &body, self.precision)?;
            Controls::start(acting, &mut batch, &frames, |row| body.body(row));
            Ok(batch)
        };
        let prepare_like_all = |torques: &[Torque]| {
            let mut acting = of(torques, acting);
            let batch = prepare(&acting)?;
            // These torques alone would have a kernel of their own, which is not the one under test.
            let is_special = batch.torques().is_common() && !self.batch.torques().is_common();
            if !(if acting.is_empty() { driven } else { is_special }) {
                return Ok(batch);
            }
            acting.push(Torque::constant_world(DVec3::ZERO));
            prepare(&acting)
        };
        Ok([prepare_like_all(self.scene.torques())?, prepare_like_all(self.twin_torques)?])
    }

    /// The names of its torques, with their numbers in the scene.
    pub fn torque_names(&self) -> Vec<String> {
        self.torques.iter().map(|&torque| torque_name(self.scene, torque)).collect()
    }
}

/// A torque's name in messages.
pub(super) fn torque_name(scene: &Scene, torque: usize) -> String {
    format!("torque {} ({})", torque + 1, scene.torques()[torque].name())
}

/// One of the sides that are compared with the twin: an engine or, for the CPU engine, lanes of one width.
pub(super) struct Side<'a> {
    pub engine: &'a dyn Backend,
    pub name: String,
    /// Bytes of a vector.
    lanes: Option<usize>,
}

impl<'a> Side<'a> {
    /// All sides of an engine.
    pub fn all(engine: &'a dyn Backend) -> Vec<Self> {
        let description = engine.description();
        let widths = if description.kind == EngineKind::Cpu { lanes::widths() } else { Vec::new() };
        if widths.is_empty() {
            return vec![Self { engine, name: description.name, lanes: None }];
        }
        widths
            .into_iter()
            .map(|bytes| {
                let [narrow, wide] = [size_of::<f32>(), size_of::<f64>()].map(|size| bytes / size);
                Self { engine, name: format!("CPU lanes ({narrow} of f32, {wide} of f64)"), lanes: Some(bytes) }
            })
            .collect()
    }

    /// Does some work on this side.
    pub fn with<V>(&self, work: impl FnOnce(&dyn Backend) -> V) -> V {
        match self.lanes {
            Some(bytes) => lanes::with_lanes_of(bytes, || work(self.engine)),
            None => work(self.engine),
        }
    }
}

/// States in the words of another precision: in one word of `f64`, with both words of `f32` added.
pub(super) fn in_one_word(states: &StateWords) -> StateWords {
    let value = (0..states.len()).map(|row| states.combined(row)).collect();
    StateWords { value, residue: Vec::new(), status: states.status.clone() }
}

/// The clock of a batch at its start.
pub(super) fn start_clock(batch: &AnyBatch) -> Clock {
    batch.torques().clock()
}
