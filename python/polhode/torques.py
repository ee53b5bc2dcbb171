"""Torques, a function each, with keyword arguments.

A parameter is the same for all bodies, or an array with one row a body. The functions follow from what the library's models declare;
`custom` makes a torque of a formula.
"""

from __future__ import annotations

from . import _native
from ._call import call_text, flattened
from .formula import custom

__all__ = ["custom"]


def _made(model, function, given):
    given = {name: value for name, value in given.items() if value is not None}
    return _native.torque(model, flattened(given), call_text(f"polhode.torques.{function}", given))


def _top(parameters):
    """The keywords of a model, in order: the parameters that stand by themselves, and the tables of the others."""
    keywords = {}
    for parameter in parameters:
        table, _, key = parameter["name"].rpartition(".")
        keywords.setdefault(table or key, []).append(parameter)
    return keywords


def _is_needed(members):
    return any(member["default"] is None and member["choice"] is None for member in members)


def _bounds(parameter):
    unit = "" if parameter["unit"] == "1" else f", {parameter['unit']}"
    axes = f", {parameter['frame']} axes" if parameter["frame"] else ""
    valid = f", {parameter['range']}" if parameter["range"] else ""
    default = "" if parameter["default"] is None else f"; default {parameter['default']:g}"
    return f"{parameter['shape']}{unit}{axes}{valid}{default}"


def _described(parameter, name, indent=""):
    other = f" (or {parameter['other'].rpartition('.')[2]})" if parameter["other"] else ""
    lines = [f"{indent}{name}{other} : {_bounds(parameter)}", f"{indent}    {parameter['about']}"]
    for element in parameter["elements"]:
        lines += _described(element, element["name"], f"{indent}        ")
    return lines


def _documentation(model):
    lines = [f"{model['summary']}", "", f"{model['source']}.", "", "Parameters", "----------"]
    for keyword, members in _top(model["parameters"]).items():
        if members[0]["name"] == keyword:
            lines += _described(members[0], keyword)
        else:
            lines.append(f"{keyword} : dict")
            for member in members:
                lines += _described(member, member["name"].rpartition(".")[2], "    ")
    choices = {}
    for parameter in model["parameters"]:
        if parameter["choice"]:
            alternatives = choices.setdefault(parameter["choice"], [])
            if parameter["alternative"] not in alternatives:
                alternatives.append(parameter["alternative"])
    for alternatives in choices.values():
        lines += ["", f"Give one of {', '.join(alternatives)}."]
    return "\n".join(lines)


def _define(model):
    names = [name.replace("-", "_") for name in (model["name"], *model["aliases"])]
    keywords = _top(model["parameters"])
    signature = ", ".join(keyword if _is_needed(members) else f"{keyword}=None" for keyword, members in keywords.items())
    given = ", ".join(f"{keyword!r}: {keyword}" for keyword in keywords)
    for name in names:
        source = f"def {name}(*, {signature}):\n    return _made({model['name']!r}, {name!r}, {{{given}}})\n"
        scope = {"_made": _made}
        exec(source, scope)
        function = scope[name]
        function.__doc__ = _documentation(model)
        function.__module__ = __name__
        globals()[name] = function
        __all__.append(name)


for _model in _native.models():
    _define(_model)
__all__.sort()
