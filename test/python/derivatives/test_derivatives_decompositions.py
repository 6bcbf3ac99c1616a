"""Derivatives of decompositions where values repeat, against differences and by hand."""

import numpy as np
import pytest

import warp as wp

PRECISE = [(wp.float32, 2e-5), (wp.float64, 1e-13)]
EYE = np.eye(3)
W = np.array([[0.3, -1.2, 0.7], [0.4, 0.9, -0.5], [1.1, 0.2, -0.8]])


@pytest.fixture(autouse=True)
def quiet(monkeypatch):
    monkeypatch.setattr(wp.config, "quiet", True)


def rotation(seed=1):
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


def symmetric(values, seed=2):
    q = rotation(seed)
    return q * np.array(values) @ q.T


def gradient(function, a, weights, dtype):
    """The derivative of the sum of the entries of function(a), each times its weight."""
    mat = wp.types.matrix((3, 3), dtype)

    @wp.kernel
    def apply(a: wp.array(dtype=mat), y: wp.array(dtype=mat)):
        y[0] = function(a[0])

    x = wp.array(np.asarray(a)[None], dtype=mat, requires_grad=True)
    y = wp.zeros(1, dtype=mat, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(apply, dim=1, inputs=[x], outputs=[y])
    tape.backward(grads={y: wp.array(np.asarray(weights)[None], dtype=mat)})
    return x.grad.numpy()[0].astype(np.float64)


def frechet(f, slope, a, weights):
    """The same for a function of a symmetric matrix, by divided differences in float64."""
    d, q = np.linalg.eigh(a)
    gap = d[:, None] - d[None, :]
    close = np.abs(gap) < 1e-6
    quotient = (f(d)[:, None] - f(d)[None, :]) / np.where(close, 1.0, gap)
    middle = 0.5 * (d[:, None] + d[None, :])
    scale = np.where(close, slope(middle), quotient)
    return q @ (scale * (q.T @ (0.5 * (weights + weights.T)) @ q)) @ q.T


def polar_part(dtype):
    mat = wp.types.matrix((3, 3), dtype)

    @wp.func
    def part(a: mat):
        r, s = wp.polar(a)
        return r

    return part


def turned(a, weights):
    """By the linear system that the turn of the polar factor solves, in float64."""
    u, s, vt = np.linalg.svd(a)
    r = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    stretch = r.T @ a
    k = r.T @ weights
    axial = np.array([k[2, 1] - k[1, 2], k[0, 2] - k[2, 0], k[1, 0] - k[0, 1]])
    x, y, z = np.linalg.solve(np.trace(stretch) * EYE - stretch, axial)
    return r @ np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


MATRICES = [
    *(EYE, rotation(), np.diag([2.0, 2, 1]), rotation() @ symmetric([2, 1, 1])),
    *(EYE + 1e-4 * W, W.T, -W.T),
]


@pytest.mark.parametrize("dtype, tolerance", PRECISE)
@pytest.mark.parametrize("scale", [1e-20, 1e-4, 1.0, 1e15])
@pytest.mark.parametrize("a", MATRICES)
def test_polar(dtype, tolerance, scale, a):
    a = np.asarray(scale * a, np.float32).astype(np.float64)
    expected = turned(a, W)
    got = gradient(polar_part(dtype), a, W, dtype)
    assert np.abs(got - expected).max() <= 4 * tolerance * np.abs(expected).max()


@pytest.mark.parametrize("dtype, tolerance", PRECISE)
@pytest.mark.parametrize("a", [EYE, rotation(), rotation() @ symmetric([2, 2, 1])])
def test_polar_factor_by_singular_values(dtype, tolerance, a):
    mat = wp.types.matrix((3, 3), dtype)

    @wp.func
    def part(a: mat):
        u, s, v = wp.svd3(a)
        return u * wp.transpose(v)

    got = gradient(part, a, W, dtype)
    np.testing.assert_allclose(got, turned(a, W), atol=20 * tolerance)


@pytest.mark.parametrize("dtype, tolerance", PRECISE)
@pytest.mark.parametrize("values", [(1, 1, 1), (2, 2, 1), (2, 1, -0.5), (3, 2, 1)])
def test_sum_of_singular_values(dtype, tolerance, values):
    mat = wp.types.matrix((3, 3), dtype)

    @wp.func
    def total(a: mat):
        u, s, v = wp.svd3(a)
        return mat(s[0] + s[1] + s[2])

    left, right = rotation(3), rotation(4)
    got = gradient(total, left * np.array(values) @ right, np.diag([1.0, 0, 0]), dtype)
    np.testing.assert_allclose(got, left @ right, atol=8 * tolerance)


@pytest.mark.parametrize("dtype, tolerance", PRECISE)
@pytest.mark.parametrize("values", [(1, 1, 1), (2, 2, 1), (3, 2, 1), (1, 0, 0)])
def test_sum_of_powers_of_eigenvalues(dtype, tolerance, values):
    mat = wp.types.matrix((3, 3), dtype)

    @wp.func
    def total(a: mat):
        q, d = wp.eig3(a)
        return mat(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])

    a = symmetric(values)
    got = gradient(total, a, np.diag([1.0, 0, 0]), dtype)
    np.testing.assert_allclose(got, 2 * a, atol=8 * tolerance)


