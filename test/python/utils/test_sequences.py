"""Scans, sorts and runs beside NumPy."""

import numpy as np
import pytest

import warp as wp
import warp.utils

KEYS = [wp.int32, wp.uint32, wp.float32, wp.int64, wp.uint64, wp.float64]
LENGTHS = [1, 31, 1000, 4097, 50_000]


def kind(dtype):
    return np.dtype(dtype.__name__)


def any_keys(dtype, count):
    """Numbers of all sizes, with duplicates, and for floats with infinities and NaN."""
    rng = np.random.default_rng(count)
    bits = rng.integers(0, 2**63, count, dtype=np.uint64) >> rng.integers(0, 60, count).astype("u8")
    keys = bits.astype(f"u{kind(dtype).itemsize}").view(kind(dtype))
    return np.where(rng.random(count) < 0.3, keys[rng.integers(0, count, count)], keys)


@pytest.mark.parametrize("dtype", KEYS)
@pytest.mark.parametrize("size", [4, 8])
def test_sorts_are_stable(device, dtype, size):
    value = wp.int32 if size == 4 else wp.vec2i
    for count in LENGTHS:
        keys, room = any_keys(dtype, count), np.zeros(count, kind(dtype))
        order = np.argsort(keys, kind="stable")
        numbers = np.arange(2 * count, dtype=np.int32)
        numbers = numbers if size == 4 else np.stack([numbers, -numbers], axis=1)
        k = wp.array(np.concatenate([keys, room]), dtype=dtype, device=device)
        v = wp.array(numbers, dtype=value, device=device)
        wp.utils.radix_sort_pairs(k, v, count)
        np.testing.assert_array_equal(v.numpy()[:count].reshape(count, -1)[:, 0], order)
        np.testing.assert_array_equal(k.numpy()[:count], keys[order])


def test_sorts_by_some_bits(device):
    keys = np.array([0x31, 0x12, 0x21, 0x10] + [0] * 4, np.uint32)
    k = wp.array(keys, device=device)
    v = wp.array(np.arange(8, dtype=np.int32), device=device)
    wp.utils.radix_sort_pairs(k, v, 4, begin_bit=4, end_bit=6)
    np.testing.assert_array_equal(v.numpy()[:4], [1, 3, 2, 0])


def test_zeros_are_equal_and_nan_comes_last(device):
    keys = np.array([-np.nan, 0.0, np.nan, np.inf, -0.0, -np.inf] + [0] * 6, np.float32)
    v = wp.array(np.arange(12, dtype=np.int32), device=device)
    wp.utils.radix_sort_pairs(wp.array(keys, device=device), v, 6)
    np.testing.assert_array_equal(v.numpy()[:6], [5, 1, 4, 3, 0, 2])


@pytest.mark.parametrize("dtype", [wp.int32, wp.float32])
def test_segments_are_sorted_alone(device, dtype):
    count, rng = 5000, np.random.default_rng(5)
    keys = any_keys(dtype, count)
    cuts = np.sort(rng.choice(np.arange(3, count), 80, replace=False)).astype(np.int32)
    begins, ends = cuts[:-1:2], cuts[1::2]
    expected, order = keys.copy(), np.arange(count)
    for begin, end in zip(begins, ends, strict=True):
        part = np.argsort(keys[begin:end], kind="stable")
        expected[begin:end], order[begin:end] = keys[begin:end][part], begin + part
    k = wp.array(np.concatenate([keys, keys]), dtype=dtype, device=device)
    v = wp.array(np.arange(2 * count, dtype=np.int32), device=device)
    shuffled = rng.permutation(len(begins))
    bounds = [wp.array(b[shuffled], dtype=int, device=device) for b in (begins, ends)]
    wp.utils.segmented_sort_pairs(k, v, count, *bounds)
    np.testing.assert_array_equal(k.numpy()[:count], expected)
    np.testing.assert_array_equal(v.numpy()[:count], order)


@pytest.mark.parametrize("dtype", [wp.int32, wp.float32])
@pytest.mark.parametrize("most", [3, 40, 150, 600, 5000])
def test_segments_of_any_length(device, dtype, most):
    """Without room between them, some of them empty; equal keys keep their order."""
    rng = np.random.default_rng(most)
    lengths = np.append(rng.integers(0, most + 1, 200), [0, 1, 128, 129, 512, 513, 2048, 2049])
    ends = np.cumsum(rng.permutation(lengths)).astype(np.int32)
    count, begins = ends[-1], np.append(0, ends[:-1]).astype(np.int32)
    keys = any_keys(dtype, count)
    if most == 150:  # All digits but one are shared.
        keys = rng.integers(0, 9, count).astype(kind(dtype))
    order = np.concatenate(
        [b + np.argsort(keys[b:e], kind="stable") for b, e in zip(begins, ends, strict=True)]
    )
    k = wp.array(np.concatenate([keys, keys]), dtype=dtype, device=device)
    v = wp.array(np.arange(2 * count, dtype=np.int32), device=device)
    offsets = wp.array(np.append(begins, count), dtype=int, device=device)
    wp.utils.segmented_sort_pairs(k, v, count, offsets)
    np.testing.assert_array_equal(k.numpy()[:count], keys[order])
    np.testing.assert_array_equal(v.numpy()[:count], order)


def test_a_few_long_segments(device):
    count, rng = 3_000_000, np.random.default_rng(2)
    keys = rng.integers(-1000, 1000, count).astype(np.int32)
    cuts = np.array([10, 1_000_000, 1_000_001, count], np.int32)
    order = np.arange(count)
    for b, e in zip(cuts[:-1], cuts[1:], strict=True):
        order[b:e] = b + np.argsort(keys[b:e], kind="stable")
    k = wp.array(np.concatenate([keys, keys]), dtype=int, device=device)
    v = wp.array(np.arange(2 * count, dtype=np.int32), device=device)
    wp.utils.segmented_sort_pairs(k, v, count, wp.array(cuts, dtype=int, device=device))
    np.testing.assert_array_equal(k.numpy()[:count], keys[order])
    np.testing.assert_array_equal(v.numpy()[:count], order)


