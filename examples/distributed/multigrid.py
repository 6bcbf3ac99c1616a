"""Preconditioners over ranks: Chebyshev polynomials, and algebraic multigrid of other libraries.

    pip install pyamg
    python examples/distributed/multigrid.py [--size 96]
    mpirun -n 4 python examples/distributed/multigrid.py

Heat flows through a square with inclusions that conduct a hundred times worse. PETSc (petsc4py)
coarsens the whole matrix, over all ranks of MPI; PyAMG does each rank's own rows, so that its
iterations grow with the number of ranks. Both get rows and vectors as they lie in the memory of the
host. Without them two curves are drawn. AmgX takes the same rows (`Matrix.csr`) on GPUs.
"""

import argparse
import importlib.util
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp
import warp.distributed as wd
from warp.optim.linear import LinearOperator, cg, preconditioner

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"


def diffusion(n):
    """Triplets of finite volumes on n x n cells: faces conduct by harmonic means."""
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    conducts = np.where((i * 6 // n % 2 == 1) & (j * 6 // n % 2 == 1), 0.01, 1.0)
    number = np.arange(n * n).reshape(n, n)
    pairs = [(np.s_[1:, :], np.s_[:-1, :]), (np.s_[:, 1:], np.s_[:, :-1])]
    a = np.concatenate([number[one].ravel() for one, _ in pairs])
    b = np.concatenate([number[other].ravel() for _, other in pairs])
    k = conducts.ravel()
    face = 2 / (1 / k[a] + 1 / k[b])
    # Walls are half a cell away and cold.
    walls = ((i == 0) | (i == n - 1)).astype(float) + ((j == 0) | (j == n - 1))
    diagonal = (2 * walls * conducts).ravel()
    np.add.at(diagonal, a, face)
    np.add.at(diagonal, b, face)
    every = number.ravel()
    return np.r_[a, b, every], np.r_[b, a, every], np.r_[-face, -face, diagonal]


def by_petsc(A, comm):
    """GAMG of PETSc: rows are numbered rank after rank, ghosts as their owners say."""
    from petsc4py import PETSc

    graph = A.graph
    first = sum(comm.gather_objects(graph.owned)[: comm.rank])
    place = graph.zeros(wp.int64)
    graph.inner(place).assign(np.arange(first, first + graph.owned))
    graph.halo(place)
    offsets, columns, values = A.csr()
    world = comm.comm if comm.size > 1 else PETSc.COMM_SELF
    size = graph.owned, PETSc.DETERMINE
    indices = place.numpy()[columns].astype(PETSc.IntType)
    matrix = PETSc.Mat().createAIJ((size, size), csr=(offsets, indices, values), comm=world)
    multigrid = PETSc.PC().create(world)
    multigrid.setOperators(matrix)
    multigrid.setType("gamg")
    multigrid.setUp()
    given, found = matrix.createVecs()

    def apply(x):
        given.setArray(x)
        multigrid.apply(given, found)
        return found.getArray()

    return apply


def by_pyamg(A, comm):
    """Smoothed aggregation of PyAMG on the block of own rows and columns."""
    import pyamg
    import scipy.sparse

    graph = A.graph
    offsets, columns, values = A.csr()
    rows = scipy.sparse.csr_matrix((values, columns, offsets), shape=(graph.owned, graph.local))
    block = rows[:, graph.first : graph.first + graph.owned].tocsr()
    multigrid = pyamg.smoothed_aggregation_solver(block).aspreconditioner(cycle="V")
    return multigrid.matvec


def operator(A, apply):
    """A preconditioner of a function of NumPy vectors."""

    def matvec(x, y, z, alpha, beta):
        found = alpha * apply(x.numpy())
        z.assign(found + beta * y.numpy() if beta else found)

    return LinearOperator(A.shape, A.scalar, A.graph.comm.device, matvec)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    comm = wd.init()
    n = options.size
    rows, columns, values = diffusion(n)
    graph = wd.Graph(rows, columns, by="rows")
    A = wd.Matrix(graph, rows, columns, values, wp.float64)
    x, y = np.meshgrid(*[(np.arange(n) + 0.5) / n] * 2, indexing="ij")
    exact = (x * (1 - x) * np.sin(3 * np.pi * y)).ravel()
    right = np.zeros(n * n)
    np.add.at(right, rows, values * exact[columns])
    mine = graph.numbers[graph.first :][: graph.owned]
    b = wp.array(right[mine], dtype=wp.float64)

    whole = wd.LinearOperator(A)
    ways = {"none": None, "Chebyshev": preconditioner(whole, "chebyshev")}
    if importlib.util.find_spec("petsc4py") and comm.engine in ("none", "MPI"):
        ways["PETSc"] = operator(A, by_petsc(A, comm))
    if importlib.util.find_spec("pyamg"):
        ways["PyAMG"] = operator(A, by_pyamg(A, comm))
    if comm.rank == 0 and len(ways) == 2:
        print("no multigrid: install pyamg, or petsc4py")
    histories: dict[str, list[float]] = {}
    lines = []
    for name, M in ways.items():
        solution = wp.zeros_like(b)
        history = histories[name] = []
        # Functions of the host are in no graph of a GPU.
        done, _, _ = cg(
            *(whole, b, solution),
            M=M,
            tol=1e-9,
            check_every=1,
            use_cuda_graph=False,
            callback=lambda *found, history=history: history.append(found[:2]),
        )
        error = max(comm.gather_objects(np.abs(solution.numpy() - exact[mine]).max(initial=0)))
        lines.append(f"{name} {done} iterations, error {error:.0e}")
    if comm.rank:
        return
    options.output.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(figsize=(6, 4))
    for name, history in histories.items():
        axes.semilogy(*zip(*history, strict=True), label=name)
    axes.set(xlabel="iteration", ylabel="residual", title=f"{comm.size} rank(s), {n * n} cells")
    axes.legend()
    figure.savefig(options.output / "multigrid.png", dpi=110, bbox_inches="tight")
    print(f"{comm.size} rank(s): {'; '.join(lines)}")


if __name__ == "__main__":
    main()
