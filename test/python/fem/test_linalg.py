"""Dense algebra of `warp.fem.linalg`, against LAPACK."""

import numpy as np
import pytest

import warp as wp
from warp.fem.linalg import array_axpy, symmetric_eigenvalues_qr

MATRICES = {n: wp.types.matrix((n, n), wp.float64) for n in (2, 3, 5, 6)}


def solve(matrices, n, device, scalar=wp.float64):
    kind, row = wp.types.matrix((n, n), scalar), wp.types.vector(n, scalar)

    @wp.kernel(module="unique")
    def eigen(
        a: wp.array(dtype=kind), d: wp.array(dtype=row), p: wp.array(dtype=kind), tol: scalar
    ):
        i = wp.tid()
        values, vectors = symmetric_eigenvalues_qr(a[i], tol)
        d[i], p[i] = values, vectors

    a = wp.array(matrices, dtype=kind, device=device)
    d, p = wp.zeros(len(a), dtype=row, device=device), wp.zeros_like(a)
    wp.launch(eigen, len(a), [a, d, p, 0.0], device=device)
    return d.numpy(), p.numpy()


def cases(n):
    rng = np.random.default_rng(n)
    x = rng.normal(size=(40, n, n))
    x[10:20] *= np.logspace(-6, 6, n)
    x[20:25] = 0.0
    x[25:30] = np.eye(n)
    x[30:35] = np.ones((n, n))
    return x + x.transpose(0, 2, 1)


@pytest.mark.parametrize("n", [2, 3, 5, 6])
def test_eigenvalues_against_lapack(n, device):
    x = cases(n)
    values, vectors = solve(x, n, device)
    scale = np.abs(x).max((1, 2))[:, None] + 1e-300
    exact = np.linalg.eigvalsh(x)
    assert np.abs((np.sort(values, 1) - exact) / scale).max() < 1e-13
    again = np.einsum("bki,bk,bkj->bij", vectors, values, vectors)
    assert (np.abs(again - x).max((1, 2)) / scale[:, 0]).max() < 1e-13
    assert np.abs(vectors @ vectors.transpose(0, 2, 1) - np.eye(n)).max() < 1e-14


def test_single_precision(device):
    x = cases(6).astype(np.float32)
    values, vectors = solve(x, 6, device, wp.float32)
    scale = np.abs(x).max((1, 2))[:, None] + 1e-30
    exact = np.linalg.eigvalsh(x.astype(np.float64))
    assert np.abs((np.sort(values, 1) - exact) / scale).max() < 1e-5
    assert np.abs(vectors @ vectors.transpose(0, 2, 1) - np.eye(6)).max() < 1e-5


def test_axpy_and_its_gradient(device):
    x = wp.array([1.0, 2.0], dtype=float, requires_grad=True, device=device)
    y = wp.array([10.0, 20.0], dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        array_axpy(x, y, 2.0, 0.5)
    assert y.numpy().tolist() == [7.0, 14.0]
    tape.backward(grads={y: wp.ones_like(y)})
    assert x.grad.numpy().tolist() == [2.0, 2.0]
    assert y.grad.numpy().tolist() == [0.5, 0.5]
    with pytest.raises(ValueError, match="one shape and device"):
        array_axpy(x, wp.zeros(3, device=device))
