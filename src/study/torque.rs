//! `[[torque]]` in study files.

use std::collections::BTreeSet;

use glam::{DMat3, DVec3};

use super::distribution::{Orientation, Scalar, Vector};
use super::draw::Draw;
use super::parameter::{Number, Owner, Source, Triple};
use super::reader::{Node, Table};
use super::table::BodyTable;
use super::variable_inertia::StudyInertia;
use crate::error::Result;
use crate::torque::white_noise::WhiteNoise;
use crate::torque::{Orbit, Torque};

/// A torque of a study: parameters not yet drawn.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StudyTorque {
    model: Model,
    /// Index among the study's torques, from 0; enters the draws.
    index: usize,
}

/// What a model reads.
// A scene has a handful of these, so the room that the smaller ones leave unused does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug, PartialEq)]
enum Model {
    ConstantBody {
        torque: Triple,
    },
    ConstantWorld {
        torque: Triple,
    },
    LinearDrag {
        coefficient: Number,
    },
    MatrixDrag {
        matrix: DMat3,
    },
    QuadraticDrag {
        coefficient: Number,
    },
    Sinusoidal {
        sine: Triple,
        cosine: Triple,
        rate: Number,
    },
    GravityGradient {
        orbit: StudyOrbit,
    },
    HeavyTop {
        mass: Number,
        centre: Triple,
        gravity: Triple,
    },
    MagneticDipole {
        moment: Triple,
        field: Triple,
    },
    OrbitingDipole {
        moment: Triple,
        orbit: StudyOrbit,
        strength: Number,
        tilt: Number,
        azimuth: Number,
        rotation: Number,
    },
    EddyCurrent {
        coefficient: Number,
        field: Triple,
    },
    SineSpring {
        stiffness: Number,
        target: Orientation,
    },
    LogSpring {
        stiffness: Number,
        target: Orientation,
    },
    InternalDissipation {
        coefficient: Number,
    },
    WhiteNoise {
        intensity: Number,
        seed: Option<u64>,
        draws_per_step: u16,
    },
    VariableInertia(StudyInertia),
}

/// An orbit's elements.
#[derive(Clone, Debug, PartialEq)]
struct StudyOrbit {
    mu: Number,
    semi_major_axis: Number,
    eccentricity: Number,
    inclination: Number,
    ascending_node: Number,
    pericentre: Number,
    mean_anomaly: Number,
}

/// The names of the models; `viscous` is another name of `linear-drag`.
const MODELS: &[&str] = &[
    "constant-body",
    "constant-world",
    "viscous",
    "linear-drag",
    "matrix-drag",
    "quadratic-drag",
    "sinusoidal",
    "gravity-gradient",
    "heavy-top",
    "magnetic-dipole",
    "orbiting-dipole",
    "eddy-current",
    "sine-spring",
    "log-spring",
    "internal-dissipation",
    "white-noise",
    "variable-inertia",
];

/// Reads the list `[[torque]]`.
pub(super) fn read(node: &Node<'_>) -> Result<Vec<StudyTorque>> {
    const EXPECTED: &str = "tables [[torque]] are needed";
    let elements = node.elements().ok_or_else(|| node.refuse(EXPECTED))?;
    elements
        .into_iter()
        .enumerate()
        .map(|(index, mut element)| {
            element.path = place(index);
            let table = element.any_table().ok_or_else(|| element.refuse(EXPECTED))?;
            Ok(StudyTorque { model: model(&table)?, index })
        })
        .collect()
}

/// What messages call a torque of the list.
pub(super) fn place(index: usize) -> String {
    format!("torque[{}]", index + 1)
}

