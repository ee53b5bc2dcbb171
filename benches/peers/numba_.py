"""numba: adaptive Dormand-Prince 8(5,3) as a user would write it for speed, compiled by LLVM.

E. Hairer, S. P. Nørsett, G. Wanner, Solving ODEs I, second edition, II.5 and II.10; coefficients from SciPy. Bodies
stand side by side in lanes, each with its own step; loops over the lanes have no branches, so that they become SIMD
code. The stages' sums are written out from the table of coefficients, since a loop over them would read zeros. Bodies
are sorted by spin, because lanes wait for the slowest.
"""

import math
import time
from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np
from scipy.integrate._ivp import dop853_coefficients as dop853

from heyoka_ import slices
from problems import quaternion_rate

NAME = "numba"
VERSION = numba.__version__

LANES = 16
STAGES = dop853.N_STAGES


@numba.njit(fastmath=True, error_model="numpy")
def eccentric_anomaly(e, mean):
    """E − e sin E = M: two iterations of order four (J. M. A. Danby, Celest. Mech. 40 (1987) 303)."""
    sine, cosine = math.sin(mean), math.cos(mean)
    anomaly = mean + e * sine * (1 + e * cosine)
    for _ in range(2):
        sine, cosine = e * math.sin(anomaly), e * math.cos(anomaly)
        excess, slope = anomaly - sine - mean, 1 - cosine
        first = -excess / slope
        second = -excess / (slope + 0.5 * first * sine)
        anomaly -= excess / (slope + 0.5 * second * sine + second * second * cosine / 6)
    return anomaly


def weighted_sum(weights, component):
    terms = [
        f"{float(weight)!r} * k[{7 * stage + component}, l]" for stage, weight in enumerate(weights) if weight != 0.0
    ]
    return " + ".join(terms) if terms else "0.0"


def source(problem):
    """The text of `integrate`: rows of `y` are the state, of `k` the slopes of all stages, one column a lane."""
    rows = problem.parameter_count
    parameters = "(" + ", ".join(f"p[{row}, l]" for row in range(rows)) + ")"
    lines = []

    def emit(depth, text):
        lines.append("    " * depth + text)

    def slopes(depth, stage, state, offset):
        """The slopes of a stage, from the rows of `state`, at the time `t + offset h`."""
        if problem.orbit:
            emit(depth, "for l in range(LANES):")
            emit(depth + 1, f"g[0, l], g[1, l], g[2, l], g[3, l] = place(t[l] + {offset!r} * h[l])")
        emit(depth, "for l in range(LANES):")
        place = "(g[0, l], g[1, l], g[2, l], g[3, l])" if problem.orbit else "(0.0, 0.0, 0.0, 0.0)"
        emit(depth + 1, f"q = ({', '.join(f'{state}[{c}, l]' for c in range(4))})")
        emit(depth + 1, f"w = ({', '.join(f'{state}[{c}, l]' for c in range(4, 7))})")
        emit(depth + 1, f"{', '.join(f'k[{7 * stage + c}, l]' for c in range(4))} = quaternion_rate(q, w)")
        emit(
            depth + 1,
            f"{', '.join(f'k[{7 * stage + c}, l]' for c in range(4, 7))} = acceleration(q, w, {place}, {parameters})",
        )

    emit(0, "def integrate(start, parameters, end, tolerance, result):")
    emit(1, "count = start.shape[1]")
    emit(1, f"y, z, k = np.empty((7, LANES)), np.empty((7, LANES)), np.empty(({7 * (STAGES + 1)}, LANES))")
    emit(1, f"p, g = np.empty(({rows}, LANES)), np.empty((4, LANES))")
    emit(1, "t, h, error, grown = np.empty(LANES), np.empty(LANES), np.empty(LANES), np.empty(LANES)")
    emit(1, "attempts = 0")
    emit(1, "for first in range(0, count, LANES):")
    emit(2, "first = min(first, count - LANES)")
    emit(2, "for l in range(LANES):")
    emit(3, "for c in range(7):")
    emit(4, "y[c, l] = start[c, first + l]")
    emit(3, f"for c in range({rows}):")
    emit(4, "p[c, l] = parameters[c, first + l]")
    emit(3, "t[l] = 0.0")
    emit(3, "spin = math.sqrt(y[4, l] ** 2 + y[5, l] ** 2 + y[6, l] ** 2)")
    emit(3, "h[l] = min(end, tolerance ** 0.125 / (1.0 + spin))")
    slopes(2, 0, "y", 0.0)
    emit(2, "running = True")
    emit(2, "while running:")
    emit(3, "attempts += LANES")
    for stage in range(1, STAGES):
        emit(3, "for l in range(LANES):")
        for c in range(7):
            emit(4, f"z[{c}, l] = y[{c}, l] + h[l] * ({weighted_sum(dop853.A[stage, :stage], c)})")
        slopes(3, stage, "z", float(dop853.C[stage]))
    emit(3, "for l in range(LANES):")
    for c in range(7):
        emit(4, f"z[{c}, l] = y[{c}, l] + h[l] * ({weighted_sum(dop853.B, c)})")
    slopes(3, STAGES, "z", 1.0)
    # The error of q is taken as it is, that of ω relative to |ω|, with a floor for bodies nearly at rest.
    emit(3, "for l in range(LANES):")
    emit(
        4,
        "spin = math.sqrt(max(y[4, l] ** 2 + y[5, l] ** 2 + y[6, l] ** 2, z[4, l] ** 2 + z[5, l] ** 2 + z[6, l] ** 2))",
    )
    emit(4, "scale = 1.0 / (0.1 + spin)")
    for c in range(7):
        factor = "" if c < 4 else "scale * "
        emit(4, f"five{c} = {factor}({weighted_sum(dop853.E5, c)})")
        emit(4, f"three{c} = {factor}({weighted_sum(dop853.E3, c)})")
    for name in ("five", "three"):
        emit(4, f"{name} = " + " + ".join(f"{name}{c} * {name}{c}" for c in range(7)))
    emit(4, "error[l] = h[l] * five / (tolerance * math.sqrt(five + 0.01 * three + 1e-300))")
    emit(3, "for l in range(LANES):")
    emit(4, "grown[l] = min(6.0, max(0.2, 0.9 / math.sqrt(math.sqrt(math.sqrt(error[l] + 1e-30)))))")
    emit(3, "running = False")
    emit(3, "for l in range(LANES):")
    emit(4, "accepted = error[l] <= 1.0")
    for c in range(7):
        emit(4, f"y[{c}, l] = z[{c}, l] if accepted else y[{c}, l]")
        emit(4, f"k[{c}, l] = k[{7 * STAGES + c}, l] if accepted else k[{c}, l]")
    emit(4, "last = h[l] >= end - t[l]")
    emit(4, "t[l] = (end if last else t[l] + h[l]) if accepted else t[l]")
    # A lane at the end stands still: a step of no length is accepted and changes nothing.
    emit(4, "h[l] = min(end - t[l], max(h[l], 1e-12 * end) * grown[l])")
    emit(3, "for l in range(LANES):")
    emit(4, "running = running or t[l] < end")
    emit(2, "for l in range(LANES):")
    emit(3, "for c in range(4):")
    emit(4, "result[c, first + l] = y[c, l]")
    emit(1, "return attempts")
    return "\n".join(lines) + "\n"


