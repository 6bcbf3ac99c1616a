"""Chebyshev polynomials of matrices beside their closed form and numpy.linalg."""

import pickle

import numpy as np
import pytest

import warp as wp
import warp.sparse as sp
from warp.optim import linear
from warp.optim.linear import Chebyshev


def laplacian(n):
    return 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)


def scaled(n):
    """A Laplacian whose diagonal lies between 1e-2 and 1e2."""
    by = 10.0 ** np.random.default_rng(1).uniform(-1, 1, n)
    return by[:, None] * laplacian(n) * by


def sparse(A, device, dtype=wp.float64, block=1):
    rows, cols = np.nonzero(A)
    values = wp.array(A[rows, cols], dtype=dtype, device=device)
    places = (wp.array(p, dtype=int, device=device) for p in (rows, cols))
    made = sp.bsr_from_triplets(*A.shape, *places, values)
    return made if block == 1 else sp.bsr_copy(made, block_shape=(block, block))


def vector(data, device, dtype=wp.float64):
    return wp.array(data, dtype=dtype, device=device)


def polynomial(degree, x):
    """The Chebyshev polynomial of the first kind."""
    return np.polynomial.chebyshev.chebval(x, np.eye(degree + 1)[degree])


@pytest.mark.parametrize("degree", [1, 2, 5])
def test_errors_shrink_as_the_polynomial_says(device, degree):
    """Each eigenvector by its own factor, in the interval and below it."""
    n, (a, b) = 20, (0.3, 2.1)
    dense = laplacian(n)
    values, vectors = np.linalg.eigh(dense / 2)
    M = Chebyshev(sparse(dense, device), degree, bounds=(a, b))
    for k in (0, 7, 19):
        x, zero = vector(vectors[:, k], device), wp.zeros(n, dtype=wp.float64, device=device)
        M.smooth(zero, x)
        factor = polynomial(degree, (b + a - 2 * values[k]) / (b - a))
        factor /= polynomial(degree, (b + a) / (b - a))
        np.testing.assert_allclose(x.numpy(), factor * vectors[:, k], atol=1e-13)
        # The preconditioner is the polynomial p with 1 - l p(l) as factor.
        z = wp.full(n, 2.0, dtype=wp.float64, device=device)
        M.matvec(vector(dense @ vectors[:, k], device), z, z, 3.0, 0.5)
        np.testing.assert_allclose(z.numpy(), 3 * (1 - factor) * vectors[:, k] + 1.0, atol=1e-12)


@pytest.mark.parametrize("make", [laplacian, scaled])
def test_estimated_ends(device, make):
    """Above the largest eigenvalue, by a tenth at most, and not below the smallest one."""
    dense = make(40)
    root = np.sqrt(np.diag(dense))
    values = np.linalg.eigvalsh(dense / root[:, None] / root)
    low, high = Chebyshev(sparse(dense, device), ratio=1e6, steps=40).bounds
    assert values[-1] <= high <= 1.11 * values[-1]
    assert 0.8 * values[0] <= low <= 1.01 * values[0]
    low, high = Chebyshev(sparse(dense, device), ratio=8.0).bounds
    assert np.isclose(low, high / 8)


@pytest.mark.parametrize("kind", ["sparse", "blocks", "dense", "single", "vectors"])
def test_solutions(device, kind):
    """Any kind of matrix: the solution of NumPy, in fewer iterations than by the diagonal."""
    n = 60
    dense = laplacian(n) if kind == "single" else scaled(n)
    dtype = wp.float32 if kind == "single" else wp.float64
    A = vector(dense, device) if kind == "dense" else None
    if A is None:
        A = sparse(dense, device, dtype, 2 if kind in ("blocks", "vectors") else 1)
    right = np.random.default_rng(2).standard_normal(n)
    if kind == "vectors":
        b = vector(right.reshape(-1, 2), device, wp.vec2d)
    else:
        b = vector(right, device, dtype)
    done = {}
    for name in ("diag", "chebyshev"):
        x = wp.zeros_like(b)
        M = linear.preconditioner(A, name)
        options = {"tol": 1e-5 if kind == "single" else 1e-10, "maxiter": 500, "check_every": 1}
        done[name], error, atol = linear.cg(A, b, x, M=M, **options)
        assert error <= atol
        wanted = np.linalg.solve(dense, right)
        atol = np.abs(wanted).max() * (2e-3 if kind == "single" else 1e-8)
        np.testing.assert_allclose(x.numpy().reshape(-1), wanted, rtol=0, atol=atol)
    assert done["chebyshev"] < 0.6 * done["diag"], done


def test_operators_made_by_hand(device):
    """Without a matrix the diagonal is given, or counts as the identity."""
    dense = scaled(30)
    own = linear.aslinearoperator(vector(dense, device))
    hidden = linear.LinearOperator(own.shape, own.dtype, own.device, own.matvec)
    wanted = Chebyshev(own).bounds
    given = Chebyshev(hidden, diagonal=vector(np.diag(dense), device)).bounds
    assert np.allclose(given, wanted)
    assert Chebyshev(hidden).bounds[1] >= np.linalg.eigvalsh(dense)[-1]


