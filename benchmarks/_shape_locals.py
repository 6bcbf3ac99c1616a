"""Kernels of shapes.py with arrays of a thread, indexed at run time."""

import warp as wp
from _shape_data import Case, case, differentiable, forward_only


@differentiable
def bins_kernel(
    index: wp.array2d(dtype=int), x: wp.array2d(dtype=float), m: int, y: wp.array(dtype=float)
):
    i = wp.tid()
    a = wp.zeros(shape=(64,), dtype=float)
    for k in range(m):
        j = index[i, k]
        a[j] = 0.5 * a[j] + x[i, k]
    s = float(0.0)
    for k in range(64):
        s += a[k] * float(k)
    y[i] = s


@case
def bins(data):
    """Averages in 64 bins of a thread."""
    n, m = data.size(1 << 11, 1 << 16), 64
    inputs = [data.integers((n, m), 0, 64), data.real((n, m)), m]
    return Case(bins_kernel, n, inputs, [data.out(n)], n * m, "number")


@differentiable
def tridiagonal_kernel(
    a: wp.array2d(dtype=float),
    b: wp.array2d(dtype=float),
    c: wp.array2d(dtype=float),
    d: wp.array2d(dtype=float),
    x: wp.array2d(dtype=float),
):
    i = wp.tid()
    p = wp.zeros(shape=(32,), dtype=float)
    q = wp.zeros(shape=(32,), dtype=float)
    p[0] = c[i, 0] / b[i, 0]
    q[0] = d[i, 0] / b[i, 0]
    for k in range(1, 32):
        m = b[i, k] - a[i, k] * p[k - 1]
        p[k] = c[i, k] / m
        q[k] = (d[i, k] - a[i, k] * q[k - 1]) / m
    last = q[31]
    x[i, 31] = last
    for k in range(30, -1, -1):
        last = q[k] - p[k] * last
        x[i, k] = last


@case
def tridiagonal(data):
    """Thomas' algorithm: a system of 32 equations per thread."""
    n = data.size(1 << 11, 1 << 16)
    shape = (n, 32)
    inputs = [data.real(shape), data.real(shape, low=4.0, high=6.0)]
    inputs += [data.real(shape), data.real(shape)]
    return Case(tridiagonal_kernel, n, inputs, [data.out(shape)], n * 32, "equation")


@forward_only
def distance_kernel(a: wp.array2d(dtype=int), b: wp.array2d(dtype=int), y: wp.array(dtype=int)):
    t = wp.tid()
    row = wp.zeros(shape=(25,), dtype=int)
    for j in range(25):
        row[j] = j
    for i in range(24):
        corner = row[0]
        row[0] = i + 1
        for j in range(24):
            change = int(1)
            if a[t, i] == b[t, j]:
                change = 0
            best = wp.min(wp.min(row[j], row[j + 1]) + 1, corner + change)
            corner = row[j + 1]
            row[j + 1] = best
    y[t] = row[24]


@case
def edit_distance(data):
    """The keys of words of 24 letters, with one row of the table."""
    n = data.size(1 << 10, 1 << 16)
    words = [data.integers((n, 24), 0, 4) for _ in range(2)]
    return Case(distance_kernel, n, words, [data.out(n, int, False)], n * 576, "cell")


@forward_only
def sort_kernel(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
    i = wp.tid()
    a = wp.zeros(shape=(16,), dtype=float)
    for j in range(16):
        a[j] = x[i, j]
    for j in range(1, 16):
        v = a[j]
        k = j - 1
        while k >= 0 and a[k] > v:
            a[k + 1] = a[k]
            k -= 1
        a[k + 1] = v
    for j in range(16):
        y[i, j] = a[j]


@case
def insertion_sort(data):
    """The sums of 16 numbers per thread."""
    n = data.size(1 << 12, 1 << 17)
    inputs = [data.real((n, 16), grad=False)]
    return Case(sort_kernel, n, inputs, [data.out((n, 16), float, False)], n * 16, "number")
