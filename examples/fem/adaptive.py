"""Poisson's equation on a grid that is fine where it has to be, by discontinuous Galerkin's method.

    python examples/fem/adaptive.py [--device cpu] [--cells 8] [--levels 2]

The solution is a narrow peak in a cube. The adaptive grid divides cells where the peak is steep;
sides between cells of different sizes need nothing of their own, as functions are discontinuous.
Its error is compared with those of uniform grids. Writes build/demo/adaptive_<device>.png.
"""

import argparse
import math
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection

import warp as wp
from warp import fem
from warp.optim import linear

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"
WIDTH = 0.06
CENTER = wp.vec3(0.35, 0.4, 0.5)


@wp.func
def peak(x: wp.vec3):
    return wp.exp(-0.5 * wp.length_sq(x - CENTER) / (WIDTH * WIDTH))


@wp.func
def wanted_size(x: wp.vec3):
    """0 where cells have to be finest, 1 where coarsest."""
    return wp.clamp(wp.length(x - CENTER) / (6.0 * WIDTH) - 0.5, 0.0, 1.0)


@fem.integrand
def load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    x = fem.position(domain, s)
    r = wp.length_sq(x - CENTER) / (WIDTH * WIDTH)
    return (3.0 - r) / (WIDTH * WIDTH) * peak(x) * v(s)


@fem.integrand
def squared_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    e = u(s) - peak(fem.position(domain, s))
    return e * e


@fem.integrand
def diffusion(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def penalty(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    """The symmetric interior penalty."""
    n, weight = fem.normal(domain, s), 8.0 * fem.measure_ratio(domain, s)
    flux_u, flux_v = wp.dot(fem.grad_average(u, s), n), wp.dot(fem.grad_average(v, s), n)
    a, b = fem.jump(u, s), fem.jump(v, s)
    return weight * a * b - a * flux_v - b * flux_u


@fem.integrand
def boundary_penalty(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    """The value 0 on the boundary, by Nitsche."""
    n, weight = fem.normal(domain, s), 8.0 * fem.measure_ratio(domain, s)
    flux_u, flux_v = wp.dot(fem.grad(u, s), n), wp.dot(fem.grad(v, s), n)
    return weight * u(s) * v(s) - u(s) * flux_v - v(s) * flux_u


def solve(geo):
    """Seconds, the field and its L2 error."""
    start = time.perf_counter()
    space = fem.make_polynomial_space(geo, degree=1, discontinuous=True)
    domains = fem.Cells(geo), fem.Sides(geo), fem.BoundarySides(geo)
    matrices = []
    for form, domain in zip((diffusion, penalty, boundary_penalty), domains, strict=True):
        u, v = fem.make_trial(space, domain=domain), fem.make_test(space, domain=domain)
        matrices.append(fem.integrate(form, fields={"u": u, "v": v}))
    A = matrices[0] + matrices[1] + matrices[2]
    fine, u = fem.RegularQuadrature(domains[0], order=4), space.make_field()
    test = fem.make_test(space, domain=domains[0])
    b = fem.integrate(load, quadrature=fine, fields={"v": test}, output_dtype=float)
    linear.cg(A, b, u.dof_values, tol=1e-5, M=linear.preconditioner(A, "diag"), check_every=50)
    seconds = time.perf_counter() - start
    return seconds, u, math.sqrt(fem.integrate(squared_error, quadrature=fine, fields={"u": u}))


def volume_of(n):
    """A volume of n^3 voxels in the unit cube."""
    voxels = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1).reshape(-1, 3)
    return wp.Volume.allocate_by_voxels(
        wp.array(voxels, dtype=wp.vec3i), voxel_size=1.0 / n, translation=wp.vec3(0.5 / n)
    )


def adaptive(n, levels):
    """A grid whose cells at the peak are 2^levels times finer."""
    coarse = volume_of(n)
    sizes = fem.ImplicitField(fem.Cells(fem.Nanogrid(coarse)), func=wanted_size)
    return fem.adaptive_nanogrid_from_field(coarse, levels + 1, sizes, grading="face")


def draw(u, axes):
    """Cells of the plane z = 0.5, coloured by the mean of their nodes."""
    space = u.space
    x = space.node_positions().numpy().reshape(-1, 8, 3)
    values, low, high = u.dof_values.numpy().reshape(-1, 8), x.min(axis=1), x.max(axis=1)
    cut = (low[:, 2] <= 0.5) & (high[:, 2] > 0.5)
    corners = [(low, low), (high, low), (high, high), (low, high)]
    squares = np.stack([np.stack([a[cut, 0], b[cut, 1]], -1) for a, b in corners], 1)
    colors = values[cut].mean(axis=1)
    cells = PolyCollection(list(squares), array=colors, edgecolor="gray", linewidth=0.3)
    axes.add_collection(cells)
    axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", xticks=(), yticks=())


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--cells", type=int, default=8, help="along an axis of the coarse grid")
    parser.add_argument("--levels", type=int, default=2, help="times that cells are halved")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(1, 2, figsize=(7, 3.3))
    print("| grid | cells | smallest cell | time [s] | L2 error | error to that of fine cells |")
    print("| --- | --- | --- | --- | --- | --- |")
    with wp.ScopedDevice(options.device):
        n, solutions = options.cells, []
        kinds: dict[str, list[tuple[int, float]]] = {"uniform": [], "adaptive": []}
        grids = [
            ("uniform", n * 2**k, fem.Nanogrid(volume_of(n * 2**k)))
            for k in range(options.levels + 1)
        ]
        grids += [("adaptive", n * 2**k, adaptive(n, k)) for k in range(1, options.levels + 1)]
        for kind, size, geo in grids:
            seconds, u, error = solve(geo)
            solutions.append(u)
            kinds[kind].append((geo.cell_count(), error))
            same = (
                "-" if kind == "uniform" else f"{error / kinds['uniform'][len(kinds[kind])][1]:.3f}"
            )
            numbers = f"1/{size} | {seconds:.2f} | {error:.2e} | {same}"
            print(f"| {kind} | {geo.cell_count()} | {numbers} |")
    draw(solutions[-1], axes[0])
    for kind, found in kinds.items():
        axes[1].loglog(*zip(*found, strict=True), "o-", label=kind)
    axes[1].set(xlabel="cells", title="L2 error")
    axes[1].legend()
    figure.tight_layout()
    figure.savefig(options.output / f"adaptive_{options.device.replace(':', '')}.png", dpi=80)


if __name__ == "__main__":
    main()
