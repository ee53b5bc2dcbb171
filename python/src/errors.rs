//! The library's errors as Python's exceptions, which `polhode/_errors.py` defines.

use polhode::Error;
use polhode::error::InputFault;
use polhode::expression::TextError;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;

/// The exception of this name with this message.
fn raised(py: Python<'_>, name: &str, message: String) -> PyErr {
    let class = py.import("polhode._errors").and_then(|module| module.getattr(name));
    match class.and_then(|class| class.call1((message.clone(),))) {
        Ok(exception) => PyErr::from_value(exception),
        Err(_) => PyRuntimeError::new_err(message),
    }
}

/// The exception for what the caller has given.
pub(crate) fn input(py: Python<'_>, message: impl Into<String>) -> PyErr {
    raised(py, "InputError", message.into())
}

/// The exception for an error of the library, with its message.
pub(crate) fn of_library(py: Python<'_>, error: &Error) -> PyErr {
    let message = error.to_string();
    match error {
        Error::Interrupted { .. } => PyKeyboardInterrupt::new_err(message),
        Error::File { .. } | Error::FolderNotEmpty { .. } | Error::FolderInUse { .. } | Error::DiskSpace { .. } => {
            raised(py, "FileError", message)
        }
        Error::Input(input) => match &input.fault {
            // The line of the formula, and carets below what is meant.
            InputFault::Formula { picture, .. } => raised(py, "InputError", format!("{message}\n{picture}")),
            _ => raised(py, "InputError", message),
        },
        _ if error.is_input() => raised(py, "InputError", message),
        _ => raised(py, "RunError", message),
    }
}

/// The exception for a formula that is none.
pub(crate) fn of_formula(py: Python<'_>, error: &TextError) -> PyErr {
    let picture = error.picture();
    let place = format!("line {}, column {}: {}", error.line, error.column, error.fault);
    input(py, if picture.is_empty() { place } else { format!("{place}\n{picture}") })
}
