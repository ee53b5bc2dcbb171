"""Torques and forces of the user's own, as text and by operators."""

import numpy as np
import polhode
import pytest
from conftest import tumbling
from polhode import formula as f

STEPPED = {"method": "rk8", "dt": 0.02, "precision": "f64"}


def ended(torque, engine, bodies):
    return polhode.run(polhode.Scene(bodies, torque, end=1.0, skip=False), engine, **STEPPED)


def test_operators_make_the_models_of_the_library(engine):
    bodies = tumbling(33)
    moment, field = np.array([0.1, -0.3, 0.2]), np.array([0.2, 0.1, 0.9])
    coefficients = np.linspace(0.0, 0.3, 33)
    drag = f.parameter(coefficients, per_body=True)
    pairs = [
        (-(drag * f.angular_velocity), polhode.torques.linear_drag(coefficient=coefficients)),
        (-0.2 * f.norm(f.angular_velocity) * f.angular_velocity, polhode.torques.quadratic_drag(coefficient=0.2)),
        (f.cross(moment, f.to_body(field)), polhode.torques.magnetic_dipole(moment=moment, field=field)),
        (
            f.parameter([0.1, 0, 0]) * f.sin(2.0 * f.time) + [0, 0.2, 0] * f.cos(2 * f.time),
            polhode.torques.sinusoidal(sine=[0.1, 0, 0], cosine=[0, 0.2, 0], rate=2.0),
        ),
    ]
    for own, known in pairs:
        own, known = ended(f.custom(own), engine, bodies), ended(known, engine, bodies)
        free = ended([], engine, bodies)
        assert np.abs(known.angular_velocity_body - free.angular_velocity_body).max() > 1e-2
        np.testing.assert_allclose(own.angular_velocity_body, known.angular_velocity_body, atol=1e-13)
        np.testing.assert_allclose(own.orientation, known.orientation, atol=1e-13)


def test_text_and_operators_agree_to_the_bit(engine):
    bodies = tumbling(33)
    k, u, omega = f.parameter(0.3), f.to_body([0, 0, 1]), f.angular_velocity
    by_operators = f.custom(k * f.cross(u, omega))
    by_text = f.custom("k * cross(to_body(vec(0, 0, 1)), angular_velocity)", {"k": 0.3})
    np.testing.assert_array_equal(ended(by_operators, engine, bodies).orientation, ended(by_text, engine, bodies).orientation)


def python_value(expression, omega):
    """The text of a number, worked out by Python itself."""
    import math
    import re

    names = {"angular_velocity": omega, **{name: getattr(math, name) for name in ("sin", "cos", "exp", "sqrt", "atan2", "pi", "tau", "pow")}}
    names |= {"abs": abs, "min": min, "max": max, "dot": lambda a, b: sum(x * y for x, y in zip(a, b))}
    names |= {"select": lambda truth, a, b: a if truth else b, "vec": lambda *v: v, "ln": math.log}
    *definitions, last = str(expression).replace("^", "**").replace("&&", " and ").replace("||", " or ").replace("!", " not ").split(";\n")
    component = re.compile(r"angular_velocity\.([xyz])")
    for definition in definitions:
        name, text = definition.removeprefix("let ").split(" = ", 1)
        names[name] = eval(component.sub(lambda of: str(omega["xyz".index(of[1])]), text), names)
    return eval(component.sub(lambda of: str(omega["xyz".index(of[1])]), last), names)


@pytest.mark.parametrize("place", range(14))
def test_operators_write_what_python_would_compute(place):
    x, y, z = f.angular_velocity.x, f.angular_velocity.y, f.angular_velocity.z
    forms = [
        (x - y - z, lambda x, y, z: x - y - z),
        (x - (y - z), lambda x, y, z: x - (y - z)),
        (x / y / z, lambda x, y, z: x / y / z),
        (x / (y * z), lambda x, y, z: x / (y * z)),
        (-x**2, lambda x, y, z: -(x**2)),
        ((-x) ** 2, lambda x, y, z: (-x) ** 2),
        (2.0**x, lambda x, y, z: 2.0**x),
        (3 - x, lambda x, y, z: 3 - x),
        (1 / x, lambda x, y, z: 1 / x),
        (np.float64(-2.5) * x + np.int64(3), lambda x, y, z: -2.5 * x + 3),
        (f.select((x < y) & ~(y >= z) | (z > 5), x, z), lambda x, y, z: x if (x < y and not y >= z) or z > 5 else z),
        (f.select((x > y) | (y <= z), x + 1, z), lambda x, y, z: x + 1 if x > y or y <= z else z),
        (abs(y) + f.min(x, z) * f.max(y, 0.1) + f.atan2(x, y), lambda x, y, z: abs(y) + min(x, z) * max(y, 0.1) + np.arctan2(x, y)),
        (f.ln(f.exp(f.sqrt(x))) + f.pi * f.sin(f.tau), lambda x, y, z: x**0.5),
    ]
    expression, expected = forms[place]
    for omega in [(0.3, -0.7, 1.1), (1.2, 0.4, 0.2), (0.5, 0.6, 0.55)]:
        assert python_value(expression, omega) == pytest.approx(expected(*omega), rel=1e-12, abs=1e-12)
    f.custom(f.vec(expression, 0, 0))


