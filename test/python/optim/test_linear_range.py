"""Solvers judge residuals of any size: their squares need not be numbers of 32 bits."""

import functools

import numpy as np
import pytest

import warp as wp
import warp.sparse as sp
from warp.optim import linear

METHODS = ("cg", "fused", "cr", "bicgstab", "gmres")
SIZE = 30


def method_of(name):
    return functools.partial(linear.cg, fused=True) if name == "fused" else getattr(linear, name)


def system():
    """A symmetric positive definite matrix of condition 10, and a vector."""
    rng = np.random.default_rng(3)
    q, _ = np.linalg.qr(rng.standard_normal((SIZE, SIZE)))
    return (q * np.geomspace(0.3, 3.0, SIZE)) @ q.T, rng.standard_normal(SIZE)


def sparse(matrix, device):
    rows, columns = np.indices(matrix.shape).reshape(2, -1)
    parts = [wp.array(a, dtype=int, device=device) for a in (rows, columns)]
    numbers = wp.array(matrix.ravel(), dtype=wp.float32, device=device)
    return sp.bsr_from_triplets(*matrix.shape, *parts, numbers)


@pytest.mark.parametrize("check_every", [10, 0])
@pytest.mark.parametrize("scale", [1e-30, 1e-12, 1e12, 1e25])
@pytest.mark.parametrize("method", METHODS)
def test_solutions_scale_with_the_right_hand_side(device, method, scale, check_every):
    matrix, vector = system()
    b = wp.array(vector * scale, dtype=wp.float32, device=device)
    x = wp.zeros(SIZE, dtype=wp.float32, device=device)
    solve = method_of(method)
    options = {"tol": 1e-5, "atol": 0.0, "maxiter": 200, "check_every": check_every}
    if check_every == 0 and wp.get_device(device).is_cuda:
        options["use_cuda_graph"] = False
    result = solve(sparse(matrix, device), b, x, **options)
    expected = np.linalg.solve(matrix, vector)
    solution = x.numpy().astype(np.float64) / scale
    assert abs(solution - expected).max() < 1e-3 * abs(expected).max()
    if check_every:
        rest = np.linalg.norm(vector * scale - matrix @ x.numpy().astype(np.float64))
        assert result[1] == pytest.approx(rest, rel=0.2, abs=2e-6 * scale)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("method", METHODS)
def test_what_cannot_be_solved_is_told(device, method, bad):
    matrix, vector = system()
    vector[4] = bad
    b = wp.array(vector, dtype=wp.float32, device=device)
    x = wp.zeros(SIZE, dtype=wp.float32, device=device)
    name = "cg" if method == "fused" else method
    with pytest.warns(UserWarning, match=f"{name}: breakdown in iteration"):
        _, residual, _ = method_of(method)(sparse(matrix, device), b, x, tol=1e-5)
    assert not np.isfinite(residual)
