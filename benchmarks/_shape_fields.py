"""Kernels of shapes.py on grids: stencils, lattices, images, samples between nodes."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only

vec9i = wp.types.vector(9, int)
vec9 = wp.types.vector(9, float)


@differentiable
def heat_kernel(u: wp.array3d(dtype=float), a: float, y: wp.array3d(dtype=float)):
    i, j, k = wp.tid()
    nx = u.shape[0]
    ny = u.shape[1]
    nz = u.shape[2]
    c = u[i, j, k]
    total = 0.0
    if i > 0:
        total += u[i - 1, j, k] - c
    if i < nx - 1:
        total += u[i + 1, j, k] - c
    if j > 0:
        total += u[i, j - 1, k] - c
    if j < ny - 1:
        total += u[i, j + 1, k] - c
    if k > 0:
        total += u[i, j, k - 1] - c
    if k < nz - 1:
        total += u[i, j, k + 1] - c
    y[i, j, k] = c + a * total


@case
def heat(data):
    """A step of the heat equation in 3-D, nothing flows through the walls."""
    n = data.size(64, 256)
    return Case(heat_kernel, (n, n, n), [data.real((n, n, n)), 0.1], [data.out((n, n, n))], n**3)


@wp.func
def bilinear(f: wp.array2d(dtype=float), x: float, y: float):
    h = f.shape[0]
    w = f.shape[1]
    x = wp.clamp(x, 0.0, float(w) - 1.001)
    y = wp.clamp(y, 0.0, float(h) - 1.001)
    j = int(wp.floor(x))
    i = int(wp.floor(y))
    s = x - float(j)
    t = y - float(i)
    low = wp.lerp(f[i, j], f[i, j + 1], s)
    high = wp.lerp(f[i + 1, j], f[i + 1, j + 1], s)
    return wp.lerp(low, high, t)


@differentiable
def advect_kernel(
    f: wp.array2d(dtype=float), v: wp.array2d(dtype=wp.vec2), dt: float, y: wp.array2d(dtype=float)
):
    i, j = wp.tid()
    u = v[i, j]
    y[i, j] = bilinear(f, float(j) - dt * u[0], float(i) - dt * u[1])


@case
def advect(data):
    """Semi-Lagrangian advection: bilinear samples where the flow came from."""
    n = data.size(384, 4096)
    v = data.real((n, n, 2), wp.vec2, -1.0)
    return Case(advect_kernel, (n, n), [data.real((n, n)), v, 3.0], [data.out((n, n))], n * n)


@differentiable
def trilinear_kernel(
    f: wp.array3d(dtype=float), p: wp.array(dtype=wp.vec3), y: wp.array(dtype=float)
):
    t = wp.tid()
    x = p[t]
    i = int(wp.floor(x[0]))
    j = int(wp.floor(x[1]))
    k = int(wp.floor(x[2]))
    d = x - wp.vec3(float(i), float(j), float(k))
    total = float(0.0)
    for a in range(2):
        for b in range(2):
            for c in range(2):
                wx = 1.0 - d[0]
                wy = 1.0 - d[1]
                wz = 1.0 - d[2]
                if a == 1:
                    wx = d[0]
                if b == 1:
                    wy = d[1]
                if c == 1:
                    wz = d[2]
                total += wx * wy * wz * f[i + a, j + b, k + c]
    y[t] = total


@case
def trilinear(data):
    """Samples of a field in 3-D at scattered points."""
    n, cells = data.size(1 << 17, 1 << 22), data.size(48, 256)
    p = data.real((n, 3), wp.vec3, 0.0, cells - 1.01)
    return Case(trilinear_kernel, n, [data.real((cells,) * 3), p], [data.out(n)], n, smooth=False)


D2Q9_X = wp.constant(vec9i(0, 1, 0, -1, 0, 1, -1, -1, 1))
D2Q9_Y = wp.constant(vec9i(0, 0, 1, 0, -1, 1, 1, -1, -1))
D2Q9_W = wp.constant(
    vec9(4.0 / 9.0, *[1.0 / 9.0 for _ in range(4)], *[1.0 / 36.0 for _ in range(4)])
)


@differentiable
def lattice_kernel(f: wp.array3d(dtype=float), omega: float, g: wp.array3d(dtype=float)):
    i, j = wp.tid()
    h = f.shape[1]
    w = f.shape[2]
    rho = float(0.0)
    ux = float(0.0)
    uy = float(0.0)
    here = vec9()
    for q in range(9):
        jj = (j - D2Q9_X[q] + w) % w
        ii = (i - D2Q9_Y[q] + h) % h
        v = f[q, ii, jj]
        here[q] = v
        rho += v
        ux += v * float(D2Q9_X[q])
        uy += v * float(D2Q9_Y[q])
    ux = ux / rho
    uy = uy / rho
    square = 1.5 * (ux * ux + uy * uy)
    for q in range(9):
        c = 3.0 * (ux * float(D2Q9_X[q]) + uy * float(D2Q9_Y[q]))
        equal = D2Q9_W[q] * rho * (1.0 + c + 0.5 * c * c - square)
        g[q, i, j] = here[q] + omega * (equal - here[q])


@case
def lattice(data):
    """Lattice Boltzmann D2Q9 with pull streaming, periodic by remainders."""
    n = data.size(256, 2048)
    f = data.real((9, n, n), low=0.5)
    return Case(lattice_kernel, (n, n), [f, 1.2], [data.out((9, n, n))], n * n)


@forward_only
def lattice3_kernel(
    f: wp.array2d(dtype=float), c: wp.array(dtype=wp.vec3i), weight: wp.array(dtype=float),
    n: int, omega: float, g: wp.array2d(dtype=float),
):  # fmt: skip
    t = wp.tid()
    x = t % n
    y = (t // n) % n
    z = t // (n * n)
    rho = float(0.0)
    u = wp.vec3()
    for q in range(19):
        d = c[q]
        xs = (x - d[0] + n) % n
        ys = (y - d[1] + n) % n
        zs = (z - d[2] + n) % n
        v = f[q, xs + n * (ys + n * zs)]
        rho += v
        u += v * wp.vec3(float(d[0]), float(d[1]), float(d[2]))
    u = u / rho
    for q in range(19):
        d = c[q]
        xs = (x - d[0] + n) % n
        ys = (y - d[1] + n) % n
        zs = (z - d[2] + n) % n
        e = 3.0 * wp.dot(u, wp.vec3(float(d[0]), float(d[1]), float(d[2])))
        equal = weight[q] * rho * (1.0 + e + 0.5 * e * e - 1.5 * wp.dot(u, u))
        g[q, t] = (1.0 - omega) * f[q, xs + n * (ys + n * zs)] + omega * equal


@case
def lattice3(data):
    """Lattice Boltzmann D3Q19: directions and weights in arrays, a flat index."""
    n = data.size(40, 192)
    steps = np.array(np.meshgrid(*[[-1, 0, 1]] * 3)).T.reshape(-1, 3)
    steps = steps[(steps**2).sum(1) < 3].astype(np.int32)
    share = np.array([1 / 3, 1 / 18, 1 / 36], np.float32)[(steps**2).sum(1)]
    arrays = [data.real((19, n**3), low=0.5, grad=False), data.given(steps, wp.vec3i)]
    arrays += [data.given(share, float), n, 1.2]
    return Case(lattice3_kernel, n**3, arrays, [data.out((19, n**3), grad=False)], n**3)


@differentiable
def wave_kernel(
    u: wp.array(dtype=wp.float64), old: wp.array(dtype=wp.float64), c: wp.float64,
    y: wp.array(dtype=wp.float64),
):  # fmt: skip
    i = wp.tid()
    n = u.shape[0]
    left = wp.float64(0.0)
    right = wp.float64(0.0)
    if i > 0:
        left = u[i - 1]
    if i + 1 < n:
        right = u[i + 1]
    y[i] = wp.float64(2.0) * u[i] - old[i] + c * (left - wp.float64(2.0) * u[i] + right)


@case
def wave(data):
    """The wave equation in 1-D and 64 bits."""
    n = data.size(1 << 18, 1 << 24)
    arrays = [data.real(n, wp.float64), data.real(n, wp.float64), 0.25]
    return Case(wave_kernel, n, arrays, [data.out(n, wp.float64)], n)


@differentiable
def reaction_kernel(
    u: wp.array2d(dtype=float), v: wp.array2d(dtype=float), feed: float, kill: float,
    a: wp.array2d(dtype=float), b: wp.array2d(dtype=float),
):  # fmt: skip
    i, j = wp.tid()
    h = u.shape[0]
    w = u.shape[1]
    up = (i + h - 1) % h
    down = (i + 1) % h
    left = (j + w - 1) % w
    right = (j + 1) % w
    x = u[i, j]
    y = v[i, j]
    du = u[up, j] + u[down, j] + u[i, left] + u[i, right] - 4.0 * x
    dv = v[up, j] + v[down, j] + v[i, left] + v[i, right] - 4.0 * y
    r = x * y * y
    a[i, j] = x + 0.16 * du - r + feed * (1.0 - x)
    b[i, j] = y + 0.08 * dv + r - (feed + kill) * y


@case
def reaction(data):
    """Gray and Scott's reaction and diffusion on a torus."""
    n = data.size(384, 4096)
    arrays = [data.real((n, n)), data.real((n, n)), 0.04, 0.06]
    return Case(reaction_kernel, (n, n), arrays, [data.out((n, n)), data.out((n, n))], n * n)


