//! Custom torques that use `position` or `velocity`, where these follow in closed form.
//!
//! The rotation does not act back on a centre of mass under constant forces, uniform gravity and linear drag, so both are functions of time:
//! with b = c/M, p = b t, φ₁ = (1 − e⁻ᵖ)/p and φ₂ = (1 − φ₁)/p,
//!
//! ```text
//! x = x₀ + (v₀ φ₁ + a t φ₂) t
//! v = v₀ (1 − p φ₁) + a t φ₁
//! ```
//!
//! ([`crate::torque::force::closed_form()`]). They replace the two inputs, and their initial values become parameters, one for each body.

use glam::DVec3;

use super::{ParameterDeclaration, Shape, Torque, Value};
use crate::bodies::Ensemble;
use crate::expression::{Input, InputKind, Recorder, Symbol};
use crate::math::real::{Function, Real};
use crate::math::vector::Vector;
use crate::torque::force::{Accelerations, Force, accelerations};

/// The message of a refusal.
const NEEDS_TRANSLATION: &str =
    "its position and velocity are needed: bodies have none without a mass, a position and a velocity";
const NEEDS_CLOSED_FORM: &str =
    "its position and velocity have no closed form: expected forces that are constant, gravity or linear drag";
const SAMPLED: &str = "it is sampled, and its position and velocity have no closed form: expected forces that are constant, gravity or \
                       linear drag, or a torque that is formed at every time";

/// Why a torque that uses a position or a velocity, and may be sampled, cannot act.
pub(crate) fn refusal(is_sampled: bool, ensemble: &Ensemble) -> &'static str {
    match ensemble.translation() {
        None => NEEDS_TRANSLATION,
        Some(_) if is_sampled => SAMPLED,
        Some(_) => NEEDS_CLOSED_FORM,
    }
}

/// The torque as a function of time, if it uses a position or a velocity and the forces leave them a closed form; otherwise `None`.
pub(crate) fn translated(torque: &Torque, ensemble: &Ensemble, forces: &[Force]) -> Option<Torque> {
    let model = torque.model().expression().filter(|_| torque.needs().position)?;
    let translation = ensemble.translation()?;
    if !forces.iter().all(Force::has_closed_form) {
        return None;
    }
    let of_body = |body: usize| accelerations(forces, body, translation.mass[body]);
    let all: Vec<Accelerations> = (0..ensemble.len()).map(of_body).collect();
    let accelerates = all.iter().any(|forces| forces.constant_world != DVec3::ZERO);
    let is_slowed = all.iter().any(|forces| forces.linear_drag != 0.0);

    let vector = |name, unit| ParameterDeclaration::number(name, unit, "of the centre of mass").of_shape(Shape::Vector);
    let mut declarations = vec![vector("initial position", "m"), vector("initial velocity", "m/s")];
    let mut values = torque.values().to_vec();
    values.push(Value::Vector(translation.position.clone().into()));
    values.push(Value::Vector(translation.velocity.clone().into()));
    if accelerates {
        declarations.push(vector("acceleration", "m/s²"));
        let column: Vec<DVec3> = all.iter().map(|forces| forces.constant_world).collect();
        values.push(Value::Vector(column.into()));
    }
    if is_slowed {
        declarations.push(ParameterDeclaration::number("rate of linear drag", "1/s", "c/M"));
        let column: Vec<f64> = all.iter().map(|forces| forces.linear_drag).collect();
        values.push(Value::Number(column.into()));
    }
    let motion = ClosedForm { first: numbers_of(torque.values()), accelerates, is_slowed };
    let model = model.moved(|recorder, input| motion.input(recorder, input), declarations).ok()?;
    Some(Torque::of_model(model, values))
}

/// How many numbers the parameters of a formula have.
pub(super) fn numbers_of(values: &[Value]) -> usize {
    let of_value = |value: &Value| match value {
        Value::Vector(_) => 3,
        Value::Rotation(_) => 4,
        _ => 1,
    };
    values.iter().map(of_value).sum()
}

/// The indices of the motion's parameters, and which there are.
#[derive(Clone, Copy, Debug)]
struct ClosedForm {
    first: usize,
    accelerates: bool,
    is_slowed: bool,
}

impl ClosedForm {
    /// The replacement of an input.
    fn input(self, recorder: &Recorder, input: Input) -> Symbol {
        let part = |vector: Vector<Symbol>| [vector.x, vector.y, vector.z][usize::from(input.index)];
        match input.kind {
            InputKind::Position => part(self.position_and_velocity(recorder).0),
            InputKind::Velocity => part(self.position_and_velocity(recorder).1),
            _ => recorder.input(input),
        }
    }

    fn position_and_velocity(self, recorder: &Recorder) -> (Vector<Symbol>, Vector<Symbol>) {
        let number = |offset: usize| recorder.input(Input::new(InputKind::Parameter, (self.first + offset) as u16));
        let vector = |offset| Vector::new(number(offset), number(offset + 1), number(offset + 2));
        let time = recorder.input(Input::new(InputKind::Time, 0));
        let (position, velocity) = (vector(0), vector(3));
        let (acceleration, rate) = if self.accelerates { (vector(6), 9) } else { (Vector::zero(), 6) };
        let one = Symbol::splat(1.0);
        if !self.is_slowed {
            let gained = acceleration * time;
            return (position + (velocity + gained * Symbol::splat(0.5)) * time, velocity + gained);
        }
        let p = number(rate) * time;
        let second = second_quotient(p);
        let first = one - p * second;
        let gained = acceleration * time;
        (position + (velocity * first + gained * second) * time, velocity * (one - p * first) + gained * first)
    }
}

/// (p − 1 + e⁻ᵖ)/p², which is ½ at 0; by its series for p up to 1, where the first neglected term is below 1e-18.
fn second_quotient(p: Symbol) -> Symbol {
    let one = Symbol::splat(1.0);
    let small = p.min(one);
    let mut sum = Symbol::splat(0.0);
    for divisor in (3..=20).rev() {
        sum = (one - small * sum) * Symbol::splat(f64::from(divisor).recip());
    }
    let series = (one - small * sum) * Symbol::splat(0.5);
    let large = p.max(one);
    let first = (one - (-large).function(Function::Exp)) / large;
    Symbol::select(p.less_than(one), series, (one - first) / large)
}
