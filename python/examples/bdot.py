# %% [markdown]
# # CubeSats that stop tumbling: a torque of your own
#
# Satellites of one to three units are released tumbling, and only magnetic coils slow them down: the coils' moment opposes the change of
# the field that a magnetometer measures, m = -k dB/dt. polhode has no such torque. You write it down once, with operators on Python
# objects, and it runs on the CPU and on a GPU without calling Python. The study is `examples/studies/bdot.toml`.

# %%
import matplotlib.pyplot as plt
import numpy as np
import polhode
from polhode import formula as f

count = 100
draws = np.random.default_rng(1)
edges = draws.uniform([0.1, 0.1, 0.1], [0.1, 0.1, 0.34], (count, 3))  # m
direction = draws.normal(size=(count, 3))
direction /= np.linalg.norm(direction, axis=1, keepdims=True)
bodies = polhode.Ensemble(
    polhode.inertia.box(edges=edges, density=1200.0).inertia,
    draws.normal(size=(count, 4)),
    direction * draws.uniform(0.175, 0.7, (count, 1)),  # 10 to 40 degrees a second
)
bodies

# %% [markdown]
# World axes: the direction to the satellite and its rate along the orbit, the tilted dipole's direction, the field and its rate.

# %%
orbit, inclination, tilt, earth = 1.1068e-3, 0.9, 2.97, 7.292115e-5  # rad/s, rad, rad, rad/s
strength = 2.397e-5  # T
u = orbit * f.time + f.parameter(draws.uniform(0, 2 * np.pi, count), per_body=True)
r = f.vec(f.cos(u), f.sin(u) * np.cos(inclination), f.sin(u) * np.sin(inclination))
v = orbit * f.vec(-f.sin(u), f.cos(u) * np.cos(inclination), f.cos(u) * np.sin(inclination))
d = f.vec(np.sin(tilt) * f.cos(earth * f.time), np.sin(tilt) * f.sin(earth * f.time), np.cos(tilt))
field = strength * (3 * f.dot(d, r) * r - d)
rate = strength * 3 * (f.dot(d, v) * r + f.dot(d, r) * v)

# %% [markdown]
# Body axes: the measured field and its change; three coils, each limited to its greatest moment.

# %%
b = f.to_body(field)
change = f.to_body(rate) + f.cross(b, f.angular_velocity)
gain, most = f.parameter(draws.uniform(1e4, 2e4, count), per_body=True), 0.24  # A m² s/T, A m²
coils = f.vec(*(f.clamp(-gain * component, -most, most) for component in (change.x, change.y, change.z)))
torque = f.custom(f.cross(coils, b))

scene = polhode.Scene(bodies, torque, end=22_708.0, outputs=567.7, statistics=["spin_rate"])  # four orbits
result = polhode.run(scene, method="rk8", tolerance=1e-9)
print(result)

# %% [markdown]
# The spin falls until the satellites follow the field, which turns twice per orbit.

# %%
spin = np.linalg.norm(result.snapshots.angular_velocity_body, axis=2)
orbits = result.snapshots.times / 5677.0
figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
axes.semilogy(orbits, spin, color="0.75", linewidth=0.6)
axes.semilogy(orbits, result.statistics["spin_rate"].mean, color="C0", label="mean")
axes.axhline(2 * orbit, color="C3", linestyle=":", label="twice the orbit's rate")
axes.set(xlabel="orbits", ylabel="spin (rad/s)", title="A hundred CubeSats under the B-dot law")
axes.legend()
plt.show()