FUNCTIONS = {
    "sqrt": (np.sqrt, lambda x: 0.5 / np.sqrt(x)),
    "log": (np.log, lambda x: 1 / x),
    "exp": (np.exp, np.exp),
}


@pytest.mark.parametrize("dtype, tolerance", PRECISE)
@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("values", [(2, 2, 2), (2, 2, 1), (1, 1 + 1e-3, 3), (0.5, 1, 4)])
def test_functions_of_symmetric_matrices(dtype, tolerance, name, values):
    a = np.asarray(symmetric(values), np.float32).astype(np.float64)
    a = 0.5 * (a + a.T)
    f, slope = FUNCTIONS[name]
    expected = frechet(f, slope, a, W)
    got = gradient(getattr(wp, f"sym_{name}3"), a, W, dtype)
    # The reference itself is good to 1e-10.
    limit = max(4 * tolerance, 1e-9) * np.abs(expected).max()
    assert np.abs(got - expected).max() <= limit

    mat, builtin = wp.types.matrix((3, 3), dtype), getattr(wp, name)

    @wp.func
    def any_function(a: mat):
        return wp.sym_fn3(a, builtin)

    got = gradient(any_function, a, W, dtype)
    assert np.abs(got - expected).max() <= limit


def test_function_of_the_user():
    @wp.func
    def cube(x: wp.float64):
        return x * x * x

    @wp.func
    def cubed(a: wp.mat33d):
        return wp.sym_fn3(a, cube)

    a = symmetric([2, 2, 1])
    np.testing.assert_allclose(
        gradient(cubed, a, W, wp.float64),
        frechet(lambda x: x**3, lambda x: 3 * x**2, a, W), atol=1e-9,
    )  # fmt: skip
    cold = wp.sym_fn3(wp.mat33(*a.flatten()), lambda x: x * x)
    np.testing.assert_allclose(np.array(list(map(list, cold))), a @ a, rtol=1e-5, atol=1e-6)


def test_only_functions_can_be_applied():
    @wp.kernel
    def apply(a: wp.array(dtype=wp.mat33)):
        a[0] = wp.sym_fn3(a[0], 2.0)

    with pytest.raises(wp.WarpCodegenTypeError, match="builtin or a `@wp.func`"):
        wp.launch(apply, dim=1, inputs=[wp.zeros(1, dtype=wp.mat33)])


def test_singular_vector_of_repeated_value_follows_the_policy(monkeypatch):
    @wp.func
    def left(a: wp.mat33d):
        u, s, v = wp.svd3(a)
        return u

    monkeypatch.setattr(wp.config, "singular", "pinned")
    np.testing.assert_array_equal(gradient(left, EYE, W, wp.float64), np.zeros((3, 3)))
    monkeypatch.setattr(wp.config, "singular", "strict")
    assert np.isnan(gradient(left, EYE, W, wp.float64)).any()


@wp.kernel
def stretch_energy(a: wp.array(dtype=wp.mat33d), e: wp.array(dtype=wp.float64)):
    _, s, _ = wp.svd3(a[0])
    for i in range(3):
        e[0] += (s[i] - wp.float64(1.0)) ** wp.float64(2.0)


def second_derivative(values, along):
    a = wp.array(np.diag(values)[None], dtype=wp.mat33d, device="cpu", requires_grad=True)

    def energy(a):
        e = wp.zeros(1, dtype=wp.float64, device="cpu", requires_grad=True)
        wp.launch(stretch_energy, 1, [a], [e], device="cpu")
        return e

    directions = [wp.array(along[None], dtype=wp.mat33d, device="cpu")]
    return wp.autograd.hvp(energy, [a], directions).numpy()[0]


# The energy is |A|^2 - 2 tr S + 3, and d tr S = tr(R' dA). It is smooth where singular values
# repeat, and not where they differ only in sign: there it is said, not zero in silence.
def test_second_derivatives_where_singular_values_repeat(capsys):
    along = np.random.default_rng(3).normal(size=(3, 3))
    for values in ((3.0, 2.0, 1.0), (1.0, 1.0, 1.0), (2.0, 1.0, 1.0)):
        found = second_derivative(values, along)
        # d R of a diagonal matrix: w_ij = (v_ij - v_ji) / (s_i + s_j).
        s = np.array(values)
        turn = (along - along.T) / (s[:, None] + s[None, :])
        np.testing.assert_allclose(found, 2 * along - 2 * turn, atol=1e-12)
    assert "singular values" not in capsys.readouterr().out
    second_derivative((2.0, 1.0, -1.0), along)
    said = capsys.readouterr().out
    assert "test_derivatives_decompositions.py:" in said
    assert "met 1 time" in said
