"""Tables of bodies from arrays and data frames, and what is refused."""

import numpy as np
import pandas
import polars
import polhode
import pyarrow
import pytest
from conftest import tumbling
from scipy.spatial.transform import Rotation

COUNT = 7


def arrays(count=COUNT):
    draws = np.random.default_rng(3)
    return draws.uniform(2.0, 3.0, (count, 3)), draws.normal(size=(count, 4)), draws.normal(size=(count, 3))


def test_columns_come_back_as_they_were_given():
    moments, orientation, spin = arrays()
    bodies = polhode.Ensemble(moments, orientation, spin)
    assert len(bodies) == COUNT
    np.testing.assert_array_equal(bodies.inertia, moments[:, :, None] * np.eye(3))
    np.testing.assert_allclose(bodies.orientation, orientation / np.linalg.norm(orientation, axis=1, keepdims=True), rtol=1e-15)
    np.testing.assert_array_equal(bodies.angular_velocity_body, spin)
    assert bodies.mass is None and bodies.position is None and bodies.velocity is None


def test_tensors_keep_their_elements():
    bodies = tumbling(COUNT)
    again = polhode.Ensemble(bodies.inertia, bodies.orientation, bodies.angular_velocity_body)
    np.testing.assert_array_equal(again.inertia, bodies.inertia)
    assert abs(bodies.inertia[0, 0, 1]) > 1e-3


def test_a_single_row_stands_for_all_bodies():
    _, _, spin = arrays()
    tensor = [[2.0, 0.1, 0.0], [0.1, 2.5, 0.0], [0.0, 0.0, 3.0]]
    bodies = polhode.Ensemble([tensor], [0, 0, 0, 2], spin, mass=3.0, velocity=[0, 0, 1])
    np.testing.assert_array_equal(bodies.inertia, np.broadcast_to(tensor, (COUNT, 3, 3)))
    np.testing.assert_array_equal(bodies.orientation, np.broadcast_to([0, 0, 0, 1], (COUNT, 4)))
    np.testing.assert_array_equal(bodies.mass, np.full(COUNT, 3.0))
    np.testing.assert_array_equal(bodies.position, np.zeros((COUNT, 3)))
    np.testing.assert_array_equal(bodies.velocity, np.broadcast_to([0, 0, 1], (COUNT, 3)))
    assert len(polhode.Ensemble([1, 1, 1], None, [1, 2, 3])) == 1
    assert len(polhode.Ensemble([1, 1, 1], None, np.zeros((0, 3)))) == 0


def strided(values):
    wide = np.zeros((values.shape[0], 2, *values.shape[1:]))
    wide[:, 1] = values
    return wide[:, 1]


def read_only(values):
    values = values.copy()
    values.flags.writeable = False
    return values


def unaligned(values):
    raw = bytearray(values.nbytes + 1)
    raw[1:] = values.tobytes()
    return np.frombuffer(raw, dtype=values.dtype, offset=1).reshape(values.shape)


@pytest.mark.parametrize(
    "laid_out",
    [
        strided,
        read_only,
        unaligned,
        np.asfortranarray,
        lambda values: values[::-1][::-1],
        lambda values: values.astype(">f8"),
        lambda values: values.tolist(),
        lambda values: values.astype(np.longdouble),
        lambda values: np.ma.array(values),
    ],
)
def test_memory_may_lie_in_any_way_and_is_left_alone(laid_out):
    given = arrays()
    expected = polhode.Ensemble(*given)
    laid = [laid_out(values) for values in given]
    before = [np.array(values, copy=True) for values in laid]
    found = polhode.Ensemble(*laid)
    np.testing.assert_array_equal(found.inertia, expected.inertia)
    np.testing.assert_array_equal(found.orientation, expected.orientation)
    np.testing.assert_array_equal(found.angular_velocity_body, expected.angular_velocity_body)
    for values, copy in zip(laid, before):
        np.testing.assert_array_equal(np.asarray(values), copy)


