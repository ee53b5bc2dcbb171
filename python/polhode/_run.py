"""Scenes and their runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native
from ._arrays import array, number
from ._engine import opened
from ._ensemble import Ensemble
from ._errors import InputError
from ._observe import Event, Histogram, Quantity, asked_quantity
from ._progress import shown
from ._result import Result

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Mapping
    from typing import TypeAlias

    from numpy.typing import ArrayLike, NDArray

    from ._engine import Engine

    #: Whether a bar is shown, or what is told instead.
    Progress: TypeAlias = bool | Callable[[int | None, int | None], object] | None


@dataclass(frozen=True)
class Accuracy:
    """The errors that are asked for, each meant for `percentile` per cent of the bodies at the end.

    Attributes
    ----------
    attitude : rad, in (0, π], or None
    angular_velocity : relative to its magnitude, above 0, or None
    energy : of the rotational kinetic energy, relative, above 0, or None
    percentile : in (0, 100]
    """

    attitude: float | None = 1e-6
    angular_velocity: float | None = None
    energy: float | None = None
    percentile: float = 99.0


def _list(given, of, name):
    elements = [given] if isinstance(given, of) else list(given)
    for place, element in enumerate(elements):
        if not isinstance(element, of):
            made = f", as polhode.{name} makes them" if of in (_native.Torque, _native.Force) else ""
            raise InputError(f"{name}[{place}]: found {type(element).__name__}, expected polhode.{of.__name__}{made}")
    return tuple(elements)


class Scene:
    """Bodies, what acts on them, and what is recorded.

    Parameters
    ----------
    ensemble : Ensemble
    torques : list of Torque, from `polhode.torques`; any number of them, also several of one model
    forces : list of Force, from `polhode.forces`, on the centres of mass of bodies with a mass
    end : the simulated time from 0, s, finite, not negative
    outputs : number, the interval in s at which states are recorded; or an array of increasing times, s; None: the end alone
        The end itself is always recorded.
    statistics : list of quantities, over all bodies at all output times: "kinetic_energy", "spin_rate", "angular_momentum" (and
        "_x", "_y", "_z" of it in world axes), "angular_velocity_x", "_y", "_z", "nutation", "dynamic_inertia", "separatrix_distance",
        "latitude_least", "latitude_middle", "latitude_greatest", "yaw", "pitch", "roll", "potential_energy", "total_energy"; or `Quantity`
    quantiles : percentages, of every quantity that has statistics: each is within 2.5e-4 of itself of the value of that rank
    histograms : list of `Histogram`
    events : list of `Event`
    states : whether states of bodies are recorded. With statistics and without states, statistics alone leave the device.
    skip : whether work that the scene does not need may be left out; it never changes a result beyond its bound
    """

    __slots__ = (
        "ensemble",
        "torques",
        "forces",
        "end",
        "outputs",
        "statistics",
        "quantiles",
        "histograms",
        "events",
        "states",
        "skip",
    )

    ensemble: Ensemble
    torques: tuple[_native.Torque, ...]
    forces: tuple[_native.Force, ...]
    end: float
    outputs: NDArray[np.float64] | None
    statistics: tuple[str | Quantity, ...]
    quantiles: tuple[float, ...]
    histograms: tuple[Histogram, ...]
    events: tuple[Event, ...]
    states: bool
    skip: bool

    def __init__(
        self,
        ensemble: Ensemble,
        torques: _native.Torque | Iterable[_native.Torque] = (),
        forces: _native.Force | Iterable[_native.Force] = (),
        *,
        end: float,
        outputs: ArrayLike | None = None,
        statistics: str | Quantity | Iterable[str | Quantity] = (),
        quantiles: ArrayLike = (),
        histograms: Histogram | Iterable[Histogram] = (),
        events: Event | Iterable[Event] = (),
        states: bool = True,
        skip: bool = True,
    ) -> None:
        if not isinstance(ensemble, Ensemble):
            raise InputError(f"ensemble: found {type(ensemble).__name__}, expected polhode.Ensemble")
        self.ensemble = ensemble
        self.torques = _list(torques, _native.Torque, "torques")
        self.forces = _list(forces, _native.Force, "forces")
        self.end = number(end, "end")
        self.outputs = None if outputs is None else array(outputs, "outputs")
        if self.outputs is not None and self.outputs.ndim > 1:
            raise InputError(f"outputs: shape {self.outputs.shape}: expected an interval or times of shape (t,) (s)")
        self.statistics = (statistics,) if isinstance(statistics, (str, Quantity)) else tuple(statistics)
        self.quantiles = tuple(np.ravel(array(quantiles, "quantiles")).tolist())
        self.histograms = _list(histograms, Histogram, "histograms")
        self.events = _list(events, Event, "events")
        names = [event.name for event in self.events]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"events: {name!r} is the name of two: expected a name of its own for each")
        self.states, self.skip = bool(states), bool(skip)

    def _parts(self):
        is_interval = self.outputs is not None and self.outputs.ndim == 0
        return {
            "bodies": self.ensemble._bodies,
            "torques": list(self.torques),
            "forces": list(self.forces),
            "end": self.end,
            "every": float(self.outputs) if is_interval else None,
            "times": None if is_interval or self.outputs is None else self.outputs.tolist(),
            "asked": {
                "statistics": [asked_quantity(quantity, "statistics") for quantity in self.statistics],
                "quantiles": list(self.quantiles),
                "histograms": [histogram._parts() for histogram in self.histograms],
                "events": [event._parts() for event in self.events],
            },
            "states": self.states,
            "skip": self.skip,
        }

    def __repr__(self) -> str:
        lines = [f"<polhode.Scene: {len(self.ensemble):,} bodies for {self.end:g} s"]
        lines += [f"  {acting!r}" for acting in (*self.torques, *self.forces)]
        return "\n".join(lines) + ">"


def _stepping(accuracy, method, dt, tolerance, least_step, precision, projection):
    if accuracy is None:
        accuracy = Accuracy()
    elif method is not None:
        raise InputError("accuracy excludes method: give one of them")
    elif isinstance(accuracy, dict):
        known = list(Accuracy.__dataclass_fields__)
        unknown = [name for name in accuracy if name not in known]
        if unknown:
            raise InputError(f"accuracy: {unknown[0]!r}: expected {', '.join(known)}")
        accuracy = Accuracy(**{"attitude": None, **accuracy})
    elif not isinstance(accuracy, Accuracy):
        accuracy = Accuracy(attitude=number(accuracy, "accuracy"))
    if method is None:
        for name, value in (("dt", dt), ("tolerance", tolerance), ("least_step", least_step), ("projection", projection or None)):
            if value is not None:
                raise InputError(f'{name}: expected a method beside it: method="rk8", for instance')
    if least_step is not None and tolerance is None:
        raise InputError("least_step: expected the tolerance of adaptive steps beside it")
    return {
        **{name: getattr(accuracy, name) for name in ("attitude", "angular_velocity", "energy", "percentile")},
        "method": method,
        "dt": None if dt is None else number(dt, "dt"),
        "tolerance": None if tolerance is None else number(tolerance, "tolerance"),
        "least_step": None if least_step is None else number(least_step, "least_step"),
        "precision": precision,
        "projection": bool(projection),
    }


def run(
    scene: Scene,
    engine: str | Engine = "auto",
    *,
    accuracy: float | Accuracy | Mapping[str, float | None] | None = None,
    method: str | None = None,
    dt: float | None = None,
    tolerance: float | None = None,
    least_step: float | None = None,
    precision: str | None = None,
    projection: bool = False,
    progress: Progress = None,
) -> Result:
    """Runs a scene and gives the states of all bodies.

    Parameters
    ----------
    scene : Scene
    engine : "auto", "cpu", "gpu" or Engine
    accuracy : number, the attitude error asked for, rad; or Accuracy, or a dict of its attributes. Left out: 1e-6 rad.
        Method, steps and precision follow from it for each class of bodies; `report.accuracy.met` says whether a sample of the bodies,
        recomputed more accurately, has met it.
    method : instead of an accuracy, the integrator: "rk4", "rk8", "cf4", "taylor", ...
    dt : s, the step of the method, above zero; shortened where needed so that output times are hit exactly
    tolerance : instead of dt, for "rk8" and "taylor": the error of one step, which each body then chooses for itself
    least_step : s, with a tolerance: a body that would need a shorter step fails
    precision : "f32", "f64" or None, which leaves the choice to the library
    projection : whether states of torque-free bodies are projected after each step onto what they conserve
    progress : True, False, or a function of what is done and the whole (body-steps, both None while planning). None: a bar of tqdm
        where it is installed and somebody watches.

    Returns
    -------
    Result

    Other Python threads go on meanwhile. Ctrl-C ends the run with KeyboardInterrupt.

    Raises
    ------
    polhode.InputError
        For what is not valid, with the library's message.
    polhode.RunError
        Where a device fails.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"scene: found {type(scene).__name__}, expected polhode.Scene")
    stepping = _stepping(accuracy, method, dt, tolerance, least_step, precision, projection)
    bar = shown(progress)
    try:
        return Result(_native.run(scene._parts(), stepping, opened(engine), bar))
    finally:
        bar.close()


