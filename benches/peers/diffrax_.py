"""diffrax on JAX, f64: `diffeqsolve` with Dopri8 and a PID controller, mapped over the bodies by `vmap`.

P. Kidger, On Neural Differential Equations, thesis, Oxford 2021. Mapped bodies step together until the last one is at
the end, so bodies are sorted by |ω| and taken in blocks; the size of a block is the fastest of a trial.
"""

import os
import time

os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from problems import eccentric_anomaly, quaternion_rate

jax.config.update("jax_enable_x64", True)

METHOD = "Dopri8, PID controller, vmap"
PRECISION = "f64"
# Error of the result ~ tolerance to this power.
EXPONENT = 1.0
EQUAL_STEPS = False
BLOCKS = (131_072, 1_048_576)
MAX_STEPS = 1_000_000
# The block size of the trial: found once in a process.
FOUND = {}


def version():
    return f"{diffrax.__version__}, JAX {jax.__version__}"


def device():
    return jax.devices()[0].device_kind


def guess(problem, target):
    return target / 10


def label(setting):
    return f"tolerance {setting:.2e}"


def body_solver(problem):
    """The state at the end of one body, seven numbers, ω in rad/s."""
    place = problem.place(jnp.sin, jnp.cos, eccentric_anomaly(jnp.sin, jnp.cos))

    def field(now, state, parameters):
        q, w = state[:4], state[4:]
        g = place(now) if place else ()
        return jnp.stack([*quaternion_rate(q, w), *problem.acceleration(q, w, g, parameters)])

    def solve(body, tolerance):
        start = jnp.concatenate([body["orientation"], problem.time_unit * body["angular_velocity"]])
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            diffrax.Dopri8(),
            t0=0.0,
            t1=problem.end,
            dt0=None,
            y0=start,
            args=jnp.stack(problem.parameter_rows(body)),
            saveat=diffrax.SaveAt(t1=True),
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
            # Nothing is differentiated: a plain loop.
            adjoint=diffrax.ForwardMode() if hasattr(diffrax, "ForwardMode") else diffrax.DirectAdjoint(),
            max_steps=MAX_STEPS,
            throw=False,
        )
        state = solution.ys[0]
        return jnp.concatenate([state[:4], state[4:] / problem.time_unit])

    return solve


class Solver:
    def __init__(self, problem):
        self.problem = problem
        self.block = jax.jit(jax.vmap(body_solver(problem), in_axes=(0, None)))
        self.split = jax.jit(sorted_blocks, static_argnums=1)
        self.join = jax.jit(in_order)

    def __call__(self, bodies, tolerance):
        """Seconds, seconds on the device alone, orientations at the end (four rows)."""
        count = len(bodies["inertia"])
        sizes = sorted({min(size, count) for size in BLOCKS})
        if len(sizes) == 1:
            return self.run(bodies, tolerance, sizes[0])
        if count not in FOUND:
            seconds = {}
            for size in sizes:
                try:
                    self.run(bodies, tolerance, size)
                    seconds[size] = self.run(bodies, tolerance, size)[0]
                except Exception as error:  # Out of memory, for one.
                    print(f"diffrax, block of {size}: {error}", flush=True)
            if not seconds:
                raise RuntimeError("no size of block works")
            print(f"diffrax, {count} bodies, seconds by block: {seconds}", flush=True)
            FOUND[count] = min(seconds, key=seconds.get)
        return self.run(bodies, tolerance, FOUND[count])

    def run(self, bodies, tolerance, size):
        clock = time.perf_counter()
        columns = jax.block_until_ready({name: jnp.asarray(column) for name, column in bodies.items()})
        device_clock = time.perf_counter()
        order, blocks = self.split(columns, size)
        states = [self.block(block, tolerance) for block in blocks]
        result = jax.block_until_ready(self.join(order, states))
        device_seconds = time.perf_counter() - device_clock
        result = np.asarray(result)
        return time.perf_counter() - clock, device_seconds, result[:4]


def sorted_blocks(columns, size):
    """The order of the bodies by |ω|, and blocks of their columns; the last body fills the last block."""
    spin = columns["angular_velocity"]
    order = jnp.argsort(jnp.sum(spin * spin, axis=1))
    count = len(order)
    parts = -(-count // size)
    padded = jnp.pad(order, (0, parts * size - count), mode="edge")
    ordered = {name: column[padded] for name, column in columns.items()}
    return order, [
        {name: column[part * size : (part + 1) * size] for name, column in ordered.items()} for part in range(parts)
    ]


def in_order(order, states):
    """Seven rows in the bodies' own order."""
    states = jnp.concatenate(states)[: len(order)]
    return jnp.zeros_like(states).at[order].set(states).T
