//! The names that a formula may use: available inputs, and the user's own parameters.

use super::fault::{Fault, nearest};
use super::graph::{Input, InputKind};
use super::orbit::{ELEMENTS, OnOrbit, OrbitElements, OrbitSymbols};
use super::symbol::{Recorder, Symbol};
use super::vocabulary;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// The shape of a value: how many numbers it has, and what they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shape {
    /// One number.
    Number,
    /// Three components.
    Vector,
    /// Four components x, y, z, w.
    Quaternion,
}

impl Shape {
    /// The number of components.
    pub const fn width(self) -> usize {
        match self {
            Shape::Number => 1,
            Shape::Vector => 3,
            Shape::Quaternion => 4,
        }
    }

    /// Its description, with an article.
    pub(super) const fn described(self) -> &'static str {
        match self {
            Shape::Number => "a number",
            Shape::Vector => "a vector",
            Shape::Quaternion => "a rotation",
        }
    }
}

/// A named value and the first of the inputs that hold it.
#[derive(Clone, Debug, PartialEq)]
pub struct Name {
    /// The name in formulas.
    pub name: String,
    /// Its shape.
    pub shape: Shape,
    /// Its first number; the others follow.
    pub first: Input,
}

impl Name {
    fn new(name: &str, shape: Shape, kind: InputKind, index: usize) -> Self {
        Self { name: name.to_owned(), shape, first: Input::new(kind, index as u16) }
    }

    /// The inputs that hold the value.
    pub fn inputs(&self) -> impl Iterator<Item = Input> + use<> {
        let Input { kind, index } = self.first;
        (0..self.shape.width() as u16).map(move |part| Input::new(kind, index + part))
    }
}

/// What is known of the inertia tensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Inertia {
    Unknown,
    /// Axes are principal ones: xx, yy, zz.
    Principal,
    /// xx, yy, zz, xy, xz, yz.
    Full,
}

/// The most numbers that the parameters of one formula have.
pub const MOST_PARAMETERS: usize = 1024;

/// The names that a formula may use.
#[derive(Clone, Debug, PartialEq)]
pub struct Symbols {
    names: Vec<Name>,
    inertia: Inertia,
    parameters: usize,
    phases: usize,
    orbit: Option<OrbitSymbols>,
}

impl Symbols {
    /// Parameters alone.
    pub fn parameters_only() -> Self {
        Self { names: vec![], inertia: Inertia::Unknown, parameters: 0, phases: 0, orbit: None }
    }

    /// The names for every torque: `attitude`, `angular_velocity` and `angular_momentum` along the body's axes, `inertia` (diagonal, as the
    /// axes are principal) and `time`.
    pub fn rotation() -> Self {
        Self {
            names: vec![
                Name::new("attitude", Shape::Quaternion, InputKind::Orientation, 0),
                Name::new("angular_velocity", Shape::Vector, InputKind::AngularVelocity, 0),
                Name::new("angular_momentum", Shape::Vector, InputKind::AngularMomentum, 0),
                Name::new("time", Shape::Number, InputKind::Time, 0),
            ],
            inertia: Inertia::Principal,
            ..Self::parameters_only()
        }
    }

    /// Parameters, and `attitude`.
    pub fn attitude() -> Self {
        Self {
            names: vec![Name::new("attitude", Shape::Quaternion, InputKind::Orientation, 0)],
            ..Self::parameters_only()
        }
    }

    /// The names for moments of inertia that change: `time`, and `inertia` with all six elements, which is the tensor at the start.
    pub fn inertia() -> Self {
        Self {
            names: vec![Name::new("time", Shape::Number, InputKind::Time, 0)],
            inertia: Inertia::Full,
            ..Self::parameters_only()
        }
    }

    /// The names for a force: `attitude`, `angular_velocity` along the body's axes, `time`, and `position` and `velocity` of the centre of
    /// mass along the world's.
    pub fn translation() -> Self {
        let mut symbols = Self::attitude();
        symbols.names.push(Name::new("angular_velocity", Shape::Vector, InputKind::AngularVelocity, 0));
        symbols.names.push(Name::new("time", Shape::Number, InputKind::Time, 0));
        symbols.with_translation()
    }

