"""Flow past a cylinder in a channel, slow (Stokes) and at Reynolds number 20 (Navier-Stokes).

    python examples/fem/channel.py [--device cpu] [--cells 2]

Case 2D-1 of Schaefer and Turek (1996): velocities of degree 2, pressures of degree 1, on squares
that a field of degree 2 bends to the cylinder. `fem.derivative` gives the tangent of the residual;
the flow without inertia is where Newton's method begins. Drag, lift and the difference of pressures
before and behind are compared with those that John and Matthies (2001) give to eleven digits.
Writes build/demo/channel_<device>.png.
"""

import argparse
import time
from pathlib import Path

import blocks
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Circle

import warp as wp
from warp import fem

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"
LENGTH, HEIGHT, CENTER, RADIUS, VISCOSITY = 2.2, 0.41, 0.2, 0.05, 1e-3
# Drag and lift coefficients, and the pressure in front less that behind.
EXACT = (5.57953523384, 0.010618948146, 0.11752016697)


@fem.integrand
def momentum(s: fem.Sample, u: fem.Field, p: fem.Field, v: fem.Field, density: wp.float64):
    slope = fem.grad(u, s)
    friction = VISCOSITY * wp.ddot(slope, fem.grad(v, s))
    return density * wp.dot(slope * u(s), v(s)) + friction - p(s) * fem.div(v, s)


@fem.integrand
def continuity(s: fem.Sample, u: fem.Field, q: fem.Field):
    return -q(s) * fem.div(u, s)


by_velocity = fem.derivative(momentum, "u", "w")
by_pressure = fem.derivative(momentum, "p", "q")


def ring(k):
    """Points from the cylinder (first index 0) to the square around it, by the angle."""
    angle = 2.0 * np.pi * (np.arange(16 * k) / (16 * k)) - 0.75 * np.pi
    circle = np.stack([np.cos(angle), np.sin(angle)], -1)
    side = np.linspace(-1.0, 1.0, 4 * k + 1)[:-1]
    ones = np.ones(4 * k)
    square = np.concatenate(
        [np.stack(p, -1) for p in ((side, -ones), (ones, side), (-side, ones), (-ones, -side))]
    )
    t = (np.linspace(0.0, 1.0, 4 * k + 1) ** 1.5)[:, None, None]
    return CENTER + (1.0 - t) * RADIUS * circle + t * 0.1 * square


def mesh(k):
    """Vertices and squares of the channel, four times finer with twice the `k`."""
    x = np.concatenate(
        [np.linspace(0.0, 0.1, 2 * k + 1)[:-1], np.linspace(0.1, 0.3, 4 * k + 1)[:-1]]
    )
    x = np.concatenate([x, 0.3 + 1.9 * np.linspace(0.0, 1.0, 12 * k + 1) ** 1.6])
    y = np.concatenate(
        [np.linspace(0.0, 0.1, 2 * k + 1)[:-1], np.linspace(0.1, 0.3, 4 * k + 1)[:-1]]
    )
    y = np.concatenate([y, np.linspace(0.3, HEIGHT, 2 * k + 1)])
    grids: list[np.ndarray] = []
    squares: list[np.ndarray] = []

    def add(grid, wraps):
        first = sum(len(p) for p in grids)
        number = first + np.arange(grid[..., 0].size).reshape(grid.shape[:2])
        number = np.concatenate([number, number[:, :1]], 1) if wraps else number
        corners = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
        grids.append(grid.reshape(-1, 2))
        squares.append(np.stack(corners, -1))

    add(np.stack(np.meshgrid(x, y, indexing="ij"), -1), False)
    inside = slice(2 * k, 6 * k)
    keep = np.ones(squares[0].shape[:2], bool)
    keep[inside, inside] = False
    squares[0] = squares[0][keep]
    add(ring(k), True)
    points, cells = np.concatenate(grids), np.concatenate([c.reshape(-1, 4) for c in squares])
    _, kept, place = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    used, cells = np.unique(place.reshape(-1)[cells], return_inverse=True)
    return points[kept][used], cells.reshape(-1, 4)


def curved(points, cells):
    """A geometry whose nodes beside the cylinder are on it."""
    flat = fem.Quadmesh2D(wp.array(cells, dtype=int), wp.array(points, dtype=wp.vec2d))
    moves = fem.make_polynomial_space(flat, degree=2, dtype=wp.vec2d).make_field()
    x = moves.space.node_positions().numpy() - CENTER
    r = np.linalg.norm(x, axis=1, keepdims=True)
    moves.dof_values.assign(np.where(r < RADIUS, x * (RADIUS / r - 1.0), 0.0))
    return moves.make_deformed_geometry()


