"""Attitudes and the equations of motion as vectorised functions: arrays of shape (..., 3) and (..., 4), which broadcast."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import _native
from ._arrays import array, columns, tensor_columns
from ._errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ._ensemble import Orientation

__all__ = [
    "angular_acceleration_body",
    "angular_momentum",
    "attitude_error",
    "exponential",
    "logarithm",
    "momentum_angle",
    "rotational_kinetic_energy",
    "torque_of_motion",
]


def _rows(**given):
    """Arrays with one axis of rows, each with the components that it is given with, and the shape that they broadcast to."""
    taken = {}
    for name, (value, *components) in given.items():
        value = array(value, name)
        if value.shape[-len(components) :] != tuple(components):
            raise InputError(f"{name}: shape {value.shape}: expected (..., {', '.join(map(str, components))})")
        taken[name] = value
    axes = {name: len(components) for name, (_, *components) in given.items()}
    try:
        shape = np.broadcast_shapes(*(value.shape[: -axes[name]] for name, value in taken.items()))
    except ValueError:
        found = ", ".join(f"{name} {value.shape}" for name, value in taken.items())
        raise InputError(f"shapes do not broadcast together: {found}") from None
    flat = []
    for name, value in taken.items():
        components = value.shape[-axes[name] :]
        flat.append(np.broadcast_to(value, (*shape, *components)).reshape(-1, *components))
    return flat, shape


def _of_motion(name, inertia, angular_velocity, **other):
    given = {key: (value, 3) for key, value in other.items()}
    (tensors, spins, *others), shape = _rows(inertia=(inertia, 3, 3), angular_velocity=(angular_velocity, 3), **given)
    found = _native.of_motion(name, len(spins), tensor_columns(tensors)[:6], columns(spins), columns(others[0]) if others else None)
    return found.reshape(*shape, *found.shape[1:])[()]


def angular_acceleration_body(inertia: ArrayLike, angular_velocity: ArrayLike, torque: ArrayLike = (0.0, 0.0, 0.0)) -> NDArray[np.float64]:
    """Euler's equations: I⁻¹ (τ − ω × I ω), rad/s², of tensors (..., 3, 3), angular velocities and torques (..., 3), body axes."""
    return _of_motion("angular_acceleration_body", inertia, angular_velocity, torque=torque)


def torque_of_motion(inertia: ArrayLike, angular_velocity: ArrayLike, angular_acceleration: ArrayLike) -> NDArray[np.float64]:
    """The torque that a given motion takes, ω × I ω + I ω̇, N m; all in the same axes."""
    return _of_motion("torque_of_motion", inertia, angular_velocity, angular_acceleration=angular_acceleration)


def angular_momentum(inertia: ArrayLike, angular_velocity: ArrayLike) -> NDArray[np.float64]:
    """I ω, kg m²/s, of tensors (..., 3, 3) and angular velocities (..., 3) in the same axes."""
    return _of_motion("angular_momentum", inertia, angular_velocity)


def rotational_kinetic_energy(inertia: ArrayLike, angular_velocity: ArrayLike) -> NDArray[np.float64]:
    """½ ω·I ω, J."""
    return _of_motion("rotational_kinetic_energy", inertia, angular_velocity)


def momentum_angle(inertia: ArrayLike, angular_velocity: ArrayLike) -> NDArray[np.float64]:
    """The angle between angular velocity and angular momentum, rad; 0 where the body spins about a principal axis."""
    return _of_motion("momentum_angle", inertia, angular_velocity)


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
