"""Studies from files and dicts, and the command beside them."""

import json
from pathlib import Path

import numpy as np
import polars
import polhode
import pytest

STUDIES = Path(__file__).parents[2] / "examples" / "studies"

STUDY = {
    "title": 'Tumbling "stages"\n',
    "seed": np.int64(42),
    "bodies": {
        "count": 100,
        "inertia": {"shape": "cylinder", "mass": 1400.0, "radius": 1.2, "height": 6.5},
        "orientation": {"distribution": "uniform"},
        "angular_velocity": {"distribution": "normal", "mean": np.array([0, 0, 0.1]), "sigma": (0.02, 0.02, 0.05)},
    },
    "torque": [{"model": "viscous", "coefficient": 1e-3}],
    "time": {"end": 60, "outputs": {"every": 20.0}},
    "accuracy": {"attitude": 1e-6},
    "output": {"snapshots": True, "statistics": ["spin_rate"], "final": True},
}

TEXT = """
title = 'Tumbling "stages"'
seed = 42
[bodies]
count = 100
inertia = { shape = "cylinder", mass = 1400.0, radius = 1.2, height = 6.5 }
orientation = { distribution = "uniform" }
angular_velocity = { distribution = "normal", mean = [0, 0, 0.1], sigma = [0.02, 0.02, 0.05] }
[[torque]]
model = "viscous"
coefficient = 1e-3
[time]
end = 60
outputs = { every = 20.0 }
[accuracy]
attitude = 1e-6
[output]
snapshots = true
statistics = ["spin_rate"]
"""


def test_dict_and_file_are_the_same_study(tmp_path):
    file = tmp_path / "study.toml"
    file.write_text(TEXT)
    of_file, of_dict = polhode.run_study(file, "cpu"), polhode.run_study(STUDY, "cpu")
    assert of_file.snapshots.orientation.shape == (3, 100, 4)
    np.testing.assert_array_equal(of_file.snapshots.orientation, of_dict.snapshots.orientation)
    assert of_file.report.study.file == str(file) and of_dict.report.study.title == STUDY["title"]
    np.testing.assert_array_equal(of_file.statistics["spin_rate"].mean, of_dict.statistics["spin_rate"].mean)
    bodies = polhode.Ensemble.from_study(file)
    assert len(bodies) == 100
    np.testing.assert_array_equal(bodies.inertia, polhode.Ensemble.from_study(STUDY).inertia)


def test_states_in_memory_are_those_in_files(tmp_path):
    found = polhode.run_study(STUDY, "cpu")
    written = polhode.run_study(STUDY, "cpu", out=tmp_path / "out")
    for name, frame in (("final", found.to_polars()), ("snapshots", found.snapshots.to_polars()), ("statistics", found.statistics.to_polars())):
        table = polars.read_csv(tmp_path / "out" / f"{name}.csv")
        assert table.columns == frame.columns
        for column in frame.columns:
            np.testing.assert_array_equal(table[column], frame[column], err_msg=column)
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["plan"]["parts"] == written.report.to_dict()["plan"]["parts"]
    assert "final.csv" in written.report.files
    with pytest.raises(polhode.InputError, match="they were written to final.csv"):
        written.orientation
    with pytest.raises(polhode.FileError, match="the output folder is not empty"):
        polhode.run_study(STUDY, "cpu", out=tmp_path / "out")
    polhode.run_study(STUDY, "cpu", out=tmp_path / "out", force=True)


def test_precision_and_skipping_are_options():
    assert "f32" in polhode.run_study({**STUDY, "accuracy": {"method": "rk4", "dt": 0.1}}, "cpu", precision="f32").report.plan.precision
    assert polhode.run_study(STUDY, "cpu", skip=False).report.body_steps > polhode.run_study(STUDY, "cpu").report.body_steps
    with pytest.raises(polhode.InputError, match="precision"):
        polhode.run_study(STUDY, "cpu", precision="f16")


@pytest.mark.parametrize("name", ["intermediate_axis", "bdot", "curveball"])
def test_shipped_studies_run(name):
    result = polhode.run_study(STUDIES / f"{name}.toml", "cpu")
    assert result.report.bodies > 0 and not result.report.failed_bodies


@pytest.mark.parametrize(
    "change, message",
    [
        ({"time": {"end": -1.0}}, "time.end = -1.0"),
        ({"time": {"end": float("nan")}}, "time.end = nan"),
        ({"times": {"end": 1.0}}, "times"),
        ({"bodies": {"count": 3}}, "bodies.inertia"),
        ({"torque": [{"model": "viscous", "coefficient": "much"}]}, "torque[1].coefficient"),
        ({"torque": [{"model": "viscos", "coefficient": 1.0}]}, "did you mean viscous?"),
        ({"time": {"end": None}}, "study: time.end is a NoneType: expected a number, text, truth value, list, array or dict"),
        ({3: 4}, "study: the key 3 is a int: expected a text"),
        ({"bodies": {"file": "none.csv"}}, "none.csv: cannot be read"),
    ],
)
def test_studies_that_are_none_are_refused(change, message):
    with pytest.raises(polhode.Error) as refusal:
        polhode.run_study({**STUDY, **change}, "cpu")
    assert message in str(refusal.value), str(refusal.value)


def test_files_that_are_missing_or_wrong(tmp_path):
    with pytest.raises(polhode.FileError, match="cannot be read") as refusal:
        polhode.run_study(tmp_path / "none.toml")
    assert isinstance(refusal.value, OSError)
    file = tmp_path / "study.toml"
    file.write_text(TEXT.replace("coefficient = 1e-3", "coeficient = 1e-3"))
    with pytest.raises(polhode.InputError, match=r"study\.toml:\d+: torque\[1\]\.coeficient"):
        polhode.run_study(file, "cpu")
    with pytest.raises(polhode.InputError, match="study: found int"):
        polhode.run_study(3)
    with pytest.raises(polhode.InputError) as picture:
        polhode.run_study({**STUDY, "torque": [{"model": "custom", "torque": "k * angular_velocity"}]})
    assert "unknown name `k`" in str(picture.value) and "^" in str(picture.value)


def test_texts_of_any_kind_survive():
    title = 'quotes " and \\ backslashes\ttabs \x7f é ∫ \U0001f680'
    study = {**STUDY, "title": title, "bodies": {**STUDY["bodies"], "count": 1}}
    assert polhode.run_study(study, "cpu").report.study.title == title
