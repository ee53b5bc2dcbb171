"""Quantiles, histograms, events and quantities of one's own, against NumPy, closed forms and the files of the command."""

import numpy as np
import polars
import polhode
import pytest
from conftest import rotated, tumbling
from polhode import formula as f

QUANTILE_ERROR = 2.5e-4
"""Of a quantile, relative, as the library says."""

SWEPT = {
    "seed": 3,
    "bodies": {
        "count": 120,
        "inertia": {"moments": [1.0, 1.7, 2.2], "scatter": 0.2},
        "orientation": {"distribution": "uniform"},
        "angular_velocity": {"distribution": "log-normal", "median": 1.5, "sigma": 0.7},
    },
    "sweep": [{"name": "drag", "values": [0.05, 0.2, 0.6]}],
    "torque": [{"model": "linear-drag", "coefficient": {"sweep": "drag"}}],
    "time": {"end": 4.0, "outputs": {"every": 1.0}},
    "accuracy": {"method": "rk8", "dt": 0.05},
    "histogram": [{"quantity": "spin_rate", "low": 0.1, "high": 10.0, "bins": 20, "scale": "log"}],
    "event": [{"name": "slow", "quantity": "spin_rate", "falls_below": 1.0}],
    "output": {"snapshots": True, "statistics": ["kinetic_energy", "nutation"], "quantiles": [5, 50, 95]},
}


def test_events_are_where_the_closed_form_has_them(engine):
    # Spheres under drag: the spin rate falls as exp(-c t / I).
    rates = np.geomspace(0.6, 40.0, 300)
    bodies = polhode.Ensemble([2.0, 2.0, 2.0], angular_velocity_body=rates[:, None] * np.array([0.6, 0.0, 0.8]))
    events = [polhode.Event("slow", "spin_rate", below=1.0), polhode.Event("slows", "spin_rate", falls_below=1.0)]
    scene = polhode.Scene(bodies, [polhode.torques.linear_drag(coefficient=0.4)], end=15.0, outputs=1.0, events=events)
    result = polhode.run(scene, engine, method="rk8", tolerance=1e-12)
    due = np.maximum(np.log(rates) / 0.2, 0.0)
    for name, is_own in (("slow", due <= 15.0), ("slows", (due <= 15.0) & (rates > 1.0))):
        event = result.events[name]
        assert sorted(event.body) == np.flatnonzero(is_own).tolist()
        np.testing.assert_allclose(event.time, due[event.body], atol=1e-8)
        np.testing.assert_allclose(np.linalg.norm(event.angular_velocity_body, axis=1)[event.time > 0], 1.0, rtol=1e-8)
        assert np.all(np.diff(event.time) >= 0.0) and (event.bodies, event.level, event.unit) == (300, 1.0, "rad/s")
        survival = event.survival
        np.testing.assert_array_equal(survival.t, np.arange(16.0))
        np.testing.assert_array_equal(survival.remaining, [300 - np.sum(is_own & (due <= t)) for t in survival.t])
        np.testing.assert_allclose(survival.share, survival.remaining / 300, rtol=1e-12)
        assert np.all((survival.low <= survival.share) & (survival.share <= survival.high)) and survival.cell is None
    slow = result.events["slow"]
    assert {known for known, time in zip(slow.known_to, slow.time) if time == 0.0} == {"start"}
    assert set(slow.known_to) == {"start", "located"} and len(slow.failed_body) == 0
    # By Kaplan and Meier's product, which rounds: the share of one half, or the one below it.
    assert slow.median in np.sort(slow.time)[149:151]
    assert [event.event for event in result.report.events] == ["slow", "slows"]
    frame = slow.to_polars()
    assert frame.columns[:3] == ["body", "t", "known_to"] and frame.height == len(slow.body)
    assert slow.to_arrow().column_names == slow.to_pandas().columns.to_list() == frame.columns
    assert "of 300 bodies" in repr(slow) and "95" not in repr(polhode.Event("a", "yaw", above=1.0))


