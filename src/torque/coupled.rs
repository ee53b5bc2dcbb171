//! Custom torques that use `position` or `velocity`, where these have no closed form: the centre of mass is integrated with the rotation. It
//! also is under a force that turns with bodies on which torques act, in the series that plans choose then.
//!
//! ```text
//! dx/dt = v,   M dv/dt = F₀ + M g − c v − C |v| v + R F + Σ Fᵢ(q, ω, t, x, v, M)
//! ```
//!
//! in SI units and world axes ([`crate::torque::force`]; the Fᵢ are forces of the user's own). The forces are recorded beside the torque,
//! as an acceleration that depends on the same inputs; their parameters, and the initial position and velocity, become parameters of the
//! torque, one for each body. The torque thus carries the whole system. [`super::motion`] makes x and v states of the series, and
//! [`crate::engine::batch`] gives bodies columns for them.

use glam::DVec3;

use super::translated::numbers_of;
use super::{Declaration, ParameterDeclaration, Shape, Torque, Value, force};
use crate::bodies::Ensemble;
use crate::expression::{Expression, Fault, Input, InputKind, Recorder, Symbol};
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;
use crate::torque::force::{Accelerations, CustomForce, Force};

/// The equation of motion of a centre of mass that is integrated with a torque, and its initial state.
pub(crate) struct Centre {
    /// dv/dt, m/s², world axes, as a formula of the torque's inputs and parameters.
    pub acceleration: Expression,
    /// The index, among the parameters' numbers, of the first component of the initial position; those of the velocity follow.
    first: usize,
}

impl Centre {
    /// The initial position (m) and velocity (m/s), world axes, from the numbers of a body's parameters.
    pub fn start(&self, numbers: &[f64]) -> (DVec3, DVec3) {
        let vector = |first: usize| DVec3::from_slice(&numbers[first..first + 3]);
        (vector(self.first), vector(self.first + 3))
    }
}

/// The torque combined with the centre of mass, if it uses a position or a velocity and is not sampled; otherwise `None`.
pub(crate) fn coupled(torque: &Torque, ensemble: &Ensemble, forces: &[Force]) -> Option<Torque> {
    (torque.needs().position && !torque.is_sampled()).then(|| carrying(torque, ensemble, forces))?
}

/// The name of a torque of [`carrier`].
const CARRIER: &str = "centre of mass";

/// A torque of zero with the centre of mass, if a force turns with the bodies and none of the `torques`, of which there are some, draws random
/// numbers or is coupled itself.
pub(crate) fn carrier(torques: &[Torque], ensemble: &Ensemble, forces: &[Force]) -> Option<Torque> {
    let is_another = |torque: &Torque| torque.is_random() || torque.is_coupled() || torque.needs().position;
    if torques.is_empty() || torques.iter().any(is_another) || !forces.iter().any(Force::needs_attitude) {
        return None;
    }
    // With an energy, so that the total energy of bodies under torques that all have a potential is known.
    let zero = Expression::of_inputs(|_| Vector::zero()).ok()?;
    let energy = Expression::of_inputs(|_| Symbol::splat(0.0)).ok()?;
    let declaration = Declaration::new(CARRIER, "under forces that turn with the body", "moved with the rotation");
    let zero = Torque::expressed_by(declaration, zero, Some(energy), Vec::new()).ok()?;
    carrying(&zero, ensemble, forces)
}

/// Whether a torque is one of [`carrier`].
pub(crate) fn is_carrier(torque: &Torque) -> bool {
    torque.is_coupled() && torque.name() == CARRIER
}

