"""Kernels of shapes.py over numbers of 8 bits: colours, quantised rows, texts, states."""

import numpy as np

import warp as wp
from _shape_data import Case, case, forward_only


@wp.func
def cubic_weight(d: float):
    w = float(0.0)
    if d < 1.0:
        w = 1.5 * d * d * d - 2.5 * d * d + 1.0
    elif d < 2.0:
        w = -0.5 * d * d * d + 2.5 * d * d - 4.0 * d + 2.0
    return w


@forward_only
def bicubic_kernel(
    image: wp.array2d(dtype=wp.vec3ub), scale: float, out: wp.array2d(dtype=wp.vec3ub)
):
    i, j = wp.tid()
    x = (float(j) + 0.5) * scale - 0.5
    y = (float(i) + 0.5) * scale - 0.5
    x0 = int(wp.floor(x))
    y0 = int(wp.floor(y))
    total = wp.vec3(0.0)
    weights = float(0.0)
    for a in range(-1, 3):
        for b in range(-1, 3):
            w = cubic_weight(wp.abs(y - float(y0 + a))) * cubic_weight(wp.abs(x - float(x0 + b)))
            row = wp.clamp(y0 + a, 0, image.shape[0] - 1)
            c = image[row, wp.clamp(x0 + b, 0, image.shape[1] - 1)]
            total += w * wp.vec3(float(c[0]), float(c[1]), float(c[2]))
            weights += w
    total = total / weights
    red = wp.uint8(wp.clamp(total[0], 0.0, 255.0))
    green = wp.uint8(wp.clamp(total[1], 0.0, 255.0))
    out[i, j] = wp.vec3ub(red, green, wp.uint8(wp.clamp(total[2], 0.0, 255.0)))


@case
def bicubic(data):
    """A picture of bytes made larger by a cubic filter."""
    n = data.size(128, 1024)
    m = n * 3 // 2
    image = data.integers((n, n, 3), 0, 256, wp.vec3ub)
    out = [data.out((m, m), wp.vec3ub, False)]
    return Case(bicubic_kernel, (m, m), [image, n / m], out, m * m, "pixel")


@forward_only
def quantised_kernel(
    a: wp.array2d(dtype=wp.int8), b: wp.array2d(dtype=wp.int8), sa: wp.array(dtype=float),
    sb: wp.array(dtype=float), y: wp.array2d(dtype=float),
):  # fmt: skip
    i, j = wp.tid()
    total = int(0)
    for k in range(a.shape[1]):
        total += int(a[i, k]) * int(b[j, k])
    y[i, j] = float(total) * sa[i] * sb[j]


@case
def quantised(data):
    """Products of rows of 8 bits, with a scale each."""
    n, k = data.size(128, 1024), 128
    rows = [data.integers((n, k), -127, 127, wp.int8) for _ in range(2)]
    scales = [data.real(n, grad=False) for _ in range(2)]
    out = [data.out((n, n), grad=False)]
    return Case(quantised_kernel, (n, n), [*rows, *scales], out, n * n * k, "term")


@forward_only
def checksum_kernel(
    text: wp.array2d(dtype=wp.uint8),
    table: wp.array(dtype=wp.uint32),
    out: wp.array(dtype=wp.uint32),
):
    i = wp.tid()
    c = wp.uint32(0xFFFFFFFF)
    for k in range(text.shape[1]):
        c = table[int((c ^ wp.uint32(text[i, k])) & wp.uint32(0xFF))] ^ (c >> wp.uint32(8))
    out[i] = c ^ wp.uint32(0xFFFFFFFF)


@case
def checksum(data):
    """CRC-32 of lines."""
    n, m = data.size(2048, 1 << 17), 64
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = (table >> 1) ^ np.where(table & 1, np.uint32(0xEDB88320), np.uint32(0))
    arrays = [data.integers((n, m), 0, 256, wp.uint8), data.given(table, wp.uint32)]
    return Case(checksum_kernel, n, arrays, [data.out(n, wp.uint32, False)], n * m, "byte")


@forward_only
def epidemic_kernel(
    state: wp.array(dtype=wp.int8), start: wp.array(dtype=int), near: wp.array(dtype=int),
    beta: float, gamma: float, seed: int, out: wp.array(dtype=wp.int8), totals: wp.array(dtype=int),
):  # fmt: skip
    i = wp.tid()
    r = wp.rand_init(seed, i)
    s = state[i]
    if s == wp.int8(0):
        sick = int(0)
        for k in range(start[i], start[i + 1]):
            if state[near[k]] == wp.int8(1):
                sick += 1
        if wp.randf(r) < 1.0 - wp.pow(1.0 - beta, float(sick)):
            s = wp.int8(1)
    elif s == wp.int8(1) and wp.randf(r) < gamma:
        s = wp.int8(2)
    out[i] = s
    wp.atomic_add(totals, int(s), 1)


@case
def epidemic(data):
    """Who falls ill along the edges of a graph."""
    n = data.size(1 << 14, 1 << 20)
    start = np.concatenate([[0], np.cumsum(data.random.poisson(8, n))]).astype(np.int32)
    arrays = [data.integers(n, 0, 3, wp.int8), data.given(start, int)]
    arrays += [data.integers(start[-1], 0, n), 0.1, 0.2, 5]
    out = [data.out(n, wp.int8, False), data.out(3, int, False)]
    return Case(epidemic_kernel, n, arrays, out, n)
