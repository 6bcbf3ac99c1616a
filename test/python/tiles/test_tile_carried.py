"""Tiles that loops and branches carry: on a GPU as values of threads, or in one place."""

import numpy as np

import warp as wp

WIDTH = 256


@wp.kernel
def turns(x: wp.array2d[float], n: int, y: wp.array2d[float]):
    """Adds or subtracts rows in turn, and begins anew with the row of a multiple of five."""
    i = wp.tid()
    t = wp.tile_load(x[i], shape=WIDTH)
    for j in range(n):
        u = wp.tile_load(x[j], shape=WIDTH)
        if j % 5 == 4:
            t = u
        else:
            if j % 2 == 0:
                t = wp.tile_map(wp.add, t, u)
            else:
                t = wp.tile_map(wp.sub, t, u)
    wp.tile_store(y[i], t)


@wp.kernel
def border(a: wp.array2d[float], b: wp.array[float], n: int, y: wp.array2d[float]):
    """The last of several matrices gets a row of its own, which a tile around the loop keeps."""
    i = wp.tid()
    kept = wp.tile_zeros(shape=16, dtype=float)
    for k in range(n):
        t = wp.tile_load(a, shape=(8, 8), offset=(8 * i, 8 * k))
        if k == n - 1:
            wp.tile_assign(t[7], wp.tile_load(b, shape=8))
            t[7, 7] = 1.0e3
            wp.tile_assign(kept, t[7], offset=4)
        wp.tile_store(y, t, offset=(8 * i, 8 * k))
    wp.tile_store(y[8 * i + 7], kept, offset=8 * n)


def test_loop_and_branches_carry_elements(device):
    n, rows = 8, 12
    x = np.random.default_rng(3).standard_normal((rows, WIDTH)).astype(np.float32)
    expected = x.astype(np.float64)
    for j in range(n):
        if j % 5 == 4:
            expected[:] = x[j]
        else:
            expected += x[j] if j % 2 == 0 else -x[j].astype(np.float64)
    y = wp.zeros((rows, WIDTH), dtype=float, device=device)
    given = wp.array(x, device=device)
    wp.launch_tiled(turns, dim=rows, inputs=[given, n, y], block_dim=WIDTH, device=device)
    # Eight sums of numbers below 6.
    np.testing.assert_allclose(y.numpy(), expected, rtol=0, atol=8 * 6 * 8 * 2.0**-24)


def test_carried_elements_have_no_memory_on_a_gpu():
    ptx = turns.ir("ptx", arch=90)
    assert ".shared" not in ptx and ".local" not in ptx


def test_branch_changes_its_tile_alone(device):
    """The other branch, the matrices before and a tile around the loop keep their elements."""
    n, blocks = 3, 2
    a = np.arange(64.0 * n * blocks, dtype=np.float32).reshape(8 * blocks, 8 * n)
    b = -np.arange(8.0, dtype=np.float32)
    expected = np.zeros((8 * blocks, 8 * n + 16), dtype=np.float32)
    expected[:, : 8 * n] = a
    expected[7::8, 8 * n - 8 : 8 * n] = b
    expected[7::8, 8 * n - 1] = 1.0e3
    expected[7::8, 8 * n + 4 : 8 * n + 12] = expected[7::8, 8 * n - 8 : 8 * n]
    y = wp.zeros(expected.shape, dtype=float, device=device)
    given = [wp.array(a, device=device), wp.array(b, device=device)]
    for threads in (32, 64):
        y.zero_()
        wp.launch_tiled(border, dim=blocks, inputs=[*given, n, y], block_dim=threads, device=device)
        np.testing.assert_array_equal(y.numpy(), expected)
