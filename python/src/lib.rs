//! The extension module of the Python package `polhode`.
//!
//! It converts, and computes nothing of its own: arrays become the library's tables (`arrays`, `ensemble`), declarations become torques
//! (`torque`), a run goes on on a thread of its own (`worker`) and leaves its states in columns that become arrays as they are
//! (`columns`, `run`), with what is asked of them (`observed`). What users see is the Python package beside it, which gives arrays their shapes before they come here.

use pyo3::prelude::*;

mod arrays;
mod columns;
mod ensemble;
mod errors;
mod free_motion;
mod mass;
mod observed;
mod run;
mod toolkit;
mod torque;
mod worker;

#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::ensemble::Bodies;
    #[pymodule_export]
    use crate::free_motion::{flips, free_motion};
    #[pymodule_export]
    use crate::mass::{
        composed_mass_properties, hull_mass_properties, mesh_mass_properties, points_mass_properties, principal,
        shape_mass_properties,
    };
    #[pymodule_export]
    use crate::run::{OpenEngine, adapters, explain, open_engine, run, run_study, study_bodies};
    #[pymodule_export]
    use crate::toolkit::{attitude_error, exponential, logarithm, of_motion};
    #[pymodule_export]
    use crate::torque::{PyForce, PyTorque, custom_force, custom_torque, force, models, torque};

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
