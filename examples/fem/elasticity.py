"""A thick rubber tube under pressure: displacements alone lock, a mixed method does not.

    python examples/fem/elasticity.py [--device cpu] [--cells 4]

Plane strain of a quarter of a tube, as Poisson's ratio nears 1/2, against the solution of Lame.
Displacements of degree 1 lock: their error grows with the bulk modulus. Displacements of degree 2
with a continuous pressure of degree 1 (Taylor and Hood) have the same error for every ratio, 1/2
included. Cells are squares bent by a field of degree 2. Writes build/demo/elasticity_<device>.png.
"""

import argparse
import math
import time
from pathlib import Path

import blocks
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.tri import Triangulation

import warp as wp
from warp import fem

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"
INNER, OUTER, MU, PRESSURE = 0.5, 1.0, 1.0, 0.1


@fem.integrand
def stiffness(s: fem.Sample, u: fem.Field, v: fem.Field, bulk: wp.float64):
    shear = 2.0 * MU * wp.ddot(fem.D(u, s), fem.D(v, s))
    return shear + bulk * fem.div(u, s) * fem.div(v, s)


@fem.integrand
def constraint(s: fem.Sample, u: fem.Field, q: fem.Field):
    return -q(s) * fem.div(u, s)


@fem.integrand
def compression(s: fem.Sample, p: fem.Field, q: fem.Field, bulk: wp.float64):
    return -p(s) * q(s) / bulk


@fem.integrand
def load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    """Pressure on the inner wall."""
    x = fem.position(domain, s)
    if wp.length(x) < 0.6:
        return -PRESSURE * wp.dot(v(s), fem.normal(domain, s))
    return 0.0 * v(s)[0]


@fem.integrand
def bend(s: fem.Sample, domain: fem.Domain):
    """The unit square to a quarter of the tube."""
    x = fem.position(domain, s)
    r, angle = INNER + (OUTER - INNER) * x[0], 0.5 * wp.pi * x[1]
    return r * wp.vec2d(wp.cos(angle), wp.sin(angle))


@fem.integrand
def squared_error(s: fem.Sample, domain: fem.Domain, u: fem.Field, a: wp.float64, b: wp.float64):
    x = fem.position(domain, s)
    e = u(s) - (a + b / wp.length_sq(x)) * x
    return wp.length_sq(e)


@fem.integrand
def squared(s: fem.Sample, domain: fem.Domain, a: wp.float64, b: wp.float64):
    x = fem.position(domain, s)
    return wp.length_sq((a + b / wp.length_sq(x)) * x)


def lame(bulk):
    """u = (a + b / r^2) x, with no traction on the outer wall."""
    first = 0.0 if math.isinf(bulk) else 1.0 / (2.0 * (bulk + MU))
    scale = PRESSURE * INNER**2 / (OUTER**2 - INNER**2)
    return {"a": scale * first, "b": scale * OUTER**2 / (2.0 * MU)}


def tube(n):
    """Cells of the quarter of the tube, curved by a field of degree 2."""
    flat = fem.Grid2D(res=wp.vec2i(n, 2 * n), scalar_type=wp.float64)
    positions = fem.make_polynomial_space(flat, degree=2, dtype=wp.vec2d).make_field()
    fem.interpolate(bend, dest=positions)
    return positions.make_deformed_geometry(relative=False)


def symmetry(space):
    """Numbers of the displacements that symmetry fixes: y on the x axis, x on the y axis."""
    x = space.node_positions().numpy()
    rows = np.arange(len(x))
    return np.concatenate([2 * rows[x[:, 1] < 1e-9] + 1, 2 * rows[x[:, 0] < 1e-9]])


def solve(geo, degree, bulk):
    """Seconds, the displacement, and its relative error."""
    start = time.perf_counter()
    cells, walls = fem.Cells(geo), fem.BoundarySides(geo)
    is_mixed = degree == 2
    space = fem.make_polynomial_space(geo, degree=degree, dtype=wp.vec2d)
    u, v = fem.make_trial(space, domain=cells), fem.make_test(space, domain=cells)
    own = {"bulk": 0.0 if is_mixed else bulk}
    parts = [blocks.scalars(fem.integrate(stiffness, fields={"u": u, "v": v}, values=own))]
    wall = fem.RegularQuadrature(walls, order=2 * degree + 2)
    f = fem.integrate(load, quadrature=wall, fields={"v": fem.make_test(space, domain=walls)})
    right, n = f.numpy().ravel(), 2 * space.node_count()
    if is_mixed:
        pressures = fem.make_polynomial_space(geo, degree=1, dtype=wp.float64)
        p, q = (make(pressures, domain=cells) for make in (fem.make_trial, fem.make_test))
        B = fem.integrate(constraint, fields={"u": u, "q": q})
        C = fem.integrate(compression, fields={"p": p, "q": q}, values={"bulk": bulk})
        parts += [blocks.scalars(B, n, 0), blocks.scalars(B, 0, n, transposed=True)]
        parts.append(blocks.scalars(C, n, n))
        right = np.append(right, np.zeros(pressures.node_count()))
    x = blocks.solve(parts, right, symmetry(space))
    field = space.make_field()
    field.dof_values.assign(x[:n].reshape(-1, 2))
    seconds, fine = time.perf_counter() - start, fem.RegularQuadrature(cells, order=8)
    exact = lame(bulk)
    error = fem.integrate(squared_error, quadrature=fine, fields={"u": field}, values=exact)
    return seconds, field, math.sqrt(error / fem.integrate(squared, quadrature=fine, values=exact))


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--cells", type=int, default=4, help="across the wall")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    ratios, solutions = (0.3, 0.49, 0.4999, 0.499999, 0.5), []
    errors: dict[int, list[float]] = {1: [], 2: []}
    print("| method | cells | Poisson's ratio | time [s] | relative error |")
    print("| --- | --- | --- | --- | --- |")
    with wp.ScopedDevice(options.device):
        geo = tube(options.cells)
        for degree, name in ((1, "displacement"), (2, "mixed")):
            for ratio in ratios if degree == 2 else ratios[:-1]:
                bulk = 2.0 * MU * ratio / (1.0 - 2.0 * ratio) if ratio < 0.5 else math.inf
                seconds, field, error = solve(geo, degree, bulk)
                errors[degree].append(error)
                solutions.append(field)
                print(f"| {name} | {geo.cell_count()} | {ratio} | {seconds:.2f} | {error:.2e} |")
    figure, axes = plt.subplots(1, 2, figsize=(8, 3.5))
    field = solutions[-1]
    x, u = field.space.node_positions().numpy(), field.dof_values.numpy()
    mesh = Triangulation(*x.T)
    mesh.set_mask(np.linalg.norm(x[mesh.triangles].mean(axis=1), axis=1) < INNER)
    mesh.x, mesh.y = (x + 2.0 * u).T
    drawn = axes[0].tripcolor(mesh, np.linalg.norm(u, axis=1), shading="gouraud")
    axes[0].plot(*(x + 2.0 * u).T, ".", color="white", markersize=1)
    axes[0].set(aspect="equal", title="displacement, doubled")
    figure.colorbar(drawn, ax=axes[0])
    for degree, name in ((1, "displacement, degree 1"), (2, "mixed, degrees 2 and 1")):
        axes[1].semilogy(ratios[: len(errors[degree])], errors[degree], "o-", label=name)
    axes[1].set(xlabel="Poisson's ratio", title="relative error of the displacement")
    axes[1].legend()
    figure.tight_layout()
    figure.savefig(options.output / f"elasticity_{options.device.replace(':', '')}.png", dpi=80)


if __name__ == "__main__":
    main()
