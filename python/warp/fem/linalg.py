"""Functions of `warp.fem.linalg` that programs call by themselves: symmetric eigenvalues, axpy.

The others belong to finite elements, which are left out.
"""

from __future__ import annotations

from typing import Any as _Any

import warp as _wp
from warp._src.absent import absent_class as _absent_class

__all__ = ["array_axpy", "symmetric_eigenvalues_qr"]
_made: dict = {}


@_wp.func
def _smallest_step(x: _wp.float16):
    return _wp.float16(9.765625e-4)


@_wp.func
def _smallest_step(x: _wp.float32):
    return _wp.float32(1.1920929e-7)


@_wp.func
def _smallest_step(x: _wp.float64):
    return _wp.float64(2.220446049250313e-16)


@_wp.func
def symmetric_eigenvalues_qr(A: _Any, tol: _Any):
    """Eigenvalues and eigenvectors of a symmetric matrix of any size, by Jacobi's rotations.

    Args:
        A: the matrix; its upper triangle counts.
        tol: off-diagonal elements may be as large, relative to the roots of their diagonal
            elements' product; at least the spacing of the numbers at 1.

    Returns:
        Eigenvalues d, in no order, and a rotation P with an eigenvector per row:
        A = P^T diag(d) P.
    """
    n = len(A)
    one, zero = A.dtype(1.0), A.dtype(0.0)
    limit = _wp.max(A.dtype(tol), _smallest_step(one))
    work = A
    P = _wp.identity(n=len(A), dtype=A.dtype)
    rotations = int(1)
    sweep = int(0)
    while rotations > 0 and sweep < 24:
        rotations = 0
        for p in range(n - 1):
            for q in range(p + 1, n):
                x = work[p, q]
                a, b = work[p, p], work[q, q]
                if _wp.abs(x) > limit * _wp.sqrt(_wp.abs(a)) * _wp.sqrt(_wp.abs(b)):
                    rotations += 1
                    # The smaller of the two angles that make this element zero.
                    slope = (b - a) / (A.dtype(2.0) * x)
                    t = one / (_wp.abs(slope) + _wp.sqrt(one + slope * slope))
                    if slope < zero:
                        t = -t
                    c = one / _wp.sqrt(one + t * t)
                    s = t * c
                    for k in range(n):
                        if k != p and k != q:
                            u = work[_wp.min(k, p), _wp.max(k, p)]
                            v = work[_wp.min(k, q), _wp.max(k, q)]
                            work[_wp.min(k, p), _wp.max(k, p)] = c * u - s * v
                            work[_wp.min(k, q), _wp.max(k, q)] = s * u + c * v
                        g, h = P[p, k], P[q, k]
                        P[p, k] = c * g - s * h
                        P[q, k] = s * g + c * h
                    work[p, p] = a - t * x
                    work[q, q] = b + t * x
                    work[p, q] = zero
        sweep += 1
    return _wp.get_diag(work), P


@_wp.kernel
def _axpy(x: _wp.array(dtype=_Any), y: _wp.array(dtype=_Any), alpha: _Any, beta: _Any):
    i = _wp.tid()
    y[i] = alpha * x[i] + beta * y[i]


def array_axpy(x, y, alpha: float = 1.0, beta: float = 1.0) -> None:
    """Computes y = alpha x + beta y, on the arrays' device; tapes record it.

    Raises:
        ValueError: the arrays differ in shape or device.
    """
    if x.shape != y.shape or x.device != y.device:
        raise ValueError(
            f"expects arrays of one shape and device, but got {x.shape} on '{x.device}' and "
            f"{y.shape} on '{y.device}'"
        )
    scalar = getattr(y.dtype, "_wp_scalar_type_", y.dtype)
    _wp.launch(_axpy, x.shape, [x, y, scalar(alpha), scalar(beta)], device=y.device)


def __getattr__(name):
    if name.startswith("_"):
        raise AttributeError(f"module 'warp.fem.linalg' has no attribute '{name}'")
    return _made.setdefault(name, _absent_class(name, "fem.linalg"))
