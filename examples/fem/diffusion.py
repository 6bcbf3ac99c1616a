"""Heat spreads in an insulated square: implicit steps in time against the exact solution.

    python examples/fem/diffusion.py [--device cpu] [--cells 12] [--steps 16]

A spot of heat and its images behind the walls are the exact solution. The matrix of a
Crank-Nicolson step is assembled and factored once. The program prints the order of convergence in
the size of steps, which theory says is 2, and how much heat is lost, which is none. Writes
build/demo/diffusion_<device>.png.
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
CENTER = wp.vec2d(0.3, 0.4)
BEGIN, END = 0.004, 0.02


@fem.integrand
def spot(x: wp.float64, center: wp.float64, t: wp.float64):
    """Heat at time t of a point in an insulated unit interval, by images."""
    total = 0.0 * x
    for k in range(-2, 3):
        shift = 2.0 * wp.float64(k)
        a, b = x - center - shift, x + center - shift
        total += wp.exp(-a * a / (4.0 * t)) + wp.exp(-b * b / (4.0 * t))
    return total / wp.sqrt(4.0 * PI * t)


@fem.integrand
def heat(s: fem.Sample, domain: fem.Domain, t: wp.float64):
    x = fem.position(domain, s)
    return spot(x[0], CENTER[0], t) * spot(x[1], CENTER[1], t)


@fem.integrand
def squared_error(s: fem.Sample, domain: fem.Domain, u: fem.Field, t: wp.float64):
    e = u(s) - heat(s, domain, t)
    return e * e


@fem.integrand
def step_form(s: fem.Sample, u: fem.Field, v: fem.Field, weight: wp.float64):
    """The mass, and the diffusion during a part of a step."""
    return u(s) * v(s) + weight * wp.dot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def value(s: fem.Sample, u: fem.Field):
    return u(s)


def triangles(n):
    """Two triangles for each square of a grid."""
    x = np.linspace(0.0, 1.0, n + 1)
    points = np.stack(np.meshgrid(x, x, indexing="ij"), -1).reshape(-1, 2)
    cells = wp.array(fem.utils.grid_to_tris(n, n), dtype=int)
    return fem.Trimesh2D(cells, wp.array(points, dtype=wp.vec2d))


def squares(n):
    """A dense grid."""
    return fem.Grid2D(res=wp.vec2i(n, n), scalar_type=wp.float64)


def solve(geo, degree, steps):
    """Seconds, fields at begin and end, relative L2 error and relative loss of heat."""
    start = time.perf_counter()
    space = fem.make_polynomial_space(geo, degree=degree, dtype=wp.float64)
    cells, u = fem.Cells(geo), space.make_field()
    fine = fem.RegularQuadrature(cells, order=2 * degree + 4)
    fem.interpolate(heat, dest=u, values={"t": BEGIN})
    first, half = u.dof_values.numpy().copy(), 0.5 * (END - BEGIN) / steps
    test, trial = fem.make_test(space, domain=cells), fem.make_trial(space, domain=cells)
    forward = fem.integrate(step_form, fields={"u": trial, "v": test}, values={"weight": -half})
    A = fem.integrate(step_form, fields={"u": trial, "v": test}, values={"weight": half})
    solver, before = linear.cholesky(A), fem.integrate(value, domain=cells, fields={"u": u})
    for _ in range(steps):
        solver.solve(forward @ u.dof_values, u.dof_values)
    seconds = time.perf_counter() - start
    lost = abs(fem.integrate(value, domain=cells, fields={"u": u}) / before - 1.0)
    square = fem.integrate(squared_error, quadrature=fine, fields={"u": u}, values={"t": END})
    return seconds, space, (first, u.dof_values.numpy()), math.sqrt(square), lost


def draw(axes, space, values, title):
    """A map of the temperature, by nodes."""
    x, y = space.node_positions().numpy().T
    axes.tripcolor(x, y, values, shading="gouraud", cmap="inferno")
    axes.set(title=title, aspect="equal", xticks=(), yticks=())


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--cells", type=int, default=12, help="along an axis")
    parser.add_argument("--steps", type=int, default=16, help="the least number of steps")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(1, 3, figsize=(9, 3))
    print("| cells | nodes | steps | time [s] | L2 error | order | lost heat |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    found = []
    with wp.ScopedDevice(options.device):
        for make, style in ((triangles, "--"), (squares, "-")):
            sizes, errors = [options.steps * 2**k for k in range(3)], []
            for steps in sizes:
                found.append(solve(make(options.cells), 4, steps))
                seconds, space, _, error, lost = found[-1]
                errors.append(error)
                order = f"{math.log2(errors[-2] / error):.2f}" if len(errors) > 1 else "-"
                numbers = f"{seconds:.2f} | {error:.2e} | {order} | {lost:.1e}"
                print(f"| {make.__name__} | {space.node_count()} | {steps} | {numbers} |")
            axes[2].loglog(sizes, errors, style, marker="o", label=make.__name__)
    _, space, values, _, _ = found[-1]
    draw(axes[0], space, values[0], f"t = {BEGIN}")
    draw(axes[1], space, values[1], f"t = {END}")
    axes[2].set(xlabel="steps", title="L2 error")
    axes[2].legend()
    figure.tight_layout()
    figure.savefig(options.output / f"diffusion_{options.device.replace(':', '')}.png", dpi=80)


if __name__ == "__main__":
    main()
