"""Closed forms, mass properties and attitudes as vectorised functions."""

import numpy as np
import polhode
import pytest
from conftest import rotated, tumbling
from polhode import inertia, toolkit
from scipy.spatial.transform import Rotation


def test_free_motion_keeps_what_free_bodies_keep():
    bodies = tumbling(50)
    times = np.array([0.0, 1.0, 1e3, -5.0])
    motion = polhode.free_motion(bodies.inertia, bodies.orientation, bodies.angular_velocity_body, times)
    assert motion.orientation.shape == (50, 4, 4) and motion.angular_momentum_world.shape == (50, 4, 3)
    np.testing.assert_allclose(motion.angular_momentum_world, np.repeat(motion.angular_momentum_world[:, :1], 4, axis=1), atol=1e-13)
    np.testing.assert_allclose(motion.kinetic_energy, np.repeat(motion.kinetic_energy[:, :1], 4, axis=1), rtol=1e-13)
    momentum = np.einsum("nij,ntj->nti", bodies.inertia, motion.angular_velocity_body)
    np.testing.assert_allclose(rotated(motion.orientation, momentum), motion.angular_momentum_world, atol=1e-13)
    np.testing.assert_allclose(motion.orientation[:, 0], bodies.orientation, atol=1e-15)


def test_an_axisymmetric_top_precesses_by_its_formulas():
    spin = np.array([0.3, 0.0, 2.0])
    motion = polhode.free_motion([2.0, 2.0, 3.0], None, spin, 7.0)
    assert motion.orientation.shape == (4,) and motion.kinetic_energy.shape == ()
    rate = (3.0 - 2.0) / 2.0 * spin[2]
    expected = [spin[0] * np.cos(rate * 7.0), spin[0] * np.sin(rate * 7.0), 2.0]
    np.testing.assert_allclose(motion.angular_velocity_body, expected, atol=1e-14)
    assert motion.mean_precession_rate == pytest.approx(np.hypot(2.0 * 0.3, 3.0 * 2.0) / 2.0, rel=1e-13)
    assert motion.polhode == "about_third" and np.isinf(motion.nutation_period)
    assert motion.polhode_period == pytest.approx(2 * np.pi / rate, rel=1e-13)


def test_the_wing_nut_flips_with_its_period():
    motion = polhode.free_motion([1.0, 2.0, 3.0], None, [[1e-3, 5.0, 0.0]], np.linspace(0, 10, 5))
    flips = motion.flips(0.0, 30.0)
    np.testing.assert_allclose(np.diff(flips), motion.nutation_period[0], rtol=1e-12)
    before = polhode.free_motion([1.0, 2.0, 3.0], None, [1e-3, 5.0, 0.0], flips[0] + np.array([-1.0, 1.0]))
    assert before.angular_velocity_body[0, 1] > 0 > before.angular_velocity_body[1, 1]
    assert motion.polhode.tolist() == ["about_first"] and 0.99 < motion.modulus[0] < 1
    with pytest.raises(polhode.InputError, match="body = 3: expected an index below 1"):
        motion.flips(0.0, 1.0, body=3)


def test_shapes_of_results_follow_those_of_arguments():
    spin = np.ones((6, 3))
    assert polhode.free_motion([1, 2, 2.5], None, spin, 1.0).orientation.shape == (6, 4)
    assert polhode.free_motion([1, 2, 2.5], None, spin[0], [1.0, 2.0]).orientation.shape == (2, 4)
    assert polhode.free_motion([1, 2, 2.5], Rotation.identity(), spin[:1], [1.0]).orientation.shape == (1, 1, 4)
    assert polhode.free_motion([1, 2, 2.5], None, spin, []).orientation.shape == (6, 0, 4)
    with pytest.raises(polhode.InputError, match="t: shape"):
        polhode.free_motion([1, 2, 2.5], None, spin, np.ones((2, 2)))
    rotations = polhode.free_motion([1, 2, 2.5], None, spin, [1.0, 2.0]).rotation
    assert len(rotations) == 12


CYLINDER = np.pi * 1.2**2 * 6.5


