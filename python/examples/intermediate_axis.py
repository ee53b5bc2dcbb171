# %% [markdown]
# # A telephone that turns over
#
# Rotation about the axis of the intermediate moment of inertia is unstable (L. Poinsot, 1834; in orbit, V. Dzhanibekov, 1985). Eight
# telephones are thrown up with one turn per second about that axis, and small errors of the hand about the other two. The study is
# `examples/studies/intermediate_axis.toml`; here a dict holds its tables.

# %%
import matplotlib.pyplot as plt
import numpy as np
import polhode

study = {
    "seed": 1985,
    "bodies": {
        "count": 8,
        # 15 cm along y, 7 cm along x, 8 mm thick: the moment about x lies between those about y and z.
        "inertia": {"shape": "box", "mass": 0.2, "edges": [0.07, 0.15, 0.008]},
        "angular_velocity": {"distribution": "normal", "mean": [2 * np.pi, 0, 0], "sigma": [0, 0.01, 0.01]},
    },
    "time": {"end": 20.0, "outputs": {"every": 0.05}},
    "accuracy": {"attitude": 1e-8},
    "output": {"snapshots": True},
}
result = polhode.run_study(study)
print(result)

# %% [markdown]
# All states are arrays: times first, then bodies, then components. The spin about x changes its sign again and again, at times that depend
# on the error at the start.

# %%
snapshots = result.snapshots
print(snapshots.angular_velocity_body.shape)
figure, axes = plt.subplots(figsize=(8, 3.5), layout="constrained")
axes.plot(snapshots.times, snapshots.angular_velocity_body[:, :4, 0])
axes.set(xlabel="time (s)", ylabel="spin about x (rad/s)", title="Four of eight telephones")
plt.show()

# %% [markdown]
# No torque acts, so the motion has a closed form. It gives the orientation at any time, the times of the flips, and their period.

# %%
bodies = polhode.Ensemble.from_study(study)
motion = polhode.free_motion(bodies.inertia, bodies.orientation, bodies.angular_velocity_body, 20.0)
for body in range(4):
    print(f"body {body}: a flip every {motion.nutation_period[body]:.3f} s, first at {motion.flips(0.0, 20.0, body)[0]:.3f} s")
error = polhode.toolkit.attitude_error(motion.orientation, result.orientation)
print(f"largest difference from the run after 20 s: {error.max():.1e} rad")

# %% [markdown]
# Orientations are in SciPy's convention, so its rotations can be used: here for the direction of the screen's normal.

# %%
from scipy.spatial.transform import Rotation

normals = Rotation.from_quat(snapshots.orientation[:, 0]).apply([0.0, 0.0, 1.0])
figure, axes = plt.subplots(figsize=(8, 3), layout="constrained")
axes.plot(snapshots.times, normals, label=["x", "y", "z"])
axes.set(xlabel="time (s)", ylabel="normal, world axes", title="Body 0")
axes.legend()
plt.show()
