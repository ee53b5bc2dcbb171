"""Mass, centre of mass and inertia of shapes, meshes, points and bodies put together from parts.

Lengths, masses and densities of shapes may be arrays, which broadcast: one row a body. SI units; the frame is the one in which the body is
described, with shapes about z as each function says.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from . import _native
from ._arrays import array, columns, number, tensor_columns
from ._errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike, NDArray

    from ._ensemble import Orientation

__all__ = [
    "MassProperties",
    "Part",
    "box",
    "capsule",
    "circular_plate",
    "compose",
    "cone",
    "cylinder",
    "ellipsoid",
    "from_hull",
    "from_mesh",
    "from_points",
    "point",
    "principal_axes",
    "rectangular_plate",
    "rod",
    "sphere",
    "spherical_shell",
    "tetrahedron",
    "torus",
    "tube",
]


class MassProperties:
    """What a distribution of mass comes down to for the motion of a rigid body.

    Attributes
    ----------
    mass : (...), kg
    volume : (...), m³; 0 for what has none: points, rods, plates and shells
    centre_of_mass : (..., 3), m
    inertia : (..., 3, 3), about the centre of mass, kg m²; off-diagonal elements are −∫ρxy
    """

    mass: NDArray[np.float64]
    volume: NDArray[np.float64]
    centre_of_mass: NDArray[np.float64]
    inertia: NDArray[np.float64]

    def __init__(
        self,
        mass: NDArray[np.float64],
        volume: NDArray[np.float64],
        centre_of_mass: NDArray[np.float64],
        inertia: NDArray[np.float64],
    ) -> None:
        self.mass, self.volume, self.centre_of_mass, self.inertia = mass, volume, centre_of_mass, inertia

    @classmethod
    def _of(cls, found, shape):
        return cls(
            found["mass"].reshape(shape)[()],
            found["volume"].reshape(shape)[()],
            found["centre_of_mass"].reshape(*shape, 3),
            found["inertia"].reshape(*shape, 3, 3),
        )

    @property
    def principal_moments(self) -> NDArray[np.float64]:
        """I₁ ≤ I₂ ≤ I₃, (..., 3), kg m²."""
        return principal_axes(self.inertia)[0]

    @property
    def density(self) -> NDArray[np.float64]:
        """kg/m³; NaN without a volume."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(np.asarray(self.volume) > 0, self.mass / np.asarray(self.volume), np.nan)[()]

    def __repr__(self) -> str:
        if np.ndim(self.mass):
            return f"<polhode.inertia.MassProperties of shape {np.shape(self.mass)}>"
        moments = ", ".join(f"{moment:.6g}" for moment in self.principal_moments)
        return f"<polhode.inertia.MassProperties: {self.mass:.6g} kg, {self.volume:.6g} m³, principal moments {moments} kg m²>"


@dataclass(frozen=True)
class Part:
    """A part of a body: turned by `orientation` (x, y, z, w) about its own origin and put at `position` (m); or taken away, as a hole."""

    properties: MassProperties
    position: ArrayLike = (0.0, 0.0, 0.0)
    orientation: Orientation = (0.0, 0.0, 0.0, 1.0)
    hole: bool = False


def _amount(mass, density):
    if (mass is None) == (density is None):
        raise InputError("expected either mass (kg) or density (kg/m³)")
    return (array(mass, "mass"), False) if density is None else (array(density, "density"), True)


def _shape(name, mass, density, **lengths):
    amount, is_density = _amount(mass, density)
    taken = []
    for key, (value, axes) in lengths.items():
        value = array(value, key)
        if value.shape[value.ndim - len(axes) :] != axes:
            raise InputError(f"{key}: shape {value.shape}: expected (..., {', '.join(map(str, axes))})")
        flat = value.reshape(*value.shape[: value.ndim - len(axes)], -1) if axes else value[..., None]
        taken += [flat[..., place] for place in range(flat.shape[-1])]
    try:
        shape = np.broadcast_shapes(amount.shape, *(column.shape for column in taken))
    except ValueError:
        found = ", ".join(str(column.shape) for column in (amount, *taken))
        raise InputError(f"{name}: shapes {found} do not broadcast together") from None
    flat = [np.broadcast_to(column, shape).reshape(-1) for column in (*taken, amount)]
    return MassProperties._of(_native.shape_mass_properties(name, flat[:-1], flat[-1], is_density), shape)


