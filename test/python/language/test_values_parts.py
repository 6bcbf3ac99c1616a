"""Parts of values: components and rows at indices known only at run time, and bits."""

import numpy as np
import pytest

import warp as wp

vec11 = wp.types.vector(length=11, dtype=wp.float32)
mat57 = wp.types.matrix(shape=(5, 7), dtype=wp.float64)


@wp.kernel
def read_components(v: wp.array(dtype=vec11), i: wp.array(dtype=int), y: wp.array(dtype=float)):
    t = wp.tid()
    u = v[0]
    y[t] = u[i[t]]


def test_component_at_any_index(device):
    values = np.arange(11, dtype=np.float32) * 2 + 1
    v = wp.array(values[None], dtype=vec11, device=device)
    indices = np.arange(-11, 11, dtype=np.int32)
    i = wp.array(indices, dtype=int, device=device)
    y = wp.zeros(22, dtype=float, device=device)
    wp.launch(read_components, dim=22, inputs=[v, i], outputs=[y], device=device)
    np.testing.assert_array_equal(y.numpy(), values[indices])


@wp.kernel
def write_components(i: wp.array(dtype=int), y: wp.array(dtype=vec11)):
    t = wp.tid()
    u = vec11(1.0)
    u[i[t]] = 5.0
    u[3] = 7.0
    y[t] = u


def test_component_set_at_any_index(device):
    indices = np.arange(-11, 11, dtype=np.int32)
    i = wp.array(indices, dtype=int, device=device)
    y = wp.zeros(22, dtype=vec11, device=device)
    wp.launch(write_components, dim=22, inputs=[i], outputs=[y], device=device)
    expected = np.ones((22, 11), np.float32)
    expected[np.arange(22), indices] = 5
    expected[:, 3] = 7
    np.testing.assert_array_equal(y.numpy(), expected)


@wp.kernel
def use_matrix(
    m: wp.array(dtype=mat57),
    i: wp.array2d(dtype=int),
    entry: wp.array(dtype=wp.float64),
    row_sum: wp.array(dtype=wp.float64),
    changed: wp.array(dtype=mat57),
):
    t = wp.tid()
    a = m[0]
    r = i[t, 0]
    c = i[t, 1]
    entry[t] = a[r, c]
    row = a[r]
    total = wp.float64(0.0)
    for k in range(7):
        total += row[k]
    row_sum[t] = total
    a[r, c] = wp.float64(-1.0)
    changed[t] = a


def test_matrix_entries_and_rows_at_any_index(device):
    values = np.arange(35.0).reshape(5, 7) ** 2
    m = wp.array(values[None], dtype=mat57, device=device)
    indices = np.array([(r, c) for r in range(-5, 5) for c in range(-7, 7)], np.int32)
    count = len(indices)
    i = wp.array(indices, dtype=int, device=device)
    entry = wp.zeros(count, dtype=wp.float64, device=device)
    row_sum = wp.zeros(count, dtype=wp.float64, device=device)
    changed = wp.zeros(count, dtype=mat57, device=device)
    wp.launch(use_matrix, count, inputs=[m, i], outputs=[entry, row_sum, changed], device=device)
    rows, cols = indices.T
    np.testing.assert_array_equal(entry.numpy(), values[rows, cols])
    np.testing.assert_array_equal(row_sum.numpy(), values.sum(1)[rows])
    expected = np.repeat(values[None], count, 0)
    expected[np.arange(count), rows, cols] = -1
    np.testing.assert_array_equal(changed.numpy(), expected)


@pytest.mark.parametrize(
    "source, target",
    [
        (wp.float32, wp.int32),
        (wp.float32, wp.uint32),
        (wp.float64, wp.uint64),
        (wp.float16, wp.uint16),
        (wp.int64, wp.float64),
        (wp.vec2f, wp.uint64),
        (wp.uint64, wp.vec2f),
        (wp.vec4h, wp.vec2f),
    ],
)
def test_bits_keep(device, source, target):
    @wp.kernel
    def same_bits(x: wp.array(dtype=source), y: wp.array(dtype=target)):
        i = wp.tid()
        y[i] = wp.cast(x[i], target)

    x = wp.zeros(64, dtype=source, device=device)
    size = x.numpy().nbytes
    pattern = np.random.default_rng(2).integers(0, 120, size).astype(np.uint8)
    x.assign(pattern.view(x.numpy().dtype).reshape(x.numpy().shape))
    y = wp.zeros(64, dtype=target, device=device)
    wp.launch(same_bits, dim=64, inputs=[x], outputs=[y], device=device)
    np.testing.assert_array_equal(y.numpy().reshape(-1).view(np.uint8), pattern)
