"""What is unique of decompositions of matrices: values, and the factors of QR."""

import mpmath as mp

from warp.report.search._numbers import cross, dot, minus, norm, scaled, times, transposed

DECOMPOSITIONS = {}


def reference(function):
    DECOMPOSITIONS[function.__name__.removeprefix("_")] = function
    return function


def _squares_of_values(a):
    return sorted(mp.eigsy(mp.matrix(times(transposed(a), a)), eigvals_only=True), reverse=True)


@reference
def _svd2(a):
    return [mp.sqrt(abs(x)) for x in _squares_of_values(a)]


@reference
def _svd3(a):
    found = [mp.sqrt(abs(x)) for x in _squares_of_values(a)]
    return [*found[:2], -found[2] if mp.det(mp.matrix(a)) < 0 else found[2]]


@reference
def _eig3(a):
    symmetric = [[(a[i][j] + a[j][i]) / 2 for j in range(3)] for i in range(3)]
    return sorted(mp.eigsy(mp.matrix(symmetric), eigvals_only=True), reverse=True)


@reference
def _qr3(a):
    """Q is a rotation; only the last entry on the diagonal of R may be negative."""
    first, second, _ = columns = transposed(a)
    x = scaled(first, 1 / norm(first))
    rest = minus(second, scaled(x, dot(x, second)))
    y = scaled(rest, 1 / norm(rest))
    q = transposed([x, y, cross(x, y)])
    upper = [
        [dot(v, column) if i <= j else mp.mpf(0) for j, column in enumerate(columns)]
        for i, v in enumerate(transposed(q))
    ]
    return q, upper
