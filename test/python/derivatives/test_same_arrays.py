"""One array as several arguments: gradients are those of a kernel with one argument for all."""

import numpy as np
import pytest

import warp as wp
from warp.extend import errors

N = 5
R = wp.float64
X = np.random.default_rng(0).uniform(0.5, 1.5, N)


@wp.kernel
def powers(x: wp.array(dtype=R), square: wp.array(dtype=R), cube: wp.array(dtype=R)):
    i = wp.tid()
    v = x[i]
    cube[i] = v * v * v
    square[i] = v * v


@wp.kernel
def product(a: wp.array(dtype=R), b: wp.array(dtype=R), c: wp.array(dtype=R), d: wp.array(dtype=R)):
    i = wp.tid()
    u, v = a[i], b[i]
    c[i] = u * v
    d[i] = u * u * v


@wp.kernel
def written_first(x: wp.array(dtype=R), y: wp.array(dtype=R), z: wp.array(dtype=R)):
    i = wp.tid()
    y[i] = x[i] * x[i]
    v = x[i]
    z[i] = v * v


@wp.kernel
def chosen(x: wp.array(dtype=R), y: wp.array(dtype=R), z: wp.array(dtype=R)):
    i = wp.tid()
    v = x[i]
    if v > R(1.0):
        y[i] = v * v
    z[i] = v * v * v


@wp.kernel
def added(x: wp.array(dtype=R), y: wp.array(dtype=R)):
    i = wp.tid()
    wp.atomic_add(y, i, x[i] * x[i])


@wp.kernel
def scaled_rows(x: wp.array2d(dtype=R), y: wp.array2d(dtype=R)):
    i = wp.tid()
    total = R(0.0)
    for k in range(x.shape[1]):
        total += x[i, k] * x[i, k]
    for k in range(x.shape[1]):
        y[i, k] = x[i, k] * total


@wp.kernel
def turned(x: wp.array2d(dtype=wp.vec3d), y: wp.array2d(dtype=wp.vec3d), z: wp.array2d(dtype=R)):
    i, j = wp.tid()
    v = x[i, j]
    z[i, j] = wp.dot(v, v)
    y[i, j] = wp.cross(v, wp.vec3d(R(1.0), R(2.0), R(3.0)))


@wp.kernel
def next_one(x: wp.array(dtype=R), y: wp.array(dtype=R)):
    i = wp.tid()
    y[i] = x[i + 1] * x[i + 1]


def real(values, device, dtype=R):
    return wp.array(values, dtype=dtype, requires_grad=True, device=device)


def backward(record, seeds, **options):
    with wp.Tape(**options) as tape:
        record()
    tape.backward(grads=seeds)


def check(found, expected):
    np.testing.assert_allclose(found.grad.numpy(), expected, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("is_view", [False, True])
def test_two_names(device, is_view):
    x, z = real(X, device), real(np.zeros(N), device)
    names = (x[:], x[:]) if is_view else (x, x)
    seeds = {z: real(np.ones(N), device), x: real(np.full(N, 2.0), device)}
    backward(lambda: wp.launch(powers, N, [*names, z], device=device), seeds)
    assert np.array_equal(x.numpy(), X * X)
    check(x, 3.0 * X**2 + 4.0 * X)


def test_three_names(device):
    x, z = real(X, device), real(np.zeros(N), device)
    seeds = {z: real(np.ones(N), device), x: real(np.full(N, 2.0), device)}
    backward(lambda: wp.launch(product, N, [x, x, x, z], device=device), seeds)
    check(x, 3.0 * X**2 + 4.0 * X)


def test_two_outputs_are_one(device):
    """The last of two values stored to one element counts."""
    x, y = real(X, device), real(np.zeros(N), device)
    backward(lambda: wp.launch(powers, N, [x, y, y], device=device), {y: real(np.ones(N), device)})
    check(x, 2.0 * X)


def test_read_again_after_the_write(device):
    x, z = real(X, device), real(np.zeros(N), device)
    run = lambda: wp.launch(written_first, N, [x, x, z], device=device)  # noqa: E731
    backward(run, {z: real(np.ones(N), device)})
    np.testing.assert_allclose(z.numpy(), X**4, rtol=1e-14)
    check(x, 4.0 * X**3)


def test_some_threads_write(device):
    x, z = real(X, device), real(np.zeros(N), device)
    seeds = {z: real(np.ones(N), device), x: real(np.full(N, 2.0), device)}
    backward(lambda: wp.launch(chosen, N, [x, x, z], device=device), seeds)
    check(x, 3.0 * X**2 + np.where(X > 1.0, 4.0 * X, 2.0))


def test_atomic_addition(device):
    x = real(X, device)
    backward(lambda: wp.launch(added, N, [x, x], device=device), {x: real(np.ones(N), device)})
    check(x, 1.0 + 2.0 * X)


def test_rows(device):
    values, seed = np.random.default_rng(1).uniform(-1.0, 1.0, (2, 3, 4))
    x = real(values, device)
    run = lambda: wp.launch(scaled_rows, 3, [x, x], device=device)  # noqa: E731
    backward(run, {x: real(seed, device)})
    total = np.sum(values**2, axis=1, keepdims=True)
    check(x, seed * total + 2.0 * values * np.sum(seed * values, axis=1, keepdims=True))


def test_two_dimensions_of_vectors(device):
    values, seed = np.random.default_rng(2).uniform(-1.0, 1.0, (2, 3, 4, 3))
    x, z = real(values, device, wp.vec3d), real(np.zeros((3, 4)), device)
    seeds = {z: real(np.ones((3, 4)), device), x: real(seed, device, wp.vec3d)}
    backward(lambda: wp.launch(turned, (3, 4), [x, x, z], device=device), seeds)
    check(x, 2.0 * values + np.cross([1.0, 2.0, 3.0], seed))


def test_what_another_thread_writes_is_refused(device):
    x = real(X, device)
    with pytest.raises(
        errors.WarpError, match=r"'x' is read here, and other threads .* may write"
    ) as found:
        backward(
            lambda: wp.launch(next_one, N - 1, [x, x], device=device),
            {x: real(np.ones(N), device)},
        )
    assert "arguments 'x', 'y' are one array" in str(found.value)


def test_views_that_overlap_are_refused(device):
    x, z = real(X, device), real(np.zeros(N), device)
    with pytest.raises(errors.WarpGradientError, match="'square', which is written, and 'x'"):
        backward(
            lambda: wp.launch(powers, N - 1, [x[1:], x[:-1], z], device=device),
            {z: real(np.ones(N), device)},
        )


@wp.kernel
def counted(
    ids: wp.array(dtype=int), left: wp.array(dtype=int), x: wp.array(dtype=R), y: wp.array(dtype=R)
):
    i = wp.tid()
    if ids[i] > 3:
        left[i] = i
    y[i] = x[i] * x[i]


def test_what_no_gradient_depends_on_may_overlap(device):
    x, y = real(X, device), real(np.zeros(N), device)
    ids = wp.array([1, 2, 3, 4, 5, 6], dtype=int, device=device)
    run = lambda: wp.launch(counted, N, [ids[1:], ids[:-1], x, y], device=device)  # noqa: E731
    backward(run, {y: real(np.ones(N), device)})
    check(x, 2.0 * X)