fn model(table: &Table<'_>) -> Result<Model> {
    let name = table.need("model", "the name of a torque's model is needed")?.choice(MODELS)?;
    let number = |key: &str, expected: &'static str| table.need(key, expected).and_then(|node| Number::read(&node));
    let number_or = |key: &str, default: f64| match table.find(key) {
        Some(node) => Number::read(&node),
        None => Ok(Number::Drawn(Scalar::Constant(default))),
    };
    let vector = |key: &str, expected: &'static str| table.need(key, expected).and_then(|node| Triple::read(&node));
    let vector_or_zero = |key: &str| match table.find(key) {
        Some(node) => Triple::read(&node),
        None => Ok(Triple::Drawn(Vector::constant(DVec3::ZERO))),
    };
    const COEFFICIENT: &str = "the coefficient is needed";
    Ok(match name {
        "constant-body" | "constant-world" => {
            table.only(&["model", "torque"])?;
            let torque = vector("torque", "a vector is needed (N m)")?;
            if name == "constant-body" { Model::ConstantBody { torque } } else { Model::ConstantWorld { torque } }
        }
        "viscous" | "linear-drag" => {
            table.only(&["model", "coefficient"])?;
            Model::LinearDrag { coefficient: number("coefficient", "the coefficient is needed (N m s)")? }
        }
        "matrix-drag" => {
            table.only(&["model", "matrix"])?;
            const ROWS: &str = "three rows of three finite numbers are needed (N m s, body axes)";
            let node = table.need("matrix", ROWS)?;
            let rows = node.elements().filter(|rows| rows.len() == 3).ok_or_else(|| node.refuse(ROWS))?;
            let rows: Vec<DVec3> = rows.iter().map(|row| row.vector(ROWS)).collect::<Result<_>>()?;
            Model::MatrixDrag { matrix: DMat3::from_cols(rows[0], rows[1], rows[2]).transpose() }
        }
        "quadratic-drag" => {
            table.only(&["model", "coefficient"])?;
            Model::QuadraticDrag { coefficient: number("coefficient", "the coefficient is needed (N m s²)")? }
        }
        "sinusoidal" => {
            table.only(&["model", "sine", "cosine", "rate"])?;
            Model::Sinusoidal {
                sine: vector_or_zero("sine")?,
                cosine: vector_or_zero("cosine")?,
                rate: number("rate", "the angular frequency is needed (rad/s)")?,
            }
        }
        "gravity-gradient" => {
            table.only(&["model", "mu", "orbit"])?;
            Model::GravityGradient { orbit: orbit(table)? }
        }
        "heavy-top" => {
            table.only(&["model", "mass", "centre", "gravity"])?;
            Model::HeavyTop {
                mass: number("mass", "the mass is needed (kg)")?,
                centre: vector("centre", "the centre of mass from the pivot, in body axes, is needed (m)")?,
                gravity: vector("gravity", "gravity in world axes is needed (m/s²)")?,
            }
        }
        "magnetic-dipole" => {
            table.only(&["model", "moment", "field"])?;
            Model::MagneticDipole {
                moment: vector("moment", "the magnetic moment in body axes is needed (A m²)")?,
                field: vector("field", "the field in world axes is needed (T)")?,
            }
        }
        "orbiting-dipole" => {
            table.only(&["model", "moment", "mu", "orbit", "strength", "tilt", "azimuth", "rotation"])?;
            Model::OrbitingDipole {
                moment: vector("moment", "the magnetic moment in body axes is needed (A m²)")?,
                orbit: orbit(table)?,
                strength: number("strength", "the planet's dipole moment times μ0/4π is needed (T m³)")?,
                tilt: number_or("tilt", 0.0)?,
                azimuth: number_or("azimuth", 0.0)?,
                rotation: number_or("rotation", 0.0)?,
            }
        }
        "eddy-current" => {
            table.only(&["model", "coefficient", "field"])?;
            Model::EddyCurrent {
                coefficient: number("coefficient", "the coefficient is needed (N m s/T²)")?,
                field: vector("field", "the field in world axes is needed (T)")?,
            }
        }
        "sine-spring" | "log-spring" => {
            table.only(&["model", "stiffness", "target"])?;
            let stiffness = number("stiffness", "the stiffness is needed (N m)")?;
            let target = table.need("target", "the attitude at rest is needed")?;
            let target = Orientation::read(&target)?;
            if name == "sine-spring" {
                Model::SineSpring { stiffness, target }
            } else {
                Model::LogSpring { stiffness, target }
            }
        }
        "variable-inertia" => Model::VariableInertia(StudyInertia::read(table)?),
        "internal-dissipation" => {
            table.only(&["model", "coefficient"])?;
            Model::InternalDissipation { coefficient: number("coefficient", COEFFICIENT)? }
        }
        _ => {
            table.only(&["model", "intensity", "seed", "draws_per_step"])?;
            const DRAWS: &str = "a whole number from 1 to 65535 is needed";
            let draws_per_step = match table.find("draws_per_step") {
                None => 1,
                Some(node) => {
                    let draws = u16::try_from(node.whole(DRAWS)?).ok();
                    draws.filter(|draws| *draws > 0).ok_or_else(|| node.refuse(DRAWS))?
                }
            };
            Model::WhiteNoise {
                intensity: number("intensity", "the intensity is needed (N m √s)")?,
                seed: table.find("seed").map(|node| node.whole("a whole number is needed")).transpose()?,
                draws_per_step,
            }
        }
    })
}

