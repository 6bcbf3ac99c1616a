"""Kernels of shapes.py made of tiles, of sizes that no machine asks for."""

import warp as wp
from _shape_data import Case, case, differentiable, forward_only


@differentiable
def soft_kernel(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
    i = wp.tid()
    t = wp.tile_load(x[i], shape=200)
    top = wp.tile_max(t)
    e = wp.tile_map(wp.exp, t - wp.tile_broadcast(top, shape=(200,)))
    total = wp.tile_sum(e)
    wp.tile_store(y[i], e / wp.tile_broadcast(total, shape=(200,)))


@case
def soft_rows(data):
    """Softmax of rows of 200 numbers."""
    n = data.size(1024, 1 << 16)
    return Case(soft_kernel, n, [data.real((n, 200))], [data.out((n, 200))], n, "row", block=64)


@differentiable
def product_kernel(
    a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), c: wp.array2d(dtype=float)
):
    i, j = wp.tid()
    total = wp.tile_zeros(shape=(48, 80), dtype=float)
    for k in range(a.shape[1] // 24):
        x = wp.tile_load(a, shape=(48, 24), offset=(i * 48, k * 24))
        y = wp.tile_load(b, shape=(24, 80), offset=(k * 24, j * 80))
        wp.tile_matmul(x, y, total)
    wp.tile_store(c, total, offset=(i * 48, j * 80))


@case
def product_odd(data):
    """A product of matrices in tiles of 48 x 80."""
    n, m = data.size((144, 240), (1536, 1920))
    arrays = [data.real((n, n)), data.real((n, m))]
    return Case(
        product_kernel,
        (n // 48, m // 80),
        arrays,
        [data.out((n, m))],
        n * n * m,
        "product",
        block=128,
    )


@differentiable
def small_layers_kernel(
    x: wp.array2d(dtype=float), w: wp.array2d(dtype=float), v: wp.array2d(dtype=float),
    b: wp.array2d(dtype=float), out: wp.array2d(dtype=float),
):  # fmt: skip
    i = wp.tid()
    a = wp.tile_load(x, shape=(32, 12), offset=(i * 32, 0))
    first = wp.tile_load(w, shape=(12, 40))
    bias = wp.tile_broadcast(wp.tile_load(b, shape=(1, 40)), shape=(32, 40))
    h = wp.tile_map(wp.tanh, wp.tile_matmul(a, first) + bias)
    last = wp.tile_load(v, shape=(40, 4))
    wp.tile_store(out, wp.tile_matmul(h, last), offset=(i * 32, 0))


@case
def small_layers(data):
    """Two small layers of a network, 32 rows per block."""
    n = data.size(64, 1 << 13)
    arrays = [
        data.real((32 * n, 12), low=-1.0),
        data.real((12, 40), low=-0.5),
        data.real((40, 4), low=-0.5),
    ]
    out = data.out((32 * n, 4))
    return Case(
        small_layers_kernel, n, [*arrays, data.real((1, 40))], [out], 32 * n, "row", block=64
    )


@differentiable
def moments_kernel(x: wp.array2d(dtype=float), out: wp.array2d(dtype=float)):
    i = wp.tid()
    t = wp.tile_load(x[i], shape=96)
    mean = wp.tile_sum(t) / 96.0
    d = t - wp.tile_broadcast(mean, shape=(96,))
    wp.tile_store(out[i], wp.tile_sum(d * d) / 96.0, offset=(0,))
    wp.tile_store(out[i], wp.tile_sum(d * d * d) / 96.0, offset=(1,))


@case
def moments(data):
    """Second and third moments of rows."""
    n = data.size(1024, 1 << 16)
    return Case(moments_kernel, n, [data.real((n, 96))], [data.out((n, 2))], n, "row", block=32)


@forward_only
def order_kernel(
    keys: wp.array2d(dtype=float), out: wp.array2d(dtype=float), places: wp.array2d(dtype=int)
):
    i = wp.tid()
    k = wp.tile_load(keys[i], shape=100, storage="shared")
    v = wp.tile_arange(100, dtype=int, storage="shared")
    wp.tile_sort(k, v)
    wp.tile_store(out[i], k)
    wp.tile_store(places[i], v)


@case
def order(data):
    """Rows of 100 keys are sorted with their places."""
    n = data.size(256, 1 << 14)
    outs = [data.out((n, 100), grad=False), data.out((n, 100), int, False)]
    return Case(order_kernel, n, [data.real((n, 100), grad=False)], outs, n, "row", block=64)


@forward_only
def prefix_kernel(x: wp.array2d(dtype=int), out: wp.array2d(dtype=int)):
    i = wp.tid()
    t = wp.tile_load(x[i], shape=150)
    wp.tile_store(out[i], wp.tile_scan_exclusive(t))


@case
def prefix(data):
    """Sums of what comes before, in rows of 150."""
    n = data.size(1024, 1 << 16)
    arrays = [data.integers((n, 150), 0, 9)]
    return Case(prefix_kernel, n, arrays, [data.out((n, 150), int, False)], n, "row", block=64)


@differentiable
def halo_kernel(x: wp.array2d(dtype=float), w: wp.array(dtype=float), y: wp.array2d(dtype=float)):
    i, j = wp.tid()
    t = wp.tile_load(x, shape=(18, 34), offset=(i * 16, j * 32))
    middle = wp.tile_view(t, offset=(1, 1), shape=(16, 32))
    upper = wp.tile_view(t, offset=(0, 1), shape=(16, 32))
    lower = wp.tile_view(t, offset=(2, 1), shape=(16, 32))
    left = wp.tile_view(t, offset=(1, 0), shape=(16, 32))
    right = wp.tile_view(t, offset=(1, 2), shape=(16, 32))
    wp.tile_store(y, (upper + lower + left + right) * w[0] + middle * w[1], offset=(i * 16, j * 32))


@case
def halo(data):
    """A stencil over a tile with a rim of one."""
    n = data.size(256, 4096)
    arrays = [data.real((n + 2, n + 2)), data.real(2)]
    return Case(
        halo_kernel, (n // 16, n // 32), arrays, [data.out((n, n))], n * n, "cell", block=128
    )


@differentiable
def normal_kernel(
    a: wp.array3d(dtype=float), b: wp.array2d(dtype=float), out: wp.array2d(dtype=float)
):
    i = wp.tid()
    m = wp.tile_load(a[i], shape=(20, 12), storage="shared")
    rhs = wp.tile_load(b[i], shape=20, storage="shared")
    s = wp.tile_matmul(wp.tile_transpose(m), m)
    r = wp.tile_matmul(wp.tile_transpose(m), wp.tile_reshape(rhs, shape=(20, 1)))
    low = wp.tile_cholesky(wp.tile_diag_add(s, wp.tile_ones(shape=12, dtype=float)))
    x = wp.tile_cholesky_solve(low, wp.tile_reshape(r, shape=(12,)))
    wp.tile_store(out[i], x)


@case
def normal_equations(data):
    """Least squares of 12 unknowns by normal equations."""
    n = data.size(256, 1 << 14)
    arrays = [data.real((n, 20, 12), low=-1.0), data.real((n, 20))]
    return Case(normal_kernel, n, arrays, [data.out((n, 12))], n, "system", block=64)


@differentiable
def energy_kernel(
    x: wp.array(dtype=wp.vec3), y: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)
):
    k = wp.tid()
    d = x[k] - y[k]
    e = wp.log(1.0 + wp.dot(d, d))
    wp.tile_atomic_add(out, wp.tile_sum(wp.tile(e)), offset=(0,))


@case
def energy(data):
    """A loss over points: values of threads become a tile, and one number."""
    n = data.size(1 << 15, 1 << 21)
    arrays = [data.real((n, 3), wp.vec3), data.real((n, 3), wp.vec3)]
    return Case(energy_kernel, n, arrays, [data.out(1)], n, "point")


@forward_only
def gather_kernel(
    x: wp.array2d(dtype=float), rows: wp.array(dtype=int), out: wp.array(dtype=float)
):
    i = wp.tid()
    total = wp.tile_zeros(shape=64, dtype=float)
    for k in range(8):
        total += wp.tile_load(x[rows[i * 8 + k]], shape=64)
    wp.tile_store(out, total * 0.125, offset=(i * 64,))


@case
def bags(data):
    """Means of eight rows of a table."""
    n, m = data.size(512, 1 << 15), data.size(1024, 1 << 17)
    arrays = [data.real((m, 64), grad=False), data.integers(8 * n, 0, m)]
    return Case(gather_kernel, n, arrays, [data.out(64 * n, grad=False)], n, "bag", block=64)
