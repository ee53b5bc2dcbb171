"""Torques and forces of your own, as text or by operators on Python objects.

    from polhode import formula as f

    k = f.parameter(0.3)                                  # or an array, one a body: f.parameter(values, per_body=True)
    up = f.to_body([0, 0, 1])
    spring = f.custom(k * f.cross([0, 0, 1], up) - 0.1 * f.angular_velocity)

What operators make is a text in the language of studies (`docs/custom-torques.md`); `str(expression)` shows it. The engines read it when a
run starts: it runs on the CPU and on a GPU, and no Python is called meanwhile.

Numbers are numbers, sequences of three numbers vectors, and of four quaternions x, y, z, w. Inputs, all SI: `attitude` (the rotation from
body to world axes), `angular_velocity`, `angular_momentum` (body axes), `inertia` (its elements, and its product with a vector), `time`, `position`,
`velocity` (world axes), and of forces `mass`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NoReturn

import numpy as np

from . import _native
from ._arrays import array
from ._errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import TypeAlias

    from numpy.typing import ArrayLike

    #: What can stand in a formula.
    Operand: TypeAlias = "Expression | ArrayLike"

__all__ = [
    "Expression",
    "abs",
    "acos",
    "angular_momentum",
    "angular_velocity",
    "asin",
    "atan2",
    "attitude",
    "clamp",
    "conjugate",
    "cos",
    "cross",
    "custom",
    "custom_force",
    "dot",
    "exp",
    "inertia",
    "kepler_cos",
    "kepler_sin",
    "ln",
    "mass",
    "max",
    "min",
    "norm",
    "normalize",
    "parameter",
    "pi",
    "position",
    "pow",
    "quat",
    "rotate",
    "rotate_inverse",
    "select",
    "sin",
    "smoothstep",
    "sqrt",
    "step",
    "tan",
    "tau",
    "time",
    "to_body",
    "to_world",
    "vec",
    "velocity",
]


_NO_EQUALITY = "formulas have no ==: numbers that are computed are hardly ever equal; compare with < and >"


class Expression:
    """A number, vector, rotation, tensor or truth value of a formula; operators make others of it.

    ``+ - * /`` as in mathematics (``p * q`` of rotations: first q, then p; ``inertia * v``), ``x ** n``, ``< <= > >=``, ``& | ~`` of truth values, and
    ``v.x``, ``.y``, ``.z``, ``.w``. The product of two vectors is `dot` or `cross`. Whether shapes go together is seen when the formula is used.
    """

    # NumPy leaves operators with its numbers and arrays to this class.
    __array_ufunc__ = None
    __slots__ = ("_parts", "_value")
    __hash__ = object.__hash__

    def __init__(self, parts, value=None):
        # Texts and expressions in turn; of a parameter no text, but a value.
        self._parts, self._value = parts, value

    def __getattr__(self, name: str) -> Expression:
        if name in ("x", "y", "z", "w", "xx", "yy", "zz", "xy", "xz", "yz"):
            return Expression((self, f".{name}"))
        raise AttributeError(f"an expression of a formula has no {name!r}: it has the components x, y, z, w, and of inertia xx, yy, zz, xy, xz, yz")

    def __add__(self, other: Operand) -> Expression:
        return _operated(self, "+", other)

    def __radd__(self, other: Operand) -> Expression:
        return _operated(other, "+", self)

    def __sub__(self, other: Operand) -> Expression:
        return _operated(self, "-", other)

    def __rsub__(self, other: Operand) -> Expression:
        return _operated(other, "-", self)

    def __mul__(self, other: Operand) -> Expression:
        return _operated(self, "*", other)

    def __rmul__(self, other: Operand) -> Expression:
        return _operated(other, "*", self)

    def __truediv__(self, other: Operand) -> Expression:
        return _operated(self, "/", other)

    def __rtruediv__(self, other: Operand) -> Expression:
        return _operated(other, "/", self)

    def __pow__(self, other: Operand) -> Expression:
        if isinstance(other, (int, np.integer)) and -16 <= other <= 16:
            return Expression(("(", self, f"^{int(other)})"))
        return pow(self, other)

    def __rpow__(self, other: Operand) -> Expression:
        return pow(other, self)

    def __neg__(self) -> Expression:
        return Expression(("(-", self, ")"))

    def __pos__(self) -> Expression:
        return self

    def __abs__(self) -> Expression:
        return abs(self)

    def __lt__(self, other: Operand) -> Expression:
        return _operated(self, "<", other)

    def __le__(self, other: Operand) -> Expression:
        return _operated(self, "<=", other)

    def __gt__(self, other: Operand) -> Expression:
        return _operated(self, ">", other)

    def __ge__(self, other: Operand) -> Expression:
        return _operated(self, ">=", other)

    def __and__(self, other: Operand) -> Expression:
        return _operated(self, "&&", other)

    def __or__(self, other: Operand) -> Expression:
        return _operated(self, "||", other)

    def __invert__(self) -> Expression:
        return Expression(("!", self))

    def __eq__(self, other: object) -> NoReturn:
        raise TypeError(_NO_EQUALITY)

    def __ne__(self, other: object) -> NoReturn:
        raise TypeError(_NO_EQUALITY)

    def __bool__(self) -> NoReturn:
        raise TypeError("a formula has no truth value before it runs: use polhode.formula.select, and & | ~ for and, or, not")

    def __iter__(self) -> NoReturn:
        raise TypeError("a formula cannot be iterated: take .x, .y and .z")

    def __str__(self) -> str:
        return _written(self)[0]

    def __repr__(self) -> str:
        return f"<polhode.formula.Expression {str(self)!r}>"


def _expression(value):
    """A number or sequence of numbers as a constant of the formula."""
    if isinstance(value, Expression):
        return value
    if isinstance(value, (list, tuple)) and any(isinstance(element, Expression) for element in value):
        if len(value) == 3:
            return vec(*value)
        if len(value) == 4:
            return quat(*value)
    given = array(value, "a constant of a formula")
    if given.ndim == 0:
        number = float(given)
        if not np.isfinite(number):
            raise InputError(f"a constant of a formula = {number}: expected a finite number")
        return Expression((repr(number) if number >= 0 else f"({number!r})",))
    if given.shape == (3,):
        return vec(*given.tolist())
    if given.shape == (4,):
        return quat(*given.tolist())
    raise InputError(
        f"a constant of a formula of shape {given.shape}: expected a number, three (a vector) or four (a quaternion x, y, z, w); "
        "what differs from body to body is a polhode.formula.parameter"
    )


def _operated(left, operator, right):
    return Expression(("(", _expression(left), f" {operator} ", _expression(right), ")"))


def _called(name, *arguments):
    parts = [f"{name}("]
    for place, argument in enumerate(arguments):
        parts += [", "] if place else []
        parts.append(_expression(argument))
    return Expression((*parts, ")"))


def parameter(value: ArrayLike, *, per_body: bool = False) -> Expression:
    """A number, vector (three numbers) or rotation (four, x, y, z, w; normalised) of the formula, the same for all bodies; with `per_body` an
    array with one row a body, shape (n,), (n, 3) or (n, 4).
    """
    given = array(value, "parameter")
    row = given.shape[1:] if per_body else given.shape
    if (per_body and given.ndim == 0) or row not in ((), (3,), (4,)):
        expected = "(n,), (n, 3) or (n, 4)" if per_body else "(), (3,) or (4,); per_body=True stands for one row a body"
        raise InputError(f"parameter: shape {given.shape}: expected {expected}")
    return Expression((), (given, per_body))


def _written(expression, known=()):
    """The text of an expression, and its parameters by their names: those that are known have their places among them. What is used more than
    once is defined once.
    """
    counts, order, stack = {}, [], [(expression, False)]
    while stack:
        node, is_done = stack.pop()
        if is_done:
            order.append(node)
            continue
        counts[id(node)] = counts.get(id(node), 0) + 1
        if counts[id(node)] == 1:
            stack.append((node, True))
            stack.extend((part, False) for part in reversed(node._parts) if isinstance(part, Expression))
    texts, definitions = {}, []
    parameters = list(known)
    for node in order:
        if node._value is not None:
            value, per_body = node._value
            name = next((name for name, other, _ in parameters if other is value), None)
            if name is None:
                name = f"p{len(parameters) + 1}"
                parameters.append((name, value, per_body))
            texts[id(node)] = name
            continue
        text = "".join(texts[id(part)] if isinstance(part, Expression) else part for part in node._parts)
        is_short = not any(isinstance(part, Expression) for part in node._parts)
        if node is not expression and ((counts[id(node)] > 1 and not is_short) or len(text) > _LONGEST):
            name = f"v{len(definitions) + 1}"
            definitions.append(f"let {name} = {text};\n")
            text = name
        texts[id(node)] = text
    return "".join(definitions) + texts[id(expression)], parameters


#: Texts longer than this, characters, are defined by themselves, so that parentheses do not nest without end.
_LONGEST = 400


def _given(formula, parameters, name):
    """Text and parameters of a formula, however it was written down."""
    if isinstance(formula, str):
        return formula, [(key, *_value(value, key)) for key, value in (parameters or {}).items()]
    if parameters is not None:
        raise InputError(f"{name}: parameters go with a text: use polhode.formula.parameter in expressions")
    return _written(_expression(formula))


def _value(value, name):
    if isinstance(value, Expression) and value._value is not None:
        return value._value
    given = array(value, f"parameter {name}")
    return given, False


def _title(function, text):
    line = " ".join(text.split())
    return f"polhode.{function}({(line if len(line) <= 60 else line[:57] + '...')!r})"


def custom(
    torque: Expression | str, parameters: Mapping[str, Operand] | None = None, *, energy: Expression | str | None = None
) -> _native.Torque:
    """A torque of your own.

    Parameters
    ----------
    torque : Expression or text, a vector, N m, body axes
    parameters : dict, with a text: values by their names, numbers, vectors (three numbers) or rotations (four, x, y, z, w), or
        `parameter(values, per_body=True)`
    energy : Expression or text, a number, J, of the attitude and the parameters alone, optional: the potential energy, for the balance in
        the report. With expressions it may hold no parameters that the torque has not.

    Raises
    ------
    polhode.InputError
        Where the formula is none: line, column and reason, and the place in the text.
    """
    text, given = _given(torque, parameters, "torque")
    if energy is not None and not isinstance(energy, str):
        energy, own = _written(_expression(energy), given)
        if len(own) > len(given):
            raise InputError("energy: expected parameters that the torque has too")
    return _native.custom_torque(text, given, energy, _title("torques.custom", text))


def custom_force(force: Expression | str, parameters: Mapping[str, Operand] | None = None) -> _native.Force:
    """A force of your own on the centres of mass.

    Parameters
    ----------
    force : Expression or text, a vector, N, world axes
    parameters : as of `custom`
    """
    text, given = _given(force, parameters, "force")
    return _native.custom_force(text, given, _title("forces.custom", text))


attitude = Expression(("attitude",))
angular_velocity = Expression(("angular_velocity",))
angular_momentum = Expression(("angular_momentum",))
inertia = Expression(("inertia",))
time = Expression(("time",))
position = Expression(("position",))
velocity = Expression(("velocity",))
mass = Expression(("mass",))
pi = Expression(("pi",))
tau = Expression(("tau",))


def dot(a: Operand, b: Operand) -> Expression:
    """The scalar product of two vectors."""
    return _called("dot", a, b)


def cross(a: Operand, b: Operand) -> Expression:
    """The vector product of two vectors."""
    return _called("cross", a, b)


def norm(a: Operand) -> Expression:
    """The length of a vector or quaternion."""
    return _called("norm", a)


def normalize(a: Operand) -> Expression:
    """A vector or quaternion over its length."""
    return _called("normalize", a)


def vec(x: Operand, y: Operand, z: Operand) -> Expression:
    """The vector of three numbers."""
    return _called("vec", x, y, z)


def quat(x: Operand, y: Operand, z: Operand, w: Operand) -> Expression:
    """The quaternion x, y, z, w; not normalised."""
    return _called("quat", x, y, z, w)


def to_body(v: Operand) -> Expression:
    """A vector in world axes, in body axes."""
    return _called("to_body", v)


def to_world(v: Operand) -> Expression:
    """A vector in body axes, in world axes."""
    return _called("to_world", v)


def rotate(q: Operand, v: Operand) -> Expression:
    """A vector turned by a rotation."""
    return _called("rotate", q, v)


def rotate_inverse(q: Operand, v: Operand) -> Expression:
    """A vector turned back by a rotation."""
    return _called("rotate_inverse", q, v)


def conjugate(q: Operand) -> Expression:
    """The inverse of a rotation."""
    return _called("conjugate", q)


def sin(x: Operand) -> Expression:
    """The sine, rad."""
    return _called("sin", x)


def cos(x: Operand) -> Expression:
    """The cosine, rad."""
    return _called("cos", x)


def tan(x: Operand) -> Expression:
    """The tangent, rad."""
    return _called("tan", x)


def asin(x: Operand) -> Expression:
    """The inverse sine, rad."""
    return _called("asin", x)


def acos(x: Operand) -> Expression:
    """The inverse cosine, rad."""
    return _called("acos", x)


def atan2(y: Operand, x: Operand) -> Expression:
    """The angle of the point (x, y), rad."""
    return _called("atan2", y, x)


def exp(x: Operand) -> Expression:
    """The exponential."""
    return _called("exp", x)


def ln(x: Operand) -> Expression:
    """The natural logarithm."""
    return _called("ln", x)


def sqrt(x: Operand) -> Expression:
    """The square root."""
    return _called("sqrt", x)


def abs(x: Operand) -> Expression:
    """The absolute value of a number."""
    return _called("abs", x)


def pow(x: Operand, y: Operand) -> Expression:
    """x to the power of y; whole powers up to 16 are written ``x ** n``."""
    return _called("pow", x, y)


def min(a: Operand, b: Operand) -> Expression:
    """The lesser of two numbers."""
    return _called("min", a, b)


def max(a: Operand, b: Operand) -> Expression:
    """The greater of two numbers."""
    return _called("max", a, b)


def clamp(x: Operand, low: Operand, high: Operand) -> Expression:
    """A number kept between two others."""
    return _called("clamp", x, low, high)


def step(edge: Operand, x: Operand) -> Expression:
    """0 where x < edge, else 1."""
    return _called("step", edge, x)


def smoothstep(low: Operand, high: Operand, x: Operand) -> Expression:
    """0 to 1 along 3t² − 2t³ between two numbers."""
    return _called("smoothstep", low, high, x)


def select(truth: Operand, a: Operand, b: Operand) -> Expression:
    """`a` where the truth value holds, else `b`."""
    return _called("select", truth, a, b)


def kepler_sin(mean_anomaly: Operand, eccentricity: Operand) -> Expression:
    """The sine of the eccentric anomaly."""
    return _called("kepler_sin", mean_anomaly, eccentricity)


def kepler_cos(mean_anomaly: Operand, eccentricity: Operand) -> Expression:
    """The cosine of the eccentric anomaly."""
    return _called("kepler_cos", mean_anomaly, eccentricity)