class Channel:
    """The channel, its spaces, and the numbers of nodes on its walls."""

    def __init__(self, k):
        self.geo = curved(*mesh(k))
        cells = fem.Cells(self.geo)
        self.velocities = fem.make_polynomial_space(self.geo, degree=2, dtype=wp.vec2d)
        self.pressures = fem.make_polynomial_space(self.geo, degree=1, dtype=wp.float64)
        self.u, self.p = self.velocities.make_field(), self.pressures.make_field()
        self.rule = fem.RegularQuadrature(cells, order=6)
        self.v, self.q = (fem.make_test(s, domain=cells) for s in (self.velocities, self.pressures))
        self.w = fem.make_trial(self.velocities, domain=cells)
        self.trial_q = fem.make_trial(self.pressures, domain=cells)
        x = self.velocities.node_positions().numpy()
        inlet = x[:, 0] < 1e-9
        self.cylinder = np.linalg.norm(x - CENTER, axis=1) < RADIUS + 1e-9
        walls = inlet | self.cylinder | (x[:, 1] < 1e-9) | (x[:, 1] > HEIGHT - 1e-9)
        self.fixed = np.flatnonzero(np.repeat(walls, 2))
        start = np.zeros_like(x)
        start[inlet, 0] = 1.2 * x[inlet, 1] * (HEIGHT - x[inlet, 1]) / HEIGHT**2
        self.u.dof_values.assign(start)

    def residual(self, density):
        """Forces at nodes, and errors of continuity."""
        known = {"u": self.u, "p": self.p}
        f = fem.integrate(
            momentum, quadrature=self.rule, fields={**known, "v": self.v},
            values={"density": density},
        )  # fmt: skip
        c = fem.integrate(continuity, quadrature=self.rule, fields={"u": self.u, "q": self.q})
        return f.numpy(), c.numpy()

    def newton_step(self, density):
        """The size of the free residual before a step, which is taken."""
        f, c = self.residual(density)
        fields = {"u": self.u, "p": self.p, "v": self.v}
        options = {"quadrature": self.rule, "values": {"density": density}}
        K = fem.integrate(by_velocity, fields={**fields, "w": self.w}, **options)
        B = fem.integrate(by_pressure, fields={**fields, "q": self.trial_q}, **options)
        n, right = f.size, -np.append(f.ravel(), c)
        parts = [blocks.scalars(K), blocks.scalars(B, 0, n), blocks.scalars(B, n, 0, True)]
        step = blocks.solve(parts, right, self.fixed)
        self.u.dof_values.assign(self.u.dof_values.numpy() + step[:n].reshape(-1, 2))
        self.p.dof_values.assign(self.p.dof_values.numpy() + step[n:])
        right[self.fixed] = 0.0
        return np.abs(right).max()

    def coefficients(self, density):
        """Drag and lift as forces that hold the cylinder, and the difference of pressures."""
        force = -self.residual(density)[0][self.cylinder].sum(axis=0)
        x, p = self.pressures.node_positions().numpy(), self.p.dof_values.numpy()
        ends = [
            p[np.argmin(np.linalg.norm(x - [CENTER + side, CENTER], axis=1))]
            for side in (-RADIUS, RADIUS)
        ]
        return (*(500.0 * force), ends[0] - ends[1])


def draw(channel, slow, path):
    """Speeds of the slow and of the fast flow."""
    x = channel.velocities.node_positions().numpy()
    figure, axes = plt.subplots(2, 1, figsize=(7, 3.2), sharex=True)
    for ax, u, title in zip(
        axes, (slow, channel.u.dof_values.numpy()), ("Stokes", "Re = 20"), strict=True
    ):
        ax.tripcolor(*x.T, np.linalg.norm(u, axis=1), shading="gouraud")
        ax.add_patch(Circle((CENTER, CENTER), RADIUS, color="white"))
        ax.set(aspect="equal", xticks=(), yticks=(), title=title)
    figure.tight_layout()
    figure.savefig(path, dpi=80)


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--cells", type=int, default=2, help="a quarter of those beside the square")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    print("| flow | unknowns | time [s] | drag | error | lift | error | pressure | error |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    with wp.ScopedDevice(options.device):
        start, channel = time.perf_counter(), Channel(options.cells)
        channel.newton_step(0.0)
        slow, seconds = channel.u.dof_values.numpy(), time.perf_counter() - start
        unknowns = 2 * channel.velocities.node_count() + channel.pressures.node_count()
        numbers = channel.coefficients(0.0)
        print(f"| Stokes | {unknowns} | {seconds:.2f} | " + row(numbers, None))
        norms = [1.0]
        while norms[-1] > 1e-12 and len(norms) < 12:
            norms.append(channel.newton_step(1.0))
        seconds = time.perf_counter() - start
        numbers = channel.coefficients(1.0)
        draw(channel, slow, options.output / f"channel_{options.device.replace(':', '')}.png")
        print(f"| Re = 20 | {unknowns} | {seconds:.2f} | " + row(numbers, EXACT))


def row(numbers, exact):
    """Numbers and their relative errors, as cells of a table."""
    cells = [(f"{n:.5f}", f"{abs(n / e - 1.0):.1e}") for n, e in zip(numbers, exact or numbers)]
    return " | ".join(f"{n} | {e if exact else '-'}" for n, e in cells) + " |"


if __name__ == "__main__":
    main()
