"""Launches on the CPU while other processes want its cores.

    python benchmarks/pool.py [--seconds 2.0] [--rounds 3] [--json out.json]

prints for a small launch, saxpy on 256 thousand and on 4 million floats, and a kernel of much
arithmetic: the fastest launch, the median, the 99th of 100, the mean, and the median over the
fastest, on the machine as it is, beside one busy process and beside one for each core. The goal
is a median of saxpy of at most 1.3 times its minimum. The rounds of all conditions alternate, so
that a change of what else runs on the machine meets all of them.

The mean counts, too: a launch that waits for milliseconds is one among many in the median.
"""

import argparse
import contextlib
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import warp as wp

GOAL = 1.3
BUSY = "while True: pass"


@wp.kernel(module="unique")
def saxpy(a: float, x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = a * x[i] + y[i]


@wp.kernel(module="unique")
def iterate(a: float, x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    s = x[i]
    for _ in range(200):
        s = s * a + 0.5
    y[i] = s


CASES = {
    "small launch": (saxpy, 64),
    "saxpy 256 k": (saxpy, 1 << 18),
    "saxpy 4 M": (saxpy, 1 << 22),
    "arithmetic": (iterate, 1 << 16),
}


@contextlib.contextmanager
def busy_processes(count):
    """Runs `count` processes that never wait, as important as this one to the kernel."""
    command = [sys.executable, "-S", "-c", BUSY]
    processes = [subprocess.Popen(command) for _ in range(count)]
    # They start up and find their cores.
    time.sleep(0.1 if count else 0.0)
    try:
        yield
    finally:
        for process in processes:
            process.kill()
        for process in processes:
            process.wait()


def launch_times(kernel, items, seconds):
    """Seconds of each launch for a while."""
    x, y = wp.ones(items, dtype=float, device="cpu"), wp.zeros(items, dtype=float, device="cpu")
    inputs = [0.999, x, y]
    command = wp.launch(kernel, items, inputs, device="cpu", record_cmd=True)
    clock, times = time.perf_counter, []
    end = clock() + seconds
    begin = clock()
    while begin < end:
        command.launch()
        now = clock()
        times.append(now - begin)
        begin = clock()
    return times


def summary(times):
    """The printed times of one case under one condition, in microseconds."""
    micro = 1e6 * np.array(times)
    return {
        "min": float(micro.min()),
        "median": float(np.median(micro)),
        "p99": float(np.percentile(micro, 99)),
        "mean": statistics.fmean(micro),
        "launches": len(times),
    }


def measure(seconds, rounds):
    """Summaries by case, then by the number of busy processes."""
    counts = sorted({0, 1, len(os.sched_getaffinity(0))})
    times = {name: {count: [] for count in counts} for name in CASES}
    for _ in range(rounds):
        for count in counts:
            with busy_processes(count):
                for name, (kernel, items) in CASES.items():
                    times[name][count] += launch_times(kernel, items, seconds / rounds)
    return {
        name: {count: summary(values) for count, values in rows.items()}
        for name, rows in times.items()
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=2.0, help="of each case and condition")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    wp.config.quiet = True
    result = measure(options.seconds, options.rounds)
    print(f"{'microseconds':14}  busy {'min':>9} {'median':>9} {'p99':>9} {'mean':>9}  median/min")
    for name, rows in result.items():
        for count, row in rows.items():
            ratio = row["median"] / row["min"]
            goal = f"goal {GOAL}" if name == "saxpy 4 M" else ""
            figures = " ".join(f"{row[key]:9.1f}" for key in ("min", "median", "p99", "mean"))
            print(f"{name:14}  {count:4} {figures}  {ratio:10.2f}  {goal}".rstrip())
    if options.json:
        options.json.write_text(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
