"""Draws of studies, by a second implementation: `python3 tests/golden/draws.py > tests/golden/draws.json`.

The standard library alone. Philox4x32-10 is written after J. K. Salmon et al., "Parallel random numbers: as easy as 1, 2, 3"
(SC11, 2011), the formulas after the table in the documentation of `polhode::study::distribution`. The normal quantile is that of
`statistics.NormalDist`, which has AS 241 too. Each case is the `[bodies]` of a study, and the numbers that its first bodies have;
whole numbers and uniform ones agree to the bit, others as far as the C library's log, exp, sin and cos agree with those of the crate
`libm`.
"""

import json
import math
from statistics import NormalDist

SEED = 20261123
COUNT = 40
MASK = 0xFFFFFFFF
INERTIA, ORIENTATION, ANGULAR_VELOCITY, MASS, ROWS, CORRELATED, DESIGN = 1, 2, 3, 4, 8, 9, 0x4000000
SELECT_NUMBER, SELECT = 0x10000, 0x20000
BOLTZMANN = 1.380649e-23


def philox(body, column, block, seed=SEED):
    counter = [body & MASK, body >> 32, column, block]
    key = [seed & MASK, seed >> 32]
    for _ in range(10):
        first, second = 0xD2511F53 * counter[0], 0xCD9E8D57 * counter[2]
        counter = [(second >> 32) ^ counter[1] ^ key[0], second & MASK, (first >> 32) ^ counter[3] ^ key[1], first & MASK]
        key = [(key[0] + 0x9E3779B9) & MASK, (key[1] + 0xBB67AE85) & MASK]
    return counter


def open_unit(high, low):
    return (((high << 32 | low) >> 12) + 0.5) * 2.0**-52


def pair(body, column, block):
    a, b, c, d = philox(body, column, block)
    return open_unit(a, b), open_unit(c, d)


def uniform(body, column, block):
    return pair(body, column, block)[0]


def normal(body, column, block):
    u, v = pair(body, column, block)
    return math.sqrt(-2.0 * math.log(u)) * math.cos(2.0 * math.pi * v)


def direction(body, column):
    u, v = pair(body, column, 0)
    radius = math.sqrt(4.0 * u * (1.0 - u))
    return [radius * math.cos(2.0 * math.pi * v), radius * math.sin(2.0 * math.pi * v), 2.0 * u - 1.0]


def fnv(name):
    value = 0x811C9DC5
    for byte in name.encode():
        value = ((value ^ byte) * 0x01000193) & MASK
    return value


def truncated(mean, sigma, low, high, u):
    """By the distribution function of the mirrored interval, as far as it lies above the mean."""
    phi = lambda x: 0.5 * math.erfc(-x / math.sqrt(2.0))
    a, b = (low - mean) / sigma, (high - mean) / sigma
    mirrored = a > 0.0
    if mirrored:
        a, b = -b, -a
    below, above = phi(a), phi(-b)
    between = phi(b) - below if b <= 0.0 else 1.0 - above - below
    p, q = below + u * between, above + (1.0 - u) * between
    x = NormalDist().inv_cdf(p) if p <= 0.5 else -NormalDist().inv_cdf(q)
    return min(max(mean + sigma * (-x if mirrored else x), low), high)


def triangular(low, mode, high, u):
    if u < (mode - low) / (high - low):
        return low + math.sqrt(u * (high - low) * (mode - low))
    return high - math.sqrt((1.0 - u) * (high - low) * (high - mode))


def perpendicular(n):
    sign = math.copysign(1.0, n[2])
    a = -1.0 / (sign + n[2])
    b = n[0] * n[1] * a
    return [1.0 + sign * n[0] ** 2 * a, sign * b, -sign * n[0]], [b, sign + n[1] ** 2 * a, -n[1]]


def near_axis(axis, versine, v):
    norm = math.sqrt(sum(x * x for x in axis))
    n = [x / norm for x in axis]
    first, second = perpendicular(n)
    radius = math.sqrt(versine * (2.0 - versine))
    cos, sin = math.cos(2.0 * math.pi * v), math.sin(2.0 * math.pi * v)
    return [(x * cos + y * sin) * radius + z * (1.0 - versine) for x, y, z in zip(first, second, n)]


def times(p, q):
    """The product of two quaternions x, y, z, w."""
    (a, b, c, d), (e, f, g, h) = p, q
    return [d * e + a * h + b * g - c * f, d * f - a * g + b * h + c * e, d * g + a * f - b * e + c * h, d * h - a * e - b * f - c * g]


