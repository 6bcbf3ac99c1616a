"""`wp.sym_fn3(A, f)`: a function of one float, applied to a symmetric matrix.

In kernels `f` may be a builtin or a `@wp.func`. A function is made for each `f` that applies it to
the eigenvalues. For the derivative it adds the divided differences of `f`, which also make sense
where eigenvalues repeat; a launch that is not differentiated does not compute them.
"""

from __future__ import annotations

import math

from warp._src.derivatives.functions import grad
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.dtypes import Float, matrix

_Symmetric = matrix((3, 3), Float)
# Where two eigenvalues differ by less than this part of their sum, the difference of their
# functions has lost digits.
_CLOSE = 0.01
# Gauss's rule with three points in [-1, 1], one of them 0.
_HALF_NODE = math.sqrt(0.15)
_made: dict = {}


def sym_fn3(A, f):
    """Q diag(f(d)) Q^T, where A = Q diag(d) Q^T is symmetric."""
    _, d = wp.eig3(A)
    values = type(d)(*(f(x) for x in d))
    return wp.sym_spectral3(A, values, type(d)())


def matrix_function(f) -> Function:
    """The kernel function that applies `f`, a builtin or a function, to a symmetric matrix."""
    found = _made.get(f)
    if found is None:
        found = _made[f] = Function(_define(f), "sym_fn3")
    return found


def _define(f):
    slope = Function(_define_slope(f), "divided_difference")

    def apply(A: _Symmetric):
        _, d = wp.eig3(A)
        values = wp.vector(f(d[0]), f(d[1]), f(d[2]))
        slopes = wp.vector(slope(d[1], d[2]), slope(d[0], d[2]), slope(d[0], d[1]))
        return wp.sym_spectral3(A, values, slopes)

    return apply


def _define_slope(f):
    """(f(x) - f(y)) / (x - y); for close arguments the mean of the derivative between them."""

    def slope(x: Float, y: Float):
        gap = x - y
        result = type(x)(0.0)
        if gap > type(x)(_CLOSE) * (wp.abs(x) + wp.abs(y)):
            result = (f(x) - f(y)) / gap
        else:
            middle = y + type(x)(0.5) * gap
            reach = type(x)(_HALF_NODE) * gap
            ends = grad(f)(middle - reach) + grad(f)(middle + reach)
            result = (type(x)(5.0) * ends + type(x)(8.0) * grad(f)(middle)) / type(x)(18.0)
        return result

    return slope
