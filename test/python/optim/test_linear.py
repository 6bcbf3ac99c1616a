"""Solutions of linear systems beside numpy.linalg.solve."""

import functools
import warnings

import numpy as np
import pytest

import warp as wp
import warp.sparse as sp
from warp.optim import linear

fused = functools.partial(linear.cg, fused=True)
SOLVERS = [linear.cg, fused, linear.cr, linear.bicgstab, linear.gmres]


def system(solver, n, seed=1):
    rng = np.random.default_rng(seed)
    C = rng.standard_normal((n, n))
    symmetric = solver in (linear.cg, fused, linear.cr)
    A = C @ C.T + n * np.eye(n) if symmetric else C + 3 * n**0.5 * np.eye(n)
    return A, rng.standard_normal(n)


def arrays(A, b, device, dtype=wp.float64):
    return (
        wp.array(A, dtype=dtype, device=device),
        wp.array(b, dtype=dtype, device=device),
        wp.zeros(len(b), dtype=dtype, device=device),
    )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_the_residual_is_the_true_one(device, solver, dtype):
    tol = 1e-11 if dtype is wp.float64 else 1e-5
    A, b = system(solver, 40)
    a, right, x = arrays(A, b, device, dtype)
    for M in (None, linear.preconditioner(a, "diag")):
        x.zero_()
        iterations, error, atol = solver(a, right, x, tol=tol, maxiter=300, M=M)
        true = np.linalg.norm(A @ x.numpy().astype(float) - b)
        assert error <= atol == pytest.approx(tol * np.linalg.norm(b), rel=1e-3)
        assert abs(true - error) < (1e-13 if dtype is wp.float64 else 1e-5)
        # A second call finds the solution there.
        assert solver(a, right, x, tol=tol, maxiter=300, M=M)[0] < iterations


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_device_decides(device, solver):
    A, b = system(solver, 30)
    a, right, x = arrays(A, b, device)
    with wp.ScopedCapture(device=device) as capture:
        state = solver(a, right, x, tol=1e-10, check_every=0, maxiter=200)
    for factor in (1.0, -2.0):
        right.assign(factor * b)
        wp.capture_launch(capture.graph)
        iterations, error, atol = (array.numpy()[0] for array in state)
        assert 0 < iterations < 200 and error <= atol
        np.testing.assert_allclose(x.numpy(), factor * np.linalg.solve(A, b), rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
def test_batches(device, solver):
    sizes = [5, 9, 1, 12]
    offsets = np.cumsum([0, *sizes])
    n = offsets[-1] + 3
    A, b = np.zeros((n, n)), np.ones(n)
    for k, size in enumerate(sizes):
        part = slice(offsets[k], offsets[k + 1])
        A[part, part], b[part] = system(solver, size, k)
    b[part] *= 1e6
    a, right, x = arrays(A, b, device)
    x.fill_(7.0)
    operator = linear.aslinearoperator(a, wp.array(offsets, dtype=int, device=device), max(sizes))
    assert operator.batch_count == 4
    solver(operator, right, x, tol=1e-10, maxiter=100)
    m = offsets[-1]
    np.testing.assert_allclose(x.numpy()[:m], np.linalg.solve(A[:m, :m], b[:m]), rtol=1e-7)
    np.testing.assert_array_equal(x.numpy()[m:], 7)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_singular_system_is_named(device, solver):
    a, right, x = arrays(np.diag([1.0, 2.0, 0.0, 3.0]), np.ones(4), device)
    state = solver(a, right, x, maxiter=50, run=False)
    with pytest.warns(UserWarning, match="breakdown in iteration"):
        _, error, atol = state()
    assert state.breakdown is not None and error > atol
    assert np.isfinite(x.numpy()).all()
    # The part outside of the null space does not suffer, and other systems are solved after it.
    right.assign([1.0, 1.0, 0.0, 1.0])
    x.zero_()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _, error, atol = state()
    assert error <= atol and state.breakdown is None


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_sparse_system_with_an_empty_row_is_named(device, solver):
    """Row and column 2 have no entry: only right sides that are zero there are reached."""
    places = wp.array([0, 1, 3], dtype=int, device=device)
    values = wp.array([2.0, 3.0, 5.0], dtype=wp.float64, device=device)
    A = wp.sparse.bsr_from_triplets(4, 4, places, places, values)
    _, right, x = arrays(np.eye(4), np.ones(4), device)
    state = solver(A, right, x, maxiter=60, run=False)
    with pytest.warns(UserWarning, match=r"breakdown in iteration \d+: the matrix is singular"):
        _, error, atol = state()
    assert 0 <= state.breakdown <= 60 and error > atol and np.isfinite(x.numpy()).all()


def test_blocks_on_the_diagonal(device):
    rng = np.random.default_rng(2)
    blocks = rng.standard_normal((4, 4, 4))
    blocks[1], blocks[2] = 0, blocks[2] @ blocks[2].T + np.eye(4)
    blocks[3] *= 1e-9
    A = sp.bsr_diag(wp.array(blocks, dtype=wp.mat44d, device=device))
    x = rng.standard_normal((4, 4))
    X, Y = (wp.array(v.ravel(), dtype=wp.float64, device=device) for v in (x, 0 * x))
    for kind in ("direct", "sequential", "tile"):
        linear.preconditioner(A, f"block_jacobi_{kind}").matvec(X, Y, Y, 1.0, 0.0)
        y = Y.numpy().reshape(4, 4)
        np.testing.assert_array_equal(y[1], x[1])
        np.testing.assert_allclose(y[2], np.linalg.solve(blocks[2], x[2]))
        for k in (0, 3):
            expected = np.linalg.solve(blocks[k], x[k]) if kind == "direct" else x[k]
            np.testing.assert_allclose(y[k], expected)


def test_a_sparse_system_of_blocks(device):
    n = 400
    i = np.arange(n)
    rows, columns = np.concatenate([i, i[1:], i[:-1]]), np.concatenate([i, i[:-1], i[1:]])
    values = np.concatenate([np.full(n, 2.01), np.full(2 * n - 2, -1.0)])
    dense = np.zeros((n, n))
    dense[rows, columns] = values
    parts = (wp.array(a, dtype=int, device=device) for a in (rows, columns))
    A = sp.bsr_from_triplets(n, n, *parts, wp.array(values, dtype=wp.float64, device=device))
    b = np.sin(i)
    for matrix in (A, sp.bsr_copy(A, block_shape=(4, 4))):
        for M in ("diag_abs", "block_jacobi_tile"):
            x = wp.zeros(n, dtype=wp.float64, device=device)
            M = linear.preconditioner(matrix, M)
            linear.cg(matrix, wp.array(b, device=device), x, tol=1e-12, maxiter=n, M=M, restart=200)
            np.testing.assert_allclose(x.numpy(), np.linalg.solve(dense, b), rtol=1e-8, atol=1e-9)


def test_wrong_arguments(device):
    a, b, x = arrays(np.eye(4), np.ones(4), device)
    with pytest.raises(ValueError, match=r"Incompatible b\.shape"):
        linear.cg(a, b[:3], x)
    with pytest.raises(ValueError, match=r"Incompatible x\.dtype"):
        linear.cg(a, b, wp.zeros(4, dtype=wp.float32, device=device))
    with pytest.raises(ValueError, match="square matrix"):
        linear.cg(a[:3], b, x)
    with pytest.raises(ValueError, match="tolerances"):
        linear.cg(a, b, x, tol=float("nan"))
    with pytest.raises(TypeError, match="restart must be an integer"):
        linear.cr(a, b, x, restart=1.5)
    with pytest.raises(ValueError, match="Unsupported preconditioner"):
        linear.preconditioner(a, "magic")
    with pytest.raises(ValueError, match="requires batch_offsets"):
        linear.aslinearoperator(a, max_batch_length=3)
