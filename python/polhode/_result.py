"""What a run leaves behind."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from ._arrays import columns
from ._errors import InputError
from ._report import Report
from ._tables import Tabular

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.spatial.transform import Rotation

#: Why a body has failed, or that an event has stopped it, by its number in `status`.
REASONS = ("valid", "not_converged", "step_too_long", "step_below_limit", "not_finite", "centre_not_finite", "stopped")


class Snapshots(Tabular):
    """All bodies at all output times, arrays of shape (t, n, ...). The numbers of a body that has failed are NaN.

    `to_arrow`, `to_polars` and `to_pandas` give a table: one row a body and output time, with the columns of `snapshots.csv`.

    Attributes
    ----------
    times : (t,), s
    orientation : (t, n, 4), unit quaternions x, y, z, w, body to world
    angular_velocity_body : (t, n, 3), rad/s, body axes
    angular_momentum_world : (t, n, 3), kg m²/s, world axes
    kinetic_energy : (t, n), rotational, J
    position, velocity : (t, n, 3), m and m/s, world axes; None where the bodies do not move through space
    status : (t, n), 0 or the number of the reason why a body has failed (`polhode.Result.reasons`); 6 where an event has stopped it
    stopped_at : (t, n), when that was, s, NaN as long as none has: the state is that of this time; None where no event stops bodies
    """

    times: NDArray[np.float64]
    orientation: NDArray[np.float64]
    angular_velocity_body: NDArray[np.float64]
    angular_momentum_world: NDArray[np.float64]
    kinetic_energy: NDArray[np.float64]
    position: NDArray[np.float64] | None
    velocity: NDArray[np.float64] | None
    status: NDArray[np.uint8]
    stopped_at: NDArray[np.float64] | None

    def __init__(self, found: dict) -> None:
        self.times = found["times"]
        self.orientation = found["orientation"]
        self.angular_velocity_body = found["angular_velocity"]
        self.angular_momentum_world = found["angular_momentum"]
        self.kinetic_energy = found["kinetic_energy"]
        self.position = found.get("position")
        self.velocity = found.get("velocity")
        self.status = found["status"]
        self.stopped_at = found.get("stopped_at")

    def __len__(self) -> int:
        return len(self.times)

    def _columns(self, outputs=slice(None)):
        bodies = self.status.shape[1]
        times = self.times[outputs]

        def flat(values):
            values = values[outputs]
            return values.reshape(values.shape[0] * values.shape[1], *values.shape[2:])

        made = {
            "body": np.tile(np.arange(bodies), len(times)),
            "t": np.repeat(times, bodies),
            **dict(zip(("qx", "qy", "qz", "qw"), columns(flat(self.orientation)))),
            **dict(zip(("wx", "wy", "wz"), columns(flat(self.angular_velocity_body)))),
            **dict(zip(("lx", "ly", "lz"), columns(flat(self.angular_momentum_world)))),
            "kinetic_energy": flat(self.kinetic_energy),
        }
        if self.position is not None:
            made.update(zip(("x", "y", "z"), columns(flat(self.position))))
            made.update(zip(("vx", "vy", "vz"), columns(flat(self.velocity))))
        if self.stopped_at is not None:
            made["stopped_at"] = flat(self.stopped_at)
        made["status"] = flat(self.status)
        return made

    def __repr__(self) -> str:
        times, bodies = self.status.shape
        return f"<polhode.Snapshots of {bodies:,} bodies at {times:,} times>"


class Summary:
    """One quantity over all bodies that did not fail, at each output time.

    Attributes
    ----------
    unit : str
    count : (t,), bodies behind the figures: those with a finite value
    mean, standard_deviation, min, max : (t,); the deviation is that of the bodies as they are, divided by their number
    min_body, max_body : (t,), the bodies with the least and the greatest value; -1 where no body is left
    quantiles : dict of (t,) by percentage, where the scene asks for any
    """

    unit: str
    count: NDArray[np.int64]
    mean: NDArray[np.float64]
    standard_deviation: NDArray[np.float64]
    min: NDArray[np.float64]
    max: NDArray[np.float64]
    min_body: NDArray[np.int64]
    max_body: NDArray[np.int64]
    quantiles: dict[float, NDArray[np.float64]]

    def __init__(self, figures: dict) -> None:
        self.__dict__.update(figures)

    def __repr__(self) -> str:
        return f"<mean {self.mean[-1]:.6g}, min {self.min[-1]:.6g}, max {self.max[-1]:.6g} {self.unit} at the end>"


class Statistics(dict[str, Summary], Tabular):
    """Of each quantity asked for its `Summary`.

    `to_arrow`, `to_polars` and `to_pandas` give a table: one row an output time, with the columns of `statistics.csv`.

    Attributes
    ----------
    times : (t,), s
    count : (t,), bodies that have not failed; a `Summary` counts those that have its quantity
    """

    times: NDArray[np.float64]
    count: NDArray[np.int64]

    def __init__(self, found: dict) -> None:
        super().__init__({name: Summary(figures) for name, figures in found["quantities"].items()})
        self.times, self.count = found["time"], found["count"]

    def _columns(self):
        made = {"t": self.times, "count": self.count}
        for name, summary in self.items():
            counted = ("count",) if summary._may_be_undefined else ()
            for figure in (*counted, "mean", "standard_deviation", "min", "max", "min_body", "max_body"):
                made[f"{name}_{figure}"] = getattr(summary, figure)
            made.update({f"{name}_q{percent:g}": values for percent, values in summary.quantiles.items()})
        return made


class HistogramCounts(Tabular):
    """How many bodies had a quantity in each of some intervals, at each output time; who has failed or has no such number is in none.

    `to_arrow`, `to_polars` and `to_pandas` give a table: one row an output time and bin, outer bins with infinite edges, as in
    `histograms.csv`.

    Attributes
    ----------
    quantity, unit : str
    edges : (bins + 1,), ascending
    times : (t,), s
    counts : (t, bins)
    below, above : (t,), bodies below the first edge, and not below the last one
    """

    quantity: str
    unit: str
    edges: NDArray[np.float64]
    times: NDArray[np.float64]
    counts: NDArray[np.int64]
    below: NDArray[np.int64]
    above: NDArray[np.int64]

    def __init__(self, found: dict) -> None:
        self.__dict__.update(found)

    def _columns(self):
        times, bins = self.counts.shape
        edges = np.concatenate(([-np.inf], self.edges, [np.inf]))
        return {
            "t": np.repeat(self.times, bins + 2),
            "low": np.tile(edges[:-1], times),
            "high": np.tile(edges[1:], times),
            "count": np.column_stack((self.below, self.counts, self.above)).ravel(),
        }

    def __repr__(self) -> str:
        return f"<polhode.HistogramCounts of {self.quantity}, {len(self.edges) - 1} bins at {len(self.times):,} times>"


class Survival:
    """The share of bodies that have not had an event, at the start and at each output time (Kaplan and Meier; bodies that fail count until then).

    Attributes
    ----------
    t : (t,), s; of a study that sweeps one cell after another
    remaining : (t,), bodies that have neither had it nor failed
    share : (t,), in [0, 1]
    low, high : (t,), its 95 % confidence interval (Rothman's; without failures Wilson's)
    cell : (t,), of a study that sweeps; else None
    """

    t: NDArray[np.float64]
    remaining: NDArray[np.int64]
    share: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    cell: NDArray[np.int64] | None

    def __init__(self, found: dict) -> None:
        self.__dict__.update({"cell": None, **found})

    def __repr__(self) -> str:
        return f"<polhode.Survival: {self.share[-1]:.3g} ({self.low[-1]:.3g} to {self.high[-1]:.3g}) at {self.t[-1]:g} s>"


class EventRecord(Tabular):
    """An event of all bodies: who had it, m of them, by time.

    `to_arrow`, `to_polars` and `to_pandas` give a table: one row a body that had it, with the columns of `events.csv`.

    Attributes
    ----------
    name, quantity, unit, condition : str
    level : float, in the unit
    occurrence : int, which time counts, from 1
    action : str, "record" or "stop"
    bodies : int, of the run
    body : (m,)
    time : (m,), s
    known_to : list of m words: "start"; "located", to 1e-12 of the span; "output", between the output before and this time
    orientation : (m, 4), then: unit quaternions x, y, z, w, body to world
    angular_velocity_body : (m, 3), then: rad/s, body axes
    failed_body, failed_time : (k,), those that failed without having had it, and when that was seen, s
    stopped_body, stopped_time : (k,), those that another event stopped without their having had it, and when, s
    median : float, s, when the share is one half, or None
    survival : Survival
    """

    name: str
    quantity: str
    unit: str
    condition: str
    level: float
    occurrence: int
    action: str
    bodies: int
    body: NDArray[np.int64]
    time: NDArray[np.float64]
    known_to: list[str]
    orientation: NDArray[np.float64]
    angular_velocity_body: NDArray[np.float64]
    failed_body: NDArray[np.int64]
    failed_time: NDArray[np.float64]
    stopped_body: NDArray[np.int64]
    stopped_time: NDArray[np.float64]
    median: float | None
    survival: Survival

    def __init__(self, found: dict) -> None:
        found = dict(found)
        self.name, self.survival = found.pop("event"), Survival(found.pop("survival"))
        self.__dict__.update(found)

    def _columns(self):
        return {
            "body": self.body,
            "t": self.time,
            "known_to": self.known_to,
            **dict(zip(("qx", "qy", "qz", "qw"), columns(self.orientation))),
            **dict(zip(("wx", "wy", "wz"), columns(self.angular_velocity_body))),
        }

    def __repr__(self) -> str:
        return f"<polhode.EventRecord {self.name!r}: {len(self.body):,} of {self.bodies:,} bodies>"


class Result(Tabular):
    """What a run leaves behind: the states of all bodies at the end, and at all output times (`snapshots`).

    Arrays are the memory that the run has written, not copies of it. The numbers of a body that has failed are NaN.
    `to_arrow`, `to_polars` and `to_pandas` give a table: all bodies at the end, with the columns of `final.csv`.

    Attributes
    ----------
    time : float, s, of the end
    orientation : (n, 4), unit quaternions x, y, z, w, body to world
    angular_velocity_body : (n, 3), rad/s, body axes
    angular_momentum_world : (n, 3), kg m²/s, world axes
    kinetic_energy : (n,), rotational, J
    position, velocity : (n, 3), m and m/s, world axes; None where the bodies do not move through space
    status : (n,), 0 or the number of the reason why a body has failed, an index of `reasons`; 6 where an event has stopped it
    stopped_at : (n,), when that was, s, NaN where none has: the state is that of this time; None where no event stops bodies
    snapshots : Snapshots, or None where no states were asked for
    statistics : dict of `Summary` by quantity, or None where none were asked for
    histograms : list of `HistogramCounts`, in the order in which they were asked for
    events : dict of `EventRecord` by name
    failures : dict of arrays, one row a body that has failed: body, t, status, reason, known_to, last_good_t, orientation,
        angular_velocity, cause (of a formula that gave no finite number, else None)
    report : Report
    """

    #: The words for the numbers in `status`.
    reasons: tuple[str, ...] = REASONS

    report: Report
    statistics: Statistics | None
    histograms: list[HistogramCounts]
    events: dict[str, EventRecord]
    snapshots: Snapshots | None
    failures: dict

    def __init__(self, found: dict) -> None:
        self.report = Report(json.loads(found["report"]), found["summary"])
        self.statistics = None if found["statistics"] is None else Statistics(found["statistics"])
        self.histograms = [HistogramCounts(histogram) for histogram in found["histograms"]]
        self.events = {event["event"]: EventRecord(event) for event in found["events"]}
        self.snapshots = Snapshots(found) if "orientation" in found else None
        self.failures = found["failures"]

    def _states(self):
        if self.snapshots is None:
            files = self.report.files
            where = f"they were written to {', '.join(files)}" if files else "the scene keeps none (states=False)"
            raise InputError(f"the result holds no states: {where}")
        return self.snapshots

    def _columns(self):
        return self._states()._columns(slice(-1, None))

    def _at_end(self, name):
        values = getattr(self._states(), name)
        return None if values is None else values[-1]

    @property
    def time(self) -> float:
        """The time of the end, s."""
        return float(self._states().times[-1])

    @property
    def orientation(self) -> NDArray[np.float64]:
        """Unit quaternions x, y, z, w, body to world, (n, 4)."""
        return self._at_end("orientation")

    @property
    def angular_velocity_body(self) -> NDArray[np.float64]:
        """Angular velocities, (n, 3), rad/s, body axes."""
        return self._at_end("angular_velocity_body")

    @property
    def angular_momentum_world(self) -> NDArray[np.float64]:
        """Angular momenta, (n, 3), kg m²/s, world axes."""
        return self._at_end("angular_momentum_world")

    @property
    def kinetic_energy(self) -> NDArray[np.float64]:
        """Rotational kinetic energies, (n,), J."""
        return self._at_end("kinetic_energy")

    @property
    def position(self) -> NDArray[np.float64] | None:
        """Centres of mass, (n, 3), m, world axes, or None."""
        return self._at_end("position")

    @property
    def velocity(self) -> NDArray[np.float64] | None:
        """Velocities of the centres of mass, (n, 3), m/s, world axes, or None."""
        return self._at_end("velocity")

    @property
    def status(self) -> NDArray[np.uint8]:
        """0, the number of the reason why a body has failed, or 6 where an event has stopped it, (n,)."""
        return self._at_end("status")

    @property
    def stopped_at(self) -> NDArray[np.float64] | None:
        """When an event stopped the bodies, (n,), s, NaN of the others; None where no event stops bodies."""
        return self._at_end("stopped_at")

    @property
    def rotation(self) -> Rotation:
        """The orientations at the end as `scipy.spatial.transform.Rotation`."""
        from ._scipy import rotation

        return rotation(self.orientation)

    def __repr__(self) -> str:
        return f"<polhode.Result>\n{self.report!r}"

    def _repr_html_(self) -> str:
        return self.report._repr_html_()
