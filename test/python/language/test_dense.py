"""Dense matrices in arrays, worked on by a thread each (`wp.dense_gemm` etc.), against NumPy."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def multiply(
    m: int, n: int, p: int, t1: int, t2: int, a: wp.array[float], b: wp.array[float],
    c: wp.array[float],
):  # fmt: skip
    wp.dense_gemm(m, n, p, t1, t2, a, b, c)


@wp.kernel
def multiply_all(
    m: wp.array[int], starts: wp.array[int], a: wp.array[float], b: wp.array[float],
    c: wp.array[float],
):  # fmt: skip
    wp.dense_gemm_batched(m, m, m, 0, 0, starts, starts, starts, a, b, c)


@wp.kernel
def solve(
    n: int, a: wp.array[float], factor: wp.array[float], b: wp.array[float], x: wp.array[float]
):
    wp.dense_chol(n, a, 0.5, factor)
    wp.dense_solve(n, a, factor, b, x)


@wp.kernel
def solve_all(
    n: wp.array[int], starts: wp.array[int], rows: wp.array[int], a: wp.array[float],
    factor: wp.array[float], b: wp.array[float], x: wp.array[float],
):  # fmt: skip
    wp.dense_chol_batched(starts, n, a, 0.5, factor)
    wp.dense_solve_batched(rows, starts, n, a, factor, b, x)


@pytest.mark.parametrize("t1", [0, 1])
@pytest.mark.parametrize("t2", [0, 1])
def test_products_and_their_gradients(device, t1, t2):
    rng = np.random.default_rng(1)
    left, right, weight = (rng.normal(size=s).astype("f4") for s in ((3, 4), (4, 5), (3, 5)))
    a = wp.array((left.T if t1 else left).ravel(), device=device, requires_grad=True)
    b = wp.array((right.T if t2 else right).ravel(), device=device, requires_grad=True)
    c = wp.zeros(15, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(multiply, 1, [3, 5, 4, t1, t2, a, b], [c], device=device)
    np.testing.assert_allclose(c.numpy(), (left @ right).ravel(), rtol=1e-5, atol=1e-6)
    tape.backward(grads={c: wp.array(weight.ravel(), device=device)})
    by_left, by_right = weight @ right.T, left.T @ weight
    for array, found in ((a, by_left.T if t1 else by_left), (b, by_right.T if t2 else by_right)):
        np.testing.assert_allclose(array.grad.numpy(), found.ravel(), rtol=1e-5, atol=1e-5)


def systems(sizes):
    """Symmetric positive definite matrices and right-hand sides."""
    rng = np.random.default_rng(2)
    squares = [rng.normal(size=(n, n)) for n in sizes]
    return [one @ one.T + np.eye(len(one)) for one in squares], [rng.normal(size=n) for n in sizes]


def test_solutions(device):
    (matrix,), (b,) = systems([5])
    a = wp.array(matrix.ravel(), dtype=float, device=device)
    x, factor = (wp.zeros(n, dtype=float, device=device) for n in (5, 25))
    given = wp.array(b, dtype=float, device=device)
    wp.launch(solve, 1, [5, a, factor, given, x], device=device)
    whole = matrix + 0.5 * np.eye(5)
    np.testing.assert_allclose(x.numpy(), np.linalg.solve(whole, b), rtol=1e-4, atol=1e-5)
    lower = np.linalg.cholesky(whole)
    np.testing.assert_allclose(factor.numpy().reshape(5, 5), lower, rtol=1e-5, atol=1e-5)


def test_batches(device):
    sizes = [3, 1, 4]
    matrices, rights = systems(sizes)
    starts = np.cumsum([0, *(n * n for n in sizes)])
    rows = np.cumsum([0, *sizes])
    integers = [wp.array(one, dtype=int, device=device) for one in (sizes, starts[:-1], rows[:-1])]
    flat = np.concatenate([one.ravel() for one in matrices])
    a = wp.array(flat, dtype=float, device=device)
    b = wp.array(np.concatenate(rights), dtype=float, device=device)
    x, factor, product = (wp.zeros(n, dtype=float, device=device) for n in (8, 26, 26))
    wp.launch(solve_all, 3, [*integers, a, factor, b, x], device=device)
    wp.launch(multiply_all, 3, [*integers[:2], a, a, product], device=device)
    for i, (matrix, right) in enumerate(zip(matrices, rights, strict=True)):
        found = np.linalg.solve(matrix + 0.5 * np.eye(sizes[i]), right)
        np.testing.assert_allclose(x.numpy()[rows[i] : rows[i + 1]], found, rtol=1e-4, atol=1e-5)
        squared = product.numpy()[starts[i] : starts[i + 1]].reshape(sizes[i], sizes[i])
        np.testing.assert_allclose(squared, matrix @ matrix, rtol=1e-5, atol=1e-5)
