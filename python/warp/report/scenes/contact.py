"""Contact: friction on a slope at the cone's edge, a stiff bounce and its gradient."""

import functools

import numpy as np

import warp as wp
import warp.report as report

GRAVITY = 9.81


@functools.cache
def make_slope(real):
    """A block on a slope with Coulomb friction, implicit in the friction's sign."""

    @wp.kernel
    def slide(
        angle: wp.array(dtype=real),
        mu: real,
        dt: real,
        steps: int,
        distance: wp.array(dtype=real),
    ):
        i = wp.tid()
        g = real(GRAVITY)
        pull, hold = g * wp.sin(angle[i]), mu * g * wp.cos(angle[i])
        v, x = real(0.0), real(0.0)
        for _ in range(steps):
            free = v + pull * dt
            # Friction takes what it needs to stop the block, at most mu times the normal force.
            v = free - wp.clamp(free, -hold * dt, hold * dt)
            x += v * dt
        distance[i] = x

    return slide


def slopes(case):
    """Slopes from flat to 60 degrees, and two at 1e-3 beside the cone's edge."""
    edge = np.arctan(case.mu)
    beside = [max(edge - 1e-3, 0.0), edge + 1e-3]
    angles = np.concatenate([np.linspace(0.0, np.pi / 3.0, 62), beside])
    return angles.astype(case.dtype)


def exact_slide(case):
    """x = a t^2 / 2 where the pull passes the cone, 0 elsewhere."""
    angles = slopes(case).astype(np.float64)
    push = GRAVITY * np.maximum(np.sin(angles) - case.mu * np.cos(angles), 0.0)
    return {"distance": 0.5 * push}


@report.scene(
    sweep=report.Sweep("dt", 1e-1, 1e-4, 7, quick=4),
    curves=(report.Sweep("mu", values=(0.0, 0.3, 0.9)),),
    reference=report.Exact(exact_slide, error=1e-15),
    limits=lambda case: {"creep": 0.0},
)
def slope(case):
    """64 blocks on slopes around the friction cone for 1 s; those that stick do not creep."""
    angles = slopes(case)
    angle = wp.array(angles, dtype=case.real, device=case.device)
    distance = wp.zeros_like(angle)
    steps = max(1, round(1.0 / case.dt))

    def run():
        inputs = [angle, case.mu, 1.0 / steps, steps, distance]
        wp.launch(make_slope(case.real), angle.shape[0], inputs, device=case.device)

    def quantities():
        moved = distance.numpy()
        stuck = np.tan(angles.astype(np.float64)) < case.mu * (1.0 - 1e-6)
        creep = float(np.abs(moved[stuck]).max()) if stuck.any() else 0.0
        return {"distance": moved, "creep": report.Error(creep)}

    return report.Program(run, quantities, work=angles.size * steps)


@functools.cache
def make_bounce(real):
    """A ball that flies against a wall at x = 0, pushed back by a spring of stiffness k."""

    @wp.kernel
    def bounce(
        start: wp.array(dtype=real), k: real, dt: real, steps: int, end: wp.array(dtype=real)
    ):
        i = wp.tid()
        x, v = start[i], real(-1.0)
        for _ in range(steps):
            # Implicit in the contact: stable for any stiffness.
            ahead = x + v * dt
            if ahead < real(0.0):
                v = (v - k * x * dt) / (real(1.0) + k * dt * dt)
            x += v * dt
        end[i] = x

    return bounce


def exact_bounce(case):
    """Free flight, half a period in the wall, free flight: dx_end / dx_start = -1."""
    start = starts().astype(case.dtype).astype(np.float64)
    frequency = np.sqrt(case.stiffness)
    return {"position": 1.0 - start - np.pi / frequency, "gradient": np.full(start.size, -1.0)}


def starts():
    return np.linspace(0.3, 0.5, 256)


def expect_bounce(case):
    """The gradient of steps that are not small beside the contact says nothing of the contact."""
    return "ok" if np.pi / np.sqrt(case.stiffness) > 20.0 * case.dt else "any"


@report.scene(
    sweep=report.Sweep("dt", 1e-3, 1e-6, 5, quick=3),
    curves=(report.Sweep("stiffness", values=(1e4, 1e6)),),
    reference=report.Exact(exact_bounce, error=1e-15),
    dtypes=("float64",),
    expect=expect_bounce,
    diverged=10.0,
)
def bounce(case):
    """Elastic bounce on a stiff wall: where the ball is after 1 s, and the gradient, -1."""
    start = wp.array(starts(), dtype=case.real, device=case.device, requires_grad=True)
    end = wp.zeros_like(start)
    seed = wp.ones_like(start)
    steps = round(1.0 / case.dt)
    kernel = make_bounce(case.real)
    inputs = [start, case.stiffness, case.dt, steps]

    def run():
        wp.launch(kernel, 256, inputs, [end], device=case.device)

    def gradient():
        tape = wp.Tape()
        with tape:
            wp.launch(kernel, 256, inputs, [end], device=case.device)
        tape.backward(grads={end: seed})
        found = start.grad.numpy().copy()
        tape.zero()
        return found

    return report.Program(run, lambda: {"position": end.numpy()}, gradient=gradient, work=steps)
