//! Evaluates quantities of single bodies from their states.

use glam::DVec3;

use super::quantity::PARAMETERS;
use super::{Quantity, Scene};
use crate::bodies::BodyState;
use crate::bodies::inertia::{InertiaTensor, principal_axes};
use crate::error::Result;
use crate::expression::{Graph, Input, InputKind, Node, Program};
use crate::torque::{Torque, variable_inertia};

/// Evaluates quantities of a scene's bodies, one quantity of one body at a time.
pub(crate) struct QuantityEvaluator<'s> {
    scene: &'s Scene,
    programs: Vec<Program>,
    /// Principal moments of all bodies, kg m², ascending, if they were formed before.
    moments: Vec<DVec3>,
    varies: bool,
    /// For each number of own state that the formulas read, after [`PARAMETERS`]: its index among the scene's.
    own: Vec<usize>,
}

impl<'s> QuantityEvaluator<'s> {
    /// An evaluator of these quantities, in this order.
    pub fn new(scene: &'s Scene, quantities: &[Quantity]) -> Result<Self> {
        let (graph, outputs) = Quantity::expression(quantities)?;
        Self::of_expression(scene, quantities, (&graph, &outputs))
    }

    /// An evaluator of quantities that are outputs of a graph ([`Quantity::expression`]).
    pub fn of_expression(
        scene: &'s Scene,
        quantities: &[Quantity],
        (graph, outputs): (&Graph, &[Node]),
    ) -> Result<Self> {
        let programs = outputs.iter().map(|output| Program::new(graph, &[*output])).collect();
        let varies = scene.torques().iter().any(Torque::changes_inertia);
        let own = Quantity::own_places(quantities, scene.torques())?;
        Ok(Self { scene, programs, moments: Vec::new(), varies, own })
    }

    /// Whether any quantity depends on the own state of torques.
    pub fn reads_own_state(&self) -> bool {
        !self.own.is_empty()
    }

    /// Whether moments of inertia change in time.
    pub fn varies(&self) -> bool {
        self.varies
    }

    /// Supplies the principal moments of all bodies, which must not change in time.
    pub fn with_moments(self, moments: Vec<DVec3>) -> Self {
        Self { moments, ..self }
    }

    /// The value of quantity number `quantity` of one body, whose state is sound; `own` has the body's own state, in the order of
    /// [`control::own_numbers`](crate::torque::control), if any is read.
    pub fn value(&self, quantity: usize, body: usize, time: f64, (state, own): (&BodyState, &[f64])) -> f64 {
        let program = &self.programs[quantity];
        let inputs = program.inputs().iter().map(|&input| match self.own_place(input) {
            Some(place) => own.get(place).copied().unwrap_or(f64::NAN),
            None => self.input(input, body, time, state),
        });
        program.evaluate_one(&inputs.collect::<Vec<f64>>())[0]
    }

    fn tensor(&self, body: usize, time: f64) -> InertiaTensor {
        let tensor = self.scene.ensemble().inertia()[body];
        if self.varies { variable_inertia::tensor_at(self.scene.torques(), body, tensor, time) } else { tensor }
    }

    /// The index in the scene's own state of what a formula reads; `None` if it reads something else.
    pub fn own_place(&self, input: Input) -> Option<usize> {
        let index = usize::from(input.index).checked_sub(PARAMETERS.len())?;
        if input.kind == InputKind::Parameter { self.own.get(index).copied() } else { None }
    }

    /// What a formula reads, other than own state.
    #[inline]
    pub fn input(&self, input: Input, body: usize, time: f64, state: &BodyState) -> f64 {
        let index = usize::from(input.index);
        match input.kind {
            InputKind::Orientation => state.orientation.to_array()[index],
            InputKind::AngularVelocity => state.angular_velocity_body.to_array()[index],
            InputKind::Inertia => {
                let tensor = self.tensor(body, time);
                [tensor.xx, tensor.yy, tensor.zz, tensor.xy, tensor.xz, tensor.yz][index]
            }
            InputKind::Time => time,
            // In the order of `PARAMETERS`.
            InputKind::Parameter => match index {
                0..=2 => state.angular_momentum_world.to_array()[index],
                3 => state.kinetic_energy,
                4..=6 => {
                    let moments = self.moments.get(body).copied();
                    let moments = moments.unwrap_or_else(|| principal_axes(&self.tensor(body, time)).moments);
                    moments.to_array()[index - 4]
                }
                _ => {
                    let torques = self.scene.torques().iter();
                    torques.filter_map(|torque| torque.potential_energy(body, state.orientation)).sum()
                }
            },
            // Formulas of quantities have no other inputs.
            _ => f64::NAN,
        }
    }
}