def point(*, mass: ArrayLike) -> MassProperties:
    """A point at the origin, without inertia of its own, for `compose`."""
    return _shape("point", mass, None)


def rod(*, mass: ArrayLike, length: ArrayLike) -> MassProperties:
    """A straight line along z."""
    return _shape("rod", mass, None, length=(length, ()))


def sphere(*, radius: ArrayLike, mass: ArrayLike | None = None, density: ArrayLike | None = None) -> MassProperties:
    """A solid sphere."""
    return _shape("sphere", mass, density, radius=(radius, ()))


def spherical_shell(*, mass: ArrayLike, radius: ArrayLike) -> MassProperties:
    """A sphere with all mass on its surface."""
    return _shape("spherical_shell", mass, None, radius=(radius, ()))


def ellipsoid(*, semi_axes: ArrayLike, mass: ArrayLike | None = None, density: ArrayLike | None = None) -> MassProperties:
    """A solid ellipsoid; `semi_axes` along x, y, z, shape (..., 3)."""
    return _shape("ellipsoid", mass, density, semi_axes=(semi_axes, (3,)))


def box(*, edges: ArrayLike, mass: ArrayLike | None = None, density: ArrayLike | None = None) -> MassProperties:
    """A solid box; whole `edges` along x, y, z, shape (..., 3)."""
    return _shape("box", mass, density, edges=(edges, (3,)))


def cylinder(*, radius: ArrayLike, height: ArrayLike, mass: ArrayLike | None = None, density: ArrayLike | None = None) -> MassProperties:
    """A solid cylinder about z."""
    return _shape("cylinder", mass, density, radius=(radius, ()), height=(height, ()))


def tube(
    *, inner_radius: ArrayLike, outer_radius: ArrayLike, height: ArrayLike, mass: ArrayLike | None = None, density: ArrayLike | None = None
) -> MassProperties:
    """A cylinder about z with a coaxial bore."""
    lengths = {"inner_radius": (inner_radius, ()), "outer_radius": (outer_radius, ()), "height": (height, ())}
    return _shape("tube", mass, density, **lengths)


def capsule(*, radius: ArrayLike, length: ArrayLike, mass: ArrayLike | None = None, density: ArrayLike | None = None) -> MassProperties:
    """A cylinder about z of this length, closed by two half spheres."""
    return _shape("capsule", mass, density, radius=(radius, ()), length=(length, ()))


def cone(*, radius: ArrayLike, height: ArrayLike, mass: ArrayLike | None = None, density: ArrayLike | None = None) -> MassProperties:
    """A solid cone with its base in the plane z = 0 and its apex at z = height; the centre of mass is at height/4."""
    return _shape("cone", mass, density, radius=(radius, ()), height=(height, ()))


def torus(
    *, major_radius: ArrayLike, minor_radius: ArrayLike, mass: ArrayLike | None = None, density: ArrayLike | None = None
) -> MassProperties:
    """A solid ring about z."""
    return _shape("torus", mass, density, major_radius=(major_radius, ()), minor_radius=(minor_radius, ()))


def rectangular_plate(*, mass: ArrayLike, width: ArrayLike, depth: ArrayLike) -> MassProperties:
    """A rectangle without thickness in the plane z = 0, `width` along x and `depth` along y."""
    return _shape("rectangular_plate", mass, None, width=(width, ()), depth=(depth, ()))


def circular_plate(*, mass: ArrayLike, radius: ArrayLike) -> MassProperties:
    """A disc without thickness in the plane z = 0."""
    return _shape("circular_plate", mass, None, radius=(radius, ()))


def tetrahedron(*, corners: ArrayLike, mass: ArrayLike | None = None, density: ArrayLike | None = None) -> MassProperties:
    """A solid tetrahedron; `corners`, shape (..., 4, 3)."""
    return _shape("tetrahedron", mass, density, corners=(corners, (4, 3)))


