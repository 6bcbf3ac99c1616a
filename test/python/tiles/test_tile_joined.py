"""Blocks of products next to each other that a GPU makes one, against NumPy."""

import numpy as np
import pytest

import warp as wp
from tile_products import check, product

# By type and tile: threads, and how many are one in a launch of many.
JOINED = [
    (wp.float16, (64, 64, 16), 128, 4),
    (wp.bfloat16, (64, 64, 32), 256, 4),
    (wp.float16, (128, 64, 32), 256, 4),
    (wp.float16, (128, 128, 32), 256, 2),
    (wp.float16, (128, 256, 64), 256, 1),
    (wp.float32, (64, 64, 16), 128, 2),
    (wp.float32, (64, 64, 32), 256, 4),
    (wp.float32, (128, 128, 32), 256, 1),
]


def edge(device):
    """Rows and columns that fill a card; a CPU does with few."""
    return 256 if device == "cpu" else 2048


@pytest.mark.parametrize("dtype, tile, threads, joined", JOINED)
def test_many_blocks_are_joined(dtype, tile, threads, joined):
    kernel = product(dtype, *tile)
    kernel.module.options["block_dim"] = threads
    blocks = 4096 // tile[0], 4096 // tile[1], threads
    (found,) = kernel.schedule(arch=90, dim=blocks)
    assert found.facts["block_coarsening"] == joined


def joined_blocks(kernel, threads):
    kernel.module.options["block_dim"] = threads
    (found,) = kernel.schedule(arch=90, dim=(64, 64, threads))
    return found.facts["block_coarsening"]


@pytest.mark.parametrize(
    "dtype, tile, threads, blocks",
    [
        (wp.float16, (64, 64, 128), 128, 2),
        (wp.float16, (64, 64, 256), 128, 1),
        (wp.float32, (64, 64, 64), 256, 2),
        (wp.float32, (64, 64, 128), 256, 1),
    ],
)
def test_what_is_loaded_ahead_has_room(dtype, tile, threads, blocks):
    """Fewer blocks fit where steps are deep."""
    assert joined_blocks(product(dtype, *tile), threads) == blocks


def test_products_that_threads_do_not_hold_are_not_joined():
    """Products of doubles, and sums of two tiles as large as the result."""
    T, n = wp.float64, 64

    @wp.kernel(module="unique")
    def doubles(a: wp.array2d(dtype=T), b: wp.array2d(dtype=T), c: wp.array2d(dtype=T)):
        i, j = wp.tid()
        sums = wp.tile_zeros(shape=(n, n), dtype=T)
        for s in range(4):
            x = wp.tile_load(a, shape=(n, 16), offset=(i * n, s * 16))
            y = wp.tile_load(b, shape=(16, n), offset=(s * 16, j * n))
            wp.tile_matmul(x, y, sums)
        wp.tile_store(c, sums, offset=(i * n, j * n))

    assert joined_blocks(doubles, 128) == 1

    @wp.kernel(module="unique")
    def scaled(a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), c: wp.array2d(dtype=float)):
        i, j = wp.tid()
        sums = wp.tile_zeros(shape=(n, n), dtype=float)
        for s in range(4):
            x = wp.tile_load(a, shape=(n, 16), offset=(i * n, s * 16))
            y = wp.tile_load(b, shape=(16, n), offset=(s * 16, j * n))
            wp.tile_matmul(x, y, sums, alpha=0.5)
        wp.tile_store(c, sums, offset=(i * n, j * n))

    assert joined_blocks(scaled, 256) == 1

    @wp.kernel(module="unique")
    def layer(
        a: wp.array2d(dtype=wp.float16),
        b: wp.array2d(dtype=wp.float16),
        bias: wp.array2d(dtype=float),
        rest: wp.array2d(dtype=float),
        c: wp.array2d(dtype=float),
    ):
        i, j = wp.tid()
        sums = wp.tile_zeros(shape=(128, 128), dtype=float)
        for s in range(4):
            x = wp.tile_load(a, shape=(128, 32), offset=(i * 128, s * 32))
            y = wp.tile_load(b, shape=(32, 128), offset=(s * 32, j * 128))
            wp.tile_matmul(x, y, sums)
        more = wp.tile_load(bias, shape=(128, 128), offset=(i * 128, j * 128))
        skip = wp.tile_load(rest, shape=(128, 128), offset=(i * 128, j * 128))
        wp.tile_store(c, wp.tile_map(wp.tanh, sums + more) + skip, offset=(i * 128, j * 128))

    assert joined_blocks(layer, 256) == 1


@pytest.mark.parametrize("blocks", [(4, 4), (64, 33)])
def test_few_blocks_and_odd_ones_are_not(blocks):
    kernel = product(wp.float16, 64, 64, 32)
    kernel.module.options["block_dim"] = 128
    (found,) = kernel.schedule(arch=90, dim=(*blocks, 128))
    assert found.facts["block_coarsening"] == 1


