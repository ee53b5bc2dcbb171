//! The table of bodies.

use std::ops::Range;

use glam::{DQuat, DVec3};

use crate::bodies::inertia::{InertiaTensor, Validity, repair_triangle_inequality};
use crate::error::InertiaDefect;
use crate::error::{Error, Result};
use crate::math::parallel;

/// Inertia tensors, orientations and angular velocities of some rows.
type Columns<'a> = (&'a mut [InertiaTensor], &'a mut [DQuat], &'a mut [DVec3]);

/// A table of independent rigid bodies, by column.
///
/// Every row is valid: finite, the tensor that of a rigid body ([`Validity`]), the orientation a unit quaternion. Rows keep
/// their order everywhere.
///
/// A tensor whose least moment vanishes to rounding is that of a linear rotor, as the triangle inequality makes the other two
/// equal. A linear rotor has no spin about its axis, and a torque about it has no effect ([`crate::torque::linear_rotor`]).
///
/// ```
/// use glam::{DQuat, DVec3};
/// use polhode::Ensemble;
///
/// let nitrogen = DVec3::new(1.4e-46, 1.4e-46, 0.0);
/// let of_spin = |spin: DVec3| Ensemble::from_columns(&[nitrogen], &[DQuat::IDENTITY], &[spin]);
/// assert!(of_spin(DVec3::new(1e12, 2e12, 0.0))?.is_linear_rotor(0));
/// assert!(of_spin(DVec3::new(1e12, 2e12, 1e9)).is_err());
/// # Ok::<(), polhode::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ensemble {
    inertia: Vec<InertiaTensor>,
    orientation: Vec<DQuat>,
    angular_velocity_body: Vec<DVec3>,
    translation: Option<Translation>,
    repairs: Option<Repairs>,
    /// Indices of the linear rotors, ascending.
    linear_rotors: Vec<u32>,
}

/// The greatest fraction of its angular velocity that a linear rotor may have along its axis: it counts as rounding and is removed.
pub(crate) const AXIAL_SPIN_ROUNDING: f64 = 1e-12;

