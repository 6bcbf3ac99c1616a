"""Atomic updates of 8- and 16-bit integers, alone and in vectors, beside NumPy; neighbours stay."""

import numpy as np
import pytest

import warp as wp

SMALL = (wp.int8, wp.uint8, wp.int16, wp.uint16)
COMBINE = {
    "add": np.add.reduce,
    "min": np.minimum.reduce,
    "max": np.maximum.reduce,
    "and": np.bitwise_and.reduce,
    "or": np.bitwise_or.reduce,
    "xor": np.bitwise_xor.reduce,
}


def _launch(kind, dtype, size, values, start):
    update = getattr(wp, f"atomic_{kind}")

    @wp.kernel(module="unique")
    def collect(x: wp.array(dtype=dtype), y: wp.array(dtype=dtype), n: int):
        i = wp.tid()
        update(y, i % n, x[i])

    x, y = wp.array(values, dtype=dtype), wp.array(start, dtype=dtype)
    wp.launch(collect, len(values), [x, y, size])
    return y.numpy()


@pytest.mark.parametrize("kind", COMBINE)
@pytest.mark.parametrize("dtype", SMALL)
def test_neighbours_in_one_word_are_updated_apart(dtype, kind):
    """Seven elements share words of 32 bits, and thousands of threads update each."""
    kept = wp.dtype_to_numpy(dtype)
    bounds = np.iinfo(kept)
    rng = np.random.default_rng(5)
    values = rng.integers(bounds.min, bounds.max, 7 * 3000, endpoint=True).astype(kept)
    start = rng.integers(bounds.min, bounds.max, 7, endpoint=True).astype(kept)
    rows = np.vstack([start, values.reshape(-1, 7)])
    expected = COMBINE[kind](rows, axis=0, dtype=kept) if kind == "add" else COMBINE[kind](rows)
    np.testing.assert_array_equal(_launch(kind, dtype, 7, values, start), expected)


@pytest.mark.parametrize("dtype", [wp.vec3b, wp.vec3us])
def test_vectors_of_small_integers_are_summed_by_component(dtype):
    kept = wp.dtype_to_numpy(dtype._wp_scalar_type_)
    values = np.random.default_rng(6).integers(0, 100, (5 * 400, 3)).astype(kept)
    start = np.zeros((5, 3), kept)
    expected = values.reshape(-1, 5, 3).sum(axis=0, dtype=kept)
    np.testing.assert_array_equal(_launch("add", dtype, 5, values, start), expected)


@pytest.mark.parametrize("dtype", SMALL)
def test_counters_hand_out_each_number_once(dtype):
    """The result of `atomic_add`, and a lock-free maximum by compare and exchange."""

    @wp.kernel(module="unique")
    def count(y: wp.array(dtype=dtype), old: wp.array(dtype=dtype)):
        old[wp.tid()] = wp.atomic_add(y, 1, dtype(1))

    y, old = wp.zeros(3, dtype=dtype), wp.zeros(100, dtype=dtype)
    wp.launch(count, 100, [y, old])
    assert y.numpy().tolist() == [0, 100, 0]
    assert sorted(old.numpy()) == list(range(100))


def test_bits_of_floats_are_refused():
    @wp.kernel(module="unique")
    def combine(y: wp.array(dtype=wp.float16)):
        wp.atomic_or(y, 0, wp.float16(1.0))

    with pytest.raises(wp.WarpCodegenError, match="expects an array of integers"):
        wp.launch(combine, 1, [wp.zeros(1, dtype=wp.float16)])
