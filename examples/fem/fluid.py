"""A drop of water turns, and one falls: the affine particle-in-cell method (APIC).

    python examples/fem/fluid.py [--device cpu] [--cells 24]

Particles carry mass, velocity and its gradient; each step they are a quadrature on a grid, whose
velocities are made free of divergence by a pressure per cell. A drop that turns without gravity
shows what APIC is for (Jiang et al., 2015): angular momentum stays to rounding, where plain
particle-in-cell loses it. Mass and momentum stay in both. Then a drop falls into a box. Writes
build/demo/fluid_<device>.png.
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
from warp.optim import linear

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"


@fem.integrand
def momentum(
    s: fem.Sample,
    domain: fem.Domain,
    v: fem.Field,
    velocities: wp.array[wp.vec2d],
    slopes: wp.array[wp.mat22d],
):
    """Momentum of particles at nodes, by their affine velocities."""
    p = s.qp_index
    offset = domain(fem.at_node(v, s)) - domain(s)
    return wp.dot(v(s), velocities[p] + slopes[p] * offset)


@fem.integrand
def mass(s: fem.Sample, v: fem.Field):
    return v(s)


@fem.integrand
def divergence(s: fem.Sample, u: fem.Field, q: fem.Field):
    return q(s) * fem.div(u, s)


@fem.integrand
def read_grid(
    s: fem.Sample,
    domain: fem.Domain,
    u: fem.Field,
    dt: wp.float64,
    positions: wp.array[wp.vec2d],
    velocities: wp.array[wp.vec2d],
    slopes: wp.array[wp.mat22d],
):
    """Velocities of particles by those of the grid; they move along."""
    p = s.qp_index
    velocities[p] = u(s)
    slopes[p] = fem.grad(u, s)
    positions[p] += dt * u(s)


@wp.kernel
def to_velocity(
    masses: wp.array[wp.float64],
    points: wp.array[wp.vec2d],
    push: wp.vec2d,
    has_walls: bool,
    momenta: wp.array[wp.vec2d],
    mobility: wp.array[wp.mat22d],
):
    """Velocities of nodes, and their inverse masses; walls hold components across them."""
    i = wp.tid()
    m, x = masses[i], points[i]
    inverse, u = wp.float64(0.0), wp.vec2d()
    if m > wp.float64(1e-12):
        inverse = wp.float64(1.0) / m
        u = momenta[i] * inverse + push
    w = wp.mat22d(inverse, 0.0, 0.0, inverse)
    if has_walls:
        for k in range(2):
            if wp.min(x[k], wp.float64(1.0) - x[k]) < wp.float64(1e-6):
                w[k, k] = wp.float64(0.0)
                u[k] = wp.float64(0.0)
    momenta[i] = u
    mobility[i] = w


class Water:
    """Particles of one density on a grid of the unit square."""

    def __init__(self, n, positions, velocities, dt, affine=True, gravity=0.0):
        self.geo = fem.Grid2D(res=wp.vec2i(n, n), scalar_type=wp.float64)
        self.dt, self.affine, self.gravity = dt, affine, gravity
        self.velocities = fem.make_polynomial_space(self.geo, degree=1, dtype=wp.vec2d)
        scalars = fem.make_polynomial_space(self.geo, degree=1, dtype=wp.float64)
        pressures = fem.make_polynomial_space(
            self.geo, degree=0, discontinuous=True, dtype=wp.float64
        )
        cells = fem.Cells(self.geo)
        self.v, self.one = (fem.make_test(s, domain=cells) for s in (self.velocities, scalars))
        self.u, self.q = self.velocities.make_field(), fem.make_test(pressures, domain=cells)
        self.trial = fem.make_trial(self.velocities, domain=cells)
        self.points = self.velocities.node_positions()
        self.x = wp.array(positions, dtype=wp.vec2d)
        self.w = wp.array(velocities, dtype=wp.vec2d)
        self.slopes = wp.zeros(len(positions), dtype=wp.mat22d)
        self.pressure = wp.zeros(pressures.node_count(), dtype=wp.float64)

    def step(self, measure):
        """One step in time; `measure` is of one particle."""
        particles = fem.PicQuadrature(fem.Cells(self.geo), self.x, measure)
        u = self.u.dof_values
        fem.integrate(
            momentum, quadrature=particles, fields={"v": self.v}, output=u,
            values={"velocities": self.w, "slopes": self.slopes}, assembly="generic",
        )  # fmt: skip
        m = fem.integrate(mass, quadrature=particles, fields={"v": self.one})
        mobility = wp.empty(len(m), dtype=wp.mat22d)
        push = wp.vec2d(0.0, -self.gravity * self.dt)
        wp.launch(to_velocity, len(m), [m, self.points, push, self.gravity > 0.0], [u, mobility])
        # Particles are the quadrature of the constraint, too: cells without any have no pressure.
        B = fem.integrate(divergence, quadrature=particles, fields={"u": self.trial, "q": self.q})
        W = wp.sparse.bsr_diag(mobility)
        S, right = B @ W @ wp.sparse.bsr_transposed(B), B @ u
        linear.cr(S, right, self.pressure, tol=1e-10, M=linear.preconditioner(S, "diag"))
        u.assign(u.numpy() - (W @ (wp.sparse.bsr_transposed(B) @ self.pressure)).numpy())
        values = {"dt": self.dt, "positions": self.x, "velocities": self.w, "slopes": self.slopes}
        fem.interpolate(read_grid, at=particles, fields={"u": self.u}, values=values)
        if not self.affine:
            self.slopes.zero_()
        return np.abs((B @ u).numpy()).max()

    def moments(self, measure):
        """Mass, momentum, angular momentum about the center of particles, as a grid sees them."""
        particles = fem.PicQuadrature(fem.Cells(self.geo), self.x, measure)
        f = fem.integrate(
            momentum, quadrature=particles, fields={"v": self.v},
            values={"velocities": self.w, "slopes": self.slopes}, assembly="generic",
        )  # fmt: skip
        m = fem.integrate(mass, quadrature=particles, fields={"v": self.one})
        f, x = f.numpy(), self.points.numpy() - 0.5
        return m.numpy().sum(), f.sum(axis=0), (x[:, 0] * f[:, 1] - x[:, 1] * f[:, 0]).sum()


def drop(n, center, radius):
    """Positions of four particles a cell in a disk, and the measure of each."""
    x = (np.arange(2 * n) + 0.5) / (2 * n)
    points = np.stack(np.meshgrid(x, x, indexing="ij"), -1).reshape(-1, 2)
    points = points[np.linalg.norm(points - center, axis=1) < radius]
    return points, np.full(len(points), 0.25 / n**2)


def turning(n, affine, turns):
    """Seconds, and relative changes of mass, momentum, angular momentum of a drop that turns."""
    x, volumes = drop(n, (0.5, 0.5), 0.3)
    measure = wp.array(volumes, dtype=wp.float64)
    spin = np.stack([0.5 - x[:, 1], x[:, 0] - 0.5], -1)
    water = Water(n, x, spin, 1.0 / n, affine)
    if affine:
        water.slopes.fill_(wp.mat22d(0.0, -1.0, 1.0, 0.0))
    before, start = water.moments(measure), time.perf_counter()
    for _ in range(round(turns * 2.0 * np.pi / water.dt)):
        water.step(measure)
    seconds, after = time.perf_counter() - start, water.moments(measure)
    scale = before[0] * 0.3
    change = np.abs(after[1] - before[1]).max() / scale
    return seconds, abs(after[0] / before[0] - 1.0), change, abs(after[2] / before[2] - 1.0)


def falling(n, times):
    """Seconds, the error of the height during free fall, and particles at some times."""
    x, volumes = drop(n, (0.5, 0.65), 0.2)
    measure = wp.array(volumes, dtype=wp.float64)
    water = Water(n, x, np.zeros_like(x), 0.2 / n, gravity=4.0)
    start, frames, error, k = time.perf_counter(), [], None, 0
    for t in times:
        while k * water.dt < t:
            water.step(measure)
            k += 1
            if error is None and k * water.dt > 0.3:
                exact = x[:, 1].mean() - 0.5 * 4.0 * water.dt**2 * k * (k + 1)
                error = abs(water.x.numpy()[:, 1].mean() - exact)
        frames.append(water.x.numpy().copy())
    return time.perf_counter() - start, error, frames


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--cells", type=int, default=24, help="along an axis")
    parser.add_argument("--turns", type=float, default=0.5)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    print("| case | time [s] | mass | momentum | angular momentum |")
    print("| --- | --- | --- | --- | --- |")
    times = (0.0, 0.35, 0.5, 0.8)
    with wp.ScopedDevice(options.device):
        found = [turning(options.cells, affine, options.turns) for affine in (False, True)]
        for name, (seconds, *changes) in zip(("PIC", "APIC"), found, strict=True):
            print(f"| {name} | {seconds:.2f} | " + " | ".join(f"{c:.1e}" for c in changes) + " |")
        seconds, error, frames = falling(options.cells, times)
    figure, axes = plt.subplots(1, len(times), figsize=(9, 2.5))
    for ax, x, t in zip(axes, frames, times, strict=True):
        ax.plot(*x.T, ".", markersize=2)
        ax.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", title=f"t = {t}", xticks=(), yticks=())
    figure.tight_layout()
    figure.savefig(options.output / f"fluid_{options.device.replace(':', '')}.png", dpi=80)
    print("| particles | time [s] | height in free fall | angular momentum, PIC | APIC |")
    print("| --- | --- | --- | --- | --- |")
    numbers = f"{error:.1e} | {found[0][-1]:.2e} | {found[1][-1]:.2e}"
    print(f"| {len(frames[0])} | {seconds:.2f} | {numbers} |")


if __name__ == "__main__":
    main()
