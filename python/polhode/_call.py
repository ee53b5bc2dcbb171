"""Arguments of torques and forces on their way to the library."""

from __future__ import annotations

import numpy as np

from ._arrays import array
from ._errors import InputError


def flattened(given, table=""):
    """Arrays by the names that the library declares: those of a dict with its own name before them."""
    flat = {}
    for name, value in given.items():
        name = f"{table}{name}"
        if hasattr(value, "items"):
            flat.update(flattened(value, f"{name}."))
        elif isinstance(value, (list, tuple)) and value and all(hasattr(element, "items") for element in value):
            flat[name] = [flattened(element) for element in value]
        elif isinstance(value, (bool, np.bool_)):
            raise InputError(f"{name} = {value}: expected a number or an array")
        elif isinstance(value, (int, np.integer)):
            # A seed may have more digits than a float holds.
            flat[name] = int(value)
        else:
            flat[name] = array(value, name)
    return flat


def call_text(function, given):
    """The call as somebody would write it, long arrays by their shapes."""
    return f"{function}({', '.join(f'{name}={_short(value)}' for name, value in given.items())})"


def _short(value):
    if hasattr(value, "items"):
        return "{" + ", ".join(f"{name!r}: {_short(inner)}" for name, inner in value.items()) + "}"
    if isinstance(value, (list, tuple)) and value and hasattr(value[0], "items"):
        return f"[{len(value)} entries]"
    if hasattr(value, "shape") or isinstance(value, (list, tuple)):
        shaped = np.asarray(value)
        if shaped.size > 9:
            return f"<array of shape {shaped.shape}>"
        return repr(shaped.tolist())
    return repr(value)
