"""Stiff equations solved within a thread: Robertson's kinetics and a van der Pol oscillator."""

import functools

import numpy as np

import warp as wp
import warp.report as report

THREADS = 256


@functools.cache
def make_robertson(real, method):
    """Robertson's three species over a geometric grid of times; Newton's method in each stage."""
    vec3 = wp.types.vector(3, real)
    mat33 = wp.types.matrix((3, 3), real)

    @wp.func
    def rates(y: vec3):
        a = real(0.04) * y[0]
        b = real(1e4) * y[1] * y[2]
        c = real(3e7) * y[1] * y[1]
        return vec3(b - a, a - b - c, c)

    @wp.func
    def jacobian(y: vec3):
        b1, b2 = real(1e4) * y[2], real(1e4) * y[1]
        c = real(6e7) * y[1]
        a = real(0.04)
        return mat33(-a, b1, b2, a, -b1 - c, -b2, real(0.0), c, real(0.0))

    @wp.func
    def implicit(base: vec3, h: real):
        y = base
        for _ in range(12):
            residual = y - base - rates(y) * h
            system = wp.identity(3, real) - jacobian(y) * h
            y -= wp.inverse(system) * residual
        return y

    @wp.func
    def euler(y: vec3, h: real):
        return implicit(y, h)

    @wp.func
    def sdirk2(y: vec3, h: real):
        # Alexander (1977): L-stable, two stages, order two.
        g = real(1.0 - 0.7071067811865476)
        first = implicit(y, g * h)
        slope = rates(first)
        return implicit(y + slope * ((real(1.0) - g) * h), g * h)

    step = euler if method == "implicit Euler" else sdirk2

    @wp.kernel
    def kinetics(y: wp.array(dtype=vec3), first: real, ratio: real, steps: int):
        i = wp.tid()
        s = y[i]
        h = first
        for _ in range(steps):
            s = step(s, h)
            h *= ratio
        y[i] = s

    return kinetics


def grid(steps, end):
    """First step and ratio of `steps` geometric steps from 0 to `end`; the ratio spans 1e6."""
    ratio = 1e6 ** (1.0 / max(steps - 1, 1))
    total = steps if ratio == 1.0 else (ratio**steps - 1.0) / (ratio - 1.0)
    return end / total, ratio


@report.scene(
    sweep=report.Sweep("steps", values=(20, 40, 80, 160, 320, 640, 1280), quick=4),
    curves=(report.Sweep("method", values=("implicit Euler", "SDIRK2")),),
    reference=report.Tabulated(
        {"species": (0.715827068719405, 9.18553476456e-6, 0.284163745745830)},
        error=1e-12,
        source="Radau IIA of order 5 in quadruple precision",
    ),
    limits=lambda case: {"mass": (10.0 * 2.0 ** (-24 if case.dtype == "float32" else -53)) * 1280},
)
def robertson(case):
    """Robertson's kinetics to t = 40 in 256 threads; scales from 1e-5 to 1, mass conserved."""
    kernel = make_robertson(case.real, case.method)
    steps = int(case.steps)
    begin = np.tile((1.0, 0.0, 0.0), (THREADS, 1))
    first = wp.array(begin, dtype=case.vec3, device=case.device)
    y = wp.clone(first)

    def run():
        wp.launch(kernel, THREADS, [y, *grid(steps, 40.0), steps], device=case.device)

    def quantities():
        species = y.numpy()[0].astype(np.float64)
        return {"species": species, "mass": report.Error(abs(float(species.sum() - 1.0)))}

    return report.Program(run, quantities, lambda: wp.copy(y, first), work=THREADS * steps)


@functools.cache
def make_van_der_pol(real):
    """Adaptive SDIRK2 by step doubling, with its extrapolation as the result."""
    vec2 = wp.types.vector(2, real)

    @wp.func
    def slope(y: vec2, mu: real):
        return vec2(y[1], mu * ((real(1.0) - y[0] * y[0]) * y[1] - y[0]))

    @wp.func
    def implicit(base: vec2, h: real, mu: real):
        y = base
        for _ in range(10):
            r = y - base - slope(y, mu) * h
            # (I - h J) by Cramer's rule, with J = ((0, 1), (c, d)).
            c = -mu * (real(2.0) * y[0] * y[1] + real(1.0)) * h
            d = real(1.0) - mu * (real(1.0) - y[0] * y[0]) * h
            bottom = d - h * c
            y -= vec2(d * r[0] + h * r[1], c * r[0] + r[1]) / bottom
        return y

    @wp.func
    def sdirk2(y: vec2, h: real, mu: real):
        g = real(1.0 - 0.7071067811865476)
        first = implicit(y, g * h, mu)
        ahead = y + (first - y) * ((real(1.0) - g) / g)
        return implicit(ahead, g * h, mu)

    @wp.kernel
    def oscillate(
        y: wp.array(dtype=vec2),
        end: real,
        mu: real,
        tolerance: real,
        most: int,
        taken: wp.array(dtype=int),
    ):
        i = wp.tid()
        s = y[i]
        t, h = real(0.0), real(1e-7)
        count = int(0)
        while t < end and count < most:
            h = wp.min(h, end - t)
            coarse = sdirk2(s, h, mu)
            fine = sdirk2(sdirk2(s, real(0.5) * h, mu), real(0.5) * h, mu)
            e0 = wp.abs(fine[0] - coarse[0]) / (real(1.0) + wp.abs(s[0]))
            e1 = wp.abs(fine[1] - coarse[1]) / (real(1.0) + wp.abs(s[1]))
            e = wp.max(e0, e1) / tolerance
            if e <= real(1.0):
                t += h
                s = fine + (fine - coarse) / real(3.0)
            factor = real(0.9) * wp.pow(wp.max(e, real(1e-6)), real(-1.0 / 3.0))
            h *= wp.clamp(factor, real(0.2), real(4.0))
            count += 1
        y[i] = s
        taken[i] = count

    return oscillate


@report.scene(
    sweep=report.Sweep("tolerance", 1e-3, 1e-8, 6, quick=4),
    reference=report.Tabulated(
        {"state": (-1.86364625480813, 0.753543086543543)},
        error=1e-12,
        source="Radau IIA of order 5 in quadruple precision",
    ),
    dtypes=("float64",),
    diverged=0.5,
    mu=1e6,
)
def van_der_pol(case):
    """Van der Pol's oscillator, mu = 1e6, to t = 1 in 64 threads with steps chosen by error."""
    kernel = make_van_der_pol(case.real)
    vec2 = wp.types.vector(2, case.real)
    first = wp.array(np.tile((2.0, 0.0), (64, 1)), dtype=vec2, device=case.device)
    y = wp.clone(first)
    taken = wp.zeros(64, dtype=int, device=case.device)

    def run():
        inputs = [y, 1.0, case.mu, case.tolerance, 200_000, taken]
        wp.launch(kernel, 64, inputs, device=case.device)

    def quantities():
        return {"state": y.numpy()[0]}

    return report.Program(run, quantities, lambda: wp.copy(y, first))
