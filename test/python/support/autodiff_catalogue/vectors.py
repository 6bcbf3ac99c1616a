"""T24 to T31 and T45: norms, components, linear algebra."""

from fractions import Fraction

import numpy as np

import warp as wp

from .problem import kernel, kernel_of
from .registry import case


def of_vectors(p, function):
    """The kernel y[i] = function(v[i]) of three-vectors."""
    R, V = p.real, p.vec3

    @kernel_of(function)
    def unary(v: wp.array(dtype=V), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = function(v[i])

    return unary


def of_pairs(p, function):
    """The kernel y[i] = function(a[i], b[i]) of three-vectors."""
    R, V = p.real, p.vec3

    @kernel_of(function)
    def binary(a: wp.array(dtype=V), b: wp.array(dtype=V), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = function(a[i], b[i])

    return binary


def scales(p):
    """Powers of ten whose squares leave the range of the scalar type, where that is 1e±25."""
    return (1e-25, 1e25) if p.precision == "float32" else (1e-25, 1e25, 1e-200, 1e200)


def unit(v):
    """v / |v| without overflow."""
    v = v / np.abs(v).max(axis=-1, keepdims=True)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@case("T24", "the length of a vector has a unit gradient at every scale, and none at 0")
def lengths(p):
    direction = np.array([[1.0, -2.0, 0.5]])
    cast = np.float32 if p.precision == "float32" else np.float64
    for scale in scales(p):
        v = cast(scale * direction)
        (got,) = p.pullback(of_vectors(p, wp.length), 1, [p.array(v, p.vec3)], [p.zeros(1)])
        p.close(got, unit(v.astype(np.float64)))
    (got,) = p.pullback(of_vectors(p, wp.length), 1, [p.zeros(1, p.vec3)], [p.zeros(1)])
    p.same(got, [[0.0, 0.0, 0.0]])


@case("T25", "the direction of a vector is differentiated at every scale")
def directions(p):
    @wp.func
    def along(w: p.vec3, v: p.vec3):
        return wp.dot(w, wp.normalize(v))

    w = p.random(1, 3)
    cast = np.float32 if p.precision == "float32" else np.float64
    for scale in scales(p):
        v = cast(scale * np.array([[1.0, -2.0, 0.5]]))
        inputs = [p.array(w, p.vec3), p.array(v, p.vec3)]
        dw, dv = p.pullback(of_pairs(p, along), 1, inputs, [p.zeros(1)])
        n = unit(v.astype(np.float64))
        size = scale * np.linalg.norm(v.astype(np.float64) / scale)
        p.close(dw, n)
        p.close(dv * size, w - n * (n @ w.T))


@case("T26", "a component that is assigned twice passes on the last value's gradient")
def component(p):
    R, V = p.real, p.vec3

    @kernel
    def twice(x: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        v = V()
        v[0] = x[i]
        v[0] = v[0] + x[i]
        y[i] = v[0]

    (got,) = p.pullback(twice, 2, [p.array([3.0, 5.0])], [p.zeros(2)])
    p.same(got, [2.0, 2.0])


@case("T27", "a matrix element as an accumulator weighs all terms alike")
def element(p):
    R, M = p.real, p.mat33

    @kernel
    def total(x: wp.array(dtype=R), y: wp.array(dtype=R)):
        m = M()
        for k in range(4):
            m[0, 0] = m[0, 0] + x[k]
        y[wp.tid()] = m[0, 0]

    (got,) = p.pullback(total, 1, [p.array(p.random(4))], [p.zeros(1)])
    p.same(got, np.ones(4))


@case("T28", "components of an array element are stored one by one")
def component_stores(p):
    R, V = p.real, p.vec3

    @kernel
    def spread(x: wp.array(dtype=R), y: wp.array(dtype=V)):
        i = wp.tid()
        y[i].x = R(2.0) * x[i]
        y[i].y = R(3.0) * x[i]

    w = p.random(4, 3)
    (got,) = p.pullback(spread, 4, [p.array(p.random(4))], [p.zeros(4, p.vec3)], [w])
    p.close(got, 2.0 * w[:, 0] + 3.0 * w[:, 1])


@case("T29", "a scalar over a vector is differentiated by both")
def scalar_over_vector(p):
    R, V = p.real, p.vec3

    @kernel
    def over(s: wp.array(dtype=R), v: wp.array(dtype=V), y: wp.array(dtype=V)):
        i = wp.tid()
        y[i] = s[i] / v[i]

    s, v, w = p.random(4), p.random(4, 3), p.random(4, 3)
    ds, dv = p.pullback(over, 4, [p.array(s), p.array(v, p.vec3)], [p.zeros(4, p.vec3)], [w])
    p.close(ds, (w / v).sum(axis=1))
    p.close(dv, -w * s[:, None] / v**2)


@case("T30", "the gradient of a determinant is the cofactor matrix, of a singular matrix too")
def determinant(p):
    R, M = p.real, p.mat33

    @kernel
    def volume(a: wp.array(dtype=M), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = wp.determinant(a[i])

    a = np.array([[[1.0, 2.0, 3.0], [2.0, 1.0, -1.0], [3.0, 3.0, 2.0]]])
    (got,) = p.pullback(volume, 1, [p.array(a, p.mat33)], [p.zeros(1)])
    cofactors = [np.cross(a[0, (i + 1) % 3], a[0, (i + 2) % 3]) for i in range(3)]
    p.close(got, [cofactors])


@case("T31", "a linear system is differentiated by solving the transposed one")
def linear_system(p):
    M, V = p.mat33, p.vec3

    @kernel
    def solve(a: wp.array(dtype=M), b: wp.array(dtype=V), x: wp.array(dtype=V)):
        i = wp.tid()
        x[i] = wp.solve3(a[i], b[i])

    left, _ = np.linalg.qr(p.random(3, 3))
    right, _ = np.linalg.qr(p.random(3, 3))
    a = (left @ np.diag([1.0, 1e-3, 1e-6]) @ right).astype(np.float32).astype(np.float64)
    b, w = p.random(3), p.random(3)
    x, back = exact_solve(a, b), exact_solve(a.T, w)
    inputs = [p.array(a[None], p.mat33), p.array(b[None], p.vec3)]
    p.condition = 1e6
    da, db = p.pullback(solve, 1, inputs, [p.zeros(1, p.vec3)], [w[None]])
    p.near(db, [back], 1e6 * 4 * p.eps)
    p.near(da, [-np.outer(back, x)], 1e6 * 4 * p.eps)


def exact_solve(a, b):
    """The solution of a 3 by 3 system in rational arithmetic, rounded."""
    rows = [[Fraction(v) for v in row] + [Fraction(r)] for row, r in zip(a.tolist(), b.tolist())]
    for k in range(3):
        pivot = max(range(k, 3), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [v / rows[k][k] for v in rows[k]]
        for i in range(3):
            if i != k:
                rows[i] = [v - rows[i][k] * u for v, u in zip(rows[i], rows[k])]
    return np.array([float(row[3]) for row in rows])


@case("T45", "the angle between vectors has finite gradients at 0 and exact ones next to it")
def angles(p):
    a = np.array([[2.0, 0.0, 0.0]])
    inputs = [p.array(a, p.vec3), p.array(1.5 * a, p.vec3)]
    da, db = p.pullback(of_pairs(p, wp.angle_between), 1, inputs, [p.zeros(1)])
    p.holds(np.linalg.norm(da) <= 0.5 * (1.0 + 16 * p.eps), f"got {da} for parallel vectors")
    p.holds(np.linalg.norm(db) <= (1.0 + 16 * p.eps) / 3.0, f"got {db} for parallel vectors")
    b = np.array([[1.0, 1e-6, 0.0]])
    inputs = [p.array(a, p.vec3), p.array(b, p.vec3)]
    da, _ = p.pullback(of_pairs(p, wp.angle_between), 1, inputs, [p.zeros(1)])
    p.close(np.linalg.norm(da), 0.5)
    p.close(da, [[0.0, -0.5, 0.0]])