/// A torque given by an expression, combined with the centre of mass.
fn carrying(torque: &Torque, ensemble: &Ensemble, forces: &[Force]) -> Option<Torque> {
    let (model, translation) = (torque.model().expression()?, ensemble.translation()?);
    let of_body = |body: usize| force::accelerations(forces, body, translation.mass[body]);
    let all: Vec<Accelerations> = (0..ensemble.len()).map(of_body).collect();
    let mut added = Added { first: numbers_of(torque.values()), declarations: Vec::new(), values: Vec::new() };
    let first = added.first;
    added.vector("initial position", "m", translation.position.clone());
    added.vector("initial velocity", "m/s", translation.velocity.clone());
    // By the kinds of the forces, not their values, so that a part of the bodies has the same terms as the whole, and thus the same bits.
    let acts = |is_kind: fn(&Force) -> bool| forces.iter().any(|force| is_kind(force) && !force.is_zero());
    let mut terms = Vec::new();
    if acts(|force| matches!(force, Force::Constant(_) | Force::Gravity(_))) {
        let column = all.iter().map(|forces| forces.constant_world).collect();
        terms.push(Term::Constant(added.vector("acceleration", "m/s²", column)));
    }
    if acts(|force| matches!(force, Force::LinearDrag(_))) {
        let column = all.iter().map(|forces| forces.linear_drag).collect();
        terms.push(Term::LinearDrag(added.number("rate of linear drag", "1/s", column)));
    }
    if acts(|force| matches!(force, Force::QuadraticDrag(_))) {
        let column = all.iter().map(|forces| forces.quadratic_drag).collect();
        terms.push(Term::QuadraticDrag(added.number("coefficient of quadratic drag", "1/m", column)));
    }
    if acts(|force| matches!(force, Force::Thrust(_))) {
        let column = all.iter().map(|forces| forces.thrust_body).collect();
        terms.push(Term::Thrust(added.vector("thrust", "m/s²", column)));
    }
    let custom: Vec<&CustomForce> = forces.iter().filter_map(Force::as_custom).collect();
    if !custom.is_empty() {
        let mass = added.number("mass", "kg", translation.mass.clone());
        for force in custom {
            terms.push(Term::Custom { force, mass, first: added.all(force) });
        }
    }
    let acceleration = acceleration(&terms).ok()?;
    let Added { declarations, values, .. } = added;
    let model = model.coupled(Centre { acceleration, first }, declarations).ok()?;
    Some(Torque::of_model(model, [torque.values().to_vec(), values].concat()))
}

/// Parameters added after those of a torque.
struct Added {
    /// The index of the next parameter's first number.
    first: usize,
    declarations: Vec<ParameterDeclaration>,
    values: Vec<Value>,
}

impl Added {
    /// Adds one parameter, and returns the index of its first number.
    fn one(&mut self, declaration: ParameterDeclaration, value: Value) -> usize {
        let first = self.first;
        self.first += numbers_of(std::slice::from_ref(&value));
        self.declarations.push(declaration);
        self.values.push(value);
        first
    }

    fn number(&mut self, name: &'static str, unit: &'static str, column: Vec<f64>) -> usize {
        let declaration = ParameterDeclaration::number(name, unit, "of the centre of mass");
        self.one(declaration, Value::Number(column.into()))
    }

    fn vector(&mut self, name: &'static str, unit: &'static str, column: Vec<DVec3>) -> usize {
        let declaration = ParameterDeclaration::number(name, unit, "of the centre of mass");
        self.one(declaration.of_shape(Shape::Vector), Value::Vector(column.into()))
    }

    /// Adds the parameters of a force, and returns the index of the first number.
    fn all(&mut self, force: &CustomForce) -> usize {
        let first = self.first;
        for (declaration, value) in force.declarations().iter().zip(force.values()) {
            self.one(declaration.clone(), value.clone());
        }
        first
    }
}

/// A part of the acceleration, with the numbers of its parameters.
enum Term<'f> {
    Constant(usize),
    LinearDrag(usize),
    QuadraticDrag(usize),
    Thrust(usize),
    Custom { force: &'f CustomForce, mass: usize, first: usize },
}

/// The sum of all terms.
fn acceleration(terms: &[Term<'_>]) -> Result<Expression, Fault> {
    Expression::of_inputs(|recorder| {
        terms.iter().fold(Vector::zero(), |sum: Vector<Symbol>, term| sum + term.acceleration(recorder))
    })
}

impl Term<'_> {
    fn acceleration(&self, recorder: &Recorder) -> Vector<Symbol> {
        let input = |kind, index: usize| recorder.input(Input::new(kind, index as u16));
        let vector =
            |kind, first: usize| Vector::new(input(kind, first), input(kind, first + 1), input(kind, first + 2));
        let number = |index: usize| input(InputKind::Parameter, index);
        let velocity = vector(InputKind::Velocity, 0);
        match *self {
            Term::Constant(first) => vector(InputKind::Parameter, first),
            Term::LinearDrag(index) => velocity * -number(index),
            Term::QuadraticDrag(index) => velocity * -(number(index) * velocity.dot(velocity).sqrt()),
            Term::Thrust(first) => {
                let q = |part: usize| input(InputKind::Orientation, part);
                Quaternion::new(q(0), q(1), q(2), q(3)).rotate(vector(InputKind::Parameter, first))
            }
            Term::Custom { force, mass, first } => {
                let found = force.formula().recorded_with(|asked| match (asked.kind, usize::from(asked.index)) {
                    (InputKind::Parameter, 0) => number(mass),
                    (InputKind::Parameter, own) => number(first + own - 1),
                    _ => recorder.input(asked),
                });
                Vector::new(found[0], found[1], found[2]) * (Symbol::splat(1.0) / number(mass))
            }
        }
    }
}
