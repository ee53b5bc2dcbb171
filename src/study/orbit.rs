//! What studies cannot mean: angles in degrees without their unit, and orbits within their central body.

use super::reader::Node;
use crate::error::Result;
use crate::torque::{Parameter, ValidationContext, Value};

/// The angles among the keys of an orbit.
const ANGLES: [&str; 4] = ["inclination", "ascending_node", "pericentre", "mean_anomaly"];

/// The parameter that is the equatorial radius of an orbit's centre.
pub(super) const RADIUS: &str = "orbit.equatorial_radius";

/// The greatest angle without a unit, rad: a turn, however its digits are rounded.
const TURN: f64 = 6.3;

/// Keys of distributions whose numbers are no angles.
const NO_ANGLES: [&str; 1] = ["weights"];

/// Whether a parameter is an angle of an orbit; in `[orbit]` names are without that of the table.
pub(super) fn is_angle(name: &str) -> bool {
    ANGLES.contains(&name.strip_prefix("orbit.").unwrap_or(name))
}

/// Refuses angles beyond a turn that have no unit, also within distributions and as values of an axis.
pub(super) fn check_angle(node: &Node<'_>) -> Result<()> {
    let is_beyond = |number: f64| number.abs() > TURN;
    let refused = |number: &str| {
        Err(node.refuse(format!(
            "expected an angle in rad, from -2π to 2π, or one with its unit, such as \"{number} deg\""
        )))
    };
    if let Some(number) = node.any_number() {
        return if is_beyond(number) { refused(&node.text()) } else { Ok(()) };
    }
    if let Some(axis) = node.swept_without_unit() {
        return match axis.iter().find(|number| is_beyond(**number)) {
            Some(number) => refused(&number.to_string()),
            None => Ok(()),
        };
    }
    if let Some(elements) = node.elements() {
        return elements.iter().try_for_each(check_angle);
    }
    let nodes = node.any_table().map(|table| table.nodes()).unwrap_or_default();
    nodes.iter().filter(|(key, _)| !NO_ANGLES.contains(&key.as_str())).try_for_each(|(_, node)| check_angle(node))
}

/// Refuses an orbit whose pericentre is below the equatorial radius of its centre, if the study states that radius or the orbit drifts.
/// `value` is that of a torque's parameter.
pub(super) fn check_pericentre<'v>(
    value: impl Fn(&str) -> Option<&'v Value>,
    is_stated: bool,
    context: &ValidationContext,
) -> Result<()> {
    const AXIS: &str = "orbit.semi_major_axis";
    let number = |name: &str| match value(name) {
        Some(Value::Number(number)) => Some(number),
        _ => None,
    };
    let elements = [AXIS, "orbit.eccentricity", RADIUS, "orbit.j2"].map(number);
    let [Some(axis), Some(eccentricity), Some(radius), Some(j2)] = elements else { return Ok(()) };
    let shared = [axis, eccentricity, radius, j2].into_iter().all(Parameter::is_shared);
    for body in 0..if shared { 1 } else { context.body_count } {
        let [a, e, r, j2] = [axis, eccentricity, radius, j2].map(|parameter| parameter.at(body));
        let pericentre = a * (1.0 - e);
        // What is not valid by itself is refused as that.
        if (is_stated || j2 != 0.0) && a > 0.0 && (0.0..1.0).contains(&e) && pericentre < r {
            let which = if e == 0.0 { String::new() } else { format!("a pericentre, here {pericentre} m, of ") };
            let expected = format!("expected {which}at least the equatorial radius of the central body, {r} m");
            return Err(context.refusal(Some(body).filter(|_| !shared), AXIS, a, expected));
        }
    }
    Ok(())
}