def explain(
    scene: Scene,
    engine: str | Engine = "auto",
    *,
    accuracy: float | Accuracy | Mapping[str, float | None] | None = None,
    method: str | None = None,
    dt: float | None = None,
    tolerance: float | None = None,
    least_step: float | None = None,
    precision: str | None = None,
    projection: bool = False,
) -> Explanation:
    """What `run` would do with the same arguments, what it would skip, and why, as text."""
    if not isinstance(scene, Scene):
        raise InputError(f"scene: found {type(scene).__name__}, expected polhode.Scene")
    stepping = _stepping(accuracy, method, dt, tolerance, least_step, precision, projection)
    return Explanation(_native.explain(scene._parts(), stepping, opened(engine)))


class Explanation(str):
    """A text that shows its lines."""

    def __repr__(self) -> str:
        return str(self)


def run_study(
    study: str | os.PathLike[str] | Mapping[str, Any],
    engine: str | Engine = "auto",
    *,
    precision: str | None = None,
    skip: bool = True,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    progress: Progress = None,
) -> Result:
    """Runs a study: the path of a file, or a dict of the same tables and keys.

    Parameters
    ----------
    study : path, or dict. `polhode run --help` and the documentation of `polhode::study` describe the keys. Files that a dict names are
        looked for in the current folder.
    engine : "auto", "cpu", "gpu" or Engine
    precision : "f32", "f64" or None: as the study says
    skip : whether work that the scene does not need may be left out
    out : path, optional. The folder into which tables and report are written as the command does; the result then holds no states.
    force : whether the folder's former results are replaced
    progress : as in `run`

    Returns
    -------
    Result
        With the states of the end, or of all output times where the study asks for snapshots.
    """
    from ._study import study_text

    bar = shown(progress)
    try:
        return Result(_native.run_study(*study_text(study), precision, skip, opened(engine), out, force, bar))
    finally:
        bar.close()
