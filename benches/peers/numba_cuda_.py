"""numba-cuda: the kernel of kernel.py, compiled by NVVM; one thread a body, as in DiffEqGPU's EnsembleGPUKernel.

U. Utkarsh and others, Comput. Methods Appl. Mech. Eng. 419 (2024) 116591 is that design; Julia itself is not used.
"""

import math
import os
import time

import numpy as np
from numba import cuda

import kernel

METHOD = "DOP853, a thread a body"
PRECISION = "f64"
# Error of the result ~ tolerance to this power.
EXPONENT = 1.0
EQUAL_STEPS = False
THREADS = 128
# Python runs the kernel, body by body: for tests without a device.
SIMULATED = os.environ.get("NUMBA_ENABLE_CUDASIM") == "1"


def version():
    from importlib import metadata

    return metadata.version("numba-cuda")


def device():
    if SIMULATED:
        return "CUDA simulator"
    name = cuda.get_current_device().name
    return name.decode() if isinstance(name, bytes) else str(name)


def guess(problem, target):
    return target / 10


def label(setting):
    return f"tolerance {setting:.2e}"


def spin_order(angular_velocity):
    """Bodies by |ω|: neighbours then take about the same number of steps.

    On the device by CuPy where it works, else by NumPy: 16 bits of |ω| are enough, and sorted in one pass.
    """
    try:
        import cupy

        column = cupy.asarray(angular_velocity)
        order = cupy.argsort(cupy.sum(column * column, axis=1)).astype(cupy.int64)
        # CuPy and numba each have a stream of their own.
        cupy.cuda.get_current_stream().synchronize()
        return cuda.as_cuda_array(order)
    except Exception:
        spin = np.sqrt(np.einsum("ij,ij->i", angular_velocity, angular_velocity))
        keys = (spin * (65535 / max(float(np.max(spin)), 1e-300))).astype(np.uint16)
        return cuda.to_device(np.argsort(keys, kind="stable"))


class Solver(kernel.Solver):
    def __init__(self, problem):
        super().__init__()
        self.problem = problem
        names = {"cuda": cuda, "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "fmin": min, "fmax": max}
        for text in kernel.sources(problem, "python", THREADS):
            exec(compile(text, f"<{problem.name} for numba-cuda>", "exec"), names)
        names["rates"] = cuda.jit(device=True, fastmath=True)(names["rates"])
        self.kernel = cuda.jit(fastmath=True)(names["integrate"])
        self.unsorted = None

    def run(self, bodies, tolerance, sort):
        count = len(bodies["inertia"])
        if self.unsorted is None:
            self.unsorted = cuda.to_device(np.zeros(1, np.int64))
        result = np.zeros((7, count))
        cuda.synchronize()
        clock = time.perf_counter()
        columns = [cuda.to_device(np.ascontiguousarray(column).reshape(-1)) for column in bodies.values()]
        order = spin_order(bodies["angular_velocity"]) if sort else self.unsorted
        output = cuda.device_array(7 * count, np.float64)
        cuda.synchronize()
        device_clock = time.perf_counter()
        self.kernel[-(-count // THREADS), THREADS](
            *columns, order, np.int32(sort), np.int32(count), self.problem.end, tolerance, tolerance**0.125, output
        )
        cuda.synchronize()
        device_seconds = time.perf_counter() - device_clock
        output.copy_to_host(result.reshape(-1))
        return time.perf_counter() - clock, device_seconds, result[:4]
