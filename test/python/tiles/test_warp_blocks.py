"""Blocks of a warp for kernels that factor small tiles, whatever the launch asks for."""

import pytest

import warp as wp
from warp._src.kernels.blocks import WARP


@wp.func
def twice(x: float):
    return 2.0 * x


def rank_of(kernel) -> int:
    """Dimensions from which on the kernel's blocks may be of a warp; 0: never."""
    kernel.prepare()
    return kernel.hook("blocks").warp_rank


def made(body, **options):
    return wp.kernel(module="unique", enable_backward=False, **options)(body)


def factor_of(n):
    """A kernel that factors and solves for n rows."""

    def factor(a: wp.array3d[float], y: wp.array2d[float], x: wp.array2d[float]):
        i = wp.tid()
        low = wp.tile_cholesky(wp.tile_load(a[i], shape=(n, n)))
        found = wp.tile_cholesky_solve(low, wp.tile_load(y[i], shape=n))
        wp.tile_store(x[i], wp.tile_map(twice, found))

    return factor


@pytest.mark.parametrize("n", [4, 27, 32])
def test_a_warp_is_enough_for_small_factors(n):
    kernel = made(factor_of(n))
    assert rank_of(kernel) == 1
    blocks = kernel.hook("blocks")
    assert blocks.threads_of_row(1, 64) == WARP
    assert blocks.threads_of_row(3, 256) == WARP
    for threads in (0, 1, 16, WARP):
        assert blocks.threads_of_row(1, threads) == threads


def test_large_factors_have_the_threads_of_the_launch():
    assert rank_of(made(factor_of(33))) == 0


def test_tiles_without_factors_have_the_threads_of_the_launch():
    def product(a: wp.array3d[float], x: wp.array3d[float]):
        i = wp.tid()
        t = wp.tile_load(a[i], shape=(16, 16))
        wp.tile_store(x[i], wp.tile_matmul(t, t))

    assert rank_of(made(product)) == 0


def test_large_tiles_beside_small_factors():
    def factor(a: wp.array3d[float], y: wp.array2d[float], x: wp.array2d[float]):
        i = wp.tid()
        low = wp.tile_cholesky(wp.tile_load(a[i], shape=(8, 8)))
        wp.tile_store(a[i], low)
        wp.tile_store(x[i], wp.tile_map(twice, wp.tile_load(y[i], shape=2048)))

    assert rank_of(made(factor)) == 0


def test_threads_that_tell_themselves_apart():
    def lanes(a: wp.array3d[float], x: wp.array2d[float]):
        i, lane = wp.tid()
        low = wp.tile_cholesky(wp.tile_load(a[i], shape=(8, 8)))
        wp.tile_store(a[i], low)
        x[i, lane] = 1.0

    def blocks(a: wp.array3d[float], x: wp.array2d[float]):
        i = wp.tid()
        low = wp.tile_cholesky(wp.tile_load(a[i], shape=(8, 8)))
        wp.tile_store(a[i], low)
        x[i, 0] = float(wp.block_dim())

    kernel = made(lanes)
    assert rank_of(kernel) == 2
    assert kernel.hook("blocks").threads_of_row(1, 64) == 64
    assert kernel.hook("blocks").threads_of_row(2, 64) == WARP
    assert rank_of(made(blocks)) == 0


def test_what_every_thread_does_counts():
    def adds(a: wp.array3d[float], n: wp.array[int]):
        i = wp.tid()
        wp.tile_store(a[i], wp.tile_cholesky(wp.tile_load(a[i], shape=(8, 8))))
        wp.atomic_add(n, 0, 1)

    def prints(a: wp.array3d[float]):
        i = wp.tid()
        wp.tile_store(a[i], wp.tile_cholesky(wp.tile_load(a[i], shape=(8, 8))))
        wp.printf("%d\n", i)

    def takes_turns(a: wp.array3d[float], x: wp.array[float]):
        i = wp.tid()
        t = wp.tile_cholesky(wp.tile_load(a[i], shape=(8, 8)))
        t[0, 0] += 1.0
        wp.tile_store(a[i], t)

    for body in (adds, prints, takes_turns):
        assert rank_of(made(body)) == 0, body.__name__


@pytest.mark.parametrize(
    "options", [{"launch_bounds": (64, 4)}, {"module_options": {"block_dim": 64}}]
)
def test_own_bounds_and_options_are_kept(options):
    assert rank_of(made(factor_of(8), **options)) == 0
