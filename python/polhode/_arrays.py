"""Arrays as the library takes them."""

from __future__ import annotations

import numpy as np

from ._errors import InputError


def array(value, name):
    """`value` as an array of float64: the same memory where it is one already, of any strides."""
    if hasattr(value, "as_quat"):
        value = value.as_quat()
    if np.ma.is_masked(value):
        raise InputError(f"{name}: some values are masked: expected numbers in all places")
    try:
        given = np.asarray(value)
    except ValueError:
        raise InputError(f"{name}: expected an array of numbers whose rows are of equal length") from None
    if given.dtype.kind not in "fiu":
        raise InputError(f"{name}: dtype {given.dtype}: expected real numbers")
    return np.require(given, np.float64, ["ALIGNED"])


def number(value, name):
    """One finite or infinite number."""
    given = array(value, name)
    if given.ndim != 0:
        raise InputError(f"{name}: shape {given.shape}: expected a number")
    return float(given)


def leading(given, name, shapes):
    """The number of rows of an array whose last axes have one of these shapes: 1 where it has no axis before them."""
    for shape in shapes:
        axes = len(shape)
        if given.shape == shape:
            return 1
        if given.ndim == axes + 1 and given.shape[1:] == shape:
            return given.shape[0]
    words = " or ".join(f"{shape} or {('n',) + shape}".replace("'", "") for shape in shapes)
    raise InputError(f"{name}: shape {given.shape}: expected {words}, one row a body")


def rows(given, name, shape, count):
    """The array with one row a body: a single row stands for all, without a copy."""
    if given.shape[: given.ndim - len(shape)] in ((), (1,), (count,)):
        return np.broadcast_to(given, (count, *shape))
    raise InputError(f"{name}: {given.shape[0]} rows: expected {count}, one a body")


def columns(given):
    """The components of rows, as views."""
    return [given[:, component] for component in range(given.shape[1])]


#: The elements of a tensor in the library's order, and then those across the diagonal.
TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1))


def tensor_columns(given):
    """The columns of moments, (n, 3), or of tensors, (n, 3, 3)."""
    if given.ndim == 2:
        return columns(given)
    return [given[:, row, column] for row, column in TENSOR]


def broadcast(**given):
    """How many rows arrays have together: all that have more than one have as many."""
    count, first = 1, None
    for name, (value, shapes) in given.items():
        found = leading(value, name, shapes)
        if found == 1 or found == count:
            continue
        if count != 1:
            raise InputError(f"{name}: {found} rows: expected {count}, as {first} has")
        count, first = found, name
    return count
