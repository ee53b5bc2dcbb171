"""Measures what README.md says of the package: python measure.py [--command polhode]

Everything runs in new processes of this Python, which has the package and polars installed. With --command the run time of the command is
measured beside, in turns.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

ROUNDS = 7

FRAME = """
import time; begun = time.perf_counter()
import numpy as np
import polhode
count = 100_000
draws = np.random.default_rng(1)
bodies = polhode.Ensemble(
    polhode.inertia.cylinder(mass=1400.0, radius=1.2, height=6.5).inertia[None],
    draws.normal(size=(count, 4)),
    draws.normal((0, 0, 0.1), (0.02, 0.02, 0.05), size=(count, 3)),
)
frame = polhode.run(polhode.Scene(bodies, end=600.0), accuracy=1e-6).to_polars()
assert frame.height == count
print(time.perf_counter() - begun)
"""

IMPORT = "import time; begun = time.perf_counter(); import {}; print(time.perf_counter() - begun)"

STUDY = """
[bodies]
count = 20_000
inertia = [1.0, 2.0, 2.5]
orientation = {{ distribution = "uniform" }}
angular_velocity = {{ distribution = "normal", mean = [0, 0, 0], sigma = 1.0 }}
[[torque]]
model = "quadratic-drag"
coefficient = 0.01
[time]
end = {end}
[accuracy]
method = "rk4"
dt = 0.01
precision = "f64"
"""

RUN = """
import sys, time
import polhode
# NumPy and the package are loaded here, when they are first used.
engine, run = polhode.Engine("cpu"), polhode.run_study
begun = time.perf_counter()
result = run(sys.argv[1], engine{out})
taken = time.perf_counter() - begun
print(taken, taken - result.report.wall_time.total)
"""

PEAK = """
import resource
import numpy as np
import polhode
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
count = 1_000_000
draws = np.random.default_rng(1)
moments, spin, orientation = np.full((count, 3), (1.0, 2.0, 2.5)), draws.normal(size=(count, 3)), draws.normal(size=(count, 4))
engine = polhode.Engine("cpu")
polhode.run(polhode.Scene(polhode.Ensemble([1, 2, 2.5], None, np.ones((100, 3))), end=1.0), engine)
arrays = peak()
bodies = polhode.Ensemble(moments, orientation, spin)
table = peak()
result = polhode.run(polhode.Scene(bodies, end=10.0), engine)
print(arrays, table - arrays, peak() - table)
"""


def python(code, *arguments):
    begun = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code, *arguments], check=True, capture_output=True, text=True)
    return [float(number) for number in done.stdout.split()], time.perf_counter() - begun


def overhead(command, folder):
    """Seconds of the same study by the command and by Python, into files and into memory: the least of rounds that take turns."""
    study = folder / "study.toml"
    study.write_text(STUDY.format(end=60.0))
    taken = {"command": [], "python, files": [], "python, memory": []}
    outside = []
    for place in range(ROUNDS):
        out = folder / f"command{place}"
        subprocess.run([command, "run", study, "--engine", "cpu", "--quiet", "--out", out], check=True)
        taken["command"].append(json.loads((out / "report.json").read_text())["wall_time"]["total"])
        for name, out in (("python, files", f", out={str(folder / f'python{place}')!r}"), ("python, memory", "")):
            whole, around = python(RUN.format(out=out), str(study))[0]
            taken[name].append(whole)
            outside.append(around / whole)
    return {name: min(seconds) for name, seconds in taken.items()}, median(outside)


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--command", help="the polhode command, to compare with")
    command = arguments.parse_args().command
    for module in ("polhode", "numpy"):
        print(f"import {module}: {median(python(IMPORT.format(module))[0][0] for _ in range(ROUNDS)) * 1e3:.1f} ms")
    frames = [python(FRAME) for _ in range(ROUNDS)]
    inside, whole = median(found[0] for found, _ in frames), median(whole for _, whole in frames)
    print(f"100,000 bodies to a polars frame: {inside:.2f} s, with the start of Python {whole:.2f} s")
    arrays, table, run = python(PEAK)[0]
    print(f"1,000,000 bodies, peak memory: {arrays:.0f} MB with the arrays given, {table:.0f} MB more for the table, {run:.0f} MB more for run and result")
    if command:
        with tempfile.TemporaryDirectory() as folder:
            seconds, outside = overhead(Path(command).absolute(), Path(folder))
        for name, of in seconds.items():
            print(f"20,000 bodies, 6,000 steps each, {name}: {of:.3f} s ({of / seconds['command'] - 1:+.1%})")
        print(f"of a run from Python, spent outside of the library's own: {outside:.1%}")


if __name__ == "__main__":
    main()
