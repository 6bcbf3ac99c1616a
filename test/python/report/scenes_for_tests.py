"""Scenes with known errors, and some that misbehave."""

import os
import time

import numpy as np

import warp as wp
import warp.report as report


@wp.kernel
def euler(x: wp.array(dtype=wp.float64), dt: wp.float64):
    i = wp.tid()
    x[i] = x[i] - x[i] * dt


@report.scene(
    sweep=report.Sweep("dt", 1e-1, 1e-3, 5, quick=3),
    reference=report.Exact(lambda case: {"x": np.full(8, np.exp(-1.0))}),
    dtypes=("float64",),
)
def decay(case):
    """x' = -x by explicit Euler."""
    x = wp.ones(8, dtype=wp.float64, device=case.device)
    steps = round(1.0 / case.dt)

    def run():
        with case.part("steps"):
            for _ in range(steps):
                wp.launch(euler, 8, [x, 1.0 / steps], device=case.device)

    return report.Program(run, lambda: {"x": x.numpy()}, lambda: x.fill_(1.0), work=8 * steps)


def constant(name, value, **options):
    """A scene that gives a constant."""

    def build(case):
        return report.Program(lambda: None, lambda: {"x": np.array([value])})

    sweep = report.Sweep("n", values=(1,))
    return report.scene(name=name, sweep=sweep, dtypes=("float64",), **options)(build)


ONE = report.Exact(lambda case: {"x": np.array([1.0])})
constant("not_finite", np.nan, reference=ONE)
constant("far_off", 5.0, reference=ONE)
constant("too_coarse", 1.01, reference=report.Tabulated({"x": (1.0,)}, 0.005, "a guess"))
constant("expected", 5.0, reference=ONE, expect=lambda case: "diverged")
constant("no_reference", 5.0)


@report.scene(sweep=report.Sweep("n", values=(1, 2)), dtypes=("float64",))
def misbehaves(case):
    """Never ends at 1, ends the process at 2."""
    action = (lambda: time.sleep(600)) if case.n == 1 else (lambda: os._exit(7))
    return report.Program(action, dict)


@report.scene(sweep=report.Sweep("n", values=(1, 2, 3)), dtypes=("float64",))
def raises(case):
    """Raises at 2, has no such parameter at 3."""
    if case.n == 2:
        raise RuntimeError("no luck")
    if case.n == 3:
        case.stiffness  # noqa: B018
    return report.Program(lambda: None, dict)
