//! The declaration of a model, stated once.
//!
//! The keys of its table in a study, their defaults and refusals, `polhode run --help`, the table in the documentation of
//! [`crate::torque`] and the checks of values all follow from its [`Declaration`].

use crate::error::Text;

/// A model of a torque.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Declaration {
    /// The name in studies and reports, in lower case with hyphens.
    pub name: Text,
    /// Other names in studies.
    pub aliases: Vec<Text>,
    /// The formula, on one line.
    pub summary: Text,
    /// What users must know to read the formula right, if anything.
    pub note: Option<Text>,
    /// Author, year and equation.
    pub source: Text,
    /// The parameters, in the order in which a torque holds their values.
    pub parameters: Vec<ParameterDeclaration>,
    /// The own state of a sampled torque, numbers and vectors, in its order; the unit is `SI` for the own state of a user's law.
    pub own_state: Vec<ParameterDeclaration>,
    /// Whether it can only take energy.
    pub is_dissipative: bool,
    /// Whether it is drawn anew for each step, so that other steps have other draws.
    pub is_random: bool,
    /// Whether bodies under it turn at I⁻¹ m with their initial moments.
    pub leaves_rigid: bool,
    /// Whether bodies under it turn about a fixed point other than the centre of mass.
    pub has_pivot: bool,
    /// Why a scene has at most one of it, if so.
    pub only_one: Option<Text>,
    /// The index of the first parameter that describes the motion of the centre of mass and is no key of a study, if there are any.
    of_centre: Option<usize>,
}

/// A parameter of a model.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ParameterDeclaration {
    /// The key in studies; `orbit.inclination` is the key `inclination` of the table `orbit`.
    pub name: Text,
    /// Another key for the same number; it excludes the keys that it replaces.
    pub other_key: Option<OtherKey>,
    /// What it is, as "the coefficient c", to be put between "expected" and its axes.
    pub about: Text,
    /// The unit; `1` of a number without one.
    pub unit: Text,
    /// The axes in which it is given, if it has a direction.
    pub frame: Option<Frame>,
    /// Its shape.
    pub shape: Shape,
    /// Which values are valid.
    pub valid: Validity,
    /// Its value where a study omits it.
    pub default: Option<Preset>,
    /// Parameters with the same choice exclude each other, by their keys at the top of the table: exactly one of these is given.
    pub choice: Option<Text>,
    /// For a choice: the first of the keys that are given together, if they stand side by side and not in a table.
    pub beside: Option<Text>,
    /// Whether a study may draw it for each body, or read it from columns of the table of bodies. In Rust every parameter that is not a
    /// whole number or a list may be a column.
    pub per_body: bool,
    /// For a list: the keys of each of its tables.
    pub elements: Vec<ParameterDeclaration>,
    /// Its number among the model's draws, which selects the random numbers; it must never change.
    pub draw: u16,
    /// Whether the torque is proportional to it, so that a body for which it is zero feels none.
    pub is_factor: bool,
    /// Whether the rate of a phase follows from it.
    pub sets_phase_rate: bool,
}

/// Another key of a parameter in studies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OtherKey {
    /// The key, with the table that contains it.
    pub name: Text,
    /// Keys beside it that are meaningless with it.
    pub excludes: Vec<Text>,
}

/// Axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// The body's.
    Body,
    /// The world's.
    World,
}

/// The shape of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Shape {
    /// A number.
    Number,
    /// Three numbers.
    Vector,
    /// A quaternion, which rotates body coordinates to world.
    Rotation,
    /// Three rows of three numbers.
    Matrix,
    /// An inertia tensor.
    Tensor,
    /// A whole number, the same for all bodies.
    Whole,
    /// A list of tables, each of which has the parameters [`ParameterDeclaration::elements`]; the same for all bodies.
    List,
}

/// Which values of a parameter are valid; all must be finite.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Validity {
    /// All finite values.
    Finite,
    /// Zero and above.
    NotNegative,
    /// Above zero.
    Positive,
    /// From one number to another, both included.
    Range(f64, f64),
    /// For a list: the number of tables, from one number to another, both included.
    Count(usize, usize),
    /// Nonzero vectors with a length whose square neither overflows nor loses digits.
    NotZero,
    /// Nonzero quaternions.
    Rotation,
    /// Matrices that are symmetric to 1e-12 of their largest element and have no negative eigenvalue.
    PositiveSemidefinite,
}

/// The value of a parameter that a study omits.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Preset {
    /// This number, for each component.
    Number(f64),
    /// This whole number.
    Whole(u64),
    /// The study's seed.
    Seed,
}

