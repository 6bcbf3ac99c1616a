"""Kernels of shapes.py with formulas of numbers: polynomials, halves, integers, bits."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only


@differentiable
def half3_kernel(
    x: wp.array(dtype=wp.vec3h), v: wp.array(dtype=wp.vec3h), y: wp.array(dtype=wp.vec3h)
):
    i = wp.tid()
    d = x[i] * wp.float16(0.5) + v[i]
    y[i] = wp.cross(d, v[i]) + d * wp.dot(x[i], v[i])


@case
def half3(data):
    """Vectors of 16 bits."""
    n = data.size(1 << 16, 1 << 22)
    x, v = (data.given(data.random.random((n, 3)).astype(np.float16), wp.vec3h, True) for _ in "xv")
    return Case(half3_kernel, n, [x, v], [data.out(n, wp.vec3h)], n)


@differentiable
def horner_kernel(c: wp.array(dtype=float), x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    v = x[i]
    p = float(0.0)
    for k in range(c.shape[0]):
        p = p * v + c[k]
    y[i] = p


@case
def horner(data):
    """A polynomial whose coefficients are in an array."""
    n = data.size(1 << 16, 1 << 22)
    return Case(horner_kernel, n, [data.real(24), data.real(n)], [data.out(n)], 24 * n, "step")


@forward_only
def largest_kernel(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
    i = wp.tid()
    best = wp.vec4(-1.0e9)
    for j in range(x.shape[1]):
        v = x[i, j]
        for k in range(4):
            if v > best[k]:
                t = best[k]
                best[k] = v
                v = t
    for k in range(4):
        y[i, k] = best[k]


@case
def largest(data):
    """The four largest numbers of each row."""
    n, m = data.size(1 << 12, 1 << 18), 64
    return Case(
        largest_kernel, n, [data.real((n, m), grad=False)], [data.out((n, 4), grad=False)], n * m
    )


@forward_only
def bits_kernel(a: wp.array(dtype=wp.uint64), y: wp.array(dtype=int)):
    i = wp.tid()
    x = a[i]
    for _ in range(8):
        x = x ^ (x << wp.uint64(13))
        x = x ^ (x >> wp.uint64(7))
        x = x ^ (x << wp.uint64(17))
    x = x * wp.uint64(0x9E3779B97F4A7C15)
    count = int(0)
    while x != wp.uint64(0):
        x = x & (x - wp.uint64(1))
        count += 1
    y[i] = count


@case
def bits(data):
    """Words of 64 bits shuffled, then their bits counted."""
    n = data.size(1 << 15, 1 << 21)
    values = data.random.integers(1, 1 << 62, n).astype(np.uint64)
    return Case(bits_kernel, n, [data.given(values, wp.uint64)], [data.out(n, int, False)], n)


@forward_only
def digits_kernel(a: wp.array(dtype=wp.int64), base: wp.int64, y: wp.array(dtype=int)):
    i = wp.tid()
    v = a[i]
    total = int(0)
    while v > wp.int64(0):
        total += int(v % base)
        v = v / base
    y[i] = total


@case
def digits(data):
    """Sums of digits: divisions of 64-bit integers by an argument."""
    n = data.size(1 << 14, 1 << 20)
    values = data.random.integers(1, 1 << 40, n).astype(np.int64)
    return Case(digits_kernel, n, [data.given(values, wp.int64), 10], [data.out(n, int, False)], n)


@wp.func
def normal_share(x: float):
    return 0.5 * (1.0 + wp.erf(x * 0.70710678))


@differentiable
def scholes_kernel(
    s: wp.array(dtype=float), k: wp.array(dtype=float), t: wp.array(dtype=float), r: float,
    vol: float, y: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    root = vol * wp.sqrt(t[i])
    d = (wp.log(s[i] / k[i]) + (r + 0.5 * vol * vol) * t[i]) / root
    y[i] = s[i] * normal_share(d) - k[i] * wp.exp(-r * t[i]) * normal_share(d - root)


@case
def scholes(data):
    """Black and Scholes's prices."""
    n = data.size(1 << 16, 1 << 22)
    arrays = [data.real(n, low=0.5), data.real(n, low=0.5), data.real(n, low=0.1), 0.02, 0.3]
    return Case(scholes_kernel, n, arrays, [data.out(n)], n)