def test_numbers_that_change(device):
    """`update` follows the matrix; pickles keep the interval."""
    A = sparse(laplacian(20), device)
    M = Chebyshev(A)
    before = M.bounds
    wp.copy(A.values, wp.array(3.0 * A.values.numpy(), dtype=A.values.dtype, device=device))
    M.update()
    # D^-1 A is the same, the diagonal is not.
    assert np.allclose(M.bounds, before)
    x = vector(np.arange(20.0), device)
    found = []
    for one in (M, pickle.loads(pickle.dumps(M)), Chebyshev(sparse(3 * laplacian(20), device))):
        z = wp.zeros_like(x)
        one.matvec(x, z, z, 1.0, 0.0)
        found.append(z.numpy())
    assert np.array_equal(found[0], found[1])
    assert np.allclose(found[0], found[2], rtol=1e-12)


def test_gradients_of_solutions(device):
    """The gradient is the implicit one, whatever preconditions the iterations."""
    dense = scaled(16)
    A = sparse(dense, device)
    A.values.requires_grad = True
    b = wp.array(np.arange(16.0), dtype=wp.float64, device=device, requires_grad=True)
    x = wp.zeros(16, dtype=wp.float64, device=device, requires_grad=True)
    M = Chebyshev(A)
    with wp.Tape() as tape:
        linear.cg(A, b, x, M=M, tol=1e-13)
    seed = np.random.default_rng(4).standard_normal(16)
    tape.backward(grads={x: vector(seed, device)})
    left = np.linalg.solve(dense, seed)
    np.testing.assert_allclose(b.grad.numpy(), left, rtol=1e-8)
    rows, columns = np.nonzero(dense)
    wanted = -left[rows] * np.linalg.solve(dense, np.arange(16.0))[columns]
    np.testing.assert_allclose(A.values.grad.numpy()[: A.nnz], wanted, rtol=1e-7, atol=1e-9)


def test_matrices_that_are_refused(device):
    dense = laplacian(30)
    for bad, text in (
        (-dense, "not positive in 30 rows, -2 in row 0: pass `-A`"),
        (dense - 1.5 * np.eye(30), "<p, A p> = -"),
        (dense * np.where(np.arange(30) == 3, np.nan, 1.0)[:, None], "not positive in 1 rows"),
        (dense + np.diag(np.full(29, np.inf), 1), "<p, A p> = "),
    ):
        with pytest.raises(ValueError, match="requires a positive definite matrix") as problem:
            Chebyshev(sparse(bad, device))
        assert text in str(problem.value)
    A = sparse(dense, device)
    for options, text in (
        ({"degree": 0}, "degree >= 1, got 0"),
        ({"steps": 0}, "steps >= 1, got 0"),
        ({"ratio": float("nan")}, "ratio >= 1, got nan"),
        ({"bounds": (1.0, 0.5)}, r"0 < a < b, got \(1.0, 0.5\)"),
        ({"diagonal": wp.ones(3, dtype=wp.float64, device=device)}, "30 numbers .* got 3"),
    ):
        with pytest.raises(ValueError, match=text):
            Chebyshev(A, **options)
    with pytest.raises(TypeError, match="'degree' expects an integer, but got '2.5'"):
        Chebyshev(A, degree=2.5)
    with pytest.raises(TypeError, match="matrix of floats, got int32"):
        Chebyshev(wp.zeros((3, 3), dtype=int, device=device))
    for bounds in ((), (1.0,), 2.0, ("a", "b")):
        with pytest.raises(TypeError, match="'bounds' expects two numbers|bounds.*two numbers"):
            Chebyshev(A, bounds=bounds)
    with pytest.raises(ValueError, match=r"square matrix, got shape \(30, 2\)"):
        Chebyshev(wp.zeros((30, 2), dtype=wp.float64, device=device))
    halves = wp.array([0, 15, 30], dtype=int, device=device)
    with pytest.raises(ValueError, match="one system, got several batches"):
        Chebyshev(linear.aslinearoperator(A, batch_offsets=halves))


def test_vectors_that_are_refused(device):
    """Vectors of another size would be read and written beyond their end."""
    M = Chebyshev(sparse(laplacian(30), device))
    good, short, single = (
        wp.ones(n, dtype=dtype, device=device)
        for n, dtype in ((30, wp.float64), (29, wp.float64), (30, wp.float32))
    )
    for b, x, text in (
        (short, good, "30 numbers in 'b', but got 29"),
        (good, short, "30 numbers in 'x', but got 29"),
        (single, good, "float64, got b of float32 and x of float64"),
        (good, single, "float64, got b of float64 and x of float32"),
    ):
        with pytest.raises(ValueError, match=text):
            M.smooth(b, x)
    with pytest.raises(ValueError, match="30 numbers in 'z', but got 29"):
        M.matvec(good, good, short, 1.0, 0.0)


def test_an_empty_and_a_single_row(device):
    for n in (0, 1):
        A = sparse(np.full((n, n), 4.0), device)
        M = Chebyshev(A)
        x = wp.full(n, 2.0, dtype=wp.float64, device=device)
        z = wp.zeros_like(x)
        M.matvec(x, z, z, 1.0, 0.0)
        assert z.size == n and (z.numpy() > 0).all()
