"""What is asked of bodies beside their states: quantities, histograms and events."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ._arrays import array, number
from ._errors import InputError
from .formula import Expression, _written

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

#: What is done with an event.
ACTIONS = ("record", "stop")

#: The conditions of an event, as keywords.
CONDITIONS = ("below", "above", "falls_below", "rises_above", "crosses")


class Quantity:
    """A number of a body's state of your own, beside those that have a name (`polhode.Scene`): `Quantity.axis_angle`, `Quantity.formula`."""

    __slots__ = ("_asked",)

    def __init__(self, asked: dict) -> None:
        self._asked = asked

    @property
    def name(self) -> str:
        """What it is called in results."""
        return self._asked["name"]

    @classmethod
    def axis_angle(cls, name: str, axis_body: ArrayLike, direction_world: ArrayLike) -> Quantity:
        """The angle between a body axis and a direction of the world, rad, in [0, π]: a pointing error.

        Parameters
        ----------
        name : what it is called in results
        axis_body : (3,), body axes, of any length above zero
        direction_world : (3,), world axes, likewise
        """
        vectors = {}
        for key, value in (("axis", axis_body), ("direction", direction_world)):
            given = array(value, key)
            if given.shape != (3,):
                raise InputError(f"{key}: shape {given.shape}: expected (3,)")
            vectors[key] = given.tolist()
        return cls(_asked(name, **vectors))

    @classmethod
    def formula(cls, name: str, formula: Expression | str, unit: str = "1") -> Quantity:
        """A formula, as text or by the operators of `polhode.formula`: a number of `attitude`, `angular_velocity` (rad/s, body axes),
        `angular_momentum` (kg m²/s, body axes), `inertia` and `time` (s).

        Parameters
        ----------
        name : what it is called in results
        formula : a text, or a `polhode.formula.Expression` without parameters
        unit : what results say of it
        """
        if not isinstance(formula, str):
            formula, parameters = _written(formula)
            if parameters:
                raise InputError(f"quantity {name!r}: a quantity has no parameters: expected numbers in their places")
        return cls(_asked(name, unit=unit, formula=formula))

    def __repr__(self) -> str:
        return f"<polhode.Quantity {self.name!r}>"


def _asked(name, **more):
    return {"name": str(name), "unit": None, "formula": None, "axis": None, "direction": None, **more}


def asked_quantity(quantity, where):
    """A quantity as the library takes it."""
    if isinstance(quantity, Quantity):
        return quantity._asked
    if isinstance(quantity, str):
        return _asked(quantity)
    raise InputError(f"{where}: found {type(quantity).__name__}, expected the name of a quantity or a polhode.Quantity")


class Histogram:
    """How many bodies have a quantity in each of some intervals, at every output time.

    Bin k holds the values from edge k on and below edge k + 1; what is outside is counted apart.

    Parameters
    ----------
    quantity : the name of a quantity (`polhode.Scene`), or `Quantity`
    low, high : the first and the last edge, in the quantity's unit, finite, ascending; `low` above zero where bins are of equal ratio
    bins : their number, 1 to 100,000
    logarithmic : whether they are of equal ratio instead of equal width
    """

    __slots__ = ("quantity", "low", "high", "bins", "logarithmic")

    quantity: str | Quantity
    low: float
    high: float
    bins: int
    logarithmic: bool

    def __init__(self, quantity: str | Quantity, low: float, high: float, bins: int = 50, *, logarithmic: bool = False) -> None:
        self.quantity = quantity
        self.low, self.high = number(low, "low"), number(high, "high")
        self.bins, self.logarithmic = _whole(bins, "bins"), bool(logarithmic)

    def _parts(self):
        parts = {name: getattr(self, name) for name in ("low", "high", "bins", "logarithmic")}
        return {**parts, "quantity": asked_quantity(self.quantity, "quantity of a histogram")}

    def __repr__(self) -> str:
        name = self.quantity if isinstance(self.quantity, str) else self.quantity.name
        return f"<polhode.Histogram of {name}, {self.bins} bins from {self.low:g} to {self.high:g}>"


class Event:
    """When a quantity of each body passes a level.

    The quantity is looked at from one output time to the next; where it has changed sides between two, the body is followed there and
    the time found to 1e-12 of the span. A quantity that passes the level and comes back between two outputs is not seen.

    Parameters
    ----------
    name : what it is called in results; each event of a scene has a name of its own
    quantity : the name of a quantity (`polhode.Scene`), or `Quantity`
    below, above : level, in the quantity's unit: it is on that side, at the start, or when it gets there
    falls_below, rises_above : level: it gets there from the other side
    crosses : level: it gets from below to the level or above, or back
        Give one of the five.
    occurrence : which time counts, from 1
    action : "record", or "stop": a body that has it stands in the state of the event from then on and costs nothing more
    """

    __slots__ = ("name", "quantity", "condition", "level", "occurrence", "action")

    name: str
    quantity: str | Quantity
    condition: str
    level: float
    occurrence: int
    action: str

    def __init__(
        self,
        name: str,
        quantity: str | Quantity,
        *,
        below: float | None = None,
        above: float | None = None,
        falls_below: float | None = None,
        rises_above: float | None = None,
        crosses: float | None = None,
        occurrence: int = 1,
        action: str = "record",
    ) -> None:
        given = dict(zip(CONDITIONS, (below, above, falls_below, rises_above, crosses)))
        given = {key: level for key, level in given.items() if level is not None}
        if len(given) != 1:
            found = ", ".join(given) or "none"
            raise InputError(f"event {name!r}: found {found}, expected one of {', '.join(CONDITIONS)}")
        ((self.condition, level),) = given.items()
        self.name, self.quantity, self.level = str(name), quantity, number(level, self.condition)
        self.occurrence = _whole(occurrence, "occurrence")
        if action not in ACTIONS:
            raise InputError(f"event {name!r}: action = {action!r}: expected one of {', '.join(ACTIONS)}")
        self.action = action

    def _parts(self):
        parts = {name: getattr(self, name) for name in ("name", "condition", "level", "occurrence", "action")}
        return {**parts, "quantity": asked_quantity(self.quantity, f"quantity of the event {self.name!r}")}

    def __repr__(self) -> str:
        name = self.quantity if isinstance(self.quantity, str) else self.quantity.name
        return f"<polhode.Event {self.name!r}: {name} {self.condition} {self.level:g}>"


def _whole(value, name):
    given = array(value, name)
    if given.ndim != 0 or float(given) != int(given) or given < 0:
        raise InputError(f"{name} = {value!r}: expected a whole number, 0 or more")
    return int(given)
