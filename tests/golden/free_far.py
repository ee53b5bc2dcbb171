"""Writes free_far.json: torque-free bodies at distant times, in 70 digits.

    python3 free_far.py > free_far.json        (needs mpmath)

The closed form is evaluated by another road than the crate's: theta functions of complex argument and Legendre's
integrals from mpmath, the precession rate from the logarithmic derivative of theta_4 at the imaginary argument. With
the argument `--check` it compares itself with the other golden files in this folder instead. Inputs are exact binary
fractions, written out in full; quaternions are w, x, y, z, body to world.
"""

import glob
import json
import os
import random
import sys
from decimal import Decimal

from mpmath import atan2, conj, cos, ellipf, ellipk, exp, fabs, jtheta, mp, mpc, mpf, nstr, pi, sin, sqrt

mp.dps = 70


def product(a, b):
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def conjugate(q):
    return (q[0], -q[1], -q[2], -q[3])


def rotated(q, v):
    return product(product(q, (mpf(0), *v)), conjugate(q))[1:]


def from_rows(rows):
    """The quaternion of a proper rotation matrix whose trace is not -1, or of a half turn."""
    trace = rows[0][0] + rows[1][1] + rows[2][2]
    squares = [(1 + trace) / 4] + [(1 + 2 * rows[i][i] - trace) / 4 for i in range(3)]
    largest = max(range(4), key=lambda i: squares[i])
    root = sqrt(squares[largest])
    if largest == 0:
        rest = [rows[2][1] - rows[1][2], rows[0][2] - rows[2][0], rows[1][0] - rows[0][1]]
        return (root, *[x / (4 * root) for x in rest])
    i = largest - 1
    j, k = (i + 1) % 3, (i + 2) % 3
    q = [mpf(0)] * 4
    q[largest] = root
    q[0] = (rows[k][j] - rows[j][k]) / (4 * root)
    q[j + 1] = (rows[j][i] + rows[i][j]) / (4 * root)
    q[k + 1] = (rows[k][i] + rows[i][k]) / (4 * root)
    return tuple(q)


class Motion:
    """A generic asymmetric body with a diagonal tensor; moments in body order."""

    def __init__(self, moments, omega, q0):
        self.moments = moments
        order = sorted(range(3), key=lambda i: moments[i])
        low, mid, high = order
        i_low, i_mid, i_high = (moments[i] for i in order)
        d_sign = i_high * (i_high - i_mid) * omega[high] ** 2 - i_low * (i_mid - i_low) * omega[low] ** 2
        d, a = (high, low) if d_sign >= 0 else (low, high)
        even = (a, mid, d) in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        self.sd = 1 if omega[d] >= 0 else -1
        self.s2 = self.sd if even else -self.sd
        self.axes = (a, mid, d)
        rows = [[mpf(0)] * 3 for _ in range(3)]
        rows[0][a], rows[1][mid], rows[2][d] = mpf(1), mpf(self.s2), mpf(self.sd)
        self.q_p = from_rows(rows)
        w_a, w_2, w_d = omega[a], self.s2 * omega[mid], self.sd * omega[d]
        i_a, i_2, i_d = moments[a], moments[mid], moments[d]
        self.s = s = 1 if i_d > i_2 else -1
        f, g = (i_d - i_2) / (i_d - i_a), (i_2 - i_a) / (i_d - i_a)
        a_a = sqrt(w_a**2 + i_2 / i_a * f * w_2**2)
        a_2 = sqrt(w_2**2 + i_a / i_2 / f * w_a**2)
        a_d = sqrt(w_d**2 + i_2 / i_d * g * w_2**2)
        k2 = i_a / i_d * g / f * (a_a / a_d) ** 2
        lam = a_d * sqrt((i_d - i_2) * (i_d - i_a) / (i_a * i_2))
        big_k, big_k_dual = ellipk(k2), ellipk(1 - k2)
        self.nu = lam * pi / (2 * big_k)
        phi = atan2(s * w_2 / a_2, w_a / a_a)
        self.v0 = pi / 2 * ellipf(phi, k2) / big_k
        phi_b = atan2(sqrt(i_a * fabs(i_d - i_2)), sqrt(i_d * fabs(i_2 - i_a)))
        self.b = pi / 2 * ellipf(phi_b, 1 - k2) / big_k
        self.nome = exp(-2 * pi * big_k_dual / big_k)
        length = sqrt(sum((moments[i] * omega[i]) ** 2 for i in range(3)))
        self.length = length
        slope = mpc(0, 1) * jtheta(4, mpc(0, self.b), self.nome, 1) / jtheta(4, mpc(0, self.b), self.nome)
        self.mu = (a_d + i_a * a_a**2 / (length + i_d * a_d)) / 2 - s * self.nu * slope.real
        momentum = (i_a * w_a, i_2 * w_2, i_d * w_d)
        c0 = sqrt((1 + momentum[2] / length) / 2)
        alpha0, beta0 = mpc(c0), mpc(momentum[1], -momentum[0]) / (2 * length * c0)
        z = self.v0 - mpc(0, 1) * s * self.b
        self.a = alpha0 / jtheta(4, z, self.nome)
        self.b_factor = beta0 / jtheta(1, z, self.nome)
        q_l = (alpha0.real, beta0.real, beta0.imag, alpha0.imag)
        self.q_w = product(q0, conjugate(product(q_l, self.q_p)))

    def at(self, t):
        v = self.v0 + self.nu * t
        v -= 2 * pi * mp.floor(v / (2 * pi))
        z = v - mpc(0, 1) * self.s * self.b
        turn = mpc(cos(self.mu * t), sin(self.mu * t))
        alpha = self.a * turn * jtheta(4, z, self.nome)
        beta = self.b_factor * turn * jtheta(1, z, self.nome)
        norm = sqrt(fabs(alpha) ** 2 + fabs(beta) ** 2)
        alpha, beta = alpha / norm, beta / norm
        q = product(product(self.q_w, (alpha.real, beta.real, beta.imag, alpha.imag)), self.q_p)
        cross = conj(alpha) * beta
        along = fabs(alpha) ** 2 - fabs(beta) ** 2
        parts = (-2 * self.length * cross.imag, 2 * self.s2 * self.length * cross.real, self.sd * self.length * along)
        omega = [mpf(0)] * 3
        for axis, part in zip(self.axes, parts):
            omega[axis] = part / self.moments[axis]
        return q, omega


