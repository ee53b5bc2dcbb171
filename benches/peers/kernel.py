"""Text of a GPU kernel, one thread a body: adaptive Dormand-Prince 8(5,3) in f64, in Python and in CUDA C++.

Method, error estimate and step control are those of numba_.py, coefficients are from SciPy. The equations of
problems.py are run once on symbols, so that an attempt at a step becomes a list of assignments without loops and
arrays: all slopes can then stay in registers. Both languages get the same assignments.
"""

import numpy as np
from scipy.integrate._ivp import dop853_coefficients as dop853

from problems import eccentric_anomaly, quaternion_rate

STAGES = dop853.N_STAGES
COMPONENTS = range(7)
# A step that is never accepted must not keep the device for ever.
ATTEMPTS = 1_000_000


class Symbol:
    """A name in the text; arithmetic with it adds assignments to its list."""

    # numpy's scalars leave their products with a symbol to the symbol.
    __array_ufunc__ = None

    def __init__(self, text, lines):
        self.text, self.lines = text, lines

    def assigned(self, text):
        name = f"s{len(self.lines)}"
        self.lines.append((name, text))
        return Symbol(name, self.lines)

    def __add__(self, other):
        return self.assigned(f"{self.text} + {written(other)}")

    def __radd__(self, other):
        return self.assigned(f"{written(other)} + {self.text}")

    def __sub__(self, other):
        return self.assigned(f"{self.text} - {written(other)}")

    def __rsub__(self, other):
        return self.assigned(f"{written(other)} - {self.text}")

    def __mul__(self, other):
        return self.assigned(f"{self.text} * {written(other)}")

    def __rmul__(self, other):
        return self.assigned(f"{written(other)} * {self.text}")

    def __truediv__(self, other):
        return self.assigned(f"{self.text} / {written(other)}")

    def __rtruediv__(self, other):
        return self.assigned(f"{written(other)} / {self.text}")

    def __neg__(self):
        return self.assigned(f"-{self.text}")


def written(value):
    if isinstance(value, Symbol):
        return value.text
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text


def sin(symbol):
    return symbol.assigned(f"sin({symbol.text})")


def cos(symbol):
    return symbol.assigned(f"cos({symbol.text})")


def columns(problem):
    """Names of the bodies' columns and the numbers of a body in each."""
    return {name: values.shape[1] for name, values in problem.bodies(1).items()}


def loading(problem):
    """Assignments of a body's state y and parameters p from its columns; the body is b."""
    lines = []
    read = {
        name: np.array([Symbol(f"{name}[b * {width} + {index}]", lines) for index in range(width)], object)
        for name, width in columns(problem).items()
    }
    # Each number is read once.
    for name, values in read.items():
        for index, value in enumerate(values):
            lines.append((f"{name}{index}", value.text))
            value.text = f"{name}{index}"
    parameters = problem.parameter_rows(read)
    lines += [(f"p{row}", written(parameter)) for row, parameter in enumerate(parameters)]
    lines += [(f"start{c}", read["orientation"][c].text) for c in range(4)]
    lines += [(f"start{4 + c}", written(problem.time_unit * read["angular_velocity"][c])) for c in range(3)]
    return lines, len(parameters)


def rates(problem, parameter_count):
    """Assignments of the slopes f of a state y at the time `now`."""
    lines = []
    state = [Symbol(f"y{c}", lines) for c in COMPONENTS]
    parameters = [Symbol(f"p{row}", lines) for row in range(parameter_count)]
    place = problem.place(sin, cos, eccentric_anomaly(sin, cos))
    g = place(Symbol("now", lines)) if place else ()
    values = [*quaternion_rate(state[:4], state[4:]), *problem.acceleration(state[:4], state[4:], g, parameters)]
    return lines + [(f"f{c}", written(value)) for c, value in enumerate(values)]


def attempt(call):
    """Assignments of an attempt: from y, k0, t, h to the new state z, its slopes and the estimate `error`.

    `call` gives the assignments of the slopes k of a stage from names of a state and the text of a time.
    """
    lines = []

    def weighted(weights, c):
        terms = [f"{written(weight)} * k{stage}_{c}" for stage, weight in enumerate(weights) if weight != 0.0]
        return " + ".join(terms)

    for stage in range(1, STAGES):
        lines += [(f"x{stage}_{c}", f"y{c} + h * ({weighted(dop853.A[stage, :stage], c)})") for c in COMPONENTS]
        lines += call(f"k{stage}", f"x{stage}_", f"t + {written(dop853.C[stage])} * h")
    lines += [(f"z{c}", f"y{c} + h * ({weighted(dop853.B, c)})") for c in COMPONENTS]
    lines += call(f"k{STAGES}", "z", "t + h")
    # The error of q is taken as it is, that of ω relative to |ω|, with a floor for bodies nearly at rest.
    for letter in "yz":
        lines.append((f"spin_{letter}", " + ".join(f"{letter}{c} * {letter}{c}" for c in (4, 5, 6))))
    lines.append(("scale", "1.0 / (0.1 + sqrt(fmax(spin_y, spin_z)))"))
    for name, weights in (("five", dop853.E5), ("three", dop853.E3)):
        for c in COMPONENTS:
            factor = "" if c < 4 else "scale * "
            lines.append((f"{name}{c}", f"{factor}({weighted(weights, c)})"))
        lines.append((name, " + ".join(f"{name}{c} * {name}{c}" for c in COMPONENTS)))
    lines.append(("error", "h * five / (tolerance * sqrt(five + 0.01 * three + 1e-300))"))
    lines.append(("grown", "fmin(6.0, fmax(0.2, 0.9 / sqrt(sqrt(sqrt(error + 1e-30)))))"))
    return lines


