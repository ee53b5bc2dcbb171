"""Bodies under the gravity gradient on inclined orbits, 30 digits; writes forced_gg_inclined.json beside this file.

The equations are those of a textbook in the inertial frame, with nothing of the library's: r'' = -mu r / r^3 from the position and
velocity of the orbit's elements, the body's axes as the columns of R, R' = [omega] R with omega = (R I R^T)^-1 L, and
L' = 3 mu / r^5 r x (R I R^T) r (P. C. Hughes, Spacecraft Attitude Dynamics, 1986, equation 8.1.13). They are solved by Gragg's and
Bulirsch's extrapolation at 45 digits. The second solution beside it takes positions from Kepler's equation in place of two-body motion, the
attitude as a quaternion, the angular velocity in body axes, and other steps of another order; digits_agree is how many digits of both are
equal.

Run: python3 forced_gg_inclined.py (some minutes)
"""

import json
import pathlib

import mpmath as mp

mp.mp.dps = 45
TIMES = ["0", "0.125", "1", "5", "10", "20"]
DIGITS = 30


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def times(matrix, v):
    return [dot(row, v) for row in matrix]


def transposed(matrix):
    return [list(column) for column in zip(*matrix)]


def inverse(matrix):
    found = mp.matrix(matrix) ** -1
    return [[found[i, j] for j in range(3)] for i in range(3)]


def attitude_matrix(q):
    w, x, y, z = q
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def quaternion(r):
    """By the largest component, which is positive."""
    trace = r[0][0] + r[1][1] + r[2][2]
    squares = [1 + trace] + [1 + 2 * r[k][k] - trace for k in range(3)]
    largest = max(range(4), key=lambda k: squares[k])
    products = [
        [squares[0], r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]],
        [r[2][1] - r[1][2], squares[1], r[1][0] + r[0][1], r[0][2] + r[2][0]],
        [r[0][2] - r[2][0], r[1][0] + r[0][1], squares[2], r[2][1] + r[1][2]],
        [r[1][0] - r[0][1], r[0][2] + r[2][0], r[2][1] + r[1][2], squares[3]],
    ]
    return [x / (2 * mp.sqrt(squares[largest])) for x in products[largest]]


class Orbit:
    """Towards the pericentre, and at right angles to it in the plane: C. D. Murray and S. F. Dermott, Solar System Dynamics, 1999, 2.8."""

    def __init__(self, model):
        number = lambda key: mp.mpf(model[key])
        self.mu, self.a, self.e, self.start = number("mu"), number("a"), number("e"), number("mean_anomaly")
        node, i, w = number("ascending_node"), number("inclination"), number("pericentre")
        cn, sn, ci, si, cw, sw = mp.cos(node), mp.sin(node), mp.cos(i), mp.sin(i), mp.cos(w), mp.sin(w)
        self.p = [cn * cw - sn * sw * ci, sn * cw + cn * sw * ci, sw * si]
        self.q = [-cn * sw - sn * cw * ci, -sn * sw + cn * cw * ci, cw * si]
        self.n = mp.sqrt(self.mu / self.a**3)
        self.anomaly = None

    def at(self, time):
        """Position and velocity by Kepler's equation."""
        mean, e = self.start + self.n * time, self.e
        anomaly = mean + e * mp.sin(mean) if self.anomaly is None else self.anomaly
        for _ in range(100):
            change = (anomaly - e * mp.sin(anomaly) - mean) / (1 - e * mp.cos(anomaly))
            anomaly -= change
            if abs(change) < mp.mpf(10) ** -30:
                break
        self.anomaly = anomaly
        c, s, b = mp.cos(anomaly), mp.sin(anomaly), mp.sqrt(1 - e * e)
        rate = self.n / (1 - e * c)
        position = [self.a * ((c - e) * p + b * s * q) for p, q in zip(self.p, self.q)]
        return position, [self.a * rate * (b * c * q - s * p) for p, q in zip(self.p, self.q)]


def extrapolated(f, t, y, step, columns):
    """One step of Gragg's midpoint rule with 2, 4, 6, ... substeps, extrapolated in their squares."""
    table = []
    for k in range(1, columns + 1):
        n = 2 * k
        h = step / n
        before, now = y, [a + h * b for a, b in zip(y, f(t, y))]
        for m in range(1, n):
            slope = f(t + m * h, now)
            before, now = now, [a + 2 * h * b for a, b in zip(before, slope)]
        slope = f(t + step, now)
        row = [[(a + b + h * c) / 2 for a, b, c in zip(before, now, slope)]]
        for j in range(1, k):
            factor = 1 / (mp.mpf(k) ** 2 / mp.mpf(k - j) ** 2 - 1)
            row.append([a + (a - b) * factor for a, b in zip(row[j - 1], table[j - 1])])
        table = row
    return table[-1]


def solved(f, y, step, columns):
    found, t = [y], mp.mpf(0)
    for end in map(mp.mpf, TIMES[1:]):
        count = int(mp.ceil((end - t) / mp.mpf(step)))
        h = (end - t) / count
        for k in range(count):
            y = extrapolated(f, t + k * h, y, h, columns)
        found.append(y)
        t = end
    return found


def inertial(case):
    """R by rows, L, r and v."""
    tensor, orbit = case["tensor"], Orbit(case["model"])
    inverted = inverse(tensor)

    def f(_, y):
        rows, momentum, r, v = [y[0:3], y[3:6], y[6:9]], y[9:12], y[12:15], y[15:18]
        back = transposed(rows)
        omega = times(rows, times(inverted, times(back, momentum)))
        columns = [cross(omega, column) for column in back]
        square = dot(r, r)
        cube = square * mp.sqrt(square)
        torque = cross(r, times(rows, times(tensor, times(back, r))))
        rows = transposed(columns)
        scale = 3 * orbit.mu / (cube * square)
        return rows[0] + rows[1] + rows[2] + [scale * x for x in torque] + v + [-orbit.mu / cube * x for x in r]

    rows = attitude_matrix(case["q"])
    r, v = orbit.at(mp.mpf(0))
    momentum = times(rows, times(tensor, case["w"]))
    states = solved(f, rows[0] + rows[1] + rows[2] + momentum + r + v, mp.mpf("0.125"), 17)
    return [([y[0:3], y[3:6], y[6:9]], y[9:12]) for y in states]


