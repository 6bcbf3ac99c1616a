"""A spot turns and spreads: convection and diffusion by discontinuous Galerkin's method.

    python examples/fem/transport.py [--device cpu] [--cells 12]

Upwind fluxes carry the spot, the symmetric interior penalty spreads it (Di Pietro and Ern, 2012).
The exact solution is a Gaussian that turns and widens. The program prints the order of convergence,
which theory says is the degree + 1, and by how much the mass changes, which is none until the spot
feels the boundary. Writes build/demo/transport_<device>.png.
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
WIDTH, DIFFUSIVITY, END = 0.06, 5e-4, 1.0
MIDDLE, CENTER = wp.vec2d(0.5, 0.5), wp.vec2d(0.5, 0.65)


@wp.func
def velocity(x: wp.vec2d):
    """One radian in unit time about the middle."""
    r = x - MIDDLE
    return wp.vec2d(-r[1], r[0])


@fem.integrand
def spot(s: fem.Sample, domain: fem.Domain, t: wp.float64):
    """The exact solution."""
    d = CENTER - MIDDLE
    turned = wp.vec2d(wp.cos(t) * d[0] - wp.sin(t) * d[1], wp.sin(t) * d[0] + wp.cos(t) * d[1])
    r = fem.position(domain, s) - MIDDLE - turned
    start, variance = WIDTH * WIDTH, WIDTH * WIDTH + 2.0 * DIFFUSIVITY * t
    return start / variance * wp.exp(-0.5 * wp.length_sq(r) / variance)


@fem.integrand
def squared_error(s: fem.Sample, domain: fem.Domain, u: fem.Field, t: wp.float64):
    e = u(s) - spot(s, domain, t)
    return e * e


@fem.integrand
def mass(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s)


@fem.integrand
def load(s: fem.Sample, domain: fem.Domain, v: fem.Field, t: wp.float64):
    return spot(s, domain, t) * v(s)


@fem.integrand
def flow_in_cells(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    x = fem.position(domain, s)
    flux = DIFFUSIVITY * fem.grad(u, s) - u(s) * velocity(x)
    return wp.dot(flux, fem.grad(v, s))


@fem.integrand
def flow_across_sides(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    """Upwind transport and interior penalty; jumps are 0 on the boundary."""
    n, x = fem.normal(domain, s), fem.position(domain, s)
    speed = wp.dot(velocity(x), n)
    k = wp.float64(fem.degree(u) + 1)
    penalty = 2.0 * k * k * fem.measure_ratio(domain, s)
    up = speed * fem.average(u, s) + 0.5 * wp.abs(speed) * fem.jump(u, s)
    spread = penalty * fem.jump(u, s) - wp.dot(fem.grad_average(u, s), n)
    symmetric = wp.dot(fem.grad_average(v, s), n) * fem.jump(u, s)
    return (up + DIFFUSIVITY * spread) * fem.jump(v, s) - DIFFUSIVITY * symmetric


@fem.integrand
def flow_across_boundary(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    """The flow out; nothing comes in."""
    speed = wp.dot(velocity(fem.position(domain, s)), fem.normal(domain, s))
    return wp.max(speed, wp.float64(0.0)) * u(s) * v(s)


def solve(n, degree, steps):
    """Seconds, the field, its L2 error, and the relative change of mass."""
    start = time.perf_counter()
    geo = fem.Grid2D(res=wp.vec2i(n, n), scalar_type=wp.float64)
    space = fem.make_polynomial_space(geo, degree=degree, discontinuous=True, dtype=wp.float64)
    cells, sides, boundary = fem.Cells(geo), fem.Sides(geo), fem.BoundarySides(geo)

    def fields(domain):
        trial, test = fem.make_trial(space, domain=domain), fem.make_test(space, domain=domain)
        return {"u": trial, "v": test}

    M = fem.integrate(mass, fields=fields(cells))
    K = fem.integrate(flow_in_cells, quadrature=rule(cells, degree), fields=fields(cells))
    for form, domain in ((flow_across_sides, sides), (flow_across_boundary, boundary)):
        K += fem.integrate(form, quadrature=rule(domain, degree), fields=fields(domain))
    half, u, fine = 0.5 * END / steps, space.make_field(), rule(cells, degree + 2)
    b = fem.integrate(load, quadrature=fine, fields={"v": fields(cells)["v"]}, values={"t": 0.0})
    linear.cg(M, b, u.dof_values, tol=1e-14)
    solver, forward = linear.lu(M + half * K), M - half * K
    before = (M @ u.dof_values).numpy().sum()
    for _ in range(steps):
        solver.solve(forward @ u.dof_values, u.dof_values)
    seconds, change = time.perf_counter() - start, (M @ u.dof_values).numpy().sum() / before - 1.0
    square = fem.integrate(squared_error, quadrature=fine, fields={"u": u}, values={"t": END})
    return seconds, u, math.sqrt(square), abs(change)


def rule(domain, degree):
    """A rule for products of two functions and a velocity that is linear."""
    return fem.RegularQuadrature(domain, order=2 * degree + 1)


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--cells", type=int, default=12, help="along an axis of the coarse grids")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    print("| degree | cells | degrees of freedom | time [s] | L2 error | order | change of mass |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    figure, axes = plt.subplots(1, 2, figsize=(7, 3.2))
    solutions = []
    with wp.ScopedDevice(options.device):
        for degree in (1, 2, 3):
            sizes, errors = (options.cells, 2 * options.cells), []
            for n in sizes:
                # Errors of steps are below those of cells.
                steps = math.ceil(0.6 * n ** ((degree + 1) / 2))
                seconds, u, error, change = solve(n, degree, steps)
                errors.append(error)
                solutions.append(u)
                order = f"{math.log2(errors[0] / error):.2f}" if len(errors) > 1 else "-"
                numbers = f"{seconds:.2f} | {error:.2e} | {order} | {change:.1e}"
                print(f"| {degree} | {n * n} | {u.space.node_count()} | {numbers} |")
            axes[1].semilogy(sizes, errors, "o-", label=f"degree {degree}")
    u = solutions[-1]
    x, y = u.space.node_positions().numpy().T
    axes[0].tripcolor(x, y, u.dof_values.numpy(), shading="gouraud")
    angles = np.linspace(0.0, END, 50)
    d = CENTER[1] - 0.5
    axes[0].plot(0.5 - d * np.sin(angles), 0.5 + d * np.cos(angles), "w--", linewidth=1)
    axes[0].set(aspect="equal", xticks=(), yticks=(), title=f"t = {END}")
    axes[1].set(xlabel="cells along an axis", title="L2 error")
    axes[1].legend()
    figure.tight_layout()
    figure.savefig(options.output / f"transport_{options.device.replace(':', '')}.png", dpi=80)


if __name__ == "__main__":
    main()
