# %% [markdown]
# # The same bodies by polhode, heyoka.py and SciPy
#
# Asymmetric bodies under a constant torque and linear drag, ten seconds, one core. Each program integrates the same ensemble; the error is
# the 99th percentile of the attitude error over the first bodies, against SciPy's DOP853 at a relative tolerance of 1e-13. Times are
# processor times on one core, the best of five, including set-up and planning, but neither heyoka's compilation, which is printed, nor the
# first run of polhode, which starts its threads. `benches/peers` has more problems and tolerances, measured with more care.

# %%
import os

os.environ["RAYON_NUM_THREADS"] = "1"  # before polhode is used: one core for everybody

import time

import heyoka as hy
import numpy as np
import polhode
from scipy.integrate import solve_ivp

count, checked, end = 4096, 64, 10.0
draws = np.random.default_rng(7)
a, b, c = draws.uniform(0.2, 1.0, (3, count))
moments = np.stack([b + c, c + a, a + b], axis=1)
spin = draws.normal(size=(count, 3))
orientation = draws.normal(size=(count, 4))
orientation /= np.linalg.norm(orientation, axis=1, keepdims=True)
torque, drag = draws.uniform(-1.0, 1.0, (count, 3)), draws.uniform(0.01, 0.1, count)


def slope(_, state, moments, torque, drag):
    """Euler's equations along principal axes, and of the quaternion x, y, z, w."""
    (x, y, z, w), omega = state[:4], state[4:]
    turned = [w * omega[0] + y * omega[2] - z * omega[1], w * omega[1] + z * omega[0] - x * omega[2], w * omega[2] + x * omega[1] - y * omega[0]]
    rate = [0.5 * of for of in turned] + [-0.5 * (x * omega[0] + y * omega[1] + z * omega[2])]
    gyroscopic = [(moments[(i + 1) % 3] - moments[(i + 2) % 3]) * omega[(i + 1) % 3] * omega[(i + 2) % 3] for i in range(3)]
    return rate + [(torque[i] - drag * omega[i] + gyroscopic[i]) / moments[i] for i in range(3)]


def by_scipy(body, tolerance):
    start = [*orientation[body], *spin[body]]
    given = (moments[body], torque[body], drag[body])
    return solve_ivp(slope, (0.0, end), start, "DOP853", rtol=tolerance, atol=tolerance, args=given).y[:4, -1]


reference = np.array([by_scipy(body, 1e-13) for body in range(checked)])
rows = []


def row(name, bodies, solve, repeats=5):
    """Solves for the orientations of so many bodies at the end, and takes note of speed and error."""
    seconds = []
    for _ in range(repeats):
        begun = time.process_time()
        states = solve()
        seconds.append(time.process_time() - begun)
    error = np.percentile(polhode.toolkit.attitude_error(states[:checked], reference), 99)
    rows.append((name, bodies * end / min(seconds), error))


# %% [markdown]
# ## polhode

# %%
acting = [polhode.torques.constant_body(torque=torque), polhode.torques.linear_drag(coefficient=drag)]
engine = polhode.Engine("cpu")


def by_polhode(accuracy):
    bodies = polhode.Ensemble(moments, orientation, spin)
    return polhode.run(polhode.Scene(bodies, acting, end=end), engine, accuracy=accuracy).orientation


by_polhode(1e-4)
for accuracy in (1e-4, 1e-6, 1e-8, 1e-10):
    row(f"polhode, {accuracy:g} rad asked for", count, lambda: by_polhode(accuracy))

# %% [markdown]
# ## heyoka.py: adaptive Taylor series in SIMD batches, compiled for the problem

# %%
state = hy.make_vars(*(f"q{name}" for name in "xyzw"), *(f"w{name}" for name in "xyz"))
parameters = [hy.par[place] for place in range(7)]
system = list(zip(state, slope(None, state, parameters[:3], parameters[3:6], parameters[6])))
batch = hy.recommended_simd_size()


def by_heyoka(integrator):
    found = np.empty((count, 4))
    for first in range(0, count, batch):
        here = slice(first, first + batch)
        integrator.set_time(0.0)
        integrator.state[:4], integrator.state[4:] = orientation[here].T, spin[here].T
        integrator.pars[:3], integrator.pars[3:6], integrator.pars[6] = moments[here].T, torque[here].T, drag[here]
        integrator.propagate_until(end)
        found[here] = integrator.state[:4].T
    return found


for tolerance in (1e-6, 1e-9, 1e-12):
    begun = time.process_time()
    integrator = hy.taylor_adaptive_batch(system, np.zeros((7, batch)), pars=np.ones((7, batch)), tol=tolerance, fast_math=True)
    print(f"compiled in {time.process_time() - begun:.2f} s")
    row(f"heyoka.py, tolerance {tolerance:g}", count, lambda: by_heyoka(integrator))

# %% [markdown]
# ## SciPy, body by body

# %%
for tolerance in (1e-6, 1e-9):
    row(f"SciPy DOP853, tolerance {tolerance:g}", checked, lambda: np.array([by_scipy(body, tolerance) for body in range(checked)]), repeats=1)

# %% [markdown]
# ## Side by side

# %%
print(f"{'program':<32}{'body·s/s':>10}{'error, p99 (rad)':>20}")
for name, speed, error in rows:
    print(f"{name:<32}{speed:>10.1e}{error:>20.1e}")

# %%
import matplotlib.pyplot as plt

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for program in ("polhode", "heyoka.py", "SciPy"):
    points = np.array([(error, speed) for name, speed, error in rows if name.startswith(program)])
    axes.loglog(points[:, 0], points[:, 1], "o-", label=program)
axes.set(xlabel="attitude error, 99th percentile (rad)", ylabel="body·s of simulated time per second", title=f"{count:,} driven bodies, 10 s, one core")
axes.legend()
plt.show()