def test_numbers_of_other_types_are_converted():
    bodies = polhode.Ensemble(np.array([2, 2, 3], np.int8), None, np.ones((4, 3), np.float32))
    np.testing.assert_array_equal(bodies.angular_velocity_body, np.ones((4, 3)))


@pytest.mark.parametrize(
    "inertia, orientation, spin, message",
    [
        ([1, 2, 3.5], None, [[1, 0, 0]], "body 0: I1 + I2 - I3 = -0.5"),
        ([1, 2, 2.5], None, [[1, 0, 0], [1, np.nan, 0]], "body 1: wy = NaN: expected a finite number"),
        ([1, 2, np.inf], None, [1, 0, 0], "body 0: "),
        ([1, 2, 2.5], [[0, 0, 0, 1], [0, 0, 0, 0]], [1, 0, 0], "body 1: orientation (qx, qy, qz, qw) = 0.0"),
        ([[1, 2, 2.5]] * 3, None, np.ones((4, 3)), "angular_velocity_body: 4 rows: expected 3, as inertia has"),
        ([1, 2, 2.5], None, np.ones((4, 2)), "angular_velocity_body: shape (4, 2): expected (3,) or (n, 3), one row a body"),
        ([1, 2, 2.5], np.ones((4, 3)), [1, 0, 0], "orientation: shape (4, 3): expected (4,) or (n, 4)"),
        (["a", "b", "c"], None, [1, 0, 0], "inertia: dtype <U1: expected real numbers"),
        ([1, 2, 2.5], None, np.ones(3) * 1j, "angular_velocity_body: dtype complex128: expected real numbers"),
        ([1, 2, 2.5], None, np.array([1, None, 2]), "angular_velocity_body: dtype object: expected real numbers"),
        ([1, 2, 2.5], None, np.ma.array([1.0, 2.0, 3.0], mask=[0, 1, 0]), "angular_velocity_body: some values are masked"),
        ([[1, 2], [3]], None, [1, 0, 0], "inertia: expected an array of numbers whose rows are of equal length"),
        ([[[2, 0.1, 0], [0, 2, 0], [0, 0, 2]]], None, [1, 0, 0], "body 0: inertia[0, 1] = 0.1, but 0 across the diagonal"),
        (np.eye(3), None, np.ones((4, 3)), "a tensor for all bodies has shape (1, 3, 3)"),
        (np.eye(3), None, [1, 0, 0], "a tensor for all bodies has shape (1, 3, 3)"),
        ([1, 2, 2.5], None, None, "angular_velocity_body: expected an array of shape (3,) or (n, 3)"),
    ],
)
def test_what_is_not_valid_is_refused_with_its_place(inertia, orientation, spin, message):
    with pytest.raises(polhode.InputError) as refusal:
        polhode.Ensemble(inertia, orientation, spin)
    assert message in str(refusal.value)
    assert isinstance(refusal.value, ValueError) and isinstance(refusal.value, polhode.Error)


@pytest.mark.parametrize(
    "columns, message",
    [
        ({"position": [0, 0, 0]}, "mass: expected the masses"),
        ({"mass": [1.0, -1.0]}, "body 1: mass = -1.0: expected a finite mass above zero (kg)"),
        ({"mass": 1.0, "velocity": [0, np.nan, 0]}, "body 0: vx = NaN"),
        ({"mass": [1.0, 2.0, 3.0], "velocity": np.ones((2, 3))}, "velocity: 2 rows: expected 3, as mass has"),
    ],
)
def test_translation_is_checked(columns, message):
    with pytest.raises(polhode.InputError) as refusal:
        polhode.Ensemble([1, 2, 2.5], None, [1, 0, 0], **columns)
    assert message in str(refusal.value)