impl Declaration {
    pub(crate) fn new(name: impl Into<Text>, summary: impl Into<Text>, source: impl Into<Text>) -> Self {
        Self {
            name: name.into(),
            aliases: Vec::new(),
            summary: summary.into(),
            note: None,
            source: source.into(),
            parameters: Vec::new(),
            own_state: Vec::new(),
            is_dissipative: false,
            is_random: false,
            leaves_rigid: true,
            has_pivot: false,
            only_one: None,
            of_centre: None,
        }
    }

    pub(crate) fn alias(mut self, name: impl Into<Text>) -> Self {
        self.aliases.push(name.into());
        self
    }

    pub(crate) fn note(mut self, note: impl Into<Text>) -> Self {
        self.note = Some(note.into());
        self
    }

    pub(crate) fn pivot(mut self) -> Self {
        self.has_pivot = true;
        self
    }

    pub(crate) fn dissipative(mut self) -> Self {
        self.is_dissipative = true;
        self
    }

    pub(crate) fn random(mut self) -> Self {
        self.is_random = true;
        self
    }

    pub(crate) fn not_rigid(mut self) -> Self {
        self.leaves_rigid = false;
        self
    }

    pub(crate) fn only_one(mut self, expected: impl Into<Text>) -> Self {
        self.only_one = Some(expected.into());
        self
    }

    /// Adds parameters; each is drawn by its position unless another number is declared.
    pub(crate) fn parameters(mut self, parameters: impl IntoIterator<Item = ParameterDeclaration>) -> Self {
        for mut parameter in parameters {
            if parameter.draw == BY_PLACE {
                parameter.draw = self.parameters.len() as u16;
            }
            self.parameters.push(parameter);
        }
        self
    }

    /// Adds parameters that describe the motion of the centre of mass, which no study states at the torque.
    pub(crate) fn parameters_of_centre(self, parameters: impl IntoIterator<Item = ParameterDeclaration>) -> Self {
        let first = self.parameters.len();
        Self { of_centre: Some(first), ..self.parameters(parameters) }
    }

    /// The parameters without those that describe the motion of the centre of mass.
    #[cfg(feature = "study")]
    pub(crate) fn parameters_of_study(&self) -> &[ParameterDeclaration] {
        &self.parameters[..self.of_centre.unwrap_or(self.parameters.len())]
    }

    pub(crate) fn own_state(mut self, parts: impl IntoIterator<Item = ParameterDeclaration>) -> Self {
        self.own_state = parts.into_iter().collect();
        self
    }

    /// Name and aliases.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        std::iter::once(&self.name).chain(&self.aliases).map(Text::as_ref)
    }

    /// The position of a parameter among all.
    pub fn position(&self, name: &str) -> Option<usize> {
        self.parameters.iter().position(|parameter| parameter.name == name)
    }
}

/// Placeholder until the parameter has its position.
const BY_PLACE: u16 = u16::MAX;

impl ParameterDeclaration {
    fn new(name: impl Into<Text>, shape: Shape, unit: impl Into<Text>, about: impl Into<Text>) -> Self {
        Self {
            name: name.into(),
            other_key: None,
            about: about.into(),
            unit: unit.into(),
            frame: None,
            shape,
            valid: Validity::Finite,
            default: None,
            choice: None,
            beside: None,
            per_body: !matches!(shape, Shape::Matrix | Shape::Whole | Shape::List),
            elements: Vec::new(),
            draw: BY_PLACE,
            is_factor: false,
            sets_phase_rate: false,
        }
    }

    pub(crate) fn number(name: impl Into<Text>, unit: impl Into<Text>, about: impl Into<Text>) -> Self {
        Self::new(name, Shape::Number, unit, about)
    }

    pub(crate) fn vector(name: impl Into<Text>, unit: impl Into<Text>, frame: Frame, about: impl Into<Text>) -> Self {
        Self { frame: Some(frame), ..Self::new(name, Shape::Vector, unit, about) }
    }

    pub(crate) fn rotation(name: impl Into<Text>, about: impl Into<Text>) -> Self {
        Self { valid: Validity::Rotation, ..Self::new(name, Shape::Rotation, "1", about) }
    }

    pub(crate) fn matrix(name: impl Into<Text>, unit: impl Into<Text>, frame: Frame, about: impl Into<Text>) -> Self {
        Self { frame: Some(frame), ..Self::new(name, Shape::Matrix, unit, about) }
    }

