"""Runs cases of shapes.py as they are asked for; under this package and under NVIDIA Warp.

    python _shape_cases.py --device cpu --folder /tmp/results [--seconds 0.1]

Every line of the standard input names a case, or a file that registers the case of its name, and is
answered by a line of JSON. At its first
request a case is compiled, and what it computes is written to the folder: outputs of one launch,
then gradients of one adjoint launch with random seeds. Gradients are also held against the outputs
themselves: `slope_error` is how far the squared length of the gradient, relatively, is from the
central difference along it of the outputs times their seeds. Each request measures times.
An adjoint launch consumes the seeds, so they are copied before each; the copies are subtracted.
"""

import argparse
import importlib.util
import json
import os
import sys
import time
from pathlib import Path

import numpy as np

import _shape_algebra  # noqa: F401  (registers cases)
import _shape_borders  # noqa: F401
import _shape_bytes  # noqa: F401
import _shape_chains  # noqa: F401
import _shape_fields  # noqa: F401
import _shape_groups  # noqa: F401
import _shape_images  # noqa: F401
import _shape_light  # noqa: F401
import _shape_locals  # noqa: F401
import _shape_loops  # noqa: F401
import _shape_maps  # noqa: F401
import _shape_networks  # noqa: F401
import _shape_numbers  # noqa: F401
import _shape_points  # noqa: F401
import _shape_queries  # noqa: F401
import _shape_ragged  # noqa: F401
import _shape_rows  # noqa: F401
import _shape_samples  # noqa: F401
import _shape_signal  # noqa: F401
import _shape_solids  # noqa: F401
import _shape_structs  # noqa: F401
import _shape_sums  # noqa: F401
import _shape_text  # noqa: F401
import _shape_tiles  # noqa: F401
import warp as wp
from _shape_data import CASES, Data

try:
    from warp._native import wait_for_background
except ImportError:
    wait_for_background = None  # NVIDIA Warp

# Seconds and launches before code that is compiled in the background is waited for: tier-1 code and
# that of the first check, the launches of the check, and the same for two more checks.
SETTLING = ((0.03, 3), (0.0, 32))
if wait_for_background and "BENCH_LANES" not in os.environ and wp.config.check_lanes:
    SETTLING += ((0.12, 3), (0.0, 32), (0.35, 3), (0.0, 32))

# Steps of central differences.
STEPS = {np.dtype(np.float16): 3e-2, np.dtype(np.float32): 1e-3, np.dtype(np.float64): 1e-6}


def flat(values):
    """Numbers of an array of numbers or structs as one row of float64."""
    if values.dtype.names:
        return np.concatenate([flat(values[name]) for name in values.dtype.names])
    return values.reshape(-1).astype(np.float64)


def seeds_of(one):
    """Random adjoints of the outputs."""
    random = np.random.default_rng(11)
    return [
        random.uniform(0.5, 1.5, out.numpy().shape).astype(out.numpy().dtype) for out in one.outputs
    ]


def slope_error(one, seeds, device):
    """Relative difference of the gradient's squared length and a central difference along it."""
    given = [a for a in one.inputs if getattr(a, "requires_grad", False)]
    values = [a.numpy().copy() for a in given]
    if not one.smooth or any(value.dtype not in STEPS for value in values):
        return None
    slopes = [a.grad.numpy().astype(np.float64) for a in given]
    largest = max(np.abs(slope).max() for slope in slopes)
    step = max(STEPS[value.dtype] for value in values) / max(largest, 1e-30)
    sums, moved = [], []
    for sign in (1.0, -1.0):
        parts = []
        for a, value, slope in zip(given, values, slopes, strict=True):
            a.assign((value + sign * step * slope).astype(value.dtype))
            parts.append(a.numpy().astype(np.float64))
        for out in one.outputs:
            out.zero_()
        one.launch(device)
        sums.append(
            sum(
                (out.numpy().astype(np.float64) * seed).sum()
                for out, seed in zip(one.outputs, seeds, strict=True)
            )
        )
        moved.append(parts)
    for a, value in zip(given, values, strict=True):
        a.assign(value)
    predicted = sum(((b - c) * s).sum() for b, c, s in zip(*moved, slopes, strict=True))
    return float(abs(sums[0] - sums[1] - predicted) / max(abs(predicted), 1e-30))


