"""A small neural network that learns an image: forward, backward and Adam with tiles.

    python examples/tiles/image_network.py [--device cpu] [--steps 400]

A block takes 32 pixels through three dense layers whose products, sums and functions are tiles; the
gradients of the weights are those of the tape. Printed are the error of the first gradient against
NumPy in float64, the loss, and the time of a step. Writes build/demo/image_network_<device>.png.
"""

import argparse
import itertools
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"
ROWS, FEATURES, HIDDEN, COLORS = 32, 32, 32, 3


@wp.func
def squared(x: float):
    """x^2"""
    return x * x


@wp.kernel
def network(x: wp.array2d[float], w1: wp.array2d[float], b1: wp.array[float],
            w2: wp.array2d[float], b2: wp.array[float], w3: wp.array2d[float],
            b3: wp.array[float], target: wp.array2d[float], scale: float,
            y: wp.array2d[float], loss: wp.array[float]):  # fmt: skip
    """Colours of the pixels of a block, and their mean squared error."""
    row = wp.tid() * ROWS
    a = wp.tile_load(x, shape=(ROWS, FEATURES), offset=(row, 0))
    p = wp.tile_matmul(a, wp.tile_load(w1, shape=(FEATURES, HIDDEN)))
    p += wp.tile_broadcast(wp.tile_load(b1, shape=HIDDEN), shape=(ROWS, HIDDEN))
    q = wp.tile_matmul(wp.tile_map(wp.tanh, p), wp.tile_load(w2, shape=(HIDDEN, HIDDEN)))
    q += wp.tile_broadcast(wp.tile_load(b2, shape=HIDDEN), shape=(ROWS, HIDDEN))
    c = wp.tile_matmul(wp.tile_map(wp.tanh, q), wp.tile_load(w3, shape=(HIDDEN, COLORS)))
    c += wp.tile_broadcast(wp.tile_load(b3, shape=COLORS), shape=(ROWS, COLORS))
    wp.tile_store(y, c, offset=(row, 0))
    wrong = c - wp.tile_load(target, shape=(ROWS, COLORS), offset=(row, 0))
    wp.tile_atomic_add(loss, wp.tile_sum(wp.tile_map(squared, wrong)) * scale)


