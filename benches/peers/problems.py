"""The problems: bodies, torques and equations of motion.

State of a body: orientation q (x, y, z, w; body to world) and angular velocity ω in body axes, which are principal
axes here:

    dq/dt = ½ q ω        dω/dt = I⁻¹ (τ − ω × I ω)

polhode reads the bodies from a table and the torques from a study, in SI units. The peers integrate the equations
below, which are plain formulas and so serve expressions of heyoka, arrays of NumPy and scalars of numba alike. They
see time in units of `Problem.time_unit`, so that ω is of order one, as a careful user of an absolute tolerance would
arrange it; and what depends on a body's parameters alone is formed before, once a body.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

SEED = 20261123
NAMES = ("qx", "qy", "qz", "qw", "wx", "wy", "wz")


def draws(column):
    """A generator for a column alone: the first bodies of a large ensemble are those of a small one."""
    return np.random.default_rng([SEED, column])


def rigid_bodies(count, scale=1.0, spin=1.0):
    """I₁ = b + c, I₂ = c + a, I₃ = a + b with a, b, c uniform in [0.2, 1]; ω normal, orientation uniform."""
    a, b, c = draws(0).uniform(0.2, 1.0, (count, 3)).T
    orientation = draws(1).normal(size=(count, 4))
    return {
        "inertia": scale * np.stack([b + c, c + a, a + b], axis=1),
        "orientation": orientation / np.linalg.norm(orientation, axis=1, keepdims=True),
        "angular_velocity": spin * draws(2).normal(size=(count, 3)),
    }


def forced_bodies(count):
    return rigid_bodies(count) | {
        "torque": draws(3).uniform(-1.0, 1.0, (count, 3)),
        "drag": draws(4).uniform(0.01, 0.1, (count, 1)),
    }


def tops(count):
    return rigid_bodies(count) | {"centre": draws(5).uniform(-0.5, 0.5, (count, 3))}


def satellites(count):
    """DESIGN 8.4: a constant torque, drag and a magnet in each body."""
    return rigid_bodies(count, 0.02, 0.05) | {
        "torque": draws(3).uniform(-1e-5, 1e-5, (count, 3)),
        "drag": draws(4).uniform(1e-5, 1e-4, (count, 1)),
        "dipole": 0.1 * draws(6).normal(size=(count, 3)),
    }


@dataclass(frozen=True)
class Orbit:
    """A Kepler orbit from its pericentre, the ascending node on the world's x axis, the pericentre at the node."""

    semi_major_axis: float
    eccentricity: float = 0.0
    inclination: float = 0.9
    mu: float = 3.986004418e14

    def study(self):
        keys = ("semi_major_axis", "eccentricity", "inclination")
        elements = ", ".join(f"{key} = {getattr(self, key)}" for key in keys)
        return f"mu = {self.mu}\norbit = {{ {elements} }}"

    def mean_motion(self):
        return float(np.sqrt(np.longdouble(self.mu) / np.longdouble(self.semi_major_axis) ** 3))

    def place(self, time_unit, sin, cos, anomaly):
        """A function of time that gives the unit vector r̂ from the centre in world axes, and 3 μ/r³.

        `anomaly(e, M)` is the eccentric anomaly E with E − e sin E = M.
        """
        n, e = self.mean_motion() * time_unit, self.eccentricity
        tilt_cos, tilt_sin = float(np.cos(self.inclination)), float(np.sin(self.inclination))
        minor, strength = float(np.sqrt(1 - e * e)), 3 * n * n

        def circular(time):
            x, y = cos(n * time), sin(n * time)
            return x, tilt_cos * y, tilt_sin * y, strength

        def elliptic(time):
            phase = anomaly(e, n * time)
            cosine = cos(phase)
            inverse = 1 / (1 - e * cosine)
            x, y = (cosine - e) * inverse, minor * sin(phase) * inverse
            return x, tilt_cos * y, tilt_sin * y, strength * inverse * inverse * inverse

        return elliptic if e > 0 else circular

    def place_from_anomaly(self, phase, sin, cos, time_unit):
        """r̂, 3 μ/r³ and dE/dt at an eccentric anomaly: for a program that carries E in its state."""
        n, e = self.mean_motion() * time_unit, self.eccentricity
        tilt_cos, tilt_sin = float(np.cos(self.inclination)), float(np.sin(self.inclination))
        cosine = cos(phase)
        inverse = 1 / (1 - e * cosine)
        x, y = (cosine - e) * inverse, float(np.sqrt(1 - e * e)) * sin(phase) * inverse
        return (x, tilt_cos * y, tilt_sin * y, 3 * n * n * inverse * inverse * inverse), n * inverse


# q, w: the state; g: what `Orbit.place` gives, or nothing; p: the body's parameters, see `Problem.parameters`.
# p[0], p[1], p[2] are (I₂ − I₃)/I₁, (I₃ − I₁)/I₂ and (I₁ − I₂)/I₃.


def free(q, w, g, p):
    return p[0] * (w[1] * w[2]), p[1] * (w[2] * w[0]), p[2] * (w[0] * w[1])