    /// Adds `position` and `velocity` of the centre of mass, m and m/s along the world's axes.
    #[must_use]
    pub fn with_translation(mut self) -> Self {
        self.names.push(Name::new("position", Shape::Vector, InputKind::Position, 0));
        self.names.push(Name::new("velocity", Shape::Vector, InputKind::Velocity, 0));
        self
    }

    /// Makes the inertia have all six elements, as the body's axes are not principal ones.
    #[must_use]
    pub fn with_full_inertia(mut self) -> Self {
        self.inertia = Inertia::Full;
        self
    }

    /// Adds a parameter of the user's own; its numbers follow those of the parameters before it.
    ///
    /// # Errors
    ///
    /// If the name is not made of letters, digits and underscores, is taken or reserved, or there are more numbers than
    /// [`MOST_PARAMETERS`].
    pub fn parameter(mut self, name: &str, shape: Shape) -> Result<Self, Fault> {
        self.check(name)?;
        if self.parameters + shape.width() > MOST_PARAMETERS {
            return Err(Fault::TooManyParameters);
        }
        self.names.push(Name::new(name, shape, InputKind::Parameter, self.parameters));
        self.parameters += shape.width();
        Ok(self)
    }

    /// Adds `orbit_position` and `orbit_velocity`, m and m/s along the world's axes: those on an orbit with elements that are the next
    /// [`ELEMENTS`] parameters, which no text can name.
    pub(crate) fn with_orbit(mut self, is_eccentric: bool, drifts: bool) -> Result<Self, Fault> {
        let first = self.parameters;
        if self.orbit.is_some() {
            return Err(Fault::DuplicateName { name: vocabulary::ORBIT_POSITION.to_owned() });
        }
        let symbols = self.with_unnamed(ELEMENTS)?;
        self = symbols;
        self.orbit = Some(OrbitSymbols { elements: OrbitElements::Parameters(first), is_eccentric, drifts });
        Ok(self)
    }

    /// The same for an orbit that all bodies share.
    pub(crate) fn with_constant_orbit(mut self, orbit: Option<OrbitSymbols>) -> Self {
        self.orbit = orbit;
        self
    }

    /// Adds numbers to the parameters that have no name.
    pub(crate) fn with_unnamed(mut self, count: usize) -> Result<Self, Fault> {
        if self.parameters + count > MOST_PARAMETERS {
            return Err(Fault::TooManyParameters);
        }
        self.parameters += count;
        Ok(self)
    }

    /// Whether it offers the position and velocity on an orbit.
    pub(super) fn offers_orbit(&self) -> bool {
        self.orbit.is_some()
    }

    /// Adds a phase that advances with time, in turns.
    ///
    /// # Errors
    ///
    /// As [`Symbols::parameter`].
    pub fn phase(mut self, name: &str) -> Result<Self, Fault> {
        self.check(name)?;
        if self.phases >= MOST_PARAMETERS {
            return Err(Fault::TooManyParameters);
        }
        self.names.push(Name::new(name, Shape::Number, InputKind::Phase, self.phases));
        self.phases += 1;
        Ok(self)
    }

    fn check(&self, name: &str) -> Result<(), Fault> {
        let mut letters = name.chars();
        let begins = letters.next().is_some_and(|first| first.is_ascii_alphabetic() || first == '_');
        if !begins || !letters.all(|letter| letter.is_ascii_alphanumeric() || letter == '_') {
            return Err(Fault::InvalidName { name: name.to_owned() });
        }
        if vocabulary::is_reserved(name) {
            return Err(Fault::ReservedName { name: name.to_owned() });
        }
        match self.find(name) {
            Some(_) => Err(Fault::DuplicateName { name: name.to_owned() }),
            None => Ok(()),
        }
    }

    /// All available names, except the inertia.
    pub fn names(&self) -> &[Name] {
        &self.names
    }

    /// How many numbers the parameters have.
    pub fn parameter_count(&self) -> usize {
        self.parameters
    }

    pub(super) fn find(&self, name: &str) -> Option<&Name> {
        self.names.iter().find(|known| known.name == name)
    }

