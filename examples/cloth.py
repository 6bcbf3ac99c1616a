"""A cloth in the wind: the wind is found from where the cloth has been blown.

    python examples/cloth.py [--device cpu] [--size 16] [--steps 200] [--iterations 25]

The cloth hangs from two corners, springs between neighbours and across. A hidden wind blows it
somewhere; from the positions there L-BFGS finds that wind again. The gradient goes through all
steps by a tape and is checked against central differences first. The last line of the table has
both errors.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp
from warp.optim import LBFGS

OUTPUT = Path(__file__).resolve().parent.parent / "build" / "demo"
# [m], [s], [m/s^2]; forces are per mass.
EDGE, DT = 1.0, 1.0 / 300.0
WIND = (0.6, -0.8, 1.6)


@wp.func
def pull(here: wp.vec3d, there: wp.vec3d, rest: wp.float64):
    """Acceleration by a spring."""
    d = there - here
    return wp.float64(4.0e3) * (wp.length(d) - rest) * wp.normalize(d)


@wp.kernel
def step(
    x: wp.array2d[wp.vec3d],
    v: wp.array2d[wp.vec3d],
    wind: wp.array[wp.vec3d],
    rest: wp.float64,
    dt: wp.float64,
    x_next: wp.array2d[wp.vec3d],
    v_next: wp.array2d[wp.vec3d],
):
    """One step of symplectic Euler; the corners of the first row are held."""
    i, j = wp.tid()
    rows, columns = x.shape[0], x.shape[1]
    a = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(-9.81))
    for di in range(-1, 2):
        for dj in range(-1, 2):
            p = i + di
            q = j + dj
            if (di != 0 or dj != 0) and p >= 0 and q >= 0 and p < rows and q < columns:
                a += pull(x[i, j], x[p, q], rest * wp.sqrt(wp.float64(di * di + dj * dj)))
    # The wind pushes along the normal, as much as it blows along it.
    right = x[i, wp.min(j + 1, columns - 1)] - x[i, wp.max(j - 1, 0)]
    down = x[wp.min(i + 1, rows - 1), j] - x[wp.max(i - 1, 0), j]
    normal = wp.normalize(wp.cross(right, down))
    a += wp.float64(3.0) * wp.dot(wind[0] - v[i, j], normal) * normal - wp.float64(0.5) * v[i, j]
    v_new = v[i, j] + a * dt
    if i == 0 and (j == 0 or j == columns - 1):
        v_new = wp.vec3d()
    v_next[i, j] = v_new
    x_next[i, j] = x[i, j] + v_new * dt


@wp.kernel
def compare(
    x: wp.array2d[wp.vec3d],
    target: wp.array2d[wp.vec3d],
    loss: wp.array[wp.float64],
):
    """Mean square distance from the target [m^2]."""
    i, j = wp.tid()
    wp.atomic_add(loss, 0, wp.length_sq(x[i, j] - target[i, j]) / wp.float64(x.size))


class Cloth:
    """Positions and velocities at all steps."""

    def __init__(self, size, steps, device):
        self.size, self.steps, self.device = size, steps, device
        options = {"dtype": wp.vec3d, "device": device, "requires_grad": True}
        at = np.linspace(-EDGE / 2, EDGE / 2, size)
        flat = np.stack([*np.meshgrid(at, -at - EDGE / 2), np.zeros((size, size))], axis=-1)
        self.x = [wp.array(flat, **options)]
        self.x += [wp.empty((size, size), **options) for _ in range(steps)]
        self.v = [wp.zeros((size, size), **options) for _ in range(steps + 1)]
        self.wind = wp.zeros(1, **options)
        self.loss = wp.zeros(1, dtype=wp.float64, device=device, requires_grad=True)
        self.target = None

    def run(self):
        """All steps, from the positions at the start."""
        rest = EDGE / (self.size - 1)
        for k in range(self.steps):
            inputs = [self.x[k], self.v[k], self.wind, rest, DT, self.x[k + 1], self.v[k + 1]]
            wp.launch(step, (self.size, self.size), inputs, device=self.device)

    def miss(self):
        """Runs and compares with the target."""
        self.run()
        self.loss.zero_()
        inputs = [self.x[-1], self.target, self.loss]
        wp.launch(compare, (self.size, self.size), inputs, device=self.device)

    def gradient(self):
        """The loss, and its derivative in the wind's gradient."""
        with wp.Tape() as tape:
            self.miss()
        tape.zero()
        tape.backward(self.loss)
        return self.loss

    def checked(self):
        """The largest relative error of the derivative against central differences."""
        self.gradient()
        found, h = self.wind.grad.numpy()[0], 1e-5
        begin, slopes = self.wind.numpy().copy(), []
        for axis in np.eye(3):
            ends = []
            for sign in (1.0, -1.0):
                self.wind.assign(begin + sign * h * axis)
                self.miss()
                ends.append(self.loss.numpy()[0])
            slopes.append((ends[0] - ends[1]) / (2 * h))
        self.wind.assign(begin)
        return np.abs(found - slopes).max() / np.abs(slopes).max()


def draw(path, cloths):
    figure = plt.figure(figsize=(5.0, 4.2), dpi=80)
    axes: Any = figure.add_axes((0, 0, 1, 1), projection="3d")
    for x, color, name in cloths[:-1]:
        axes.plot_wireframe(*x.transpose(2, 0, 1), color=color, linewidth=0.6, label=name)
    x, color, name = cloths[-1]
    axes.scatter(*x.transpose(2, 0, 1), color=color, s=5, label=name, depthshade=False)
    axes.legend(loc="upper right")
    axes.view_init(18, -62)
    axes.set_axis_off()
    axes.set_aspect("equal")
    figure.savefig(path)
    plt.close(figure)


def main(device, size, steps, iterations, output):
    cloth = Cloth(size, steps, device)
    cloth.wind.assign([WIND])
    cloth.run()
    cloth.target = wp.clone(cloth.x[-1], requires_grad=False)
    cloth.wind.zero_()
    slope_error = cloth.checked()
    first = cloth.x[-1].numpy().copy()
    start = time.perf_counter()
    optimizer = LBFGS(
        [cloth.wind], max_iter=iterations, tolerance_grad=1e-14, tolerance_change=1e-14
    )
    optimizer.step(cloth.gradient)
    took = time.perf_counter() - start
    cloth.miss()
    wrong = np.abs(cloth.wind.numpy()[0] - WIND).max()
    output.mkdir(parents=True, exist_ok=True)
    last = cloth.x[-1].numpy()
    kinds = (first, "0.6", "no wind"), (cloth.target.numpy(), "C0", "target"), (last, "C3", "found")
    draw(output / f"cloth_{device.replace(':', '')}.png", kinds)
    print("| device | particles | steps | s | error of the gradient | error of the wind [m/s] |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    print(f"| {device} | {size**2} | {steps} | {took:.2f} | {slope_error:.1e} | {wrong:.1e} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--size", type=int, default=16)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--iterations", type=int, default=25)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    wp.config.quiet = True
    main(options.device, options.size, options.steps, options.iterations, options.output)