def forced(q, w, g, p):
    return (
        p[0] * (w[1] * w[2]) + p[3] - p[6] * w[0],
        p[1] * (w[2] * w[0]) + p[4] - p[7] * w[1],
        p[2] * (w[0] * w[1]) + p[5] - p[8] * w[2],
    )


def heavy_top(q, w, g, p):
    """τ = c × Rᵀ (0, 0, −M g): p[3..6] is −M g c, p[6..9] is 1/I."""
    x, y, z = 2 * (q[0] * q[2] - q[3] * q[1]), 2 * (q[1] * q[2] + q[3] * q[0]), 1 - 2 * (q[0] * q[0] + q[1] * q[1])
    return (
        p[0] * (w[1] * w[2]) + p[6] * (p[4] * z - p[5] * y),
        p[1] * (w[2] * w[0]) + p[7] * (p[5] * x - p[3] * z),
        p[2] * (w[0] * w[1]) + p[8] * (p[3] * y - p[4] * x),
    )


def gravity_gradient(q, w, g, p):
    """τ = 3 μ/r³ u × I u, u = Rᵀ r̂: the factors of u₂u₃ are those of ω₂ω₃ but for the sign."""
    xx, yy, zz = q[0] * q[0], q[1] * q[1], q[2] * q[2]
    xy, xz, yz = q[0] * q[1], q[0] * q[2], q[1] * q[2]
    wx, wy, wz = q[3] * q[0], q[3] * q[1], q[3] * q[2]
    u = (1 - 2 * (yy + zz)) * g[0] + 2 * (xy + wz) * g[1] + 2 * (xz - wy) * g[2]
    v = 2 * (xy - wz) * g[0] + (1 - 2 * (xx + zz)) * g[1] + 2 * (yz + wx) * g[2]
    s = 2 * (xz + wy) * g[0] + 2 * (yz - wx) * g[1] + (1 - 2 * (xx + yy)) * g[2]
    return (
        p[0] * (w[1] * w[2] - g[3] * (v * s)),
        p[1] * (w[2] * w[0] - g[3] * (s * u)),
        p[2] * (w[0] * w[1] - g[3] * (u * v)),
    )


FIELD = (2e-5, -1e-5, 3e-5)


def orbit(q, w, g, p):
    """All of `forced` and `gravity_gradient`, and τ = m × Rᵀ B: p[9..12] is m |B|, p[12..15] is 1/I; b is Rᵀ B/|B|."""
    xx, yy, zz = q[0] * q[0], q[1] * q[1], q[2] * q[2]
    xy, xz, yz = q[0] * q[1], q[0] * q[2], q[1] * q[2]
    wx, wy, wz = q[3] * q[0], q[3] * q[1], q[3] * q[2]
    a00, a01, a02 = 1 - 2 * (yy + zz), 2 * (xy + wz), 2 * (xz - wy)
    a10, a11, a12 = 2 * (xy - wz), 1 - 2 * (xx + zz), 2 * (yz + wx)
    a20, a21, a22 = 2 * (xz + wy), 2 * (yz - wx), 1 - 2 * (xx + yy)
    u = a00 * g[0] + a01 * g[1] + a02 * g[2]
    v = a10 * g[0] + a11 * g[1] + a12 * g[2]
    s = a20 * g[0] + a21 * g[1] + a22 * g[2]
    bx = a00 * B0 + a01 * B1 + a02 * B2
    by = a10 * B0 + a11 * B1 + a12 * B2
    bz = a20 * B0 + a21 * B1 + a22 * B2
    return (
        p[0] * (w[1] * w[2] - g[3] * (v * s)) + p[3] - p[6] * w[0] + p[12] * (p[10] * bz - p[11] * by),
        p[1] * (w[2] * w[0] - g[3] * (s * u)) + p[4] - p[7] * w[1] + p[13] * (p[11] * bx - p[9] * bz),
        p[2] * (w[0] * w[1] - g[3] * (u * v)) + p[5] - p[8] * w[2] + p[14] * (p[9] * by - p[10] * bx),
    )


FIELD_STRENGTH = float(np.linalg.norm(FIELD))
B0, B1, B2 = (component / FIELD_STRENGTH for component in FIELD)


def quaternion_rate(q, w):
    """½ q ω"""
    return (
        0.5 * (q[3] * w[0] + q[1] * w[2] - q[2] * w[1]),
        0.5 * (q[3] * w[1] + q[2] * w[0] - q[0] * w[2]),
        0.5 * (q[3] * w[2] + q[0] * w[1] - q[1] * w[0]),
        -0.5 * (q[0] * w[0] + q[1] * w[1] + q[2] * w[2]),
    )


def eccentric_anomaly(sin, cos):
    """E − e sin E = M as a function of e and M, for any sine and cosine.

    Two iterations of order four (J. M. A. Danby, Celest. Mech. 40 (1987) 303).
    """

    def anomaly(e, mean):
        sine, cosine = sin(mean), cos(mean)
        result = mean + e * sine * (1 + e * cosine)
        for _ in range(2):
            sine, cosine = e * sin(result), e * cos(result)
            excess, slope = result - sine - mean, 1 - cosine
            first = -excess / slope
            second = -excess / (slope + 0.5 * first * sine)
            result = result - excess / (slope + 0.5 * second * sine + second * second * cosine / 6)
        return result

    return anomaly


