"""Kernels of shapes.py whose threads agree in part: tiles, channels, exits, maxima by zone."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only


@differentiable
def layers_kernel(
    depth: wp.array(dtype=float), density: wp.array(dtype=float), layers: int,
    out: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    left = float(1.0)
    total = float(0.0)
    for k in range(layers):
        share = density[k] * wp.exp(-depth[i] * float(k))
        if left * (1.0 - share) < 0.05:
            break
        total += share * left
        left = left * (1.0 - share)
    out[i] = total


@case
def layers(data):
    """Light through layers, until little of it is left."""
    n, count = data.size(1 << 13, 1 << 18), 64
    arrays = [data.real(n, high=0.05), data.real(count, high=0.1), count]
    return Case(layers_kernel, n, arrays, [data.out(n)], n, "ray", smooth=False)


@differentiable
def lists_kernel(
    x: wp.array(dtype=float), weight: wp.array(dtype=float), items: wp.array(dtype=int),
    count: int, out: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    left = float(1.0)
    total = float(0.0)
    first = (i // 16) * 8
    for k in range(first, first + count):
        share = weight[items[k]] * wp.exp(-x[i] * float(k - first))
        total += share * left
        left = left * (1.0 - share)
    out[i] = total


@case
def tile_lists(data):
    """Blends the items of a list for each 16 pixels."""
    n, count = data.size(1 << 13, 1 << 18), 64
    arrays = [
        data.real(n, high=0.05), data.real(800, high=0.1),
        data.integers((n // 16) * 8 + count, 0, 800), count,
    ]  # fmt: skip
    return Case(lists_kernel, n, arrays, [data.out(n)], n, "pixel")


@differentiable
def channels_kernel(u: wp.array4d(dtype=float), o: wp.array4d(dtype=float)):
    i, j, k = wp.tid()
    if i < 1 or j < 1 or k < 1:
        return
    if i >= u.shape[1] - 1 or j >= u.shape[2] - 1 or k >= u.shape[3] - 1:
        return
    o[0, i, j, k] = u[0, i + 1, j, k] - u[0, i - 1, j, k] + u[1, i, j + 1, k] - u[1, i, j - 1, k]
    o[1, i, j, k] = u[1, i, j, k + 1] - u[1, i, j, k - 1] + u[0, i, j + 1, k] - u[0, i, j - 1, k]


@case
def channels(data):
    """Differences of two components that are stored one after the other."""
    n = data.size(64, 256)
    arrays = [data.real((2, n, n, n))]
    return Case(channels_kernel, (n, n, n), arrays, [data.out((2, n, n, n))], n**3, "cell")


@forward_only
def zones_kernel(
    key: wp.array(dtype=wp.int64), value: wp.array(dtype=float), count: wp.array(dtype=int),
    total: wp.array(dtype=wp.float64), largest: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    b = int(key[i])
    wp.atomic_add(count, b, 1)
    wp.atomic_add(total, b, wp.float64(value[i]))
    wp.atomic_max(largest, b, value[i])


@case
def zones(data):
    """Counts, sums and largest values by zone."""
    n, bins = data.size(1 << 20, 1 << 22), 4096
    keys = np.minimum(data.random.zipf(1.3, n), 2**40) % bins
    arrays = [data.given(keys.astype(np.int64), wp.int64), data.real(n, grad=False)]
    outputs = [data.out(bins, kind, grad=False) for kind in (int, wp.float64, float)]
    return Case(zones_kernel, n, arrays, outputs, n)


@differentiable
def tree_kernel(
    x: wp.array2d(dtype=float), parent: wp.array(dtype=int), n: int, y: wp.array2d(dtype=float)
):
    w = wp.tid()
    for k in range(n):
        s = x[w, k]
        j = parent[k]
        while j >= 0:
            s = s - x[w, k] * x[w, j]
            j = parent[j]
        y[w, k] = s


@case
def row_tree(data):
    """Sums along the branches of one tree, in a row for each thread."""
    worlds, n = data.size(2048, 1 << 16), 27
    arrays = [data.real((worlds, n)), data.given(np.arange(n) // 2 - 1, int), n]
    return Case(tree_kernel, worlds, arrays, [data.out((worlds, n))], worlds * n, "row")
