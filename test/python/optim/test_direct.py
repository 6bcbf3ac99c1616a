"""Direct solvers against NumPy and against manufactured solutions, and matrices without factors."""

import gc

import numpy as np
import pytest

import warp as wp
from warp.optim import linear
from warp.sparse import bsr_from_triplets, bsr_zeros

pytestmark = pytest.mark.skipif(
    not (__import__("pathlib").Path(wp.__file__).parent / "libwarp_eigen.so").exists(),
    reason="Eigen's headers are not installed",
)
KINDS = ["ldlt", "cholesky", "lu", "qr"]


def sparse_of(values, device, block=1, dtype=wp.float64):
    n, m = values.shape[0] // block, values.shape[1] // block
    blocks = values.reshape(n, block, m, block).swapaxes(1, 2)
    rows, columns = np.nonzero(np.abs(blocks).sum((2, 3)))
    kind = dtype if block == 1 else wp.types.matrix(shape=(block, block), dtype=dtype)
    matrix = bsr_zeros(n, m, kind, device)
    arrays = [wp.array(a.astype(np.int32), dtype=int, device=device) for a in (rows, columns)]
    kept = blocks[rows, columns] if block > 1 else blocks[rows, columns].reshape(-1)
    return bsr_from_triplets(n, m, *arrays, wp.array(kept, dtype=kind, device=device))


def definite(n, seed=0):
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.2)
    return a @ a.T + np.eye(n)


def stiff(n, decades):
    """Springs in a row whose stiffnesses span decades, and the order they come in is random."""
    k = 10.0 ** np.random.default_rng(1).uniform(0.0, decades, n + 1)
    return np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("block", [0, 1, 3])
def test_solutions_are_those_of_numpy(device, kind, block):
    values = definite(30)
    if block:
        A = sparse_of(values, device, block)
    else:
        A = wp.array(values, dtype=wp.float64, device=device)
    solver = getattr(linear, kind)(A)
    b = np.random.default_rng(2).normal(size=30)
    expected = np.linalg.solve(values, b)
    dtype = wp.vec3d if block == 3 else wp.float64
    given = wp.array(b.reshape(-1, 3) if block == 3 else b, dtype=dtype, device=device)
    found = solver.solve(given)
    assert found.dtype is given.dtype and found.shape == given.shape
    np.testing.assert_allclose(found.numpy().reshape(-1), expected, rtol=1e-11, atol=1e-12)
    many = wp.array(np.stack([b, 2 * b]), dtype=wp.float64, device=device)
    np.testing.assert_allclose(solver.solve(many).numpy()[1], 2 * expected, rtol=1e-11)
    assert 0.3 < solver.condition / np.linalg.cond(values, 1) <= 1.0 + 1e-9


@pytest.mark.parametrize("kind", KINDS)
def test_stiff_systems_where_cg_stalls(device, kind):
    values = stiff(400, 12.0)
    A = sparse_of(values, device)
    exact = np.sin(np.arange(400.0))
    b = wp.array(values @ exact, dtype=wp.float64, device=device)
    x = wp.zeros_like(b)
    _, residual, _ = linear.cg(A, b, x, tol=1e-10, maxiter=2000)
    assert residual > 1e-8 * np.linalg.norm(b.numpy())
    solver = getattr(linear, kind)(A)
    found = solver.solve(b).numpy()
    assert np.linalg.norm(values @ found - b.numpy()) < 1e-6 * residual
    assert solver.condition > 1e11
    size = np.abs(values) @ np.abs(found)
    if kind == "qr":
        # Rotations mix rows: small against the largest, not against each.
        size = size.max()
    assert (np.abs(values @ found - b.numpy()) / size).max() < 1e-13


def test_least_squares(device):
    rng = np.random.default_rng(5)
    values, b = rng.normal(size=(20, 7)), rng.normal(size=20)
    solver = linear.qr(sparse_of(values, device))
    found = solver.solve(wp.array(b, dtype=wp.float64, device=device))
    np.testing.assert_allclose(found.numpy(), np.linalg.lstsq(values, b)[0], rtol=1e-11)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("is_sparse", [False, True])