def test_counts_and_quantiles_are_those_of_the_states(engine):
    axis, direction = np.array([0.0, 0.0, 1.0]), np.array([1.0, 1.0, 0.0])
    pointing = polhode.Quantity.axis_angle("pointing", 3.0 * axis, direction)
    up = f.to_world([0, 0, 1])
    height = polhode.Quantity.formula("height", f.dot(up, [0, 0, 1]) * 2.0, unit="m")
    same = polhode.Quantity.formula("same", "2.0 * dot(to_world(vec(0, 0, 1)), vec(0, 0, 1))", unit="m")
    scene = polhode.Scene(
        tumbling(3000),
        end=4.0,
        outputs=2.0,
        statistics=["spin_rate", pointing, height, same],
        quantiles=[50, 5, 97.5],
        histograms=[
            polhode.Histogram(pointing, 0.2, 3.0, 14),
            polhode.Histogram("spin_rate", 0.3, 6.0, 9, logarithmic=True),
        ],
    )
    result = polhode.run(scene, engine)
    states = result.snapshots
    assert list(result.statistics) == ["spin_rate", "pointing", "height", "same"]
    heights = 2.0 * rotated(states.orientation, axis)[..., 2]
    cosines = rotated(states.orientation, axis) @ (direction / np.sqrt(2.0))
    numbers = {
        "spin_rate": np.linalg.norm(states.angular_velocity_body, axis=-1),
        "pointing": np.arccos(np.clip(cosines, -1.0, 1.0)),
        "height": heights,
        "same": heights,
    }
    for name, values in numbers.items():
        summary = result.statistics[name]
        assert list(summary.quantiles) == [5.0, 50.0, 97.5]
        np.testing.assert_allclose(summary.mean, values.mean(axis=1), rtol=1e-9, atol=1e-9)
        for percent, found in summary.quantiles.items():
            ranked = np.percentile(values, percent, axis=1, method="inverted_cdf")
            np.testing.assert_allclose(found, ranked, rtol=QUANTILE_ERROR, atol=1e-9, err_msg=f"{name}, {percent} %")
    np.testing.assert_array_equal(result.statistics["height"].mean, result.statistics["same"].mean)
    assert result.statistics["height"].unit == "m" and "height_q97.5" in result.statistics.to_polars().columns
    for histogram, name in zip(result.histograms, ("pointing", "spin_rate")):
        edges = histogram.edges
        values = numbers[name]
        # Values within rounding of an edge may be on either side of it in NumPy's own arithmetic.
        assert np.min(np.abs(values[..., None] - edges)) > 1e-12
        counts = [np.histogram(at, edges)[0] for at in values]
        np.testing.assert_array_equal(histogram.counts, counts)
        np.testing.assert_array_equal(histogram.below, np.sum(values < edges[0], axis=1))
        np.testing.assert_array_equal(histogram.above, np.sum(values >= edges[-1], axis=1))
        np.testing.assert_array_equal(histogram.times, states.times)
        assert (histogram.quantity, histogram.to_polars()["count"].sum()) == (name, 3000 * len(states.times))
    np.testing.assert_allclose(result.histograms[0].edges, np.linspace(0.2, 3.0, 15), rtol=1e-14)
    np.testing.assert_allclose(result.histograms[1].edges, np.geomspace(0.3, 6.0, 10), rtol=1e-14)


def test_bodies_without_a_finite_value_are_counted():
    scene = polhode.Scene(
        tumbling(300),
        end=2.0,
        outputs=1.0,
        statistics=[polhode.Quantity.formula("root", "sqrt(angular_velocity.y)"), "spin_rate"],
    )
    result = polhode.run(scene, "cpu")
    root, spin = (result.statistics[name] for name in ("root", "spin_rate"))
    np.testing.assert_array_equal(root.count, np.sum(result.snapshots.angular_velocity_body[..., 1] >= 0.0, axis=1))
    assert (spin.count == 300).all() and (result.statistics.count == 300).all()
    columns = result.statistics.to_polars().columns
    assert columns[:4] == ["t", "count", "root_count", "root_mean"] and "spin_rate_count" not in columns


def test_without_states_the_counts_are_the_same():
    histogram = polhode.Histogram("kinetic_energy", 0.0, 10.0, 40)
    parts = dict(end=3.0, outputs=1.0, histograms=histogram, statistics="kinetic_energy", quantiles=50)
    kept, left = (polhode.run(polhode.Scene(tumbling(500), **parts, states=states), "cpu") for states in (True, False))
    assert left.snapshots is None and kept.events == left.events == {}
    np.testing.assert_array_equal(kept.histograms[0].counts, left.histograms[0].counts)
    medians = [result.statistics["kinetic_energy"].quantiles[50.0] for result in (kept, left)]
    np.testing.assert_array_equal(*medians)


def test_those_of_a_study_are_those_of_its_files(tmp_path):
    found = polhode.run_study(SWEPT, "cpu")
    polhode.run_study(SWEPT, "cpu", out=tmp_path / "out")
    table = {name: polars.read_csv(tmp_path / "out" / f"{name}.csv") for name in ("events", "survival", "histograms", "statistics")}
    slow, survival = found.events["slow"], found.events["slow"].survival
    assert 0 < len(slow.body) < 360
    own = slow.to_polars()
    for column in own.columns:
        np.testing.assert_array_equal(own[column], table["events"][column], err_msg=column)
    for column in ("t", "remaining", "share", "low", "high", "cell"):
        np.testing.assert_array_equal(getattr(survival, column), table["survival"][column], err_msg=column)
    counts = found.histograms[0].to_polars()
    np.testing.assert_array_equal(counts["count"], table["histograms"]["count"])
    np.testing.assert_array_equal(counts["high"], table["histograms"]["high"])
    statistics = found.statistics.to_polars()
    assert sorted(statistics.columns) == sorted(table["statistics"].columns)
    for column in statistics.columns:
        np.testing.assert_array_equal(statistics[column], table["statistics"][column], err_msg=column)


