"""Image filter: two-dimensional launches, textures, random numbers, a ray marcher, views."""

import numpy as np

import warp as wp


@wp.func
def sdf(p: wp.vec3):
    return wp.min(wp.length(p) - 1.0, p.y + 1.0)


@wp.kernel
def shade(pixels: wp.array2d[float], seed: int):
    i, j = wp.tid()
    state = wp.rand_init(seed, i * pixels.shape[1] + j)
    u = (float(j) + wp.randf(state)) / float(pixels.shape[1]) * 2.0 - 1.0
    v = (float(i) + wp.randf(state)) / float(pixels.shape[0]) * 2.0 - 1.0
    origin = wp.vec3(0.0, 0.0, -3.0)
    direction = wp.normalize(wp.vec3(u, -v, 1.5))
    t = float(0.0)
    for _ in range(64):
        d = sdf(origin + direction * t)
        if d < 1.0e-3:
            break
        t = t + d
    pixels[i, j] = wp.where(t < 10.0, 1.0 - t / 10.0, 0.0)


@wp.kernel
def blur(src: wp.array2d[float], dst: wp.array2d[float]):
    i, j = wp.tid()
    total = float(0.0)
    for di in range(-1, 2):
        for dj in range(-1, 2):
            y = wp.clamp(i + di, 0, src.shape[0] - 1)
            x = wp.clamp(j + dj, 0, src.shape[1] - 1)
            total += src[y, x]
    dst[i, j] = total / 9.0


image = wp.zeros((48, 64), dtype=float)
wp.launch(shade, dim=image.shape, inputs=[image, 42])
soft = wp.empty_like(image)
wp.launch(blur, dim=(48, 64), inputs=[image, soft])
crop = soft[8:40, 16:48]
assert crop.shape == (32, 32)
host: np.ndarray = crop.numpy()
squares = wp.map(wp.sin, soft)
total = soft + image * 2.0
assert host.max() <= 1.0
print(host.mean(), squares.shape, total.numpy().std())
