"""SciPy: `solve_ivp` with DOP853 on many bodies at once.

A call of Python a body and stage would cost a thousand times the arithmetic, so bodies are stacked into one system of
equations and NumPy works on whole columns; the step is then common to a block. Blocks are of bodies of similar spin.
SciPy uses one thread.
"""

import time

import numpy as np
import scipy
from scipy.integrate import solve_ivp

from problems import quaternion_rate

NAME = "SciPy"
VERSION = scipy.__version__

BLOCK = 128


def eccentric_anomaly(e, mean):
    anomaly = mean + e * np.sin(mean)
    for _ in range(6):
        anomaly -= (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
    return anomaly


class Solver:
    """SciPy at a tolerance; nothing is compiled."""

    compile_seconds = 0.0

    def __init__(self, problem, tolerance, threads=1):
        self.problem, self.tolerance = problem, tolerance
        self.place = problem.place(np.sin, np.cos, eccentric_anomaly)

    def __call__(self, bodies):
        """Seconds and orientations at the end, four rows."""
        clock = time.perf_counter()
        start, parameters = self.problem.start(bodies), self.problem.parameters(bodies)
        order = np.argsort(np.sum(start[4:] ** 2, axis=0))
        result = np.empty((4, start.shape[1]))
        for first in range(0, start.shape[1], BLOCK):
            block = order[first : first + BLOCK]
            result[:, block] = self.block(start[:, block], parameters[:, block])
        return time.perf_counter() - clock, result

    def block(self, start, parameters):
        shape = start.shape

        def rate(now, flat):
            state = flat.reshape(shape)
            q, w = state[:4], state[4:]
            place = self.place(now) if self.place else ()
            return np.concatenate([*quaternion_rate(q, w), *self.problem.acceleration(q, w, place, parameters)])

        # SciPy takes no relative tolerance below 100 units of roundoff.
        relative = max(self.tolerance, 2.3e-14)
        solution = solve_ivp(rate, (0.0, self.problem.end), start.ravel(), "DOP853", rtol=relative, atol=self.tolerance)
        if not solution.success:
            raise RuntimeError(solution.message)
        return solution.y[:, -1].reshape(shape)[:4]
