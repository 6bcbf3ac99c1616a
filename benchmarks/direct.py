"""Direct solvers beside SuperLU, CHOLMOD and conjugate gradients.

    python benchmarks/direct.py [--scale 1.0]

Five matrices of the kinds that the SuiteSparse collection has: a Poisson problem in the plane and
one in space, a thin plate of nearly incompressible rubber, a network of springs whose stiffnesses
span twelve decades, and advection with upwind differences, which is not symmetric. Prints processor
time of factor and solution, numbers in the factors, the componentwise backward error of the
solution, and its error against the vector that the right-hand side was made of. SciPy and
scikit-sparse are used where they are installed.
"""

import argparse
import time

import numpy as np

import warp as wp
from warp.optim import linear
from warp.sparse import bsr_from_triplets

STEPS = 2000


def stencil(shape):
    """Rows, columns and numbers of minus the Laplacian on a grid."""
    number = np.arange(np.prod(shape)).reshape(shape)
    rows, columns, values = [], [], []
    for axis in range(len(shape)):
        n = np.moveaxis(number, axis, 0)
        low, high = n[:-1].ravel(), n[1:].ravel()
        everything = number.ravel()
        rows += [low, high, everything]
        columns += [high, low, everything]
        values += [np.full(low.size, -1.0)] * 2 + [np.full(everything.size, 2.0)]
    return tuple(map(np.concatenate, (rows, columns, values)))


def plate(cells):
    """Bilinear quadrilaterals of a plate 20 times as long as high, Poisson's ratio 0.4999."""
    nx, ny, ratio = 8 * cells, cells, 0.4999
    hx, hy = 20.0 / nx, 1.0 / ny
    d = np.array([[1 - ratio, ratio, 0], [ratio, 1 - ratio, 0], [0, 0, 0.5 - ratio]])
    d /= (1 + ratio) * (1 - 2 * ratio)
    local = np.zeros((8, 8))
    for a in (-1, 1):
        for b in (-1, 1):
            x, y = a / np.sqrt(3.0), b / np.sqrt(3.0)
            dx = np.array([-(1 - y), 1 - y, 1 + y, -(1 + y)]) / (2 * hx)
            dy = np.array([-(1 - x), -(1 + x), 1 + x, 1 - x]) / (2 * hy)
            strain = np.zeros((3, 8))
            strain[0, 0::2], strain[1, 1::2] = dx, dy
            strain[2, 0::2], strain[2, 1::2] = dy, dx
            local += strain.T @ d @ strain * (hx * hy / 4)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"))
    corner = i * (ny + 1) + j
    nodes = np.stack([corner, corner + ny + 1, corner + ny + 2, corner + 1], 1)
    places = np.stack([2 * nodes, 2 * nodes + 1], 2).reshape(-1, 8)
    rows, columns = np.repeat(places, 8, 1).ravel(), np.tile(places, 8).ravel()
    values = np.tile(local.ravel(), len(places))
    # The end at x = 0 is held.
    held = 2 * (ny + 1)
    free = (rows >= held) & (columns >= held)
    return rows[free] - held, columns[free] - held, values[free]


def springs(count, decades=12.0):
    """A grid of springs, each stiffness a power of ten of its own, tied to the ground."""
    rng = np.random.default_rng(1)
    number = np.arange(count * count).reshape(count, count)
    a = np.concatenate([number[:-1].ravel(), number[:, :-1].ravel()])
    b = np.concatenate([number[1:].ravel(), number[:, 1:].ravel()])
    k = 10.0 ** rng.uniform(0.0, decades, a.size)
    tie = np.ones(number.size)
    rows = np.concatenate([a, b, a, b, number.ravel()])
    columns = np.concatenate([a, b, b, a, number.ravel()])
    return rows, columns, np.concatenate([k, k, -k, -k, tie])


def upwind(count, speed=2000.0):
    """Diffusion and fast advection along a turned direction."""
    rows, columns, values = stencil((count, count))
    number = np.arange(count * count).reshape(count, count)
    here, west, south = number.ravel(), number[:-1].ravel(), number[:, :-1].ravel()
    h = speed / count
    rows = np.concatenate([rows, here, number[1:].ravel(), number[:, 1:].ravel()])
    columns = np.concatenate([columns, here, west, south])
    more = [np.full(here.size, 1.5 * h), np.full(west.size, -h), np.full(south.size, -0.5 * h)]
    return rows, columns, np.concatenate([values, *more])


