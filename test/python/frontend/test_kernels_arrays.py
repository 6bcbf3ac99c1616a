"""Arrays in kernels: ranks, strides, views, component stores, launch dimensions."""

import numpy as np
import pytest

import warp as wp


def numbers(*shape, seed=1):
    """Random single-precision numbers."""
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


@wp.kernel
def copy_1d(a: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = 2.0 * a[i]


@wp.kernel
def copy_2d(a: wp.array2d(dtype=float), out: wp.array2d(dtype=float)):
    i, j = wp.tid()
    out[i, j] = 2.0 * a[i, j] + float(i * 100 + j)


@wp.kernel
def copy_3d(a: wp.array3d(dtype=float), out: wp.array3d(dtype=float)):
    i, j, k = wp.tid()
    out[i, j, k] = 2.0 * a[i, j, k] + float(i * 100 + j * 10 + k)


@wp.kernel
def copy_4d(a: wp.array4d(dtype=float), out: wp.array4d(dtype=float)):
    i, j, k, m = wp.tid()
    out[i, j, k, m] = 2.0 * a[i, j, k, m] + float(i * 1000 + j * 100 + k * 10 + m)


KERNELS = [copy_1d, copy_2d, copy_3d, copy_4d]
SHAPES = [(7,), (5, 9), (3, 4, 5), (2, 3, 4, 5), (1000,), (1, 1, 1), (130, 257)]


@pytest.mark.parametrize("shape", SHAPES)
def test_every_rank(device, shape):
    data = numbers(*shape)
    a = wp.array(data, dtype=float, device=device)
    out = wp.zeros(shape, dtype=float, device=device)
    wp.launch(KERNELS[len(shape) - 1], shape, [a], [out], device=device)
    weights = {1: [0], 2: [100, 1], 3: [100, 10, 1], 4: [1000, 100, 10, 1]}[len(shape)]
    expected = 2.0 * data + sum(w * g for w, g in zip(weights, np.indices(shape)))
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-6)


@pytest.mark.parametrize("rank", [1, 2, 3, 4])
def test_strided_inputs_and_outputs(device, rank):
    data = numbers(*(6,) * rank)
    a = wp.array(data, dtype=float, device=device)
    out = wp.zeros((6,) * rank, dtype=float, device=device)
    part = (slice(1, 6, 2),) * rank
    wp.launch(KERNELS[rank - 1], (3,) * rank, [a[part]], [out[part]], device=device)
    dense = wp.zeros((3,) * rank, dtype=float, device=device)
    inner = wp.array(np.ascontiguousarray(data[part]), dtype=float, device=device)
    wp.launch(KERNELS[rank - 1], (3,) * rank, [inner], [dense], device=device)
    result = out.numpy()
    np.testing.assert_array_equal(result[part], dense.numpy())
    result[part] = 0.0
    assert not result.any()


def test_transposed_input(device):
    data = numbers(4, 7)
    a = wp.array(data, dtype=float, device=device).transpose()
    out = wp.zeros((7, 4), dtype=float, device=device)
    wp.launch(copy_2d, (7, 4), [a], [out], device=device)
    i, j = np.indices((7, 4))
    np.testing.assert_allclose(out.numpy(), 2.0 * data.T + i * 100 + j, rtol=1e-6)


def test_one_source_two_launches_of_different_contiguity(device):
    data = numbers(32)
    a = wp.array(data, dtype=float, device=device)
    for view in (a, a[::2], a[3:20], a):
        out = wp.zeros(view.shape, dtype=float, device=device)
        wp.launch(copy_1d, view.shape, [view], [out], device=device)
        np.testing.assert_array_equal(out.numpy(), 2.0 * view.numpy())


