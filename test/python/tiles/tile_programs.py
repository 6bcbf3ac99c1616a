"""Kernels with tiles, and what NumPy says of them in float64.

Each is (kernel, shapes of the inputs, shape of the output, the same in NumPy). The kernel gets the
inputs as arrays of floats, and stores one tile.
"""

import numpy as np

import warp as wp

N, M = 12, 7


@wp.kernel
def copy(a: wp.array2d(dtype=float), out: wp.array2d(dtype=float)):
    t = wp.tile_load(a, shape=(12, 7))
    wp.tile_store(out, t)


@wp.kernel
def elementwise(
    a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), out: wp.array2d(dtype=float)
):
    s = wp.tile_load(a, shape=(12, 7))
    t = wp.tile_load(b, shape=(12, 7))
    wp.tile_store(out, wp.tile_map(wp.sin, s) * 2.0 + s * t - t / (wp.tile_map(wp.abs, s) + 1.5))


@wp.kernel
def transposed(a: wp.array2d(dtype=float), out: wp.array2d(dtype=float)):
    t = wp.tile_transpose(wp.tile_load(a, shape=(12, 7)))
    wp.tile_store(out, t * t)


@wp.kernel
def reshaped(a: wp.array2d(dtype=float), out: wp.array2d(dtype=float)):
    t = wp.tile_reshape(wp.tile_load(a, shape=(12, 7)), shape=(4, 21))
    wp.tile_store(out, t * 3.0)


@wp.kernel
def broadcast(a: wp.array(dtype=float), out: wp.array2d(dtype=float)):
    t = wp.tile_broadcast(wp.tile_load(a, shape=7), shape=(12, 7))
    wp.tile_store(out, t * t)


@wp.kernel
def sliced(a: wp.array2d(dtype=float), out: wp.array2d(dtype=float)):
    t = wp.tile_load(a, shape=(12, 7))
    wp.tile_store(out, t[2:10:3, 6:0:-2] * 2.0)


@wp.kernel
def assigned(a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), out: wp.array2d(dtype=float)):
    s = wp.tile_load(a, shape=(12, 7))
    t = wp.tile_load(b, shape=(3, 7))
    wp.tile_assign(s, t * 2.0, offset=(4, 0))
    s[0] = t[1]
    wp.tile_store(out, s * s)


@wp.kernel
def summed(a: wp.array2d(dtype=float), out: wp.array(dtype=float)):
    t = wp.tile_load(a, shape=(12, 7))
    wp.tile_store(out, wp.tile_sum(t * t))


@wp.kernel
def summed_along(a: wp.array2d(dtype=float), out: wp.array(dtype=float)):
    t = wp.tile_load(a, shape=(12, 7))
    wp.tile_store(out, wp.tile_sum(t * t, axis=0))


@wp.kernel
def smallest(a: wp.array2d(dtype=float), out: wp.array(dtype=float)):
    t = wp.tile_load(a, shape=(12, 7))
    wp.tile_store(out, wp.tile_min(t) * 3.0 + wp.tile_max(t))


@wp.kernel
def largest_along(a: wp.array2d(dtype=float), out: wp.array(dtype=float)):
    t = wp.tile_load(a, shape=(12, 7))
    wp.tile_store(out, wp.tile_max(t, axis=1))


@wp.kernel
def scanned(a: wp.array(dtype=float), out: wp.array(dtype=float)):
    t = wp.tile_load(a, shape=12)
    wp.tile_store(out, wp.tile_scan_inclusive(t) * wp.tile_scan_exclusive(t))


@wp.kernel
def sorted_pairs(a: wp.array(dtype=float), b: wp.array(dtype=float), out: wp.array(dtype=float)):
    keys = wp.tile_load(a, shape=12)
    values = wp.tile_load(b, shape=12)
    wp.tile_sort(keys, values)
    wp.tile_store(out, keys * values)