@differentiable
def cubic_kernel(c: wp.array(dtype=wp.vec3), y: wp.array(dtype=float)):
    i = wp.tid()
    a = c[i][0]
    b = c[i][1]
    d = c[i][2]
    p = b - a * a / 3.0
    q = 2.0 * a * a * a / 27.0 - a * b / 3.0 + d
    disc = 0.25 * q * q + p * p * p / 27.0
    root = float(0.0)
    if disc > 0.0:
        s = wp.sqrt(disc)
        root = wp.cbrt(-0.5 * q + s) + wp.cbrt(-0.5 * q - s)
    else:
        m = 2.0 * wp.sqrt(-p / 3.0)
        root = m * wp.cos(wp.acos(wp.clamp(3.0 * q / (p * m), -1.0, 1.0)) / 3.0)
    y[i] = root - a / 3.0


@case
def cubic(data):
    """A root of a cubic, with two branches."""
    n = data.size(1 << 16, 1 << 22)
    return Case(cubic_kernel, n, [data.real((n, 3), wp.vec3, -1.0)], [data.out(n)], n, smooth=False)


@differentiable
def ell_kernel(
    value: wp.array2d(dtype=float),
    column: wp.array2d(dtype=int),
    x: wp.array(dtype=float),
    y: wp.array(dtype=float),
):
    i = wp.tid()
    total = float(0.0)
    for k in range(value.shape[0]):
        c = column[k, i]
        if c >= 0:
            total += value[k, i] * x[c]
    y[i] = total


@case
def ell(data):
    """A sparse matrix in ELLPACK's layout, some entries missing."""
    n, m = data.size(1 << 14, 1 << 20), 12
    column = data.random.integers(0, n, (m, n))
    column[data.random.random((m, n)) < 0.2] = -1
    arrays = [data.real((m, n)), data.given(column.astype(np.int32), int), data.real(n)]
    return Case(ell_kernel, n, arrays, [data.out(n)], n * m, "entry")


@forward_only
def congruence_kernel(
    seeds: wp.array(dtype=wp.uint64), steps: int, out: wp.array(dtype=wp.float64)
):
    i = wp.tid()
    s = seeds[i]
    total = wp.float64(0.0)
    for _k in range(steps):
        s = s * wp.uint64(6364136223846793005) + wp.uint64(1442695040888963407)
        x = (s >> wp.uint64(18)) ^ s
        total += wp.float64(x >> wp.uint64(11)) * wp.float64(1.1102230246251565e-16)
    out[i] = total / wp.float64(steps)


@case
def congruence(data):
    """Random numbers of 64 bits by a linear recurrence."""
    n = data.size(1 << 14, 1 << 20)
    seeds = data.given(data.random.integers(1, 1 << 62, n).astype(np.uint64), wp.uint64)
    return Case(
        congruence_kernel, n, [seeds, 32], [data.out(n, wp.float64, False)], n * 32, "number"
    )


@forward_only
def modular_kernel(
    base: wp.array(dtype=wp.int64), power: int, modulus: wp.int64, out: wp.array(dtype=wp.int64)
):
    i = wp.tid()
    b = base[i] % modulus
    r = wp.int64(1)
    e = power
    while e > 0:
        if e % 2 == 1:
            r = (r * b) % modulus
        b = (b * b) % modulus
        e = e // 2
    out[i] = r


@case
def modular(data):
    """Powers of whole numbers by a modulus, with 64 bits."""
    n = data.size(1 << 14, 1 << 21)
    base = data.integers(n, 0, 1 << 30, wp.int64)
    return Case(
        modular_kernel, n, [base, 65537, 1000000007], [data.out(n, wp.int64, False)], n, "power"
    )
