"""Conjugate gradients with fused products: as accurate as plain ones on stiff systems."""

import numpy as np
import pytest

import warp as wp
from warp.optim import linear


def stiff(n, condition, seed=0):
    """A symmetric matrix with eigenvalues from 1 down to 1 / condition, and a solvable b."""
    rng = np.random.default_rng(seed)
    q, _ = np.linalg.qr(rng.standard_normal((n, n)))
    A = (q * np.geomspace(1, 1 / condition, n)) @ q.T
    A = (A + A.T) / 2
    return A, A @ rng.standard_normal(n)


def solved(A, b, dtype, device, **options):
    right = wp.array(b, dtype=dtype, device=device)
    x = wp.zeros_like(right)
    matrix = wp.array(A, dtype=dtype, device=device)
    state = linear.cg(matrix, right, x, maxiter=20000, run=False, **options)
    iterations, error, atol = state()
    return iterations, error, atol, x.numpy().astype(float), state


@pytest.mark.parametrize(("condition", "tol"), [(1e4, 1e-12), (1e6, 1e-10), (1e8, 5e-7)])
def test_stiff_systems_take_as_many_iterations(device, condition, tol):
    A, b = stiff(200, condition)
    plain = solved(A, b, wp.float64, device, tol=tol, atol=0.0)
    fused = solved(A, b, wp.float64, device, tol=tol, atol=0.0, fused=True)
    for iterations, error, atol, x, _ in (plain, fused):
        assert error <= atol and 0 < iterations < 20000
        assert np.isclose(np.linalg.norm(A @ x - b), error, rtol=0.1)
    assert fused[0] <= 1.3 * plain[0] + 10, (fused[0], plain[0])


@pytest.mark.parametrize("check_every", [10, 0])
def test_a_residual_that_may_have_drifted_is_computed_anew(device, check_every):
    """In 32 bits the residual falls by more than their precision is the root of."""
    A, b = stiff(120, 1e3, 1)
    refreshed = []
    right = wp.array(b, dtype=wp.float32, device=device)
    x = wp.zeros_like(right)
    matrix = wp.array(A, dtype=wp.float32, device=device)
    options = {"tol": 2e-6, "atol": 0.0, "maxiter": 2000, "check_every": check_every}
    if wp.get_device(device).is_cuda:
        options["use_cuda_graph"] = False
    state = linear.cg(matrix, right, x, fused=True, run=False, **options)
    own = state.refresh
    state.refresh = lambda: refreshed.append(own())
    iterations, *_ = state()
    count = int(iterations.numpy()[0]) if check_every == 0 else iterations
    assert refreshed and count < 400
    A32, b32 = A.astype(np.float32).astype(float), b.astype(np.float32).astype(float)
    true = np.linalg.norm(A32 @ x.numpy().astype(float) - b32)
    assert true <= 2.5e-6 * np.linalg.norm(b32)


def test_gradients_of_fused_solutions(device):
    A, b = stiff(20, 1e2, 2)
    right = wp.array(b, dtype=wp.float64, device=device, requires_grad=True)
    x = wp.zeros_like(right)
    matrix = wp.array(A, dtype=wp.float64, device=device)
    seed = np.random.default_rng(3).standard_normal(20)
    with wp.Tape() as tape:
        linear.cg(matrix, right, x, tol=1e-12, maxiter=200, fused=True)
    tape.backward(grads={x: wp.array(seed, dtype=wp.float64, device=device)})
    np.testing.assert_allclose(right.grad.numpy(), np.linalg.solve(A, seed), rtol=1e-8)