@wp.kernel
def product(a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), out: wp.array2d(dtype=float)):
    s = wp.tile_load(a, shape=(12, 7))
    t = wp.tile_load(b, shape=(7, 12))
    c = wp.tile_ones(shape=(12, 12), dtype=float)
    wp.tile_matmul(s, t, c, alpha=2.0, beta=0.5)
    wp.tile_store(out, c)


@wp.kernel
def product_of_transposed(a: wp.array2d(dtype=float), out: wp.array2d(dtype=float)):
    s = wp.tile_load(a, shape=(12, 7))
    wp.tile_store(out, wp.tile_matmul(wp.tile_transpose(s), s))


@wp.kernel
def accumulated(
    a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), out: wp.array2d(dtype=float)
):
    total = wp.tile_zeros(shape=(6, 7), dtype=float)
    for k in range(4):
        s = wp.tile_load(a, shape=(6, 3), offset=(0, 3 * k))
        t = wp.tile_load(b, shape=(3, 7), offset=(3 * k, 0))
        wp.tile_matmul(s, t, total)
    wp.tile_store(out, total)


@wp.kernel
def dotted(a: wp.array(dtype=float), b: wp.array(dtype=float), out: wp.array(dtype=float)):
    s = wp.tile_load(a, shape=12)
    t = wp.tile_load(b, shape=12)
    wp.tile_axpy(2.0, s, t)
    wp.tile_store(out, wp.tile_dot(s, t))


@wp.kernel
def elements(a: wp.array(dtype=float), out: wp.array(dtype=float)):
    t = wp.tile_load(a, shape=12)
    u = wp.tile_full(shape=12, value=t[3], dtype=float)
    wp.tile_store(out, u * t)


def product_reference(a, b):
    return 2.0 * a @ b + 0.5


def assigned_reference(a, b):
    s = a.copy()
    s[4:7] = 2.0 * b
    s[0] = b[1]
    return s * s


def sorted_reference(a, b):
    order = np.argsort(a, kind="stable")
    return a[order] * b[order]


def scanned_reference(a):
    total = np.cumsum(a)
    return total * (total - a)


def dotted_reference(a, b):
    return np.array([np.dot(a, b + 2.0 * a)])


CASES = {
    "copy": (copy, [(N, M)], (N, M), lambda a: a),
    "elementwise": (
        elementwise,
        [(N, M)] * 2,
        (N, M),
        lambda a, b: np.sin(a) * 2 + a * b - b / (np.abs(a) + 1.5),
    ),
    "transposed": (transposed, [(N, M)], (M, N), lambda a: (a * a).T),
    "reshaped": (reshaped, [(N, M)], (4, 21), lambda a: 3 * a.reshape(4, 21)),
    "broadcast": (broadcast, [(M,)], (N, M), lambda a: np.broadcast_to(a * a, (N, M))),
    "sliced": (sliced, [(N, M)], (3, 3), lambda a: 2 * a[2:10:3, 6:0:-2]),
    "assigned": (assigned, [(N, M), (3, M)], (N, M), assigned_reference),
    "summed": (summed, [(N, M)], (1,), lambda a: np.array([(a * a).sum()])),
    "summed_along": (summed_along, [(N, M)], (M,), lambda a: (a * a).sum(0)),
    "smallest": (smallest, [(N, M)], (1,), lambda a: np.array([3 * a.min() + a.max()])),
    "largest_along": (largest_along, [(N, M)], (N,), lambda a: a.max(1)),
    "scanned": (scanned, [(N,)], (N,), scanned_reference),
    "sorted_pairs": (sorted_pairs, [(N,)] * 2, (N,), sorted_reference),
    "product": (product, [(N, M), (M, N)], (N, N), product_reference),
    "product_of_transposed": (product_of_transposed, [(N, M)], (M, M), lambda a: a.T @ a),
    "accumulated": (accumulated, [(6, 12), (12, M)], (6, M), lambda a, b: a @ b),
    "dotted": (dotted, [(N,)] * 2, (1,), dotted_reference),
    "elements": (elements, [(N,)], (N,), lambda a: a[3] * a),
}
