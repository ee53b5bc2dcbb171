"""What a run did and how well."""

from __future__ import annotations

import html
import json
from typing import Any


class Report:
    """A part of `report.json` as attributes; the keys are those of the file. `print(report)` shows what the command shows."""

    def __init__(self, entries: dict[str, Any], summary: str | None = None) -> None:
        self._entries, self._summary = entries, summary

    def __getattr__(self, name: str) -> Any:
        entries = self.__dict__.get("_entries", {})
        if name in entries:
            return _wrapped(entries[name])
        if name.startswith("__"):
            raise AttributeError(name)
        raise AttributeError(f"the report has no {name!r}: it has {', '.join(entries)}")

    def __getitem__(self, name: str) -> Any:
        return _wrapped(self._entries[name])

    def __dir__(self) -> list[str]:
        return [*self._entries, "to_dict", "to_json"]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Report) and self._entries == other._entries

    __hash__ = None  # type: ignore[assignment]

    def to_dict(self) -> dict[str, Any]:
        """The report as dicts and lists."""
        return json.loads(self.to_json())

    def to_json(self) -> str:
        """The report as `report.json` has it."""
        return json.dumps(self._entries, indent=2)

    def __repr__(self) -> str:
        if self._summary is not None:
            return self._summary
        return "\n".join(f"{name}: {_short(value)}" for name, value in self._entries.items())

    def _repr_html_(self) -> str:
        if self._summary is None:
            rows = [(name, _short(value)) for name, value in self._entries.items()]
        else:
            rows = _rows(self._summary)
        cell = '<td style="text-align: left; white-space: pre">'
        lines = "".join(
            f'<tr><th style="text-align: left; vertical-align: top">{html.escape(name)}</th>{cell}{html.escape(text)}</td></tr>'
            for name, text in rows
        )
        return f"<table>{lines}</table>"


def _wrapped(value):
    if isinstance(value, dict):
        return Report(value)
    if isinstance(value, list):
        return [_wrapped(element) for element in value]
    return value


def _short(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name}: {_short(inner)}" for name, inner in value.items()) + "}"
    if isinstance(value, list) and len(value) > 8:
        return f"[{len(value)} entries]"
    return repr(value)


def _rows(summary):
    """The lines of the summary under the word that each begins with; a line without one goes on with the last."""
    rows = []
    for line in summary.splitlines():
        word, text = line[2:11].strip(), line[11:]
        if not line.startswith("  "):
            rows.append(("", line))
        elif word or not rows:
            rows.append((word, text))
        else:
            rows[-1] = (rows[-1][0], f"{rows[-1][1]}\n{text}")
    return rows
