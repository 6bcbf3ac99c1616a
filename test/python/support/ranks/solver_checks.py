"""Checks of graphs, sparse products and solvers over ranks."""

import functools

import checking
import numpy as np

import warp as wp
import warp.distributed as wd
from warp.optim.linear import Chebyshev, LinearOperator, bicgstab, cg, gmres, preconditioner

ROWS, COLUMNS = 24, 16


def poisson(shape=None):
    """Triplets of the 5-point Laplacian of a grid, and a right-hand side."""
    shape = shape or (ROWS, COLUMNS)
    number = np.arange(shape[0] * shape[1]).reshape(shape)
    pairs = [(number[1:], number[:-1]), (number[:, 1:], number[:, :-1])]
    a = np.concatenate([one.ravel() for one, _ in pairs])
    b = np.concatenate([one.ravel() for _, one in pairs])
    every = number.ravel()
    rows, columns = np.r_[a, b, every], np.r_[b, a, every]
    values = np.r_[-np.ones(2 * len(a)), np.full(len(every), 4.0)].astype(np.float32)
    right = np.random.default_rng(3).standard_normal(number.size).astype(np.float32)
    return rows, columns, values, right


def graph_operations(comm):
    """Halo and push are each other's adjoints; ghosts are owners' values."""
    rows, columns, _, _ = poisson()
    points = np.stack(np.meshgrid(np.arange(ROWS), np.arange(COLUMNS), indexing="ij"), -1)
    for by in ("rows", "metis", "hilbert"):
        graph = wd.Graph(rows, columns, by=by, positions=points.reshape(-1, 2), comm=comm)
        counts = comm.gather_objects(graph.owned)
        assert sum(counts) == ROWS * COLUMNS and max(counts) <= 1.4 * min(counts), (by, counts)
        data = np.arange(float(ROWS * COLUMNS))
        x = graph.zeros(wp.float64)
        graph.inner(x).assign(graph.inner(wp.array(graph.scatter(data), dtype=wp.float64)))
        graph.halo(x)
        assert np.array_equal(x.numpy(), graph.scatter(data)), by
        assert np.array_equal(graph.gather(x), data)
        rng = np.random.default_rng(comm.rank)
        for operation in (graph.halo, graph.push):
            x, y = (graph.zeros(wp.float64, requires_grad=True) for _ in range(2))
            x.assign(rng.random(graph.local))
            y.assign(rng.random(graph.local))
            before = x.numpy().copy()
            with wp.Tape() as tape:
                operation(x)
            tape.backward(grads={x: y})
            left = sum(comm.gather_objects(float(x.numpy() @ y.numpy())))
            right = sum(comm.gather_objects(float(before @ x.grad.numpy())))
            assert np.isclose(left, right, rtol=1e-12), (by, operation, left, right)


def products_and_solvers(comm):
    """Products have the bits of one rank; CG takes as many iterations, to the same bits."""
    # Small, since four ranks on two processors change places at each sum.
    rows, columns, values, right = poisson((14, 11))
    dense = np.zeros((len(right), len(right)))
    dense[rows, columns] = values
    wanted = np.linalg.solve(dense, right.astype(float))
    before = wp.config.deterministic
    wp.config.deterministic = "run_to_run"
    found = []
    try:
        graph = wd.Graph(rows, columns, by="rows", comm=comm)
        A = wd.Matrix(graph, rows, columns, values)
        b = graph.zeros()
        b.assign(graph.scatter(right))
        b = graph.inner(b).contiguous()
        product = wd.bsr_mv(A, b)
        whole = graph.gather(_padded(graph, product))
        assert np.allclose(whole, dense @ right, atol=1e-4)
        found.append(checking.digest(whole))
        for solve in (cg, functools.partial(cg, fused=True), bicgstab, gmres):
            x = wp.zeros_like(b)
            done, error, _ = solve(wd.LinearOperator(A), b, x, tol=1e-6, maxiter=500)
            solution = graph.gather(_padded(graph, x))
            assert np.abs(solution - wanted).max() < 1e-4 * np.abs(wanted).max(), solve
            found += [done, checking.digest(solution)]
    finally:
        wp.config.deterministic = before
    return found


