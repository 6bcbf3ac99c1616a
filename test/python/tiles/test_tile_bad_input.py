"""Input at and beyond the limits: windows outside of arrays, NaN, blocks of every size, memory."""

import numpy as np
import pytest

import warp as wp

ROWS, COLUMNS = 5, 7


def window(shape):
    @wp.kernel(module="unique")
    def copy(
        src: wp.array2d(dtype=float), dst: wp.array2d(dtype=float), total: wp.array2d(dtype=float),
        row: int, column: int,
    ):  # fmt: skip
        t = wp.tile_load(src, shape=shape, offset=(row, column))
        wp.tile_store(dst, t + wp.tile_ones(shape, dtype=float), offset=(row, column))
        wp.tile_atomic_add(total, t, offset=(row, column))

    return copy


# Zero is read outside, and nothing is written: at both ends, of both axes, and far away.
@pytest.mark.parametrize("row", [-(2**31), -4, -3, 0, 2, 4, 5, 2**31 - 1])
@pytest.mark.parametrize("column", [-9, -1, 0, 3, 6, 2**31 - 2])
def test_windows_outside(device, row, column):
    shape = (3, 4)
    rng = np.random.default_rng(5)
    given = rng.integers(1, 9, (ROWS, COLUMNS)).astype(np.float32)
    wide = np.zeros((ROWS + 2 * shape[0], COLUMNS + 2 * shape[1]), np.float32)
    wide[shape[0] : -shape[0], shape[1] : -shape[1]] = 1.0
    src = wp.array(given, requires_grad=True, device=device)
    dst = wp.full((ROWS, COLUMNS), -1.0, dtype=float, requires_grad=True, device=device)
    total = wp.zeros((ROWS, COLUMNS), dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch_tiled(
            WINDOW, dim=1, inputs=[src, dst, total, row, column], block_dim=32, device=device
        )
    i, j = np.meshgrid(np.arange(ROWS), np.arange(COLUMNS), indexing="ij")
    inside = (i >= row) & (i < row + shape[0]) & (j >= column) & (j < column + shape[1])
    np.testing.assert_array_equal(dst.numpy(), np.where(inside, given + 1, -1))
    np.testing.assert_array_equal(total.numpy(), np.where(inside, given, 0))
    ones = wp.ones_like(dst, requires_grad=False)
    tape.backward(grads={dst: ones, total: wp.clone(ones)})
    np.testing.assert_array_equal(src.grad.numpy(), np.where(inside, 2.0, 0.0))


WINDOW = window((3, 4))


@wp.kernel
def overlap(x: wp.array(dtype=float), y: wp.array(dtype=float), z: wp.array(dtype=float)):
    t = wp.tile_load(x, shape=64)
    wp.tile_assign(t[1:64], t[0:63])
    wp.tile_store(y, t)
    wp.tile_assign(t[0:63], t[1:64])
    t[0:32] = t[63:31:-1]
    wp.tile_store(z, t)


# The assigned value is read first.
@pytest.mark.parametrize("threads", [1, 32, 48])
def test_overlapping_views(device, threads, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    t = np.arange(64, dtype=np.float32)
    x, y, z = (wp.array(t, device=device) for _ in range(3))
    wp.launch_tiled(overlap, dim=1, inputs=[x, y, z], block_dim=threads, device=device)
    t[1:] = t[:-1].copy()
    np.testing.assert_array_equal(y.numpy(), t)
    t[:-1] = t[1:].copy()
    t[:32] = t[63:31:-1].copy()
    np.testing.assert_array_equal(z.numpy(), t)


@wp.kernel
def orders(x: wp.array(dtype=float), y: wp.array(dtype=float), places: wp.array(dtype=int)):
    t = wp.tile_load(x, shape=50)
    wp.tile_store(y, wp.tile_min(t), offset=50)
    wp.tile_store(y, wp.tile_max(t), offset=51)
    wp.tile_store(y, wp.tile_sum(t), offset=52)
    wp.tile_store(places, wp.tile_argmin(t), offset=50)
    wp.tile_store(places, wp.tile_argmax(t), offset=51)
    numbers = wp.tile_arange(50, dtype=int)
    wp.tile_sort(t, numbers)
    wp.tile_store(y, t)
    wp.tile_store(places, numbers)


# Extrema skip what is no number, sums do not, and sorting puts it last: NumPy's rules.
@pytest.mark.parametrize("threads", [1, 32, 48, 1024])
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_no_numbers(device, threads, share, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    rng = np.random.default_rng(int(10 * share))
    given = rng.choice(np.array([-np.inf, -2, 0, 1, 5, np.inf], np.float32), 50)
    given[rng.random(50) < share] = np.nan
    x = wp.array(given, device=device)
    y = wp.zeros(53, dtype=float, device=device)
    places = wp.zeros(52, dtype=int, device=device)
    wp.launch_tiled(orders, dim=1, inputs=[x, y, places], block_dim=threads, device=device)
    order = np.argsort(given, kind="stable")
    np.testing.assert_array_equal(y.numpy()[:50], given[order])
    np.testing.assert_array_equal(places.numpy()[:50], order)
    with np.errstate(invalid="ignore"):
        assert np.array_equal(y.numpy()[52], given.sum(), equal_nan=True)
    if share < 1.0:
        np.testing.assert_array_equal(y.numpy()[50:52], [np.nanmin(given), np.nanmax(given)])
        np.testing.assert_array_equal(
            places.numpy()[50:], [np.nanargmin(given), np.nanargmax(given)]
        )


@wp.kernel
def threads_of(x: wp.array(dtype=wp.int32), sums: wp.array(dtype=wp.int32)):
    i, lane = wp.tid()
    t = wp.tile(x[lane] + i)
    wp.tile_store(sums, wp.tile_sum(t), offset=2 * i)
    wp.tile_store(sums, wp.tile_max(wp.tile_scan_inclusive(t)), offset=2 * i + 1)


@pytest.mark.parametrize("threads", [1, 2, 31, 32, 33, 48, 96, 1000, 1023, 1024])
def test_blocks_of_every_size(device, threads, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    given = np.random.default_rng(threads).integers(0, 1000, threads).astype(np.int32)
    x = wp.array(given, device=device)
    sums = wp.zeros(6, dtype=int, device=device)
    wp.launch_tiled(threads_of, dim=3, inputs=[x, sums], block_dim=threads, device=device)
    expected = [given.sum() + i * threads for i in range(3)]
    np.testing.assert_array_equal(sums.numpy(), np.repeat(expected, 2))


@pytest.mark.parametrize("threads", [1025, 2**31])
def test_blocks_that_there_are_not(device, threads, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    x = wp.zeros(4, dtype=int, device=device)
    with pytest.raises((wp.WarpError, ValueError), match="block_dim"):
        wp.launch_tiled(threads_of, dim=1, inputs=[x, x], block_dim=threads, device=device)


def test_more_memory_than_a_block_has_names_the_largest(device):
    @wp.kernel(module="unique")
    def large(y: wp.array2d(dtype=float)):
        t = wp.tile_zeros((1024, 1024), dtype=float)
        u = wp.tile_zeros((256, 1024), dtype=float)
        t[wp.block_dim(), 0] = 1.0
        u[wp.block_dim(), 0] = 1.0
        wp.tile_store(y, t)
        wp.tile_store(y, u)
        wp.tile_store(y, t)

    y = wp.zeros((4, 4), dtype=float, device=device)
    with pytest.raises(wp.WarpError, match="make them smaller") as caught:
        wp.launch_tiled(large, dim=1, inputs=[y], block_dim=32, device=device)
        wp.synchronize()
    first, largest, second = str(caught.value).split("test_tile_bad_input.py")[1:4]
    assert "need 5242880 bytes" in first
    assert "shape=(1024, 1024))' needs 4194304 bytes" in largest
    assert "shape=(256, 1024))' needs 1048576 bytes" in second


# Threads that do not come by would be waited for.
def test_tiles_under_conditions_that_differ(device, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    y = wp.zeros(32, dtype=float, device=device)

    def branch(y: wp.array(dtype=float)):
        _i, lane = wp.tid()
        if lane < 3:
            wp.tile_store(y, wp.tile_ones(4, dtype=float))

    def loop(y: wp.array(dtype=float)):
        _i, lane = wp.tid()
        for _k in range(lane):
            wp.tile_store(y, wp.tile_ones(4, dtype=float))

    for function in (branch, loop):
        with pytest.raises(wp.WarpError, match="differs between them") as caught:
            wp.launch_tiled(wp.Kernel(function), dim=1, inputs=[y], block_dim=32, device=device)
            wp.synchronize()
        line = function.__code__.co_firstlineno + 2
        assert f"test_tile_bad_input.py:{line}: the condition" in str(caught.value)


@wp.kernel
def factor(a: wp.array2d(dtype=float), out: wp.array2d(dtype=float)):
    f = wp.tile_cholesky(wp.tile_load(a, shape=(5, 5)))
    wp.tile_store(out, f)


@wp.kernel
def elements(x: wp.array(dtype=float), i: int, j: int, k: int, y: wp.array(dtype=float)):
    t = wp.tile_load(x, shape=8)
    t[i] = 1.0
    y[0] = t[j]
    wp.tile_store(y, wp.tile_view(t, offset=(k,), shape=(4,)), offset=1)


def error_of_debug(kernel, inputs, device):
    with pytest.raises(wp.WarpError) as caught:
        wp.launch_tiled(kernel, dim=1, inputs=inputs, block_dim=32, device=device)
        wp.synchronize()
    return str(caught.value)


# A kernel in debug mode names what others compute NaN of, or drop.
def test_debug_names_what_is_wrong(device, monkeypatch):
    monkeypatch.setattr(wp.config, "mode", "debug")
    matrix = np.eye(5, dtype=np.float32)
    out = wp.zeros((5, 5), dtype=float, device=device)
    good = wp.array(matrix, device=device)
    wp.launch_tiled(factor, dim=1, inputs=[good, out], block_dim=32, device=device)
    np.testing.assert_array_equal(out.numpy(), matrix)
    for place, value in ((2, -1.0), (4, 0.0), (0, np.nan)):
        matrix = np.eye(5, dtype=np.float32)
        matrix[place, place] = value
        text = error_of_debug(factor, [wp.array(matrix, device=device), out], device)
        line = factor.func.__code__.co_firstlineno + 2
        assert "not positive definite" in text and f"test_tile_bad_input.py:{line}" in text, text

    x, y = wp.zeros(8, dtype=float, device=device), wp.zeros(8, dtype=float, device=device)
    wp.launch_tiled(elements, dim=1, inputs=[x, 4, 7, 4, y], block_dim=32, device=device)
    np.testing.assert_array_equal(y.numpy(), [0, 1, 0, 0, 0, 0, 0, 0])
    line = elements.func.__code__.co_firstlineno
    for i, j, k, at in (
        *((8, 0, 0, 3), (-9, 0, 0, 3), (0, 8, 0, 4)),
        *((0, -9, 0, 4), (0, 0, 5, 5), (0, 0, -1, 5)),
    ):
        text = error_of_debug(elements, [x, i, j, k, y], device)
        index = {5: 8}.get(k, i or j or k)
        assert f"index ({index},) is out of bounds for a tile of shape (8,)" in text, text
        assert f"test_tile_bad_input.py:{line + at}" in text, text
