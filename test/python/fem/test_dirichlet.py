"""Fixed degrees of freedom: projected systems against dense algebra in float64."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem
from warp._src.fem import dirichlet
from warp._src.fem.temporaries import TemporaryStore, borrow_temporary, borrow_temporary_like
from warp.sparse import bsr_set_from_triplets, bsr_zeros

RNG = np.random.default_rng(3)


def block_matrix(dense, size, scalar, keep):
    n = dense.shape[0] // size
    blocks = dense.reshape(n, size, n, size).transpose(0, 2, 1, 3)
    rows, cols = np.nonzero(keep)
    dtype = scalar if size == 1 else wp.types.matrix(shape=(size, size), dtype=scalar)
    result = bsr_zeros(n, n, dtype, device="cpu")
    i, j = (wp.array(x, dtype=int, device="cpu") for x in (rows, cols))
    values = blocks[rows, cols] if size > 1 else blocks[rows, cols, 0, 0]
    bsr_set_from_triplets(result, i, j, wp.array(values, dtype=dtype, device="cpu"))
    return result


def to_dense(matrix):
    size, nnz = matrix.block_shape[0], matrix.nnz_sync()
    offsets, columns = matrix.offsets.numpy(), matrix.columns.numpy()[:nnz]
    values = matrix.values.numpy()[:nnz].reshape(nnz, size, size)
    dense = np.zeros((matrix.nrow, matrix.ncol, size, size))
    rows = np.repeat(np.arange(matrix.nrow), np.diff(offsets))
    dense[rows, columns] = values
    return dense.transpose(0, 2, 1, 3).reshape(matrix.shape)


@pytest.mark.parametrize("size", [1, 2, 3])
@pytest.mark.parametrize("scalar", [wp.float32, wp.float64])
def test_projected_system(size, scalar):
    n = 6
    dense = RNG.standard_normal((n * size, n * size))
    A = block_matrix(dense, size, scalar, np.ones((n, n), bool))
    # Scaled projectors of no, one and all directions.
    projector, fixed = np.zeros((n, n, size, size)), np.zeros((n, size))
    values = RNG.standard_normal((n, size))
    for node in (1, 4):
        normal = RNG.standard_normal(size)
        P = np.outer(normal, normal) if node == 1 else 0.25 * np.eye(size)
        projector[node, node], fixed[node] = P, P @ values[node]
    projector = projector.transpose(0, 2, 1, 3).reshape(n * size, n * size)
    P = block_matrix(projector, size, scalar, np.diag([0, 1, 0, 0, 1, 0]))
    dtype = scalar if size == 1 else wp.types.vector(length=size, dtype=scalar)
    shaped = (n,) if size == 1 else (n, size)
    b = RNG.standard_normal(n * size)
    rhs = wp.array(b.reshape(shaped), dtype=dtype, device="cpu")
    u = wp.array(fixed.reshape(shaped), dtype=dtype, device="cpu")
    dirichlet.project_linear_system(A, rhs, P, u)
    values_of_nodes, modes = np.linalg.eigh(projector)
    kept = modes[:, values_of_nodes > 1e-9]
    exact = kept @ kept.T
    full = exact @ np.linalg.pinv(projector) @ fixed.ravel()
    Q = np.eye(n * size) - exact
    tolerance = dict(rtol=1e-4, atol=2e-5) if scalar is wp.float32 else dict(rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(to_dense(A), Q @ dense @ Q + exact, **tolerance)
    expected = Q @ (b - dense @ full) + full
    np.testing.assert_allclose(rhs.numpy().ravel(), expected, **tolerance)


def test_shapes_that_do_not_fit_are_named():
    A = bsr_zeros(3, 4, wp.mat22, device="cpu")
    with pytest.raises(ValueError, match="3 x 4 blocks of shape 2 x 2"):
        dirichlet.normalize_dirichlet_projector(A)
    A = bsr_zeros(3, 3, wp.mat22, device="cpu")
    with pytest.raises(ValueError, match="expects 3 elements of 2 numbers, but got 5 of 2"):
        dirichlet.normalize_dirichlet_projector(A, wp.zeros(5, dtype=wp.vec2, device="cpu"))


def test_a_store_lends_memory_again():
    store = TemporaryStore()
    a = borrow_temporary(store, shape=(10, 3), dtype=wp.vec3, device="cpu")
    address = a.ptr
    a.release()
    a.release()
    b = borrow_temporary(store, shape=80, dtype=float, device="cpu")
    assert b.ptr == address and b.shape == (80,)
    c = borrow_temporary_like(b, store)
    assert c.ptr != address
    kept = b.detach()
    kept.release()
    assert borrow_temporary(store, shape=80, dtype=float, device="cpu").ptr != address


def test_a_tape_keeps_temporaries():
    store = TemporaryStore()
    with wp.Tape():
        a = borrow_temporary(store, shape=8, dtype=float, device="cpu", requires_grad=True)
        a.release()
        assert borrow_temporary(store, shape=8, dtype=float, device="cpu").ptr != a.ptr


@pytest.mark.parametrize("name", ["grid2", "tri", "grid3", "tet", "hex"])
@pytest.mark.parametrize("basis", ["NEDELEC_FIRST_KIND", "RAVIART_THOMAS"])
def test_edges_and_faces_of_the_boundary_alone_are_fixed(name, basis):
    """Edges that end on the boundary have values there, but no tangential ones."""
    geo = programs.geometry(name, 3, wp.float64)
    space = fem.make_polynomial_space(
        geo,
        degree=1,
        element_basis=getattr(fem.ElementBasis, basis),
        dtype=wp.types.vector(length=geo.dimension, dtype=wp.float64),
    )
    fixed = fem.dirichlet(space).nodes.numpy()
    positions = space.node_positions().numpy()
    expected = np.flatnonzero(programs.on_boundary(positions))
    np.testing.assert_array_equal(np.sort(fixed), expected)
    sides = geo.boundary_side_count()
    # A closed surface of V vertices, E edges and F faces has V - E + F = 2.
    if geo.dimension == 2 or basis == "RAVIART_THOMAS":
        assert len(fixed) == sides
    else:
        assert len(fixed) == sides * (3 if name == "tet" else 4) // 2
