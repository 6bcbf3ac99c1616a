"""Factorized sparse approximate inverses beside dense solutions of NumPy in float64."""

import numpy as np
import pytest

import warp as wp
import warp.sparse as sp
from warp.optim import linear

TOLERANCE = {wp.float16: 2e-2, wp.float32: 2e-5, wp.float64: 1e-12}


def sparse(A, device, dtype=wp.float64, block=1, keep=None):
    """The numbers of A that are not zero (or that `keep` names), as a sparse matrix."""
    rows, cols = np.nonzero(A if keep is None else keep)
    place = {"dtype": int, "device": device}
    values = wp.array(A[rows, cols], dtype=dtype, device=device)
    scalar = sp.bsr_from_triplets(
        *A.shape,
        wp.array(rows, **place),
        wp.array(cols, **place),
        values,
        prune_numerical_zeros=False,
    )
    return sp.bsr_copy(scalar, block_shape=(block, block)) if block > 1 else scalar


def dense(matrix):
    offsets, columns = matrix.offsets.numpy(), matrix.columns.numpy()
    ends = offsets[1:]
    if matrix.row_counts is not None:
        ends = offsets[:-1] + matrix.row_counts.numpy()
    values = matrix.values.numpy().astype(float)
    result = np.zeros(matrix.shape)
    for row in range(matrix.nrow):
        here = slice(offsets[row], ends[row])
        assert (np.diff(columns[here]) > 0).all()
        result[row, columns[here]] = values[here]
    return result


def laplacian(n):
    """The five-point Laplacian on n x n points."""
    line = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    return np.kron(line, np.eye(n)) + np.kron(np.eye(n), line)


def random_matrix(n, seed):
    """Sparse, symmetric, positive definite and badly scaled."""
    rng = np.random.default_rng(seed)
    A = np.where(rng.random((n, n)) < 0.2, rng.standard_normal((n, n)), 0.0)
    A = A + A.T
    np.fill_diagonal(A, np.abs(A).sum(1) + 0.5)
    scale = np.exp(rng.uniform(-2, 2, n))
    return A * scale * scale[:, None]


def defects(pre, A):
    """The factor, and how far it is from its definition: (G A)_ij is zero on the support of row i
    but for its last entry, and the diagonal of G A G^T is one."""
    G = dense(pre.G)
    np.testing.assert_array_equal(dense(pre.GT), G.T)
    np.testing.assert_array_equal(G, np.tril(G))
    assert (np.diag(G) > 0).all()
    size = np.sqrt(np.diag(A))
    product = (G @ A) / size
    off = np.where((G != 0) & ~np.eye(len(A), dtype=bool), product, 0.0)
    return G, max(np.abs(off).max(), np.abs(np.diag(G @ A @ G.T) - 1).max())


@pytest.mark.parametrize("dtype", [wp.float16, wp.float32, wp.float64])
@pytest.mark.parametrize("block", [1, 3])
def test_rows_solve_the_matrix_on_their_supports(device, dtype, block):
    A = random_matrix(24, 3)
    A = A.astype(wp.dtype_to_numpy(dtype)).astype(float)
    for width, step in ((1, 1), (5, 1), (8, 3), (24, 64)):
        pre = linear.FSAI(
            sparse(A, device, dtype, block), max_row_size=width, max_step_size=step, kap_tolerance=0
        )
        G, defect = defects(pre, A)
        assert defect < TOLERANCE[dtype]
        assert (G != 0).sum(1).max() <= width and pre.truncated_rows == 0
        if width == 1:
            np.testing.assert_allclose(np.diag(G) ** -2, np.diag(A), rtol=TOLERANCE[dtype])


def test_room_for_all_gives_the_inverse(device):
    rng = np.random.default_rng(1)
    C = rng.standard_normal((20, 20))
    A = C @ C.T + np.eye(20)
    for step in (1, 4):
        pre = linear.FSAI(sparse(A, device), 20, kap_tolerance=0, max_step_size=step)
        G, _ = defects(pre, A)
        np.testing.assert_allclose(G.T @ G, np.linalg.inv(A), rtol=1e-9, atol=1e-11)


