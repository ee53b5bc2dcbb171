//! What sessions refuse: batches, methods, times and step sizes.

use super::batch::AnyBatch;
use crate::error::{Error, Result};
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::torque::Kind;

/// The refusal of a torque that is drawn step by step.
pub(crate) const NOISE_REFUSED: &str =
    "white noise is drawn for steps of equal length and has no adaptive ones: use a method with a step dt";

/// Refuses a batch with a torque that has no meaning between equal steps.
pub(crate) fn check_torques(batch: &AnyBatch) -> Result<()> {
    let noise = batch.torques().instances(Kind::WhiteNoise);
    if noise.count == 0 {
        return Ok(());
    }
    let torque = batch.torques().list().iter().position(|instance| instance.kind == Kind::WhiteNoise).unwrap_or(0);
    Err(Error::Torque {
        torque,
        model: "white-noise".into(),
        body: None,
        field: "draws_per_step".into(),
        value: batch.first_parameter(noise.first + 1),
        expected: NOISE_REFUSED.into(),
    })
}

/// The refusal of `taylor` in `f32`.
pub(crate) const TAYLOR_IN_F64: &str = "its series are formed in f64: use precision \"f64\", or method \"rk8\"";

/// The refusal of `taylor` on a GPU.
pub(crate) const TAYLOR_ON_CPU: &str = "its series are formed on the CPU: use engine \"cpu\", or method \"rk8\"";

/// The refusal of other methods where the centre of mass is part of the state.
pub(crate) const COUPLED: &str = "a torque names a position or velocity that has no closed form, which series alone integrate: use method \"taylor\"";

/// Refuses a batch whose centres of mass are part of the state.
pub(crate) fn check_uncoupled(batch: &AnyBatch, method: Method) -> Result<()> {
    if batch.torques().is_coupled() {
        Err(Error::MethodUnavailable { method, expected: COUPLED.into() })
    } else {
        Ok(())
    }
}

/// The refusal of `taylor` with equal steps.
pub(crate) const TAYLOR_ADAPTS: &str = "its steps are adaptive: use a tolerance instead of dt";

/// Refuses equal steps of a method whose steps are adaptive.
pub(crate) fn check_equal_steps(method: Method) -> Result<()> {
    if method == Method::Taylor { Err(taylor_unavailable(TAYLOR_ADAPTS)) } else { Ok(()) }
}

/// The refusal of `taylor`; `expected` says what would be valid.
pub(crate) fn taylor_unavailable(expected: &'static str) -> Error {
    Error::MethodUnavailable { method: Method::Taylor, expected: expected.into() }
}

/// Refuses times at which a closed form cannot be evaluated.
pub(crate) fn check_time(time: f64) -> Result<()> {
    let expected = "expected a finite time (s)";
    if time.is_finite() { Ok(()) } else { Err(Error::Setting { field: "time", value: time, expected }) }
}

/// Refuses step sizes that a precision cannot hold in two words without subnormal numbers.
pub(crate) fn check_step(dt: f64, precision: Precision) -> Result<()> {
    let (least, greatest, expected) = match precision {
        Precision::F32 => (1e-30, 1e30, "expected a step of 1e-30 to 1e30 s in f32"),
        Precision::F64 => (f64::MIN_POSITIVE, f64::MAX, "expected a finite step above zero (s)"),
    };
    if dt >= least && dt <= greatest { Ok(()) } else { Err(Error::Setting { field: "dt", value: dt, expected }) }
}
