"""Kernels of shapes.py over signals and rows: transforms, filters, recurrences, views."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only

vec16 = wp.types.vector(16, float)
mat88 = wp.types.matrix((8, 8), float)


@forward_only
def fourier_kernel(x: wp.array2d(dtype=wp.vec2), y: wp.array2d(dtype=wp.vec2)):
    row, k = wp.tid()
    n = x.shape[1]
    total = wp.vec2()
    for j in range(n):
        angle = -2.0 * wp.pi * float((j * k) % n) / float(n)
        c = wp.cos(angle)
        s = wp.sin(angle)
        a = x[row, j]
        total += wp.vec2(a[0] * c - a[1] * s, a[0] * s + a[1] * c)
    y[row, k] = total


@case
def fourier(data):
    """Sums of Fourier, one per thread."""
    rows, n = data.size(8, 1 << 12), 128
    x = data.real((rows, n, 2), wp.vec2, grad=False)
    return Case(
        fourier_kernel, (rows, n), [x], [data.out((rows, n), wp.vec2, False)], rows * n * n, "term"
    )


@differentiable
def cosine_kernel(
    image: wp.array2d(dtype=float), basis: wp.array2d(dtype=float), out: wp.array2d(dtype=float)
):
    i, j = wp.tid()
    block = mat88()
    for a in range(8):
        for b in range(8):
            block[a, b] = image[i * 8 + a, j * 8 + b]
    t = mat88()
    for a in range(8):
        for b in range(8):
            t[a, b] = basis[a, b]
    r = t * block * wp.transpose(t)
    for a in range(8):
        for b in range(8):
            out[i * 8 + a, j * 8 + b] = r[a, b]


@case
def cosine(data):
    """Cosine transforms of blocks of 8 x 8."""
    n = data.size(32, 256)
    k = np.arange(8)
    basis = np.cos(np.pi * (2 * k[None] + 1) * k[:, None] / 16) / 2.0
    basis[0] /= np.sqrt(2.0)
    arrays = [data.real((8 * n, 8 * n)), data.given(basis.astype(np.float32), float, True)]
    return Case(cosine_kernel, (n, n), arrays, [data.out((8 * n, 8 * n))], n * n, "block")


@differentiable
def filter_kernel(x: wp.array2d(dtype=float), b: wp.vec3, a: wp.vec2, y: wp.array2d(dtype=float)):
    i = wp.tid()
    x1 = float(0.0)
    x2 = float(0.0)
    y1 = float(0.0)
    y2 = float(0.0)
    for t in range(x.shape[1]):
        v = x[i, t]
        w = b[0] * v + b[1] * x1 + b[2] * x2 - a[0] * y1 - a[1] * y2
        x2 = x1
        x1 = v
        y2 = y1
        y1 = w
        y[i, t] = w


@case
def filters(data):
    """Filters of second order along rows."""
    n, m = data.size(1024, 1 << 16), 128
    arrays = [data.real((n, m)), wp.vec3(0.2, 0.4, 0.2), wp.vec2(-0.5, 0.3)]
    return Case(filter_kernel, n, arrays, [data.out((n, m))], n * m, "sample")


@differentiable
def gru_kernel(
    x: wp.array2d(dtype=float), u: wp.array2d(dtype=float), w: wp.array2d(dtype=float),
    out: wp.array2d(dtype=float),
):  # fmt: skip
    i = wp.tid()
    h = vec16()
    for t in range(x.shape[1]):
        new = vec16()
        for r in range(16):
            s = u[0, r] * x[i, t]
            for c in range(16):
                s += w[r, c] * h[c]
            new[r] = wp.tanh(s)
        h = new
    for r in range(16):
        out[i, r] = h[r]


@case
def recurrent(data):
    """A recurrent network of 16 units per thread."""
    n, m = data.size(512, 1 << 15), 8
    arrays = [
        data.real((n, m)),
        data.real((1, 16), low=-1.0),
        data.real((16, 16), low=-0.3, high=0.3),
    ]
    return Case(gru_kernel, n, arrays, [data.out((n, 16))], n * m, "step")


@differentiable
def layer_kernel(
    x: wp.array2d(dtype=wp.float16),
    gain: wp.array(dtype=wp.float16),
    out: wp.array2d(dtype=wp.float16),
):
    i = wp.tid()
    n = x.shape[1]
    total = float(0.0)
    square = float(0.0)
    for k in range(n):
        v = float(x[i, k])
        total += v
        square += v * v
    mean = total / float(n)
    scale = 1.0 / wp.sqrt(square / float(n) - mean * mean + 1.0e-5)
    for k in range(n):
        out[i, k] = wp.float16((float(x[i, k]) - mean) * scale) * gain[k]


@case
def layer(data):
    """Rows in 16 bits with mean 0 and deviation 1."""
    n, m = data.size(1024, 1 << 15), 64
    x, g = (data.random.uniform(-1.0, 1.0, s).astype(np.float16) for s in ((n, m), m))
    arrays = [data.given(x, wp.float16, True), data.given(g, wp.float16, True)]
    return Case(
        layer_kernel, n, arrays, [data.out((n, m), wp.float16)], n * m, "number", smooth=False
    )


@differentiable
def nd_kernel(x: wp.array4d(dtype=float), w: wp.array(dtype=float), out: wp.array4d(dtype=float)):
    b, i, j, c = wp.tid()
    n = x.shape[1]
    m = x.shape[2]
    s = float(0.0)
    for a in range(3):
        for d in range(3):
            y = i + a - 1
            z = j + d - 1
            if y >= 0 and y < n and z >= 0 and z < m:
                s += w[a * 3 + d] * x[b, y, z, c]
    out[b, i, j, c] = wp.max(s, 0.1 * s)


@case
def depthwise(data):
    """A filter of 3 x 3 in each channel: a launch of four dimensions."""
    shape = data.size((2, 32, 32, 16), (8, 256, 256, 32))
    arrays = [data.real(shape, low=-1.0), data.real(9, low=-1.0)]
    return Case(
        nd_kernel, shape, arrays, [data.out(shape)], int(np.prod(shape)), "number", smooth=False
    )


@differentiable
def planes_kernel(x: wp.array3d(dtype=float), out: wp.array3d(dtype=float)):
    i, j, k = wp.tid()
    i += 1
    j += 1
    k += 1
    near = x[i - 1, j, k] + x[i + 1, j, k] + x[i, j - 1, k] + x[i, j + 1, k] + x[i, j, k - 1]
    out[i, j, k] = x[i, j, k] + 0.1 * (near + x[i, j, k + 1] - 6.0 * x[i, j, k])


@case
def planes(data):
    """Heat in a box whose first index is the fastest, without its border."""
    n = data.size(48, 320)
    x = data.real((n, n, n)).transpose([2, 1, 0])
    x.requires_grad = True
    out = data.out((n, n, n)).transpose([2, 1, 0])
    out.requires_grad = True
    return Case(planes_kernel, (n - 2, n - 2, n - 2), [x], [out], n**3, "cell")


@differentiable
def strided_kernel(
    x: wp.array2d(dtype=float), y: wp.array2d(dtype=float), out: wp.array2d(dtype=float)
):
    i, j = wp.tid()
    out[i, j] = wp.sqrt(x[i, j] * x[i, j] + y[i, j] * y[i, j])


@case
def strided(data):
    """Every second column of one array and every third row of another."""
    n = data.size(512, 4096)
    wide, tall = data.real((n, 2 * n), low=0.1), data.real((3 * n, n), low=0.1)
    arrays = [wide[:, ::2], tall[::3]]
    return Case(strided_kernel, (n, n), arrays, [data.out((n, n))], n * n, "number")


@forward_only
def some_kernel(
    x: wp.indexedarray2d(dtype=wp.vec3), w: wp.array(dtype=float), out: wp.array2d(dtype=wp.vec3)
):
    i, j = wp.tid()
    out[i, j] = x[i, j] * w[i] + x[i, wp.max(j - 1, 0)] * (1.0 - w[i])


@case
def some_rows(data):
    """Some rows and columns of an array, by lists of both."""
    n = data.size(256, 2048)
    x = data.real((2 * n, 2 * n, 3), wp.vec3, grad=False)
    lists = [data.integers(n, 0, 2 * n) for _ in range(2)]
    arrays = [wp.indexedarray2d(x, lists), data.real(n, grad=False)]
    return Case(some_kernel, (n, n), arrays, [data.out((n, n), wp.vec3, False)], n * n, "element")


@differentiable
def stiff_kernel(
    y0: wp.array(dtype=wp.vec3d), h: wp.float64, steps: int, out: wp.array(dtype=wp.vec3d)
):
    i = wp.tid()
    y = y0[i]
    one = wp.identity(n=3, dtype=wp.float64)
    for _s in range(steps):
        a = wp.float64(0.04)
        b = wp.float64(10.0)
        c = wp.float64(30.0)
        f = wp.vec3d(
            -a * y[0] + b * y[1] * y[2],
            a * y[0] - b * y[1] * y[2] - c * y[1] * y[1],
            c * y[1] * y[1],
        )
        jac = wp.mat33d(
            -a, b * y[2], b * y[1],
            a, -b * y[2] - wp.float64(2.0) * c * y[1], -b * y[1],
            wp.float64(0.0), wp.float64(2.0) * c * y[1], wp.float64(0.0),
        )  # fmt: skip
        y = y + wp.inverse(one - jac * h) * f * h
    out[i] = y


@case
def stiff(data):
    """Stiff reactions by linearly implicit steps, with 64 bits."""
    n = data.size(2048, 1 << 17)
    arrays = [data.real((n, 3), wp.vec3d), 0.01, 16]
    return Case(stiff_kernel, n, arrays, [data.out(n, wp.vec3d)], n * 16, "step")


vec32 = wp.types.vector(32, float)


@differentiable
def window_kernel(x: wp.array(dtype=float), gain: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    a = gain[i]
    taps = vec32()
    for j in range(32):
        taps[j] = a * 0.1 + x[(i + j) % x.shape[0]]
    for j in range(1, 32):
        a = a + taps[j] * taps[j - 1] * 0.05
    y[i] = a


@case
def windows(data):
    """Products of neighbours in a window, whose gradients overlap from thread to thread."""
    n = data.size(1 << 16, 1 << 22)
    return Case(window_kernel, n, [data.real(n), data.real(n)], [data.out(n)], 32 * n, "tap")