def polynomials(comm):
    """Chebyshev preconditioners: interval, iterations and solution have the same bits."""
    rows, columns, values, dense = stiff_system()
    right = dense @ np.random.default_rng(9).standard_normal(len(dense))
    before = wp.config.deterministic
    wp.config.deterministic = "run_to_run"
    try:
        graph = wd.Graph(rows, columns, by="rows", comm=comm)
        A = wd.LinearOperator(wd.Matrix(graph, rows, columns, values, dtype=wp.float64))
        mine = graph.numbers[graph.first :][: graph.owned]
        b = wp.array(right[mine], dtype=wp.float64)
        done, solutions = {}, {}
        for name in ("diag", "chebyshev"):
            x, M = wp.zeros_like(b), preconditioner(A, name)
            done[name], error, atol = cg(A, b, x, M=M, tol=1e-9, check_every=1)
            assert error <= atol, (name, error, atol)
            solutions[name] = graph.gather(_padded(graph, x))
            assert np.linalg.norm(dense @ solutions[name] - right) < 2e-9 * np.linalg.norm(right)
        assert done["chebyshev"] < done["diag"], done
        root = np.sqrt(np.diag(dense))
        ends = np.linalg.eigvalsh(dense / root[:, None] / root)
        assert ends[-1] < M.bounds[1] < 1.2 * ends[-1]
        negative = wd.Matrix(graph, rows, columns, -values, dtype=wp.float64)
        text = f"not positive in {len(dense)} rows"
        checking.fails(lambda: Chebyshev(wd.LinearOperator(negative)), text, "pass `-A`")
        shifted = values - np.where(rows == columns, 0.9 * values, 0.0)
        odd = wd.Matrix(graph, rows, columns, shifted, dtype=wp.float64)
        checking.fails(lambda: Chebyshev(wd.LinearOperator(odd)), "<p, A p> = -")
        return [*done.values(), *M.bounds, *(checking.digest(one) for one in solutions.values())]
    finally:
        wp.config.deterministic = before


def block_systems(comm):
    """Matrices of blocks, some of them in pieces: diagonal, rows and solutions against NumPy."""
    n, rng = 4 * comm.size + 1, np.random.default_rng(5)
    every = np.arange(n)
    rows = np.r_[every, every[:-1], every[1:], 0, 0]
    columns = np.r_[every, every[1:], every[:-1], 0, 0]
    beside = 0.2 * rng.random((n - 1, 3, 3))
    own = np.repeat((3 * np.eye(3) + 0.1)[None], n, 0)
    blocks = np.concatenate(
        [own, -beside, -beside.transpose(0, 2, 1), np.repeat(np.eye(3)[None], 2, 0)]
    )
    whole = np.zeros((n, 3, n, 3))
    for i, j, block in zip(rows, columns, blocks, strict=True):
        whole[i, :, j, :] += block
    dense = whole.reshape(3 * n, 3 * n)
    right = rng.random((n, 3))
    solution = np.linalg.solve(dense, right.reshape(-1)).reshape(n, 3)
    for by in ("rows", "metis"):
        graph = wd.Graph(rows, columns, by=by, comm=comm)
        A = wd.Matrix(graph, rows, columns, blocks, dtype=wp.mat33d)
        mine = graph.numbers[graph.first :][: graph.owned]
        assert np.allclose(A.diagonal().numpy(), np.diag(dense).reshape(n, 3)[mine].reshape(-1))
        offsets, places, values = A.csr()
        found = np.zeros((graph.owned, 3, n, 3))
        for row in range(graph.owned):
            part = slice(offsets[row], offsets[row + 1])
            found[row][:, graph.numbers[places[part]]] += values[part].transpose(1, 0, 2)
        assert np.allclose(found, whole[mine])
        b, operator = wp.array(right[mine], dtype=wp.vec3d), wd.LinearOperator(A)
        for kind in ("diag", "chebyshev"):
            x = wp.zeros_like(b)
            cg(operator, b, x, M=preconditioner(operator, kind), tol=1e-11)
            assert np.abs(x.numpy() - solution[mine]).max() < 1e-8, (by, kind)
    # Ranks have cycles of one length, also those whose rows are fewer, and not all as many.
    x = wp.zeros_like(b)
    gmres(operator, b, x, tol=1e-11)
    assert np.abs(x.numpy() - solution[mine]).max() < 1e-8


