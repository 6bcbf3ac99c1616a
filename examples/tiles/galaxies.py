"""Two galaxies that collide: all pairs of bodies, with tiles of bodies that a block shares.

    python examples/tiles/galaxies.py [--device cpu] [--bodies 4096] [--steps 60]

Each thread sums the pull of all bodies on its own; its block loads them tile by tile. Printed are
the error of the accelerations against NumPy in float64, the drift of the momentum, and pairs per
second. Writes build/demo/galaxies_<device>.png.
"""

import argparse
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"
TILE = 64
SOFTENING = 0.05
# On a CPU, too, TILE bodies share what a block loads.
wp.config.enable_cpu_blocks = True


@wp.kernel
def attract(x: wp.array[wp.vec3], softening: float, a: wp.array[wp.vec3]):
    """Accelerations; the masses are one over the number of bodies."""
    i = wp.tid()
    p = x[i]
    total = wp.vec3()
    for first in range(0, x.shape[0], TILE):
        others = wp.tile_load(x, shape=TILE, offset=first, storage="shared")
        for k in range(TILE):
            d = others[k] - p
            r = 1.0 / wp.sqrt(wp.dot(d, d) + softening * softening)
            total += d * (r * r * r)
    a[i] = total / float(x.shape[0])


@wp.kernel
def move(a: wp.array[wp.vec3], dt: float, x: wp.array[wp.vec3],
         v: wp.array[wp.vec3]):  # fmt: skip
    """One step of the symplectic Euler scheme."""
    i = wp.tid()
    faster = v[i] + dt * a[i]
    v[i] = faster
    x[i] += dt * faster


def galaxies(bodies):
    """Positions and velocities of two discs on their way to each other."""
    rng = np.random.default_rng(6)
    half = bodies // 2
    radius = np.sqrt(rng.uniform(0.01, 1.0, half))
    angle = rng.uniform(0.0, 2.0 * np.pi, half)
    disc = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(half)], axis=-1)
    # On circles: half of the mass lies in a disc whose density is even.
    speed = np.sqrt(0.5 * radius**2 / np.hypot(radius, SOFTENING))
    spin = speed[:, None] * np.stack([-np.sin(angle), np.cos(angle), np.zeros(half)], axis=-1)
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, 0.5, -0.866], [0.0, 0.866, 0.5]])
    away, towards = np.array([1.3, 0.4, 0.0]), np.array([-0.35, 0.0, 0.0])
    x = np.concatenate([disc + away, disc @ tilt.T - away])
    v = np.concatenate([spin + towards, spin @ tilt.T - towards])
    return x.astype(np.float32), v.astype(np.float32)


def reference(x, chosen):
    """Accelerations of some bodies by NumPy in float64."""
    x = x.astype(np.float64)
    d = x[None] - x[chosen, None]
    weight = (np.einsum("ijk,ijk->ij", d, d) + SOFTENING**2) ** -1.5
    return np.einsum("ij,ijk->ik", weight, d) / len(x)


def picture(frames, path):
    """Bodies seen from above, each galaxy in its colour."""
    figure, panels = plt.subplots(1, len(frames), figsize=(3.2 * len(frames), 3.4), dpi=140,
                                  layout="constrained")  # fmt: skip
    for panel, (seconds, x) in zip(panels, frames):
        half = len(x) // 2
        panel.scatter(x[:half, 0], x[:half, 1], s=0.4, color="#1f6fb4", linewidths=0)
        panel.scatter(x[half:, 0], x[half:, 1], s=0.4, color="#d1495b", linewidths=0)
        panel.set(xlim=(-2.6, 2.6), ylim=(-2.6, 2.6), title=f"t = {seconds:.1f}", aspect="equal")
        panel.set_axis_off()
    figure.savefig(path)
    plt.close(figure)


def demonstrate(device, bodies, steps, output):
    """Everything for one device; returns (error of accelerations, drift of the momentum)."""
    positions, velocities = galaxies(bodies)
    x = wp.array(positions, dtype=wp.vec3, device=device)
    v = wp.array(velocities, dtype=wp.vec3, device=device)
    a = wp.zeros_like(v)
    dt, frames, took = 0.03, [(0.0, positions)], 0.0

    def accelerate():
        wp.launch(attract, bodies, [x, SOFTENING], [a], device=device, block_dim=TILE)

    accelerate()
    chosen = np.random.default_rng(0).choice(bodies, min(bodies, 256), replace=False)
    expected = reference(positions, chosen)
    error = np.abs(a.numpy()[chosen] - expected).max() / np.abs(expected).max()
    for k in range(1, steps + 1):
        begin = time.perf_counter()
        accelerate()
        wp.launch(move, bodies, [a, dt], [x, v], device=device)
        wp.synchronize_device(device)
        took += time.perf_counter() - begin
        if k % max(1, steps // 3) == 0:
            frames.append((k * dt, x.numpy().copy()))
    drift = np.abs(v.numpy().astype(np.float64).mean(0) - velocities.mean(0)).max()
    rate = steps * bodies**2 / took
    print(f"galaxies on {device}: {bodies} bodies, {steps} steps")
    print("\n| error of accelerations | drift of the mean velocity | pairs [G/s] |\n|--:|--:|--:|")
    print(f"| {error:.1e} | {drift:.1e} | {rate / 1e9:.2f} |")
    picture(frames[:4], output / f"galaxies_{device.replace(':', '')}.png")
    return error, drift


def main():
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", help="one device instead of all, such as cpu or cuda:0")
    parser.add_argument("--bodies", type=int, default=4096, help=f"a multiple of {2 * TILE}")
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--output", type=Path, default=OUTPUT, help="folder of the picture")
    options = parser.parse_args()
    if options.bodies < 1 or options.bodies % (2 * TILE):
        parser.error(f"expects a multiple of {2 * TILE} bodies, but got {options.bodies}")
    wp.config.quiet = True
    options.output.mkdir(parents=True, exist_ok=True)
    devices = [options.device] if options.device else [d.alias for d in wp.get_devices()]
    for device in devices:
        demonstrate(device, options.bodies, options.steps, options.output)


if __name__ == "__main__":
    main()