    pub(super) fn offers_inertia(&self) -> bool {
        self.inertia != Inertia::Unknown
    }

    /// The error for an unknown name, with the nearest of the known names and of `more`.
    pub(super) fn unknown<'a>(&'a self, name: &str, more: impl Iterator<Item = &'a str>) -> Fault {
        if vocabulary::INPUTS.contains(&name) {
            return Fault::NotOffered { name: name.to_owned() };
        }
        let inertia = self.offers_inertia().then_some("inertia");
        let known = self.names.iter().map(|known| known.name.as_str()).chain(inertia).chain(more);
        Fault::UnknownName { name: name.to_owned(), nearest: nearest(name, known) }
    }
}

/// The symbols of a recording, by name.
pub struct Scope<'a> {
    symbols: &'a Symbols,
    recorder: &'a Recorder,
}

impl<'a> Scope<'a> {
    pub(crate) fn new(symbols: &'a Symbols, recorder: &'a Recorder) -> Self {
        Self { symbols, recorder }
    }

    /// The input or parameter `name`, which must be a number. An unknown name, or one of another shape, makes the recording fail;
    /// so do the methods below.
    pub fn number(&self, name: &str) -> Symbol {
        self.numbers::<1>(name, Shape::Number)[0]
    }

    /// The input or parameter `name`, which must be a vector.
    pub fn vector(&self, name: &str) -> Vector<Symbol> {
        let [x, y, z] = self.numbers(name, Shape::Vector);
        Vector::new(x, y, z)
    }

    /// The input or parameter `name`, which must be a quaternion.
    pub fn quaternion(&self, name: &str) -> Quaternion<Symbol> {
        let [x, y, z, w] = self.numbers(name, Shape::Quaternion);
        Quaternion::new(x, y, z, w)
    }

    /// The rotation from the body's axes to the world's.
    pub fn attitude(&self) -> Quaternion<Symbol> {
        self.quaternion("attitude")
    }

    /// The angular velocity, rad/s, along the body's axes.
    pub fn angular_velocity(&self) -> Vector<Symbol> {
        self.vector("angular_velocity")
    }

    /// The angular momentum, kg m²/s, along the body's axes.
    pub fn angular_momentum(&self) -> Vector<Symbol> {
        self.vector("angular_momentum")
    }

    /// Time, s.
    pub fn time(&self) -> Symbol {
        self.number("time")
    }

    /// The position of the centre of mass, m, along the world's axes.
    pub fn position(&self) -> Vector<Symbol> {
        self.vector("position")
    }

    /// The velocity of the centre of mass, m/s, along the world's axes.
    pub fn velocity(&self) -> Vector<Symbol> {
        self.vector("velocity")
    }

    /// The position on the orbit, m, along the world's axes, if the formula has an orbit ([`crate::torque::Parameters::orbit`]).
    pub fn orbit_position(&self) -> Vector<Symbol> {
        self.on_orbit(vocabulary::ORBIT_POSITION).position
    }

    /// The velocity on the orbit, m/s, along the world's axes.
    pub fn orbit_velocity(&self) -> Vector<Symbol> {
        self.on_orbit(vocabulary::ORBIT_VELOCITY).velocity
    }

    fn on_orbit(&self, name: &str) -> OnOrbit {
        let Some(orbit) = &self.symbols.orbit else {
            let none = self.recorder.refuse(self.symbols.unknown(name, std::iter::empty()));
            return OnOrbit { position: Vector::new(none, none, none), velocity: Vector::new(none, none, none) };
        };
        let elements = std::array::from_fn(|place| match orbit.elements {
            OrbitElements::Parameters(first) => {
                self.recorder.input(Input::new(InputKind::Parameter, (first + place) as u16))
            }
            #[cfg(feature = "study")]
            OrbitElements::Constants(numbers) => Symbol::splat(numbers[place]),
        });
        OnOrbit::at(elements, orbit, self.recorder.input(Input::new(InputKind::Time, 0)))
    }