def test_gradients_are_those_of_differences(device, kind, is_sparse):
    rng = np.random.default_rng(7)
    values, b, seed = definite(6), rng.normal(size=6), rng.normal(size=6)
    if kind == "qr":
        values, b = rng.normal(size=(9, 6)), rng.normal(size=9)
    if kind == "lu":
        values = values + np.triu(rng.normal(size=(6, 6)))
    A = wp.array(values, dtype=wp.float64, device=device, requires_grad=True)
    store = A
    if is_sparse:
        A = sparse_of(values, device)
        A.values.requires_grad, store = True, A.values
    right = wp.array(b, dtype=wp.float64, device=device, requires_grad=True)
    with wp.Tape() as tape:
        x = getattr(linear, kind)(A).solve(right)
    tape.backward(grads={x: wp.array(seed, dtype=wp.float64, device=device)})

    def goal(values, b):
        return seed @ np.linalg.lstsq(values, b)[0]

    def slope(change_a, change_b, h=1e-6):
        ahead = goal(values + h * change_a, b + h * change_b)
        return (ahead - goal(values - h * change_a, b - h * change_b)) / (2 * h)

    for _ in range(4):
        change_a, change_b = rng.normal(size=values.shape), rng.normal(size=b.shape)
        grad = store.grad.numpy()
        if is_sparse:
            # Numbers that are not stored stay zero.
            change_a, grad = change_a * (values != 0.0), np.zeros_like(values)
            grad[A.uncompress_rows().numpy(), A.columns.numpy()] = store.grad.numpy()
        found = (grad * change_a).sum() + right.grad.numpy() @ change_b
        assert found == pytest.approx(slope(change_a, change_b), rel=1e-6, abs=1e-8)


def test_factors_are_kept_and_renewed(device):
    values = definite(12)
    A = sparse_of(values, device)
    solver = linear.ldlt(A)
    b = wp.array(np.ones(12), dtype=wp.float64, device=device)
    A.values.assign(2.0 * A.values.numpy())
    np.testing.assert_allclose(solver.solve(b).numpy(), np.linalg.solve(values, np.ones(12)))
    solver.refactor()
    np.testing.assert_allclose(solver.solve(b).numpy(), np.linalg.solve(2 * values, np.ones(12)))
    del solver
    gc.collect()


@pytest.mark.parametrize("kind", KINDS)
def test_singular_matrices_are_refused(device, kind):
    n = 20
    ring = 2 * np.eye(n) - np.roll(np.eye(n), 1, 0) - np.roll(np.eye(n), -1, 0)
    with pytest.raises(linear.FactorError, match=r"zero|singular|rank|lost"):
        getattr(linear, kind)(sparse_of(ring, device))
    hilbert = 1.0 / (np.arange(16)[:, None] + np.arange(16) + 1.0)
    with pytest.raises(linear.FactorError):
        getattr(linear, kind)(wp.array(hilbert, dtype=wp.float64, device=device))


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        ("cholesky", [[1.0, 0.0], [0.0, -2.0]], r"not positive definite \(row 1, pivot -2\)"),
        ("ldlt", [[0.0, 1.0], [1.0, 0.0]], "pivot"),
        ("ldlt", [[1.0, 2.0], [0.0, 1.0]], "symmetric"),
        ("lu", [[1.0, 2.0], [2.0, 4.0]], "singular"),
        ("lu", [[1.0, 2.0]], "square"),
        ("qr", [[1.0, 2.0]], "rows"),
        ("qr", [[1.0, 0.0], [1.0, 0.0], [1.0, 0.0]], "rank 1"),
        ("lu", [[np.nan, 0.0], [0.0, 1.0]], "finite"),
    ],
)
def test_what_has_no_factors(kind, values, message):
    with pytest.raises(linear.FactorError, match=message):
        getattr(linear, kind)(wp.array(values, dtype=wp.float64, device="cpu"))


def test_sizes_are_checked():
    solver = linear.lu(wp.array(np.eye(3), dtype=float, device="cpu"))
    with pytest.raises(ValueError, match="3 numbers"):
        solver.solve(wp.zeros(4, dtype=float, device="cpu"))
    with pytest.raises(TypeError, match="floats"):
        solver.solve(wp.zeros(3, dtype=int, device="cpu"))


def test_float32_is_solved_in_double_precision():
    values = stiff(50, 5.0).astype(np.float32)
    b = np.ones(50, np.float32)
    A = wp.array(values, dtype=float, device="cpu")
    found = linear.ldlt(A).solve(wp.array(b, dtype=float, device="cpu")).numpy()
    exact = np.linalg.solve(values.astype(float), b.astype(float))
    np.testing.assert_allclose(found, exact, rtol=3e-7)


@pytest.mark.parametrize("kind", KINDS)
def test_adjoints_use_the_factors_of_their_solution(device, kind):
    # The second matrix is factored while a tape holds a solution with the first.
    first, second = definite(5, seed=1), definite(5, seed=2)
    b = wp.array(np.ones(5), dtype=wp.float64, device=device, requires_grad=True)
    with wp.Tape() as tape:
        solver = getattr(linear, kind)(wp.array(first, dtype=wp.float64, device=device))
        x = solver.solve(b)
        solver.refactor(wp.array(second, dtype=wp.float64, device=device))
        y = solver.solve(x)
    tape.backward(grads={y: wp.array(np.ones(5), dtype=wp.float64, device=device)})
    expected = np.linalg.solve(first.T, np.linalg.solve(second.T, np.ones(5)))
    np.testing.assert_allclose(b.grad.numpy(), expected, rtol=1e-9)
