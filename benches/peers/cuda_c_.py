"""CUDA C++: the kernel of kernel.py, compiled by NVRTC and started from CuPy; one thread a body."""

import time

import cupy
import numpy as np

import kernel

METHOD = "DOP853, a thread a body"
PRECISION = "f64"
# Error of the result ~ tolerance to this power.
EXPONENT = 1.0
EQUAL_STEPS = False
THREADS = 128


def version():
    runtime = cupy.cuda.runtime.runtimeGetVersion()
    return f"CUDA {runtime // 1000}.{runtime % 1000 // 10}, CuPy {cupy.__version__}"


def device():
    name = cupy.cuda.runtime.getDeviceProperties(cupy.cuda.runtime.getDevice())["name"]
    return name.decode() if isinstance(name, bytes) else str(name)


def guess(problem, target):
    return target / 10


def label(setting):
    return f"tolerance {setting:.2e}"


class Solver(kernel.Solver):
    def __init__(self, problem):
        super().__init__()
        self.problem = problem
        text = "\n".join(kernel.sources(problem, "cuda", THREADS))
        self.kernel = cupy.RawKernel(text, "integrate", options=("--std=c++14",))

    def run(self, bodies, tolerance, sort):
        count = len(bodies["inertia"])
        result = np.zeros((7, count))
        synchronize = cupy.cuda.runtime.deviceSynchronize
        synchronize()
        clock = time.perf_counter()
        columns = {name: cupy.asarray(np.ascontiguousarray(column)) for name, column in bodies.items()}
        if sort:
            spin = columns["angular_velocity"]
            order = cupy.argsort(cupy.sum(spin * spin, axis=1)).astype(cupy.int64)
        else:
            order = cupy.zeros(1, cupy.int64)
        output = cupy.empty((7, count))
        synchronize()
        device_clock = time.perf_counter()
        scalars = (np.int32(sort), np.int32(count), np.float64(self.problem.end), np.float64(tolerance))
        self.kernel(
            (-(-count // THREADS),),
            (THREADS,),
            (*columns.values(), order, *scalars, np.float64(tolerance**0.125), output),
        )
        synchronize()
        device_seconds = time.perf_counter() - device_clock
        output.get(out=result)
        return time.perf_counter() - clock, device_seconds, result[:4]