/// `mu` and `orbit` of a torque's table.
fn orbit(table: &Table<'_>) -> Result<StudyOrbit> {
    let mu = table.need("mu", "the centre's gravitational parameter is needed (m³/s²)")?;
    const EXPECTED: &str = "{ radius = metres } or { semi_major_axis = metres, eccentricity = ... } is needed";
    let node = table.need("orbit", EXPECTED)?;
    let known =
        &["radius", "semi_major_axis", "eccentricity", "inclination", "ascending_node", "pericentre", "mean_anomaly"];
    let elements = node.table(EXPECTED, known)?;
    elements.exclusive("radius", "semi_major_axis")?;
    elements.exclusive("radius", "eccentricity")?;
    let size = elements.find("radius").or_else(|| elements.find("semi_major_axis"));
    let size = size.ok_or_else(|| node.refuse(EXPECTED))?;
    let element = |key: &str| match elements.find(key) {
        Some(node) => Number::read(&node),
        None => Ok(Number::Drawn(Scalar::Constant(0.0))),
    };
    Ok(StudyOrbit {
        mu: Number::read(&mu)?,
        semi_major_axis: Number::read(&size)?,
        eccentricity: element("eccentricity")?,
        inclination: element("inclination")?,
        ascending_node: element("ascending_node")?,
        pericentre: element("pericentre")?,
        mean_anomaly: element("mean_anomaly")?,
    })
}

/// An orbit, its elements drawn; the first of them is the `first`-th parameter.
fn drawn_orbit(source: &Source<'_>, orbit: &StudyOrbit, first: usize) -> Orbit {
    Orbit {
        mu: source.number(&orbit.mu, first),
        semi_major_axis: source.number(&orbit.semi_major_axis, first + 1),
        eccentricity: source.number(&orbit.eccentricity, first + 2),
        inclination: source.number(&orbit.inclination, first + 3),
        ascending_node: source.number(&orbit.ascending_node, first + 4),
        pericentre: source.number(&orbit.pericentre, first + 5),
        mean_anomaly: source.number(&orbit.mean_anomaly, first + 6),
    }
}

impl StudyTorque {
    /// The names of the columns of the table of bodies that the torque reads.
    pub(super) fn columns(&self, names: &mut BTreeSet<String>) {
        let mut number = |number: &Number| number.columns(names);
        let orbit_numbers = |orbit: &StudyOrbit| {
            let StudyOrbit { mu, semi_major_axis, eccentricity, inclination, ascending_node, pericentre, mean_anomaly } =
                orbit.clone();
            [mu, semi_major_axis, eccentricity, inclination, ascending_node, pericentre, mean_anomaly]
        };
        let mut triples: Vec<&Triple> = Vec::new();
        match &self.model {
            Model::ConstantBody { torque } | Model::ConstantWorld { torque } => triples.push(torque),
            Model::LinearDrag { coefficient }
            | Model::QuadraticDrag { coefficient }
            | Model::InternalDissipation { coefficient } => number(coefficient),
            Model::MatrixDrag { .. } => {}
            Model::Sinusoidal { sine, cosine, rate } => {
                triples.extend([sine, cosine]);
                number(rate);
            }
            Model::GravityGradient { orbit } => orbit_numbers(orbit).iter().for_each(number),
            Model::HeavyTop { mass, centre, gravity } => {
                triples.extend([centre, gravity]);
                number(mass);
            }
            Model::MagneticDipole { moment, field } => triples.extend([moment, field]),
            Model::OrbitingDipole { moment, orbit, strength, tilt, azimuth, rotation } => {
                triples.push(moment);
                orbit_numbers(orbit).iter().chain([strength, tilt, azimuth, rotation]).for_each(number);
            }
            Model::EddyCurrent { coefficient, field } => {
                triples.push(field);
                number(coefficient);
            }
            Model::SineSpring { stiffness, .. } | Model::LogSpring { stiffness, .. } => number(stiffness),
            Model::WhiteNoise { intensity, .. } => number(intensity),
            Model::VariableInertia(change) => change.columns(names),
        }
        triples.into_iter().for_each(|triple| triple.columns(names));
    }

