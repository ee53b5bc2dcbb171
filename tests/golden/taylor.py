"""Taylor coefficients of formulas of time at 60 digits, for tests of src/expression/jet; writes taylor.json beside this file.

mpmath differentiates by contour integrals or differences at the working precision, so that 20 coefficients are good to more than 30
digits. Run: python3 taylor.py
"""

import json
import pathlib

import mpmath as mp

mp.mp.dps = 120
ORDER = 20


def kepler(m, e):
    return mp.findroot(lambda x: x - e * mp.sin(x) - m, m + e * mp.sin(m))


CASES = [
    ("sin(1.3 * time + 0.2) * cos(0.7 * time)", 0.4, lambda t: mp.sin(1.3 * t + 0.2) * mp.cos(0.7 * t)),
    ("sin(time * time) / (2 + cos(time))", 0.6, lambda t: mp.sin(t * t) / (2 + mp.cos(t))),
    ("exp(-0.5 * time * time)", 0.3, lambda t: mp.exp(-0.5 * t * t)),
    ("ln(1 + time * time)", 0.8, lambda t: mp.log(1 + t * t)),
    ("sqrt(1 + time * time * time)", 0.5, lambda t: mp.sqrt(1 + t**3)),
    ("tan(0.4 * sin(time))", 0.9, lambda t: mp.tan(0.4 * mp.sin(t))),
    ("asin(0.6 * sin(1.1 * time)) + acos(0.3 * time)", 0.7, lambda t: mp.asin(0.6 * mp.sin(1.1 * t)) + mp.acos(0.3 * t)),
    ("atan2(sin(time) + 0.3, 2 * cos(time))", 2.1, lambda t: mp.atan2(mp.sin(t) + 0.3, 2 * mp.cos(t))),
    ("pow(1 + time * time, 0.37) + pow(time, 3) + pow(2 + sin(time), 1 + 0.1 * time)", 1.2,
     lambda t: (1 + t * t) ** mp.mpf("0.37") + t**3 + (2 + mp.sin(t)) ** (1 + t / 10)),
    ("kepler_sin(1.3 * time, 0.6) * kepler_cos(0.4 * time, 0.3)", 0.5,
     lambda t: mp.sin(kepler(1.3 * t, mp.mpf("0.6"))) * mp.cos(kepler(0.4 * t, mp.mpf("0.3")))),
    ("kepler_cos(0.2 + 0.1 * sin(time), 0.8)", 0.5, lambda t: mp.cos(kepler(0.2 + mp.sin(t) / 10, mp.mpf("0.8")))),
    ("abs(time - 2) * max(time, 1) + min(3 * time, time * time)", 0.9, lambda t: (2 - t) + t * t),
    ("select(time < 1, sin(time), cos(time)) * clamp(2 * time, 0, 1)", 0.3, lambda t: mp.sin(t) * 2 * t),
]


def coefficients(f, at):
    # On a circle well inside the radius of convergence: the mean of f z^-k over N points, whose error is of the order of the
    # coefficient k + N.
    points, radius = 512, mp.mpf("0.05")
    values = [f(at + radius * mp.expjpi(mp.mpf(2 * j) / points)) for j in range(points)]
    found = []
    for k in range(ORDER + 1):
        mean = mp.fsum(v * mp.expjpi(-mp.mpf(2 * j * k) / points) for j, v in enumerate(values)) / points
        found.append(float(mp.re(mean) / radius**k))
    return found


def atan2_free(t):
    return mp.atan((mp.sin(t) + 0.3) / (2 * mp.cos(t))) + mp.pi


if __name__ == "__main__":
    rows = []
    for text, at, f in CASES:
        # arctan of a quotient has the derivatives of atan2, which takes real numbers only.
        f = atan2_free if text.startswith("atan2") else f
        rows.append({"formula": text, "at": at, "coefficients": coefficients(f, mp.mpf(at))})
    pathlib.Path(__file__).with_suffix(".json").write_text(json.dumps(rows, indent=1) + "\n")
