//! The table of bodies.

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::inertia::{InertiaTensor, principal_axes};

/// The relative slack of the triangle inequality I₁ + I₂ ≥ I₃: measured plates miss it by rounding.
pub const TRIANGLE_SLACK: f64 = 1e-12;

/// A table of independent rigid bodies, by column.
///
/// Every row is valid: finite, the tensor positive definite with I₁ + I₂ ≥ I₃ (1 − 1e-12), the orientation a unit
/// quaternion. Rows keep their order everywhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ensemble {
    inertia: Vec<InertiaTensor>,
    orientation: Vec<DQuat>,
    angular_velocity_body: Vec<DVec3>,
    translation: Option<Translation>,
}

/// The columns of bodies that also move through space, shape `[body_count]` each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Translation {
    /// Mass, kg, above zero.
    pub mass: Vec<f64>,
    /// Position of the centre of mass at t = 0, m, world axes.
    pub position: Vec<DVec3>,
    /// Velocity of the centre of mass at t = 0, m/s, world axes.
    pub velocity: Vec<DVec3>,
}

impl Ensemble {
    /// An ensemble without bodies.
    pub fn new() -> Self {
        Self::default()
    }

    /// The ensemble with one body for each row of three columns of equal length.
    ///
    /// * `inertia`: tensors about the centre of mass in body axes, kg m² (a [`glam::DMat3`], a [`DVec3`] of moments
    ///   along the body axes, or an [`InertiaTensor`]), shape `[body_count]`;
    /// * `orientation`: rotates body coordinates to world; any non-zero quaternion, normalised here;
    /// * `angular_velocity_body`: rad/s in body axes.
    ///
    /// # Errors
    ///
    /// [`Error::ColumnLength`] where the columns differ in length; [`Error::Body`] for the first body with a value
    /// that is not finite, a tensor that is not positive definite or breaks the triangle inequality, or a zero
    /// quaternion; [`Error::TooManyBodies`] where the memory does not suffice.
    pub fn from_columns<I>(inertia: &[I], orientation: &[DQuat], angular_velocity_body: &[DVec3]) -> Result<Self>
    where
        I: Copy + Into<InertiaTensor> + Sync,
    {
        let count = inertia.len();
        for (column, found) in
            [("orientation", orientation.len()), ("angular_velocity_body", angular_velocity_body.len())]
        {
            if found != count {
                return Err(Error::ColumnLength { column, found, expected: count });
            }
        }
        let mut ensemble = Self::with_capacity(count)?;
        ensemble.inertia.extend(inertia.iter().map(|&tensor| tensor.into()));
        ensemble.orientation.extend_from_slice(orientation);
        ensemble.angular_velocity_body.extend_from_slice(angular_velocity_body);
        ensemble.validate()?;
        Ok(ensemble)
    }

    /// The ensemble whose body `i` is `body(i)`, made on all cores.
    ///
    /// # Errors
    ///
    /// As [`Ensemble::from_columns`].
    pub fn from_fn<I, F>(count: usize, body: F) -> Result<Self>
    where
        I: Into<InertiaTensor>,
        F: Fn(usize) -> (I, DQuat, DVec3) + Sync,
    {
        let mut ensemble = Self::with_capacity(count)?;
        ensemble.inertia.resize(count, InertiaTensor::default());
        ensemble.orientation.resize(count, DQuat::IDENTITY);
        ensemble.angular_velocity_body.resize(count, DVec3::ZERO);
        ensemble
            .inertia
            .par_iter_mut()
            .zip(&mut ensemble.orientation)
            .zip(&mut ensemble.angular_velocity_body)
            .enumerate()
            .for_each(|(index, ((inertia, orientation), angular_velocity))| {
                let row = body(index);
                *inertia = row.0.into();
                *orientation = row.1;
                *angular_velocity = row.2;
            });
        ensemble.validate()?;
        Ok(ensemble)
    }

    /// The same bodies, moving through space.
    ///
    /// # Errors
    ///
    /// [`Error::ColumnLength`] where a column has not one row a body; [`Error::Body`] for the first body with a value
    /// that is not finite or a mass that is not above zero.
    pub fn with_translation(mut self, translation: Translation) -> Result<Self> {
        let expected = self.len();
        for (column, found) in [
            ("mass", translation.mass.len()),
            ("position", translation.position.len()),
            ("velocity", translation.velocity.len()),
        ] {
            if found != expected {
                return Err(Error::ColumnLength { column, found, expected });
            }
        }
        for (body, &mass) in translation.mass.iter().enumerate() {
            if !(mass.is_finite() && mass > 0.0) {
                return Err(Error::Body {
                    body,
                    field: "mass",
                    value: mass,
                    expected: "a finite mass above zero is needed (kg)",
                });
            }
            let vectors = [("x", translation.position[body]), ("vx", translation.velocity[body])];
            for (field, vector) in vectors {
                if let Some(value) = vector.to_array().into_iter().find(|x| !x.is_finite()) {
                    return Err(Error::Body { body, field, value, expected: "finite components are needed" });
                }
            }
        }
        self.translation = Some(translation);
        Ok(self)
    }

