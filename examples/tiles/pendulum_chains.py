"""Many chains of pendulums: the mass matrix of each is factored by a block, with tiles.

    python examples/tiles/pendulum_chains.py [--device cpu] [--links 16] [--chains 256]

The angles q of a chain of equal point masses obey Lagrange's equations M(q) q'' = r(q, q'), with M
symmetric and positive definite. A block factors M (Cholesky) and solves; the classical Runge-Kutta
scheme steps all chains. Printed are the error of
the accelerations against NumPy in float64, the drift of the energy, and the time of a step.
Writes build/demo/pendulum_chains_<device>.png.
"""

import argparse
import time
from functools import cache
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"
GRAVITY = 9.81


@wp.kernel
def equations(q: wp.array2d[float], v: wp.array2d[float], gravity: float,
              mass: wp.array3d[float], right: wp.array2d[float]):  # fmt: skip
    """Row i of the mass matrix of a chain, and of the right side; masses and lengths are 1."""
    c, i = wp.tid()
    n = q.shape[1]
    r = -gravity * float(n - i) * wp.sin(q[c, i])
    for j in range(n):
        below = float(n - wp.max(i, j))
        mass[c, i, j] = below * wp.cos(q[c, i] - q[c, j])
        r -= below * wp.sin(q[c, i] - q[c, j]) * v[c, j] * v[c, j]
    right[c, i] = r


@cache
def solver(links):
    """The kernel that solves the system of a chain of that many links."""

    @wp.kernel
    def solve(mass: wp.array3d[float], right: wp.array2d[float],
              a: wp.array2d[float]):  # fmt: skip
        c = wp.tid()
        factor = wp.tile_cholesky(wp.tile_load(mass[c], shape=(links, links)))
        wp.tile_store(a[c], wp.tile_cholesky_solve(factor, wp.tile_load(right[c], shape=links)))

    return solve


@wp.kernel
def advance(q0: wp.array2d[float], q1: wp.array2d[float], h: float,
            q: wp.array2d[float]):  # fmt: skip
    """q = q0 + h q1"""
    i, j = wp.tid()
    q[i, j] = q0[i, j] + h * q1[i, j]


def reference(q, v):
    """Accelerations by NumPy in float64."""
    n = q.shape[1]
    below = n - np.maximum(*np.indices((n, n)))
    difference = q[:, :, None] - q[:, None, :]
    right = -GRAVITY * (n - np.arange(n)) * np.sin(q)
    right -= np.einsum("cij,cj->ci", below * np.sin(difference), v**2)
    return np.linalg.solve(below * np.cos(difference), right[..., None])[..., 0]


def energy(q, v):
    """Energy of each chain."""
    x, y = np.cumsum(np.cos(q) * v, axis=1), np.cumsum(np.sin(q) * v, axis=1)
    height = -np.cumsum(np.cos(q), axis=1)
    return (0.5 * (x**2 + y**2) + GRAVITY * height).sum(axis=1)


class Chains:
    """The state of all chains, in single precision."""

    def __init__(self, chains, links, device):
        rng = np.random.default_rng(4)
        start = 0.5 * np.pi + 0.2 * rng.normal(size=(chains, 1)) + np.zeros((chains, links))
        kind = {"dtype": float, "device": device}
        self.device, self.shape = device, (chains, links)
        self.q = wp.array(start, **kind)
        self.v = wp.zeros(self.shape, **kind)
        self.mass = wp.zeros((chains, links, links), **kind)
        self.right = wp.zeros(self.shape, **kind)
        self.stage = [(wp.zeros(self.shape, **kind), wp.zeros(self.shape, **kind))
                      for _ in range(5)]  # fmt: skip

    def launch(self, kernel, inputs, outputs):
        """A thread per angle."""
        wp.launch(kernel, self.shape, inputs, outputs, device=self.device)

    def accelerate(self, q, v, a):
        """The accelerations of a state."""
        self.launch(equations, [q, v, GRAVITY], [self.mass, self.right])
        wp.launch_tiled(solver(self.shape[1]), dim=self.shape[0], inputs=[self.mass, self.right],
                        outputs=[a], block_dim=32, device=self.device)  # fmt: skip

    def step(self, h):
        """One step of the classical Runge-Kutta scheme."""
        (q1, v1), *slopes = self.stage
        wp.copy(slopes[0][0], self.v)
        self.accelerate(self.q, self.v, slopes[0][1])
        for before, (velocity, acceleration), part in zip(slopes, slopes[1:], (0.5, 0.5, 1.0)):
            self.launch(advance, [self.q, before[0], part * h], [q1])
            self.launch(advance, [self.v, before[1], part * h], [v1])
            wp.copy(velocity, v1)
            self.accelerate(q1, v1, acceleration)
        for slope, weight in zip(slopes, (1.0, 2.0, 2.0, 1.0)):
            self.launch(advance, [self.q, slope[0], weight * h / 6.0], [self.q])
            self.launch(advance, [self.v, slope[1], weight * h / 6.0], [self.v])

    def numpy(self):
        """Angles and velocities in float64."""
        return self.q.numpy().astype(np.float64), self.v.numpy().astype(np.float64)


