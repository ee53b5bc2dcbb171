"""The truth: the first bodies of an ensemble, more accurately than any program here.

heyoka in 80-bit arithmetic, one body at a time, with parameters formed in that arithmetic too. `matrices` checks it
by other equations in other variables: the rotation matrix and the angular momentum in world axes, SI units, torques
as vectors.
"""

import numpy as np
from scipy.integrate import solve_ivp

from problems import FIELD, GRAVITY, attitude_errors

EXTENDED = np.longdouble


def attitudes(problem, bodies, count):
    """Orientations at the end of the first bodies; four rows, 80 bits."""
    # Here, since `matrices` is used without it too.
    import heyoka as hy

    from heyoka_ import equations

    bodies = {name: column[:count].astype(EXTENDED) for name, column in bodies.items()}
    start, parameters = problem.start(bodies), problem.parameters(bodies)
    integrator = hy.taylor_adaptive(
        equations(problem), start[:, 0], pars=parameters[:, 0], fp_type=EXTENDED, compact_mode=True, high_accuracy=True
    )
    result = np.empty((4, count), EXTENDED)
    for body in range(count):
        integrator.time = EXTENDED(0)
        integrator.state[:] = start[:, body]
        integrator.pars[:] = parameters[:, body]
        outcome = integrator.propagate_until(EXTENDED(problem.end))[0]
        if outcome != hy.taylor_outcome.time_limit:
            raise RuntimeError(f"truth of {problem.name}, body {body}: {outcome}")
        result[:, body] = integrator.state[:4]
    return result


def matrices(problem, bodies, count):
    """Orientations of a few bodies by `matrix_rate` and DOP853 at a tolerance of 1e-13; four rows."""
    return np.stack(
        [matrix_attitude(problem, {name: column[body] for name, column in bodies.items()}) for body in range(count)],
        axis=1,
    )


def matrix_attitude(problem, body):
    x, y, z, w = body["orientation"]
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    momentum = rotation @ (body["inertia"] * body["angular_velocity"])
    # Of order one, for an absolute tolerance.
    unit = np.linalg.norm(momentum)
    start = np.concatenate([rotation.ravel(), momentum / unit])

    def rate(time, state):
        return matrix_rate(problem, body, unit, time, state)

    # Steps no longer than a thousandth of the span put the truncation error under the rounding.
    solution = solve_ivp(
        rate, (0.0, problem.span), start, "DOP853", rtol=1e-13, atol=1e-14, max_step=problem.span / 1000
    )
    return quaternion(solution.y[:9, -1].reshape(3, 3))


def matrix_rate(problem, body, unit, time, state):
    """dR/dt = R [ω]×, dL/dt = R τ."""
    rotation, momentum = state[:9].reshape(3, 3), unit * state[9:]
    omega = (rotation.T @ momentum) / body["inertia"]
    torque = np.zeros(3)
    if "torque" in body:
        torque += body["torque"]
    if "drag" in body:
        torque -= body["drag"] * omega
    if "centre" in body:
        torque += np.cross(body["centre"], rotation.T @ np.array([0.0, 0.0, -GRAVITY]))
    if "dipole" in body:
        torque += np.cross(body["dipole"], rotation.T @ np.array(FIELD))
    if problem.orbit:
        position = orbital_position(problem.orbit, time)
        distance = np.linalg.norm(position)
        u = rotation.T @ (position / distance)
        torque += 3 * problem.orbit.mu / distance**3 * np.cross(u, body["inertia"] * u)
    spin = np.array([[0, -omega[2], omega[1]], [omega[2], 0, -omega[0]], [-omega[1], omega[0], 0]])
    return np.concatenate([(rotation @ spin).ravel(), rotation @ torque / unit])


def orbital_position(orbit, time):
    """Kepler's equation by bisection, and one step of Newton's method for the last digits."""
    e = orbit.eccentricity
    mean = np.sqrt(orbit.mu / orbit.semi_major_axis**3) * time
    low, high = mean - 1.0, mean + 1.0
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (middle, high) if middle - e * np.sin(middle) < mean else (low, middle)
    anomaly = (low + high) / 2
    anomaly -= (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
    plane = orbit.semi_major_axis * np.array([np.cos(anomaly) - e, np.sqrt(1 - e * e) * np.sin(anomaly)])
    return np.array([plane[0], np.cos(orbit.inclination) * plane[1], np.sin(orbit.inclination) * plane[1]])


def quaternion(rotation):
    """x, y, z, w: the eigenvector of the greatest eigenvalue of Davenport's matrix, by SciPy."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(rotation).as_quat()


def checked(problem, bodies, count, few=8):
    """The truth, and the greatest angle by which `matrices` differs from it on a few bodies."""
    truth = attitudes(problem, bodies, count)
    return truth, float(np.max(attitude_errors(matrices(problem, bodies, few), truth[:, :few])))