def in_body_axes(case):
    """Quaternion and angular velocity, after Euler's equations."""
    tensor, orbit = case["tensor"], Orbit(case["model"])
    inverted = inverse(tensor)

    def f(t, y):
        (w, x, y_, z), omega = y[0:4], y[4:7]
        r, _ = orbit.at(t)
        u = times(transposed(attitude_matrix(y[0:4])), r)
        square = dot(u, u)
        scale = 3 * orbit.mu / (square * square * mp.sqrt(square))
        torque = [scale * part for part in cross(u, times(tensor, u))]
        gyroscopic = cross(omega, times(tensor, omega))
        a, b, c = omega
        rate = [-x * a - y_ * b - z * c, w * a + y_ * c - z * b, w * b + z * a - x * c, w * c + x * b - y_ * a]
        return [part / 2 for part in rate] + times(inverted, [m - g for m, g in zip(torque, gyroscopic)])

    states = solved(f, case["q"] + case["w"], mp.mpf("0.1"), 16)
    found = []
    for y in states:
        rows = attitude_matrix(y[0:4])
        found.append((rows, times(rows, times(tensor, y[4:7]))))
    return found


def tumbling(name, about, tensor, orbit, q, w):
    keys = ["mu", "a", "e", "inclination", "ascending_node", "pericentre", "mean_anomaly"]
    model = {"type": "gravity_gradient_inclined", **dict(zip(keys, orbit))}
    return {"name": name, "about": about, "body": tensor, "model": model, "q_raw": q, "w_body": w}


FULL = [["2.1337890625", "-0.154296875", "0.1328125"], ["-0.154296875", "2.05859375", "-0.248046875"],
        ["0.1328125", "-0.248046875", "3.8076171875"]]
SLENDER = [["1.5", "0.25", "-0.125"], ["0.25", "2.75", "0.1875"], ["-0.125", "0.1875", "3.25"]]

CASES = [
    tumbling("gg_inclined_circ0_p", "circular orbit, tumbling body", FULL,
             ["1", "1", "0", "0.6875", "2.125", "-0.8125", "1.375"],
             ["0.75", "-0.25", "0.4375", "0.5625"], ["0.3125", "-0.5", "0.25"]),
    tumbling("gg_inclined_circ1_p", "circular orbit that goes against the axis, tumbling body", SLENDER,
             ["1.25", "1.125", "0", "2.25", "-1.5", "0.375", "-2.5"],
             ["-0.3125", "0.875", "0.125", "0.5"], ["0.75", "0.375", "-0.25"]),
    tumbling("gg_inclined_kepler0_p", "Kepler ellipse, tumbling body", SLENDER,
             ["1", "1", "0.25", "1.125", "-0.6875", "2.375", "-1.0625"],
             ["0.625", "0.5", "-0.375", "0.1875"], ["-0.5", "0.25", "0.625"]),
    tumbling("gg_inclined_kepler1_p", "eccentric Kepler ellipse, tumbling body", FULL,
             ["1.5", "1.25", "0.5", "0.4375", "1.75", "-1.125", "0.9375"],
             ["0.25", "0.6875", "0.5", "-0.4375"], ["0.375", "0.6875", "-0.3125"]),
]


def text(x):
    return mp.nstr(x, DIGITS, strip_zeros=False)


def record(case):
    numbers = lambda row: [mp.mpf(x) for x in row]
    norm = mp.sqrt(mp.fsum(x * x for x in numbers(case["q_raw"])))
    solved_case = {
        "tensor": [numbers(row) for row in case["body"]],
        "model": case["model"],
        "q": [x / norm for x in numbers(case["q_raw"])],
        "w": numbers(case["w_body"]),
    }
    inverted = inverse(solved_case["tensor"])
    states, worst = [], mp.inf
    for time, (rows, momentum), (other, others) in zip(TIMES, inertial(solved_case), in_body_axes(solved_case)):
        off = max(abs(a - b) for a, b in zip(sum(rows, []) + momentum, sum(other, []) + others))
        worst = min(worst, -mp.log10(off) if off > 0 else mp.inf)
        omega = times(inverted, times(transposed(rows), momentum))
        energy = dot(omega, times(solved_case["tensor"], omega)) / 2
        vector = lambda v: [text(x) for x in v]
        states.append({"t": time, "q": vector(quaternion(rows)), "w_body": vector(omega), "L_world": vector(momentum),
                       "kinetic_energy": text(energy)})
    return {
        "name": case["name"],
        "category": "gravity_gradient",
        "description": "gravity gradient, " + case["about"],
        "body": {"inertia_body": case["body"]},
        "model": case["model"],
        "initial": {"q_raw": case["q_raw"], "w_body": case["w_body"]},
        "states": states,
        "min_digits_agree": float(mp.nstr(worst, 3)),
    }


if __name__ == "__main__":
    records = [record(case) for case in CASES]
    for found in records:
        print(found["name"], found["min_digits_agree"])
        assert found["min_digits_agree"] >= DIGITS - 1
    file = {"schema": "rigid-golden-1", "category": "forced_gg_inclined", "cases": records}
    pathlib.Path(__file__).with_suffix(".json").write_text(json.dumps(file, indent=1) + "\n")
