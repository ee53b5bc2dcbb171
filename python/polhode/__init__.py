"""Rotation of large ensembles of independent rigid bodies, on the GPU and on all cores of the CPU.

    import numpy as np
    import polhode

    bodies = polhode.Ensemble(
        inertia=[1.0, 2.0, 2.5],                              # kg m², principal moments along the body axes
        angular_velocity_body=np.random.normal(size=(1000, 3)),  # rad/s
    )
    scene = polhode.Scene(bodies, [polhode.torques.linear_drag(coefficient=0.01)], end=60.0)
    result = polhode.run(scene, accuracy=1e-6)
    result.orientation            # (1000, 4): x, y, z, w
    result.report

Conventions. *Body* axes are your own, with the origin at the centre of mass; *world* axes are inertial. A vector's name ends in its
axes. An orientation is a unit quaternion x, y, z, w, as SciPy writes it, and rotates body coordinates to world. All units are SI.

Names are loaded when they are first used, so that the import takes some milliseconds.
"""

from importlib import import_module as _import_module

_MODULES = ("forces", "formula", "inertia", "toolkit", "torques")
_NAMES = {
    "Accuracy": "_run",
    "Engine": "_engine",
    "Ensemble": "_ensemble",
    "Error": "_errors",
    "Event": "_observe",
    "EventRecord": "_result",
    "FileError": "_errors",
    "Force": "_native",
    "FreeMotion": "_free_motion",
    "Histogram": "_observe",
    "HistogramCounts": "_result",
    "InputError": "_errors",
    "Quantity": "_observe",
    "Report": "_report",
    "Result": "_result",
    "RunError": "_errors",
    "Scene": "_run",
    "Snapshots": "_result",
    "Survival": "_result",
    "Torque": "_native",
    "__version__": "_native",
    "devices": "_engine",
    "explain": "_run",
    "free_motion": "_free_motion",
    "run": "_run",
    "run_study": "_run",
}

__all__ = sorted([*_MODULES, *(name for name in _NAMES if not name.startswith("_"))])


def __getattr__(name):
    if name in _MODULES:
        value = _import_module(f"{__name__}.{name}")
    elif name in _NAMES:
        value = getattr(_import_module(f"{__name__}.{_NAMES[name]}"), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__():
    return sorted([*__all__, "__version__", "__doc__", "__all__"])
