"""Sums, counters and determinism: N1 to N4, N12, N14."""

import functools
import math

import numpy as np

import warp as wp
from warp.report.stability._case import case
from warp.report.stability.rotations import BOTH


@functools.cache
def make_totals(real):
    @wp.kernel
    def compensated(x: wp.array(dtype=real), out: wp.array(dtype=real)):
        total, lost = real(0.0), real(0.0)
        for i in range(x.shape[0]):
            y = x[i] - lost
            t = total + y
            lost = (t - total) - y
            total = t
        out[0] = total

    @wp.kernel
    def atomic(x: wp.array(dtype=real), out: wp.array(dtype=real)):
        wp.atomic_add(out, 0, x[wp.tid()])

    return compensated, atomic


@case("N1", "the sum of 1e7 times 0.1", ("float32",))
def long_sum(p):
    n = 10_000_000
    x = wp.full(n, 0.1, dtype=p.real, device=p.device)
    exact = n * float(np.float32(0.1))
    compensated, atomic = make_totals(p.real)
    p.check("wp.utils.array_sum", wp.utils.array_sum(x) / exact - 1, math.log2(n) * p.u)
    out = p.zeros(1)
    p.launch(compensated, 1, x, out)
    p.check("compensated loop", out.numpy()[0] / exact - 1, 2 * p.u)
    out = p.zeros(1)
    p.launch(atomic, n, x, out)
    # In single precision by definition: no worse than adding one by one.
    p.check("atomic_add of all threads", out.numpy()[0] / exact - 1, 0.088)


@case("N2", "sums that cancel, in random order", ("float64",))
def cancelling_sum(p):
    x = np.tile([1.0, 1e8, 1.0, -1e8], 10000)
    found = []
    for _ in range(5):
        p.random.shuffle(x)
        found.append(float(wp.utils.array_sum(p.array(x))))
    kappa = np.abs(x).sum() / 20000.0
    p.check("array_sum", np.array(found) / 20000.0 - 1, math.log2(x.size) * p.u * kappa)
    p.note("condition number of the sum", float(kappa))
    p.note("spread over orders", float(np.ptp(found)))


@case("N3", "counting by atomic_add past 2^24", ("float32",))
def counter(p):
    n = (1 << 24) + 4096
    ones, out = wp.ones(n, dtype=p.real, device=p.device), p.zeros(1)
    p.launch(make_totals(p.real)[1], n, ones, out)
    p.check("float counter of a launch", out.numpy()[0] / n - 1, 2 * p.u)
    count = p.zeros(1, wp.int32)
    p.launch(make_totals(wp.int32)[1], n, wp.ones(n, dtype=wp.int32, device=p.device), count)
    p.check("int counter", count.numpy()[0] - n, 0.0)
    # One by one nothing can be had: 2^24 + 1 is no float.
    out = wp.full(1, float(1 << 24), dtype=p.real, device=p.device)
    p.launch(make_totals(p.real)[1], 1, wp.ones(1, dtype=p.real, device=p.device), out)
    stalled = float(out.numpy()[0]) == float(1 << 24)
    if stalled:
        p.explained("float counter over launches", "stalls at 2^24: count with integers")


@functools.cache
def make_deterministic(real):
    @wp.kernel(module="unique", module_options={"deterministic": "gpu_to_gpu"})
    def scatter(x: wp.array(dtype=real), bin: wp.array(dtype=int), out: wp.array(dtype=real)):
        i = wp.tid()
        wp.atomic_add(out, bin[i], x[i])

    return scatter


@case("N4", "atomic sums, 20 runs: within n u of each other, bit for bit where asked for", BOTH)
def repeated_sums(p):
    n = 200_000
    x = p.random.normal(size=n).astype(p.dtype)
    exact, size = math.fsum(x.tolist()), math.fsum(np.abs(x).tolist())
    given, runs = p.array(x), []
    for _ in range(20):
        out = p.zeros(1)
        p.launch(make_totals(p.real)[1], n, given, out)
        runs.append(float(out.numpy()[0]))
    p.check("default", (np.array(runs) - exact) / size, math.log2(n) * p.u)
    bins, seen = p.array(np.arange(n) % 7, wp.int32), set()
    for _ in range(20):
        out = p.zeros(7)
        p.launch(make_deterministic(p.real), n, given, bins, out)
        seen.add(out.numpy().tobytes())
    p.check("results of 20 deterministic runs", len(seen) - 1, 0.0)


@functools.cache
def make_half():
    @wp.kernel
    def accumulate(x: wp.array(dtype=wp.float16), out: wp.array(dtype=wp.float32)):
        wp.atomic_add(out, 0, wp.float32(x[wp.tid()]))

    @wp.kernel
    def square(x: wp.array(dtype=wp.float16), y: wp.array(dtype=wp.float16)):
        i = wp.tid()
        y[i] = x[i] * x[i]

    return accumulate, square


@case("N12", "half precision: sums in single, overflow at 65504 is named", ("float16",))
def half_precision(p):
    n = 100_000
    x = p.array(np.full(n, 0.1, np.float16))
    accumulate, square = make_half()
    out = p.zeros(1, wp.float32)
    p.launch(accumulate, n, x, out)
    exact = n * float(np.float16(0.1))
    p.check("sum in float32", out.numpy()[0] / exact - 1, 2e-6)

    def overflow():
        wp.config.verify_fp = True
        try:
            p.launch(square, 2, p.array(np.array([3.0, 300.0], np.float16)), p.zeros(2))
        finally:
            wp.config.verify_fp = False

    p.diagnosed("300 squared", overflow, "square", "not finite")


@functools.cache
def make_stencil(real):
    @wp.kernel
    def smooth(x: wp.array(dtype=real), y: wp.array(dtype=real)):
        i = wp.tid()
        if i > 0 and i < x.shape[0] - 1:
            y[i] = (x[i - 1] + x[i] + x[i + 1]) / real(3.0)

    return smooth


@case("N14", "one NaN or infinity: only what depends on it is not finite", BOTH)
def poisoned(p):
    for value in (math.nan, math.inf, -math.inf):
        for place in (0, 1, 37, 998, 999):
            x = p.random.normal(size=1000)
            x[place] = value
            y = p.zeros(1000)
            p.launch(make_stencil(p.real), 1000, p.array(x), y)
            bad = np.flatnonzero(~np.isfinite(y.numpy()))
            expected = [i for i in (place - 1, place, place + 1) if 0 < i < 999]
            p.holds(f"{value} at {place}", bad.tolist() == expected)
    points = p.random.uniform(0, 1, (500, 3)).astype(np.float32)
    points[7] = math.nan
    grid = wp.HashGrid(16, 16, 16, device=p.device)
    grid.build(p.array(points, wp.vec3), 0.1)
    p.check("points a grid leaves out", grid.skipped - 1, 0.0)