@pytest.mark.parametrize(
    "body, moments, volume",
    [
        (inertia.sphere(radius=2.0, mass=3.0), [4.8, 4.8, 4.8], 4 / 3 * np.pi * 8),
        (inertia.spherical_shell(radius=2.0, mass=3.0), [8.0, 8.0, 8.0], 0.0),
        (inertia.cylinder(radius=1.2, height=6.5, mass=12.0), [12 * (3 * 1.44 + 42.25) / 12] * 2 + [8.64], CYLINDER),
        (inertia.box(edges=[1.0, 2.0, 3.0], mass=12.0), [13.0, 10.0, 5.0], 6.0),
        (inertia.ellipsoid(semi_axes=[1.0, 2.0, 3.0], mass=5.0), [13.0, 10.0, 5.0], 8 * np.pi),
        (inertia.rod(length=2.0, mass=3.0), [1.0, 1.0, 0.0], 0.0),
        (inertia.rectangular_plate(width=1.0, depth=2.0, mass=12.0), [4.0, 1.0, 5.0], 0.0),
        (inertia.circular_plate(radius=2.0, mass=1.0), [1.0, 1.0, 2.0], 0.0),
        (inertia.tube(inner_radius=1.0, outer_radius=2.0, height=1.0, mass=12.0), [16.0, 16.0, 30.0], 3 * np.pi),
        (inertia.torus(major_radius=2.0, minor_radius=1.0, mass=8.0), [21.0, 21.0, 38.0], 4 * np.pi**2),
        (inertia.cone(radius=2.0, height=4.0, mass=80.0), [96.0, 96.0, 96.0], 16 * np.pi / 3),
        (inertia.capsule(radius=1.0, length=0.0 + 1e-9, mass=5.0), [2.0, 2.0, 2.0], 4 / 3 * np.pi),
    ],
)
def test_shapes_have_the_moments_of_any_handbook(body, moments, volume):
    np.testing.assert_allclose(np.diagonal(body.inertia), moments, rtol=1e-8, atol=1e-15)
    assert body.volume == pytest.approx(volume, rel=1e-8)
    assert body.inertia.shape == (3, 3) and np.ndim(body.mass) == 0


def test_lengths_and_masses_broadcast():
    stages = inertia.cylinder(radius=np.array([[1.0], [2.0]]), height=np.array([3.0, 4.0, 5.0]), density=2.0)
    assert stages.mass.shape == (2, 3) and stages.inertia.shape == (2, 3, 3, 3)
    for row, radius in enumerate((1.0, 2.0)):
        for column, height in enumerate((3.0, 4.0, 5.0)):
            alone = inertia.cylinder(radius=radius, height=height, density=2.0)
            np.testing.assert_array_equal(stages.inertia[row, column], alone.inertia)
            assert stages.mass[row, column] == alone.mass == pytest.approx(2.0 * np.pi * radius**2 * height)
    np.testing.assert_allclose(stages.density, 2.0, rtol=1e-14)
    bodies = polhode.Ensemble(stages.inertia.reshape(-1, 3, 3), None, [0.1, 0, 0], mass=stages.mass.ravel())
    assert len(bodies) == 6
    assert inertia.tetrahedron(corners=np.vstack([np.zeros(3), np.eye(3)]), density=6.0).mass == pytest.approx(1.0)


def cube(path, scale=1.0, faces=12):
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    triangles = [(1, 2, 4), (1, 4, 3), (5, 7, 8), (5, 8, 6), (1, 5, 6), (1, 6, 2), (3, 4, 8), (3, 8, 7), (1, 3, 7), (1, 7, 5), (2, 6, 8), (2, 8, 4)]
    lines = [f"v {x * scale} {y * scale} {z * scale}" for x, y, z in corners]
    path.write_text("\n".join(lines + [f"f {a} {b} {c}" for a, b, c in triangles[:faces]]) + "\n")
    return path