def test_what_is_used_twice_is_written_once():
    shared = f.cross(f.angular_velocity, f.to_body([0, 0, 1]))
    text = str(shared * f.norm(shared))
    assert text.count("cross(") == 1 and text.startswith("let v1 = cross(")
    doubled = f.angular_velocity
    for _ in range(60):
        doubled = doubled + doubled
    assert len(str(doubled)) < 4000
    f.custom(doubled)


def test_a_parameter_that_is_used_twice_is_one():
    k = f.parameter(np.arange(1.0, 4.0), per_body=True)
    text, parameters = f._written(k * f.angular_velocity + k * k * f.angular_momentum)
    assert len(parameters) == 1 and text.count("p1") == 3


def test_long_sums_do_not_nest_without_end():
    total = f.angular_velocity * 0.0
    for place in range(1000):
        total = total + f.vec(0, 0, f.sin(place * 0.01 + f.time)) * 1e-6
    f.custom(total)


def test_energies_close_the_balance():
    bodies = tumbling(33)
    k, up = f.parameter(0.3), f.to_body([0, 0, 1])
    pendulum = f.custom(k * f.cross([0, 0, 1], up), energy=-k * f.dot(up, [0, 0, 1]))
    by_text = f.custom("k * cross(vec(0,0,1), to_body(vec(0,0,1)))", {"k": 0.3}, energy="-k * dot(to_body(vec(0,0,1)), vec(0,0,1))")
    for torque in (pendulum, by_text):
        balance = polhode.run(polhode.Scene(bodies, torque, end=5.0), "cpu", accuracy=1e-10).report.balance
        assert balance.total_energy.max < 1e-9
    wrong = f.custom(k * f.cross([0, 0, 1], up), energy=k * f.dot(up, [0, 0, 1]))
    assert polhode.run(polhode.Scene(bodies, wrong, end=5.0), "cpu").report.balance.total_energy.max > 1e-2
    with pytest.raises(polhode.InputError, match="parameters that the torque has too"):
        f.custom(f.cross([0, 0, 1], up), energy=k * f.dot(up, [0, 0, 1]))


def test_forces_of_ones_own_move_centres_of_mass():
    """A harmonic oscillator of unit mass and stiffness 4."""
    bodies = polhode.Ensemble([1, 1, 1], None, [0.0, 0.0, 0.0], mass=1.0, position=[1.0, 0, 0])
    for force in (polhode.forces.custom(-4 * f.position * f.mass), polhode.forces.custom("-k * position", {"k": 4.0})):
        result = polhode.run(polhode.Scene(bodies, forces=force, end=1.0), "cpu")
        np.testing.assert_allclose(result.position[0], [np.cos(2.0), 0, 0], atol=1e-9)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: f.custom(f.angular_velocity * f.angular_velocity), "found a vector and a vector, needed `dot(a, b)` or `cross(a, b)`"),
        (lambda: f.custom(f.time), "found a number, needed a vector"),
        (lambda: f.custom("k * angular_velocty", {"k": 1.0}), "unknown name `angular_velocty`; nearest: `angular_velocity`"),
        (lambda: f.custom("k * angular_velocity"), "unknown name `k`"),
        (lambda: f.custom("k * angular_velocity", {"time": 1.0}), "parameter time:"),
        (lambda: f.custom("k * angular_velocity", {"k": np.ones(7)}), "parameter k of shape [7]: expected a number, three"),
        (lambda: f.custom(f.angular_velocity, {"k": 1.0}), "torque: parameters go with a text"),
        (lambda: f.custom(f.angular_velocity / 0), "division by zero"),
        (lambda: f.custom(f.mass * f.angular_velocity), "mass"),
        (lambda: f.parameter(np.ones(2)), "parameter: shape (2,): expected (), (3,) or (4,)"),
        (lambda: f.parameter(1.0, per_body=True), "parameter: shape (): expected (n,), (n, 3) or (n, 4)"),
        (lambda: f.angular_velocity * np.ones(5), "a constant of a formula of shape (5,)"),
        (lambda: f.angular_velocity * np.inf, "a constant of a formula = inf: expected a finite number"),
        (lambda: f.angular_velocity * "x", "dtype <U1"),
    ],
)
def test_formulas_that_are_none_are_refused(make, message):
    with pytest.raises(polhode.InputError) as refusal:
        make()
    assert message in str(refusal.value)


def test_a_formula_is_no_number():
    x = f.angular_velocity.x
    for use in (lambda: bool(x), lambda: x == 1, lambda: x != 1, lambda: list(x), lambda: 0 < x < 1, lambda: np.sin(x)):
        with pytest.raises(TypeError):
            use()
    with pytest.raises(AttributeError, match="components x, y, z, w"):
        x.real
    assert "angular_velocity.x" in repr(x)


def test_the_picture_shows_the_place():
    with pytest.raises(polhode.InputError) as refusal:
        f.custom("let up = to_body(vec(0, 0, 1));\nk * up", {})
    assert str(refusal.value).splitlines() == ["line 2, column 1: unknown name `k`", "k * up", "^"]
