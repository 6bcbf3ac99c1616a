"""Heat equation: graphs, streams, tiles, modules and options, IR output."""

import numpy as np

import warp as wp

wp.config.quiet = True
TILE = wp.constant(16)


@wp.kernel
def heat(u: wp.array2d[float], w: wp.array2d[float], k: float):
    i, j = wp.tid()
    if i > 0 and j > 0 and i < u.shape[0] - 1 and j < u.shape[1] - 1:
        lap = u[i - 1, j] + u[i + 1, j] + u[i, j - 1] + u[i, j + 1] - 4.0 * u[i, j]
        w[i, j] = u[i, j] + k * lap


@wp.kernel
def product(a: wp.array2d[float], b: wp.array2d[float], c: wp.array2d[float]):
    i, j = wp.tid()
    total = wp.tile_zeros(shape=(TILE, TILE), dtype=float)
    for k in range(a.shape[1] // TILE):
        left = wp.tile_load(a, shape=(TILE, TILE), offset=(i * TILE, k * TILE))
        right = wp.tile_load(b, shape=(TILE, TILE), offset=(k * TILE, j * TILE))
        wp.tile_matmul(left, right, total)
    wp.tile_store(c, total, offset=(i * TILE, j * TILE))


device = wp.get_device("cpu")
u = wp.zeros((64, 64), dtype=float, device=device)
u[20:30, 20:30].fill_(1.0)
w = wp.clone(u)
with wp.ScopedDevice(device):
    with wp.ScopedCapture() as capture:
        wp.launch(heat, dim=u.shape, inputs=[u, w, 0.1])
        wp.copy(u, w)
    for _ in range(10):
        wp.capture_launch(capture.graph)
assert np.isclose(u.numpy().sum(), 100.0, rtol=1e-3)

a = wp.array(np.eye(32), dtype=float)
b = wp.array(np.arange(1024.0).reshape(32, 32), dtype=float)
c = wp.zeros((32, 32), dtype=float)
wp.launch_tiled(product, dim=(2, 2), inputs=[a, b, c], block_dim=64)
assert np.allclose(c.numpy(), b.numpy())
text = heat.ir("ptx", arch=80)
options = wp.get_module_options()
wp.set_module_options({"fast_math": False})
wp.load_module(device="cpu")
print(len(text), len(options), str(device), device.is_cuda, wp.is_cuda_available())
