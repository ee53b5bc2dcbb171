"""Forces on the centres of mass, a function each.

They need bodies with a mass (`polhode.Ensemble(..., mass=...)`) and act on the translation alone. A parameter is the same for all bodies, or
an array with one row a body.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import _native
from ._arrays import array
from ._call import call_text
from .formula import custom_force as custom

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["constant", "custom", "gravity", "linear_drag", "quadratic_drag", "thrust"]


def _made(name, function, key, value):
    return _native.force(name, array(value, key), call_text(f"polhode.forces.{function}", {key: value}))


def constant(*, force: ArrayLike) -> _native.Force:
    """A force that is constant in world axes.

    Parameters
    ----------
    force : array of shape (3,), or (n, 3), one row a body, N, world axes
    """
    return _made("constant", "constant", "force", force)


def gravity(*, acceleration: ArrayLike) -> _native.Force:
    """A uniform field of gravity.

    Parameters
    ----------
    acceleration : array of shape (3,), or (n, 3), one row a body, m/s², world axes
    """
    return _made("gravity", "gravity", "acceleration", acceleration)


def linear_drag(*, coefficient: ArrayLike) -> _native.Force:
    """−c v.

    Parameters
    ----------
    coefficient : number, or array of shape (n,), one a body, N s/m, not negative
    """
    return _made("linear-drag", "linear_drag", "coefficient", coefficient)


def quadratic_drag(*, coefficient: ArrayLike) -> _native.Force:
    """−C \\|v\\| v.

    Parameters
    ----------
    coefficient : number, or array of shape (n,), one a body, N s²/m², not negative
    """
    return _made("quadratic-drag", "quadratic_drag", "coefficient", coefficient)


def thrust(*, force: ArrayLike) -> _native.Force:
    """A force fixed in the body, through its centre of mass: it gives no torque.

    Parameters
    ----------
    force : array of shape (3,), or (n, 3), one row a body, N, body axes
    """
    return _made("thrust", "thrust", "force", force)
