"""The stiffest bar in torsion: a tape differentiates a solution by the shape of its mesh.

    python examples/fem/shape.py [--device cpu] [--rings 6]

The boundary of a cross-section is a Fourier series. Its torsion constant J is twice the integral
of Prandtl's stress function, the solution of a Poisson problem. A tape takes the gradient of
J / A^2, A the area, through mesh, matrix and solver, and L-BFGS follows it. Saint-Venant found that
the circle is best, with 1 / (2 pi). The program checks the gradient against differences, and the
best shape against the circle. Writes build/demo/shape_<device>.png.
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
from warp.optim import LBFGS, linear

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"
WAVES = wp.constant(6)
REALS = wp.array[wp.float64]


@wp.kernel
def place(series: REALS, flat: wp.array[wp.vec2d], positions: wp.array[wp.vec2d]):
    """Points of a disk, moved along their rays as far as the boundary is."""
    i = wp.tid()
    x, radius = flat[i], wp.float64(1.0)
    angle = wp.atan2(x[1], x[0])
    for k in range(WAVES):
        phase = wp.float64(k + 2) * angle
        radius += series[2 * k] * wp.cos(phase) + series[2 * k + 1] * wp.sin(phase)
    positions[i] = radius * x


@fem.integrand
def diffusion(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def load(s: fem.Sample, v: fem.Field):
    return 2.0 * v(s)


@wp.kernel
def fix(places: wp.array[int], values: REALS):
    """The solution is held at nodes of the boundary by large numbers on the diagonal."""
    values[places[wp.tid()]] += wp.float64(1e10)


@wp.kernel
def inner(a: REALS, b: REALS, out: REALS):
    wp.atomic_add(out, 0, a[wp.tid()] * b[wp.tid()])


@wp.kernel
def quotient(torsion: REALS, twice_area: REALS, out: REALS):
    """-J / A^2."""
    out[0] = wp.float64(-4.0) * torsion[0] / (twice_area[0] * twice_area[0])


def disk(rings):
    """Points and triangles of a disk, in six sectors."""
    points, first = [np.zeros((1, 2))], [0, 1]
    for ring in range(1, rings + 1):
        angle = 2.0 * np.pi * np.arange(6 * ring) / (6 * ring)
        points.append(ring / rings * np.stack([np.cos(angle), np.sin(angle)], -1))
        first.append(first[-1] + 6 * ring)
    cells = []
    for ring in range(1, rings + 1):
        for sector in range(6):
            for k in range(ring):
                outer = [first[ring] + (sector * ring + k + e) % (6 * ring) for e in (0, 1)]
                inside = [sector * (ring - 1) + k + e for e in (0, 1)]
                inside = [first[ring - 1] + e % max(6 * (ring - 1), 1) for e in inside]
                cells.append((outer[0], outer[1], inside[0]))
                if k < ring - 1:
                    cells.append((inside[0], outer[1], inside[1]))
    return np.concatenate(points), np.array(cells)


class Section:
    """A cross-section whose boundary is a Fourier series."""

    def __init__(self, rings, series):
        points, self.cells = disk(rings)
        self.series = wp.array(series, dtype=wp.float64, requires_grad=True)
        self.flat = wp.array(points, dtype=wp.vec2d)
        self.positions = wp.array(points, dtype=wp.vec2d, requires_grad=True)
        self.geo = fem.Trimesh2D(wp.array(self.cells, dtype=int), self.positions)
        space = fem.make_polynomial_space(self.geo, degree=2, dtype=wp.float64)
        cells = fem.Cells(self.geo)
        self.test = fem.make_test(space, domain=cells)
        self.fields = {"u": fem.make_trial(space, domain=cells), "v": self.test}
        self.count = space.node_count()
        pattern = fem.integrate(diffusion, fields=self.fields)
        offsets, columns = pattern.offsets.numpy(), pattern.columns.numpy()
        fixed = fem.dirichlet(space).nodes.numpy()
        rows = [columns[offsets[i] : offsets[i + 1]] for i in fixed]
        places = [offsets[i] + np.searchsorted(row, i) for i, row in zip(fixed, rows, strict=True)]
        self.places = wp.array(places, dtype=int)
        self.ones = wp.array(np.ones(self.count), dtype=wp.float64)

    def objective(self):
        """-J / A^2, to be recorded by a tape."""
        made = [wp.zeros(1, dtype=wp.float64, requires_grad=True) for _ in range(3)]
        torsion, twice_area, result = made
        u = wp.zeros(self.count, dtype=wp.float64, requires_grad=True)
        wp.launch(place, len(self.flat), [self.series, self.flat], [self.positions])
        K = fem.integrate(diffusion, fields=self.fields)
        b = fem.integrate(load, fields={"v": self.test})
        wp.launch(fix, len(self.places), [self.places, K.values])
        linear.cg(K, b, u, tol=1e-14, M=linear.preconditioner(K, "diag"), check_every=20)
        wp.launch(inner, self.count, [b, u], [torsion])
        wp.launch(inner, self.count, [b, self.ones], [twice_area])
        wp.launch(quotient, 1, [torsion, twice_area], [result])
        return result

    def gradient(self):
        """The objective; its gradient is left in `series.grad`."""
        with wp.Tape() as tape:
            result = self.objective()
        for array in (self.series, self.positions):
            array.grad.zero_()
        tape.backward(result)
        return float(result.numpy()[0])

    def check(self, step=1e-5):
        """Relative error of the gradient along one direction, against central differences."""
        self.gradient()
        start, slope = self.series.numpy().copy(), self.series.grad.numpy().copy()
        direction, sides = np.random.default_rng(0).standard_normal(start.shape), []
        for sign in (1.0, -1.0):
            self.series.assign(start + sign * step * direction)
            sides.append(float(self.objective().numpy()[0]))
        self.series.assign(start)
        return abs((slope @ direction) * 2.0 * step / (sides[0] - sides[1]) - 1.0)


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--rings", type=int, default=6, help="rings of triangles")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(1, 3, figsize=(9, 3))
    with wp.ScopedDevice(options.device):
        series = np.zeros(2 * WAVES)
        series[[2, 6, 9]] = 0.15, 0.2, 0.08
        section, history = Section(options.rings, series), []
        slope_error = section.check()

        def closure():
            history.append(-section.gradient())
            return -history[-1]

        def draw(ax, title):
            x = section.positions.numpy()
            ax.triplot(*x.T, section.cells, linewidth=0.4, color="C0")
            ax.set(aspect="equal", title=title, xticks=(), yticks=())

        start, first = time.perf_counter(), -closure()
        draw(axes[0], f"J / A² = {first:.4f}")
        LBFGS([section.series], max_iter=60, tolerance_grad=1e-9).step(closure)
        seconds, last = time.perf_counter() - start, -closure()
        draw(axes[1], f"J / A² = {last:.4f}")
    best, off = 1.0 / (2.0 * math.pi), np.abs(section.series.numpy()).max()
    axes[2].semilogy(np.maximum(best - np.array(history), 1e-9))
    axes[2].set(xlabel="evaluations", title="below the circle")
    figure.tight_layout()
    figure.savefig(options.output / f"shape_{options.device.replace(':', '')}.png", dpi=80)
    print(
        "| triangles | evaluations | time [s] | first J / A^2 | last | error | radius | gradient |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    numbers = f"{seconds:.2f} | {first:.6f} | {last:.6f} | {abs(last / best - 1.0):.1e}"
    row = f"{len(section.cells)} | {len(history)} | {numbers} | {off:.1e} | {slope_error:.1e}"
    print(f"| {row} |")


if __name__ == "__main__":
    main()
