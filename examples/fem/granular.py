"""A column of sand collapses: the material point method with Drucker and Prager's plasticity.

    python examples/fem/granular.py [--device cpu] [--cells 12]

Explicit steps on a grid of B-splines of degree 2. Grains carry an elastic strain, which the return
map of Klar et al. (2016) keeps inside the cone of friction. Mass and momentum stay to rounding; the
run-out is compared with the law of Lube et al. (2005) for columns in two dimensions, 1.2 times the
aspect ratio, as far as measurements scatter about it. Writes build/demo/granular_<device>.png.
"""

import argparse
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp
from warp import fem

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"
# Lame's constants over the density, gravity: a column of height 1 has speeds of about 1.
MU, LAMBDA, GRAVITY, FRICTION = 100.0, 100.0, 1.0, 0.515


@fem.integrand
def mass(s: fem.Sample, v: fem.Field):
    return v(s)


@fem.integrand
def momentum(
    s: fem.Sample,
    domain: fem.Domain,
    v: fem.Field,
    dt: float,
    velocities: wp.array[wp.vec2],
    slopes: wp.array[wp.mat22],
    stresses: wp.array[wp.mat22],
):
    """Momentum after a step of stress and gravity."""
    p = s.qp_index
    offset = domain(fem.at_node(v, s)) - domain(s)
    u = velocities[p] + slopes[p] * offset + wp.vec2(0.0, -GRAVITY * dt)
    return wp.dot(v(s), u) - dt * wp.ddot(stresses[p], fem.grad(v, s))


@wp.kernel
def to_velocity(masses: wp.array[float], points: wp.array[wp.vec2], momenta: wp.array[wp.vec2]):
    """Velocities of nodes; the floor is rough, walls are smooth."""
    i = wp.tid()
    u, x = wp.vec2(), points[i]
    if masses[i] > 1e-10:
        u = momenta[i] / masses[i]
        if x[1] < 1e-4:
            u = wp.vec2()
        if x[0] < 1e-4:
            u[0] = wp.max(u[0], 0.0)
    momenta[i] = u


@wp.func
def sand(F: wp.mat22):
    """The elastic deformation that friction leaves, and Kirchhoff's stress: Hencky strains."""
    U, sigma, V = wp.svd2(F)
    e = wp.vec2(wp.log(wp.max(sigma[0], 0.05)), wp.log(wp.max(sigma[1], 0.05)))
    trace = e[0] + e[1]
    shear = e - 0.5 * wp.vec2(trace, trace)
    size = wp.length(shear)
    # The cone of Drucker and Prager in the plane: sin of the angle of friction.
    slack = size * 2.0 * MU + (2.0 * MU + 2.0 * LAMBDA) * 0.5 * trace * FRICTION * wp.sqrt(2.0)
    if trace >= 0.0 or size == 0.0:
        e = wp.where(trace >= 0.0, wp.vec2(), e)
    elif slack > 0.0:
        e -= slack / (2.0 * MU * size) * shear
    new = U * wp.diag(wp.vec2(wp.exp(e[0]), wp.exp(e[1]))) * wp.transpose(V)
    t = 2.0 * MU * e + LAMBDA * (e[0] + e[1]) * wp.vec2(1.0, 1.0)
    return new, U * wp.diag(t) * wp.transpose(U)


@fem.integrand
def read_grid(
    s: fem.Sample,
    u: fem.Field,
    dt: float,
    positions: wp.array[wp.vec2],
    velocities: wp.array[wp.vec2],
    slopes: wp.array[wp.mat22],
    deformations: wp.array[wp.mat22],
    stresses: wp.array[wp.mat22],
):
    """Velocities, their gradients, deformations and stresses of grains; grains move along."""
    p = s.qp_index
    slope = fem.grad(u, s)
    velocities[p] = u(s)
    slopes[p] = slope
    positions[p] += dt * u(s)
    F, stress = sand((wp.identity(n=2, dtype=float) + dt * slope) * deformations[p])
    deformations[p] = F
    stresses[p] = stress


