"""A rubber bar is twisted by half a turn: neo-Hookean elasticity by Newton's method.

    python examples/fem/twist.py [--device cpu] [--cells 4] [--turn 0.5]

The energy is the only form that is written; `fem.derivative` gives residual and tangent. The
program checks both against differences of the energy, and prints how the residual falls, which is
quadratically. Writes build/demo/twist_<device>.png: the bar, coloured by its energy.
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
REAL = wp.float64


@fem.integrand
def energy(s: fem.Sample, u: fem.Field):
    """Compressible neo-Hookean energy density; mu = 1, lambda = 2."""
    F = wp.identity(n=3, dtype=wp.float64) + fem.grad(u, s)
    J = wp.determinant(F)
    return 0.5 * (wp.ddot(F, F) - 3.0) - wp.log(J) + wp.log(J) * wp.log(J)


residual_form = fem.derivative(energy, "u", "v")
tangent_form = fem.derivative(residual_form, "u", "w")


class Bar:
    """The bar [0, 4] x [0, 1]^2, whose ends are held."""

    def __init__(self, cells, device):
        self.device, self.cells, self.angle = device, cells, 0.0
        res, high = wp.vec3i(4 * cells, cells, cells), wp.vec3d(4.0, 1.0, 1.0)
        geo = fem.Grid3D(res=res, bounds_lo=wp.vec3d(0.0), bounds_hi=high, scalar_type=REAL)
        self.space = fem.make_polynomial_space(geo, degree=1, dtype=wp.vec3d)
        domain = fem.Cells(geo)
        self.rule = fem.RegularQuadrature(domain, order=2)
        self.test = fem.make_test(self.space, domain=domain)
        self.trial = fem.make_trial(self.space, domain=domain)
        self.u = self.space.make_field()
        self.points = self.space.node_positions().numpy()
        ends = (self.points[:, 0] < 1e-9) | (self.points[:, 0] > 4.0 - 1e-9)
        self.fixed = np.flatnonzero(ends)
        self.P = wp.sparse.bsr_zeros(len(ends), len(ends), wp.mat33d, device=device)
        rows = wp.array(self.fixed, dtype=int, device=device)
        ones = wp.array([np.eye(3)] * len(self.fixed), dtype=wp.mat33d, device=device)
        wp.sparse.bsr_set_from_triplets(self.P, rows, rows, ones)

    def turn_end(self, angle):
        """Turns the end at x = 4 to an angle; the rest follows by a linear twist."""
        x, turned = self.points, []
        y, z = x[:, 1] - 0.5, x[:, 2] - 0.5
        for a in (self.angle * x[:, 0] / 4.0, angle * x[:, 0] / 4.0):
            rows = [0.0 * y, y * np.cos(a) - z * np.sin(a), y * np.sin(a) + z * np.cos(a)]
            turned.append(np.stack(rows, 1))
        self.angle = angle
        self.u.dof_values.assign(self.u.dof_values.numpy() + turned[1] - turned[0])

    def energy(self):
        """The energy of the bar."""
        return float(fem.integrate(energy, quadrature=self.rule, fields={"u": self.u}))

    def residual(self):
        """Forces at nodes."""
        fields = {"u": self.u, "v": self.test}
        return fem.integrate(residual_form, quadrature=self.rule, fields=fields)

    def tangent(self):
        """The derivative of the forces."""
        fields = {"u": self.u, "v": self.test, "w": self.trial}
        return fem.integrate(tangent_form, quadrature=self.rule, fields=fields)

    def check(self):
        """Relative errors of residual and tangent against central differences."""
        rng = np.random.default_rng(0)
        start = self.u.dof_values.numpy().copy()
        d = rng.standard_normal(start.shape)
        r, K = self.residual().numpy().copy(), self.tangent()
        step, sides = 1e-6, []
        for sign in (1.0, -1.0):
            self.u.dof_values.assign(start + sign * step * d)
            sides.append((self.energy(), self.residual().numpy()))
        self.u.dof_values.assign(start)
        slope = (sides[0][0] - sides[1][0]) / (2.0 * step)
        change = (sides[0][1] - sides[1][1]) / (2.0 * step)
        product = (K @ wp.array(d, dtype=wp.vec3d, device=self.device)).numpy()
        return abs((r * d).sum() / slope - 1.0), np.abs(product - change).max() / np.abs(
            change
        ).max()

    def solve(self, limit=1e-9):
        """Newton's method; the norm of the free forces before each step."""
        norms = []
        free = ~np.isin(np.arange(len(self.points)), self.fixed)
        while True:
            r = self.residual()
            norms.append(np.abs(r.numpy()[free]).max())
            if norms[-1] < limit or len(norms) > 12:
                return norms
            K, rhs = self.tangent(), wp.array(-r.numpy(), dtype=wp.vec3d, device=self.device)
            fem.project_linear_system(K, rhs, self.P, normalize_projector=False)
            step = wp.zeros_like(rhs)
            linear.cg(K, rhs, step, tol=1e-12, M=linear.preconditioner(K, "diag"))
            self.u.dof_values.assign(self.u.dof_values.numpy() + step.numpy())


def draw(bar, path):
    """The surface of the bar, coloured by the size of the displacement."""
    k = bar.cells
    shape = 4 * k + 1, k + 1, k + 1
    x = (bar.points + bar.u.dof_values.numpy()).reshape(*shape, 3)
    size = np.linalg.norm(bar.u.dof_values.numpy(), axis=1).reshape(shape)
    figure = plt.figure(figsize=(7, 3))
    axes = figure.add_subplot(projection="3d")
    for part in (np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1], np.s_[-1]):
        middle = size[part][:-1, :-1] / size.max()
        colors = plt.get_cmap("viridis")(middle)
        axes.plot_surface(
            *np.moveaxis(x[part], -1, 0),
            facecolors=colors,
            rstride=1,
            cstride=1,
            edgecolor="white",
            linewidth=0.3,
            shade=False,
        )
    axes.set(xlim=(0, 4), ylim=(-0.2, 1.2), zlim=(-0.2, 1.2))
    axes.set_box_aspect((4, 1.4, 1.4), zoom=1.2)  # type: ignore[arg-type]
    axes.set_axis_off()
    axes.view_init(20, -60)
    figure.subplots_adjust(0.0, 0.0, 1.0, 1.0)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--cells", type=int, default=4, help="across the bar")
    parser.add_argument("--turn", type=float, default=0.5, help="turns of the end")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    with wp.ScopedDevice(options.device):
        start = time.perf_counter()
        bar = Bar(options.cells, options.device)
        steps = max(1, math.ceil(8 * options.turn))
        for k in range(steps):
            bar.turn_end(2.0 * math.pi * options.turn * (k + 1) / steps)
            norms = bar.solve()
            print(f"step {k + 1}: forces " + "  ".join(f"{n:.1e}" for n in norms))
        seconds = time.perf_counter() - start
        errors = bar.check()
        draw(bar, options.output / f"twist_{options.device.replace(':', '')}.png")
    print("| cells | nodes | turns | time [s] | energy | error of residual | error of tangent |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    cells, nodes = bar.space.geometry.cell_count(), len(bar.points)
    numbers = f"{seconds:.2f} | {bar.energy():.6f} | {errors[0]:.1e} | {errors[1]:.1e}"
    print(f"| {cells} | {nodes} | {options.turn} | {numbers} |")


if __name__ == "__main__":
    main()