    /// The inertia tensor times a vector, both along the body's axes.
    pub fn inertia_times(&self, v: Vector<Symbol>) -> Vector<Symbol> {
        let [xx, yy, zz] = ["xx", "yy", "zz"].map(|name| self.inertia(name));
        if self.symbols.inertia != Inertia::Full {
            return Vector::new(xx, yy, zz).scaled_by(v);
        }
        let [xy, xz, yz] = ["xy", "xz", "yz"].map(|name| self.inertia(name));
        Vector::new(
            xx.mul_add(v.x, xy.mul_add(v.y, xz * v.z)),
            xy.mul_add(v.x, yy.mul_add(v.y, yz * v.z)),
            xz.mul_add(v.x, yz.mul_add(v.y, zz * v.z)),
        )
    }

    /// An element of the inertia tensor, kg m²: `xx`, `yy`, `zz` and, if the axes are not principal, `xy`, `xz`, `yz`.
    pub fn inertia(&self, element: &str) -> Symbol {
        match self.inertia_element(element) {
            Ok(element) => element,
            Err(fault) => self.recorder.refuse(fault),
        }
    }

    pub(super) fn inertia_element(&self, element: &str) -> Result<Symbol, Fault> {
        let (elements, known) = match self.symbols.inertia {
            Inertia::Unknown => return Err(self.symbols.unknown("inertia", std::iter::empty())),
            Inertia::Principal => (3, "xx, yy, zz"),
            Inertia::Full => (6, "xx, yy, zz, xy, xz, yz"),
        };
        let place = ["xx", "yy", "zz", "xy", "xz", "yz"][..elements].iter().position(|name| *name == element);
        match place {
            Some(index) => Ok(self.recorder.input(Input::new(InputKind::Inertia, index as u16))),
            None => Err(Fault::UnknownComponent { name: element.to_owned(), known }),
        }
    }

    /// The components along the body's axes of a vector given along the world's.
    pub fn to_body(&self, world: Vector<Symbol>) -> Vector<Symbol> {
        self.attitude().rotate_inverse(world)
    }

    /// The components along the world's axes of a vector given along the body's.
    pub fn to_world(&self, body: Vector<Symbol>) -> Vector<Symbol> {
        self.attitude().rotate(body)
    }

    pub(super) fn symbols(&self) -> &'a Symbols {
        self.symbols
    }

    pub(super) fn recorder(&self) -> &'a Recorder {
        self.recorder
    }

    /// Gives the numbers of a parameter or a phase its name. Other inputs may be named by a `let`, or are arguments with names of their
    /// own.
    pub(super) fn name_inputs(&self, known: &Name, numbers: &[Symbol]) {
        if matches!(known.first.kind, InputKind::Parameter | InputKind::Phase) {
            self.recorder.name(&known.name, numbers);
        }
    }

    fn numbers<const N: usize>(&self, name: &str, shape: Shape) -> [Symbol; N] {
        let fault = match self.symbols.find(name) {
            Some(found) if found.shape == shape => {
                let Input { kind, index } = found.first;
                let numbers = std::array::from_fn(|part| self.recorder.input(Input::new(kind, index + part as u16)));
                self.name_inputs(found, &numbers);
                return numbers;
            }
            Some(found) => Fault::Shape {
                of: format!("`{name}`"),
                found: found.shape.described().to_owned(),
                needed: shape.described().to_owned(),
            },
            None => self.symbols.unknown(name, std::iter::empty()),
        };
        [self.recorder.refuse(fault); N]
    }
}

/// What a closure that records a formula may return.
pub trait Recorded {
    /// Its shape.
    const SHAPE: Shape;
    /// Its numbers.
    fn into_symbols(self) -> Vec<Symbol>;
}

impl Recorded for Symbol {
    const SHAPE: Shape = Shape::Number;
    fn into_symbols(self) -> Vec<Symbol> {
        vec![self]
    }
}

impl Recorded for Vector<Symbol> {
    const SHAPE: Shape = Shape::Vector;
    fn into_symbols(self) -> Vec<Symbol> {
        vec![self.x, self.y, self.z]
    }
}

impl Recorded for Quaternion<Symbol> {
    const SHAPE: Shape = Shape::Quaternion;
    fn into_symbols(self) -> Vec<Symbol> {
        vec![self.x, self.y, self.z, self.w]
    }
}
