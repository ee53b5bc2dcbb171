"""What a run leaves behind."""

from __future__ import annotations

import json

import numpy as np

from ._arrays import columns
from ._errors import InputError
from ._report import Report
from ._tables import frame_to_columns

#: Why a body has failed, by its number in `status`.
REASONS = ("valid", "not_converged", "step_too_long", "step_below_limit", "not_finite", "centre_not_finite")


class Snapshots:
    """All bodies at all output times, arrays of shape (t, n, ...). The numbers of a body that has failed are NaN.

    Attributes
    ----------
    times : (t,), s
    orientation : (t, n, 4), unit quaternions x, y, z, w, body to world
    angular_velocity_body : (t, n, 3), rad/s, body axes
    angular_momentum_world : (t, n, 3), kg m²/s, world axes
    kinetic_energy : (t, n), rotational, J
    position, velocity : (t, n, 3), m and m/s, world axes; None where the bodies do not move through space
    status : (t, n), 0 or the number of the reason why a body has failed (`polhode.Result.reasons`)
    """

    __slots__ = (
        "times",
        "orientation",
        "angular_velocity_body",
        "angular_momentum_world",
        "kinetic_energy",
        "position",
        "velocity",
        "status",
    )

    def __init__(self, found):
        self.times = found["times"]
        self.orientation = found["orientation"]
        self.angular_velocity_body = found["angular_velocity"]
        self.angular_momentum_world = found["angular_momentum"]
        self.kinetic_energy = found["kinetic_energy"]
        self.position = found.get("position")
        self.velocity = found.get("velocity")
        self.status = found["status"]

    def __len__(self):
        return len(self.times)

    def _columns(self, outputs):
        """One column a component, one row a body and output time, as the tables of the command."""
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
        made["status"] = flat(self.status)
        return made

    def to_arrow(self):
        """All bodies at all output times as `pyarrow.Table`, with the columns of `snapshots.csv`."""
        return frame_to_columns("arrow", self._columns(slice(None)))

    def to_polars(self):
        """All bodies at all output times as `polars.DataFrame`, with the columns of `snapshots.csv`."""
        return frame_to_columns("polars", self._columns(slice(None)))

    def to_pandas(self):
        """All bodies at all output times as `pandas.DataFrame`, with the columns of `snapshots.csv`."""
        return frame_to_columns("pandas", self._columns(slice(None)))

    def __repr__(self):
        times, bodies = self.status.shape
        return f"<polhode.Snapshots of {bodies:,} bodies at {times:,} times>"


class Summary:
    """One quantity over all bodies that did not fail, at each output time.

    Attributes
    ----------
    unit : str
    mean, standard_deviation, min, max : (t,); the deviation is that of the bodies as they are, divided by their number
    min_body, max_body : (t,), the bodies with the least and the greatest value; -1 where no body is left
    """

    def __init__(self, figures):
        self.__dict__.update(figures)

    def __repr__(self):
        return f"<mean {self.mean[-1]:.6g}, min {self.min[-1]:.6g}, max {self.max[-1]:.6g} {self.unit} at the end>"


class Statistics(dict):
    """Of each quantity asked for its `Summary`.

    Attributes
    ----------
    times : (t,), s
    count : (t,), bodies behind the figures
    """

    def __init__(self, found):
        super().__init__({name: Summary(figures) for name, figures in found["quantities"].items()})
        self.times, self.count = found["time"], found["count"]

    def _columns(self):
        made = {"t": self.times, "count": self.count}
        for name, summary in self.items():
            for figure in ("mean", "standard_deviation", "min", "max", "min_body", "max_body"):
                made[f"{name}_{figure}"] = getattr(summary, figure)
        return made

    def to_arrow(self):
        """One row an output time as `pyarrow.Table`, with the columns of `statistics.csv`."""
        return frame_to_columns("arrow", self._columns())

    def to_polars(self):
        """One row an output time as `polars.DataFrame`, with the columns of `statistics.csv`."""
        return frame_to_columns("polars", self._columns())

    def to_pandas(self):
        """One row an output time as `pandas.DataFrame`, with the columns of `statistics.csv`."""
        return frame_to_columns("pandas", self._columns())