def compiled(problem):
    options = {"fastmath": True, "error_model": "numpy", "nogil": True}
    place = problem.place(math.sin, math.cos, eccentric_anomaly)
    names = {
        "LANES": LANES,
        "np": np,
        "math": math,
        "quaternion_rate": numba.njit(**options)(quaternion_rate),
        "acceleration": numba.njit(**options)(problem.acceleration),
        "place": numba.njit(**options)(place) if place else None,
    }
    exec(compile(source(problem), f"<{problem.name} for numba>", "exec"), names)
    return numba.njit(**options)(names["integrate"])


KERNELS = {}


class Solver:
    """The kernel of a problem at a tolerance; compiled once a problem."""

    def __init__(self, problem, tolerance, threads=1):
        self.problem, self.tolerance, self.threads = problem, tolerance, threads
        if problem.name not in KERNELS:
            clock = time.perf_counter()
            kernel = compiled(problem)
            bodies = problem.bodies(LANES)
            columns = np.ascontiguousarray(problem.start(bodies)), np.ascontiguousarray(problem.parameters(bodies))
            kernel(*columns, problem.end, 1e-3, np.empty((4, LANES)))
            KERNELS[problem.name] = kernel, time.perf_counter() - clock
        self.kernel, self.compile_seconds = KERNELS[problem.name]

    def __call__(self, bodies):
        """Seconds and orientations at the end, four rows."""
        clock = time.perf_counter()
        start, parameters = self.problem.start(bodies), self.problem.parameters(bodies)
        count = start.shape[1]
        order = np.argsort(np.sum(start[4:] ** 2, axis=0))
        start, parameters = start[:, order], parameters[:, order]
        result = np.empty((4, count))

        def part(here):
            # Columns of a part as an array of its own: strides of a view would be another type to compile for.
            states = np.empty((4, here.stop - here.start))
            columns = np.ascontiguousarray(start[:, here]), np.ascontiguousarray(parameters[:, here])
            self.kernel(*columns, self.problem.end, self.tolerance, states)
            result[:, here] = states

        parts = slices(count, self.threads, LANES)
        if len(parts) == 1:
            part(parts[0])
        else:
            with ThreadPoolExecutor(self.threads) as pool:
                list(pool.map(part, parts))
        states = np.empty_like(result)
        states[:, order] = result
        return time.perf_counter() - clock, states
