"""Products of a decomposition's vectors and functions of its values, where values repeat.

`u * diag(f(s)) * transpose(v)` is a smooth function of the matrix there, too. Gradients are held
against differences with 100 digits, whose steps separate the values.
"""

import mpmath as mp
import numpy as np
import pytest

import warp as wp

RNG = np.random.default_rng(3)
W = RNG.normal(size=(3, 3))
TURN = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
TURN *= np.linalg.det(TURN)
OTHER = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
OTHER *= np.linalg.det(OTHER)


@wp.func
def stress(a: wp.mat33d):
    u, s, v = wp.svd3(a)
    return u * wp.diag(wp.cw_mul(s, s)) * wp.transpose(v)


@wp.func
def stress_by_entries(a: wp.mat33d):
    """The other order of products, a matrix written out, and a part that all values share."""
    u, s, v = wp.svd3(a)
    j = s[0] * s[1] * s[2]
    zero = wp.float64(0.0)
    x, y, z = s[0] * s[0] + j, s[1] * s[1] + j, s[2] * s[2] + j
    return u * (wp.mat33d(x, zero, zero, zero, y, zero, zero, zero, z) * wp.transpose(v))


@wp.func
def left_logarithm(a: wp.mat33d):
    u, s, v = wp.svd3(a)
    e = wp.vec3d(wp.log(s[0]), wp.log(s[1]), wp.log(s[2]))
    return u * wp.diag(e) * wp.transpose(u)


@wp.func
def right_exponential(a: wp.mat33d):
    u, s, v = wp.svd3(a)
    e = wp.vec3d(wp.exp(s[0]), wp.exp(s[1]), wp.exp(s[2]))
    return v * wp.diag(e) * wp.transpose(v)


@wp.func
def logarithm(a: wp.mat33d):
    q, d = wp.eig3(a)
    return q * wp.diag(wp.vec3d(wp.log(d[0]), wp.log(d[1]), wp.log(d[2]))) * wp.transpose(q)


@wp.func
def piece(x: wp.float64):
    """Branches and a choice; no value of the tests is where pieces meet."""
    y = wp.exp(x)
    if x > wp.float64(2.2):
        y = wp.log(x)
    elif x > wp.float64(0.7):
        y = x * x * x
        if x > wp.float64(1.5):
            y = y + x
    return wp.where(x > wp.float64(2.7), y + x, y - x)


@wp.func
def by_pieces(a: wp.mat33d):
    u, s, v = wp.svd3(a)
    return u * wp.diag(wp.vec3d(piece(s[0]), piece(s[1]), piece(s[2]))) * wp.transpose(v)


@wp.func
def sum_over_columns(a: wp.mat33d):
    u, s, v = wp.svd3(a)
    result = wp.mat33d()
    for k in range(3):
        left = wp.vec3d(u[0, k], u[1, k], u[2, k])
        result += s[k] * s[k] * wp.outer(left, v[:, k])
    return result


@wp.func
def sum_beside_others(a: wp.mat33d):
    """Factors at vectors, and terms that are none of the decomposition's."""
    q, d = wp.eig3(a)
    rows = wp.transpose(q)
    result = a * wp.float64(0.25) + wp.outer(wp.log(d[0]) * rows[0], rows[0])
    result += wp.outer(rows[1], rows[1] * wp.log(d[1]))
    return result + wp.outer(q[:, 2], q[:, 2]) * wp.log(d[2])


@wp.func
def sum_by_entries(a: wp.mat33d):
    """Factors in all orders, one of which is the same for all columns."""
    u, s, v = wp.svd3(a)
    square = wp.vec3d()
    result = wp.mat33d()
    for k in range(3):
        square[k] = s[k] * s[k]
    for i in range(3):
        for j in range(3):
            for k in range(3):
                result[i, j] += (u[i, k] * wp.float64(0.5)) * square[k] * v[j, k]
    return wp.float64(2.0) * result


@wp.func
def left_logarithm_by_entries(a: wp.mat33d):
    u, s, v = wp.svd3(a)
    result = wp.mat33d()
    for i in range(3):
        for j in range(3):
            for k in range(2, -1, -1):
                result[i, j] = u[j, k] * (wp.log(s[k]) * u[i, k]) + result[i, j]
    return result