def test_slices_and_views_inside_a_kernel(device):
    @wp.kernel
    def kernel(a: wp.array2d(dtype=float), lo: int, hi: int, out: wp.array(dtype=float)):
        i = wp.tid()
        row = a[i]
        part = row[lo:hi]
        s = float(0.0)
        for k in range(part.shape[0]):
            s += part[k] * float(k + 1)
        out[i] = s + row[-1]

    data = numbers(5, 8)
    a = wp.array(data, dtype=float, device=device)
    out = wp.zeros(5, dtype=float, device=device)
    wp.launch(kernel, 5, [a, 2, 6], [out], device=device)
    expected = data[:, 2:6] @ np.arange(1, 5) + data[:, -1]
    np.testing.assert_allclose(out.numpy(), expected, rtol=2e-6, atol=1e-6)


def test_function_takes_an_array_view(device):
    @wp.func
    def total(a: wp.array(dtype=float)):
        s = float(0.0)
        for k in range(a.shape[0]):
            s += a[k]
        return s

    @wp.kernel
    def kernel(a: wp.array2d(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = total(a[i])

    data = numbers(6, 11)
    a = wp.array(data, dtype=float, device=device)
    out = wp.zeros(6, dtype=float, device=device)
    wp.launch(kernel, 6, [a], [out], device=device)
    np.testing.assert_allclose(out.numpy(), data.sum(1), rtol=1e-5, atol=1e-6)


def test_negative_indices_wrap(device):
    @wp.kernel
    def kernel(a: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        out[-1 - i] = a[-2]

    a = wp.array([1.0, 2.0, 3.0], dtype=float, device=device)
    out = wp.zeros(4, dtype=float, device=device)
    wp.launch(kernel, 2, [a], [out], device=device)
    assert out.numpy().tolist() == [0.0, 0.0, 2.0, 2.0]


def test_shape_and_length(device):
    @wp.kernel
    def kernel(a: wp.array3d(dtype=float), out: wp.array(dtype=int)):
        out[0] = a.shape[0]
        out[1] = a.shape[1]
        out[2] = a.shape[2]
        out[3] = len(a)

    a = wp.zeros((4, 5, 6), dtype=float, device=device)
    out = wp.zeros(4, dtype=int, device=device)
    wp.launch(kernel, 1, [a], [out], device=device)
    assert out.numpy().tolist() == [4, 5, 6, 4]


def test_component_and_row_stores(device):
    @wp.kernel
    def kernel(v: wp.array(dtype=wp.vec3), m: wp.array(dtype=wp.mat33)):
        i = wp.tid()
        v[i].y = 5.0
        v[i][2] = v[i].x
        m[i][1] = wp.vec3(1.0, 2.0, 3.0)
        m[i][2, 0] = float(i)

    data, matrices = numbers(4, 3), numbers(4, 3, 3)
    v = wp.array(data, dtype=wp.vec3, device=device)
    m = wp.array(matrices, dtype=wp.mat33, device=device)
    wp.launch(kernel, 4, [v, m], device=device)
    expected = data.copy()
    expected[:, 1], expected[:, 2] = 5.0, data[:, 0]
    np.testing.assert_array_equal(v.numpy(), expected)
    expected = matrices.copy()
    expected[:, 1], expected[:, 2, 0] = (1, 2, 3), np.arange(4)
    np.testing.assert_array_equal(m.numpy(), expected)


def test_augmented_assignment_of_elements(device):
    @wp.kernel
    def kernel(idx: wp.array(dtype=int), out: wp.array(dtype=float), v: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        out[idx[i]] += 1.0
        out[idx[i]] -= 0.25
        v[idx[i]] += wp.vec3(1.0, 0.0, -1.0)
        v[idx[i]].y += 0.5

    n = 4000
    index = np.random.default_rng(3).integers(0, 5, n).astype(np.int32)
    idx = wp.array(index, dtype=int, device=device)
    out = wp.zeros(5, dtype=float, device=device)
    v = wp.zeros(5, dtype=wp.vec3, device=device)
    wp.launch(kernel, n, [idx, out, v], device=device)
    count = np.bincount(index, minlength=5)
    np.testing.assert_array_equal(out.numpy(), 0.75 * count)
    np.testing.assert_array_equal(v.numpy(), np.outer(count, [1.0, 0.5, -1.0]))


@pytest.mark.parametrize(
    "dim", [13, (13,), (3, 5), (2, 3, 5), (2, 3, 4, 5), (1, 70000), (70000, 1)]
)
def test_every_launch_rank_numbers_its_threads(device, dim):
    shape = (dim,) if isinstance(dim, int) else dim

    @wp.kernel
    def rank1(out: wp.array(dtype=int)):
        wp.atomic_add(out, wp.tid(), 1)

    @wp.kernel
    def rank2(out: wp.array2d(dtype=int)):
        i, j = wp.tid()
        wp.atomic_add(out, i, j, 1)

    @wp.kernel
    def rank3(out: wp.array3d(dtype=int)):
        i, j, k = wp.tid()
        wp.atomic_add(out, i, j, k, 1)

    @wp.kernel
    def rank4(out: wp.array4d(dtype=int)):
        i, j, k, m = wp.tid()
        wp.atomic_add(out, i, j, k, m, 1)

    out = wp.zeros(shape, dtype=int, device=device)
    wp.launch((rank1, rank2, rank3, rank4)[len(shape) - 1], dim, [out], device=device)
    assert (out.numpy() == 1).all()


def test_one_thread_id_over_a_grid_counts_all_threads(device):
    @wp.kernel
    def kernel(out: wp.array(dtype=int)):
        i = wp.tid()
        wp.atomic_add(out, i, 1)

    out = wp.zeros(30, dtype=int, device=device)
    wp.launch(kernel, (5, 6), [out], device=device)
    result = out.numpy()
    assert result.sum() == 30


def test_chained_launches_run_in_order(device):
    @wp.kernel
    def step(a: wp.array(dtype=float), b: wp.array(dtype=float)):
        i = wp.tid()
        b[i] = a[i] * 0.5 + a[(i + 1) % a.shape[0]]

    n = 10000
    data = numbers(n)
    a, b = wp.array(data, dtype=float, device=device), wp.zeros(n, dtype=float, device=device)
    for _ in range(20):
        wp.launch(step, n, [a], [b], device=device)
        a, b = b, a
    expected = data.astype(np.float64)
    for _ in range(20):
        expected = expected * 0.5 + np.roll(expected, -1)
    np.testing.assert_allclose(a.numpy(), expected, rtol=1e-4, atol=1e-2)


def test_integer_element_types_keep_their_width(device):
    for dtype, numpy_type in [
        (wp.int8, np.int8),
        (wp.uint8, np.uint8),
        (wp.int16, np.int16),
        (wp.uint16, np.uint16),
        (wp.int32, np.int32),
        (wp.uint32, np.uint32),
        (wp.int64, np.int64),
        (wp.uint64, np.uint64),
    ]:

        @wp.kernel
        def kernel(a: wp.array(dtype=dtype), out: wp.array(dtype=dtype)):
            i = wp.tid()
            out[i] = a[i] * a[i] + a[i]

        info = np.iinfo(numpy_type)
        data = np.array([0, 1, 7, info.max, info.min, info.max // 3], dtype=numpy_type)
        a = wp.array(data, dtype=dtype, device=device)
        out = wp.zeros(len(data), dtype=dtype, device=device)
        wp.launch(kernel, len(data), [a], [out], device=device)
        with np.errstate(over="ignore"):
            np.testing.assert_array_equal(out.numpy(), (data * data + data).astype(numpy_type))


def test_bool_arrays(device):
    @wp.kernel
    def kernel(a: wp.array(dtype=wp.bool), out: wp.array(dtype=wp.bool)):
        i = wp.tid()
        out[i] = not a[i]

    data = np.array([True, False, True])
    out = wp.zeros(3, dtype=wp.bool, device=device)
    wp.launch(kernel, 3, [wp.array(data, dtype=wp.bool, device=device)], [out], device=device)
    assert out.numpy().tolist() == [False, True, False]
