"""A user's own adjoint around functions of tiles goes before theirs; gradients can be stopped."""

from typing import Any

import numpy as np
import pytest

import warp as wp

Matrix, Vector = wp.array2d(dtype=float), wp.array(dtype=float)
A = np.random.default_rng(0).normal(size=(4, 4))
A = (A @ A.T + 4.0 * np.eye(4)).astype(np.float32)


@wp.func
def factor_of_arrays(h: Matrix, r: Vector, lower: Matrix):
    tile, added = wp.tile_load(h, shape=(4, 4)), wp.tile_load(r, shape=4)
    wp.tile_store(lower, wp.tile_cholesky(wp.tile_diag_add(tile, added)))


@wp.func_grad(factor_of_arrays)
def no_gradient_of_arrays(h: Matrix, r: Vector, lower: Matrix):
    pass


@wp.kernel
def by_arrays(h: Matrix, r: Vector, lower: Matrix):
    i = wp.tid()
    factor_of_arrays(h, r, lower)


@wp.func
def factor(h: Any, r: Any):
    return wp.tile_cholesky(wp.tile_diag_add(h, r))


@wp.func_grad(factor)
def no_gradient(h: Any, r: Any, adj_ret: Any):
    pass


@wp.kernel
def by_tiles(h: Matrix, r: Vector, lower: Matrix):
    i = wp.tid()
    made = factor(wp.tile_load(h, shape=(4, 4)), wp.tile_load(r, shape=4))
    wp.tile_store(lower, made)


@wp.func
def factor_with_adjoint(h: wp.tile(dtype=float, shape=(4, 4)), r: wp.tile(dtype=float, shape=(4,))):
    return wp.tile_cholesky(wp.tile_diag_add(h, r))


@wp.func_grad(factor_with_adjoint)
def straight_through(
    h: wp.tile(dtype=float, shape=(4, 4)),
    r: wp.tile(dtype=float, shape=(4,)),
    adj_ret: wp.tile(dtype=float, shape=(4, 4)),
):
    wp.adjoint[h] += adj_ret


@wp.kernel
def by_own_adjoint(h: Matrix, r: Vector, lower: Matrix):
    i = wp.tid()
    made = factor_with_adjoint(wp.tile_load(h, shape=(4, 4)), wp.tile_load(r, shape=4))
    wp.tile_store(lower, made)


@wp.kernel
def stopped(h: Matrix, r: Vector, lower: Matrix):
    i = wp.tid()
    tile = wp.stop_gradient(wp.tile_load(h, shape=(4, 4)))
    wp.tile_store(lower, wp.tile_cholesky(wp.tile_diag_add(tile, wp.tile_load(r, shape=4))))


@wp.kernel
def plain(h: Matrix, r: Vector, lower: Matrix):
    i = wp.tid()
    tile, added = wp.tile_load(h, shape=(4, 4)), wp.tile_load(r, shape=4)
    wp.tile_store(lower, wp.tile_cholesky(wp.tile_diag_add(tile, added)))


def gradients(kernel, device):
    h = wp.array(A, dtype=float, requires_grad=True, device=device)
    r = wp.array(np.ones(4), dtype=float, requires_grad=True, device=device)
    lower = wp.zeros((4, 4), dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch_tiled(kernel, [1], [h, r], [lower], block_dim=64, device=device)
    tape.backward(grads={lower: wp.ones((4, 4), dtype=float, device=device)})
    exact = np.linalg.cholesky(A + np.eye(4))
    np.testing.assert_allclose(np.tril(lower.numpy()), exact, rtol=1e-5, atol=1e-6)
    return h.grad.numpy(), r.grad.numpy()


def differences():
    """The gradient of the sum of the factor, by each diagonal element, in float64."""

    def total(i, step):
        matrix = A.astype(np.float64) + np.eye(4)
        matrix[i, i] += step
        return np.sum(np.linalg.cholesky(matrix))

    return [(total(i, 1e-5) - total(i, -1e-5)) / 2e-5 for i in range(4)]


@pytest.mark.parametrize("kernel", [by_arrays, by_tiles])
def test_an_adjoint_that_gives_nothing(kernel, device):
    h, r = gradients(kernel, device)
    assert not h.any() and not r.any()


def test_an_own_adjoint(device):
    h, r = gradients(by_own_adjoint, device)
    assert (h == 1.0).all() and not r.any()


def test_a_tile_without_gradient(device):
    h, r = gradients(stopped, device)
    assert not h.any()
    np.testing.assert_allclose(r, differences(), rtol=1e-4)


def test_the_setting(device):
    """Exact gradients, but for programs whose own adjoints count on none."""
    h, r = gradients(plain, device)
    np.testing.assert_allclose(r, differences(), rtol=1e-4)
    np.testing.assert_allclose(np.diag(h), r, rtol=1e-5)
    try:
        wp.config.peer_tile_gradients = True
        h, r = gradients(plain, device)
    finally:
        wp.config.peer_tile_gradients = False
    assert not h.any() and not r.any()
    np.testing.assert_allclose(gradients(plain, device)[1], differences(), rtol=1e-4)


@wp.kernel
def others(x: Vector, out: Vector):
    i = wp.tid()
    t = wp.tile_load(x, shape=4)
    wp.tile_store(out, wp.tile_min(t), offset=0)
    wp.tile_store(out, wp.tile_max(t), offset=1)
    wp.tile_store(out, wp.tile_reduce(wp.add, t), offset=2)
    wp.tile_store(out, wp.tile_scan_inclusive(t), offset=3)
    wp.tile_store(out, wp.tile_scan_exclusive(t), offset=7)


@pytest.mark.parametrize("stops", [False, True])
def test_other_functions(stops, device):
    values = np.array([2.0, 1.0, 4.0, 3.0])
    x = wp.array(values, dtype=float, requires_grad=True, device=device)
    out = wp.zeros(11, dtype=float, requires_grad=True, device=device)
    try:
        wp.config.peer_tile_gradients = stops
        with wp.Tape() as tape:
            wp.launch_tiled(others, [1], [x], [out], block_dim=32, device=device)
        tape.backward(grads={out: wp.ones(11, dtype=float, device=device)})
    finally:
        wp.config.peer_tile_gradients = False
    sums = np.cumsum(values)
    np.testing.assert_allclose(out.numpy(), [1.0, 4.0, 10.0, *sums, 0.0, *sums[:3]])
    exact = np.array([0, 1, 0, 0]) + [0, 0, 1, 0] + 1.0 + [4, 3, 2, 1] + [3, 2, 1, 0]
    np.testing.assert_allclose(x.grad.numpy(), np.zeros(4) if stops else exact, rtol=1e-6)