@wp.struct
class Factors:
    u: wp.mat33d
    s: wp.vec3d
    v: wp.mat33d


@wp.func
def factorize(a: wp.mat33d):
    factors = Factors()
    u, s, v = wp.svd3(a)
    factors.u = u
    factors.s = s
    factors.v = v
    return factors


@wp.func
def stress_by_memory(a: wp.mat33d):
    """Factors that go through a struct and an array of the thread's own."""
    factors = factorize(a)
    rotations = wp.zeros(shape=2, dtype=wp.mat33d)
    rotations[0] = factors.u
    rotations[1] = factors.v
    square = wp.zeros(shape=3, dtype=wp.float64)
    for k in range(3):
        square[k] = factors.s[k] * factors.s[k]
    diagonal = wp.diag(wp.vec3d(square[0], square[1], square[2]))
    return rotations[0] * diagonal * wp.transpose(rotations[1])


@wp.func
def stress_of_2(a: wp.mat22d):
    u, s, v = wp.svd2(a)
    return u * wp.diag(wp.cw_mul(s, s)) * wp.transpose(v)


def of_symmetric(m, function):
    values, vectors = mp.eigsy(m)
    return vectors * mp.diag([function(x) for x in values]) * vectors.T


def exact_piece(x):
    y = mp.exp(x)
    if x > 2.2:
        y = mp.log(x)
    elif x > 0.7:
        y = x**3 + (x if x > 1.5 else 0)
    return y + x if x > 2.7 else y - x


def root(m):
    return of_symmetric(m, mp.sqrt)


EXACT = {
    stress: lambda a: a * root(a.T * a),
    stress_by_entries: lambda a: (
        a * root(a.T * a) + mp.det(a) * a * of_symmetric(a.T * a, lambda x: 1 / mp.sqrt(x))
    ),
    left_logarithm: lambda a: of_symmetric(a * a.T, lambda x: mp.log(x) / 2),
    right_exponential: lambda a: of_symmetric(a.T * a, lambda x: mp.exp(mp.sqrt(x))),
    logarithm: lambda a: of_symmetric((a + a.T) / 2, mp.log),
    by_pieces: lambda a: a * of_symmetric(a.T * a, lambda x: exact_piece(mp.sqrt(x)) / mp.sqrt(x)),
    sum_over_columns: lambda a: a * root(a.T * a),
    sum_by_entries: lambda a: a * root(a.T * a),
    left_logarithm_by_entries: lambda a: of_symmetric(a * a.T, lambda x: mp.log(x) / 2),
    stress_by_memory: lambda a: a * root(a.T * a),
    sum_beside_others: lambda a: of_symmetric((a + a.T) / 2, mp.log) + a / 4,
    stress_of_2: lambda a: a * root(a.T * a),
}

VALUES = {
    "the identity": (1.0, 1.0, 1.0),
    "a multiple of it": (2.5, 2.5, 2.5),
    "the upper two": (2.0, 2.0, 1.0),
    "the lower two": (2.0, 1.0, 1.0),
    "nearly all": (1.0, 1.0 - 1e-9, 1.0 - 2e-7),
    "nearly two": (1.0 + 3e-14, 1.0, 0.5),
    "hardly": (1.0, 1.0 - 4e-6, 1.0 - 1e-5),
    "none": (3.0, 2.0, 1.0),
}


def exact_gradient(function, a):
    """The gradient of the sum of products with entries of W."""
    with mp.workdps(100):
        step, n = mp.mpf(10) ** -25, len(a)
        base, result = mp.matrix(a.tolist()), np.zeros((n, n))
        for i in range(n):
            for j in range(n):
                total = mp.mpf(0)
                for sign in (1, -1):
                    moved = base.copy()
                    moved[i, j] += sign * step
                    value = function(moved)
                    total += sign * sum(
                        mp.mpf(W[k, m]) * value[k, m] for k in range(n) for m in range(n)
                    )
                result[i, j] = total / (2 * step)
        return result


