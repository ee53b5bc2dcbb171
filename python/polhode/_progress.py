"""How far a run is: a bar of tqdm where that is installed, in terminals and in notebooks."""

from __future__ import annotations

import sys
import time
import warnings
from importlib.util import find_spec

from ._errors import InputError

#: A run shorter than this, s, shows no bar: it would only flash.
QUIET_START = 0.3


def _is_watched():
    if hasattr(sys.stderr, "isatty") and sys.stderr.isatty():
        return True
    # Notebooks have a kernel whose output is no terminal.
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython and hasattr(ipython, "get_ipython") else None
    return type(shell).__name__ == "ZMQInteractiveShell"


def _bar(total):
    with warnings.catch_warnings():
        # A notebook without its widgets gets a bar of text, and no page of advice.
        warnings.simplefilter("ignore")
        from tqdm.auto import tqdm
    return tqdm(total=total, unit=" body-steps", unit_scale=True, leave=False, desc="planning")


class _Bar:
    def __init__(self):
        self.since, self.bar = time.monotonic(), None

    def __call__(self, done, total):
        if self.bar is None and time.monotonic() - self.since < QUIET_START:
            return
        if self.bar is None:
            self.bar = _bar(total)
        if total is not None:
            self.bar.total = total
            self.bar.set_description_str("running", refresh=False)
            self.bar.update(done - self.bar.n)
        else:
            self.bar.refresh()

    def close(self):
        if self.bar is not None:
            self.bar.close()


class _Silent:
    def __call__(self, done, total):
        pass

    def close(self):
        pass


class _Own(_Silent):
    def __init__(self, report):
        self.report = report

    def __call__(self, done, total):
        self.report(done, total)


def shown(progress):
    """What is called some twenty times a second with what is done and the whole, in body-steps, both None while planning."""
    if callable(progress):
        return _Own(progress)
    if progress is False or (progress is None and not _is_watched()):
        return _Silent()
    if find_spec("tqdm") is not None:
        return _Bar()
    if progress:
        raise InputError("progress = True: expected tqdm to be installed, or a function of what is done and the whole")
    return _Silent()