@forward_only
def sobel_kernel(image: wp.array2d(dtype=wp.uint8), y: wp.array2d(dtype=wp.uint8)):
    i, j = wp.tid()
    h = image.shape[0]
    w = image.shape[1]
    if i == 0 or j == 0 or i == h - 1 or j == w - 1:
        y[i, j] = wp.uint8(0)
        return
    gx = int(0)
    gy = int(0)
    for a in range(-1, 2):
        gx += (2 - wp.abs(a)) * (int(image[i + a, j + 1]) - int(image[i + a, j - 1]))
        gy += (2 - wp.abs(a)) * (int(image[i + 1, j + a]) - int(image[i - 1, j + a]))
    y[i, j] = wp.uint8(wp.min(wp.abs(gx) + wp.abs(gy), 255))


@case
def sobel(data):
    """Edges of an image of bytes, with an early return at the border."""
    n = data.size(512, 4096)
    image = data.integers((n, n), 0, 256, wp.uint8)
    return Case(sobel_kernel, (n, n), [image], [data.out((n, n), wp.uint8, False)], n * n)


@differentiable
def bilateral_kernel(
    image: wp.array2d(dtype=float), radius: int, s: float, y: wp.array2d(dtype=float)
):
    i, j = wp.tid()
    h = image.shape[0]
    w = image.shape[1]
    c = image[i, j]
    total = float(0.0)
    weights = float(0.0)
    for a in range(-radius, radius + 1):
        for b in range(-radius, radius + 1):
            ii = wp.clamp(i + a, 0, h - 1)
            jj = wp.clamp(j + b, 0, w - 1)
            v = image[ii, jj]
            k = wp.exp(-0.1 * float(a * a + b * b) - s * (v - c) * (v - c))
            total += k * v
            weights += k
    y[i, j] = total / weights


@case
def bilateral(data):
    """A bilateral filter of 5 x 5 pixels, its radius an argument."""
    n = data.size(128, 2048)
    return Case(bilateral_kernel, (n, n), [data.real((n, n)), 2, 4.0], [data.out((n, n))], n * n)