    pub(crate) fn tensor(name: impl Into<Text>, about: impl Into<Text>) -> Self {
        Self { frame: Some(Frame::Body), ..Self::new(name, Shape::Tensor, "kg m²", about) }
    }

    pub(crate) fn whole(name: impl Into<Text>, about: impl Into<Text>) -> Self {
        Self::new(name, Shape::Whole, "1", about)
    }

    /// A list of tables.
    pub(crate) fn list(
        name: impl Into<Text>,
        (least, most): (usize, usize),
        about: impl Into<Text>,
        elements: Vec<ParameterDeclaration>,
    ) -> Self {
        Self { valid: Validity::Count(least, most), elements, ..Self::new(name, Shape::List, "1", about) }
    }

    pub(crate) fn of_shape(self, shape: Shape) -> Self {
        Self { shape, ..self }
    }

    pub(crate) fn valid(self, valid: Validity) -> Self {
        Self { valid, ..self }
    }

    pub(crate) fn or(self, default: Preset) -> Self {
        Self { default: Some(default), ..self }
    }

    /// Another key of the same table, with the keys beside it that are meaningless with it.
    pub(crate) fn or_key(self, name: &'static str, excludes: &[&'static str]) -> Self {
        let excludes = excludes.iter().map(|&name| name.into()).collect();
        Self { other_key: Some(OtherKey { name: name.into(), excludes }), ..self }
    }

    pub(crate) fn choice(self, choice: impl Into<Text>) -> Self {
        Self { choice: Some(choice.into()), ..self }
    }

    /// For a choice: given side by side with `first`.
    pub(crate) fn beside(self, first: impl Into<Text>) -> Self {
        Self { beside: Some(first.into()), ..self }
    }

    /// The same for all bodies.
    pub(crate) fn constant(self) -> Self {
        Self { per_body: false, ..self }
    }

    pub(crate) fn drawn_as(self, draw: u16) -> Self {
        Self { draw, ..self }
    }

    pub(crate) fn factor(self) -> Self {
        Self { is_factor: true, ..self }
    }

    pub(crate) fn phase_rate(self) -> Self {
        Self { sets_phase_rate: true, ..self }
    }

    /// Its description, with its axes.
    pub fn with_axes(&self) -> String {
        let axes = match self.frame {
            Some(Frame::Body) => " in body axes",
            Some(Frame::World) => " in world axes",
            None => "",
        };
        format!("{}{axes}", self.about)
    }

    /// What a refusal says would be valid.
    pub fn expected(&self) -> Text {
        self.valid.expected(self.shape, &self.unit)
    }

    /// For a choice: the alternative that it belongs to, by its first key.
    pub fn alternative(&self) -> &str {
        let top = self.name.split('.').next().unwrap_or_default();
        self.beside.as_deref().unwrap_or(top)
    }
}

impl Validity {
    /// What a refusal says would be valid.
    pub(crate) fn expected(&self, shape: Shape, unit: &str) -> Text {
        let unit = in_brackets(unit);
        let (what, are) = match shape {
            Shape::Whole => ("a whole number", "is"),
            Shape::Number => ("a finite number", "is"),
            _ => ("finite components", "are"),
        };
        match self {
            Validity::Finite => format!("expected {what}{unit}"),
            Validity::NotNegative => format!("expected {what} that {are} not negative{unit}"),
            Validity::Positive => format!("expected {what} above zero{unit}"),
            Validity::Range(low, high) => format!("expected {what} from {low} to {high}{unit}"),
            Validity::Count(least, most) => format!("expected a list of {least} to {most} tables"),
            Validity::NotZero => format!("expected finite components and a length from 1e-153 to 1e153{unit}"),
            Validity::Rotation => "expected a finite quaternion that is not zero".to_owned(),
            Validity::PositiveSemidefinite => {
                format!("expected a finite symmetric matrix without negative eigenvalues{unit}")
            }
        }
        .into()
    }

    /// Whether a number, or a component, is valid.
    pub(crate) fn holds(&self, x: f64) -> bool {
        x.is_finite()
            && match *self {
                Validity::NotNegative => x >= 0.0,
                Validity::Positive => x > 0.0,
                Validity::Range(low, high) => (low..=high).contains(&x),
                Validity::Count(least, most) => x >= least as f64 && x <= most as f64,
                Validity::Finite | Validity::NotZero | Validity::Rotation | Validity::PositiveSemidefinite => true,
            }
    }
}

/// A unit in brackets, to follow a quantity; empty if there is none.
pub(crate) fn in_brackets(unit: &str) -> String {
    if unit == "1" || unit.is_empty() { String::new() } else { format!(" ({unit})") }
}