def gradient(function, a, device, dtype=None):
    dtype = dtype or (wp.mat33d if len(a) == 3 else wp.mat22d)

    @wp.kernel(module="unique")
    def evaluate(
        a: wp.array(dtype=dtype),
        w: wp.array(dtype=dtype),
        y: wp.array(dtype=dtype._wp_scalar_type_),
    ):
        i = wp.tid()
        y[i] = wp.ddot(w[i], function(a[i]))

    kind = dtype._wp_scalar_type_
    w = wp.array(W[: len(a), : len(a)][None], dtype=dtype, device=device)
    a = wp.array(a[None], dtype=dtype, requires_grad=True, device=device)
    y = wp.zeros(1, dtype=kind, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(evaluate, 1, [a, w], [y], device=device)
    tape.backward(grads={y: wp.ones_like(y)})
    return a.grad.numpy()[0]


def matrix_of(function, values):
    if function is stress_of_2:
        return np.diag(values[:2]) @ np.array([[0.6, 0.8], [-0.8, 0.6]])
    turned = TURN @ np.diag(values)
    return turned @ (TURN.T if function in (logarithm, sum_beside_others) else OTHER.T)


@pytest.mark.parametrize("name", VALUES)
@pytest.mark.parametrize("function", EXACT, ids=lambda f: f.key)
def test_gradients_are_right_where_values_repeat(device, function, name, monkeypatch, capfd):
    monkeypatch.setattr(wp.config, "singular", "report")
    a = matrix_of(function, VALUES[name])
    if name == "the identity" and function is not stress_of_2:
        a = np.eye(3)
    found = gradient(function, a, device)
    exact = exact_gradient(EXACT[function], a)
    np.testing.assert_allclose(found, exact, rtol=0, atol=2e-10 * np.abs(exact).max())
    assert ".py:" not in capfd.readouterr().out


def test_shear_at_rest(device):
    """Where no cotangent of the values tells anything: one entry beside the diagonal."""

    @wp.func
    def shear(a: wp.mat33d):
        return wp.mat33d(wp.float64(0.0)) + wp.cw_mul(
            stress(a), wp.static(wp.mat33d(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        )

    found = gradient(shear, np.eye(3), device)
    # d (A (A^T A)^(1/2)) at the identity is dA + (dA + dA^T) / 2.
    exact = np.zeros((3, 3))
    exact[0, 1], exact[1, 0] = 1.5 * W[0, 1], 0.5 * W[0, 1]
    np.testing.assert_allclose(found, exact, atol=1e-14)


@pytest.mark.parametrize("gap", [0.0, 1e-6, 1e-4, 2e-3, 6e-3])
def test_single_precision_close_to_rest(device, gap):
    @wp.func
    def single(a: wp.mat33):
        u, s, v = wp.svd3(a)
        return u * wp.diag(wp.cw_mul(s, s)) * wp.transpose(v)

    a = (TURN @ np.diag([1.0 + gap, 1.0, 1.0 - gap]) @ OTHER.T).astype(np.float32)
    found = gradient(single, a, device, wp.mat33)
    exact = exact_gradient(EXACT[stress], a.astype(np.float64))
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-4 * np.abs(exact).max())


@wp.func
def power16(x: wp.float64):
    a = x * x
    b = a * a
    c = b * b
    return c * c


@wp.func
def power65536(x: wp.float64):
    return power16(power16(power16(power16(x))))


def test_entries_that_share_factors_many_times(device):
    """A product with 2^40 factors, made by 40 operations, is no sum over columns."""

    @wp.kernel(module="unique")
    def program(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.mat33d)):
        i = wp.tid()
        p = power65536(power65536(power16(power16(x[i]))))
        zero = wp.float64(0.0)
        y[i] = wp.mat33d(p, zero, zero, zero, p, zero, zero, zero, p)

    x = wp.ones(1, dtype=wp.float64, device=device, requires_grad=True)
    y = wp.zeros(1, dtype=wp.mat33d, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(program, 1, [x, y], device=device)
    tape.backward(grads={y: wp.array(np.eye(3)[None], dtype=wp.mat33d, device=device)})
    assert x.grad.numpy()[0] == 3.0 * 2.0**40
