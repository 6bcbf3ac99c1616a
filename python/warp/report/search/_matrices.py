"""Matrices: inverses, systems, functions of symmetric ones, what is unique of decompositions."""

import mpmath as mp

from warp.report.search._numbers import cross, dot, minus, norm, scaled, times, transposed

MATRICES = {}


def reference(function):
    MATRICES[function.__name__.removeprefix("_")] = function
    return function


@reference
def _inverse(a):
    return mp.inverse(mp.matrix(a)).tolist()


def _solve(a, b):
    return list(mp.lu_solve(mp.matrix(a), mp.matrix(b)))


MATRICES["inverse_approx"] = _inverse
MATRICES |= dict.fromkeys(("solve2", "solve3", "solve4"), _solve)


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


def _spectral(function):
    def apply(a):
        symmetric = [[(a[i][j] + a[j][i]) / 2 for j in range(3)] for i in range(3)]
        values, vectors = mp.eigsy(mp.matrix(symmetric))
        scaled_columns = vectors * mp.diag([function(x) for x in values])
        return (scaled_columns * vectors.T).tolist()

    return apply


for _name, _function in (("sym_exp3", mp.exp), ("sym_log3", mp.log), ("sym_sqrt3", mp.sqrt)):
    MATRICES[_name] = _spectral(_function)
