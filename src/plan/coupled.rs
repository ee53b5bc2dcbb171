//! Scenes whose centres of mass are integrated with the rotation, because a torque asks for them ([`crate::torque::coupled`]). Only Taylor
//! series do this, in `f64` on the CPU.

use crate::engine::Backend;
use crate::error::{Error, Result};
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::scene::{Scene, Stepping};
use crate::torque::Torque;
use crate::torque::coupled::is_carrier;
use crate::torque::force::Force;

/// Refuses a method, precision or engine that cannot step such a scene.
pub(super) fn check(scene: &Scene, engine: &dyn Backend) -> Result<()> {
    let Some((place, torque)) = scene.coupling() else { return Ok(()) };
    let unavailable = |method: Method, hint: &str| {
        let force = scene.forces().iter().position(|force| !force.has_closed_form());
        let under = force
            .map_or(String::new(), |force| format!(" under force {} ({})", force + 1, scene.forces()[force].name()));
        let reason = match is_carrier(torque) {
            true => {
                format!("the rotation with the centres of mass{under}, which turn with the bodies, is by series{hint}")
            }
            false => format!(
                "torque {} ({}) names a position or velocity that has no closed form{under}, which series alone integrate{hint}",
                place + 1,
                torque.name()
            ),
        };
        Err(Error::MethodUnavailable { method, expected: reason.into() })
    };
    let wanted = match scene.stepping() {
        Stepping::Adaptive { method: Method::Taylor, .. } => None,
        Stepping::Pinned { method, .. } | Stepping::Adaptive { method, .. } => Some(method),
        Stepping::Accuracy(_) | Stepping::Statistics(_) => None,
    };
    match wanted {
        Some(method) => {
            unavailable(method, ": use method \"taylor\" with a tolerance, or accuracy.attitude without a method")
        }
        None if scene.torques().iter().any(Torque::is_random) => {
            unavailable(Method::Taylor, ", in steps that have no draws of white noise: leave out one of the two")
        }
        None if engine.speed_of_series().is_none() => {
            let steps = if is_carrier(torque) { ", or a method with a step dt" } else { "" };
            unavailable(Method::Taylor, &format!(", on the CPU: use engine \"cpu\" or \"auto\"{steps}"))
        }
        None if scene.wanted_precision() == Some(Precision::F32) => {
            unavailable(Method::Taylor, ", in f64: use precision \"f64\" or \"auto\"")
        }
        None => Ok(()),
    }
}

/// Which torques require the centres of mass to be integrated with the rotation.
pub(super) fn described(scene: &Scene) -> Option<String> {
    let (place, torque) = scene.coupling()?;
    let why = match is_carrier(torque) {
        true => {
            let turning = scene.forces().iter().position(Force::needs_attitude).unwrap_or_default();
            format!("force {} ({}) turns with the body", turning + 1, scene.forces()[turning].name())
        }
        false => {
            let coupled = scene.torques().iter().enumerate().skip(place).filter(|(_, torque)| torque.is_coupled());
            let names: Vec<String> =
                coupled.map(|(place, torque)| format!("torque {} ({})", place + 1, torque.name())).collect();
            format!("{} names them", names.join(", "))
        }
    };
    Some(format!("position and velocity with the rotation, by taylor on the CPU, as {why}"))
}
