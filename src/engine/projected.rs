//! Sessions whose states are projected after each step onto what torque-free bodies conserve.
//!
//! Near the separatrix no other way of stepping keeps the phase:
//!
//! ```
//! use glam::{DQuat, DVec3};
//! use polhode::math::Precision;
//! use polhode::engine::batch::prepare;
//! use polhode::engine::{Backend, End, Engine, unobserved};
//! use polhode::kernel::free_motion::FreeMotion;
//! use polhode::{Ensemble, Method};
//!
//! // Almost on the separatrix: it flips every few seconds.
//! let omega = 5.0 * DVec3::new(1e-6, 1.0, 1e-6);
//! let ensemble = Ensemble::from_columns(&[DVec3::new(1.0, 2.0, 3.0)], &[DQuat::IDENTITY], &[omega])?;
//! let truth = FreeMotion::of_body(&ensemble, 0).at(100.0).orientation;
//! let error = |projected: bool| -> polhode::Result<f64> {
//!     let (frames, batch) = prepare(&ensemble, Precision::F64)?;
//!     let engine = Engine::cpu();
//!     let mut session =
//!         if projected { engine.start_projected(batch, Method::Rk8)? } else { engine.start(batch, Method::Rk8)? };
//!     session.advance_to(End::of_steps(1.0 / 64.0, 6400), &mut unobserved)?;
//!     Ok(frames[0].body_state(session.read(0..1)?.combined(0)).orientation.angle_between(truth))
//! };
//! assert!(error(true)? < 1e-7); // what the angle of two quaternions by arc cosine resolves
//! assert!(error(false)? > 1e-6);
//! # Ok::<(), polhode::Error>(())
//! ```
//!
//! In a scene: [`crate::Scene::projected`].

use crate::engine::batch::{AnyBatch, Batch};
use crate::error::{Error, Result};
use crate::kernel::method::Method;
use crate::math::Precision;

/// Refuses what cannot be projected.
///
/// # Errors
///
/// [`Error::Projection`] in `f32`, under torques, and for a method other than `rk4`, `rk8`, `cf4` and the splittings (one free
/// flow here).
pub fn check(precision: Precision, free: bool, method: Method) -> Result<()> {
    let refused = |expected| Err(Error::Projection { method, expected });
    if precision != Precision::F64 {
        return refused("expected f64");
    }
    if !free {
        return refused("expected bodies without torques, as others conserve nothing of the kind");
    }
    match method {
        Method::Rk4 | Method::Rk8 | Method::Cf4 | Method::Splitting2 | Method::Splitting4 | Method::Splitting6 => {
            Ok(())
        }
        _ => refused("expected one of the methods rk4, rk8, cf4, splitting2, splitting4, splitting6"),
    }
}

/// A batch with the columns of its bodies' conserved quantities.
pub(super) fn conserving(batch: AnyBatch, method: Method) -> Result<Batch<f64>> {
    check(batch.precision(), batch.torques().is_empty(), method)?;
    let AnyBatch::F64(mut batch) = batch else {
        return Err(Error::Projection { method, expected: "expected f64" });
    };
    batch.append_invariants();
    batch.append_combinations();
    Ok(batch)
}