def stiff_system():
    """A Laplacian whose coefficients lie between 1e-4 and 1e4, of condition 1e8 and more."""
    rows, columns, _, right = poisson((8, 6))
    count = len(right)
    weight = 10.0 ** np.random.default_rng(8).uniform(-4, 4, count)
    inside = rows != columns
    shared = np.sqrt(weight[rows[inside]] * weight[columns[inside]])
    diagonal = np.zeros(count)
    np.add.at(diagonal, rows[inside], shared)
    values = np.r_[-shared, 1e-5 + diagonal]
    every = np.arange(count)
    rows, columns = np.r_[rows[inside], every], np.r_[columns[inside], every]
    dense = np.zeros((count, count))
    dense[rows, columns] = values
    return rows, columns, values, dense


class Sums:
    """Counts the reductions of a communicator."""

    def __init__(self, comm):
        self.comm, self.count = comm, 0
        self.before = comm.all_reduce

    def __enter__(self):
        def counted(*arguments):
            self.count += 1
            self.before(*arguments)

        self.comm.all_reduce = counted
        return self

    def __exit__(self, *_):
        del self.comm.all_reduce


def fused_solver(comm):
    """Fused CG on a stiff system: one sum an iteration, the same bits, the accuracy of plain CG."""
    rows, columns, values, dense = stiff_system()
    assert np.linalg.cond(dense) > 1e8
    right = dense @ np.random.default_rng(9).standard_normal(len(dense))
    before = wp.config.deterministic
    wp.config.deterministic = "run_to_run"
    found, done = [], {}
    try:
        graph = wd.Graph(rows, columns, by="rows", comm=comm)
        A = wd.Matrix(graph, rows, columns, values, dtype=wp.float64)
        mine = graph.numbers[graph.first :][: graph.owned]
        b = wp.array(right[mine], dtype=wp.float64)
        diagonal = wp.array(1.0 / np.diag(dense)[mine], dtype=wp.float64)
        for M in (None, diagonal):
            for fused in (False, True):
                x = wp.zeros_like(b)
                options = {"tol": 1e-7, "maxiter": 20000, "M": M, "fused": fused}
                with Sums(comm) as sums:
                    state = cg(wd.LinearOperator(A), b, x, **options, run=False)
                    iterations, error, atol = state()
                assert error <= atol, (fused, error, atol)
                solution = graph.gather(_padded(graph, x))
                true = np.linalg.norm(dense @ solution - right)
                assert np.isclose(true, error, rtol=1e-2), (true, error)
                done[fused] = iterations
                if comm.size > 1:
                    # The rest is for checks and for the residual at the end.
                    assert sums.count < (1 if fused else 2) * iterations * 1.15 + 20, sums.count
                found += [iterations, checking.digest(solution)]
            assert done[True] <= 1.25 * done[False] + 20, done
    finally:
        wp.config.deterministic = before
    return found


def _padded(graph, own):
    x = graph.zeros(own.dtype)
    wp.copy(graph.inner(x), own)
    return x


@wp.kernel
def laplacian(p: wp.array2d(dtype=float), q: wp.array2d(dtype=float)):
    i, j = wp.tid()
    i = i + 1
    j = j + 1
    q[i - 1, j - 1] = 4.0 * p[i, j] - p[i - 1, j] - p[i + 1, j] - p[i, j - 1] - p[i, j + 1]


