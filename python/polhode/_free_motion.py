"""Torque-free motion in closed form."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import _native
from ._arrays import array
from ._ensemble import Ensemble
from ._errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import Rotation

    from ._ensemble import Orientation


class FreeMotion:
    """The torque-free motion of bodies at given times, from `free_motion`.

    Shapes are (n, t, ...). The axis of the bodies is left out where a single body was given (all arguments without an axis of bodies), that of
    the times where a single time was.

    Attributes
    ----------
    times : s
    orientation : (n, t, 4), unit quaternions x, y, z, w, body to world
    angular_velocity_body : (n, t, 3), rad/s, body axes
    angular_momentum_world : (n, t, 3), kg m²/s, world axes
    kinetic_energy : (n, t), rotational, J
    polhode : (n,), "point", "about_first", "about_third" or "separatrix": the curve of the angular momentum in the body
    modulus, complementary_modulus : (n,), the elliptic moduli k and k′
    polhode_period : (n,), s, after which the angular momentum comes back to its place in the body; inf where it never does
    nutation_period : (n,), s; the time between two flips of a spin about the middle axis
    mean_precession_rate : (n,), rad/s, about the angular momentum
    """

    times: NDArray[np.float64]
    orientation: NDArray[np.float64]
    angular_velocity_body: NDArray[np.float64]
    angular_momentum_world: NDArray[np.float64]
    kinetic_energy: NDArray[np.float64]
    polhode: NDArray[np.str_]
    modulus: NDArray[np.float64]
    complementary_modulus: NDArray[np.float64]
    polhode_period: NDArray[np.float64]
    nutation_period: NDArray[np.float64]
    mean_precession_rate: NDArray[np.float64]

    def __init__(self, found: dict, times: NDArray[np.float64], ensemble: Ensemble, is_single: bool) -> None:
        self.times, self._ensemble = times, ensemble

        def shaped(values, has_times=True):
            if has_times and times.ndim == 0:
                values = values[:, 0]
            return values[0] if is_single else values

        self.orientation = shaped(found["orientation"])
        self.angular_velocity_body = shaped(found["angular_velocity"])
        self.angular_momentum_world = shaped(found["angular_momentum"])
        self.kinetic_energy = shaped(found["kinetic_energy"])
        self.polhode = shaped(np.array(found["polhode"]), False)
        for name in ("modulus", "complementary_modulus", "polhode_period", "nutation_period", "mean_precession_rate"):
            setattr(self, name, shaped(found[name], False))

    @property
    def rotation(self) -> Rotation:
        """The orientations as `scipy.spatial.transform.Rotation`, with bodies and times in one axis."""
        from ._scipy import rotation

        return rotation(self.orientation.reshape(-1, 4))

    def flips(self, start: float, end: float, body: int = 0) -> NDArray[np.float64]:
        """The times from `start` to `end`, s, at which the spin of one body about its middle axis changes sign: the wing nut's flips."""
        if not 0 <= body < len(self._ensemble):
            raise InputError(f"body = {body}: expected an index below {len(self._ensemble)}")
        return _native.flips(self._ensemble._bodies, body, start, end)

    def __repr__(self) -> str:
        bodies = "body" if len(self._ensemble) == 1 else "bodies"
        return f"<polhode.FreeMotion of {len(self._ensemble):,} {bodies} at {self.times.size:,} times>"


def free_motion(
    inertia: ArrayLike, orientation: Orientation | None, angular_velocity_body: ArrayLike, t: ArrayLike
) -> FreeMotion:
    """The state of torque-free bodies at any times, in closed form: at a cost that does not depend on the time, to about 1e-15 rad.

    Parameters
    ----------
    inertia : array of shape (3,), (n, 3) or (n, 3, 3), kg m², as of `Ensemble`
    orientation : array of shape (4,) or (n, 4), x, y, z, w, body to world, or `scipy.spatial.transform.Rotation`, or None: along world axes
    angular_velocity_body : array of shape (3,) or (n, 3), rad/s, body axes
    t : number or array of shape (t,), s, before or after 0

    Returns
    -------
    FreeMotion
    """
    times = array(t, "t")
    if times.ndim > 1:
        raise InputError(f"t: shape {times.shape}: expected a number or an array of shape (t,) (s)")
    ensemble = Ensemble(inertia, orientation, angular_velocity_body)
    given = [(inertia, 1), (angular_velocity_body, 1)] + ([] if orientation is None else [(orientation, 1)])
    is_single = all(array(value, "").ndim == axes for value, axes in given)
    return FreeMotion(_native.free_motion(ensemble._bodies, np.atleast_1d(times)), times, ensemble, is_single)
