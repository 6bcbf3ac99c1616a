"""Work-precision of Poisson's equation: error against run time, over degrees and meshes.

    python examples/fem/convergence.py [--device cpu] [--most 40]

The solution is a product of sines. Each mesh is assembled and solved by conjugate gradients in
float64. The order of convergence is printed; theory says that it is the degree + 1. Writes
build/demo/convergence_<device>.png.
"""

import argparse
import math
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp
from warp import fem
from warp.optim import linear

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"
PI = wp.constant(math.pi)
REAL = wp.float64


@fem.integrand
def diffusion(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    x = fem.position(domain, s)
    return 2.0 * PI * PI * wp.sin(PI * x[0]) * wp.sin(PI * x[1]) * v(s)


@fem.integrand
def squared_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    x = fem.position(domain, s)
    e = u(s) - wp.sin(PI * x[0]) * wp.sin(PI * x[1])
    return e * e


def triangles(n):
    """Two triangles for each square of a grid."""
    x = np.linspace(0.0, 1.0, n + 1)
    points = np.stack(np.meshgrid(x, x, indexing="ij"), -1).reshape(-1, 2)
    cells = wp.array(fem.utils.grid_to_tris(n, n), dtype=int)
    return fem.Trimesh2D(cells, wp.array(points, dtype=wp.vec2d))


def squares(n):
    """A dense grid."""
    return fem.Grid2D(res=wp.vec2i(n, n), scalar_type=REAL)


def once(geo, degree):
    """Seconds, space, cells and solution of one mesh."""
    start = time.perf_counter()
    space = fem.make_polynomial_space(geo, degree=degree, dtype=REAL)
    cells = fem.Cells(geo)
    u, v = fem.make_trial(space, domain=cells), fem.make_test(space, domain=cells)
    rule = fem.RegularQuadrature(cells, order=2 * degree + 2)
    A = fem.integrate(diffusion, fields={"u": u, "v": v})
    b = fem.integrate(load, quadrature=rule, fields={"v": v})
    fem.dirichlet(space).project(A, b)
    field = space.make_field()
    M = linear.preconditioner(A, "diag")
    linear.cg(A, b, field.dof_values, tol=1e-12, M=M, check_every=50)
    wp.synchronize()
    return time.perf_counter() - start, space, cells, field


def solve(geo, degree):
    """Seconds and L2 error of one mesh, the second time it is solved."""
    once(geo, degree)
    seconds, space, cells, field = once(geo, degree)
    fine = fem.RegularQuadrature(cells, order=2 * degree + 4)
    square = fem.integrate(squared_error, quadrature=fine, fields={"u": field})
    return seconds, math.sqrt(square), space.node_count()


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--most", type=int, default=40, help="cells along an axis, degree 1")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(figsize=(6, 4))
    print("| mesh | degree | cells along an axis | nodes | time [s] | L2 error | order |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    with wp.ScopedDevice(options.device):
        for make, style in ((squares, "-"), (triangles, "--")):
            for degree in (1, 2, 3, 4):
                sizes = [max(2, options.most // (degree * k)) for k in (4, 2, 1)]
                found = [solve(make(n), degree) for n in sizes]
                for k, (n, (seconds, error, nodes)) in enumerate(zip(sizes, found, strict=True)):
                    order = "-"
                    if k and sizes[k] > sizes[k - 1]:
                        ratio = math.log(sizes[k] / sizes[k - 1])
                        order = f"{math.log(found[k - 1][1] / error) / ratio:.2f}"
                    numbers = f"{nodes} | {seconds:.4f} | {error:.2e} | {order}"
                    print(f"| {make.__name__} | {degree} | {n} | {numbers} |")
                label = f"{make.__name__}, degree {degree}"
                seconds, errors, _ = zip(*found, strict=True)
                axes.loglog(seconds, errors, style, marker="o", color=f"C{degree}", label=label)
    axes.set(xlabel="time [s]", ylabel="L2 error")
    axes.legend(fontsize=7)
    figure.tight_layout()
    name = f"convergence_{options.device.replace(':', '')}.png"
    figure.savefig(options.output / name, dpi=80)


if __name__ == "__main__":
    main()
