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


@wp.kernel
def products(a: wp.array3d[float], m: wp.array2d[float], last: int, y: wp.array2d[float]):
    """Adds squares of matrices to a tile that is carried as a vector, until one is the last."""
    i = wp.tid()
    flat = wp.tile_load(m[i], shape=1024)
    total = wp.tile_reshape(flat, (32, 32))
    for k in range(12):
        if k > last:
            break
        t = wp.tile_load(a[k], shape=(32, 32))
        total += wp.tile_matmul(t, t)
    wp.tile_store(y, total, offset=(32 * i, 0))


@wp.kernel
def exchanged(x: wp.array2d[float], n: int, y: wp.array2d[float]):
    """Exchanges two tiles, one of which grows, as long as an element of it is small."""
    u = wp.tile_load(x[0], shape=48)
    v = wp.tile_load(x[1], shape=48)
    k = int(0)
    while k < n and u[3] < 50.0:
        w = u
        u = v + wp.tile_ones(shape=48, dtype=float)
        v = w
        k += 1
    wp.tile_store(y[0], u)
    wp.tile_store(y[1], v)


def test_products_are_added_until_a_loop_ends(device):
    random = np.random.default_rng(7)
    a = random.integers(-4, 5, (12, 32, 32)).astype(np.float32)
    m = random.integers(-4, 5, (3, 1024)).astype(np.float32)
    given = [wp.array(one, device=device) for one in (a, m)]
    y = wp.zeros((96, 32), dtype=float, device=device)
    for last in (-1, 0, 4, 30):
        squares = sum((a[k] @ a[k] for k in range(min(last + 1, 12))), np.zeros((32, 32)))
        for threads in (32, 64, 128):
            y.zero_()
            inputs = [*given, last, y]
            wp.launch_tiled(products, dim=3, inputs=inputs, block_dim=threads, device=device)
            # Integers below 2^24.
            got = y.numpy().reshape(3, 32, 32)
            np.testing.assert_array_equal(got, m.reshape(3, 32, 32) + squares)


def test_sums_of_a_loop_that_ends_stay_in_registers():
    text = products.ir("launch", arch=90)
    before, loop = text.split("scf.while")
    assert before.count("warp_tile_take") == 1
    assert "warp_tile_take" not in loop and "warp_tile_give" not in loop
    assert loop.count("warp_tile_multiply") == loop.count("warp_tile_store") == 1


def test_loops_exchange_tiles(device):
    x = np.random.default_rng(9).uniform(0.0, 40.0, (2, 48)).astype(np.float32)
    for n in (0, 1, 5, 30):
        u, v = x
        for _ in range(n):
            if u[3] >= 50.0:
                break
            u, v = v + np.float32(1.0), u
        y = wp.zeros((2, 48), dtype=float, device=device)
        inputs = [wp.array(x, device=device), n, y]
        wp.launch_tiled(exchanged, dim=1, inputs=inputs, block_dim=32, device=device)
        np.testing.assert_array_equal(y.numpy(), np.stack([u, v]))