def test_tensors_are_repaired_where_that_is_asked_for():
    bodies = polhode.Ensemble([[1.0, 2.0, 3.03], [1.0, 2.0, 2.5]], None, [1, 0, 0], repair_triangle_inequality=0.01)
    assert bodies.repairs["bodies"] == 1 and bodies.repairs["largest_relative_change"] == pytest.approx(0.0046, abs=1e-4)
    with pytest.raises(polhode.InputError):
        polhode.Ensemble([[1.0, 2.0, 3.03]], None, [1, 0, 0], repair_triangle_inequality=0.001)


def test_rotations_of_scipy_are_taken_and_given():
    _, orientation, spin = arrays()
    rotations = Rotation.from_quat(orientation)
    bodies = polhode.Ensemble([1, 2, 2.5], rotations, spin)
    vector = np.array([0.3, -0.2, 0.9])
    np.testing.assert_allclose(bodies.rotation.apply(vector), rotations.apply(vector), atol=1e-15)
    assert len(polhode.Ensemble([1, 2, 2.5], Rotation.identity(), spin)) == COUNT


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("frame", ["pandas", "polars", "arrow"])
def test_tables_lead_there_and_back(frame, moving):
    more = {"mass": np.arange(1.0, COUNT + 1), "position": np.ones(3), "velocity": arrays()[2]} if moving else {}
    bodies = tumbling(COUNT, **more)
    table = getattr(bodies, f"to_{frame}")()
    kinds = {"pandas": pandas.DataFrame, "polars": polars.DataFrame, "arrow": pyarrow.Table}
    assert isinstance(table, kinds[frame])
    again = polhode.Ensemble.from_table(table)
    np.testing.assert_array_equal(again.inertia, bodies.inertia)
    np.testing.assert_array_equal(again.angular_velocity_body, bodies.angular_velocity_body)
    np.testing.assert_allclose(again.orientation, bodies.orientation, rtol=1e-15)
    for name in ("mass", "position", "velocity"):
        np.testing.assert_array_equal(getattr(again, name), getattr(bodies, name))


def test_dicts_and_structured_arrays_are_tables():
    columns = {"ixx": [1.0, 1.0], "iyy": [2.0, 2.0], "izz": [2.5, 2.5], "wx": [0, 1], "wy": [1, 0], "wz": [0, 0], "label": ["a", "b"]}
    bodies = polhode.Ensemble.from_table(columns)
    np.testing.assert_array_equal(bodies.angular_velocity_body, [[0, 1, 0], [1, 0, 0]])
    numbers = pandas.DataFrame(columns).drop(columns="label").to_records()
    np.testing.assert_array_equal(polhode.Ensemble.from_table(numbers).inertia, bodies.inertia)


@pytest.mark.parametrize(
    "table, message",
    [
        ({"ixx": [1.0]}, "column iyy: expected a column of numbers, beside ixx"),
        ({"ixx": [1.0], "iyy": [1.0], "izz": [1.0]}, "column wx: expected a column of numbers"),
        ({"ixx": [1.0], "iyy": [1.0], "izz": [1.0], "wx": [1.0], "wy": [1.0], "wz": [1.0, 2.0]}, "angular_velocity: 2 rows: expected 1"),
        ({"ixx": 1.0, "iyy": 1.0, "izz": 1.0}, "column ixx: shape (): expected (n,)"),
        (pyarrow.table({"ixx": [1.0, None]}), "column ixx: 1 values are null"),
        (polars.DataFrame({"ixx": [1.0], "iyy": [1.0], "izz": [1.0], "wx": [None], "wy": [1.0], "wz": [1.0]}), "body 0: wx = NaN: expected a finite number"),
        (7, "table: found int, expected a pandas, polars or Arrow table"),
    ],
)
def test_tables_that_are_none_are_refused(table, message):
    with pytest.raises(polhode.InputError) as refusal:
        polhode.Ensemble.from_table(table)
    assert message in str(refusal.value)
