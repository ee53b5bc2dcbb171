//! Torques and forces.

use numpy::PyReadonlyArrayDyn;
use polhode::expression::{Fault, TextError};
use polhode::torque::{
    Argument, Declaration, Frame, ParameterDeclaration, Parameters, Preset, Shape, Validity, Value, declarations,
};
use polhode::{Force, Torque};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyString};

use crate::arrays::{matrix, parameter, quaternion, tensor, vector};
use crate::errors;

/// A torque: a model and the values of its parameters.
#[pyclass(frozen, module = "polhode", name = "Torque")]
pub(crate) struct PyTorque {
    pub(crate) torque: Torque,
    text: String,
}

#[pymethods]
impl PyTorque {
    /// The name of the model in studies and reports.
    #[getter]
    fn name(&self) -> &str {
        self.torque.name()
    }

    /// Whether it can only take energy from a body.
    #[getter]
    fn dissipative(&self) -> bool {
        self.torque.dissipative()
    }

    fn __repr__(&self) -> &str {
        &self.text
    }
}

/// A force on the centres of mass.
#[pyclass(frozen, module = "polhode", name = "Force")]
pub(crate) struct PyForce {
    pub(crate) force: Force,
    text: String,
}

#[pymethods]
impl PyForce {
    /// The name in studies.
    #[getter]
    fn name(&self) -> &str {
        self.force.name()
    }

    fn __repr__(&self) -> &str {
        &self.text
    }
}

type Array<'py> = PyReadonlyArrayDyn<'py, f64>;

/// The shapes of arrays that a parameter may have, for refusals.
fn shapes(declared: &ParameterDeclaration) -> &'static str {
    match (declared.shape, declared.per_body || declared.shape == Shape::Matrix) {
        (Shape::Number, true) => "a number or an array of shape (n,), one a body",
        (Shape::Number, false) => "a number",
        (Shape::Vector, true) => "an array of shape (3,), or (n, 3), one row a body",
        (Shape::Vector, false) => "an array of shape (3,)",
        (Shape::Rotation, _) => "a quaternion x, y, z, w: an array of shape (4,), or (n, 4), one row a body",
        (Shape::Matrix, _) => "a matrix of shape (3, 3), or (n, 3, 3), one a body",
        (Shape::Tensor, _) => "a tensor of shape (3, 3), or (n, 3, 3), one a body, or moments of shape (3,)",
        (Shape::Whole, _) => "a whole number that is not negative",
        _ => "a list of dicts",
    }
}

fn argument(model: &str, declared: &ParameterDeclaration, given: &Bound<'_, PyAny>) -> PyResult<Argument> {
    let py = given.py();
    let refused = || {
        let (name, what, unit) = (&declared.name, declared.with_axes(), &declared.unit);
        let unit = if unit == "1" { String::new() } else { format!(" ({unit})") };
        let found = given.getattr("shape").and_then(|shape| shape.str()).or_else(|_| given.repr());
        let found = found.map_or_else(|_| String::new(), |found| format!(" = {found}"));
        let message = format!("{model}: {name}{found}: expected {what}{unit}: {}", shapes(declared));
        errors::input(py, message)
    };
    let array = || given.extract::<Array<'_>>().map_err(|_| refused());
    let value = match declared.shape {
        Shape::Whole => Value::Whole(given.extract().map_err(|_| refused())?),
        Shape::List => {
            let list = given.cast::<PyList>().map_err(|_| refused())?;
            let table = |table: Bound<'_, PyAny>| {
                let table = table.cast_into::<PyDict>().map_err(|_| refused())?;
                arguments(model, &declared.elements, &table)
            };
            return Ok(Argument::Tables(list.iter().map(table).collect::<PyResult<_>>()?));
        }
        Shape::Number => Value::Number(match given.extract::<i128>() {
            Ok(whole) => (whole as f64).into(),
            Err(_) => parameter(&array()?, &[], |x| x.first().copied()).ok_or_else(refused)?,
        }),
        Shape::Vector => Value::Vector(parameter(&array()?, &[3], vector).ok_or_else(refused)?),
        Shape::Rotation => Value::Rotation(parameter(&array()?, &[4], quaternion).ok_or_else(refused)?),
        Shape::Matrix => Value::Matrix(parameter(&array()?, &[3, 3], matrix).ok_or_else(refused)?),
        Shape::Tensor => {
            let array = array()?;
            let read = parameter(&array, &[3, 3], tensor).or_else(|| parameter(&array, &[3], tensor));
            Value::Tensor(read.ok_or_else(refused)?)
        }
        _ => return Err(refused()),
    };
    Ok(Argument::Value(value))
}

