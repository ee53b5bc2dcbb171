"""Torques by the functions that follow from the library's declarations."""

import inspect

import numpy as np
import polars
import polhode
import pytest
from conftest import tumbling
from polhode import _native, torques

MODELS = _native.models()

ORBIT = {"mu": 3.986e14, "orbit": {"radius": 7e6, "inclination": 0.9}}
FACET = {"area": 0.5, "normal": [1, 0, 0], "centre": [0, 1, 0.2], "solar": {"specular": 0.3, "diffuse": 0.2}}
VALUES = {
    "constant-body": {"torque": [0.1, 0.2, 0.3]},
    "constant-world": {"torque": [0.1, 0.2, 0.3]},
    "linear-drag": {"coefficient": 0.1},
    "matrix-drag": {"matrix": np.diag([0.1, 0.2, 0.3])},
    "quadratic-drag": {"coefficient": 0.1},
    "sinusoidal": {"sine": [0.1, 0, 0], "cosine": [0, 0.1, 0], "rate": 2.0},
    "gravity-gradient": ORBIT,
    "heavy-top": {"mass": 1.0, "centre": [0, 0, 0.3], "gravity": [0, 0, -9.81]},
    "magnetic-dipole": {"moment": [0.1, 0, 0.2], "field": [0, 0, 1.0]},
    "orbiting-dipole": {**ORBIT, "moment": [0.1, 0, 0.2], "strength": 7.8e15, "tilt": 0.2},
    "eddy-current": {"coefficient": 0.1, "field": [0, 0, 1.0]},
    "orbiting-eddy-current": {**ORBIT, "coefficient": 1e3, "strength": 7.8e15},
    "flat-plates": {"pressure": 0.1, "direction": [1, 0, 0.2], "facets": [FACET, {**FACET, "normal": [-1, 0, 0]}]},
    "sine-spring": {"stiffness": 0.5, "target": [0, 0, 0, 1]},
    "log-spring": {"stiffness": 0.5, "target": [0, 0, 0, 1]},
    "internal-dissipation": {"coefficient": 0.02},
    "pd-attitude": {"stiffness": 0.5, "damping": 0.3, "target": [0, 0, 0, 1], "torque_limit": 0.2, "every": 0.1},
    "pd-direction": {
        **{"stiffness": 0.5, "damping": 0.3, "axis": [0, 0, 1], "direction": [1, 0, 0], "torque_limit": 0.2},
        **{"every": 0.1, "delay": 0.05},
    },
    "reaction-wheels": {
        **{"stiffness": 0.5, "damping": 0.3, "target": [0, 0, 0, 1], "torque_limit": 0.2, "momentum_limit": 0.1},
        **{"momentum": [0.01, 0, 0], "every": 0.1, "delay": 0.05},
    },
    "magnetorquers": {**ORBIT, "gain": 1e8, "moment_limit": 1e4, "strength": 7.8e15, "every": 0.2},
    "white-noise": {"intensity": 0.01, "seed": 3},
    "variable-inertia": {"factor": 1.2, "ramp": {"start": 0.2, "duration": 0.5}},
}
"""What each model may be called with; a model without an entry fails the tests below."""


def function(model):
    return getattr(torques, model["name"].replace("-", "_"))


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model["name"])
def test_every_model_runs_as_the_study_of_the_same_values(model, engine, tmp_path):
    given = VALUES[model["name"]]
    table = tmp_path / "bodies.csv"
    tumbling(33).to_polars().write_csv(table)
    bodies = polhode.Ensemble.from_table(polars.read_csv(table))
    stepped = {"method": "rk8", "dt": 0.05, "precision": "f64"}
    found = polhode.run(polhode.Scene(bodies, function(model)(**given), end=1.0), engine, **stepped)
    free = polhode.run(polhode.Scene(bodies, end=1.0, skip=False), engine, **stepped)
    changed = np.abs(found.angular_velocity_body - free.angular_velocity_body).max()
    assert changed > 1e-7, "the torque has acted"

    torque = [{"model": model["name"], **given}]
    study = {"bodies": {"file": table}, "torque": torque, "time": {"end": 1.0}, "accuracy": stepped}
    expected = polhode.run_study(study, engine)
    np.testing.assert_array_equal(found.orientation, expected.orientation)
    np.testing.assert_array_equal(found.angular_velocity_body, expected.angular_velocity_body)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model["name"])
def test_functions_say_what_they_take(model):
    of = function(model)
    assert all(parameter.kind is inspect.Parameter.KEYWORD_ONLY for parameter in inspect.signature(of).parameters.values())
    keywords = {parameter["name"].split(".")[0] for parameter in model["parameters"]}
    assert set(inspect.signature(of).parameters) == keywords
    for parameter in model["parameters"]:
        assert parameter["about"] in of.__doc__
        assert parameter["unit"] == "1" or parameter["unit"] in of.__doc__
    assert model["source"] in of.__doc__ and model["summary"] in of.__doc__
    for alias in model["aliases"]:
        assert inspect.signature(getattr(torques, alias.replace("-", "_"))) == inspect.signature(of)


def test_a_column_is_a_value_for_each_body():
    bodies = tumbling(3)
    coefficients = np.array([0.0, 0.1, 0.4])
    result = polhode.run(polhode.Scene(bodies, torques.linear_drag(coefficient=coefficients), end=1.0), "cpu")
    for body, coefficient in enumerate(coefficients):
        alone = polhode.Ensemble(bodies.inertia[[body]], bodies.orientation[[body]], bodies.angular_velocity_body[[body]])
        one = polhode.run(polhode.Scene(alone, torques.linear_drag(coefficient=coefficient), end=1.0), "cpu")
        np.testing.assert_allclose(result.angular_velocity_body[body], one.angular_velocity_body[0], atol=1e-6)


