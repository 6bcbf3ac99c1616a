"""SPH density with a hash grid; generic kernels, overloads, wp.static."""

import typing

import numpy as np

import warp as wp

RADIUS = 0.1
N: int = 4


@wp.func
def poly6(r2: float, h: float) -> float:
    q = wp.max(h * h - r2, 0.0)
    return 315.0 / (64.0 * wp.pi * wp.pow(h, 9.0)) * q * q * q


@wp.kernel
def density(grid: wp.uint64, x: wp.array[wp.vec3], h: float, rho: wp.array[float]):
    tid = wp.tid()
    i = wp.hash_grid_point_id(grid, tid)
    total = float(0.0)
    for j in wp.hash_grid_query(grid, x[i], h):
        total += poly6(wp.length_sq(x[i] - x[j]), h)
    rho[i] = total


@wp.kernel
def scale(x: wp.array[typing.Any], s: typing.Any):
    i = wp.tid()
    for _ in range(wp.static(N)):
        x[i] = x[i] * s


wp.overload(scale, [wp.array(dtype=float), float])

x = wp.array(np.random.default_rng(0).random((2000, 3)), dtype=wp.vec3)
rho = wp.empty(x.shape, dtype=float)
grid = wp.HashGrid(16, 16, 16)
grid.build(points=x, radius=RADIUS)
wp.launch(density, dim=x.shape[0], inputs=[grid.id, x, RADIUS, rho])
wp.launch(scale, dim=rho.size, inputs=[rho, 0.5])
mean = wp.utils.array_sum(rho) / rho.size
smallest: float = np.min(rho.numpy())
assert smallest >= 0.0
print(mean)
