"""Engines."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from typing import Any

from . import _native
from ._errors import InputError


@contextmanager
def _quiet_drivers():
    """Some drivers look for a Wayland display and write to standard error where its folder is not set: one that does not exist keeps them quiet."""
    if not sys.platform.startswith("linux") or "XDG_RUNTIME_DIR" in os.environ:
        yield
        return
    os.environ["XDG_RUNTIME_DIR"] = "/nonexistent"
    try:
        yield
    finally:
        os.environ.pop("XDG_RUNTIME_DIR", None)


def _open(name, adapter):
    with _quiet_drivers():
        return _native.open_engine(name, adapter)


class Engine:
    """An engine that is open and can be given to any number of runs.

    Parameters
    ----------
    name : "auto", "cpu" or "gpu"
        "auto" takes the best real GPU with the CPU beside it, else the CPU. "gpu" takes a software adapter too.
    adapter : int, optional
        The index of an adapter in `devices()`.

    Raises
    ------
    polhode.InputError
        Where there is no such adapter, or it cannot be used.
    """

    __slots__ = ("_engine",)

    def __init__(self, name: str = "auto", *, adapter: int | None = None) -> None:
        self._engine = _open(name, adapter)

    @property
    def kind(self) -> str:
        """"cpu" or "gpu"."""
        return self._engine.kind

    @property
    def name(self) -> str:
        """The adapter's name, or the processor's instruction set and cores."""
        return self._engine.name

    @property
    def driver(self) -> str:
        """The driver and its version; empty on the CPU."""
        return self._engine.driver

    @property
    def software(self) -> bool:
        """Whether a software adapter plays the GPU."""
        return self._engine.software

    @property
    def precisions(self) -> tuple[str, ...]:
        """The precisions that it computes in: "f32", "f64"."""
        return tuple(self._engine.precisions)

    def __repr__(self) -> str:
        return f"<polhode.Engine {self.kind}: {self.name}>"


def opened(engine):
    """The engine that is asked for, by name or as it is."""
    if isinstance(engine, Engine):
        return engine._engine
    if isinstance(engine, str):
        return _open(engine, None)
    raise InputError(f'engine = {engine!r}: expected "auto", "cpu", "gpu" or a polhode.Engine')


class Devices(list[dict[str, Any]]):
    """The adapters of this machine, a dict each, and what `engine="auto"` takes (`auto`)."""

    auto: str

    def __init__(self, adapters: list[dict[str, Any]], auto: str) -> None:
        super().__init__(adapters)
        self.auto = auto

    def __repr__(self) -> str:
        lines = [f"  {one['index']}  {one['name']} ({one['kind']}, {one['backend']}; {', '.join(one['precisions']) or 'not usable'})" for one in self]
        return "\n".join(["adapters" if lines else "no adapters", *lines, f"auto takes {self.auto}"])


def devices() -> Devices:
    """The GPU adapters of this machine, each opened and probed, and what `engine="auto"` takes."""
    with _quiet_drivers():
        return Devices(*_native.adapters())