fn arguments(
    model: &str,
    declared: &[ParameterDeclaration],
    given: &Bound<'_, PyDict>,
) -> PyResult<Vec<(String, Argument)>> {
    let named = |name: &str, parameter: &&ParameterDeclaration| {
        parameter.name == name || parameter.other_key.as_ref().is_some_and(|other| other.name == name)
    };
    given
        .iter()
        .map(|(name, value)| {
            let name: String = name.extract()?;
            // An unknown name is refused by the library, which lists the known ones.
            let argument = match declared.iter().find(|parameter| named(&name, parameter)) {
                Some(declared) => argument(model, declared, &value)?,
                None => Argument::Value(Value::Absent),
            };
            Ok((name, argument))
        })
        .collect()
}

/// A torque of a model by its name; `parameters` are arrays by the names that the model declares.
#[pyfunction]
pub(crate) fn torque(py: Python<'_>, model: &str, parameters: &Bound<'_, PyDict>, text: String) -> PyResult<PyTorque> {
    let declared = declarations().find(|declaration| declaration.names().any(|name| name == model));
    let given = declared.map_or(Ok(Vec::new()), |declared| arguments(model, &declared.parameters, parameters))?;
    let torque = Torque::named(model, given).map_err(|error| errors::of_library(py, &error))?;
    Ok(PyTorque { torque, text })
}

/// A formula's parameters: name, array, and whether it has one row a body.
type Given<'py> = Vec<(String, Array<'py>, bool)>;

fn parameters(py: Python<'_>, given: &Given<'_>) -> PyResult<Parameters> {
    let mut parameters = Parameters::new();
    for (name, array, per_body) in given {
        let view = array.as_array();
        let row = view.shape().get(usize::from(*per_body)..).unwrap_or_default();
        let added: Result<Parameters, Fault> = match row {
            [] => {
                let number = parameter(array, &[], |x| x.first().copied());
                number.map_or(Ok(parameters.clone()), |number| parameters.number(name, number))
            }
            [3] => {
                let vector = parameter(array, &[3], vector);
                vector.map_or(Ok(parameters.clone()), |vector| parameters.vector(name, vector))
            }
            [4] => {
                let rotation = parameter(array, &[4], quaternion);
                rotation.map_or(Ok(parameters.clone()), |rotation| parameters.rotation(name, rotation))
            }
            other => {
                let message = format!(
                    "parameter {name} of shape {other:?}: expected a number, three (a vector) or four (a rotation x, y, z, w); \
                     per_body=True stands for one row a body"
                );
                return Err(errors::input(py, message));
            }
        };
        parameters = added.map_err(|fault| errors::input(py, format!("parameter {name}: {fault}")))?;
    }
    Ok(parameters)
}

/// A torque by a formula, N m, body axes.
#[pyfunction]
pub(crate) fn custom_torque(
    py: Python<'_>,
    formula: &str,
    given: Given<'_>,
    energy: Option<&str>,
    text: String,
) -> PyResult<PyTorque> {
    let parameters = parameters(py, &given)?;
    let refused = |error: TextError| errors::of_formula(py, &error);
    let mut torque = Torque::custom(formula, parameters.clone()).map_err(refused)?;
    if let Some(energy) = energy {
        torque = torque.with_energy(energy, &parameters).map_err(refused)?;
    }
    Ok(PyTorque { torque, text })
}

/// A force by a formula, N, world axes.
#[pyfunction]
pub(crate) fn custom_force(py: Python<'_>, formula: &str, given: Given<'_>, text: String) -> PyResult<PyForce> {
    let parameters = parameters(py, &given)?;
    let force = Force::custom(formula, parameters).map_err(|error| errors::of_formula(py, &error))?;
    Ok(PyForce { force, text })
}

