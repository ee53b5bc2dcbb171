//! The closed form of torque-free motion, of many bodies at many times.

use glam::{DQuat, DVec3};
use polhode::kernel::free_motion::{FreeMotion, Polhode};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrays::{Column, moved, moved_rows};
use crate::ensemble::Bodies;

/// What the curve of the angular momentum in the body is called.
fn name(polhode: Polhode) -> &'static str {
    match polhode {
        Polhode::Point => "point",
        Polhode::AboutFirst => "about_first",
        Polhode::AboutThird => "about_third",
        Polhode::Separatrix => "separatrix",
    }
}

/// What characterises the motion of one body.
struct Character {
    polhode: Polhode,
    modulus: f64,
    complementary_modulus: f64,
    polhode_period: f64,
    nutation_period: f64,
    mean_precession_rate: f64,
}

impl Character {
    fn of(motion: &FreeMotion) -> Self {
        Self {
            polhode: motion.polhode(),
            modulus: motion.modulus(),
            complementary_modulus: motion.complementary_modulus(),
            polhode_period: motion.polhode_period().unwrap_or(f64::INFINITY),
            nutation_period: motion.nutation_period().unwrap_or(f64::INFINITY),
            mean_precession_rate: motion.mean_precession_rate(),
        }
    }
}

/// States of all bodies at all times, arrays of shape `(bodies, times, …)`, and what characterises each motion.
#[pyfunction]
pub(crate) fn free_motion<'py>(py: Python<'py>, bodies: &Bodies, times: Column<'py>) -> PyResult<Bound<'py, PyDict>> {
    let (ensemble, times) = (&*bodies.0, times.as_array().to_vec());
    let (count, rows) = (ensemble.len(), ensemble.len() * times.len());
    let mut orientation = vec![DQuat::NAN; rows];
    let mut angular_velocity = vec![DVec3::NAN; rows];
    let mut angular_momentum = vec![DVec3::NAN; rows];
    let mut kinetic_energy = vec![f64::NAN; rows];
    let characters: Vec<Character> = py.detach(|| {
        if times.is_empty() {
            return (0..count)
                .into_par_iter()
                .map(|body| Character::of(&FreeMotion::of_body(ensemble, body)))
                .collect();
        }
        let states = orientation.par_chunks_mut(times.len()).zip(angular_velocity.par_chunks_mut(times.len()));
        let states =
            states.zip(angular_momentum.par_chunks_mut(times.len())).zip(kinetic_energy.par_chunks_mut(times.len()));
        let evaluated =
            states.enumerate().map(|(body, (((orientation, angular_velocity), angular_momentum), energy))| {
                let motion = FreeMotion::of_body(ensemble, body);
                for (place, &time) in times.iter().enumerate() {
                    let state = motion.at(time);
                    orientation[place] = state.orientation;
                    angular_velocity[place] = state.angular_velocity_body;
                    angular_momentum[place] = state.angular_momentum_world;
                    energy[place] = state.kinetic_energy;
                }
                Character::of(&motion)
            });
        evaluated.collect()
    });
    let all = PyDict::new(py);
    let shape = [count, times.len()];
    all.set_item("orientation", moved_rows(py, orientation, &shape)?)?;
    all.set_item("angular_velocity", moved_rows(py, angular_velocity, &shape)?)?;
    all.set_item("angular_momentum", moved_rows(py, angular_momentum, &shape)?)?;
    all.set_item("kinetic_energy", moved(py, kinetic_energy, &shape)?)?;
    let column = |of: fn(&Character) -> f64| moved(py, characters.iter().map(of).collect::<Vec<f64>>(), &shape[..1]);
    all.set_item("modulus", column(|of| of.modulus)?)?;
    all.set_item("complementary_modulus", column(|of| of.complementary_modulus)?)?;
    all.set_item("polhode_period", column(|of| of.polhode_period)?)?;
    all.set_item("nutation_period", column(|of| of.nutation_period)?)?;
    all.set_item("mean_precession_rate", column(|of| of.mean_precession_rate)?)?;
    all.set_item("polhode", characters.iter().map(|of| name(of.polhode)).collect::<Vec<_>>())?;
    Ok(all)
}

/// The times from `start` to `end` at which the spin of a body about its middle axis changes sign.
#[pyfunction]
pub(crate) fn flips<'py>(
    py: Python<'py>,
    bodies: &Bodies,
    body: usize,
    start: f64,
    end: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let times: Vec<f64> = FreeMotion::of_body(&bodies.0, body).flips(start, end).collect();
    let shape = [times.len()];
    moved(py, times, &shape)
}