def test_meshes_hulls_and_points(tmp_path):
    solid = inertia.from_mesh(cube(tmp_path / "cube.obj", 1000.0), density=6.0, scale=0.001)
    assert solid.mass == pytest.approx(6.0) and solid.volume == pytest.approx(1.0)
    np.testing.assert_allclose(solid.centre_of_mass, [0.5] * 3)
    np.testing.assert_allclose(solid.inertia, np.eye(3), atol=1e-14)
    shell = inertia.from_mesh(cube(tmp_path / "cube.obj"), mass=18.0, shell=True)
    np.testing.assert_allclose(shell.inertia, 5 * np.eye(3), atol=1e-13)
    draws = np.random.default_rng(1).uniform(size=(50, 3))
    corners = np.vstack([draws, [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]])
    np.testing.assert_allclose(inertia.from_hull(corners, mass=6.0).inertia, np.eye(3), atol=1e-13)
    dumbbell = inertia.from_points([1.0, 1.0], [[1, 0, 0], [-1, 0, 0]])
    np.testing.assert_array_equal(dumbbell.inertia, np.diag([0.0, 2.0, 2.0]))
    with pytest.raises(polhode.InputError, match="mesh"):
        inertia.from_mesh(cube(tmp_path / "open.obj", faces=11), mass=1.0)
    with pytest.raises(polhode.Error, match="none.stl"):
        inertia.from_mesh(tmp_path / "none.stl", mass=1.0)


def test_parts_and_holes_make_a_body():
    """A tube is a cylinder less its bore, and two boxes side by side are one."""
    outer, bore = (inertia.cylinder(radius=radius, height=3.0, density=2.0) for radius in (2.0, 1.0))
    tube = inertia.compose([outer, inertia.Part(bore, hole=True)])
    expected = inertia.tube(inner_radius=1.0, outer_radius=2.0, height=3.0, density=2.0)
    np.testing.assert_allclose(tube.inertia, expected.inertia, rtol=1e-13, atol=1e-12)
    half = inertia.box(edges=[1.0, 2.0, 3.0], density=1.0)
    turned = inertia.box(edges=[2.0, 1.0, 3.0], density=1.0)
    quarter = np.sqrt(0.5)
    whole = inertia.compose([inertia.Part(half, (0.5, 0, 0)), inertia.Part(turned, (-0.5, 0, 0), (0, 0, quarter, quarter))])
    np.testing.assert_allclose(whole.inertia, inertia.box(edges=[2.0, 2.0, 3.0], density=1.0).inertia, atol=1e-13)
    np.testing.assert_allclose(whole.centre_of_mass, 0.0, atol=1e-15)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: inertia.sphere(radius=1.0), "expected either mass (kg) or density (kg/m³)"),
        (lambda: inertia.sphere(radius=1.0, mass=1.0, density=1.0), "expected either mass"),
        (lambda: inertia.sphere(radius=-1.0, mass=1.0), "radius = -1.0"),
        (lambda: inertia.sphere(radius=[1.0, -1.0], mass=1.0), "row 1: radius = -1.0"),
        (lambda: inertia.cylinder(radius=[1.0, 2.0], height=[1.0, 2.0, 3.0], mass=1.0), "do not broadcast"),
        (lambda: inertia.box(edges=[1.0, 2.0], mass=1.0), "edges: shape (2,): expected (..., 3)"),
        (lambda: inertia.from_points([1.0], np.ones((2, 3))), "mass: shape (1,): expected (2,), one a point (kg)"),
        (lambda: inertia.from_points([1.0, 1.0], np.ones((2, 2))), "position: shape (2, 2): expected (n, 3) (m)"),
        (lambda: inertia.from_mesh("x.obj", density=1.0, shell=True), "shell: expected the mass of a shell"),
        (lambda: inertia.from_hull(np.zeros((5, 3)), mass=1.0), "convex hull"),
        (lambda: inertia.compose([3]), "parts[0]: expected a Part"),
        (lambda: inertia.principal_axes(np.ones(3)), "inertia: shape (3,): expected (..., 3, 3)"),
    ],
)
def test_bodies_that_are_none_are_refused(call, message):
    with pytest.raises(polhode.InputError) as refusal:
        call()
    assert message in str(refusal.value), str(refusal.value)


