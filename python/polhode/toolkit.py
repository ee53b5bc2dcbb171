"""Attitudes and the equations of motion as vectorised functions: arrays of shape (..., 3) and (..., 4), which broadcast."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import _native
from ._arrays import array, columns
from ._errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ._ensemble import Orientation

__all__ = ["attitude_error", "exponential", "logarithm"]


def _rows(**given):
    """Arrays with one axis of rows, and the shape that they broadcast to."""
    taken = {}
    for name, (value, components) in given.items():
        value = array(value, name)
        if value.shape[-1:] != (components,):
            raise InputError(f"{name}: shape {value.shape}: expected (..., {components})")
        taken[name] = value
    try:
        shape = np.broadcast_shapes(*(value.shape[:-1] for value in taken.values()))
    except ValueError:
        found = ", ".join(f"{name} {value.shape}" for name, value in taken.items())
        raise InputError(f"shapes do not broadcast together: {found}") from None
    flat = [np.broadcast_to(value, (*shape, value.shape[-1])).reshape(-1, value.shape[-1]) for value in taken.values()]
    return flat, shape


def attitude_error(a: Orientation, b: Orientation) -> NDArray[np.float64]:
    """The angle of the rotation between two orientations, x, y, z, w, in [0, π], rad. Quaternions need not be normalised."""
    (a, b), shape = _rows(a=(a, 4), b=(b, 4))
    return _native.attitude_error(len(a), columns(a), columns(b)).reshape(shape)[()]


def exponential(rotation_vector: ArrayLike) -> NDArray[np.float64]:
    """The rotation by |v| rad about v, as a quaternion x, y, z, w."""
    (vectors,), shape = _rows(rotation_vector=(rotation_vector, 3))
    return _native.exponential(len(vectors), columns(vectors)).reshape(*shape, 4)


def logarithm(orientation: Orientation) -> NDArray[np.float64]:
    """The rotation vector, rad, of length in [0, π], of an orientation x, y, z, w."""
    (rotations,), shape = _rows(orientation=(orientation, 4))
    return _native.logarithm(len(rotations), columns(rotations)).reshape(*shape, 3)