class Worker:
    """Cases that have been made, ready to be timed again."""

    def __init__(self, options):
        self.device, self.folder = options.device, Path(options.folder)
        self.seconds = options.seconds
        # Other threads compile at first launches, and no part of a later one is theirs.
        self.total = time.process_time if options.processor else time.perf_counter
        self.clock = time.thread_time if options.processor else time.perf_counter
        self.made = {}

    def first(self, function):
        """Seconds of a first launch."""
        begin = self.total()
        function(self.device)
        wp.synchronize_device(self.device)
        return self.total() - begin

    def make(self, name):
        """The case, and the times of its first launches."""
        path = Path(name)
        if path.suffix == ".py":
            # Source lines of kernels are read from the file.
            spec = importlib.util.spec_from_file_location(path.stem, path)
            spec.loader.exec_module(importlib.util.module_from_spec(spec))
        one = CASES[path.stem](Data(self.device))
        result = {"first": self.first(one.launch)}
        arrays = {f"output {k}": flat(out.numpy()) for k, out in enumerate(one.outputs)}
        if one.differentiable:
            seeds = seeds_of(one)
            one.seeds = [
                wp.array(seed, dtype=out.dtype, device=self.device)
                for out, seed in zip(one.outputs, seeds, strict=True)
            ]
            one.seed_adjoints()
            result["adjoint_first"] = self.first(one.launch_adjoint)
            for k, given in enumerate(one.inputs):
                if getattr(given, "requires_grad", False):
                    arrays[f"gradient {k}"] = flat(given.grad.numpy())
            result["slope_error"] = slope_error(one, seeds, self.device)
        np.savez(self.folder / path.stem, **arrays)
        self.made[name] = one
        return result

    def settle(self, function):
        """Launches until tier-1 code is there and its lanes are checked: where another program has
        the processors, the threads that compile would come too late for what is timed.
        """
        if wait_for_background is None:
            return
        for seconds, least in SETTLING:
            end, count = self.clock() + seconds, 0
            while self.clock() < end or count < least:
                function(self.device)
                count += 1
            wait_for_background()

    def fastest(self, function):
        """Seconds per call in the fastest of many batches."""
        once = max(self.first(function), 1e-6)
        batch = max(1, int((0.01 if "cuda" in self.device else 0.002) / once))
        times, end = [], self.clock() + self.seconds
        while self.clock() < end or len(times) < 20:
            begin = self.clock()
            for _ in range(batch):
                function(self.device)
            wp.synchronize_device(self.device)
            times.append((self.clock() - begin) / batch)
        return min(times)

    def answer(self, name):
        """Times of one case, or the error that it ended with."""
        try:
            is_new = name not in self.made
            result = self.make(name) if is_new else {}
            one = self.made[name]
            if is_new:
                self.settle(one.launch)
            result |= {"items": one.items, "unit": one.unit, "forward": self.fastest(one.launch)}
            if one.differentiable:
                if is_new:
                    self.settle(one.launch_seeded)
                seeding = self.fastest(lambda device: one.seed_adjoints())
                result["adjoint"] = self.fastest(one.launch_seeded) - seeding
        except Exception as error:  # whatever a package raises is its result
            result = {"error": f"{type(error).__name__}: {error}"[:400]}
        return {"case": name} | result


def main():
    """Answer requests until the standard input ends."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--folder", required=True)
    parser.add_argument("--seconds", type=float, default=0.1)
    parser.add_argument("--processor", action="store_true")
    options = parser.parse_args()
    wp.config.quiet = True
    wp.init()
    worker = Worker(options)
    for line in sys.stdin:
        sys.stdout.write("\n" + json.dumps(worker.answer(line.strip())) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