    /// The torque, its parameters drawn.
    pub(super) fn torque(&self, draw: Draw, seed: u64, count: usize, table: Option<&BodyTable>) -> Torque {
        let source = Source { draw, count, table, of: Owner::Torque(self.index) };
        let (number, vector) = (|n: &Number, p: usize| source.number(n, p), |v: &Triple, p: usize| source.vector(v, p));
        match &self.model {
            Model::ConstantBody { torque } => Torque::constant_body(vector(torque, 0)),
            Model::ConstantWorld { torque } => Torque::constant_world(vector(torque, 0)),
            Model::LinearDrag { coefficient } => Torque::linear_drag(number(coefficient, 0)),
            Model::MatrixDrag { matrix } => Torque::matrix_drag(*matrix),
            Model::QuadraticDrag { coefficient } => Torque::quadratic_drag(number(coefficient, 0)),
            Model::Sinusoidal { sine, cosine, rate } => {
                Torque::sinusoidal(vector(sine, 0), vector(cosine, 1), number(rate, 2))
            }
            Model::GravityGradient { orbit } => Torque::gravity_gradient(drawn_orbit(&source, orbit, 0)),
            Model::HeavyTop { mass, centre, gravity } => {
                Torque::heavy_top(number(mass, 0), vector(centre, 1), vector(gravity, 2))
            }
            Model::MagneticDipole { moment, field } => Torque::magnetic_dipole(vector(moment, 0), vector(field, 1)),
            Model::OrbitingDipole { moment, orbit, strength, tilt, azimuth, rotation } => Torque::orbiting_dipole(
                vector(moment, 7),
                drawn_orbit(&source, orbit, 0),
                number(strength, 8),
                number(tilt, 9),
                number(azimuth, 10),
                number(rotation, 11),
            ),
            Model::EddyCurrent { coefficient, field } => Torque::eddy_current(number(coefficient, 0), vector(field, 1)),
            Model::SineSpring { stiffness, target } => {
                Torque::sine_spring(number(stiffness, 0), source.orientation(target, 1))
            }
            Model::LogSpring { stiffness, target } => {
                Torque::log_spring(number(stiffness, 0), source.orientation(target, 1))
            }
            Model::InternalDissipation { coefficient } => Torque::internal_dissipation(number(coefficient, 0)),
            Model::WhiteNoise { intensity, seed: own, draws_per_step } => Torque::WhiteNoise(WhiteNoise {
                intensity: number(intensity, 0),
                seed: own.unwrap_or(seed),
                draws_per_step: *draws_per_step,
            }),
            Model::VariableInertia(change) => change.torque(&source),
        }
    }

    /// The key in the file of a parameter that turned out not to be valid.
    pub(super) fn key(&self, field: &str) -> String {
        if let Model::VariableInertia(change) = &self.model {
            return format!("{}.{}", place(self.index), change.key(field));
        }
        let name = match field {
            "orbit.mu" => "mu",
            "matrix_body" => "matrix",
            other => other.strip_suffix("_body").or_else(|| other.strip_suffix("_world")).unwrap_or(other),
        };
        format!("{}.{name}", place(self.index))
    }
}
