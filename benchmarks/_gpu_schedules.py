"""Launches that a schedule of their own makes faster: the `schedules` section of gpu.py.

    python _gpu_schedules.py schedules --device cuda:0 [--seconds 0.5]

prints one line of JSON: pairs per second of n-body by the number of points, with sums in order and
with `fast_math`; shares of a copy on the device for kernels that exchange indices; and the time of
an adjoint over that of its forward launch.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

import numpy as np

import _gpu_cases as cases
import _spine_cases as spine
import warp as wp

POINTS = (4096, 16384, 49152, 131072)
SIDE = 8192


@wp.kernel(module="unique")
def turn_store(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
    i, j = wp.tid()
    y[j, i] = x[i, j]


def pair_rates(device, seconds):
    """Pairs per second, by "points order" or "points fast"."""
    result = {}
    for name in ("order", "fast"):
        kernel = spine.define_nbody()
        kernel.options["fast_math"] = name == "fast"
        for n in POINTS:
            points, force = spine.arrays(device, n, wp.vec3, wp.vec3)

            def launch(kernel=kernel, n=n, points=points, force=force):
                wp.launch(kernel, n, [points, force, n, 1e-4], device=device)

            result[f"{n} {name}"] = n * n / cases.fastest(launch, device, seconds, 2)
    return result


def turn_shares(device, seconds):
    """Bytes per second of kernels that exchange indices, over those of a copy."""
    x = wp.zeros((SIDE, SIDE), dtype=float, device=device)
    y = wp.zeros((SIDE, SIDE), dtype=float, device=device)
    data = np.random.default_rng(1).standard_normal((SIDE, SIDE), dtype=np.float32)
    x.assign(data)
    copy = cases.fastest(lambda: wp.copy(y, x), device, seconds)
    result = {}
    for name, kernel in (("load", cases.transpose), ("store", turn_store)):
        y.zero_()

        def launch(kernel=kernel):
            wp.launch(kernel, x.shape, [x, y], device=device)

        result[name] = copy / cases.fastest(launch, device, seconds)
        if not np.array_equal(y.numpy(), data.T):
            raise RuntimeError(f"'{kernel.key}' is wrong")
    return result


def adjoint_ratio(device, seconds):
    """Time of the adjoint of sin·exp over that of its forward launch, and both rates."""
    n = 1 << 26
    x = wp.full(n, 0.7, dtype=float, device=device, requires_grad=True)
    y = wp.zeros(n, dtype=float, device=device, requires_grad=True)
    kernel = spine.define_math()

    def forward():
        wp.launch(kernel, n, [x, y], device=device)

    def backward():
        wp.launch(kernel, n, [x, y], [], [x.grad, y.grad], [], device=device, adjoint=True)

    there = cases.fastest(forward, device, seconds)
    back = cases.fastest(backward, device, seconds)
    return {"forward": n / there, "backward": n / back, "ratio": back / there}


def measure_schedules(device, seconds):
    """All of the above."""
    return {
        "pairs": pair_rates(device, seconds),
        "turns": turn_shares(device, seconds),
        "sin·exp": adjoint_ratio(device, seconds),
    }


def schedule_rows(device, seconds):
    """Rows for the table of gpu.py; the measurement runs in a process of its own."""
    from spine import Row, Runner

    with tempfile.TemporaryDirectory() as cache:
        result = Runner(device, seconds, None, Path(__file__), 60.0).run("schedules", cache)
    goals = {"16384 order": 600, "16384 fast": 1000, "131072 fast": 1300}
    rows = []
    for name, rate in result["pairs"].items():
        goal = goals.get(name)
        points, how = name.split()
        label = f"n-body, {points} points, " + ("fast_math" if how == "fast" else "in order")
        met = None if goal is None else rate >= 1e9 * goal
        rows.append(
            Row(label, f">= {goal} G/s" if goal else "", f"{rate / 1e9:.0f} G pairs/s", met)
        )
    for name, share in result["turns"].items():
        row = Row(f"exchanged {name} of device memcpy", ">= 95%", f"{share:.1%}", share >= 0.95)
        rows.append(row)
    found = result["sin·exp"]
    text = f"{found['ratio']:.2f}x: {found['backward'] / 1e9:.0f} G/s backward, "
    text += f"{found['forward'] / 1e9:.0f} forward"
    rows.append(Row("sin·exp, adjoint over forward", "<= 1.6x", text, found["ratio"] <= 1.6))
    return rows


def main():
    """Run the measurement."""
    parser = argparse.ArgumentParser()
    parser.add_argument("measurement", choices=["schedules"])
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--seconds", type=float, default=0.5)
    options = parser.parse_args()
    wp.config.quiet = True
    result = measure_schedules(options.device, options.seconds)
    sys.stdout.write("\n" + json.dumps(result) + "\n")


if __name__ == "__main__":
    main()