/// The changes made by [`Ensemble::from_fn_repaired`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct Repairs {
    /// How many tensors were repaired.
    pub bodies: usize,
    /// The greatest |change of a tensor| / |tensor| in the Frobenius norm; 0 if none was repaired.
    pub largest_relative_change: f64,
    /// The greatest relative change that was allowed.
    pub limit: f64,
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
                return Err(Error::ColumnLength { column: column.into(), found, expected: count });
            }
        }
        let mut ensemble = Self::with_capacity(count)?;
        ensemble.inertia.extend(inertia.iter().map(|&tensor| tensor.into()));
        ensemble.orientation.extend_from_slice(orientation);
        ensemble.angular_velocity_body.extend_from_slice(angular_velocity_body);
        ensemble.validate()?;
        Ok(ensemble)
    }

    /// The ensemble whose body `i` is `body(i)`, computed on all cores.
    ///
    /// # Errors
    ///
    /// As [`Ensemble::from_columns`].
    pub fn from_fn<I, F>(count: usize, body: F) -> Result<Self>
    where
        I: Into<InertiaTensor>,
        F: Fn(usize) -> (I, DQuat, DVec3) + Sync,
    {
        let mut ensemble = Self::filled(count, body)?;
        ensemble.validate()?;
        Ok(ensemble)
    }

    /// As [`Ensemble::from_fn`], for measured tensors: a tensor that breaks the triangle inequality slightly is replaced by the nearest
    /// that does not ([`repair_triangle_inequality`]), if this changes it by at most `largest_relative_change`. [`Ensemble::repairs`] tells
    /// what was done.
    ///
    /// ```
    /// use glam::{DQuat, DVec3};
    /// use polhode::Ensemble;
    ///
    /// let measured = [DVec3::new(1.0, 2.0, 3.03), DVec3::new(1.0, 2.0, 2.5)];
    /// let body = |i: usize| (measured[i], DQuat::IDENTITY, DVec3::X);
    /// let ensemble = Ensemble::from_fn_repaired(2, 0.01, body)?;
    /// let repairs = ensemble.repairs().expect("asked for");
    /// assert_eq!(repairs.bodies, 1);
    /// assert!((repairs.largest_relative_change - 0.0046).abs() < 1e-4);
    /// assert!(Ensemble::from_fn_repaired(2, 0.001, body).is_err());
    /// # Ok::<(), polhode::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// As [`Ensemble::from_columns`]; a tensor that would change by more than allowed is refused unchanged.
    /// [`Error::Setting`] if `largest_relative_change` is negative or not finite.
    pub fn from_fn_repaired<I, F>(count: usize, largest_relative_change: f64, body: F) -> Result<Self>
    where
        I: Into<InertiaTensor>,
        F: Fn(usize) -> (I, DQuat, DVec3) + Sync,
    {
        let limit = largest_relative_change;
        if !(limit >= 0.0 && limit.is_finite()) {
            let expected = "expected a number that is not negative";
            return Err(Error::Setting { field: "largest_relative_change", value: limit, expected });
        }
        let mut ensemble = Self::filled(count, body)?;
        let repaired = |tensor: &mut InertiaTensor| match repair_triangle_inequality(tensor, limit) {
            Ok(repair) if repair.relative_change > 0.0 => {
                *tensor = repair.tensor;
                (1, repair.relative_change)
            }
            // A tensor that cannot be repaired is refused below, with its row.
            _ => (0, 0.0),
        };
        let of_task = |_, tensors: &mut [InertiaTensor]| {
            tensors.iter_mut().map(repaired).fold((0, 0.0_f64), |a, b| (a.0 + b.0, a.1.max(b.1)))
        };
        let length = parallel::rows_of_a_task(count);
        let found = parallel::map_tasks(ensemble.inertia.chunks_mut(length), of_task);
        let (bodies, largest_relative_change) = found.into_iter().fold((0, 0.0_f64), |a, b| (a.0 + b.0, a.1.max(b.1)));
        ensemble.repairs = Some(Repairs { bodies, largest_relative_change, limit });
        ensemble.validate()?;
        Ok(ensemble)
    }

    /// The bodies that `body` makes, not yet checked.
    fn filled<I, F>(count: usize, body: F) -> Result<Self>
    where
        I: Into<InertiaTensor>,
        F: Fn(usize) -> (I, DQuat, DVec3) + Sync,
    {
        let mut ensemble = Self::with_capacity(count)?;
        ensemble.inertia.resize(count, InertiaTensor::default());
        ensemble.orientation.resize(count, DQuat::IDENTITY);
        ensemble.angular_velocity_body.resize(count, DVec3::ZERO);
        parallel::for_each_task(ensemble.tasks(), |_, (first, (inertia, orientation, angular_velocity_body))| {
            for place in 0..inertia.len() {
                let row = body(first + place);
                inertia[place] = row.0.into();
                orientation[place] = row.1;
                angular_velocity_body[place] = row.2;
            }
        });
        Ok(ensemble)
    }

    /// The same bodies, moving through space.
    ///
    /// # Errors
    ///
    /// [`Error::ColumnLength`] if a column does not have one row for each body; [`Error::Body`] for the first body with a value
    /// that is not finite or a mass that is not above zero.
    pub fn with_translation(mut self, translation: Translation) -> Result<Self> {
        let expected = self.len();
        for (column, found) in [
            ("mass", translation.mass.len()),
            ("position", translation.position.len()),
            ("velocity", translation.velocity.len()),
        ] {
            if found != expected {
                return Err(Error::ColumnLength { column: column.into(), found, expected });
            }
        }
        for (body, &mass) in translation.mass.iter().enumerate() {
            if !(mass.is_finite() && mass > 0.0) {
                return Err(Error::Body {
                    body,
                    field: "mass",
                    value: mass,
                    expected: "expected a finite mass above zero (kg)",
                });
            }
            let vectors = [("x", translation.position[body]), ("vx", translation.velocity[body])];
            for (field, vector) in vectors {
                if let Some(value) = vector.to_array().into_iter().find(|x| !x.is_finite()) {
                    return Err(Error::Body { body, field, value, expected: "expected finite components" });
                }
            }
        }
        self.translation = Some(translation);
        Ok(self)
    }

    /// The bodies of a range, counted from 0.
    ///
    /// # Panics
    ///
    /// If the range exceeds the ensemble.
    #[must_use]
    pub fn only(&self, bodies: Range<usize>) -> Self {
        let translation = self.translation.as_ref().map(|translation| Translation {
            mass: translation.mass[bodies.clone()].to_vec(),
            position: translation.position[bodies.clone()].to_vec(),
            velocity: translation.velocity[bodies.clone()].to_vec(),
        });
        let linear_rotors = self.linear_rotors.iter().map(|&body| body as usize).filter(|body| bodies.contains(body));
        Self {
            linear_rotors: linear_rotors.map(|body| (body - bodies.start) as u32).collect(),
            inertia: self.inertia[bodies.clone()].to_vec(),
            orientation: self.orientation[bodies.clone()].to_vec(),
            angular_velocity_body: self.angular_velocity_body[bodies].to_vec(),
            translation,
            repairs: None,
        }
    }

    /// The repairs, if they were asked for.
    pub fn repairs(&self) -> Option<Repairs> {
        self.repairs
    }

    /// Masses, positions and velocities, if the bodies move through space.
    pub fn translation(&self) -> Option<&Translation> {
        self.translation.as_ref()
    }

    fn with_capacity(count: usize) -> Result<Self> {
        let mut ensemble = Self::default();
        crate::bodies::memory::require(count, count.saturating_mul(ROW_BYTES), "the table of bodies")?;
        let reserved = ensemble.inertia.try_reserve_exact(count).is_ok()
            && ensemble.orientation.try_reserve_exact(count).is_ok()
            && ensemble.angular_velocity_body.try_reserve_exact(count).is_ok();
        if reserved {
            Ok(ensemble)
        } else {
            Err(crate::bodies::memory::refusal(count, count.saturating_mul(ROW_BYTES), "the table of bodies"))
        }
    }

    /// Some rows after the other, each with the index of its first.
    fn tasks(&mut self) -> impl Iterator<Item = (usize, Columns<'_>)> {
        let length = parallel::rows_of_a_task(self.len());
        let columns = self.inertia.chunks_mut(length).zip(self.orientation.chunks_mut(length));
        let columns = columns.zip(self.angular_velocity_body.chunks_mut(length)).enumerate();
        columns.map(move |(task, ((inertia, orientation), omega))| (task * length, (inertia, orientation, omega)))
    }

    /// Checks every row, normalises the orientations and removes rounding from the angular velocities of linear rotors; reports the
    /// first bad row.
    fn validate(&mut self) -> Result<()> {
        let of_task = |_, (first, (inertia, orientation, angular_velocity)): (usize, Columns<'_>)| {
            let mut remarkable = Vec::new();
            for place in 0..inertia.len() {
                let body = first + place;
                match validate_row(body, &inertia[place], &mut orientation[place], &mut angular_velocity[place]) {
                    Ok(Row::Ordinary) => {}
                    Ok(Row::LinearRotor) => remarkable.push((body, None)),
                    Err(error) => remarkable.push((body, Some(error))),
                }
            }
            remarkable
        };
        let remarkable = parallel::map_tasks(self.tasks(), of_task);
        // In the order of the rows.
        for (body, error) in remarkable.into_iter().flatten() {
            match error {
                Some(error) => return Err(error),
                None => self.linear_rotors.push(body as u32),
            }
        }
        Ok(())
    }

    /// Whether a body is a linear rotor.
    pub fn is_linear_rotor(&self, body: usize) -> bool {
        self.linear_rotors.binary_search(&(body as u32)).is_ok()
    }

    /// Whether one of the bodies is a linear rotor.
    pub(crate) fn has_linear_rotors(&self) -> bool {
        !self.linear_rotors.is_empty()
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

/// The kind of a valid row.
enum Row {
    Ordinary,
    LinearRotor,
}

/// Checks one row, normalises its orientation and removes rounding from the angular velocity of a linear rotor.
fn validate_row(
    body: usize,
    inertia: &InertiaTensor,
    orientation: &mut DQuat,
    angular_velocity_body: &mut DVec3,
) -> Result<Row> {
    let finite = |field: &'static str, value: f64| {
        if value.is_finite() {
            Ok(())
        } else {
            Err(Error::Body { body, field, value, expected: "expected a finite number" })
        }
    };
    let validity = Validity::of(inertia);
    let defect = validity.defect();
    if let Some(defect @ InertiaDefect::NotFinite { .. }) = defect {
        return Err(defect.of_body(body));
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
            expected: "expected a quaternion that is not zero",
        });
    }
    // Scaled first, so that the norm neither overflows nor underflows.
    *orientation = (*orientation * (1.0 / largest)).normalize();
    match defect {
        None => Ok(Row::Ordinary),
        Some(InertiaDefect::VanishingMoment { .. }) => {
            let axis = validity.axes.axis_body(0);
            let along = axis.dot(*angular_velocity_body);
            // Not the norm, whose square may overflow or underflow.
            let whole = angular_velocity_body.abs().max_element();
            if along.abs() > AXIAL_SPIN_ROUNDING * whole {
                let expected =
                    "a linear rotor (principal moments 0, I, I) has no spin about its axis: expected 0 (rad/s)";
                return Err(Error::Body { body, field: "angular velocity along the axis", value: along, expected });
            }
            *angular_velocity_body -= axis * along;
            Ok(Row::LinearRotor)
        }
        Some(defect) => Err(defect.of_body(body)),
    }
}
