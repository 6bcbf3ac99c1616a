"""Kernels of shapes.py on images and fields that are written in place, strided or sampled."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only


@differentiable
def resize_kernel(image: wp.array2d(dtype=wp.vec3), y: wp.array2d(dtype=wp.vec3)):
    i, j = wp.tid()
    u = (float(i) + 0.5) * float(image.shape[0]) / float(y.shape[0]) - 0.5
    v = (float(j) + 0.5) * float(image.shape[1]) / float(y.shape[1]) - 0.5
    a = wp.clamp(int(wp.floor(u)), 0, image.shape[0] - 2)
    b = wp.clamp(int(wp.floor(v)), 0, image.shape[1] - 2)
    s = wp.clamp(u - float(a), 0.0, 1.0)
    t = wp.clamp(v - float(b), 0.0, 1.0)
    top = image[a, b] * (1.0 - t) + image[a, b + 1] * t
    low = image[a + 1, b] * (1.0 - t) + image[a + 1, b + 1] * t
    y[i, j] = top * (1.0 - s) + low * s


@case
def resize(data):
    """A colour image made larger by bilinear samples."""
    n = data.size(192, 2048)
    image = data.real((n, n, 3), wp.vec3)
    m = n * 3 // 2
    return Case(resize_kernel, (m, m), [image], [data.out((m, m), wp.vec3)], m * m)


@forward_only
def yee_kernel(
    ex: wp.array2d(dtype=float), ey: wp.array2d(dtype=float), hz: wp.array2d(dtype=float), c: float
):
    i, j = wp.tid()
    if i > 0 and j > 0:
        ex[i, j] = ex[i, j] + c * (hz[i, j] - hz[i - 1, j])
        ey[i, j] = ey[i, j] - c * (hz[i, j] - hz[i, j - 1])


@case
def yee(data):
    """A half step of Yee's scheme: two fields in place from a third."""
    n = data.size(512, 4096)
    fields = [data.real((n, n), grad=False) for _ in range(3)]
    for field in fields[:2]:
        field.zero_()
    return Case(yee_kernel, (n, n), [*fields, 0.5], [], n * n)


@forward_only
def red_kernel(
    u: wp.array2d(dtype=float), f: wp.array2d(dtype=float), color: int, y: wp.array2d(dtype=float)
):
    i, half = wp.tid()
    j = 2 * half + (i + color) % 2
    if i > 0 and j > 0 and i < u.shape[0] - 1 and j < u.shape[1] - 1:
        total = u[i - 1, j] + u[i + 1, j] + u[i, j - 1] + u[i, j + 1]
        y[i, j] = 0.25 * (total - f[i, j])