    /// Masses, positions and velocities, where the bodies move through space.
    pub fn translation(&self) -> Option<&Translation> {
        self.translation.as_ref()
    }

    fn with_capacity(count: usize) -> Result<Self> {
        let mut ensemble = Self::default();
        crate::memory::require(count, count.saturating_mul(ROW_BYTES), "the table of bodies")?;
        let reserved = ensemble.inertia.try_reserve_exact(count).is_ok()
            && ensemble.orientation.try_reserve_exact(count).is_ok()
            && ensemble.angular_velocity_body.try_reserve_exact(count).is_ok();
        if reserved {
            Ok(ensemble)
        } else {
            Err(crate::memory::refusal(count, count.saturating_mul(ROW_BYTES), "the table of bodies"))
        }
    }

    /// Checks every row and normalises the orientations; the first bad row in order is the one reported.
    fn validate(&mut self) -> Result<()> {
        let first = self
            .inertia
            .par_iter()
            .zip(&mut self.orientation)
            .zip(&self.angular_velocity_body)
            .enumerate()
            .filter_map(|(body, ((inertia, orientation), angular_velocity))| {
                validate_row(body, inertia, orientation, *angular_velocity).err().map(|error| (body, error))
            })
            .min_by_key(|(body, _)| *body);
        match first {
            Some((_, error)) => Err(error),
            None => Ok(()),
        }
    }

    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.inertia.len()
    }

    /// Whether there are no bodies.
    pub fn is_empty(&self) -> bool {
        self.inertia.is_empty()
    }

    /// Inertia tensors in body axes, kg m², shape `[body_count]`.
    pub fn inertia(&self) -> &[InertiaTensor] {
        &self.inertia
    }

    /// Unit quaternions that rotate body coordinates to world, shape `[body_count]`.
    pub fn orientation(&self) -> &[DQuat] {
        &self.orientation
    }

    /// Angular velocities in body axes, rad/s, shape `[body_count]`.
    pub fn angular_velocity_body(&self) -> &[DVec3] {
        &self.angular_velocity_body
    }
}

/// Bytes of one row of the table.
const ROW_BYTES: usize = size_of::<InertiaTensor>() + size_of::<DQuat>() + size_of::<DVec3>();

/// Checks one row and normalises its orientation.
fn validate_row(
    body: usize,
    inertia: &InertiaTensor,
    orientation: &mut DQuat,
    angular_velocity_body: DVec3,
) -> Result<()> {
    let finite = |field: &'static str, value: f64| {
        if value.is_finite() {
            Ok(())
        } else {
            Err(Error::Body { body, field, value, expected: "a finite number is needed" })
        }
    };
    for (field, value) in ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"].into_iter().zip(inertia.to_array()) {
        finite(field, value)?;
    }
    for (field, value) in ["qx", "qy", "qz", "qw"].into_iter().zip(orientation.to_array()) {
        finite(field, value)?;
    }
    for (field, value) in ["wx", "wy", "wz"].into_iter().zip(angular_velocity_body.to_array()) {
        finite(field, value)?;
    }
    let largest = orientation.to_array().into_iter().fold(0.0_f64, |largest, q| largest.max(q.abs()));
    if largest == 0.0 {
        return Err(Error::Body {
            body,
            field: "orientation (qx, qy, qz, qw)",
            value: 0.0,
            expected: "a quaternion that is not zero is needed",
        });
    }
    // Scaled first, so that the norm neither overflows nor underflows.
    *orientation = (*orientation * (1.0 / largest)).normalize();

    let moments = principal_axes(inertia).moments;
    let least = moments.min_element();
    if least <= 0.0 {
        return Err(Error::Body {
            body,
            field: "the least principal moment of inertia",
            value: least,
            expected: "a positive definite tensor is needed (kg m²)",
        });
    }
    if moments.x + moments.y < moments.z * (1.0 - TRIANGLE_SLACK) {
        return Err(Error::Body {
            body,
            field: "I1 + I2 - I3",
            value: moments.x + moments.y - moments.z,
            expected: "no mass distribution has this tensor: I1 + I2 >= I3 is needed (principal moments, kg m²)",
        });
    }
    Ok(())
}
