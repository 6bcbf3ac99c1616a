"""A solution that is not finite never passes without a word."""

import functools
import warnings

import numpy as np
import pytest

import warp as wp
import warp.sparse as sp
from random_runs import seeds
from warp.optim import linear

fused = functools.partial(linear.cg, fused=True)
SOLVERS = [linear.cg, fused, linear.cr, linear.bicgstab, linear.gmres]


def sparse(A, device, dtype=wp.float32):
    rows, cols = np.nonzero(A)
    places = (wp.array(p, dtype=int, device=device) for p in (rows, cols))
    return sp.bsr_from_triplets(*A.shape, *places, wp.array(A[rows, cols], dtype=dtype))


def system(seed, n=5):
    """A symmetric matrix whose last row and column are empty, and a right side that needs them."""
    rng = np.random.default_rng(seed)
    M = rng.standard_normal((n, n)) * (rng.random((n, n)) < 0.4)
    A = M @ M.T + n * np.eye(n)
    A[-1] = A[:, -1] = 0
    return A, rng.standard_normal(n)


def check(found, x):
    """A finite solution beside its true residual, or none and a residual that is no number."""
    assert np.isfinite(x.numpy()).all() == np.isfinite(found[1]), (found, x.numpy())


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("kind", ["sparse", "dense", "preconditioned", "batched"])
def test_singular_systems(device, solver, kind):
    with wp.ScopedDevice(device):
        for seed in seeds(10):
            A, b = system(seed)
            if kind == "batched":
                whole, _ = system(seed + 1)
                whole[-1, -1] = 4.0
                A = np.block([[whole, 0 * A], [0 * A, A]])
                b = np.concatenate([b, b])
            a = wp.array(A, dtype=float) if kind == "dense" else sparse(A, device)
            M = linear.preconditioner(a) if kind == "preconditioned" else None
            if kind == "batched":
                a = linear.aslinearoperator(a, wp.array([0, 5, 10], dtype=int), 5)
            x = wp.zeros(len(b), dtype=float)
            for check_every in (1, 10, 64):
                x.zero_()
                options = {"tol": 1e-5, "maxiter": 200, "check_every": check_every, "M": M}
                with warnings.catch_warnings(record=True) as caught:
                    warnings.simplefilter("always")
                    found = solver(a, wp.array(b, dtype=float), x, **options)
                assert any("breakdown" in str(one.message) for one in caught)
                check(found, x)


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_device_tells_it_by_the_residual(device, solver):
    """Without checks by the host the squared residual of such a solution is NaN."""
    with wp.ScopedDevice(device):
        A, b = system(3)
        x = wp.array([0.0, 0.0, 0.0, 0.0, np.inf], dtype=float)
        options = {"tol": 1e-5, "maxiter": 200, "check_every": 0, "use_cuda_graph": False}
        found = solver(sparse(A, device), wp.array(b, dtype=float), x, **options)
        assert np.isnan(found[1].numpy()).all() and not np.isfinite(x.numpy()).all()


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_guess_that_the_matrix_does_not_see(device, solver, bad):
    """A guess that is not finite where a column is empty leaves no trace in b - A x."""
    with wp.ScopedDevice(device):
        A, b = system(4)
        b[-1] = 0
        x = wp.array([0.0, 0.0, 0.0, 0.0, bad], dtype=float)
        with pytest.warns(UserWarning, match="the residual is no number: x is not finite"):
            found = solver(sparse(A, device), wp.array(b, dtype=float), x, tol=1e-5, maxiter=50)
        assert np.isnan(found[1])


@pytest.mark.parametrize("solver", SOLVERS)
def test_numbers_of_no_system_do_not_matter(device, solver):
    """The memory behind the last system may hold anything."""
    with wp.ScopedDevice(device):
        A = np.diag([2.0, 4.0, 1.0])
        offsets = wp.array([0, 2], dtype=int)
        operator = linear.aslinearoperator(sparse(A, device), offsets, 2)
        x = wp.array([0.0, 0.0, np.nan], dtype=float)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            solver(operator, wp.array([2.0, 2.0, 0.0], dtype=float), x, tol=1e-6, maxiter=9)
        np.testing.assert_allclose(x.numpy()[:2], [1.0, 0.5], rtol=1e-6)
