"""Tables of bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native
from ._arrays import array, broadcast, columns, number, rows, tensor_columns
from ._errors import InputError
from ._tables import BODY_COLUMNS, Tabular, table_columns

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from typing import TypeAlias

    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import Rotation

    #: Quaternions x, y, z, w of shape (4,) or (n, 4), or rotations of SciPy.
    Orientation: TypeAlias = ArrayLike | Rotation


class Ensemble(Tabular):
    """A table of independent rigid bodies, one row a body.

    `to_arrow`, `to_polars` and `to_pandas` give a table: the columns of `from_table`.

    Parameters
    ----------
    inertia : array, kg m², body axes, about the centre of mass
        Shape (3,) or (n, 3): moments, where the body axes are principal axes. Shape (n, 3, 3): tensors; (1, 3, 3) is one for all bodies.
        Off-diagonal elements are −∫ρxy. Valid if positive definite and I₁ + I₂ ≥ I₃.
    orientation : array of shape (4,) or (n, 4), or `scipy.spatial.transform.Rotation`, optional
        Quaternions **x, y, z, w** that rotate body coordinates to world; normalised here. Left out: body axes along world axes.
    angular_velocity_body : array of shape (3,) or (n, 3), rad/s, body axes
    mass : number or array of shape (n,), kg, above zero, optional
        For bodies that move through space.
    position, velocity : array of shape (3,) or (n, 3), m and m/s, world axes, optional
        Of the centre of mass at t = 0; they need `mass`. Left out: zero.
    repair_triangle_inequality : float, optional
        Replaces a tensor that breaks I₁ + I₂ ≥ I₃ by the nearest that does not, where that changes it by at most this part of itself;
        `repairs` says how many were.

    A single row stands for all bodies. Arrays are read as they lie in memory, whatever their strides; the table is the library's own, and
    runs share it.

    Raises
    ------
    polhode.InputError
        For a wrong shape or dtype, and for the first row that is not valid, with body, column and value.
    """

    __slots__ = ("_bodies",)

    def __init__(
        self,
        inertia: ArrayLike,
        orientation: Orientation | None = None,
        angular_velocity_body: ArrayLike | None = None,
        *,
        mass: ArrayLike | None = None,
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        repair_triangle_inequality: float | None = None,
    ) -> None:
        if angular_velocity_body is None:
            raise InputError("angular_velocity_body: expected an array of shape (3,) or (n, 3), one row a body (rad/s, body axes)")
        if mass is None and not (position is None and velocity is None):
            raise InputError("mass: expected the masses of bodies that have a position or velocity (kg)")
        tensors = array(inertia, "inertia")
        # Rows of moments, one a body, as of any array of two axes.
        is_square = tensors.shape == (3, 3)
        try:
            self._bodies = self._made(
                tensors,
                [(3,)] if is_square else [(3,), (3, 3)],
                {
                    "orientation": (orientation, [(4,)]),
                    "angular_velocity_body": (angular_velocity_body, [(3,)]),
                    "mass": (mass, [()]),
                    "position": (position, [(3,)]),
                    "velocity": (velocity, [(3,)]),
                },
                repair_triangle_inequality,
            )
        except InputError as error:
            if not is_square:
                raise
            hint = "inertia of shape (3, 3) holds the moments of three bodies; a tensor for all bodies has shape (1, 3, 3)"
            raise InputError(f"{error} ({hint})") from None

    @staticmethod
    def _made(inertia, inertia_shapes, optional, repair):
        """The library's table of what is given, each with the shapes of a row."""
        given = {"inertia": (inertia, inertia_shapes)}
        for name, (value, shapes) in optional.items():
            if value is not None:
                given[name] = (array(value, name), shapes)
        count = broadcast(**given)

        def of(name):
            return rows(given[name][0], name, given[name][1][0], count) if name in given else None

        def components(name):
            value = of(name)
            return None if value is None else columns(value)

        tensors = rows(inertia, "inertia", (3, 3) if inertia.ndim == 3 else (3,), count)
        return _native.Bodies(
            count,
            tensor_columns(tensors),
            components("orientation"),
            components("angular_velocity_body"),
            of("mass"),
            components("position"),
            components("velocity"),
            None if repair is None else number(repair, "repair_triangle_inequality"),
        )

    @classmethod
    def _of(cls, bodies):
        made = object.__new__(cls)
        made._bodies = bodies
        return made

    @classmethod
    def from_table(cls, table: Any, *, repair_triangle_inequality: float | None = None) -> Ensemble:
        """The ensemble of a table: a pandas, polars or Arrow table, a structured array, or a dict of columns.

        Columns, SI, body axes, positions and velocities in world axes: ``ixx iyy izz`` and ``wx wy wz``, which are needed; ``ixy ixz iyz``
        (elements −∫ρxy; zero where left out), ``qx qy qz qw``, ``mass``, ``x y z``, ``vx vy vz``. Other columns are not read.
        """
        found = table_columns(table)

        def group(*names, needed=False):
            there = [name for name in names if name in found]
            if not there and not needed:
                return None
            for name in names:
                if name not in found:
                    beside = f", beside {there[0]}" if there else ""
                    raise InputError(f"column {name}: expected a column of numbers{beside}")
            return [column(name) for name in names]

        def column(name):
            given = array(found[name], f"column {name}")
            if given.ndim != 1:
                raise InputError(f"column {name}: shape {given.shape}: expected (n,), one number a body")
            return given

        diagonal = group("ixx", "iyy", "izz", needed=True)
        count = len(diagonal[0])
        products = [column(name) if name in found else np.broadcast_to(0.0, count) for name in BODY_COLUMNS[4:7]]
        mass = group("mass")
        position, velocity = group("x", "y", "z"), group("vx", "vy", "vz")
        if mass is None and (position or velocity):
            raise InputError("column mass: expected the masses of bodies that have a position or velocity (kg)")
        return cls._of(
            _native.Bodies(
                count,
                diagonal + products,
                group("qx", "qy", "qz", "qw"),
                group("wx", "wy", "wz", needed=True),
                mass and mass[0],
                position,
                velocity,
                repair_triangle_inequality,
            )
        )

    @classmethod
    def from_study(cls, study: str | os.PathLike[str] | Mapping[str, Any]) -> Ensemble:
        """The bodies that a study draws or reads: the path of a file, or a dict of the same tables and keys."""
        from ._study import study_text

        return cls._of(_native.study_bodies(*study_text(study)))

    def __len__(self) -> int:
        return len(self._bodies)

    @property
    def inertia(self) -> NDArray[np.float64]:
        """Tensors about the centre of mass, (n, 3, 3), kg m², body axes. A copy."""
        return self._bodies.inertia()

    @property
    def orientation(self) -> NDArray[np.float64]:
        """Unit quaternions x, y, z, w that rotate body coordinates to world, (n, 4). A copy."""
        return self._bodies.orientation()

    @property
    def rotation(self) -> Rotation:
        """The orientations as `scipy.spatial.transform.Rotation`."""
        from ._scipy import rotation

        return rotation(self.orientation)

    @property
    def angular_velocity_body(self) -> NDArray[np.float64]:
        """Angular velocities, (n, 3), rad/s, body axes. A copy."""
        return self._bodies.angular_velocity()

    def _of_translation(self, place):
        translation = self._bodies.translation()
        return None if translation is None else translation[place]

    @property
    def mass(self) -> NDArray[np.float64] | None:
        """Masses, (n,), kg; None where the bodies do not move through space. A copy."""
        return self._of_translation(0)

    @property
    def position(self) -> NDArray[np.float64] | None:
        """Positions of the centres of mass at t = 0, (n, 3), m, world axes, or None. A copy."""
        return self._of_translation(1)

    @property
    def velocity(self) -> NDArray[np.float64] | None:
        """Velocities of the centres of mass at t = 0, (n, 3), m/s, world axes, or None. A copy."""
        return self._of_translation(2)

    @property
    def repairs(self) -> dict[str, float] | None:
        """What `repair_triangle_inequality` has changed: a dict of `bodies`, `largest_relative_change` and `limit`, or None."""
        repairs = self._bodies.repairs()
        return repairs and dict(zip(("bodies", "largest_relative_change", "limit"), repairs))

    def _columns(self):
        inertia, orientation, spin = self.inertia, self.orientation, self.angular_velocity_body
        elements = [inertia[:, row, column] for row, column in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        made = dict(zip(BODY_COLUMNS[1:], [*elements, *columns(orientation), *columns(spin)]))
        if self.mass is not None:
            made = {"mass": self.mass, **made}
            made.update(zip(BODY_COLUMNS[14:], [*columns(self.position), *columns(self.velocity)]))
        return made

    def __repr__(self) -> str:
        bodies = "body" if len(self) == 1 else "bodies"
        moving = "" if self._bodies.translation() is None else ", with mass, position and velocity"
        return f"<polhode.Ensemble of {len(self):,} {bodies}{moving}>"