GRAVITY = 9.81

CONSTANT_TORQUE = """[[torque]]
model = "constant-body"
torque = { columns = ["torque_x", "torque_y", "torque_z"] }
"""
LINEAR_DRAG = """[[torque]]
model = "linear-drag"
coefficient = { column = "drag" }
"""
HEAVY_TOP = f"""[[torque]]
model = "heavy-top"
mass = 1.0
centre = {{ columns = ["centre_x", "centre_y", "centre_z"] }}
gravity = [0.0, 0.0, {-GRAVITY}]
"""
DIPOLE = f"""[[torque]]
model = "magnetic-dipole"
moment = {{ columns = ["dipole_x", "dipole_y", "dipole_z"] }}
field = {list(FIELD)}
"""


def gradient_study(path):
    return f'[[torque]]\nmodel = "gravity-gradient"\n{path.study()}\n'


@dataclass(frozen=True)
class Problem:
    name: str
    title: str
    span: float
    bodies: Callable
    acceleration: Callable
    torques: str = ""
    orbit: Orbit | None = None
    time_unit: float = 1.0
    extra: tuple = field(default=())

    def place(self, sin, cos, anomaly):
        """r̂ and 3 μ/r³ as a function of the peers' time; without an orbit there are none."""
        return self.orbit.place(self.time_unit, sin, cos, anomaly) if self.orbit else None

    def parameter_rows(self, bodies):
        """The rows p of the accelerations as a list, with the peers' unit of time; columns of a body or of many."""
        i1, i2, i3 = bodies["inertia"].T
        rows = [(i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3]
        inverse = 1 / bodies["inertia"].T
        unit = self.time_unit
        for name in self.extra:
            rows += {
                "torque": lambda: list(unit * unit * bodies["torque"].T * inverse),
                "drag": lambda: list(unit * bodies["drag"].T * inverse),
                "centre": lambda: list(-GRAVITY * bodies["centre"].T),
                "dipole": lambda: list(FIELD_STRENGTH * bodies["dipole"].T),
                "inverse": lambda: list(unit * unit * inverse),
            }[name]()
        return rows

    def parameters(self, bodies):
        """The rows p in the precision of the bodies' columns."""
        return np.array(self.parameter_rows(bodies))

    def start(self, bodies):
        """The state at t = 0, seven rows, with the peers' unit of time."""
        return np.concatenate([bodies["orientation"].T, self.time_unit * bodies["angular_velocity"].T])

    @property
    def parameter_count(self):
        return len(self.parameters(self.bodies(1)))

    @property
    def end(self):
        return self.span / self.time_unit


LOW_ORBIT = Orbit(6.878e6)
ELLIPSE = Orbit(1.0e7, 0.3)

PROBLEMS = {
    problem.name: problem
    for problem in (
        Problem("free", "free", 10.0, rigid_bodies, free),
        Problem(
            "forced",
            "constant torque, drag",
            10.0,
            forced_bodies,
            forced,
            CONSTANT_TORQUE + LINEAR_DRAG,
            extra=("torque", "drag"),
        ),
        Problem("heavy-top", "heavy top", 10.0, tops, heavy_top, HEAVY_TOP, extra=("centre", "inverse")),
        Problem(
            "gradient",
            "gravity gradient, circular",
            5000.0,
            lambda count: rigid_bodies(count, 0.02, 0.002),
            gravity_gradient,
            gradient_study(LOW_ORBIT),
            LOW_ORBIT,
            time_unit=500.0,
        ),
        Problem(
            "kepler",
            "gravity gradient, e = 0.3",
            10000.0,
            lambda count: rigid_bodies(count, 0.02, 0.001),
            gravity_gradient,
            gradient_study(ELLIPSE),
            ELLIPSE,
            time_unit=1000.0,
        ),
        Problem(
            "orbit",
            "orbit, four torques",
            600.0,
            satellites,
            orbit,
            CONSTANT_TORQUE + LINEAR_DRAG + gradient_study(LOW_ORBIT) + DIPOLE,
            LOW_ORBIT,
            time_unit=20.0,
            extra=("torque", "drag", "dipole", "inverse"),
        ),
    )
}


def attitude_errors(q, truth):
    """The angle of the rotation between orientations, rad; rows x, y, z, w, of any norm.

    2 atan2 of the vector and scalar parts: the arc cosine would lose half of the digits of a small angle.
    """
    q, truth = np.asarray(q, np.longdouble), np.asarray(truth, np.longdouble)
    vector = truth[3] * q[:3] - q[3] * truth[:3] - np.cross(truth[:3], q[:3], axis=0)
    scalar = np.sum(q * truth, axis=0)
    return np.asarray(2 * np.arctan2(np.sqrt(np.sum(vector * vector, axis=0)), np.abs(scalar)), float)