def rotation(body):
    u, v = pair(body, ORIENTATION, 0)
    w = uniform(body, ORIENTATION, 1)
    near, far, turn = math.sqrt(1.0 - u), math.sqrt(u), 2.0 * math.pi
    return [near * math.sin(turn * v), near * math.cos(turn * v), far * math.sin(turn * w), far * math.cos(turn * w)]


def scatter(body, about, sigma):
    phi = [s * normal(body, ORIENTATION, c) for c, s in enumerate(sigma)]
    angle = math.sqrt(sum(x * x for x in phi))
    return times(about, [x / angle * math.sin(angle / 2.0) for x in phi] + [math.cos(angle / 2.0)])


def permuted(axis, index, size):
    half = max(1, ((size - 1).bit_length() + 1) // 2)
    while True:
        left, right = index >> half, index & (1 << half) - 1
        for turn in range(8):
            left, right = right, left ^ (philox(right, DESIGN | axis, 0x100 + turn)[0] & (1 << half) - 1)
        index = left << half | right
        if index < size:
            return index


def latin(axis, cell, cells):
    return (permuted(axis, cell, cells) + uniform(cell, DESIGN | axis, 0)) / cells


def sobol(axis, cell):
    """Axes 0 and 1: the direction numbers of the second are the rows of Pascal's triangle modulo 2."""
    plain = 0
    for bit in range(32):
        if cell >> bit & 1:
            row = [1 if axis == 0 and k == bit else math.comb(bit, k) % 2 if axis == 1 else 0 for k in range(bit + 1)]
            for k, digit in enumerate(row):
                plain ^= digit << (31 - k)
    scrambled = 0
    for digit in range(32):
        before = 1 << digit | plain >> (32 - digit)
        flip = philox(before, DESIGN | axis, 0x200)[0] & 1
        scrambled = scrambled << 1 | (plain >> (31 - digit) & 1) ^ flip
    return open_unit(scrambled, philox(cell, DESIGN | axis, 0)[0])


CASES = []


def case(name, ulps, lines, value, column="angular_velocity", more="", inertia="[1.0, 1.5, 2.0]"):
    """`ulps`: how far two numbers may be apart, in units of 2⁻⁵² of the largest component."""
    bodies = [f"count = {COUNT}", f"inertia = {inertia}"]
    bodies += [] if column == "angular_velocity" else ["angular_velocity = [0, 0, 1]"]
    text = "\n".join([f"seed = {SEED}", more, "[bodies]", *bodies, f"{column} = {lines}", "[time]", "end = 1.0", ""])
    CASES.append({"name": name, "column": column, "ulps": ulps, "study": text, "values": [value(b) for b in range(COUNT)]})


def number(name, ulps, distribution, value):
    """The x component; y and z are zero."""
    case(name, ulps, f"[{distribution}, 0, 0]", lambda b: [value(b), 0.0, 0.0])


W = ANGULAR_VELOCITY
number("uniform", 0, '{ distribution = "uniform", low = -1.0, high = 3.0 }', lambda b: -1.0 + 4.0 * uniform(b, W, 0))
number("normal", 4, '{ distribution = "normal", mean = 1.0, sigma = 0.5 }', lambda b: 1.0 + 0.5 * normal(b, W, 0))
number("log-normal", 8, '{ distribution = "log-normal", median = 2.0, sigma = 0.7 }', lambda b: 2.0 * math.exp(0.7 * normal(b, W, 0)))
number("truncated-normal", 16, '{ distribution = "truncated-normal", mean = 1.0, sigma = 0.5, low = 0.2, high = 3.0 }',
       lambda b: truncated(1.0, 0.5, 0.2, 3.0, uniform(b, W, 0)))
number("truncated-normal, upper tail", 16, '{ distribution = "truncated-normal", mean = 0.0, sigma = 1.0, low = 6.0 }',
       lambda b: truncated(0.0, 1.0, 6.0, math.inf, uniform(b, W, 0)))
number("exponential", 4, '{ distribution = "exponential", mean = 0.3 }', lambda b: -0.3 * math.log(uniform(b, W, 0)))
number("rayleigh", 4, '{ distribution = "rayleigh", sigma = 0.3 }', lambda b: 0.3 * math.sqrt(-2.0 * math.log(uniform(b, W, 0))))
number("triangular", 2, '{ distribution = "triangular", low = -1.0, mode = 0.5, high = 2.0 }',
       lambda b: triangular(-1.0, 0.5, 2.0, uniform(b, W, 0)))
number("mixture", 2, '{ distribution = "mixture", weights = [3, 1], of = [{ distribution = "uniform", low = 0.0, high = 1.0 }, 7.5] }',
       lambda b: uniform(b, W, 0) if uniform(b, W, SELECT_NUMBER) < 0.75 else 7.5)
case("direction", 4, '{ distribution = "direction", magnitude = 2.0 }', lambda b: [2.0 * x for x in direction(b, W)])
for kappa in (0.0, 0.5, 1e6):
    case(f"von-mises-fisher, {kappa}", 16,
         f'{{ distribution = "von-mises-fisher", axis = [1, -2, 2], concentration = {kappa}, magnitude = 1.0 }}',
         lambda b: near_axis([1, -2, 2], 2.0 * (1.0 - uniform(b, W, 0)) if kappa == 0.0 else
                             -math.log1p((1.0 - uniform(b, W, 0)) * math.expm1(-2.0 * kappa)) / kappa, pair(b, W, 0)[1]))
case("cone", 16, '{ distribution = "cone", axis = [0, 0, -3], half_angle = 0.4, magnitude = 1.0 }',
     lambda b: near_axis([0, 0, -3], uniform(b, W, 0) * 2.0 * math.sin(0.2) ** 2, pair(b, W, 0)[1]))
case("covariance", 8, '{ distribution = "normal", mean = [1, 2, 3], covariance = [[4, 2, 0], [2, 5, 2], [0, 2, 2]] }',
     lambda b: (lambda z: [1 + 2 * z[0], 2 + z[0] + 2 * z[1], 3 + z[1] + z[2]])([normal(b, W, c) for c in range(3)]))
CORRELATED_GROUP = """[correlated.craft]
variables = ["spin", "wobble"]
mean = [1.0, 0.5]
sigma = [0.2, 0.1]
correlation = [[1, 0.6], [0.6, 1]]"""
case("correlated", 8,
     '[{ distribution = "correlated", variable = "craft.wobble" }, 0, { distribution = "correlated", variable = "craft.spin" }]',
     lambda b: (lambda s, w: [0.5 + 0.06 * s + 0.08 * w, 0.0, 1.0 + 0.2 * s])(
         normal(b, CORRELATED, fnv("craft.spin")), normal(b, CORRELATED, fnv("craft.wobble"))), more=CORRELATED_GROUP)
case("rotation", 4, '{ distribution = "uniform" }', rotation, column="orientation")
case("scatter", 8, '{ distribution = "scatter", about = [0.6, 0.0, 0.0, 0.8], sigma = [0.01, 0.02, 0.5] }',
     lambda b: scatter(b, [0.6, 0.0, 0.0, 0.8], [0.01, 0.02, 0.5]), column="orientation")
MOLECULE = "[1.0e-46, 2.0e-46, 2.5e-46]"
case("thermal", 8, '{ distribution = "thermal", temperature = 300.0 }',
     lambda b: [math.sqrt(BOLTZMANN * 300.0 / i) * normal(b, W, c) for c, i in enumerate([1e-46, 2e-46, 2.5e-46])], inertia=MOLECULE)
case("fixed-energy", 8, '{ distribution = "fixed-energy", energy = 4.0 }',
     lambda b: [math.sqrt(8.0 / i) * n for i, n in zip([1.0, 1.5, 2.0], direction(b, W))])
case("fixed-angular-momentum", 8, '{ distribution = "fixed-angular-momentum", angular_momentum = 4.0 }',
     lambda b: [4.0 * n / i for i, n in zip([1.0, 1.5, 2.0], direction(b, W))])
AXES = """[[sweep]]
name = "first"
from = 0.0
to = 1.0
[[sweep]]
name = "second"
from = 0.0
to = 1.0
[design]
kind = "{}"
points = {}"""
SWEPT = '[{ sweep = "first" }, { sweep = "second" }, 0]'
for kind, cells, value in (("latin-hypercube", 37, lambda c: [latin(0, c, 37), latin(1, c, 37), 0.0]),
                           ("sobol", 32, lambda c: [sobol(0, c), sobol(1, c), 0.0])):
    case(kind, 0, SWEPT, lambda b: value(b % cells), more=AXES.format(kind, cells))
    CASES[-1]["study"] = CASES[-1]["study"].replace(f"count = {COUNT}", "count = 2")

if __name__ == "__main__":
    print("[\n" + ",\n".join(json.dumps(case) for case in CASES) + "\n]")
