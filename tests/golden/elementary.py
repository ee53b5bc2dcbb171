"""Writes elementary.json: values of elementary functions at f64 arguments, correctly rounded, and what the rounding
leaves of them. Needs mpmath 1.3."""

import json

from mpmath import acos, asin, atan, atan2, exp, log, mp, mpf, sqrt, tan

mp.prec = 400
LEAST, LARGEST, ULP = 2.0**-1022, (2.0 - 2.0**-52) * 2.0**1023, 2.0**-52
POLES = [1.5707963267948966, 3.141592653589793, 4.71238898038469, 1e5 * 1.5707963267948966, 1048574.6899, 355.0]


def around(*xs):
    return [x * (1 + s * ULP) for x in xs for s in (-1, 0, 1)]


ONE_ARGUMENT = {
    "exp": (exp, [0.0, 1.0, -1.0, 1e-20, -1e-9, 709.78, -708.39, 0.34657359027997264, -0.34657359027997264, 100.5, -345.25]),
    "ln": (log, around(1.0, 2.0, 0.5, 1.4142135623730951, 0.70710678118654757, 0.9375, 1.0625) + [LEAST, LARGEST, 5e-324, 1e300, 1e-300]),
    "tan": (tan, POLES + [-x for x in POLES] + [1e-300, 1e-8, 0.7853981633974483, 1.0, 1048575.5]),
    "asin": (asin, [0.0, 1.0, -1.0, 1 - ULP / 2, -1 + ULP / 2, 0.5, 1e-300, 1e-8, 0.7071067811865476, 0.2537, 0.75]),
    "acos": (acos, [0.0, 1.0, -1.0, 1 - ULP / 2, -1 + ULP / 2, 0.5, 1e-300, 1e-8, 0.7071067811865476, -0.5, 0.75]),
    "arctangent_ratio": (lambda x: atan(sqrt(x)) / sqrt(x) if x else mpf(1), [0.0, 1e-300, 1e-17, 1e-4, 0.01, 0.02, 0.04]),
}
TWO_ARGUMENTS = {
    "atan2": (
        atan2,
        [(y, x) for y in (1.0, -1.0, 0.13, 0.36, 0.72, 1e-9) for x in (1.0, -1.0, 1e-9, -1e-5)]
        + [(LARGEST, LARGEST), (LEAST, LEAST), (5e-324, -5e-324), (1e308, -1e-308), (1e-308, -1e308), (3e-310, 1e-309)]
        + [(2e-250, -3e-250), (1e280, 3e279), (0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0)],
    ),
    "pow": (
        lambda x, y: mpf(x) ** mpf(y),
        [(2.0, 0.5), (2.0, 1023.0), (2.0, -1022.0), (10.0, 308.0), (10.0, -307.0), (1 + ULP, 3e18), (1 - ULP / 2, 6e18)]
        + [(LARGEST, 0.999), (LEAST, 0.999), (LARGEST, -0.99), (0.7, 1900.0), (1.41, 2000.0), (1.0, 1e300), (7.3, 1 / 3)]
        + [(5e-324, 0.25), (1e-5, -60.5), (0.0, 2.5)],
    ),
}


def row(name, arguments, value):
    rounded = float(value)
    residue = float(value - mpf(rounded))
    return {"function": name, "arguments": [repr(x) for x in arguments], "value": repr(rounded), "residue": repr(residue)}


rows = [row(n, [x], f(mpf(x))) for n, (f, xs) in ONE_ARGUMENT.items() for x in xs]
rows += [row(n, xs, f(mpf(xs[0]), mpf(xs[1]))) for n, (f, pairs) in TWO_ARGUMENTS.items() for xs in pairs]
with open("elementary.json", "w") as file:
    file.write("[\n" + ",\n".join(json.dumps(r) for r in rows) + "\n]\n")