/// A force of the library by its name, with its one parameter.
#[pyfunction]
pub(crate) fn force(py: Python<'_>, name: &str, given: Array<'_>, text: String) -> PyResult<PyForce> {
    let as_vector = || parameter(&given, &[3], vector);
    let as_number = || parameter(&given, &[], |x| x.first().copied());
    let (force, expected) = match name {
        "constant" => {
            (as_vector().map(Force::constant), "force: expected an array of shape (3,) or (n, 3) (N, world axes)")
        }
        "gravity" => (
            as_vector().map(Force::gravity),
            "acceleration: expected an array of shape (3,) or (n, 3) (m/s², world axes)",
        ),
        "thrust" => (as_vector().map(Force::thrust), "force: expected an array of shape (3,) or (n, 3) (N, body axes)"),
        "linear-drag" => {
            (as_number().map(Force::linear_drag), "coefficient: expected a number or an array of shape (n,) (N s/m)")
        }
        "quadratic-drag" => (
            as_number().map(Force::quadratic_drag),
            "coefficient: expected a number or an array of shape (n,) (N s²/m²)",
        ),
        _ => (None, "expected constant, gravity, linear-drag, quadratic-drag or thrust"),
    };
    match force {
        Some(force) => Ok(PyForce { force, text }),
        None => Err(errors::input(py, format!("force {name}: {expected}"))),
    }
}

fn range(valid: Validity) -> String {
    match valid {
        Validity::NotNegative => "not negative".to_owned(),
        Validity::Positive => "above zero".to_owned(),
        Validity::NotZero => "not zero".to_owned(),
        Validity::Range(low, high) => format!("{low} to {high}"),
        Validity::Count(least, most) => format!("{least} to {most} of them"),
        Validity::PositiveSemidefinite => "symmetric, without negative eigenvalues".to_owned(),
        _ => String::new(),
    }
}

fn described_parameter<'py>(py: Python<'py>, declared: &ParameterDeclaration) -> PyResult<Bound<'py, PyDict>> {
    let described = PyDict::new(py);
    described.set_item("name", &*declared.name)?;
    described.set_item("other", declared.other_key.as_ref().map(|other| other.name.to_string()))?;
    described.set_item("about", &*declared.about)?;
    described.set_item("unit", &*declared.unit)?;
    described.set_item("frame", declared.frame.map(|frame| if frame == Frame::Body { "body" } else { "world" }))?;
    described.set_item("shape", shapes(declared))?;
    described.set_item("is_list", declared.shape == Shape::List)?;
    described.set_item("range", range(declared.valid))?;
    let default = match declared.default {
        None => py.None().into_bound(py),
        Some(Preset::Number(number)) => number.into_pyobject(py)?.into_any(),
        Some(Preset::Whole(number)) => number.into_pyobject(py)?.into_any(),
        // A study's own seed is 0 where it names none.
        Some(_) => 0_u64.into_pyobject(py)?.into_any(),
    };
    described.set_item("default", default)?;
    described.set_item("choice", declared.choice.as_ref().map(|choice| choice.to_string()))?;
    described.set_item("alternative", PyString::new(py, declared.alternative()))?;
    let elements = declared.elements.iter().map(|element| described_parameter(py, element));
    described.set_item("elements", elements.collect::<PyResult<Vec<_>>>()?)?;
    Ok(described)
}

fn described<'py>(py: Python<'py>, declaration: &Declaration) -> PyResult<Bound<'py, PyDict>> {
    let described = PyDict::new(py);
    described.set_item("name", &*declaration.name)?;
    described.set_item("aliases", declaration.aliases.iter().map(|alias| alias.to_string()).collect::<Vec<_>>())?;
    described.set_item("summary", &*declaration.summary)?;
    described.set_item("source", &*declaration.source)?;
    let parameters = declaration.parameters.iter().map(|parameter| described_parameter(py, parameter));
    described.set_item("parameters", parameters.collect::<PyResult<Vec<_>>>()?)?;
    Ok(described)
}

/// What the library's models of torques declare.
#[pyfunction]
pub(crate) fn models(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    declarations().map(|declaration| described(py, declaration)).collect()
}