def pixels(side):
    """Features (sines of random waves) and colours of a picture of side x side pixels."""
    u, v = np.meshgrid(*[np.linspace(-1.0, 1.0, side)] * 2, indexing="ij")
    r, angle = np.hypot(u, v), np.arctan2(v, u)
    rings = 0.5 + 0.5 * np.cos(14.0 * r - 3.0 * angle)
    colors = np.stack([rings, np.exp(-3.0 * r**2), 0.5 + 0.5 * np.sin(4.0 * u) * v], axis=-1)
    waves = np.random.default_rng(3).normal(size=(2, FEATURES // 2)) * 4.0
    phase = np.stack([u, v], axis=-1).reshape(-1, 2) @ waves
    features = np.concatenate([np.sin(phase), np.cos(phase)], axis=1)
    return features.astype(np.float32), colors.reshape(-1, COLORS).astype(np.float32)


def weights():
    """Initial weights and offsets of the three layers."""
    rng = np.random.default_rng(5)
    sizes = (FEATURES, HIDDEN, HIDDEN, COLORS)
    made = []
    for rows, columns in itertools.pairwise(sizes):
        made.append((rng.normal(size=(rows, columns)) / np.sqrt(rows)).astype(np.float32))
        made.append(np.zeros(columns, dtype=np.float32))
    return made


def reference_gradients(x, values, target):
    """Gradients of the mean squared error, NumPy in float64."""
    x, target, *values = (v.astype(np.float64) for v in (x, target, *values))
    w1, b1, w2, b2, w3, b3 = values
    h1 = np.tanh(x @ w1 + b1)
    h2 = np.tanh(h1 @ w2 + b2)
    g = 2.0 * (h2 @ w3 + b3 - target) / target.size
    g2 = (g @ w3.T) * (1.0 - h2**2)
    g1 = (g2 @ w2.T) * (1.0 - h1**2)
    return [x.T @ g1, g1.sum(0), h1.T @ g2, g2.sum(0), h2.T @ g, g.sum(0)]


class Trainer:
    """The network, its optimiser and the picture it learns."""

    def __init__(self, side, device):
        self.device = device
        self.features, self.colors = pixels(side)
        self.values = weights()
        self.x = wp.array(self.features, device=device)
        self.target = wp.array(self.colors, device=device)
        self.y = wp.zeros_like(self.target)
        self.loss = wp.zeros(1, dtype=float, device=device, requires_grad=True)
        self.parameters = [wp.array(v, device=device, requires_grad=True) for v in self.values]
        self.adam = wp.optim.Adam([p.flatten() for p in self.parameters], lr=4e-3)

    def gradients(self):
        """Runs the network forward and backward; returns the loss's array."""
        self.loss.zero_()
        inputs = [self.x, *self.parameters, self.target, 1.0 / self.colors.size]
        with wp.Tape() as tape:
            wp.launch_tiled(network, dim=len(self.features) // ROWS, inputs=inputs,
                            outputs=[self.y, self.loss], block_dim=64,
                            device=self.device)  # fmt: skip
        tape.backward(self.loss)
        return self.loss

    def step(self):
        """One step of Adam."""
        self.gradients()
        self.adam.step([p.grad.flatten() for p in self.parameters])
        for parameter in self.parameters:
            parameter.grad.zero_()


def picture(trainer, losses, side, path):
    """The image, what was learned, and the loss."""
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), dpi=140, layout="constrained")
    for panel, image, title in (
        (axes[0], trainer.colors, "image"),
        (axes[1], trainer.y.numpy(), "network"),
    ):
        panel.imshow(np.clip(image, 0.0, 1.0).reshape(side, side, COLORS))
        panel.set_title(title)
        panel.set_axis_off()
    axes[2].semilogy(losses, color="#1f6fb4")
    axes[2].set(xlabel="step", ylabel="mean squared error")
    axes[2].grid(True, color="#dddddd", linewidth=0.6)
    figure.savefig(path)
    plt.close(figure)


def demonstrate(device, side, steps, output):
    """Everything for one device; returns (error of the gradient, first loss, last loss)."""
    trainer = Trainer(side, device)
    trainer.gradients()
    expected = reference_gradients(trainer.features, trainer.values, trainer.colors)
    error = max(
        np.abs(p.grad.numpy() - g).max() / np.abs(g).max()
        for p, g in zip(trainer.parameters, expected)
    )
    for parameter in trainer.parameters:
        parameter.grad.zero_()
    losses = []
    begin = time.perf_counter()
    for _ in range(steps):
        trainer.step()
        losses.append(float(trainer.loss.numpy()[0]))
    took = (time.perf_counter() - begin) / steps
    print(f"image network on {device}: {side} x {side} pixels, {steps} steps of Adam")
    print("\n| error of the gradient | first loss | last loss | time of a step [ms] |")
    print("|--:|--:|--:|--:|")
    print(f"| {error:.1e} | {losses[0]:.4f} | {losses[-1]:.5f} | {1e3 * took:.2f} |")
    picture(trainer, losses, side, output / f"image_network_{device.replace(':', '')}.png")
    return error, losses[0], losses[-1]


def main():
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", help="one device instead of all, such as cpu or cuda:0")
    parser.add_argument("--side", type=int, default=96, help="pixels along a side")
    parser.add_argument("--steps", type=int, default=400)
    parser.add_argument("--output", type=Path, default=OUTPUT, help="folder of the picture")
    options = parser.parse_args()
    wp.config.quiet = True
    options.output.mkdir(parents=True, exist_ok=True)
    devices = [options.device] if options.device else [d.alias for d in wp.get_devices()]
    for device in devices:
        demonstrate(device, options.side, options.steps, options.output)


if __name__ == "__main__":
    main()