def greedy_support(A, row, width, step, tolerance):
    """The support of a row, from dense solutions."""
    d = np.sqrt(np.diag(A))
    A = A / d / d[:, None]
    support, z = [row], np.ones(1)
    while len(support) < width:
        score = np.abs(A[:, support] @ z)
        score[row:] = 0
        score[support] = 0
        order = np.lexsort((np.arange(len(A)), -score))
        new = [c for c in order[: min(step, width - len(support))] if score[c] > 0]
        if not new:
            break
        support += new
        before, z = z[0], np.linalg.solve(A[np.ix_(support, support)], np.eye(len(support))[0])
        if 0 < 1 - before / z[0] <= tolerance:
            break
    return sorted(support)


@pytest.mark.parametrize("block", [1, 2])
@pytest.mark.parametrize("step", [1, 3])
@pytest.mark.parametrize("tolerance", [0.0, 0.02])
def test_supports_grow_where_the_residual_is_largest(device, block, step, tolerance):
    A = random_matrix(30, 7)
    pre = linear.FSAI(
        sparse(A, device, block=block), 6, kap_tolerance=tolerance, max_step_size=step
    )
    offsets, columns = pre.G.offsets.numpy(), pre.G.columns.numpy()
    for row in range(30):
        expected = greedy_support(A, row, 6, step, tolerance)
        np.testing.assert_array_equal(columns[offsets[row] : offsets[row + 1]], expected)


def test_many_rows_in_several_launches(device, monkeypatch):
    from warp._src.optim.linear import fsai_plan

    A = sparse(laplacian(40), device)
    whole = linear.FSAI(A)
    monkeypatch.setattr(fsai_plan, "_ROOM", 1)
    parts = linear.FSAI(A)
    for name in ("offsets", "columns", "values"):
        np.testing.assert_array_equal(
            getattr(parts.G, name).numpy(), getattr(whole.G, name).numpy()
        )


def test_fewer_iterations_than_with_the_diagonal(device):
    """On a Laplacian with coefficients of all sizes; the best of 8 numbers in a row by theory (a
    condition number about 4 times smaller) halves the iterations."""
    n = 32
    scale = np.exp(np.random.default_rng(2).uniform(-3, 3, n * n))
    dense_A = (laplacian(n) + 0.01 * np.eye(n * n)) * scale * scale[:, None]
    A = sparse(dense_A, device)
    b = wp.array(dense_A @ np.ones(n * n), dtype=wp.float64, device=device)
    used = {}
    for kind in ("diag", "fsai"):
        for solver in (linear.cg, linear.cr):
            x = wp.zeros_like(b)
            M = linear.preconditioner(A, kind)
            used[kind, solver], error, atol = solver(A, b, x, tol=1e-10, M=M, check_every=1)
            assert error <= atol
            np.testing.assert_allclose(x.numpy(), 1.0, rtol=1e-4)
    for solver in (linear.cg, linear.cr):
        assert used["fsai", solver] <= 0.55 * used["diag", solver]


