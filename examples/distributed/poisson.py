"""Conjugate gradients over ranks: a Poisson problem, convergence, and work by number of ranks.

    python examples/distributed/poisson.py [--size 96]
    mpirun -n 4 python examples/distributed/poisson.py

The matrix is split by rows; rows without ghosts are multiplied while the halo travels. With
`wp.config.deterministic` inner products are exact, so every number of ranks takes the same steps to
the same bits: compare the checksum of the last line.
"""

import argparse
import zlib
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp
import warp.distributed as wd
from warp.optim.linear import cg

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"


def laplacian(n):
    """Triplets of the 5-point operator on n x n points."""
    number = np.arange(n * n).reshape(n, n)
    a = np.concatenate([number[1:].ravel(), number[:, 1:].ravel()])
    b = np.concatenate([number[:-1].ravel(), number[:, :-1].ravel()])
    every = number.ravel()
    rows, columns = np.r_[a, b, every], np.r_[b, a, every]
    return rows, columns, np.r_[-np.ones(2 * len(a)), np.full(n * n, 4.0)]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    comm = wd.init()
    n = options.size
    wp.config.deterministic = "run_to_run"
    rows, columns, values = laplacian(n)
    graph = wd.Graph(rows, columns, by="rows")
    A = wd.Matrix(graph, rows, columns, values, wp.float64)
    x, y = np.meshgrid(*[np.linspace(0, 1, n + 2)[1:-1]] * 2, indexing="ij")
    exact = np.sin(np.pi * x) * np.sin(2 * np.pi * y)
    # The discrete operator's eigenvalue: the answer is known exactly.
    h = 1 / (n + 1)
    eigenvalue = 4 - 2 * np.cos(np.pi * h) - 2 * np.cos(2 * np.pi * h)
    rough = np.random.default_rng(0).standard_normal((n, n))
    right = (eigenvalue * exact).ravel()
    b = wp.array(graph.scatter(right)[graph.first :][: graph.owned], dtype=wp.float64)
    start = wp.array(graph.scatter(rough.ravel())[graph.first :][: graph.owned], dtype=wp.float64)
    history = []

    def note(iteration, residual, tolerance):
        history.append((iteration, residual))

    operator = wd.LinearOperator(A)
    done, residual, _ = cg(operator, b, start, tol=1e-10, callback=note, check_every=5)
    solution = graph.zeros(wp.float64)
    wp.copy(graph.inner(solution), start)
    whole = graph.gather(solution).reshape(n, n)
    if comm.rank:
        return
    error = np.abs(whole - exact).max()
    options.output.mkdir(parents=True, exist_ok=True)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4))
    left.semilogy(*zip(*history, strict=True), marker=".")
    left.set(xlabel="iteration", ylabel="residual", title=f"{comm.size} rank(s)")
    image = right.imshow(whole.T, origin="lower", extent=(0, 1, 0, 1))
    right.set(title="solution")
    figure.colorbar(image)
    figure.savefig(options.output / "poisson.png", dpi=110, bbox_inches="tight")
    checksum = zlib.crc32(whole.tobytes())
    print(
        f"{comm.size} rank(s): {done} iterations, residual {residual:.1e}, error {error:.1e}, "
        f"checksum {checksum:08x}"
    )


if __name__ == "__main__":
    main()
