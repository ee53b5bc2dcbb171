"""Bodies and engines that several tests use."""

import numpy as np
import polhode
import pytest


@pytest.fixture(params=["cpu", "gpu"], scope="session")
def engine(request):
    """The CPU, and a GPU; the software adapter of Mesa will do, but no adapter at all is a failure."""
    return polhode.Engine(request.param)


def tumbling(count, seed=0, **more):
    """Asymmetric bodies whose axes are not principal ones, in any attitude."""
    draws = np.random.default_rng(seed)
    a, b, c = draws.uniform(0.2, 1.0, (3, count))
    moments = np.stack([b + c, c + a, a + b], axis=-1)
    turned = np.linalg.qr(draws.normal(size=(count, 3, 3)))[0]
    tensors = np.einsum("nij,nj,nkj->nik", turned, moments, turned)
    tensors = 0.5 * (tensors + tensors.transpose(0, 2, 1))
    return polhode.Ensemble(tensors, draws.normal(size=(count, 4)), draws.normal(size=(count, 3)), **more)


def rotated(orientation, vector):
    """Vectors in world axes, by NumPy alone."""
    q, w = orientation[..., :3], orientation[..., 3:]
    t = 2.0 * np.cross(q, vector)
    return vector + w * t + np.cross(q, t)
