"""Optimisation through a split simulation: find the initial heat that leads to a picture.

    python examples/distributed/heat_control.py [--size 48 --steps 40 --iterations 60]
    mpirun -n 3 python examples/distributed/heat_control.py

The plate is split over ranks. `blocks.halo` is on the tape, so gradients of cells at borders are
those of one program over all ranks; the conductivity is replicated and learned as well.
"""

import argparse
import itertools
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp
import warp.distributed as wd

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"


@wp.kernel
def diffuse(
    a: wp.array2d[float],
    k: wp.array[float],
    b: wp.array2d[float],
):
    i, j = wp.tid()
    i = i + 1
    j = j + 1
    around = a[i - 1, j] + a[i + 1, j] + a[i, j - 1] + a[i, j + 1]
    b[i, j] = a[i, j] + k[0] * (around - 4.0 * a[i, j])


@wp.kernel
def misfit(x: wp.array2d[float], target: wp.array2d[float], terms: wp.array2d[float]):
    i, j = wp.tid()
    d = x[i + 1, j + 1] - target[i + 1, j + 1]
    terms[i, j] = d * d


@wp.kernel
def descend(g: wp.array2d[float], rate: float, x: wp.array2d[float]):
    i, j = wp.tid()
    x[i, j] = x[i, j] - rate * g[i, j]


def picture(n):
    x, y = np.meshgrid(*[np.linspace(-1, 1, n)] * 2, indexing="ij")
    r = np.hypot(x, y)
    return (np.exp(-(((r - 0.6) / 0.15) ** 2)) + np.exp(-((r / 0.2) ** 2))).astype(np.float32)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    for name, value in (("size", 48), ("steps", 40), ("iterations", 60)):
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    comm = wd.init()
    n = options.size
    blocks = wd.Blocks((n, n), corners=False)
    target = blocks.zeros()
    blocks.scatter(picture(n), target)
    heat = blocks.zeros(requires_grad=True)
    states = [heat] + [blocks.zeros(requires_grad=True) for _ in range(options.steps)]
    conductivity = wp.array([0.15], dtype=float, requires_grad=True)
    terms = wp.zeros(blocks.owned, dtype=float, requires_grad=True)
    losses = []
    for _ in wd.progress(range(options.iterations), desc="descent", disable=None):
        with wp.Tape() as tape:
            k = wd.replicate(conductivity)
            for a, b in itertools.pairwise(states):
                blocks.halo(a)
                wp.launch(diffuse, blocks.owned, [a, k, b])
            wp.launch(misfit, blocks.owned, [states[-1], target, terms])
            loss = wd.sum(terms, exact=True)
        tape.backward(loss)
        losses.append(float(loss.numpy()[0]))
        wp.launch(descend, blocks.owned, [blocks.inner(heat.grad), 0.4, blocks.inner(heat)])
        rate = 2e-5 * float(conductivity.grad.numpy()[0])
        conductivity.assign(np.clip(conductivity.numpy() - rate, 0.05, 0.24))
        tape.zero()
    start, end = blocks.gather(heat), blocks.gather(states[-1])
    if comm.rank:
        return
    options.output.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(1, 4, figsize=(14, 3.2))
    for axis, (title, field) in zip(
        axes, (("found start", start), ("its end", end), ("wanted", picture(n))), strict=False
    ):
        axis.imshow(field.T, origin="lower")
        axis.set(title=title)
    axes[3].semilogy(losses)
    axes[3].set(title=f"loss, {comm.size} rank(s)", xlabel="iteration")
    figure.savefig(options.output / "heat_control.png", dpi=110, bbox_inches="tight")
    print(
        f"{comm.size} rank(s): loss {losses[0]:.4f} to {losses[-1]:.6f}, conductivity "
        f"{conductivity.numpy()[0]:.4f}"
    )


if __name__ == "__main__":
    main()