def test_segments_that_are_none(device):
    keys = np.array([3, 2, 1, 0] + [0] * 4, np.int32)
    k, v = wp.array(keys, device=device), wp.zeros(8, dtype=int, device=device)
    begins, ends = ([-1, 2, 3, 0], [2, 1, 5, 2])
    bounds = [wp.array(b, dtype=int, device=device) for b in (begins, ends)]
    if v.device.is_cpu:
        with pytest.raises(ValueError, match="Invalid segment range at index 0"):
            wp.utils.segmented_sort_pairs(k, v, 4, *bounds)
        return
    wp.utils.segmented_sort_pairs(k, v, 4, *bounds)
    np.testing.assert_array_equal(k.numpy()[:4], [2, 3, 1, 0])


@pytest.mark.parametrize("dtype", [*KEYS, wp.vec3, wp.vec2d, wp.types.vector(5, wp.int64)])
def test_scans(device, dtype):
    scalar = kind(wp.types.type_scalar_type(dtype))
    for count in [*LENGTHS, 1_500_000]:
        rng = np.random.default_rng(count)
        shape = (count, *getattr(dtype, "_shape_", ()))
        numbers = rng.integers(-9, 9, shape).astype(scalar)
        source = wp.array(numbers, dtype=dtype, device=device)
        result = wp.empty_like(source)
        with np.errstate(over="ignore"):
            sums = np.cumsum(numbers, axis=0, dtype=scalar)
        wp.utils.array_scan(source, result, True)
        np.testing.assert_array_equal(result.numpy(), sums)
        wp.utils.array_scan(source, source, False)
        np.testing.assert_array_equal(source.numpy(), sums - numbers)


@pytest.mark.parametrize("dtype", [wp.int32, wp.float32])
def test_long_scans_have_the_same_bits(device, dtype):
    """More tiles than a GPU puts in two groups; a sum of floats keeps its shape."""
    numbers = np.random.default_rng(1).integers(0, 9, 5_000_003).astype(kind(dtype))
    source = wp.array(numbers / 7 if dtype is wp.float32 else numbers, dtype=dtype, device=device)
    first, again = wp.empty_like(source), wp.empty_like(source)
    wp.utils.array_scan(source, first)
    wp.utils.array_scan(source, again)
    sums = np.cumsum(source.numpy(), dtype=np.float64)
    np.testing.assert_array_equal(first.numpy(), again.numpy())
    np.testing.assert_allclose(first.numpy(), sums, rtol=0 if dtype is wp.int32 else 4e-6)


def test_scans_of_views(device):
    base = wp.array(np.arange(20, dtype=np.float64), device=device)
    out = wp.zeros(30, dtype=wp.float64, device=device)
    wp.utils.array_scan(base[::2], out[2:30:3])
    np.testing.assert_array_equal(out[2:30:3].numpy(), np.cumsum(np.arange(0, 20, 2.0)))
    with pytest.raises(RuntimeError, match="overlap"):
        wp.utils.array_scan(base[:10], base[1:11])


@pytest.mark.parametrize("dtype", [wp.int32, wp.uint64])
@pytest.mark.parametrize("longest", [1, 5, 30_000])
def test_runs(device, dtype, longest):
    for count in [*LENGTHS, 1_500_000]:
        rng = np.random.default_rng(count)
        lengths = rng.integers(
            1, longest + 1, 1 + 3 * count // (1 + longest) if longest > 5 else count
        )
        numbers = np.repeat(rng.integers(0, 5, lengths.size), lengths)[:count]
        numbers = np.append(numbers, np.zeros(count - numbers.size, numbers.dtype))
        starts = np.flatnonzero(np.diff(numbers, prepend=-1))
        # Not at the beginning of 16 bytes.
        values = wp.array(np.append(7, numbers), dtype=dtype, device=device)[1:]
        found, lengths = wp.empty_like(values), wp.empty(count, dtype=int, device=device)
        runs = wp.utils.runlength_encode(values, found, lengths)
        assert runs == len(starts)
        np.testing.assert_array_equal(found.numpy()[:runs], numbers[starts])
        np.testing.assert_array_equal(lengths.numpy()[:runs], np.diff(starts, append=count))


def test_a_graph_repeats_them(device):
    keys = wp.array([3, 1, 3, 0, 0, 0], dtype=int, device=device)
    values = wp.zeros(6, dtype=int, device=device)
    found, lengths = (wp.zeros(3, dtype=int, device=device) for _ in range(2))
    total = wp.zeros(1, dtype=int, device=device)
    with wp.ScopedCapture(device=device) as capture:
        wp.utils.radix_sort_pairs(keys, values, 3)
        wp.utils.array_scan(keys[:3], found)
        wp.utils.runlength_encode(keys[:3], found, lengths, total)
    keys.assign(np.array([7, 2, 7, 0, 0, 0], np.int32))
    wp.capture_launch(capture.graph)
    assert total.numpy()[0] == 2
    np.testing.assert_array_equal(found.numpy()[:2], [2, 7])
    np.testing.assert_array_equal(lengths.numpy()[:2], [1, 2])
    with wp.ScopedCapture(device=device), pytest.raises(NotImplementedError, match="run_count"):
        wp.utils.runlength_encode(keys, wp.empty_like(keys), wp.empty_like(keys))
