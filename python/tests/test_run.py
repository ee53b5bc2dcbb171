"""Runs: what they compute, what they give back, and what goes on meanwhile."""

import signal
import threading
import time

import numpy as np
import polhode
import pytest
from conftest import rotated, tumbling
from scipy.integrate import solve_ivp

BODIES = 101
"""Not a multiple of any workgroup or lane group."""


def test_free_bodies_follow_the_closed_form(engine):
    bodies = tumbling(BODIES)
    result = polhode.run(polhode.Scene(bodies, end=30.0, outputs=10.0), engine, accuracy=1e-8)
    exact = polhode.free_motion(bodies.inertia, bodies.orientation, bodies.angular_velocity_body, [10.0, 20.0, 30.0])
    np.testing.assert_array_equal(result.snapshots.times, [10.0, 20.0, 30.0])
    errors = polhode.toolkit.attitude_error(result.snapshots.orientation, exact.orientation.swapaxes(0, 1))
    assert errors.shape == (3, BODIES) and np.percentile(errors, 99) < 1e-8
    np.testing.assert_array_equal(result.orientation, result.snapshots.orientation[-1])
    assert result.time == 30.0 and result.report.accuracy.met is True


def test_scipy_finds_the_same_motion_under_torques(engine):
    """An independent integration of Euler's equations in NumPy, body axes, with the torques written down anew."""
    bodies = tumbling(5, seed=2)
    drag, field, moment = 0.05, np.array([0.0, 0.3, 1.0]), np.array([0.2, -0.1, 0.4])
    torques = [polhode.torques.linear_drag(coefficient=drag), polhode.torques.magnetic_dipole(moment=moment, field=field)]
    result = polhode.run(polhode.Scene(bodies, torques, end=5.0), engine, accuracy=1e-9)
    for body in range(5):
        tensor = bodies.inertia[body]

        def slope(_, state):
            q, spin = state[:4], state[4:]
            field_body = rotated(q * [-1, -1, -1, 1], field)
            torque = -drag * spin + np.cross(moment, field_body)
            rate = np.array([*(q[3] * spin + np.cross(q[:3], spin)), -q[:3] @ spin]) / 2.0
            return [*rate, *np.linalg.solve(tensor, torque - np.cross(spin, tensor @ spin))]

        start = [*bodies.orientation[body], *bodies.angular_velocity_body[body]]
        end = solve_ivp(slope, (0.0, 5.0), start, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        assert polhode.toolkit.attitude_error(result.orientation[body], end[:4]) < 2e-8
        np.testing.assert_allclose(result.angular_velocity_body[body], end[4:], atol=2e-8)


def test_momentum_and_energy_are_those_of_the_state(engine):
    bodies = tumbling(BODIES)
    result = polhode.run(polhode.Scene(bodies, [polhode.torques.linear_drag(coefficient=0.1)], end=2.0), engine)
    momentum_body = np.einsum("nij,nj->ni", bodies.inertia, result.angular_velocity_body)
    np.testing.assert_allclose(result.angular_momentum_world, rotated(result.orientation, momentum_body), atol=1e-13)
    energy = 0.5 * np.einsum("ni,ni->n", result.angular_velocity_body, momentum_body)
    np.testing.assert_allclose(result.kinetic_energy, energy, rtol=1e-12)
    assert result.status.dtype == np.uint8 and not result.status.any()


def test_bodies_move_through_space(engine):
    bodies = tumbling(BODIES, mass=2.0, velocity=[1.0, 0.0, 3.0])
    forces = [polhode.forces.gravity(acceleration=[0, 0, -9.81]), polhode.forces.constant(force=[4.0, 0.0, 0.0])]
    result = polhode.run(polhode.Scene(bodies, forces=forces, end=2.0, outputs=[0.5]), engine)
    np.testing.assert_allclose(result.position, np.broadcast_to([6.0, 0.0, 6.0 - 19.62], (BODIES, 3)), atol=1e-12)
    np.testing.assert_allclose(result.velocity, np.broadcast_to([5.0, 0.0, 3.0 - 19.62], (BODIES, 3)), atol=1e-12)
    assert result.snapshots.position.shape == (2, BODIES, 3)


def test_methods_and_steps_may_be_pinned(engine):
    scene = polhode.Scene(tumbling(BODIES), [polhode.torques.linear_drag(coefficient=0.01)], end=1.0, skip=False)
    result = polhode.run(scene, engine, method="rk4", dt=0.01, precision="f64")
    assert result.report.plan.method == "rk4" and result.report.plan.precision == "f64"
    assert result.report.plan.steps == 100 and result.report.body_steps == 100 * BODIES
    adaptive = polhode.run(scene, engine, method="rk8", tolerance=1e-10)
    assert adaptive.report.adaptive.accepted.total > 0
    assert np.max(polhode.toolkit.attitude_error(result.orientation, adaptive.orientation)) < 1e-6
    free = polhode.Scene(tumbling(BODIES), end=1.0)
    assert polhode.run(free, engine, method="rk8", dt=0.01, projection=True).report.plan.method == "rk8"
    precise = polhode.Accuracy(attitude=1e-7, energy=1e-9, percentile=95)
    report = polhode.run(scene, engine, accuracy=precise).report
    assert report.accuracy.target.to_dict() == {"attitude": 1e-7, "angular_velocity": None, "energy": 1e-9, "percentile": 95.0}
    assert polhode.run(scene, engine, accuracy={"energy": 1e-9}).report.accuracy.target.attitude is None


def test_statistics_alone_leave_the_states(engine):
    bodies = tumbling(BODIES)
    scene = polhode.Scene(bodies, end=4.0, outputs=1.0, statistics=["spin_rate", "kinetic_energy"], states=False)
    result = polhode.run(scene, engine)
    spin = result.statistics["spin_rate"]
    assert spin.mean.shape == (4,) and spin.unit == "rad/s" and (result.statistics.count == BODIES).all()
    kept = polhode.run(polhode.Scene(bodies, end=4.0, outputs=1.0), engine)
    rates = np.linalg.norm(kept.snapshots.angular_velocity_body, axis=2)
    np.testing.assert_allclose(spin.mean, rates.mean(axis=1), rtol=1e-6)
    np.testing.assert_array_equal(spin.max_body, rates.argmax(axis=1))
    np.testing.assert_allclose(result.statistics["kinetic_energy"].min, kept.snapshots.kinetic_energy.min(axis=1), rtol=1e-6)
    assert list(result.statistics.to_polars().columns)[:4] == ["t", "count", "spin_rate_mean", "spin_rate_standard_deviation"]
    assert result.snapshots is None
    with pytest.raises(polhode.InputError, match="holds no states"):
        result.orientation


def test_bodies_that_fail_are_listed(engine):
    """A torque that grows without bound beyond a spin of 1 rad/s."""
    spin = np.zeros((20, 3))
    spin[:, 2] = 0.1
    spin[7, 2] = 2.0
    runaway = polhode.formula.custom("exp(exp(20 * (norm(angular_velocity) - 1))) * angular_velocity - 3 * angular_velocity")
    scene = polhode.Scene(polhode.Ensemble([1.0, 2.0, 2.5], None, spin), [runaway], end=1.0)
    result = polhode.run(scene, engine, method="rk4", dt=0.01)
    assert result.failures["body"].tolist() == [7]
    assert np.isnan(result.orientation[7]).all() and np.isfinite(np.delete(result.orientation, 7, 0)).all()
    assert result.reasons[result.status[7]] == result.failures["reason"][0] == "not_finite"
    assert result.report.failed_bodies == [7]


def test_scenes_share_the_table_and_are_left_alone():
    bodies = tumbling(BODIES)
    before = bodies.orientation
    scene = polhode.Scene(bodies, end=1.0)
    first, second = polhode.run(scene, "cpu"), polhode.run(scene, "cpu")
    np.testing.assert_array_equal(first.orientation, second.orientation)
    np.testing.assert_array_equal(bodies.orientation, before)


def test_results_are_their_own_memory():
    result = polhode.run(polhode.Scene(tumbling(BODIES), end=1.0), "cpu")
    orientation = result.orientation
    assert orientation.flags.writeable and orientation.flags.c_contiguous
    del result
    orientation[0] = [0, 0, 0, 1]
    assert np.isfinite(orientation).all()


def test_no_bodies_make_an_empty_result(engine):
    result = polhode.run(polhode.Scene(polhode.Ensemble([1, 1, 1], None, np.zeros((0, 3))), end=1.0), engine)
    assert result.orientation.shape == (0, 4) and len(result.to_polars()) == 0


def test_tables_have_the_columns_of_the_command():
    bodies = tumbling(BODIES, mass=1.0)
    result = polhode.run(polhode.Scene(bodies, end=1.0, outputs=0.5), "cpu")
    names = "body t qx qy qz qw wx wy wz lx ly lz kinetic_energy x y z vx vy vz status".split()
    frame = result.to_pandas()
    assert list(frame.columns) == names and result.to_polars().columns == names and result.to_arrow().column_names == names
    np.testing.assert_array_equal(frame[["qx", "qy", "qz", "qw"]], result.orientation)
    np.testing.assert_array_equal(frame["lz"], result.angular_momentum_world[:, 2])
    np.testing.assert_array_equal(frame["body"], np.arange(BODIES))
    every = result.snapshots.to_pandas()
    assert len(every) == 2 * BODIES and every["t"].tolist() == [0.5] * BODIES + [1.0] * BODIES
    np.testing.assert_array_equal(every["wx"][:BODIES], result.snapshots.angular_velocity_body[0, :, 0])


def test_the_result_shows_itself():
    result = polhode.run(polhode.Scene(tumbling(BODIES), end=1.0), "cpu")
    assert "101 bodies, 1 s" in repr(result) and "failed   none" in repr(result)
    page = result._repr_html_()
    assert page.startswith("<table>") and "101 bodies, 1 s" in page
    with pytest.raises(AttributeError, match="the report has no 'acuracy'"):
        result.report.acuracy
    assert result.report.to_dict()["bodies"] == BODIES and "wall_time" in dir(result.report)


def long_scene():
    """Some minutes of work on any machine."""
    bodies = tumbling(20_000)
    return polhode.Scene(bodies, [polhode.torques.quadratic_drag(coefficient=1e-9)], end=1e5)


@pytest.fixture
def interruptible():
    """Ctrl-C raises, also in a job of the background, which shells start with the signal ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_an_interrupt_ends_a_run_within_a_second(interruptible):
    import _thread

    begun = time.monotonic()
    threading.Timer(0.5, _thread.interrupt_main).start()
    with pytest.raises(KeyboardInterrupt):
        polhode.run(long_scene(), "cpu", method="rk4", dt=0.01)
    assert time.monotonic() - begun < 1.5


def test_an_interrupt_ends_planning_too(interruptible):
    import _thread

    # Seconds of planning: hundreds of thousands of steps a body.
    torques = [polhode.torques.sinusoidal(sine=[0.1, 0.2, 0.1], rate=1e4)]
    begun = time.monotonic()
    threading.Timer(0.1, _thread.interrupt_main).start()
    with pytest.raises(KeyboardInterrupt):
        polhode.run(polhode.Scene(tumbling(1000), torques, end=100.0), "cpu", accuracy=1e-6)
    assert time.monotonic() - begun < 3.5


def test_other_threads_go_on_meanwhile():
    ticks, done = [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.005)

    thread = threading.Thread(target=tick)
    thread.start()
    begun = time.monotonic()
    scene = polhode.Scene(tumbling(4_000), [polhode.torques.quadratic_drag(coefficient=1e-9)], end=200.0)
    polhode.run(scene, "cpu", method="rk4", dt=0.01)
    taken = time.monotonic() - begun
    done.set()
    thread.join()
    within = [tick for tick in ticks if begun < tick < begun + taken]
    assert taken > 0.2 and len(within) > 20 * taken, (taken, len(within))


def test_progress_is_told_and_what_it_raises_ends_the_run():
    told = []

    def stop(done, total):
        told.append((done, total))
        if total is not None and done > 0:
            raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        polhode.run(long_scene(), "cpu", method="rk4", dt=0.01, progress=stop)
    done, total = told[-1]
    assert 0 < done < total and total == 20_000 * 10**7


def test_a_bar_is_shown_where_it_is_asked_for(capfd):
    scene = polhode.Scene(tumbling(4_000), [polhode.torques.quadratic_drag(coefficient=1e-9)], end=400.0)
    polhode.run(scene, "cpu", method="rk4", dt=0.01, progress=True)
    assert "body-steps" in capfd.readouterr().err
    polhode.run(scene, "cpu", method="rk4", dt=0.01)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    "scene, options, message",
    [
        ({"end": -1.0}, {}, "time.end = -1.0: expected a finite time that is not negative (s)"),
        ({"end": np.nan}, {}, "time.end = NaN"),
        ({"end": [1, 2]}, {}, "end: shape (2,): expected a number"),
        ({"outputs": [0.5, 0.2]}, {}, "expected increasing times (s)"),
        ({"outputs": np.ones((2, 2))}, {}, "outputs: shape (2, 2): expected an interval or times"),
        ({"statistics": ["spin"]}, {}, "statistics: \"spin\": expected kinetic_energy, spin_rate, angular_momentum"),
        ({"torques": [3]}, {}, "torques[0]: found int, expected polhode.Torque"),
        ({"forces": "gravity"}, {}, "forces[0]: found str, expected polhode.Force"),
        ({"forces": polhode.forces.gravity(acceleration=[0, 0, 1])}, {}, "a force needs masses"),
        ({}, {"accuracy": -1}, "accuracy.attitude = -1.0: expected an angle above 0 and up to pi (rad)"),
        ({}, {"accuracy": {"atitude": 1}}, "accuracy: 'atitude': expected attitude, angular_velocity, energy, percentile"),
        ({}, {"accuracy": 1e-6, "method": "rk4"}, "accuracy excludes method"),
        ({}, {"method": "rk5", "dt": 0.1}, 'method = "rk5": expected rk4, rk8'),
        ({}, {"method": "rk4"}, 'method = "rk4": expected dt beside it (s)'),
        ({}, {"method": "rk4", "dt": 0.1, "tolerance": 1e-9}, "dt excludes tolerance"),
        ({}, {"method": "rk4", "tolerance": 1e-9}, 'methods with adaptive steps are "rk8" and "taylor"'),
        ({}, {"method": "taylor", "dt": 0.1}, 'the steps of "taylor" are adaptive'),
        ({}, {"dt": 0.1}, "dt: expected a method beside it"),
        ({}, {"projection": True}, "projection: expected a method beside it"),
        ({}, {"method": "rk8", "dt": 0.1, "least_step": 0.1}, "least_step: expected the tolerance"),
        ({}, {"precision": "f16"}, 'precision = "f16": expected "auto", "f32" or "f64"'),
        ({}, {"engine": "tpu"}, 'engine = "tpu": expected "auto", "cpu" or "gpu"'),
        ({}, {"engine": 3}, 'engine = 3: expected "auto", "cpu", "gpu" or a polhode.Engine'),
    ],
)
def test_what_makes_no_sense_is_refused(scene, options, message):
    with pytest.raises(polhode.InputError) as refusal:
        made = polhode.Scene(tumbling(2), **{"end": 1.0, **scene})
        polhode.run(made, **{"engine": "cpu", **options})
    assert message in str(refusal.value)


def test_other_things_are_no_scenes():
    with pytest.raises(polhode.InputError, match="scene: found Ensemble, expected polhode.Scene"):
        polhode.run(tumbling(2))
    with pytest.raises(polhode.InputError, match="ensemble: found int, expected polhode.Ensemble"):
        polhode.Scene(3, end=1.0)


def test_the_plan_explains_itself():
    text = polhode.explain(polhode.Scene(tumbling(BODIES), end=60.0), "cpu")
    assert "101 bodies, 60 s" in text and "closed" in text


def test_engines_say_what_they_are(engine):
    assert engine.kind in ("cpu", "gpu") and engine.name and "f32" in engine.precisions
    assert engine.kind in repr(engine)


def test_devices_are_listed():
    found = polhode.devices()
    assert found and {"index", "name", "kind", "precisions"} <= set(found[0]) and found.auto in repr(found)
    with pytest.raises(polhode.InputError, match="adapter"):
        polhode.Engine("gpu", adapter=999)
    with pytest.raises(polhode.InputError, match="the CPU engine has no adapter"):
        polhode.Engine("cpu", adapter=0)