@pytest.mark.parametrize("turned", [(False, False), (True, False), (False, True)])
@pytest.mark.parametrize("dtype, tile, threads, joined", JOINED)
def test_products(dtype, tile, threads, joined, turned, device):
    kernel = product(dtype, *tile, *turned, first=0.5)
    size = edge(device)
    shape = (size, size, 3 * tile[2])
    check(kernel, dtype, tile, shape, threads, device, turned, first=0.5)


@pytest.mark.parametrize("dtype", [wp.float16, wp.float32])
def test_edges(dtype, device):
    """The parts of arrays beyond joined blocks are neither read nor written."""
    tile = (64, 64, 32)
    kernel = product(dtype, *tile)
    size = edge(device)
    for columns in (size - 1, size - 40, size - 65):
        check(kernel, dtype, tile, (size - 3, columns, 80), 128, device)


def test_a_launch_may_leave_columns_out(device):
    """Joined blocks do not go beyond the launch."""
    size = edge(device)
    kernel = product(wp.float32, 64, 64, 32)
    a = wp.array(np.ones((size, 32)), dtype=float, device=device)
    b = wp.array(np.ones((32, size)), dtype=float, device=device)
    for left_out in range(1, 5):
        c = wp.full((size, size), -1.0, dtype=float, device=device)
        blocks = size // 64
        wp.launch_tiled(
            kernel, [blocks, blocks - left_out], [a, b, c, 1], block_dim=128, device=device
        )
        expected = np.full((size, size), 32.0)
        expected[:, size - 64 * left_out :] = -1.0
        np.testing.assert_array_equal(c.numpy(), expected)


def test_sums_that_are_used(device):
    """A function of the sums, a sum in memory, and one row of blocks."""
    size = edge(device)

    @wp.kernel(module="unique")
    def work(
        a: wp.array2d(dtype=wp.float16),
        b: wp.array2d(dtype=wp.float16),
        c: wp.array2d(dtype=float),
        total: wp.array2d(dtype=float),
    ):
        j = wp.tid()
        sums = wp.tile_zeros(shape=(64, 64), dtype=float)
        for s in range(4):
            x = wp.tile_load(a, shape=(64, 32), offset=(0, s * 32))
            y = wp.tile_load(b, shape=(32, 64), offset=(s * 32, j * 64))
            wp.tile_matmul(x, y, sums)
        wp.tile_atomic_add(total, sums, offset=(0, j * 64))
        wp.tile_store(c, wp.tile_map(wp.abs, sums), offset=(0, j * 64))

    rng = np.random.default_rng(0)
    columns = 64 * 1056 if device != "cpu" else size
    a = rng.integers(-8, 9, (64, 128)).astype(np.float16)
    b = rng.integers(-8, 9, (128, columns)).astype(np.float16)
    arrays = [wp.array(v, dtype=wp.float16, device=device) for v in (a, b)]
    c = wp.zeros((64, columns), dtype=float, device=device)
    total = wp.ones((64, columns), dtype=float, device=device)
    inputs = [*arrays, c, total]
    for _ in range(2):
        wp.launch_tiled(work, [columns // 64], inputs, block_dim=128, device=device)
    expected = a.astype(float) @ b.astype(float)
    np.testing.assert_array_equal(c.numpy(), np.abs(expected))
    np.testing.assert_array_equal(total.numpy(), 1 + 2 * expected)


@pytest.mark.parametrize("dtype", [wp.float16, wp.float32])
def test_adjoint(dtype, device):
    """Gradients of many blocks: g b^T and a^T g, with integers, which all types hold."""
    size, depth = edge(device), 64
    kernel = product(dtype, 64, 64, 32)
    rng = np.random.default_rng(1)
    a, b, g = (
        rng.integers(-2, 3, shape).astype(float)
        for shape in ((size, depth), (depth, size), (size, size))
    )
    x, y = (wp.array(v, dtype=dtype, device=device, requires_grad=True) for v in (a, b))
    c = wp.zeros((size, size), dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch_tiled(
            kernel, [size // 64] * 2, [x, y, c, depth // 32], block_dim=128, device=device
        )
    np.testing.assert_array_equal(c.numpy(), a @ b)
    tape.backward(grads={c: wp.array(g, dtype=float, device=device)})
    np.testing.assert_array_equal(
        x.grad.numpy().astype(float), (g @ b.T).astype(wp.dtype_to_numpy(dtype))
    )
    np.testing.assert_array_equal(
        y.grad.numpy().astype(float), (a.T @ g).astype(wp.dtype_to_numpy(dtype))
    )
