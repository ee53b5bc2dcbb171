"""MuJoCo MJX on JAX: a body with a free joint, mapped over the bodies' inertias by `vmap`; RK4 in equal steps.

E. Todorov, T. Erez, Y. Tassa, IROS 2012, and MJX since. No gravity, contacts or constraints, so only the problem `free`
can be put to it. The loop over steps carries position and velocity alone: the compiler then leaves out what else a step
computes. MuJoCo's RK4 turns the quaternion by a mean angular velocity in body axes, so its attitude is of order two.
"""

import os
import time

os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

METHOD = "RK4, equal steps, vmap"
# Set by the worker before the first solver.
PRECISION = "f32"
# Error of the result ~ step to this power.
EXPONENT = 2.0
EQUAL_STEPS = True
MODEL = """
<mujoco>
  <option integrator="RK4" gravity="0 0 0" timestep="0.01">
    <flag contact="disable" constraint="disable" gravity="disable"/>
  </option>
  <worldbody>
    <body>
      <freejoint/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    </body>
  </worldbody>
</mujoco>
"""


def use(precision):
    global PRECISION
    PRECISION = precision
    jax.config.update("jax_enable_x64", precision == "f64")


def version():
    return f"{mujoco.__version__}, JAX {jax.__version__}"


def device():
    return jax.devices()[0].device_kind


def solves(problem):
    return problem.name == "free"


def guess(problem, target):
    # The error of `free` is 0.76 (dt / s)² rad.
    return min(0.1, (0.8 * target) ** 0.5)


def label(setting):
    return f"dt {setting:.3e}"


class Solver:
    def __init__(self, problem):
        self.problem = problem
        self.dtype = np.float64 if PRECISION == "f64" else np.float32
        model = mjx.put_model(mujoco.MjModel.from_xml_string(MODEL))
        data = mjx.make_data(model)

        def solve(body, steps, dt):
            # Index 0 of the model's bodies is the world.
            mine = model.replace(
                body_inertia=model.body_inertia.at[1].set(body["inertia"]),
                opt=model.opt.replace(timestep=dt),
            )
            x, y, z, w = body["orientation"]
            position = jnp.concatenate([jnp.zeros(3, self.dtype), jnp.stack([w, x, y, z])])
            velocity = jnp.concatenate([jnp.zeros(3, self.dtype), body["angular_velocity"]])

            def step(_, state):
                after = mjx.step(mine, data.replace(qpos=state[0], qvel=state[1]))
                return after.qpos, after.qvel

            position, velocity = jax.lax.fori_loop(0, steps, step, (position, velocity))
            w, x, y, z = position[3:]
            return jnp.concatenate([jnp.stack([x, y, z, w]), velocity[3:]])

        self.solve = jax.jit(jax.vmap(solve, in_axes=(0, None, None), out_axes=1))

    def __call__(self, bodies, dt):
        """Seconds, seconds on the device alone, orientations at the end (four rows)."""
        steps = int(np.ceil(self.problem.span / dt - 1e-9))
        step = self.dtype(self.problem.span / steps)
        clock = time.perf_counter()
        columns = jax.block_until_ready({name: jnp.asarray(column, self.dtype) for name, column in bodies.items()})
        device_clock = time.perf_counter()
        result = jax.block_until_ready(self.solve(columns, steps, step))
        device_seconds = time.perf_counter() - device_clock
        result = np.asarray(result)
        return time.perf_counter() - clock, device_seconds, result[:4]
