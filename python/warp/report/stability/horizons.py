"""Gradients over long horizons: L1 to L8."""

import functools

import numpy as np

import warp as wp
from warp.report.scenes.horizons import make_logistic
from warp.report.stability._case import case

BOTH = ("float32", "float64")


def gradient(p, kernel, start, *inputs):
    """Values and derivative of `kernel(start, *inputs, end)`, one thread for each start."""
    start = p.array(start, requires_grad=True)
    end = p.zeros(start.shape, requires_grad=True)
    tape = wp.Tape()
    with tape:
        p.launch(kernel, start.shape[0], start, *inputs, end)
    tape.backward(grads={end: wp.ones_like(end, requires_grad=False)})
    return end.numpy(), start.grad.numpy()


@case("L1", "derivative of the logistic map after 10, 20 and 1000 steps", BOTH)
def logistic_map(p):
    for steps, exact in ((10, -1211.521358799067), (20, 1342792.0893)):
        _, found = gradient(p, make_logistic(p.real), [0.1], steps)
        p.check(f"{steps} steps", found[0] / exact - 1, max(2**steps * 4 * p.u, 1e-9))
    steps = 100 if p.dtype == "float32" else 1000
    _, found = gradient(p, make_logistic(p.real), np.linspace(0.1, 0.2, 64), steps)
    rate = np.log(np.abs(found.astype(float))) / steps
    p.check("growth rate - ln 2, in the mean", rate.mean() - np.log(2), 0.05)


@functools.cache
def make_oscillator(real):
    @wp.kernel
    def oscillator(start: wp.array(dtype=real), v: real, steps: int, end: wp.array(dtype=real)):
        i = wp.tid()
        x, h = start[i], real(0.01)
        for _ in range(steps):
            v -= h * x
            x += h * v
        end[i] = x

    return oscillator


@case("L3", "derivative of an oscillator over 1e4 steps", BOTH)
def oscillator(p):
    h = np.longdouble(np.array(0.01, p.dtype))
    step = np.array([[1 - h * h, h], [-h, 1]], np.longdouble)
    power = np.eye(2, dtype=np.longdouble)
    for _ in range(10000):
        power = step @ power
    _, found = gradient(p, make_oscillator(p.real), [0.3], 0.0, 10000)
    p.check("dx / dx0", found[0] - power[0, 0], 1e4 * p.u)


def contact_kernel(p):
    from warp.report._scene import registered

    return registered()["bounce"].build.__globals__["make_bounce"](p.real)


@case("L4", "gradients through stiff contact are those of the program that ran")
def stiff_contact(p):
    start = np.array([0.31037, 0.37041, 0.43029])
    for k in (1e2, 1e4, 1e6, 1e8):
        # Far enough from a step that touches the wall in one program and not in the other.
        eps = 1e-7
        _, found = gradient(p, contact_kernel(p), start, k, 1e-3, 1000)
        up, _ = gradient(p, contact_kernel(p), start + eps, k, 1e-3, 1000)
        down, _ = gradient(p, contact_kernel(p), start - eps, k, 1e-3, 1000)
        p.check(f"k = {k:g}: from differences", found - (up - down) / (2 * eps), 1e-5, start=start)
        p.note(f"k = {k:g}: bias to the exact event", float(np.abs(found + 1).max()))


@case("L5", "an elastic bounce: derivative -1, where a contact without its time gives +1")
def bounce(p):
    found = p.scene("bounce", {}, stiffness=1e4, dt=1e-5)
    p.check("gradient", found["errors"].get("gradient", np.inf), 0.05)


@functools.cache
def make_step(real):
    @wp.kernel
    def step(x: wp.array(dtype=real), y: wp.array(dtype=real)):
        i = wp.tid()
        y[i] = x[i] + real(0.01) * wp.sin(real(3.0) * x[i])

    return step


@case("L6", "checkpoints give the gradient of full storage, bit for bit", BOTH)
def checkpoints(p):
    found, steps = [], 150
    for snapshots in (steps, 5):
        x = p.array(np.linspace(0.1, 1.0, 16), requires_grad=True)

        def advance(_, x=x):
            y = p.zeros(16, requires_grad=True)
            p.launch(make_step(p.real), 16, x, y)
            wp.copy(x, y)

        tape = wp.Tape()
        with tape:
            wp.autograd.checkpoint(advance, steps, [x], snapshots)
        tape.backward(grads={x: wp.ones_like(x, requires_grad=False)})
        found.append(x.grad.numpy())
    p.check("difference", found[0] - found[1], 0.0)
    p.holds("not zero", np.abs(found[0]) > 0.0)


@functools.cache
def make_fixed_point(real):
    @wp.kernel
    def iterate(start: wp.array(dtype=real), steps: int, end: wp.array(dtype=real)):
        i = wp.tid()
        x = real(1.0)
        for _ in range(steps):
            x = wp.cos(start[i] * x)
        end[i] = x

    return iterate


@case("L7", "gradient through a solver stopped early and at convergence")
def unconverged(p):
    a = np.linspace(0.5, 0.9, 8)
    x = np.ones(8)
    for _ in range(500):
        x = np.cos(a * x)
    exact = -np.sin(a * x) * x / (1 + a * np.sin(a * x))
    for steps in (5, 20, 300):
        value, found = gradient(p, make_fixed_point(p.real), a, steps)
        residual = np.abs(value - x).max()
        # Contraction by a factor q: both errors fall as q^n, the gradient's by a factor n slower.
        limit = 20 * steps * residual + 20 * p.u
        p.check(f"{steps} steps: error over the residual", np.abs(found - exact).max(), limit)
        p.note(f"{steps} steps: bias", float(np.abs(found - exact).max()))


@case("L8", "norm of the gradient over the horizon", BOTH)
def horizon_curve(p):
    norms = []
    for steps in (10, 20, 40, 80, 160):
        _, found = gradient(p, make_logistic(p.real), np.linspace(0.1, 0.2, 64), steps)
        norms.append(np.log(np.abs(found.astype(float))).mean())
    slopes = np.diff(norms) / np.diff([10, 20, 40, 80, 160])
    finite = np.isfinite(slopes)
    p.check("slope of log |g|, less ln 2", np.abs(slopes[finite] - np.log(2)).max(), 0.07)
    first = [n for n, v in zip((10, 20, 40, 80, 160), norms) if not np.isfinite(v)]
    p.note("first horizon that is not finite", first[0] if first else "none")