@pytest.mark.parametrize("engine", ["cpu", "gpu"])
def test_a_stopped_body_stands_where_its_spin_fell_below_the_level(engine):
    spin = np.linspace(0.4, 2.0, 50)
    spheres = polhode.Ensemble([2.0, 2.0, 2.0], angular_velocity_body=spin[:, None] * np.array([0.0, 0.0, 1.0]))
    slow = polhode.Event("slow", "spin_rate", below=0.5, action="stop")
    never = polhode.Event("never", "spin_rate", below=0.45)
    scene = polhode.Scene(spheres, [polhode.torques.linear_drag(coefficient=0.2)], end=10.0, outputs=1.0, events=[slow, never])
    found = polhode.run(scene, engine)
    # The spin decays as exp(-t / 10 s).
    expected = np.maximum(10.0 * np.log(spin / 0.5), 0.0)
    stopped = expected <= 10.0
    assert 0 < stopped.sum() < 50
    np.testing.assert_array_equal(found.status, np.where(stopped, polhode.Result.reasons.index("stopped"), 0))
    np.testing.assert_allclose(found.stopped_at[stopped], expected[stopped], atol=1e-5)
    assert np.isnan(found.stopped_at[~stopped]).all()
    np.testing.assert_allclose(found.angular_velocity_body[stopped, 2], np.minimum(spin, 0.5)[stopped], rtol=1e-9)
    record = found.events["never"]
    np.testing.assert_array_equal(np.sort(record.stopped_body), np.flatnonzero(stopped & (spin >= 0.45)))
    assert found.events["slow"].action == "stop" and record.action == "record" and len(record.failed_body) == 0
    assert "stopped_at" in found.to_polars().columns and len(found.failures["body"]) == 0
    assert polhode.run(polhode.Scene(spheres, end=1.0), engine).stopped_at is None


@pytest.mark.parametrize(
    "asked, said",
    [
        (lambda: dict(statistics="spin"), 'statistics: "spin": expected kinetic_energy, spin_rate, .*, or a polhode.Quantity'),
        (lambda: dict(events=polhode.Event("a", "jaw", above=0.0)), 'quantity of the event "a": "jaw": expected'),
        (lambda: dict(statistics=[3]), "statistics: found int, expected the name of a quantity or a polhode.Quantity"),
        (lambda: dict(statistics="yaw", quantiles=[50, 101]), "quantiles = 101.*0 to 100"),
        (lambda: dict(histograms=["yaw"]), r"histograms\[0\]: found str, expected polhode.Histogram"),
        (lambda: dict(histograms=polhode.Histogram("yaw", 1.0, 1.0)), "high = 1.0: expected a finite number above"),
        (lambda: dict(histograms=polhode.Histogram("yaw", 0.0, 1.0, 0)), "bins = 0.0: expected 1 to 100000"),
        (lambda: dict(histograms=polhode.Histogram("yaw", 0.0, 1.0, logarithmic=True)), "low = 0.0: expected a number above zero"),
        (lambda: dict(histograms=polhode.Histogram("yaw", 0.0, 1.0, 2.5)), r"bins = 2.5: expected a whole number"),
        (lambda: dict(events=polhode.Event("a", "yaw", below=float("nan"))), "below = NaN: expected a finite level"),
        (lambda: dict(events=polhode.Event("a", "yaw", below=1.0, above=2.0)), "found below, above, expected one of below, above"),
        (lambda: dict(events=polhode.Event("a", "yaw")), "found none, expected one of"),
        (lambda: dict(events=polhode.Event("a", "yaw", above=0.0, occurrence=0)), "occurrence = 0.0: expected 1 or more"),
        (lambda: dict(events=polhode.Event("a", "yaw", above=0.0, action="halt")), "action = 'halt': expected one of record, stop"),
        (lambda: dict(events=[polhode.Event("a", "yaw", above=x) for x in (0.0, 1.0)]), "'a' is the name of two"),
        (lambda: dict(statistics=polhode.Quantity.axis_angle("a", [0, 0, 0], [0, 0, 1])), "axis.*not zero"),
        (lambda: dict(statistics=polhode.Quantity.axis_angle("a", [0, 0], [0, 0, 1])), r"axis: shape \(2,\): expected \(3,\)"),
        (lambda: dict(statistics=polhode.Quantity.formula("a", "attitude +")), "line 1, column"),
        (lambda: dict(statistics=polhode.Quantity.formula("a", f.angular_velocity)), "found a vector, needed a number"),
        (lambda: dict(statistics=polhode.Quantity.formula("a", f.parameter(2.0) * f.time)), "has no parameters"),
    ],
)
def test_what_is_not_valid_is_refused(asked, said):
    with pytest.raises(polhode.InputError, match=said):
        polhode.run(polhode.Scene(tumbling(3), end=1.0, **asked()), "cpu")
