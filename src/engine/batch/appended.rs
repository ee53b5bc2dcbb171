//! Columns that a batch has only for some methods, engines and scenes.

use std::ops::Range;

use glam::DVec3;

use super::Batch;
use crate::bodies::columns::{
    CENTRE_COLUMNS, INVARIANT_COLUMNS, PARAMETER_COMPONENTS, STATE_COMPONENTS, state_columns, stride_of,
};
use crate::bodies::ensemble::Translation;
use crate::kernel::method::projection::combinations;
use crate::math::real::Scalar;
use crate::torque::force::carried::{CENTRE_COMPONENTS, Carried, FORCE_COLUMNS};

impl<T: Scalar> Batch<T> {
    /// Adds the columns of [`crate::kernel::rigid_body::Invariants`], from the present state.
    ///
    /// Only a method that reads them asks for them ([`crate::kernel::method::Step::INVARIANTS`]).
    pub fn append_invariants(&mut self) {
        let stride = self.stride;
        let mut columns = vec![T::default(); INVARIANT_COLUMNS * stride];
        let words = |columns: &[T], column: usize, residue: usize, body: usize| {
            let value = columns[column * stride + body].to_f64();
            if T::WORDS == 2 { value + columns[(column + residue) * stride + body].to_f64() } else { value }
        };
        for body in 0..self.body_count {
            let (mut squared, mut twice_energy) = (0.0, 0.0);
            for axis in 0..3 {
                let m = words(&self.state, 4 + axis, STATE_COMPONENTS, body);
                squared += m * m;
                twice_energy += words(&self.parameters, axis, PARAMETER_COMPONENTS, body) * m * m;
            }
            columns[body] = T::from_f64(squared);
            columns[stride + body] = T::from_f64(0.5 * twice_energy);
        }
        self.parameters.extend_from_slice(&columns);
    }

    /// Adds the columns of [`crate::kernel::method::projection::Combinations`], from the present state, after those of
    /// the invariants.
    pub(crate) fn append_combinations(&mut self) {
        let stride = self.stride;
        let mut columns = vec![T::default(); 3 * stride];
        for body in 0..self.body_count {
            let at = |columns: &[T], column: usize| columns[column * stride + body].to_f64();
            let inverse = [0, 1, 2].map(|axis| at(&self.parameters, axis));
            let kept = combinations(inverse, [4, 5, 6].map(|column| at(&self.state, column)));
            for (column, number) in [kept.first_second, kept.second_third, kept.first_third].into_iter().enumerate() {
                columns[column * stride + body] = T::from_f64(number);
            }
        }
        self.parameters.extend_from_slice(&columns);
    }

    /// Adds the columns of centres of mass, one for each body in the order of rows: forces after the parameters,
    /// position and velocity after the state.
    pub(crate) fn append_centres(&mut self, centres: &[Carried]) {
        let stride = self.stride;
        let mut parameters = vec![T::default(); FORCE_COLUMNS * stride];
        let mut state = vec![T::default(); CENTRE_COMPONENTS * T::WORDS * stride];
        for (row, centre) in centres.iter().enumerate() {
            for (column, number) in centre.parameters().into_iter().enumerate() {
                parameters[column * stride + row] = T::from_f64(number);
            }
            for (column, number) in centre.state().into_iter().enumerate() {
                let (value, residue) = T::two_words(number);
                state[column * stride + row] = value;
                if T::WORDS == 2 {
                    state[(CENTRE_COMPONENTS + column) * stride + row] = residue;
                }
            }
        }
        self.parameters.extend_from_slice(&parameters);
        self.state.extend_from_slice(&state);
    }

    /// Adds the state columns of centres of mass that are integrated with the rotation, one for each body in the order
    /// of rows.
    pub(crate) fn append_integrated_centres(&mut self, translation: &Translation, bodies: &[usize]) {
        let (first, stride) = (self.state.len(), self.stride);
        self.state.resize(first + CENTRE_COLUMNS * stride, T::default());
        for (row, &body) in bodies.iter().enumerate() {
            let numbers = [translation.position[body].to_array(), translation.velocity[body].to_array()].concat();
            for (column, number) in numbers.into_iter().enumerate() {
                self.state[first + column * stride + row] = T::from_f64(number);
            }
        }
    }

    /// Positions (m) and velocities (m/s), world axes, of some rows, if they are integrated with the rotation.
    pub(crate) fn integrated_centres(&self, rows: Range<usize>) -> Vec<(DVec3, DVec3)> {
        if !self.torques.is_coupled() {
            return Vec::new();
        }
        let first = state_columns::<T>();
        let number = |row: usize, column: usize| self.state[(first + column) * self.stride + row].to_f64();
        let vector = |row: usize, column: usize| DVec3::from([0, 1, 2].map(|axis| number(row, column + axis)));
        rows.map(|row| (vector(row, 0), vector(row, 3))).collect()
    }

    /// The first body `body_count` times, as kernels read it: what the torque table keeps beside the columns is right
    /// only for the first row.
    pub(crate) fn repeated(&self, body_count: usize) -> Self {
        let stride = stride_of(body_count);
        let columns = |numbers: &[T]| -> Vec<T> {
            let firsts = numbers.iter().step_by(self.stride.max(1));
            firsts.flat_map(|&number| std::iter::repeat_n(number, stride)).collect()
        };
        let (parameters, state) = (columns(&self.parameters), columns(&self.state));
        Self { body_count, stride, parameters, state, torques: self.torques.clone(), ends: Vec::new() }
    }

    /// Number of state columns, those of centres of mass among them.
    pub(crate) fn all_state_columns(&self) -> usize {
        self.state.len().checked_div(self.stride).unwrap_or(state_columns::<T>())
    }
}
