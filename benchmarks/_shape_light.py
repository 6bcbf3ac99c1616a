"""Kernels of shapes.py that draw: paths of light, noise, splats, tones, waves on a sphere."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only

vec9 = wp.types.vector(9, float)
mat23 = wp.types.matrix((2, 3), float)


@wp.func
def sphere_hit(o: wp.vec3, d: wp.vec3, c: wp.vec3, r: float):
    p = o - c
    b = wp.dot(p, d)
    h = b * b - wp.dot(p, p) + r * r
    if h < 0.0:
        return -1.0
    h = wp.sqrt(h)
    if -b - h > 1.0e-3:
        return -b - h
    return -1.0


@forward_only
def paths_kernel(
    centers: wp.array(dtype=wp.vec3), radii: wp.array(dtype=float), albedo: wp.array(dtype=wp.vec3),
    width: int, height: int, samples: int, image: wp.array(dtype=wp.vec3),
):  # fmt: skip
    t = wp.tid()
    rng = wp.rand_init(42, t)
    u0 = float(t % width)
    v0 = float(t // width)
    total = wp.vec3()
    for _s in range(samples):
        u = (u0 + wp.randf(rng)) / float(width) - 0.5
        v = (v0 + wp.randf(rng)) / float(height) - 0.5
        o = wp.vec3(0.0, 0.0, -3.0)
        d = wp.normalize(wp.vec3(u * 2.0, v * 2.0, 1.0))
        throughput = wp.vec3(1.0, 1.0, 1.0)
        for _bounce in range(5):
            best = float(1.0e6)
            which = int(-1)
            for k in range(centers.shape[0]):
                h = sphere_hit(o, d, centers[k], radii[k])
                if h > 0.0 and h < best:
                    best = h
                    which = k
            if which < 0:
                sky = 0.5 * (d[1] + 1.0)
                total += wp.cw_mul(throughput, wp.vec3(1.0 - 0.5 * sky, 1.0 - 0.3 * sky, 1.0))
                break
            o = o + d * best
            n = wp.normalize(o - centers[which])
            throughput = wp.cw_mul(throughput, albedo[which])
            if wp.max(throughput) < 0.05:
                break
            d = wp.normalize(n + wp.sample_unit_sphere_surface(rng))
    image[t] = total / float(samples)


@case
def paths(data):
    """Paths of light between twelve spheres."""
    n = data.size(64, 1024)
    arrays = [
        data.real((12, 3), wp.vec3, -1.0, grad=False),
        data.real(12, low=0.2, high=0.5, grad=False),
    ]
    arrays += [data.real((12, 3), wp.vec3, 0.4, grad=False), n, n, 4]
    return Case(paths_kernel, n * n, arrays, [data.out(n * n, wp.vec3, False)], n * n * 4, "path")


@forward_only
def terrain_kernel(seed: int, scale: float, octaves: int, out: wp.array2d(dtype=float)):
    i, j = wp.tid()
    state = wp.rand_init(seed)
    p = wp.vec2(float(i) * scale, float(j) * scale)
    total = float(0.0)
    size = float(1.0)
    for _k in range(octaves):
        total += size * wp.abs(wp.noise(state, p))
        p = p * 2.0
        size *= 0.5
    out[i, j] = total


@case
def terrain(data):
    """Octaves of noise over a plane."""
    n = data.size(256, 4096)
    return Case(
        terrain_kernel, (n, n), [7, 0.02, 5], [data.out((n, n), grad=False)], n * n, "point"
    )


@forward_only
def smoke_kernel(time: float, steps: int, out: wp.array2d(dtype=float)):
    i, j = wp.tid()
    state = wp.rand_init(3)
    d = wp.normalize(wp.vec3(float(j) / 256.0 - 0.5, float(i) / 256.0 - 0.5, 1.0))
    seen = float(1.0)
    light = float(0.0)
    t = float(0.0)
    for _s in range(steps):
        p = d * t + wp.vec3(0.0, 0.0, time)
        density = wp.max(wp.curlnoise(state, p)[0], 0.0)
        if density > 0.01:
            part = seen * (1.0 - wp.exp(-density * 0.2))
            light += part
            seen -= part
            if seen < 0.02:
                break
        t += 0.1
    out[i, j] = light


@case
def smoke(data):
    """A march through curls of noise, until little light is left."""
    n = data.size(64, 1024)
    return Case(smoke_kernel, (n, n), [0.5, 24], [data.out((n, n), grad=False)], n * n * 24, "step")


@wp.func
def harmonics(d: wp.vec3):
    x = d[0]
    y = d[1]
    z = d[2]
    return vec9(
        0.282095, -0.488603 * y, 0.488603 * z, -0.488603 * x, 1.092548 * x * y, -1.092548 * y * z,
        0.315392 * (3.0 * z * z - 1.0), -1.092548 * x * z, 0.546274 * (x * x - y * y),
    )  # fmt: skip


@differentiable
def shade_kernel(
    normal: wp.array(dtype=wp.vec3), weights: wp.array2d(dtype=wp.vec3), which: wp.array(dtype=int),
    color: wp.array(dtype=wp.vec3),
):  # fmt: skip
    i = wp.tid()
    y = harmonics(wp.normalize(normal[i]))
    c = wp.vec3(0.5, 0.5, 0.5)
    for k in range(9):
        c += weights[which[i], k] * y[k]
    color[i] = wp.vec3(wp.max(c[0], 0.0), wp.max(c[1], 0.0), wp.max(c[2], 0.0))


@case
def shade(data):
    """Colours by spherical harmonics of nine weights."""
    n = data.size(1 << 14, 1 << 21)
    arrays = [data.real((n, 3), wp.vec3, -1.0), data.real((64, 9, 3), wp.vec3, -0.2, 0.3)]
    return Case(
        shade_kernel, n, [*arrays, data.integers(n, 0, 64)], [data.out(n, wp.vec3)], n, "normal"
    )


@differentiable
def splat_kernel(
    center: wp.array(dtype=wp.vec3), scale: wp.array(dtype=wp.vec3), turn: wp.array(dtype=wp.quat),
    view: wp.mat44, focal: float, mean: wp.array(dtype=wp.vec2), conic: wp.array(dtype=wp.vec3),
):  # fmt: skip
    i = wp.tid()
    p = wp.transform_point(view, center[i])
    r = wp.quat_to_matrix(wp.normalize(turn[i]))
    m = r * wp.diag(wp.vec3(wp.exp(scale[i][0]), wp.exp(scale[i][1]), wp.exp(scale[i][2])))
    w = wp.mat33(
        view[0, 0], view[0, 1], view[0, 2], view[1, 0], view[1, 1], view[1, 2], view[2, 0],
        view[2, 1], view[2, 2],
    )  # fmt: skip
    iz = 1.0 / p[2]
    j = mat23(focal * iz, 0.0, -focal * p[0] * iz * iz, 0.0, focal * iz, -focal * p[1] * iz * iz)
    a = j * w * m
    s = a * wp.transpose(a) + wp.identity(n=2, dtype=float) * 0.3
    inv = wp.inverse(s)
    mean[i] = wp.vec2(p[0], p[1]) * (focal * iz)
    conic[i] = wp.vec3(inv[0, 0], inv[0, 1], inv[1, 1])


@case
def splat(data):
    """Gaussians in space become ellipses in an image."""
    n = data.size(1 << 13, 1 << 20)
    turn = data.random.standard_normal((n, 4)).astype(np.float32)
    arrays = [data.real((n, 3), wp.vec3, -1.0), data.real((n, 3), wp.vec3, -1.0, 0.0)]
    view = wp.mat44(1.0, 0.0, 0.0, 0.0, 0.0, 0.8, -0.6, 0.0, 0.0, 0.6, 0.8, 4.0, 0.0, 0.0, 0.0, 1.0)
    arrays += [data.given(turn, wp.quat, True), view, 2.0]
    return Case(splat_kernel, n, arrays, [data.out(n, wp.vec2), data.out(n, wp.vec3)], n, "splat")


@forward_only
def tones_kernel(image: wp.array3d(dtype=wp.float16), gain: float, out: wp.array3d(dtype=wp.uint8)):
    i, j = wp.tid()
    r = float(image[i, j, 0]) * gain
    g = float(image[i, j, 1]) * gain
    b = float(image[i, j, 2]) * gain
    light = 0.2126 * r + 0.7152 * g + 0.0722 * b
    k = (1.0 + light / 16.0) / (1.0 + light)
    out[i, j, 0] = wp.uint8(wp.clamp(wp.pow(r * k, 1.0 / 2.2) * 255.0 + 0.5, 0.0, 255.0))
    out[i, j, 1] = wp.uint8(wp.clamp(wp.pow(g * k, 1.0 / 2.2) * 255.0 + 0.5, 0.0, 255.0))
    out[i, j, 2] = wp.uint8(wp.clamp(wp.pow(b * k, 1.0 / 2.2) * 255.0 + 0.5, 0.0, 255.0))


@case
def tones(data):
    """Light in 16 bits becomes colours of 8."""
    n = data.size(256, 2048)
    image = data.given(data.random.uniform(0.0, 4.0, (n, n, 3)).astype(np.float16), wp.float16)
    return Case(
        tones_kernel, (n, n), [image, 1.5], [data.out((n, n, 3), wp.uint8, False)], n * n, "pixel"
    )


@forward_only
def debayer_kernel(raw: wp.array2d(dtype=wp.uint8), out: wp.array2d(dtype=wp.vec3ub)):
    i, j = wp.tid()
    n = raw.shape[0]
    m = raw.shape[1]
    u = wp.max(i - 1, 0)
    d = wp.min(i + 1, n - 1)
    left = wp.max(j - 1, 0)
    right = wp.min(j + 1, m - 1)
    cross = (int(raw[u, j]) + int(raw[d, j]) + int(raw[i, left]) + int(raw[i, right])) / 4
    corner = (int(raw[u, left]) + int(raw[u, right]) + int(raw[d, left]) + int(raw[d, right])) / 4
    across = (int(raw[i, left]) + int(raw[i, right])) / 2
    along = (int(raw[u, j]) + int(raw[d, j])) / 2
    here = int(raw[i, j])
    if i % 2 == 0 and j % 2 == 0:
        out[i, j] = wp.vec3ub(wp.uint8(here), wp.uint8(cross), wp.uint8(corner))
    elif i % 2 == 0:
        out[i, j] = wp.vec3ub(wp.uint8(across), wp.uint8(here), wp.uint8(along))
    elif j % 2 == 0:
        out[i, j] = wp.vec3ub(wp.uint8(along), wp.uint8(here), wp.uint8(across))
    else:
        out[i, j] = wp.vec3ub(wp.uint8(corner), wp.uint8(cross), wp.uint8(here))


@case
def debayer(data):
    """Colours out of a mosaic of a camera."""
    n = data.size(512, 4096)
    raw = data.integers((n, n), 0, 256, wp.uint8)
    return Case(debayer_kernel, (n, n), [raw], [data.out((n, n), wp.vec3ub, False)], n * n, "pixel")


@forward_only
def erode_kernel(image: wp.array2d(dtype=wp.uint8), radius: int, out: wp.array2d(dtype=wp.uint8)):
    i, j = wp.tid()
    low = wp.uint8(255)
    for a in range(-radius, radius + 1):
        for b in range(-radius, radius + 1):
            y = i + a
            x = j + b
            if y >= 0 and y < image.shape[0] and x >= 0 and x < image.shape[1]:
                low = wp.min(low, image[y, x])
    out[i, j] = low


@case
def erode(data):
    """The smallest byte of a window, cut at the border."""
    n = data.size(384, 4096)
    image = data.integers((n, n), 0, 256, wp.uint8)
    return Case(
        erode_kernel, (n, n), [image, 2], [data.out((n, n), wp.uint8, False)], n * n, "pixel"
    )


@differentiable
def warp_image_kernel(
    image: wp.array3d(dtype=float), flow: wp.array2d(dtype=wp.vec2), out: wp.array3d(dtype=float)
):
    i, j, c = wp.tid()
    p = wp.vec2(float(i), float(j)) + flow[i, j]
    y = wp.clamp(p[0], 0.0, float(image.shape[0]) - 1.001)
    x = wp.clamp(p[1], 0.0, float(image.shape[1]) - 1.001)
    a = int(wp.floor(y))
    b = int(wp.floor(x))
    s = y - float(a)
    t = x - float(b)
    upper = wp.lerp(image[a, b, c], image[a, b + 1, c], t)
    lower = wp.lerp(image[a + 1, b, c], image[a + 1, b + 1, c], t)
    out[i, j, c] = wp.lerp(upper, lower, s)


@case
def warp_image(data):
    """An image of three channels moved by a flow; the channel is the last dimension."""
    n = data.size(160, 1536)
    arrays = [data.real((n, n, 3)), data.real((n, n, 2), wp.vec2, -3.0, 3.0)]
    return Case(warp_image_kernel, (n, n, 3), arrays, [data.out((n, n, 3))], n * n * 3, "number")
