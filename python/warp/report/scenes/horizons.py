"""Gradients over long horizons: a chaotic map whose derivative is known in closed form."""

import functools

import numpy as np

import warp as wp
import warp.report as report

START = 0.1


@functools.cache
def make_logistic(real):
    """x <- 4 x (1 - x), many times in a thread."""

    @wp.kernel
    def logistic(start: wp.array(dtype=real), steps: int, end: wp.array(dtype=real)):
        i = wp.tid()
        x = start[i]
        for _ in range(steps):
            x = real(4.0) * x * (real(1.0) - x)
        end[i] = x

    return logistic


def exact_logistic(case):
    """x_n = sin^2(2^n a) with sin^2 a = x_0 as the run's precision has it, and its derivative."""
    start = np.float64(np.dtype(case.dtype).type(START))
    angle = np.arcsin(np.sqrt(start))
    phase = 2.0**case.horizon * angle
    slope = 2.0**case.horizon * np.sin(2.0 * phase) / np.sin(2.0 * angle)
    return {"position": np.array([np.sin(phase) ** 2]), "gradient": np.array([slope])}


def limits(case):
    """Errors double with each step: 2^n u, with a margin of 16."""
    unit = 2.0 ** (-24 if case.dtype == "float32" else -53)
    bound = 16.0 * 2.0**case.horizon * unit
    return {} if bound > 0.5 else {"gradient": max(bound, 64.0 * unit)}


@report.scene(
    sweep=report.Sweep("horizon", values=(1, 2, 5, 10, 15, 20, 30, 40, 60), quick=5),
    reference=report.Exact(exact_logistic, error=1e-14),
    limits=limits,
    expect=lambda case: "ok" if case.horizon < (20 if case.dtype == "float32" else 45) else "any",
    diverged=np.inf,
)
def logistic_gradient(case):
    """d x_n / d x_0 of the logistic map: exact to 2^n rounding errors, growing as 2^n."""
    start = wp.full(1, START, dtype=case.real, device=case.device, requires_grad=True)
    end = wp.zeros_like(start)
    seed = wp.ones_like(start)
    kernel = make_logistic(case.real)

    def run():
        wp.launch(kernel, 1, [start, case.horizon], [end], device=case.device)

    def gradient():
        tape = wp.Tape()
        with tape:
            wp.launch(kernel, 1, [start, case.horizon], [end], device=case.device)
        tape.backward(grads={end: seed})
        found = start.grad.numpy().copy()
        tape.zero()
        return found

    return report.Program(run, lambda: {"position": end.numpy()}, gradient=gradient)