def test_gradients_of_solutions_do_not_see_it(device):
    A = random_matrix(12, 5)
    matrix = sparse(A, device)
    matrix.values.requires_grad = True
    b = wp.array(np.arange(12.0), dtype=wp.float64, device=device, requires_grad=True)
    x = wp.zeros_like(b, requires_grad=True)
    with wp.Tape() as tape:
        linear.cg(matrix, b, x, tol=1e-13, M=linear.FSAI(matrix))
    seed = np.linspace(-1, 1, 12)
    tape.backward(grads={x: wp.array(seed, dtype=wp.float64, device=device)})
    np.testing.assert_allclose(b.grad.numpy(), np.linalg.solve(A.T, seed), rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("shared", ["", "xz", "yz", "xyz"])
def test_application_adds_and_may_share_arrays(device, shared):
    A = random_matrix(12, 9)
    rng = np.random.default_rng(0)
    for block, stored in ((1, wp.float64), (3, wp.float32)):
        pre = linear.FSAI(sparse(A, device, block=block), factor_dtype=stored)
        G = dense(pre.G)
        x, y = rng.standard_normal((2, 12))
        y = x if shared == "xyz" else y
        dtype = wp.float64 if block == 1 else wp.vec3d
        a, b, c = (
            wp.array(v.reshape(-1, block).squeeze(), dtype=dtype, device=device) for v in (x, y, y)
        )
        b = a if shared == "xyz" else b
        c = {"": c, "yz": b, "xz": a, "xyz": a}[shared]
        pre.matvec(a, b, c, 0.75, -2.0)
        expected = 0.75 * G.T @ (G @ x) - 2.0 * y
        np.testing.assert_allclose(c.numpy().ravel(), expected, rtol=1e-13, atol=1e-13)
        # Entries of weight zero are not read.
        b.fill_(np.nan)
        a.fill_(2.0)
        c = wp.zeros_like(a)
        pre.matvec(a, b, c, 1.0, 0.0)
        np.testing.assert_allclose(c.numpy().ravel(), 2 * G.T @ G @ np.ones(12), rtol=1e-13)
        pre.matvec(b, a, c, 0.0, 0.5)
        np.testing.assert_array_equal(c.numpy(), 1.0)


def test_updates_keep_the_supports(device):
    A = random_matrix(18, 11)
    matrix = sparse(A, device, block=3, keep=np.ones_like(A))
    pre = linear.FSAI(matrix, 5, reuse_pattern=True)
    columns, memory = pre.G.columns.numpy(), pre.G.values.ptr
    B = A + np.diag(np.linspace(0, 2, 18)) + 0.01
    assert pre.update(sparse(B, device, block=3)) is pre
    _, defect = defects(pre, B)
    assert defect < 1e-12 and pre.G.values.ptr == memory
    np.testing.assert_array_equal(pre.G.columns.numpy(), columns)
    # New numbers in the same arrays, and a graph that finds them at each replay.
    matrix = pre.source
    x, y = (wp.ones(18, dtype=wp.float64, device=device) for _ in range(2))
    pre.update()
    pre.matvec(x, y, y, 1.0, 0.0)
    with wp.ScopedCapture(device=device) as capture:
        pre.update()
        pre.matvec(x, y, y, 1.0, 0.0)
    first = matrix.values.numpy().copy()
    for factor in (4.0, 0.25):
        matrix.values.assign(factor * first)
        wp.capture_launch(capture.graph)
        G, defect = defects(pre, factor * B)
        assert defect < 1e-12 and not pre.update_status.numpy().any()
        np.testing.assert_allclose(y.numpy(), G.T @ G @ np.ones(18), rtol=1e-12)
    matrix.values.zero_()
    wp.capture_launch(capture.graph)
    assert pre.update_status.numpy()[1] == 18
    np.testing.assert_array_equal(dense(pre.G), G)


def test_supports_from_the_first_update(device):
    """Chosen in a graph, too, and at its first replay alone."""
    A = random_matrix(16, 13)
    matrix = sparse(A, device)
    expected = dense(linear.FSAI(matrix, 5).G)
    values = matrix.values.numpy().copy()
    for captured in (False, True):
        matrix.values.zero_()
        pre = linear.FSAI(matrix, 5, reuse_pattern=True, defer_pattern=True)
        np.testing.assert_array_equal(dense(pre.G), np.eye(16))
        np.testing.assert_array_equal(dense(pre.GT), np.eye(16))
        if captured:
            with wp.ScopedCapture(device=device) as capture:
                pre.update()
        else:
            with pytest.raises(ValueError, match="16 of 16"):
                pre.update()
            assert pre.pattern_ready.numpy()[0] == 0
        for B in (values, values * np.linspace(1, 1.2, values.size)):
            matrix.values.assign(B)
            wp.capture_launch(capture.graph) if captured else pre.update()
            assert pre.pattern_ready.numpy()[0] == 1 and pre.pattern_status.numpy()[1] == 0
            if B is values:
                np.testing.assert_allclose(dense(pre.G), expected, rtol=1e-13)
            assert ((dense(pre.G) != 0) == (expected != 0)).all()
            np.testing.assert_array_equal(dense(pre.GT), dense(pre.G).T)


def test_refused_updates_change_nothing(device):
    A = random_matrix(9, 17)
    pre = linear.FSAI(sparse(A, device), reuse_pattern=True)
    G = dense(pre.G)
    other, indefinite = A.copy(), A.copy()
    other[0, 8] = other[8, 0] = 0.5 - other[0, 8]
    indefinite[A != 0] = 10 * A.max()
    np.fill_diagonal(indefinite, 1.0)
    for B, message in (
        (-A, "9 of 9"),
        (np.where(A != 0, np.nan, 0), "positive diagonals"),
        (indefinite, "not SPD"),
        (np.roll(A, 1, (0, 1)), "sparsity|number of blocks"),
    ):
        with pytest.raises(ValueError, match=message):
            pre.update(sparse(B, device, keep=B != 0))
        np.testing.assert_array_equal(dense(pre.G), G)
        np.testing.assert_array_equal(dense(pre.GT), G.T)


def test_regularized_updates_go_on(device):
    """A singular pair is made regular, a diagonal of no use is left out; the rest is exact."""
    pair = np.array([[2.0, 1.0], [1.0, 2.0]])
    start = np.kron(np.eye(3), pair)
    pre = linear.FSAI(sparse(start, device), reuse_pattern=True, regularize_refit=True)
    B = start.copy()
    B[:2, :2] = 1.0
    B[2, 2] = -1.0
    B[4:, 4:] = [[4.0, -1.0], [-1.0, 3.0]]
    pre.update(sparse(B, device))
    np.testing.assert_array_equal(pre.update_status.numpy(), [0, 1, 1, 1])
    G = dense(pre.G)
    assert np.isfinite(G).all() and (np.diag(G) > 0).all()
    np.testing.assert_allclose(G[4:, 4:].T @ G[4:, 4:], np.linalg.inv(B[4:, 4:]), rtol=1e-13)
    np.testing.assert_allclose(G[3], [0, 0, 0, 2**-0.5, 0, 0], rtol=1e-15)
    np.testing.assert_array_equal(G[2], np.eye(6)[2])


def test_pivots_stop_rows(device):
    A = np.eye(3) + 0.0
    A[0, 1] = A[1, 0] = 1 - 1e-14
    pre = linear.FSAI(sparse(A, device))
    assert pre.truncated_rows == 1
    np.testing.assert_array_equal(dense(pre.G), np.eye(3))


def test_nothing(device):
    for options in ({}, {"reuse_pattern": True}, {"reuse_pattern": True, "defer_pattern": True}):
        pre = linear.FSAI(sp.bsr_zeros(0, 0, wp.float32, device=device), **options)
        x = wp.empty(0, dtype=wp.float32, device=device)
        pre.matvec(x, x, x, 1.0, 0.0)
        if options:
            pre.update()
        assert pre.shape == (0, 0) and pre.G.nnz_sync() == 0


def test_bad_arguments(device):
    eye = sparse(np.eye(4), device)
    for options, message in (
        ({"max_row_size": 0}, "max_row_size must be an integer in"),
        ({"max_row_size": 2.5}, "got 2.5"),
        ({"max_step_size": 65}, "max_step_size"),
        ({"kap_tolerance": 1.0}, r"kap_tolerance must be in \[0, 1\)"),
        ({"pivot_floor": float("nan")}, r"pivot_floor must be in \(0, 1\)"),
        ({"factor_dtype": wp.float16}, "factor_dtype must be the matrix's 'float64'"),
        ({"defer_pattern": True}, "requires reuse_pattern"),
    ):
        with pytest.raises(ValueError, match=message):
            linear.FSAI(eye, **options)
    for A in (np.eye(3), sp.bsr_zeros(2, 3, wp.float32, device=device)):
        with pytest.raises(ValueError, match="square"):
            linear.FSAI(A)
    with pytest.raises(TypeError, match="bfloat16"):
        linear.FSAI(sp.bsr_zeros(2, 2, wp.bfloat16, device=device))
    # A row without a diagonal, or with one of no use, or of no use as float32.
    for diagonal, options in (
        ([1.0, 0.0], {}),
        ([1.0, -1.0], {}),
        ([np.inf, 1.0], {}),
        ([1e-100, 1.0], {"factor_dtype": wp.float32}),
    ):
        with pytest.raises(ValueError, match=r"positive diagonal|1 of 2 rows"):
            linear.FSAI(sparse(np.diag(diagonal), device), **options)
    with pytest.raises(ValueError, match="reuse_pattern=True"):
        linear.FSAI(eye).update()
    pre = linear.FSAI(eye, reuse_pattern=True)
    for other in (np.eye(4), sparse(np.eye(3), device), sparse(np.eye(4), device, wp.float32)):
        with pytest.raises(ValueError, match="BSR matrix|same shape"):
            pre.update(other)