class Sand:
    """A column of sand of width 1 beside the wall x = 0."""

    def __init__(self, n, aspect):
        h, self.width = 1.0 / n, 1.0
        res = wp.vec2i(round((1.6 + 1.6 * aspect) * n), round(1.1 * aspect * n) + 1)
        high = wp.vec2(res[0] * h, res[1] * h)
        self.geo = fem.Grid2D(res=res, bounds_hi=high)
        options = {"degree": 2, "element_basis": fem.ElementBasis.BSPLINE}
        cells = fem.Cells(self.geo)
        velocities = fem.make_polynomial_space(self.geo, dtype=wp.vec2, **options)
        scalars = fem.make_polynomial_space(self.geo, dtype=float, **options)
        self.v, self.one = (fem.make_test(s, domain=cells) for s in (velocities, scalars))
        self.u, self.points = velocities.make_field(), velocities.node_positions()
        x, y = (np.arange(h / 4, e, h / 2) for e in (1.0, aspect))
        points = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
        count = len(points)
        self.start, self.x = points, wp.array(points, dtype=wp.vec2)
        self.velocities = wp.zeros(count, dtype=wp.vec2)
        self.slopes, self.stresses = (wp.zeros(count, dtype=wp.mat22) for _ in range(2))
        self.F = wp.full(count, wp.mat22(1.0, 0.0, 0.0, 1.0), dtype=wp.mat22)
        self.volume = 0.25 * h * h
        self.measure = wp.full(count, self.volume, dtype=float)
        # Waves of compression cross a third of a cell in a step.
        self.dt = 0.3 * h / np.sqrt(LAMBDA + 2.0 * MU)

    def step(self):
        """One step in time."""
        particles, u = fem.PicQuadrature(fem.Cells(self.geo), self.x, self.measure), self.u
        values = {"dt": self.dt, "velocities": self.velocities, "slopes": self.slopes}
        fem.integrate(
            momentum, quadrature=particles, fields={"v": self.v}, output=u.dof_values,
            values={**values, "stresses": self.stresses}, assembly="generic",
        )  # fmt: skip
        m = fem.integrate(mass, quadrature=particles, fields={"v": self.one}, output_dtype=float)
        self.mass = m
        wp.launch(to_velocity, len(m), [m, self.points], [u.dof_values])
        values |= {"positions": self.x, "deformations": self.F, "stresses": self.stresses}
        fem.interpolate(read_grid, at=particles, fields={"u": u}, values=values)

    def spread(self):
        """How far the sand has come, relative to the width: the 99 % of grains nearest."""
        return float(np.quantile(self.x.numpy()[:, 0], 0.99) - self.width) / self.width

    def energy(self):
        """Kinetic energy over the potential energy that the column had."""
        moving = 0.5 * (self.velocities.numpy().astype(float) ** 2).sum()
        return moving / (GRAVITY * self.start[:, 1].sum())


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--cells", type=int, default=12, help="across the column")
    parser.add_argument("--aspect", type=float, default=1.0, help="height to width")
    parser.add_argument("--end", type=float, default=4.0, help="when the program ends")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    with wp.ScopedDevice(options.device):
        sand = Sand(options.cells, options.aspect)
        frames, start, steps = [sand.x.numpy().copy()], time.perf_counter(), 0
        for end in (0.3, 0.6, 1.0):
            while steps * sand.dt < end * options.end:
                sand.step()
                steps += 1
            frames.append(sand.x.numpy().copy())
        seconds = time.perf_counter() - start
        lost = abs(sand.mass.numpy().astype(float).sum() / (len(frames[0]) * sand.volume) - 1.0)
    figure, axes = plt.subplots(2, 2, figsize=(8, 3.2), sharex=True, sharey=True)
    height = sand.start[:, 1]
    for ax, x, part in zip(axes.flat, frames, (0.0, 0.3, 0.6, 1.0), strict=True):
        ax.scatter(*x.T, c=np.floor(8.0 * height / height.max()) % 2, s=1, cmap="copper")
        ax.set(aspect="equal", title=f"t = {part * options.end:.1f}")
    figure.tight_layout()
    figure.savefig(options.output / f"granular_{options.device.replace(':', '')}.png", dpi=80)
    law = 1.2 * options.aspect
    print("| grains | steps | time [s] | mass | kinetic energy left | run-out | law | difference |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    numbers = f"{lost:.1e} | {sand.energy():.1e} | {sand.spread():.3f} | {law:.3f}"
    numbers += f" | {abs(sand.spread() / law - 1.0):.2f}"
    print(f"| {len(height)} | {steps} | {seconds:.2f} | {numbers} |")


if __name__ == "__main__":
    main()
