"""`wp.func_native` with vectors, matrices and quaternions, and declared again."""

import numpy as np
import pytest

import warp as wp

pytestmark = pytest.mark.usefixtures("native_device")


def array(values, dtype=float, **options):
    return wp.array(values, dtype=dtype, **options)


@wp.func_native(
    """
    wp::vec_t<3, float> twice = x + x;
    return s * wp::vec3(twice[1], twice[2], twice[0]) + wp::dot(x, x) * wp::vec3(1.0f, 0.0f, 0.0f);
    """,
    """
    for (int i = 0; i < 3; ++i) {
      adj_x[(i + 1) % 3] += 2.0f * s * adj_ret[i];
      adj_s += 2.0f * x[(i + 1) % 3] * adj_ret[i];
      adj_x[i] += 2.0f * x[i] * adj_ret[0];
    }
    """,
)
def turned(x: wp.vec3, s: float) -> wp.vec3: ...


@wp.func_native("return wp::mat_t<2, 2, double>(a[1][1], -a[0][1], -a[1][0], q[3]);")
def mixed(a: wp.mat22d, q: wp.quatf) -> wp.mat22d: ...


@wp.kernel
def turns(x: wp.array[wp.vec3], s: wp.array[float], y: wp.array[wp.vec3]):
    i = wp.tid()
    y[i] = turned(x[i], s[i])


@wp.kernel
def mixes(a: wp.array[wp.mat22d], y: wp.array[wp.mat22d]):
    i = wp.tid()
    y[i] = mixed(a[i], wp.quat(0.0, 1.0, 2.0, 3.0))


def test_vectors_and_their_gradients():
    rng = np.random.default_rng(5)
    given, scale, seed = (rng.normal(size=shape) for shape in ((7, 3), 7, (7, 3)))
    x = array(given, wp.vec3, requires_grad=True)
    s = array(scale, requires_grad=True)
    y = wp.zeros(7, dtype=wp.vec3, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(turns, 7, [x, s], [y])
    expected = 2 * scale[:, None] * np.roll(given, -1, axis=1)
    expected[:, 0] += (given**2).sum(axis=1)
    np.testing.assert_allclose(y.numpy(), expected, rtol=1e-5, atol=1e-5)
    tape.backward(grads={y: array(seed, wp.vec3)})
    by_x = 2 * scale[:, None] * np.roll(seed, 1, axis=1) + 2 * given * seed[:, :1]
    by_s = (2 * np.roll(given, -1, axis=1) * seed).sum(axis=1)
    np.testing.assert_allclose(x.grad.numpy(), by_x, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(s.grad.numpy(), by_s, rtol=1e-5, atol=1e-5)


def test_matrices_and_quaternions():
    given = np.arange(8, dtype=np.float64).reshape(2, 2, 2)
    y = wp.zeros(2, dtype=wp.mat22d)
    wp.launch(mixes, 2, [array(given, wp.mat22d)], [y])
    a, b, c, d = given.reshape(2, 4).T
    np.testing.assert_array_equal(y.numpy().reshape(2, 4).T, [d, -b, -c, np.full(2, 3.0)])


def test_code_that_is_declared_again():
    @wp.func_native("y[i] = x[i] + 1.0f;", "")
    def put(x: wp.array[float], y: wp.array[float], i: int): ...

    @wp.kernel
    def puts(x: wp.array[float], y: wp.array[float]):
        put(x, y, wp.tid())

    x, y = array([1.0, 2.0]), wp.zeros(2)
    wp.launch(puts, 2, [x, y])
    np.testing.assert_array_equal(y.numpy(), [2.0, 3.0])

    @wp.func_native("y[i] = x[i] + 2.0f;", "")
    def put(x: wp.array[float], y: wp.array[float], i: int): ...  # noqa: F811

    wp.launch(puts, 2, [x, y])
    np.testing.assert_array_equal(y.numpy(), [3.0, 4.0])