def from_mesh(
    path: str | os.PathLike[str],
    *,
    mass: float | None = None,
    density: float | None = None,
    scale: float = 1.0,
    shell: bool = False,
) -> MassProperties:
    """Of the closed surface in an STL or OBJ file, or of a thin skin.

    Parameters
    ----------
    path : the file; its ending says what it is
    mass, density : kg or kg/m³: one of them, and of a shell the mass
    scale : the length in m of the file's unit: 0.001 where it is in millimetres
    shell : whether the surface is a thin skin, which may be open

    Raises
    ------
    polhode.InputError
        For a file that cannot be read, and for a surface that is open, inside out or crosses itself.
    """
    amount, is_density = _amount(mass, density)
    if shell and is_density:
        raise InputError("shell: expected the mass of a shell (kg), which has no volume")
    amount = number(amount, "density" if is_density else "mass")
    given = (None, amount) if is_density else (amount, None)
    return MassProperties._of(_native.mesh_mass_properties(os.fspath(path), *given, number(scale, "scale"), bool(shell)), ())


def _points(value, name):
    given = array(value, name)
    if given.ndim != 2 or given.shape[1] != 3:
        raise InputError(f"{name}: shape {given.shape}: expected (n, 3) (m)")
    return given


def from_hull(points: ArrayLike, *, mass: float | None = None, density: float | None = None) -> MassProperties:
    """Of the convex hull of points, shape (n, 3), m."""
    amount, is_density = _amount(mass, density)
    amount = number(amount, "density" if is_density else "mass")
    given = (None, amount) if is_density else (amount, None)
    return MassProperties._of(_native.hull_mass_properties(_points(points, "points"), *given), ())


def from_points(mass: ArrayLike, position: ArrayLike) -> MassProperties:
    """Of point masses: `mass`, shape (n,), kg, at `position`, shape (n, 3), m."""
    places, masses = _points(position, "position"), array(mass, "mass")
    if masses.shape not in ((), (len(places),)):
        raise InputError(f"mass: shape {masses.shape}: expected ({len(places)},), one a point (kg)")
    return MassProperties._of(_native.points_mass_properties(np.broadcast_to(masses, len(places)), places), ())


def compose(parts: Iterable[Part | MassProperties]) -> MassProperties:
    """Of a body that is put together from parts: `Part`, or mass properties as they stand."""
    given = []
    for place, part in enumerate(parts):
        part = Part(part) if isinstance(part, MassProperties) else part
        if not isinstance(part, Part) or np.ndim(part.properties.mass):
            raise InputError(f"parts[{place}]: expected a Part of one body's MassProperties")
        orientation = array(part.orientation, f"parts[{place}].orientation")
        position = array(part.position, f"parts[{place}].position")
        for name, value, shape in (("orientation", orientation, (4,)), ("position", position, (3,))):
            if value.shape != shape:
                raise InputError(f"parts[{place}].{name}: shape {value.shape}: expected {shape}")
        of = part.properties
        body = (float(of.mass), float(of.volume), of.centre_of_mass.tolist(), of.inertia.tolist())
        given.append((*body, orientation.tolist(), position.tolist(), bool(part.hole)))
    return MassProperties._of(_native.composed_mass_properties(given), ())


def principal_axes(inertia: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Principal moments I₁ ≤ I₂ ≤ I₃, (..., 3), kg m², and the rotations from principal to body axes, (..., 4), x, y, z, w, of tensors of shape
    (..., 3, 3) about the centre of mass.
    """
    given = array(inertia, "inertia")
    if given.shape[-2:] != (3, 3):
        raise InputError(f"inertia: shape {given.shape}: expected (..., 3, 3)")
    flat = given.reshape(-1, 3, 3)
    moments, rotations = _native.principal(len(flat), tensor_columns(flat)[:6])
    return moments.reshape(*given.shape[:-2], 3), rotations.reshape(*given.shape[:-2], 4)
