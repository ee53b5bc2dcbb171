"""The package as it is installed: names, stubs, time to import, memory."""

import importlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import polhode
import pytest

SOURCE = Path(__file__).parents[1]

MEDIAN_OF = 5
IMPORT_LIMIT = 0.1
"""s; of the interpreter's own start nothing is counted."""


INSTALLED = Path(polhode.__file__).parents[1]


def mypy(module, *arguments, folder):
    """Runs a type checker with the settings of the package, wherever that is."""
    path = {} if INSTALLED.name == "site-packages" else {"MYPYPATH": str(INSTALLED), "PYTHONPATH": str(INSTALLED)}
    command = [sys.executable, "-m", module, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env={**os.environ, **path})
    return done.returncode, done.stdout + done.stderr


def run_python(code, *arguments):
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_import_takes_less_than_a_tenth_of_a_second():
    code = "import time; begun = time.perf_counter(); import polhode; print(time.perf_counter() - begun)"
    taken = sorted(float(run_python(code)) for _ in range(MEDIAN_OF))[MEDIAN_OF // 2]
    assert taken < IMPORT_LIMIT


def test_every_name_is_there_and_documented():
    assert set(polhode.__all__) <= set(dir(polhode))
    for name in polhode.__all__:
        assert getattr(polhode, name).__doc__, name
    for module in ("forces", "formula", "inertia", "toolkit", "torques"):
        for name in importlib.import_module(f"polhode.{module}").__all__:
            member = getattr(getattr(polhode, module), name)
            assert not callable(member) or member.__doc__, f"{module}.{name}"
    with pytest.raises(AttributeError, match="has no attribute 'Scenes'"):
        polhode.Scenes
    assert polhode.__version__.count(".") == 2


def test_stubs_are_those_of_the_models():
    sys.path.insert(0, str(SOURCE))
    try:
        import stubs
    finally:
        sys.path.remove(str(SOURCE))
    assert Path(polhode.torques.__file__).with_suffix(".pyi").read_text() == stubs.stubs(), "run python/stubs.py"


FOR_CHECKERS_ALONE = r"polhode\.\w+\.(Orientation|Operand|Progress|Rotation|pandas|pyarrow|polars)"
"""Names that modules import under TYPE_CHECKING, so that the packages need not be there."""


def test_stubs_agree_with_the_package(tmp_path):
    settings, allowed = str(SOURCE / "pyproject.toml"), tmp_path / "allowed.txt"
    allowed.write_text(FOR_CHECKERS_ALONE)
    options = ["--ignore-missing-stub", "--allowlist", str(allowed), "--ignore-unused-allowlist", "--mypy-config-file", settings]
    code, said = mypy("mypy.stubtest", "polhode", *options, folder=tmp_path)
    assert code == 0, said


USER = """
import numpy as np
import polhode
from polhode import formula as f

bodies = polhode.Ensemble([1, 2, 2.5], None, np.ones((3, 3)))
torques = [polhode.torques.linear_drag(coefficient=0.1), f.custom(2.0 * f.cross(f.angular_velocity, [0, 0, 1]))]
result = polhode.run(polhode.Scene(bodies, torques, end=1.0), "cpu", accuracy=1e-6)
moments: float = result.orientation.sum() + polhode.inertia.sphere(radius=1.0, mass=2.0).inertia.sum()
"""


def test_a_type_checker_accepts_what_is_right_and_finds_what_is_wrong(tmp_path):
    def checked(text):
        (tmp_path / "user.py").write_text(text)
        settings = str(SOURCE / "pyproject.toml")
        return mypy("mypy", "--config-file", settings, str(tmp_path / "user.py"), folder=tmp_path)[1]

    assert "Success" in checked(USER), checked(USER)
    for right, wrong in (("coefficient=0.1", "coeficient=0.1"), ('"cpu"', "3"), ("end=1.0", 'end="1"'), ("result.orientation", "result.orientatio")):
        assert "error" in checked(USER.replace(right, wrong)), wrong


PEAK = """
import resource, sys
import numpy as np
import polhode
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
count = 1_000_000
draws = np.random.default_rng(1)
moments, spin = np.full((count, 3), (1.0, 2.0, 2.5)), draws.normal(size=(count, 3))
orientation = draws.normal(size=(count, 4))
engine = polhode.Engine("cpu")
polhode.run(polhode.Scene(polhode.Ensemble([1, 2, 2.5], None, np.ones((100, 3))), end=1.0), engine)
before = peak()
bodies = polhode.Ensemble(moments, orientation, spin)
table = peak() - before
result = polhode.run(polhode.Scene(bodies, end=10.0), engine)
print(table, peak() - before, result.orientation.nbytes + result.angular_velocity_body.nbytes)
"""

TABLE_BYTES = 6 * 8 + 4 * 8 + 3 * 8
"""A row of the library's table: tensor, orientation, angular velocity."""
RESULT_BYTES = 8 * 11 + 1
"""A row of the result: orientation, angular velocity, angular momentum, energy, status."""
RUN_BYTES = 80
"""What a run of free bodies has beside these, a body: rows of the closed form and what is gathered of the drift."""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the unit of the peak differs elsewhere")
def test_a_million_bodies_are_not_copied():
    table, whole, _ = (int(number) for number in run_python(PEAK).split())
    count = 1_000_000
    assert table < 1.1 * TABLE_BYTES * count, f"{table / count} bytes a body"
    assert whole < 1.1 * (TABLE_BYTES + RESULT_BYTES + RUN_BYTES) * count, f"{whole / count} bytes a body"


def test_arrays_of_the_same_memory_are_read_in_place():
    """Strided columns of a table of doubles, as a view of a larger one, need no copy of it."""
    wide = np.zeros((1000, 20))
    wide[:, 5:8] = (1.0, 2.0, 2.5)
    from polhode._arrays import array

    assert np.shares_memory(array(wide[:, 5:8], "inertia"), wide)
    assert len(polhode.Ensemble(wide[:, 5:8], None, wide[:, 10:13])) == 1000
