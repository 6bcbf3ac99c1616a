"""One membrane on several GPUs: strips of a wave equation that exchange their edges.

    python examples/several_devices.py [--devices cuda:0,cuda:1] [--size 1024] [--steps 400]

Each device has a strip of rows, with a row of each neighbour's beside it. After a step these rows
are copied between devices; nothing else is. Without GPUs, or with one, strips share it. The last
line of the table says whether the result has the bits of one strip, and the error against the
standing wave of the discrete equation, which is known exactly.
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

OUTPUT = Path(__file__).resolve().parent.parent / "build" / "demo"
# Speed of waves, in cells per step; below 1 / sqrt(2) for stability.
COURANT = 0.5


@wp.kernel
def step(
    now: wp.array2d[float],
    before: wp.array2d[float],
    courant2: float,
    after: wp.array2d[float],
):
    """Leapfrog for the rows of a strip; the first and the last row are others'."""
    i, j = wp.tid()
    row, column = i + 1, j + 1
    around = now[row - 1, column] + now[row + 1, column]
    around += now[row, column - 1] + now[row, column + 1]
    middle = now[row, column]
    after[row, column] = 2.0 * middle - before[row, column] + courant2 * (around - 4.0 * middle)


class Strip:
    """Rows `first` to `last` of the membrane, with one more at each side."""

    def __init__(self, device, first, last, start, second):
        self.device, self.first, self.last = device, first, last
        part = slice(first - 1, last + 1)
        self.levels = [
            wp.array(level, dtype=float, device=device)
            for level in (start[part], second[part], np.zeros_like(start[part]))
        ]

    def step(self):
        before, now, after = self.levels
        extents = self.last - self.first, now.shape[1] - 2
        wp.launch(step, extents, [now, before, COURANT**2, after], device=self.device)
        self.levels = [now, after, before]


def exchange(strips):
    """The rows at the edges go to the neighbours."""
    for upper, lower in itertools.pairwise(strips):
        above, below = upper.levels[1], lower.levels[1]
        wp.copy(below[0], above[-2])
        wp.copy(above[-1], below[1])


def standing(size, steps):
    """The lowest modes of the discrete equation after some steps."""
    at = np.sin(np.outer((1, 3), np.pi * np.arange(size) / (size - 1)))
    found = np.zeros((size, size))
    for m in range(2):
        for n in range(2):
            waves = [np.sin((2 * k + 1) * np.pi / (2 * (size - 1))) ** 2 for k in (m, n)]
            angle = 2.0 * np.arcsin(COURANT * np.sqrt(sum(waves)))
            found += np.cos(angle * steps) / (1 + m + 2 * n) * np.outer(at[m], at[n])
    return found


def solve(devices, size, steps):
    """The membrane after all steps, and the seconds they took."""
    start, second = (np.float32(standing(size, k)) for k in (0, 1))
    edges = np.linspace(1, size - 1, len(devices) + 1).astype(int)
    strips = [
        Strip(device, first, last, start, second)
        for device, first, last in zip(devices, edges, edges[1:])
    ]
    for strip in strips:
        # Compiled and loaded before the time is taken; the level is computed again.
        inputs = [strip.levels[1], strip.levels[0], COURANT**2, strip.levels[2]]
        extents = strip.last - strip.first, size - 2
        wp.launch(step, extents, inputs, device=strip.device)
    wp.synchronize()
    begin = time.perf_counter()
    for _ in range(steps - 1):
        for strip in strips:
            strip.step()
        exchange(strips)
    wp.synchronize()
    took = time.perf_counter() - begin
    result = np.zeros((size, size), np.float32)
    for strip in strips:
        result[strip.first : strip.last] = strip.levels[1].numpy()[1:-1]
    return result, took


def main(devices, size, steps, output):
    found, took = solve(devices, size, steps)
    alone, took_alone = solve(devices[:1], size, steps)
    same = "yes" if np.array_equal(found, alone) else "no"
    error = np.abs(found - standing(size, steps)).max()
    output.mkdir(parents=True, exist_ok=True)
    figure = plt.figure(figsize=(4.8, 4.8), dpi=80)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.imshow(found, cmap="RdBu", interpolation="bilinear")
    for edge in np.linspace(1, size - 1, len(devices) + 1)[1:-1]:
        axes.axhline(edge, color="k", linewidth=0.6)
    axes.axis("off")
    figure.savefig(output / "several_devices.png")
    print("| devices | cells | steps | s | s on one | same bits | error |")
    print("| --- | ---: | ---: | ---: | ---: | --- | ---: |")
    names = ", ".join(devices)
    times = f"{took:.2f} | {took_alone:.2f}"
    print(f"| {names} | {size * size} | {steps} | {times} | {same} | {error:.1e} |")


def all_devices():
    """All GPUs; strips that share what there is if there are fewer than two."""
    names = [str(device) for device in wp.get_cuda_devices()]
    return names if len(names) > 1 else (names or ["cpu"]) * 3


if __name__ == "__main__":
    wp.config.quiet = True
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--devices", help="names, separated by commas; all GPUs by default")
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--steps", type=int, default=400)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    chosen = options.devices.split(",") if options.devices else all_devices()
    main(chosen, options.size, options.steps, options.output)
