"""Launches one by one, recorded, and replayed as a graph: the `graphs` section of gpu.py.

    python _gpu_graphs.py graphs --device cuda:0 [--seconds 0.5]

prints one line of JSON, seconds per launch of a step of 32 launches of a kernel with four array
arguments. `host` is the time until the calls are back, `whole` until the work is done. Works with
`--device cpu`, too.
"""

import argparse
import json
import statistics
import sys
import tempfile
import time
from pathlib import Path

import warp as wp

STEP = 32
WAYS = ("plain", "recorded", "graph")


@wp.kernel(module="unique")
def four_arrays(
    a: wp.array(dtype=float),
    b: wp.array(dtype=float),
    c: wp.array(dtype=float),
    d: wp.array(dtype=float),
):
    i = wp.tid()
    d[i] = a[i] + b[i] * c[i]


@wp.kernel(module="unique")
def count_down(n: wp.array(dtype=int)):
    n[0] = n[0] - 1


def seconds_per_step(step, device, seconds, steps=20):
    """Median time of a step: until the calls are back, and until the work is done."""
    host, whole = [], []
    for _ in range(3):
        step()
    wp.synchronize_device(device)
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = time.perf_counter()
        for _ in range(steps):
            step()
        queued = time.perf_counter()
        wp.synchronize_device(device)
        host.append((queued - begin) / steps)
        whole.append((time.perf_counter() - begin) / steps)
    return {"host": statistics.median(host), "whole": statistics.median(whole)}


def measure_graphs(device, seconds):
    """Seconds per launch of each way, and per turn of a loop inside of a graph."""
    arrays = [wp.zeros(64, device=device) for _ in range(4)]

    def plain():
        for _ in range(STEP):
            wp.launch(four_arrays, 64, arrays, device=device)

    command = wp.launch(four_arrays, 64, arrays, device=device, record_cmd=True)

    def recorded():
        for _ in range(STEP):
            command.launch()

    plain()
    with wp.ScopedCapture(device) as capture:
        plain()
    steps = {"plain": plain, "recorded": recorded}
    steps["graph"] = lambda: wp.capture_launch(capture.graph)
    result = {}
    for name, step in steps.items():
        times = seconds_per_step(step, device, seconds)
        result[name] = {key: value / STEP for key, value in times.items()}
    if device == "cpu" or wp.is_conditional_graph_supported():
        turns = wp.zeros(1, dtype=int, device=device)
        with wp.ScopedCapture(device) as loop:
            turns.fill_(1000)
            wp.capture_while(turns, lambda: wp.launch(count_down, 1, [turns], device=device))
        times = seconds_per_step(lambda: wp.capture_launch(loop.graph), device, seconds, 2)
        result["loop"] = times["whole"] / 1000
    return result


def graph_rows(device, seconds):
    """Rows for the table of gpu.py; the measurement runs in a process of its own."""
    from spine import Row, Runner

    with tempfile.TemporaryDirectory() as cache:
        result = Runner(device, seconds, None, Path(__file__), 60.0).run("graphs", cache)
    goals = {"plain": None, "recorded": None, "graph": 0.8}
    rows = []
    for name in WAYS:
        host, whole = (1e6 * result[name][key] for key in ("host", "whole"))
        goal = goals[name]
        text = f"{whole:.3f} us per launch, {host:.3f} us on the host"
        met = None if goal is None else whole <= goal
        rows.append(Row(f"{STEP} launches, {name}", f"<= {goal} us" if goal else "", text, met))
    if "loop" in result:
        text = f"{1e6 * result['loop']:.3f} us per turn"
        rows.append(Row("capture_while, a launch per turn", "", text))
    return rows


def main():
    """Run the measurement."""
    parser = argparse.ArgumentParser()
    parser.add_argument("measurement", choices=["graphs"])
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--seconds", type=float, default=0.5)
    options = parser.parse_args()
    wp.config.quiet = True
    result = measure_graphs(options.device, options.seconds)
    sys.stdout.write("\n" + json.dumps(result) + "\n")


if __name__ == "__main__":
    main()
