"""Studies from files and dicts."""

from __future__ import annotations

import json
import os

import numpy as np

from ._errors import InputError


def study_text(study):
    """The file of a study, and its text where it is given as a dict."""
    if isinstance(study, (str, os.PathLike)):
        return os.fspath(study), None
    if not hasattr(study, "items"):
        raise InputError(f"study: found {type(study).__name__}, expected the path of a file or a dict")
    return "study", "".join(f"{_key(name)} = {_value(value, name)}\n" for name, value in study.items())


def _key(name):
    if not isinstance(name, str):
        raise InputError(f"study: the key {name!r} is a {type(name).__name__}: expected a text")
    return _text(name)


def _text(text):
    # A string of JSON is one of TOML as well.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value, path):
    """A value as TOML writes it."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, os.PathLike):
        return _text(os.fspath(value))
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        number = float(value)
        return repr(number) if np.isfinite(number) else {"nan": "nan", "inf": "inf", "-inf": "-inf"}[str(number)]
    if isinstance(value, np.ndarray):
        return _value(value.tolist(), path)
    if hasattr(value, "items"):
        return "{ " + ", ".join(f"{_key(name)} = {_value(inner, f'{path}.{name}')}" for name, inner in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(inner, f"{path}[{place}]") for place, inner in enumerate(value)) + "]"
    raise InputError(f"study: {path} is a {type(value).__name__}: expected a number, text, truth value, list, array or dict")
