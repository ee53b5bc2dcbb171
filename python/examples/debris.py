# %% [markdown]
# # Fragments of a break-up, from and to data frames
#
# A thousand fragments drift apart while a constant force acts on them, as in `examples/studies/debris.toml`. Here the bodies are a polars
# frame, as a simulation of the break-up would produce it.

# %%
import matplotlib.pyplot as plt
import numpy as np
import polars as pl
import polhode

count = 1000
draws = np.random.default_rng(3)


def direction(length):
    vectors = draws.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True) * length[:, None]


fragments = polhode.inertia.ellipsoid(
    mass=0.5 * np.exp(0.8 * draws.normal(size=count)),  # kg
    semi_axes=draws.uniform([0.02, 0.05, 0.1], [0.05, 0.1, 0.2], (count, 3)),  # m
)
spin, velocity = direction(draws.uniform(0.1, 3.0, count)), direction(draws.normal(20.0, 5.0, count))
orientation = draws.normal(size=(count, 4))
table = pl.DataFrame(
    {
        "mass": fragments.mass,
        **{name: fragments.inertia[:, axis, axis] for axis, name in enumerate(("ixx", "iyy", "izz"))},
        **dict(zip(("qx", "qy", "qz", "qw"), orientation.T)),
        **dict(zip(("wx", "wy", "wz"), spin.T)),
        **{name: np.zeros(count) for name in "xyz"},
        **dict(zip(("vx", "vy", "vz"), velocity.T)),
    }
)
table

# %%
bodies = polhode.Ensemble.from_table(table)
scene = polhode.Scene(bodies, forces=polhode.forces.constant(force=[0.0, 0.0, -0.01]), end=60.0, outputs=20.0)
result = polhode.run(scene, accuracy=1e-5)
print(result)

# %% [markdown]
# `to_polars` gives the bodies at the end; `snapshots.to_polars` those at all output times.

# %%
frame = result.snapshots.to_polars().with_columns((pl.col("x") ** 2 + pl.col("y") ** 2 + pl.col("z") ** 2).sqrt().alias("distance"))
print(frame.group_by("t").agg(pl.col("distance").mean(), pl.col("kinetic_energy").sum()).sort("t"))

# %%
figure, axes = plt.subplots(figsize=(6, 5), layout="constrained")
for time, part in frame.group_by("t", maintain_order=True):
    axes.scatter(part["x"], part["z"], s=4, label=f"{time[0]:.0f} s")
axes.set(xlabel="x (m)", ylabel="z (m)", aspect="equal", title="Fragments, world axes")
axes.legend()
plt.show()