# Slopes are a function of their own: the compilers put it in line, and numba has less to read.
# Names that both languages know: sqrt, sin, cos, fmin, fmax. `order` is read if `sorted` is not 0; `first` is the
# tolerance to the power 1/8; rows of the result are components, ω in rad/s.
PYTHON_RATES = """def rates({arguments}):
{rates}
    return {values}
"""

PYTHON = """def integrate({columns}, order, use_order, count, end, tolerance, first, result):
    i = cuda.grid(1)
    if i < count:
        b = order[i] if use_order else i
{loading}
{start}
        t = 0.0
        h = fmin(end, first / (1.0 + sqrt(y4 * y4 + y5 * y5 + y6 * y6)))
{slopes}
        attempts = 0
        while t < end and attempts < {attempts}:
            attempts += 1
{attempt}
            if error <= 1.0:
                t = end if h >= end - t else t + h
{accept}
            h = fmin(end - t, fmax(h, 1e-12 * end) * grown)
{store}
"""

CUDA_RATES = """__device__ __forceinline__ void rates({arguments}, {results}) {{
{rates}
{values}
}}
"""

CUDA = """extern "C" __global__ void __launch_bounds__({threads}) integrate(
    {columns}, const long long* __restrict__ order, int use_order, int count, double end, double tolerance,
    double first, double* __restrict__ result) {{
    const int i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i < count) {{
        const long long b = use_order ? order[i] : i;
{loading}
{start}
        double t = 0.0;
        double h = fmin(end, first / (1.0 + sqrt(y4 * y4 + y5 * y5 + y6 * y6)));
{slopes}
        int attempts = 0;
        while (t < end && attempts < {attempts}) {{
            attempts += 1;
{attempt}
            if (error <= 1.0) {{
                t = h >= end - t ? end : t + h;
{accept}
            }}
            h = fmin(end - t, fmax(h, 1e-12 * end) * grown);
        }}
{store}
    }}
}}
"""


def sources(problem, language, threads=128):
    """Texts of the slopes' function and of the kernel, in "python" or "cuda"."""
    c_like = language == "cuda"

    def text(lines, depth, declared=True):
        before = "    " * depth + ("double " if c_like and declared else "")
        after = ";" if c_like else ""
        # No name: a call of C++.
        return "\n".join(
            f"{before}{name} = {value}{after}" if name else f"{'    ' * depth}{value}{after}" for name, value in lines
        )

    load, parameter_count = loading(problem)
    names = [f"y{c}" for c in COMPONENTS] + [f"p{row}" for row in range(parameter_count)] + ["now"]

    def call(result, state, time):
        values = ", ".join([f"{state}{c}" for c in COMPONENTS] + names[len(COMPONENTS) : -1] + [time])
        results = [f"{result}_{c}" for c in COMPONENTS]
        if not c_like:
            return [(", ".join(results), f"rates({values})")]
        declared = [] if result == "k0" else [("", "double " + ", ".join(results))]
        return declared + [("", f"rates({values}, {', '.join(results)})")]

    slopes = call("k0", "y", "t")
    if c_like:
        slopes.insert(0, ("", "double " + ", ".join(f"k0_{c}" for c in COMPONENTS)))
    formulas = rates(problem, parameter_count)
    function = (CUDA_RATES if c_like else PYTHON_RATES).format(
        arguments=", ".join(f"double {name}" if c_like else name for name in names),
        results=", ".join(f"double& r{c}" for c in COMPONENTS),
        rates=text(formulas, 1),
        values=text([(f"r{c}", f"f{c}") for c in COMPONENTS], 1, False)
        if c_like
        else ", ".join(f"f{c}" for c in COMPONENTS),
    )
    unit = written(problem.time_unit)
    cast = "(long long)" if c_like else ""
    kernel = (CUDA if c_like else PYTHON).format(
        threads=threads,
        attempts=ATTEMPTS,
        columns=", ".join(f"const double* __restrict__ {name}" if c_like else name for name in columns(problem)),
        loading=text(load, 2),
        start=text([(f"y{c}", f"start{c}") for c in COMPONENTS], 2),
        slopes=text(slopes, 2, False),
        attempt=text(attempt(call), 3),
        accept=text(
            [(f"y{c}", f"z{c}") for c in COMPONENTS] + [(f"k0_{c}", f"k{STAGES}_{c}") for c in COMPONENTS], 4, False
        ),
        store=text(
            [(f"result[{c} * {cast}count + b]", f"y{c}" if c < 4 else f"y{c} / {unit}") for c in COMPONENTS], 2, False
        ),
    )
    return function, kernel


class Solver:
    """Runs a kernel by `run(bodies, tolerance, sort)`, with the bodies sorted by spin or not, whichever is faster."""

    def __init__(self):
        self.sort = {}

    def __call__(self, bodies, tolerance):
        """Seconds, seconds of the kernel alone, orientations at the end (four rows)."""
        count = len(bodies["inertia"])
        if count not in self.sort:
            # A trial, after a call that compiles: does sorting pay?
            self.run(bodies, tolerance, True)
            trials = {sort: min(self.run(bodies, tolerance, sort)[0] for _ in range(2)) for sort in (True, False)}
            self.sort[count] = trials[True] <= trials[False]
        return self.run(bodies, tolerance, self.sort[count])
