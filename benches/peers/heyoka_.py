"""heyoka: adaptive Taylor series, SIMD batches of bodies, compiled by LLVM for the problem and the tolerance.

F. Biscani, D. Izzo, MNRAS 504 (2021) 2614. The integrator is built once for a problem and a tolerance (its time is
stated apart) and then takes one batch of bodies after the other. Options and order of bodies are those that were
fastest on the problem in a trial before the rounds: see `choices`. Batches of twice the SIMD width were slower on all
problems, and so was `compact_mode`.
"""

import itertools
import time
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy

import heyoka as hy
import numpy as np

from problems import NAMES, quaternion_rate

NAME = "heyoka"
VERSION = hy.__version__


def equations(problem, carry_anomaly=False):
    """The right-hand side as expressions; `carry_anomaly`: E is one more state instead of Kepler's equation."""
    names = NAMES + (("anomaly",) if carry_anomaly else ())
    state = hy.make_vars(*names)
    parameters = [hy.par[index] for index in range(problem.parameter_count)]
    q, w = state[:4], state[4:7]
    if carry_anomaly:
        place, anomaly_rate = problem.orbit.place_from_anomaly(state[7], hy.sin, hy.cos, problem.time_unit)
    else:
        place = problem.place(hy.sin, hy.cos, lambda e, mean: hy.kepE(hy.expression(e), mean))
        place = place(hy.time) if place else ()
    rates = list(quaternion_rate(q, w)) + list(problem.acceleration(q, w, place, parameters))
    if carry_anomaly:
        rates.append(anomaly_rate)
    return list(zip(state, rates))


def choices(problem):
    """What is tried before the rounds: wider vector code, bodies sorted by spin, the anomaly in the state."""
    carry = (False, True) if problem.orbit and problem.orbit.eccentricity > 0 else (False,)
    for wide, sort, anomaly in itertools.product((False, True), (False, True), carry):
        yield {"batch": hy.recommended_simd_size(), "force_avx512": wide, "sort": sort, "carry_anomaly": anomaly}


# heyoka keeps compiled code, in memory and on disk: only the first integrator of its kind shows what compiling takes.
FIRST_BUILD = {}
hy.llvm_state.set_diskcache_enabled(False)


class Solver:
    """An integrator for a problem and a tolerance."""

    def __init__(self, problem, tolerance, choice, threads=1):
        self.problem, self.choice, self.threads = problem, choice, threads
        system = equations(problem, choice["carry_anomaly"])
        batch = choice["batch"]
        clock = time.perf_counter()
        integrator = hy.taylor_adaptive_batch(
            system,
            np.zeros((len(system), batch)),
            pars=np.ones((problem.parameter_count, batch)),
            tol=tolerance,
            opt_level=3,
            force_avx512=choice["force_avx512"],
            fast_math=True,
        )
        kind = (problem.name, integrator.order, batch, choice["force_avx512"], choice["carry_anomaly"])
        self.compile_seconds = FIRST_BUILD.setdefault(kind, time.perf_counter() - clock)
        self.integrators = [integrator] + [deepcopy(integrator) for _ in range(threads - 1)]

    def __call__(self, bodies):
        """Seconds and orientations at the end, four rows."""
        clock = time.perf_counter()
        start, parameters = self.problem.start(bodies), self.problem.parameters(bodies)
        count = start.shape[1]
        order = np.arange(count)
        if self.choice["sort"]:
            # Bodies of a batch wait for each other; those of similar spin wait less.
            order = np.argsort(np.sum(start[4:] ** 2, axis=0))
            start, parameters = start[:, order], parameters[:, order]
        result = np.empty((4, count))
        parts = [
            (start[:, part], parameters[:, part], result[:, part])
            for part in slices(count, self.threads, self.choice["batch"])
        ]
        if len(parts) == 1:
            self.pass_over(self.integrators[0], *parts[0])
        else:
            with ThreadPoolExecutor(self.threads) as pool:
                list(pool.map(lambda pair: self.pass_over(pair[0], *pair[1]), zip(self.integrators, parts)))
        states = np.empty_like(result)
        states[:, order] = result
        return time.perf_counter() - clock, states

    def pass_over(self, integrator, start, parameters, result):
        batch, count = self.choice["batch"], start.shape[1]
        state, pars, end = integrator.state, integrator.pars, self.problem.end
        for first in range(0, count, batch):
            # The last batch may have to take some bodies again.
            first = min(first, count - batch)
            here = slice(first, first + batch)
            integrator.set_time(0.0)
            state[:7] = start[:, here]
            state[7:] = 0.0
            pars[:] = parameters[:, here]
            integrator.propagate_until(end)
            result[:, here] = state[:4]


def slices(count, parts, batch):
    """Parts of nearly the same size, whole batches where there are enough."""
    batches = -(-count // batch)
    parts = max(1, min(parts, batches))
    edges = [min(count, batch * (batches * part // parts)) for part in range(parts + 1)]
    return [slice(low, high) for low, high in zip(edges, edges[1:])]


def chosen(problem, bodies, tolerance=1e-9, repeats=5):
    """The fastest of the choices on some bodies, by processor time, which other work on the machine disturbs less."""
    candidates = list(choices(problem))
    solvers = [Solver(problem, tolerance, choice) for choice in candidates]
    seconds = np.full(len(solvers), np.inf)
    for _ in range(repeats):
        for index, solver in enumerate(solvers):
            clock = time.process_time()
            solver(bodies)
            seconds[index] = min(seconds[index], time.process_time() - clock)
    return candidates[int(np.argmin(seconds))]