def test_columns_of_matrices_tensors_and_rotations():
    from scipy.spatial.transform import Rotation

    bodies = tumbling(2)
    matrices = np.array([np.zeros((3, 3)), np.diag([0.1, 0.2, 0.3])])
    tensors = bodies.inertia * np.array([1.0, 2.0])[:, None, None]
    targets = Rotation.from_quat(bodies.orientation)
    acting = [
        torques.matrix_drag(matrix=matrices),
        torques.sine_spring(stiffness=[0.0, 0.3], target=targets),
        torques.variable_inertia(inertia=tensors, oscillation={"rate": 2.0}),
    ]
    result = polhode.run(polhode.Scene(bodies, acting, end=1.0), "cpu", method="rk8", dt=0.01)
    free = polhode.run(polhode.Scene(bodies, end=1.0), "cpu", accuracy=1e-12)
    moved = np.abs(result.angular_velocity_body - free.angular_velocity_body).max(axis=1)
    assert moved[0] < 1e-9 < 1e-3 < moved[1]


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: torques.linear_drag(coefficient="x"), "coefficient: dtype <U1: expected real numbers"),
        (lambda: torques.linear_drag(coefficient=[[1, 2]]), "linear-drag: coefficient = (1, 2): expected the coefficient c (N m s)"),
        (lambda: torques.constant_body(torque=[1, 2]), "constant-body: torque = (2,): expected"),
        (lambda: torques.constant_body(torque=True), "torque = True: expected a number or an array"),
        (lambda: torques.white_noise(intensity=1.0, seed=0.5), "a whole number that is not negative"),
        (lambda: torques.white_noise(intensity=1.0, seed=-1), "a whole number that is not negative"),
        (lambda: torques.gravity_gradient(mu=4e14, orbit={}), "gravity-gradient: orbit.semi_major_axis: expected the semi-major axis"),
        (lambda: torques.gravity_gradient(mu=4e14, orbit={"radiu": 7e6}), "gravity-gradient: orbit.radiu: expected mu, orbit."),
        (
            lambda: torques.gravity_gradient(mu=4e14, orbit={"radius": 7e6, "eccentricity": 0.1}),
            "orbit.eccentricity: orbit.radius excludes it",
        ),
        (lambda: torques.variable_inertia(factor=2.0), "variable-inertia: ramp: expected ramp or oscillation"),
        (
            lambda: torques.flat_plates(pressure=1, direction=[1, 0, 0], facets=[{**FACET, "solar": {"specular": 2, "diffuse": 0}}]),
            "flat-plates: facets[1].solar.specular = 2: expected a finite number from 0 to 1",
        ),
        (lambda: torques.flat_plates(pressure=1, direction=[1, 0, 0], facets=3), "flat-plates: facets = 3: expected the plates"),
    ],
)
def test_what_is_not_valid_is_refused_at_once(call, message):
    with pytest.raises(polhode.InputError) as refusal:
        call()
    assert message in str(refusal.value)


@pytest.mark.parametrize(
    "coefficient, message",
    [
        (-1, "torque 1 (linear-drag): coefficient = -1: expected a finite number that is not negative (N m s)"),
        ([0.1, np.nan], "torque 1 (linear-drag), body 1: coefficient = NaN"),
        ([0.1, 0.2, 0.3], "column coefficient has 3 rows: expected 2, one a body"),
    ],
)
def test_values_are_checked_when_a_run_begins(coefficient, message):
    with pytest.raises(polhode.InputError) as refusal:
        polhode.run(polhode.Scene(tumbling(2), torques.linear_drag(coefficient=coefficient), end=1.0), "cpu")
    assert message in str(refusal.value)


def test_torques_show_how_they_were_made():
    assert repr(torques.linear_drag(coefficient=0.1)) == "polhode.torques.linear_drag(coefficient=0.1)"
    shown = repr(torques.gravity_gradient(mu=4e14, orbit={"radius": np.full(20, 7e6)}))
    assert shown == "polhode.torques.gravity_gradient(mu=400000000000000.0, orbit={'radius': <array of shape (20,)>})"
    assert torques.viscous(coefficient=0.1).name == "linear-drag" and torques.viscous(coefficient=1).dissipative


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: polhode.forces.gravity(acceleration=9.81), "force gravity: acceleration: expected an array of shape (3,) or (n, 3) (m/s²"),
        (lambda: polhode.forces.linear_drag(coefficient=[[1.0]]), "force linear-drag: coefficient: expected a number or an array of shape (n,)"),
    ],
)
def test_forces_are_checked(call, message):
    with pytest.raises(polhode.InputError) as refusal:
        call()
    assert message in str(refusal.value)


def test_drag_on_the_centre_of_mass_has_its_closed_form():
    bodies = polhode.Ensemble([1, 1, 1], None, np.zeros((2, 3)), mass=[1.0, 2.0], velocity=[3.0, 0, 0])
    result = polhode.run(polhode.Scene(bodies, forces=polhode.forces.linear_drag(coefficient=[0.5, 0.0]), end=2.0), "cpu")
    np.testing.assert_allclose(result.velocity[:, 0], [3 * np.exp(-1.0), 3.0], rtol=1e-14)
    thrust = polhode.run(polhode.Scene(bodies, forces=polhode.forces.thrust(force=[0, 2.0, 0]), end=1.0), "cpu")
    np.testing.assert_allclose(thrust.position[:, 1], [1.0, 0.5], rtol=1e-12)
    drag = polhode.run(polhode.Scene(bodies, forces=polhode.forces.quadratic_drag(coefficient=0.5), end=2.0), "cpu")
    np.testing.assert_allclose(drag.velocity[0, 0], 3.0 / (1 + 3.0 * 0.5 * 2.0), rtol=1e-9)
