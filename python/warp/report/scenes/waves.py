"""Waves and heat on a grid: order, the limit of stability, conservation."""

import functools

import numpy as np

import warp as wp
import warp.report as report


@functools.cache
def make_wave(real):
    """Leapfrog of the wave equation on a ring of cells."""

    @wp.kernel
    def wave(
        before: wp.array(dtype=real),
        now: wp.array(dtype=real),
        c2: real,
        after: wp.array(dtype=real),
    ):
        i = wp.tid()
        n = now.shape[0]
        left, right = now[(i + n - 1) % n], now[(i + 1) % n]
        after[i] = real(2.0) * now[i] - before[i] + c2 * (left - real(2.0) * now[i] + right)

    return wave


def travelling(cells, time):
    """sin(2 pi (x - t)) + sin(6 pi (x - t)) / 3 at the cells' points, period 1, speed 1."""
    phase = 2.0 * np.pi * (np.arange(cells) / cells - time)
    return np.sin(phase) + np.sin(3.0 * phase) / 3.0


def steps_of(case):
    """Steps to t = 1: one turn round the ring."""
    return round(case.cells / case.courant)


def expect_wave(case):
    """Above a Courant number c of 1 rounding errors grow by (c + sqrt(c^2 - 1))^2 a step."""
    if case.courant <= 1.0:
        return "ok"
    factor = (case.courant + np.sqrt(case.courant**2 - 1.0)) ** 2
    unit = 2.0 ** (-24 if case.dtype == "float32" else -53)
    size = np.log10(unit) + steps_of(case) * np.log10(factor)
    return "any" if abs(size) < 4.0 else "diverged" if size > 0.0 else "ok"


@report.scene(
    sweep=report.Sweep("cells", values=(32, 64, 128, 256, 512, 1024), quick=4),
    curves=(report.Sweep("courant", values=(0.5, 0.9, 1.01)),),
    reference=report.Exact(
        lambda case: {"height": travelling(case.cells, steps_of(case) * case.courant / case.cells)},
        error=1e-14,
    ),
    expect=expect_wave,
    diverged=2.0,
)
def wave(case):
    """A wave goes once round a ring; second order, unstable above a Courant number of 1."""
    cells, kernel = int(case.cells), make_wave(case.real)
    step = case.courant / cells
    levels = [travelling(cells, -step), travelling(cells, 0.0), np.zeros(cells)]
    first = [wp.array(level, dtype=case.real, device=case.device) for level in levels]
    rows = [wp.clone(level) for level in first]
    steps = steps_of(case)

    def reset():
        for row, level in zip(rows, first):
            wp.copy(row, level)

    def run():
        before, now, after = rows
        for _ in range(steps):
            inputs = [before, now, case.courant**2]
            wp.launch(kernel, cells, inputs, [after], device=case.device)
            before, now, after = now, after, before

    def quantities():
        return {"height": rows[(1 + steps) % 3].numpy()}

    return report.Program(run, quantities, reset, work=cells * steps)


@functools.cache
def make_heat(real):
    """An explicit step of the heat equation on a ring."""

    @wp.kernel
    def heat(now: wp.array(dtype=real), r: real, after: wp.array(dtype=real)):
        i = wp.tid()
        n = now.shape[0]
        left, right = now[(i + n - 1) % n], now[(i + 1) % n]
        after[i] = now[i] + r * (left - real(2.0) * now[i] + right)

    return heat


HEAT_STEPS = 400


def heat_mode(case):
    """The discrete decay of the roughest wave but one, exact for the scheme itself."""
    cells = int(case.cells)
    mode = cells // 2
    decay = 1.0 - 4.0 * case.cfl * np.sin(np.pi * mode / cells) ** 2
    start = np.cos(2.0 * np.pi * mode * np.arange(cells) / cells)
    return {"temperature": start * decay**HEAT_STEPS}


@report.scene(
    sweep=report.Sweep("cfl", values=(0.1, 0.3, 0.45, 0.49, 0.5, 0.5001, 0.51, 0.6), quick=5),
    reference=report.Exact(heat_mode, error=1e-13),
    dtypes=("float64",),
    diverged=1.0,
    cells=64,
)
def heat(case):
    """Explicit heat equation on both sides of its limit 0.5, against the scheme's own decay."""
    cells, kernel = int(case.cells), make_heat(case.real)
    mode = np.cos(np.pi * np.arange(cells))
    first = wp.array(mode, dtype=case.real, device=case.device)
    rows = [wp.clone(first), wp.zeros_like(first)]

    def run():
        now, after = rows
        for _ in range(HEAT_STEPS):
            wp.launch(kernel, cells, [now, case.cfl], [after], device=case.device)
            now, after = after, now

    def quantities():
        return {"temperature": rows[0].numpy()}

    return report.Program(run, quantities, lambda: wp.copy(rows[0], first), work=cells * HEAT_STEPS)
