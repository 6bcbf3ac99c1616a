"""Harmonic springs, mild to stiff: three schemes, the limits of their stability, drift."""

import functools

import numpy as np

import warp as wp
import warp.report as report

COUNT = 4096
PERIODS = 4.0


@functools.cache
def make_kernels(real):
    """Steps of `x'' = -k x`, by the name of the scheme."""

    @wp.kernel
    def explicit(x: wp.array(dtype=real), v: wp.array(dtype=real), k: real, dt: real):
        i = wp.tid()
        a = -k * x[i]
        x[i] = x[i] + v[i] * dt
        v[i] = v[i] + a * dt

    @wp.kernel
    def symplectic(x: wp.array(dtype=real), v: wp.array(dtype=real), k: real, dt: real):
        i = wp.tid()
        v1 = v[i] - k * x[i] * dt
        v[i] = v1
        x[i] = x[i] + v1 * dt

    @wp.kernel
    def leapfrog(x: wp.array(dtype=real), v: wp.array(dtype=real), k: real, dt: real):
        i = wp.tid()
        half = v[i] - k * x[i] * dt * real(0.5)
        x1 = x[i] + half * dt
        x[i] = x1
        v[i] = half - k * x1 * dt * real(0.5)

    @wp.kernel
    def implicit(x: wp.array(dtype=real), v: wp.array(dtype=real), k: real, dt: real):
        i = wp.tid()
        v1 = (v[i] - k * x[i] * dt) / (real(1.0) + k * dt * dt)
        v[i] = v1
        x[i] = x[i] + v1 * dt

    return {
        "explicit": explicit,
        "symplectic": symplectic,
        "leapfrog": leapfrog,
        "implicit": implicit,
    }


def start(dtype):
    """Positions, and velocities over the frequency: points of the unit circle."""
    angle = np.linspace(0.0, 1.0, COUNT)
    return np.cos(angle).astype(dtype), np.sin(angle).astype(dtype)


def steps_of(case):
    """Steps of a run; the step size is given in units of 1 / frequency."""
    return max(1, round(2.0 * np.pi * PERIODS / case.dt))


def exact(case):
    """Rotation of the phase plane by the time that the steps make up."""
    angle = steps_of(case) * case.dt
    x, v = (part.astype(np.float64) for part in start(case.dtype))
    return {"position": x * np.cos(angle) + v * np.sin(angle)}


#: Errors beyond, next to an amplitude of one, are a divergence.
LARGEST = 3.0


def expect(case):
    """Explicit Euler grows by sqrt(1 + dt^2) a step; the others are stable to dt = 2 or always.

    A stable orbit is an ellipse, of length 1 / sqrt(1 - dt / 2) at most by symplectic Euler; the
    exact one is a circle, and where the two are out of phase both lengths add up.
    """
    steps, dt = steps_of(case), case.dt
    if case.method == "explicit":
        growth = 0.5 * steps * np.log1p(dt * dt)
        if growth > np.log(LARGEST + 1.0):
            return "diverged"
        return "ok" if growth < np.log(LARGEST - 1.0) else "any"
    if case.method == "implicit" or 1.0 + (1.0 - 0.5 * min(dt, 1.9)) ** -0.5 < LARGEST:
        return "ok"
    return "any" if dt < 2.0 else "diverged"


@report.scene(
    sweep=report.Sweep("dt", 3.0, 3e-3, 10, quick=5),
    curves=(
        report.Sweep("method", values=("explicit", "symplectic", "leapfrog", "implicit")),
        report.Sweep("stiffness", values=(1e2, 1e10), quick=2),
    ),
    reference=report.Exact(exact),
    expect=expect,
    diverged=LARGEST,
)
def springs(case):
    """4096 springs over four periods, k = 1e2 and 1e10 N/m; dt in units of 1 / frequency."""
    kernel, steps = make_kernels(case.real)[case.method], steps_of(case)
    frequency = float(np.sqrt(case.stiffness))
    x0, v0 = start(case.dtype)
    first = [wp.array(a, dtype=case.real, device=case.device) for a in (x0, v0 * frequency)]
    x, v = (wp.clone(a) for a in first)
    dt = case.dt / frequency

    def reset():
        wp.copy(x, first[0])
        wp.copy(v, first[1])

    def run():
        for _ in range(steps):
            wp.launch(kernel, COUNT, [x, v, case.stiffness, dt], device=case.device)

    def quantities():
        return {"position": x.numpy()}

    return report.Program(run, quantities, reset, work=COUNT * steps)


def largest_frequency(ratio):
    """Largest eigenvalue of two equal springs in a row, the second mass `ratio` times the first."""
    return np.linalg.eigvals(np.array([[2.0, -1.0], [-1.0 / ratio, 1.0 / ratio]])).real.max()


def expect_chain(case):
    """Symplectic Euler is stable while dt^2 times the largest eigenvalue is below four."""
    return "ok" if case.kh2 * largest_frequency(case.mass_ratio) < 4.0 else "diverged"


@functools.cache
def make_chain(real):
    """Many symplectic steps of a chain of two masses that hangs on a wall, one thread each."""

    @wp.kernel
    def chain(x: wp.array2d(dtype=real), kh2: real, ratio: real, steps: int):
        i = wp.tid()
        a, b = x[i, 0], x[i, 1]
        da, db = real(0.0), real(0.0)
        for _ in range(steps):
            da += kh2 * (b - a - a)
            db += kh2 * (a - b) / ratio
            a += da
            b += db
        x[i, 0] = a
        x[i, 1] = b

    return chain


@report.scene(
    sweep=report.Sweep("kh2", values=tuple(np.geomspace(0.05, 20.0, 12)), quick=6),
    curves=(report.Sweep("mass_ratio", values=(1.0, 10.0, 100.0, 1e3, 1e6), quick=3),),
    expect=expect_chain,
    diverged=1e3,
)
def chain_stability(case):
    """The stable region of symplectic Euler: k h^2 against the mass ratio of a chain of two."""
    kernel, steps = make_chain(case.real), 400
    first = wp.array(np.full((64, 2), (1.0, 1.0)), dtype=case.real, device=case.device)
    x = wp.clone(first)

    def run():
        inputs = [x, case.kh2, case.mass_ratio, steps]
        wp.launch(kernel, 64, inputs, device=case.device)

    def quantities():
        with np.errstate(all="ignore"):
            size = float(np.abs(x.numpy()).max())
        return {"amplitude": report.Error(size)}

    return report.Program(run, quantities, lambda: wp.copy(x, first), work=64 * steps)
