//! Evaluates quantities of single bodies from their states.

use super::quantity::{PARAMETERS, is_of_axes};
use super::{Quantity, Scene};
use crate::bodies::BodyState;
use crate::bodies::inertia::{InertiaTensor, PrincipalAxes, principal_axes};
use crate::error::Result;
use crate::expression::{Graph, Input, InputKind, Node, Program};
use crate::math::parallel;
use crate::torque::{Torque, variable_inertia};

/// Evaluates quantities of a scene's bodies, one quantity of one body at a time.
pub(crate) struct QuantityEvaluator<'s> {
    scene: &'s Scene,
    programs: Vec<Program>,
    /// Principal moments and axes of all bodies, if they were formed before.
    axes: Vec<PrincipalAxes>,
    varies: bool,
    /// For each number of own state that the formulas read, after [`PARAMETERS`]: its index among the scene's.
    own: Vec<usize>,
    /// After these: the index of the torque, for each torque whose potential energy they read.
    energies: Vec<usize>,
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
        let energies = Quantity::torque_energies(quantities).iter().map(|energy| energy.torque).collect();
        Ok(Self { scene, programs, axes: Vec::new(), varies, own, energies })
    }

    /// Whether any quantity depends on the own state of torques.
    pub fn reads_own_state(&self) -> bool {
        !self.own.is_empty()
    }

    /// The same with the principal axes of all bodies formed once, if a formula reads them and they do not change in time.
    pub fn with_axes(self) -> Self {
        let reads_axes = |program: &Program| program.inputs().iter().copied().any(is_of_axes);
        if self.varies || !self.programs.iter().any(reads_axes) {
            return self;
        }
        let inertia = self.scene.ensemble().inertia();
        Self { axes: parallel::rows(inertia.len(), 1, &|body| principal_axes(&inertia[body])), ..self }
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

    /// The potential energy of one torque, by its place among those that formulas read.
    fn energy_of(&self, place: usize, body: usize, state: &BodyState) -> f64 {
        let torque = self.energies.get(place).and_then(|torque| self.scene.torques().get(*torque));
        torque.and_then(|torque| torque.potential_energy(body, state.orientation)).unwrap_or(f64::NAN)
    }

    fn principal_axes(&self, body: usize, time: f64) -> PrincipalAxes {
        self.axes.get(body).copied().unwrap_or_else(|| principal_axes(&self.tensor(body, time)))
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
                4..=6 => self.principal_axes(body, time).moments.to_array()[index - 4],
                7 => {
                    let torques = self.scene.torques().iter();
                    torques.filter_map(|torque| torque.potential_energy(body, state.orientation)).sum()
                }
                8..=11 => self.principal_axes(body, time).principal_to_body.to_array()[index - 8],
                12..=15 => self.scene.ensemble().orientation()[body].normalize().to_array()[index - 12],
                16..=18 => self.scene.ensemble().angular_velocity_body()[body].to_array()[index - 16],
                _ => self.energy_of(index - PARAMETERS.len() - self.own.len(), body, state),
            },
            // Formulas of quantities have no other inputs.
            _ => f64::NAN,
        }
    }
}
