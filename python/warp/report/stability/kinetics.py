"""Stiff kinetics of many species: D8."""

import functools

import numpy as np

import warp as wp
from warp.report.stability._case import case

#: At t = 321.8122; Radau IIA of order 5 in quadruple precision.
HIRES = (
    *(7.37131257333e-4, 1.44248572632e-4, 5.88872974097e-5, 1.17565134328e-3),
    *(2.38635619883e-3, 6.23896825274e-3, 2.84999839519e-3, 2.85000160481e-3),
)
END, START = 321.8122, (1.0, *[0.0] * 6, 0.0057)


@functools.cache
def make_hires(real):
    """SDIRK of order 2, L-stable, with Newton's method; elimination without pivots."""
    vec8, mat88 = wp.types.vector(8, real), wp.types.matrix((8, 8), real)
    gamma = 1.0 - 0.5**0.5

    @wp.func
    def rates(y: vec8):
        meet = real(280.0) * y[5] * y[7]
        f = vec8()
        f[0] = real(-1.71) * y[0] + real(0.43) * y[1] + real(8.32) * y[2] + real(0.0007)
        f[1] = real(1.71) * y[0] - real(8.75) * y[1]
        f[2] = real(-10.03) * y[2] + real(0.43) * y[3] + real(0.035) * y[4]
        f[3] = real(8.32) * y[1] + real(1.71) * y[2] - real(1.12) * y[3]
        f[4] = real(-1.745) * y[4] + real(0.43) * y[5] + real(0.43) * y[6]
        f[5] = real(0.69) * y[3] + real(1.71) * y[4] - real(0.43) * y[5] + real(0.69) * y[6] - meet
        f[6] = meet - real(1.81) * y[6]
        f[7] = real(1.81) * y[6] - meet
        return f

    @wp.func
    def system(linear: wp.array2d(dtype=real), y: vec8, h: real):
        """I - h df/dy."""
        m = mat88()
        for i in range(8):
            for j in range(8):
                m[i, j] = -h * linear[i, j]
            m[i, i] += real(1.0)
        for i in range(5, 8):
            sign = wp.where(i == 6, real(-280.0), real(280.0))
            m[i, 5] += h * sign * y[7]
            m[i, 7] += h * sign * y[5]
        return m

    @wp.func
    def solve(given: mat88, right: vec8):
        m, b = given, right
        for k in range(8):
            for i in range(k + 1, 8):
                factor = m[i, k] / m[k, k]
                for j in range(k, 8):
                    m[i, j] -= factor * m[k, j]
                b[i] -= factor * b[k]
        for back in range(8):
            i = 7 - back
            for j in range(i + 1, 8):
                b[i] -= m[i, j] * b[j]
            b[i] /= m[i, i]
        return b

    @wp.kernel(module_options={"max_unroll": 1})
    def kinetics(
        linear: wp.array2d(dtype=real),
        y: wp.array(dtype=vec8),
        first: real,
        ratio: real,
        steps: int,
    ):
        s, h = y[0], first
        for _ in range(steps):
            a = real(gamma) * h
            base, stage = s, s
            for number in range(2):
                for _iteration in range(4):
                    left = base + a * rates(stage) - stage
                    stage += solve(system(linear, stage, a), left)
                if number == 0:
                    base = s + (real(1.0 - gamma) / real(gamma)) * (stage - s)
            s = stage
            h *= ratio
        y[0] = s

    return kinetics


def linear_part():
    """df/dy without what the meeting of the sixth and eighth species gives."""
    rates = np.zeros((8, 8))
    rates[0, :3] = -1.71, 0.43, 8.32
    rates[1, :2] = 1.71, -8.75
    rates[2, 2:5] = -10.03, 0.43, 0.035
    rates[3, 1:4] = 8.32, 1.71, -1.12
    rates[4, 4:7] = -1.745, 0.43, 0.43
    rates[5, 3:7] = 0.69, 1.71, -0.43, 0.69
    rates[6, 6], rates[7, 6] = -1.81, 1.81
    return rates


@case("D8", "HIRES: eight species, t = 321.8122, order 2 as predicted")
def hires(p):
    errors = []
    for steps in (8000, 16000):
        ratio = 1e5 ** (1.0 / (steps - 1))
        first = END * (ratio - 1.0) / (ratio**steps - 1.0)
        y = p.array([START], p.vector(8))
        p.launch(make_hires(p.real), 1, p.array(linear_part()), y, first, ratio, steps)
        errors.append(np.abs(y.numpy()[0] / HIRES - 1.0).max())
    p.check("relative error of the worst species", errors[-1], 2e-5)
    p.check("order that two step sizes show", np.log2(errors[0] / errors[1]) - 2.0, 0.3)