def picture(poses, drift, path):
    """The first chain at several times, and the drift of the energy."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), dpi=140, layout="constrained")
    for number, q in enumerate(poses):
        x, y = np.insert(np.cumsum(np.sin(q)), 0, 0.0), np.insert(np.cumsum(-np.cos(q)), 0, 0.0)
        left.plot(x, y, color=plt.cm.viridis(number / len(poses)), linewidth=1.2)
    left.set_aspect("equal")
    left.set_title("one chain")
    times, values = zip(*drift)
    right.semilogy(times, np.maximum(values, 1e-9), color="#1f6fb4")
    right.set(xlabel="time [s]", ylabel="largest relative drift of the energy")
    right.grid(True, color="#dddddd", linewidth=0.6)
    figure.savefig(path)
    plt.close(figure)


def demonstrate(device, chains, links, steps, output):
    """Everything for one device; returns (error of accelerations, drift of the energy)."""
    state, h = Chains(chains, links, device), 2.0e-3
    for _ in range(5):
        state.step(h)
    q, v = state.numpy()
    a = wp.zeros(state.shape, dtype=float, device=device)
    state.accelerate(state.q, state.v, a)
    expected = reference(q, v)
    error = np.abs(a.numpy() - expected).max() / np.abs(expected).max()
    begin_energy, scale = energy(q, v), GRAVITY * links * (links + 1) / 2
    poses, drift, took = [], [], 0.0
    for k in range(0, steps, max(1, steps // 24)):
        begin = time.perf_counter()
        for _ in range(max(1, steps // 24)):
            state.step(h)
        wp.synchronize_device(device)
        took += time.perf_counter() - begin
        q, v = state.numpy()
        poses.append(q[0])
        drift.append(((k + 1) * h, np.abs(energy(q, v) - begin_energy).max() / scale))
    done = len(poses) * max(1, steps // 24)
    print(f"pendulum chains on {device}: {chains} chains of {links} links, {done} steps")
    print("\n| error of accelerations | drift of the energy | time of a step [ms] |")
    print("|--:|--:|--:|")
    print(f"| {error:.1e} | {drift[-1][1]:.1e} | {1e3 * took / done:.2f} |")
    picture(poses, drift, output / f"pendulum_chains_{device.replace(':', '')}.png")
    return error, drift[-1][1]


def main():
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", help="one device instead of all, such as cpu or cuda:0")
    parser.add_argument("--chains", type=int, default=256)
    parser.add_argument("--links", type=int, default=16)
    parser.add_argument("--steps", type=int, default=480)
    parser.add_argument("--output", type=Path, default=OUTPUT, help="folder of the picture")
    options = parser.parse_args()
    wp.config.quiet = True
    options.output.mkdir(parents=True, exist_ok=True)
    devices = [options.device] if options.device else [d.alias for d in wp.get_devices()]
    for device in devices:
        demonstrate(device, options.chains, options.links, options.steps, options.output)


if __name__ == "__main__":
    main()