def matrix_free(comm):
    """CG with a stencil and `comm=`, captured or not."""
    *_, right = poisson()
    blocks = wd.Blocks((ROWS, COLUMNS), corners=False, comm=comm)
    p = blocks.zeros()
    own, first = blocks.owned, blocks.offset
    q = wp.zeros(own, dtype=float)

    def matvec(x, y, z, alpha, beta):
        assert alpha in (1.0, -1.0)
        wp.copy(blocks.inner(p), x.reshape(own))
        blocks.halo(p)
        wp.launch(laplacian, own, [p, q])
        if beta == 0.0:
            wp.copy(z.reshape(own), q)
        else:
            wp.map(wp.sub, y, q.flatten(), out=z)

    part = right.reshape(ROWS, COLUMNS)
    part = part[first[0] : first[0] + own[0], first[1] : first[1] + own[1]]
    b = wp.array(part.ravel(), dtype=float)
    size = b.size
    operator = LinearOperator((size, size), float, comm.device, matvec)
    before, wp.config.deterministic = wp.config.deterministic, "run_to_run"
    try:
        x = wp.zeros_like(b)
        done, *_ = cg(operator, b, x, tol=1e-6, maxiter=300, comm=comm)
    finally:
        wp.config.deterministic = before
    wp.copy(blocks.inner(p), x.reshape(own))
    whole = blocks.gather(p)
    return None if comm.rank else [done, checking.digest(whole)]


def bad_graphs(comm):
    """Nodes and partitions that do not fit, each one line."""
    who = f"rank {comm.rank}"
    checking.fails(lambda: wd.Graph([0, 5], [1, 2], 3), who, "0 to 2", "5")
    checking.fails(lambda: wd.Graph([0, -1], [1, 2], 3), who, "0 to 2", "got -1")
    checking.fails(lambda: wd.Graph([0, 1], [1], 3), who, "2 and 1")
    if comm.size > 1:
        # Ranks that see other edges, or of which some have METIS and some have not.
        ends = [1, 2 + (comm.rank == 1)]
        checking.fails(lambda: wd.Graph([0, 1], ends, 9), who, "2 edges", "alike on all ranks")
    checking.fails(lambda: wd.Graph([0], [1], 3, by="size"), who, "'size'")
    if comm.size > 2:
        checking.fails(lambda: wd.Graph([0], [1], 2), who, "fewer ranks")
    graph = wd.Graph(np.arange(9), np.arange(9)[::-1], by="rows")
    checking.fails(lambda: graph.halo(wp.zeros(graph.local + 1)), who, "`zeros`")
    first = graph.numbers[graph.first]
    far = (first + 4) % 9
    if graph.local_of([far])[0] < 0:
        checking.fails(lambda: wd.Matrix(graph, [first], [far], [1.0]), who, "no neighbour")
    checking.fails(lambda: wd.bsr_mv(1, wp.zeros(3)), "int")
    checking.fails(lambda: wd.Graph([0.5], [1.0], 3), who, "integers", "float64")
    checking.fails(lambda: wd.Matrix(graph, [0, 1], [0], [1.0, 2.0]), who, "2, 1 and 2")
    checking.fails(lambda: wd.Matrix(graph, [0, 9], [0, 1], [1.0, 2.0]), who, "0 to 8", "row 9")
    A = wd.Matrix(graph, np.arange(9), np.arange(9), np.ones(9))
    checking.fails(lambda: wd.bsr_mv(A, wp.zeros(99)), who, f"x expects {graph.owned}", "(99,)")
    checking.fails(lambda: wd.bsr_mv(A, np.zeros(3)), who, "ndarray")


CHECKS = [
    graph_operations,
    products_and_solvers,
    fused_solver,
    polynomials,
    block_systems,
    matrix_free,
    bad_graphs,
]