class Result:
    """What a run leaves behind: the states of all bodies at the end, and at all output times (`snapshots`).

    Arrays are the memory that the run has written, not copies of it. The numbers of a body that has failed are NaN.

    Attributes
    ----------
    time : float, s, of the end
    orientation : (n, 4), unit quaternions x, y, z, w, body to world
    angular_velocity_body : (n, 3), rad/s, body axes
    angular_momentum_world : (n, 3), kg m²/s, world axes
    kinetic_energy : (n,), rotational, J
    position, velocity : (n, 3), m and m/s, world axes; None where the bodies do not move through space
    status : (n,), 0 or the number of the reason why a body has failed, an index of `reasons`
    snapshots : Snapshots, or None where no states were asked for
    statistics : dict of `Summary` by quantity, or None where none were asked for
    failures : dict of arrays, one row a body that has failed: body, t, status, reason, known_to, last_good_t, orientation, angular_velocity
    report : Report
    """

    #: The words for the numbers in `status`.
    reasons = REASONS

    def __init__(self, found):
        self.report = Report(json.loads(found["report"]), found["summary"])
        self.statistics = None if found["statistics"] is None else Statistics(found["statistics"])
        self.snapshots = Snapshots(found) if "orientation" in found else None
        self.failures = found["failures"]

    def _states(self):
        if self.snapshots is None:
            files = self.report.files
            where = f"they were written to {', '.join(files)}" if files else "the scene keeps none (states=False)"
            raise InputError(f"the result holds no states: {where}")
        return self.snapshots

    def _at_end(self, name):
        values = getattr(self._states(), name)
        return None if values is None else values[-1]

    time = property(lambda self: float(self._states().times[-1]), doc="The time of the end, s.")
    orientation = property(lambda self: self._at_end("orientation"), doc="Unit quaternions x, y, z, w, body to world, (n, 4).")
    angular_velocity_body = property(lambda self: self._at_end("angular_velocity_body"), doc="Angular velocities, (n, 3), rad/s, body axes.")
    angular_momentum_world = property(
        lambda self: self._at_end("angular_momentum_world"), doc="Angular momenta, (n, 3), kg m²/s, world axes."
    )
    kinetic_energy = property(lambda self: self._at_end("kinetic_energy"), doc="Rotational kinetic energies, (n,), J.")
    position = property(lambda self: self._at_end("position"), doc="Centres of mass, (n, 3), m, world axes, or None.")
    velocity = property(lambda self: self._at_end("velocity"), doc="Velocities of the centres of mass, (n, 3), m/s, world axes, or None.")
    status = property(lambda self: self._at_end("status"), doc="0, or the number of the reason why a body has failed, (n,).")

    @property
    def rotation(self):
        """The orientations at the end as `scipy.spatial.transform.Rotation`."""
        from ._scipy import rotation

        return rotation(self.orientation)

    def to_arrow(self):
        """All bodies at the end as `pyarrow.Table`, with the columns of `final.csv`."""
        return frame_to_columns("arrow", self._states()._columns(slice(-1, None)))

    def to_polars(self):
        """All bodies at the end as `polars.DataFrame`, with the columns of `final.csv`."""
        return frame_to_columns("polars", self._states()._columns(slice(-1, None)))

    def to_pandas(self):
        """All bodies at the end as `pandas.DataFrame`, with the columns of `final.csv`."""
        return frame_to_columns("pandas", self._states()._columns(slice(-1, None)))

    def __repr__(self):
        return f"<polhode.Result>\n{self.report!r}"

    def _repr_html_(self):
        return self.report._repr_html_()
