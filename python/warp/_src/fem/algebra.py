"""Algebra of small tensors - symmetric, skew and spherical parts."""

from typing import Any

import warp as wp


@wp.func
def symmetric_part(x: Any):
    """Symmetric part of a square matrix."""
    return x.dtype(0.5) * (x + wp.transpose(x))


@wp.func
def skew_part(x: wp.types.matrix((2, 2), wp.Scalar)):
    """Angle of the skew part of a matrix."""
    return x.dtype(0.5) * (x[1, 0] - x[0, 1])


@wp.func
def skew_part(x: wp.types.matrix((3, 3), wp.Scalar)):
    """Vector of the skew part of a matrix."""
    half = x.dtype(0.5)
    return type(x[0])(
        half * (x[2, 1] - x[1, 2]), half * (x[0, 2] - x[2, 0]), half * (x[1, 0] - x[0, 1])
    )


@wp.func
def spherical_part(x: wp.types.matrix((2, 2), wp.Scalar)):
    """Multiple of the identity with the trace of a matrix."""
    return (x.dtype(0.5) * wp.trace(x)) * wp.identity(n=2, dtype=x.dtype)


@wp.func
def spherical_part(x: wp.types.matrix((3, 3), wp.Scalar)):
    """Multiple of the identity with the trace of a matrix."""
    return (wp.trace(x) / x.dtype(3.0)) * wp.identity(n=3, dtype=x.dtype)
