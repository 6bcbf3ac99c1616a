"""The code that blocks of a GPU run, by threads in any order between barriers, against NumPy."""

import numpy as np
import pytest
from support.block_program import run_block

import warp as wp


@wp.kernel
def sort(keys: wp.array(dtype=float), places: wp.array(dtype=int)):
    k = wp.tile_load(keys, shape=13)
    v = wp.tile_arange(13)
    wp.tile_sort(k, v)
    wp.tile_store(keys, k)
    wp.tile_store(places, v)


def transform(length, inverse):
    @wp.kernel
    def work(a: wp.array2d(dtype=wp.vec2d), out: wp.array2d(dtype=wp.vec2d)):
        t = wp.tile_load(a, shape=(2, length))
        if wp.static(inverse):
            wp.tile_ifft(t)
        else:
            wp.tile_fft(t)
        wp.tile_store(out, t)

    return work


@wp.kernel
def normalise(a: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float64)):
    t = wp.tile_load(a, shape=300)
    low = wp.tile_min(t)
    u = t - wp.tile_broadcast(low, shape=(300,))
    s = wp.tile_sum(u * u)
    wp.tile_store(out, wp.tile_map(wp.div, u, wp.tile_broadcast(s, shape=(300,))))


def take(length):
    @wp.kernel
    def work(a: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float64)):
        t = wp.tile_load(a, shape=length)
        wp.tile_store(a, wp.tile_zeros(shape=length, dtype=wp.float64))
        wp.tile_store(out, t - wp.tile_broadcast(wp.tile_max(t), shape=(length,)))

    return work


@wp.kernel
def add_up(a: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float64)):
    t = wp.tile_load(a, shape=300)
    wp.tile_store(out, wp.tile_sum(t * wp.float64(2.0) + t))


@wp.kernel
def multiply(
    a: wp.array2d(dtype=wp.float64),
    b: wp.array2d(dtype=wp.float64),
    out: wp.array2d(dtype=wp.float64),
):
    x = wp.tile_load(a, shape=(5, 7))
    wp.tile_store(out, wp.tile_matmul(wp.tile_transpose(x), wp.tile_load(b, shape=(5, 3))))


@pytest.mark.parametrize("seed", range(3))
def test_sorting(seed):
    chosen = np.array([1.0, -1.0, np.nan, 0.0, -0.0, 5.0, np.inf], dtype=np.float32)
    values = np.random.default_rng(seed).choice(chosen, 13)
    keys, places = values.copy(), np.zeros(13, dtype=np.int32)
    run_block(sort, [keys, places], seed)
    order = np.argsort(values, kind="stable")
    np.testing.assert_array_equal(places, order)
    np.testing.assert_array_equal(keys, values[order])


def test_sorting_needs_its_barriers():
    """In no order of the threads but a lucky one the network works without them."""
    values = np.arange(13.0, 0.0, -1.0, dtype=np.float32)
    found = []
    for seed in range(3):
        keys, places = values.copy(), np.zeros(13, dtype=np.int32)
        run_block(sort, [keys, places], seed, waits=False)
        found.append(np.array_equal(keys, np.sort(values)))
    assert not any(found)


@pytest.mark.parametrize("inverse", [False, True])
@pytest.mark.parametrize("length", [4, 8, 12, 19])
def test_transforms(length, inverse):
    x = np.random.default_rng(length).normal(size=(2, length, 2))
    out = np.zeros_like(x)
    run_block(transform(length, inverse), [x, out], length)
    z = x[..., 0] + 1j * x[..., 1]
    expected = np.fft.ifft(z) * length if inverse else np.fft.fft(z)
    np.testing.assert_allclose(out[..., 0] + 1j * out[..., 1], expected, atol=1e-13 * length)


# Threads have the elements that they load and replace for themselves, in registers or in memory.
@pytest.mark.parametrize("length", [300, 512])
@pytest.mark.parametrize("seed", range(2))
def test_elements_that_are_replaced(length, seed):
    given, out = np.random.default_rng(seed).normal(size=length), np.zeros(length)
    a = given.copy()
    run_block(take(length), [a, out], seed)
    assert not a.any()
    np.testing.assert_array_equal(out, given - given.max())


@pytest.mark.parametrize("seed", range(2))
def test_sums_and_extrema(seed):
    a, out, total = np.random.default_rng(seed).normal(size=300), np.zeros(300), np.zeros(1)
    run_block(normalise, [a, out], seed)
    u = a - a.min()
    np.testing.assert_allclose(out, u / (u * u).sum(), rtol=1e-12)
    run_block(add_up, [a, total], seed)
    np.testing.assert_allclose(total[0], 3.0 * a.sum(), rtol=1e-12)


def test_products():
    rng = np.random.default_rng(1)
    a, b, out = rng.normal(size=(5, 7)), rng.normal(size=(5, 3)), np.zeros((7, 3))
    run_block(multiply, [a, b, out])
    np.testing.assert_allclose(out, a.T @ b, rtol=1e-12)


@pytest.mark.parametrize("derivative", [None, "adjoint"])
def test_code_is_shown_for_the_blocks_that_run_it(derivative):
    gpu = normalise.ir("launch", arch=90, derivative=derivative)
    assert "warp.block_threads = 256" in gpu and "warp.thread_number" in gpu
    assert "warp.block_threads = 1 " in normalise.ir("launch", derivative=derivative)
