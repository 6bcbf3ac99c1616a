"""A sweep on Ray: kernels and arrays travel to workers, a bar counts what comes back.

    python examples/distributed/ray_sweep.py [--workers 2 --values 64]

The kernel is of this file, which workers do not import: it travels with its source, and its code is
in the kernel cache that all share. Without Ray the sweep runs in this process.
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from tqdm import tqdm

import warp as wp

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"


@wp.kernel
def pendulum(angles: wp.array[float], damping: float, times: wp.array[float]):
    """How long a pendulum takes until its energy has fallen to a tenth."""
    i = wp.tid()
    q = angles[i]
    p = float(0.0)
    start = 1.0 - wp.cos(q)
    t = float(0.0)
    while t < 200.0 and 0.5 * p * p + 1.0 - wp.cos(q) > 0.1 * start:
        p = p - 0.01 * (wp.sin(q) + damping * p)
        q = q + 0.01 * p
        t = t + 0.01
    times[i] = t


def simulate(kernel, angles, damping):
    times = wp.zeros(len(angles), dtype=float, device="cpu")
    wp.launch(kernel, len(angles), [angles, damping, times], device="cpu")
    return damping, times


def results(angles, values, workers):
    """Pairs of damping and times, as they come."""
    try:
        import ray
    except ImportError:
        yield from (simulate(pendulum, angles, value) for value in values)
        return
    ray.init(num_cpus=workers, include_dashboard=False, log_to_driver=False)
    task = ray.remote(simulate)
    kernel, shared = ray.put(pendulum), ray.put(angles)
    waiting = [task.remote(kernel, shared, value) for value in values]
    while waiting:
        done, waiting = ray.wait(waiting)
        yield from ray.get(done)
    ray.shutdown()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--values", type=int, default=64)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    wp.config.quiet = True
    angles = wp.array(np.linspace(0.1, 3.0, 200), dtype=float, device="cpu")
    values = [float(value) for value in np.geomspace(0.05, 2.0, options.values)]
    bar = tqdm(results(angles, values, options.workers), total=len(values), disable=None)
    found = {damping: times.numpy().copy() for damping, times in bar}
    table = np.stack([found[value] for value in values])
    options.output.mkdir(parents=True, exist_ok=True)
    plt.pcolormesh(angles.numpy(), values, np.log10(table))
    plt.yscale("log")
    plt.xlabel("first angle")
    plt.ylabel("damping")
    plt.colorbar(label="log10 of the time to a tenth of the energy")
    plt.savefig(options.output / "ray_sweep.png", dpi=110, bbox_inches="tight")
    print(f"{len(found)} values, times from {table.min():.2f} to {table.max():.2f}")


if __name__ == "__main__":
    main()