def test_principal_axes_turn_tensors_diagonal():
    tensors = tumbling(20).inertia.reshape(4, 5, 3, 3)
    moments, rotations = inertia.principal_axes(tensors)
    assert moments.shape == (4, 5, 3) and (np.diff(moments, axis=-1) >= 0).all()
    np.testing.assert_allclose(moments, np.linalg.eigvalsh(tensors), rtol=1e-13)
    for axis in range(3):
        unit = rotated(rotations, np.broadcast_to(np.eye(3)[axis], (4, 5, 3)))
        product = np.einsum("abij,abj->abi", tensors, unit)
        np.testing.assert_allclose(product, moments[..., axis : axis + 1] * unit, atol=1e-13)


def test_attitudes_agree_with_scipy():
    draws = np.random.default_rng(5)
    vectors = draws.normal(size=(3, 7, 3))
    turned = toolkit.exponential(vectors)
    reference = Rotation.from_rotvec(vectors.reshape(-1, 3))
    assert turned.shape == (3, 7, 4)
    np.testing.assert_allclose(np.abs(np.sum(turned.reshape(-1, 4) * reference.as_quat(), axis=1)), 1.0, rtol=1e-14)
    np.testing.assert_allclose(toolkit.logarithm(turned).reshape(-1, 3), reference.as_rotvec(), atol=1e-13)
    other = Rotation.from_quat(draws.normal(size=(7, 4)))
    angles = toolkit.attitude_error(turned, other.as_quat())
    expected = [(Rotation.from_quat(row).inv() * other).magnitude() for row in turned]
    np.testing.assert_allclose(angles, expected, atol=1e-13)
    assert toolkit.attitude_error([0, 0, 0, 1], [0, 0, 0, -1]) == 0.0
    with pytest.raises(polhode.InputError, match="do not broadcast"):
        toolkit.attitude_error(np.ones((2, 4)), np.ones((3, 4)))
    with pytest.raises(polhode.InputError, match=r"a: shape \(3,\): expected \(..., 4\)"):
        toolkit.attitude_error([1, 2, 3], [0, 0, 0, 1])


def test_the_equations_of_motion_are_those_of_numpy():
    bodies = tumbling(6)
    inertia, spin = bodies.inertia.reshape(2, 3, 3, 3), bodies.angular_velocity_body.reshape(2, 3, 3)
    torque = np.array([0.3, -0.1, 0.2])
    momentum = np.einsum("abij,abj->abi", inertia, spin)
    np.testing.assert_allclose(toolkit.angular_momentum(inertia, spin), momentum, rtol=1e-13)
    np.testing.assert_allclose(toolkit.rotational_kinetic_energy(inertia, spin), 0.5 * np.sum(spin * momentum, -1), rtol=1e-13)
    expected = np.linalg.solve(inertia, (torque - np.cross(spin, momentum))[..., None])[..., 0]
    rate = toolkit.angular_acceleration_body(inertia, spin, torque)
    np.testing.assert_allclose(rate, expected, rtol=1e-12)
    np.testing.assert_allclose(toolkit.torque_of_motion(inertia, spin, rate), np.broadcast_to(torque, (2, 3, 3)), atol=1e-13)
    cosine = np.sum(spin * momentum, -1) / np.linalg.norm(spin, axis=-1) / np.linalg.norm(momentum, axis=-1)
    np.testing.assert_allclose(toolkit.momentum_angle(inertia, spin), np.arccos(cosine), rtol=1e-7)
    # Torque-free, with the sign of Euler's equations: (I2 - I3)/I1, (I3 - I1)/I2, (I1 - I2)/I3.
    free = toolkit.angular_acceleration_body(np.diag([1.0, 2.0, 3.0]), [1.0, 1.0, 1.0])
    np.testing.assert_allclose(free, [-1.0, 1.0, -1 / 3], rtol=1e-15)
    with pytest.raises(polhode.InputError, match=r"inertia: shape \(3,\): expected \(..., 3, 3\)"):
        toolkit.angular_momentum([1, 2, 3], [1, 0, 0])