def matrices(scale):
    plane, space = int(200 * scale**0.5), int(24 * scale ** (1 / 3))
    yield "Poisson, plane", True, stencil((plane, plane))
    yield "Poisson, space", True, stencil((space,) * 3)
    yield "rubber plate", True, plate(int(32 * scale**0.5))
    yield "springs, 12 decades", True, springs(int(150 * scale**0.5))
    yield "advection", False, upwind(plane)


def timed(work):
    start = time.process_time()
    result = work()
    return result, time.process_time() - start


def entry(package, how, factor, solve, nnz, x, apart, exact):
    """One row of the table; `apart` gives b - A x and |A| |x| + |b|."""
    left, size = apart(x)
    print(
        f"| {package} | {how} | {1e3 * factor:.0f} | {1e3 * solve:.1f} | {nnz} | "
        f"{np.max(np.abs(left) / size):.1e} | {np.abs(left).max() / size.max():.1e} | "
        f"{np.linalg.norm(x - exact) / np.linalg.norm(exact):.1e} |",
        flush=True,
    )


def own(kinds, triplets, n, b, row):
    rows, columns, values = triplets
    parts = [wp.array(a.astype(np.int32), dtype=int, device="cpu") for a in (rows, columns)]
    matrix = bsr_from_triplets(n, n, *parts, wp.array(values, dtype=wp.float64, device="cpu"))
    right = wp.array(b, dtype=wp.float64, device="cpu")
    for kind in kinds:
        solver, factor = timed(lambda kind=kind: getattr(linear, kind)(matrix))
        x, solve = timed(lambda solver=solver: solver.solve(right).numpy())
        row("this package", kind, factor, solve, f"{solver.nnz:,}", x)
    return matrix, right, solver.condition


def stepped(matrix, right, row):
    x = wp.zeros_like(right)
    done, took = timed(lambda: linear.cg(matrix, right, x, tol=1e-12, maxiter=STEPS))
    row("this package", f"cg, {int(done[0]):,} steps", 0.0, took, "-", x.numpy())


def others(symmetric, triplets, n, b, row):
    try:
        import scipy.sparse as sp
        from scipy.sparse.linalg import splu
    except ImportError:
        print("| SciPy | not installed | - | - | - | - | - | - |")
        return
    rows, columns, values = triplets
    a = sp.csc_matrix((values, (rows, columns)), shape=(n, n))
    factors, factor = timed(lambda: splu(a))
    x, solve = timed(lambda: factors.solve(b))
    row("SuperLU", "lu, COLAMD", factor, solve, f"{factors.L.nnz + factors.U.nnz:,}", x)
    if not symmetric:
        return
    try:
        from sksparse import cholmod
    except ImportError:
        print("| CHOLMOD | not installed | - | - | - | - | - | - |")
        return
    make = getattr(cholmod, "cho_factor", None) or cholmod.cholesky
    factors, factor = timed(lambda: make(a))
    x, solve = timed(lambda: factors.solve(b) if hasattr(factors, "solve") else factors(b))
    inside = factors.L() if callable(getattr(factors, "L", None)) else getattr(factors, "L", None)
    nnz = f"{inside.nnz:,}" if inside is not None else "-"
    row("CHOLMOD", "cholesky, AMD", factor, solve, nnz, x)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scale", type=float, default=1.0, help="of the number of unknowns")
    options = parser.parse_args()
    wp.config.quiet = True
    for name, symmetric, triplets in matrices(options.scale):
        rows, columns, values = triplets
        n = int(rows.max()) + 1
        exact = np.sin(np.arange(n) * 0.37) + 0.5
        # Summed in the widest type, so that the right-hand side adds no error of its own.
        b = np.zeros(n, np.longdouble)
        np.add.at(b, rows, values.astype(np.longdouble) * exact[columns])
        b = b.astype(np.float64)

        def apart(x, rows=rows, columns=columns, values=values, b=b):
            left, size = b.astype(np.longdouble), np.abs(b)
            np.subtract.at(left, rows, values.astype(np.longdouble) * x[columns])
            np.add.at(size, rows, np.abs(values) * np.abs(x[columns]))
            return left.astype(np.float64), size

        def row(*cells, apart=apart, exact=exact):
            entry(*cells, apart, exact)

        print(f"\n### {name}: {n:,} unknowns\n")
        print("| package | method | factor ms | solve ms | numbers | backward | normwise | error |")
        print("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |")
        kinds = ("ldlt", "cholesky", "lu") if symmetric else ("lu",)
        matrix, right, condition = own(kinds, triplets, n, b, row)
        others(symmetric, triplets, n, b, row)
        if symmetric:
            stepped(matrix, right, row)
        print(f"\ncondition about {condition:.1e}")


if __name__ == "__main__":
    main()