def text(x):
    return nstr(x, 25, strip_zeros=False, min_fixed=-30, max_fixed=30)


def check():
    worst = mpf(0)
    for path in sorted(glob.glob(os.path.join(os.path.dirname(os.path.abspath(__file__)), "free_*.json"))):
        for case in json.load(open(path))["cases"]:
            if case["solution_kind"] != "gen" or case["name"].endswith("_full") or "far" in path:
                continue
            moments = [mpf(case["body"]["inertia_body"][i][i]) for i in range(3)]
            raw = [mpf(x) for x in case["initial"]["q_raw"]]
            norm = sqrt(sum(x * x for x in raw))
            motion = Motion(moments, [mpf(x) for x in case["initial"]["w_body"]], tuple(x / norm for x in raw))
            for state in case["states"]:
                q, _ = motion.at(mpf(state["t"]))
                listed = [mpf(x) for x in state["q"]]
                error = min(max(fabs(a - sign * b) for a, b in zip(q, listed)) for sign in (1, -1))
                worst = max(worst, error)
    print("largest difference of a quaternion component:", nstr(worst, 3))


def main():
    draw = random.Random(20)
    cases = []
    for index in range(24):
        a, b, c = (draw.uniform(0.2, 1.0) for _ in range(3))
        moments = [b + c, c + a, a + b]
        omega = [draw.gauss(0, 1) for _ in range(3)]
        raw = [draw.gauss(0, 1) for _ in range(4)]
        norm = sqrt(sum(mpf(x) ** 2 for x in raw))
        motion = Motion([mpf(x) for x in moments], [mpf(x) for x in omega], tuple(mpf(x) / norm for x in raw))
        states = []
        for t in ("0", "-100000", "100000", "123456.7890625", "1000000000", "-1000000000"):
            q, w = motion.at(mpf(t))
            momentum = rotated(q, [moments[i] * w[i] for i in range(3)])
            energy = sum(moments[i] * w[i] ** 2 for i in range(3)) / 2
            states.append({
                "t": t, "q": [text(x) for x in q], "w_body": [text(x) for x in w],
                "L_world": [text(x) for x in momentum], "kinetic_energy": text(energy),
            })
        exact = lambda x: format(Decimal(x), "f")
        inertia = [[exact(moments[i]) if i == j else "0" for j in range(3)] for i in range(3)]
        cases.append({
            "name": f"far_{index:02}", "category": "free", "body": {"inertia_body": inertia},
            "initial": {"q_raw": [exact(x) for x in raw], "w_body": [exact(x) for x in omega]}, "states": states,
        })
    json.dump({"schema": "as the other files of this folder", "category": "free", "cases": cases}, sys.stdout, indent=1)


check() if "--check" in sys.argv else main()
