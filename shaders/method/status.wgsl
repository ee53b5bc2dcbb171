// The status of a body after a step, as numbers in a column of the state. Twin: src/bodies/status.rs.

const NOT_CONVERGED: real = 1.0;
const STEP_TOO_LONG: real = 2.0;
const STEP_BELOW_LIMIT: real = 3.0;

// `status`, or `reason` if there is a fault and there is no reason yet.
fn flagged(status: real, fault: bool, reason: real) -> real {
    let unset = status < 0.5;
    return select(status, reason, fault && unset);
}