@case
def red(data):
    """Every second node of a checkerboard, as in Gauss and Seidel's method."""
    n = data.size(512, 4096)
    arrays = [data.real((n, n), grad=False), data.real((n, n), grad=False), 1]
    return Case(red_kernel, (n, n // 2), arrays, [data.out((n, n), grad=False)], n * n // 2)


@forward_only
def julia_kernel(cx: float, cy: float, limit: int, y: wp.array2d(dtype=int)):
    i, j = wp.tid()
    x = 3.0 * float(j) / float(y.shape[1]) - 1.5
    z = 3.0 * float(i) / float(y.shape[0]) - 1.5
    k = int(0)
    while k < limit:
        if x * x + z * z > 4.0:
            break
        t = x * x - z * z + cx
        z = 2.0 * x * z + cy
        x = t
        k += 1
    y[i, j] = k


@case
def julia(data):
    """A Julia set: a while loop with a break, long in few places."""
    n = data.size(256, 4096)
    return Case(julia_kernel, (n, n), [-0.8, 0.156, 200], [data.out((n, n), int, False)], n * n)


@differentiable
def staggered_kernel(
    u: wp.array2d(dtype=float), v: wp.array2d(dtype=float), solid: wp.array2d(dtype=wp.uint8),
    y: wp.array2d(dtype=float),
):  # fmt: skip
    i, j = wp.tid()
    if solid[i, j] != wp.uint8(0):
        return
    y[i, j] = u[i, j + 1] - u[i, j] + v[i + 1, j] - v[i, j]


@case
def staggered(data):
    """The divergence on a staggered grid, where there is no wall."""
    n = data.size(512, 4096)
    arrays = [data.real((n, n + 1)), data.real((n + 1, n))]
    arrays.append(data.given((data.random.random((n, n)) < 0.1).astype(np.uint8), wp.uint8))
    return Case(staggered_kernel, (n, n), arrays, [data.out((n, n))], n * n)


@differentiable
def permuted_kernel(
    a: wp.array3d(dtype=float), b: wp.array3d(dtype=float), y: wp.array3d(dtype=float)
):
    i, j, k = wp.tid()
    y[i, j, k] = a[i, j, k] * b[i, j, k] + a[i, j, k]


@case
def permuted(data):
    """A view with its dimensions in another order, and every second element of another one."""
    n = data.size(64, 256)
    a = data.real((n, n, n)).transpose((1, 2, 0))
    b = data.real((n, n, 2 * n), grad=False)[:, :, ::2]
    a.requires_grad = False
    return Case(permuted_kernel, (n, n, n), [a, b], [data.out((n, n, n), grad=False)], n**3)


@forward_only
def indexed_kernel(x: wp.indexedarray(dtype=wp.vec3), y: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    v = x[i]
    y[i] = wp.vec3(v[1], v[2], v[0]) * 2.0


@case
def indexed(data):
    """An array behind a list of indices."""
    n = data.size(1 << 17, 1 << 22)
    base = data.real((2 * n, 3), wp.vec3, grad=False)
    order = data.given(data.random.permutation(2 * n)[:n].astype(np.int32), int)
    x = wp.indexedarray(base, [order])
    return Case(indexed_kernel, n, [x], [data.out(n, wp.vec3, False)], n)


@differentiable
def columns_kernel(
    a: wp.array2d(dtype=wp.float64), x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)
):
    j = wp.tid()
    total = wp.float64(0.0)
    for i in range(a.shape[0]):
        total += a[i, j] * x[i]
    y[j] = total


@case
def columns(data):
    """A transposed matrix times a vector in 64 bits: threads next to each other read a row."""
    n, m = data.size(2048, 1 << 16), 256
    arrays = [data.real((m, n), wp.float64), data.real(m, wp.float64)]
    return Case(columns_kernel, n, arrays, [data.out(n, wp.float64)], n * m, "product")


@differentiable
def running_kernel(x: wp.array2d(dtype=float), decay: float, y: wp.array2d(dtype=float)):
    j = wp.tid()
    total = float(0.0)
    for i in range(x.shape[0]):
        total = total * decay + x[i, j]
        y[i, j] = total


@case
def running(data):
    """A running mean down each column."""
    n, m = data.size(1024, 1 << 16), 256
    return Case(running_kernel, n, [data.real((m, n)), 0.9], [data.out((m, n))], n * m, "element")


@differentiable
def logsum_kernel(x: wp.array2d(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    n = x.shape[1]
    top = x[i, 0]
    for j in range(1, n):
        top = wp.max(top, x[i, j])
    total = float(0.0)
    for j in range(n):
        total += wp.exp(x[i, j] - top)
    y[i] = top + wp.log(total)


@case
def logsum(data):
    """The logarithm of a sum of exponentials, a row per thread."""
    n, m = data.size(2048, 1 << 16), 128
    return Case(logsum_kernel, n, [data.real((n, m), low=-4.0)], [data.out(n)], n * m, "element")


@forward_only
def dither_kernel(image: wp.array2d(dtype=float), y: wp.array2d(dtype=wp.uint8)):
    i = wp.tid()
    error = float(0.0)
    for j in range(image.shape[1]):
        v = image[i, j] + error
        bit = wp.uint8(0)
        if v > 0.5:
            bit = wp.uint8(255)
            error = v - 1.0
        else:
            error = v
        y[i, j] = bit


@case
def dither(data):
    """Rows of an image in black and white, errors diffused."""
    n = data.size(512, 4096)
    image = data.real((n, n), grad=False)
    return Case(dither_kernel, n, [image], [data.out((n, n), wp.uint8, False)], n * n, "pixel")
