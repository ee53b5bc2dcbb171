"""Writes polhode/torques.pyi from what the library's models declare: python stubs.py, with the package installed or on the path."""

from pathlib import Path

from polhode import _native, torques

HEADER = '''"""Written by stubs.py from what the library's models declare."""

from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike
from polhode._ensemble import Orientation
from polhode._native import Torque
from polhode.formula import custom as custom

__all__: list[str]
'''


def _annotation(members, keyword):
    first = members[0]
    if first["name"] != keyword:
        return "Mapping[str, ArrayLike]"
    if first["is_list"]:
        return "Sequence[Mapping[str, Any]]"
    if "quaternion" in first["shape"]:
        return "Orientation"
    return "int" if "whole number" in first["shape"] else "ArrayLike"


def stubs():
    """The text of the stub file."""
    text = HEADER
    for model in _native.models():
        taken = []
        for keyword, members in torques._top(model["parameters"]).items():
            annotation = _annotation(members, keyword)
            taken.append(f"{keyword}: {annotation}" if torques._is_needed(members) else f"{keyword}: {annotation} | None = None")
        for name in (model["name"], *model["aliases"]):
            text += f"\ndef {name.replace('-', '_')}(*, {', '.join(taken)}) -> Torque: ...\n"
    return text


if __name__ == "__main__":
    Path(torques.__file__).with_suffix(".pyi").write_text(stubs())
