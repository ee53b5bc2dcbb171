"""Rotations of SciPy, which need not be installed."""


def rotation(orientation):
    """`scipy.spatial.transform.Rotation` of quaternions x, y, z, w, shape (n, 4)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(orientation)
