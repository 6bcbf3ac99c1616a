"""Arrays: construction, views, fills, copies, interfaces."""

import gc
import math

import numpy as np
import pytest

import warp as wp


def data_of(*shape):
    return np.arange(math.prod(shape), dtype=np.float32).reshape(shape)


def same(array, expected):
    return np.array_equal(array.numpy(), np.asarray(expected))


@pytest.mark.parametrize("shape", [3, (3,), (2, 3), (2, 3, 4), (2, 3, 4, 5), 0, (3, 0)])
def test_zeros_ones_full(device, shape):
    for make, value in ((wp.zeros, 0), (wp.ones, 1)):
        array = make(shape, dtype=wp.int16, device=device)
        extents = shape if isinstance(shape, tuple) else (shape,)
        assert array.shape == extents and array.ndim == len(extents)
        assert same(array, np.full(extents, value, np.int16))
    assert same(wp.full(shape, 2.5, device=device), np.full(shape, 2.5, np.float32))


def test_length_instead_of_shape(device):
    assert wp.zeros(length=3, device=device).shape == (3,)
    assert wp.array([1, 2], length=2, device=device).shape == (2,)
    with pytest.raises(ValueError):
        wp.zeros(shape=3, length=3, device=device)


@pytest.mark.parametrize(
    "dtype", [wp.bool, wp.int8, wp.uint8, wp.int32, wp.uint64, wp.float16, wp.float32, wp.float64]
)
def test_scalar_types_round_trip(device, dtype):
    numbers = np.array([0, 1, 1, 0, 1])
    array = wp.array(numbers, dtype=dtype, device=device)
    assert array.dtype is dtype and array.item_size == np.dtype(dtype).itemsize
    assert array.numpy().dtype == np.dtype(dtype) and same(array, numbers)
    assert array.list() == numbers.tolist()


def test_bfloat16_is_seen_as_numbers(device):
    ml_dtypes = pytest.importorskip("ml_dtypes")  # pinned, but not on every GPU machine
    array = wp.array([1.0, -2.5, 3.0], dtype=wp.bfloat16, device=device)
    assert array.numpy().dtype == ml_dtypes.bfloat16
    assert array.numpy().tolist() == array.list() == [1.0, -2.5, 3.0]
    assert wp.array(array.numpy(), dtype=wp.bfloat16, device=device).list() == [1.0, -2.5, 3.0]


def test_bfloat16_is_seen_as_bits_where_no_package_has_it(device, monkeypatch):
    monkeypatch.setattr("warp._src.arrays.array.numpy_bfloat16", lambda: None)
    array = wp.array([1.0, -2.5, 3.0], dtype=wp.bfloat16, device=device)
    assert array.numpy().tolist() == [0x3F80, 0xC020, 0x4040]
    assert array.list() == [1.0, -2.5, 3.0]


@pytest.mark.parametrize(
    "data, dtype, shape, expected",
    [
        ([1, 2, 3], None, (3,), wp.int64),
        ([1.5, 2], None, (2,), wp.float64),
        ([True, False], None, (2,), wp.bool),
        ([], float, (0,), wp.float32),
        ([[1, 2], [3, 4]], float, (2, 2), wp.float32),
        ([[1, 2, 3]], wp.vec3, (1,), wp.vec3),
        ([1, 2, 3, 4, 5, 6], wp.vec3, (2,), wp.vec3),
        ([wp.vec3(1, 2, 3)] * 4, wp.vec3, (4,), wp.vec3),
        ([[wp.vec2h(1, 2)], [wp.vec2h(3, 4)]], wp.vec2h, (2, 1), wp.vec2h),
        ([wp.mat22(1, 2, 3, 4)], wp.mat22, (1,), wp.mat22),
        ([wp.float32(1), wp.float32(2)], float, (2,), wp.float32),
        (np.zeros((4, 3)), wp.vec3, (4,), wp.vec3),
        (np.zeros((4, 9)), wp.mat33, (4,), wp.mat33),
        (np.zeros((5, 4, 3, 3)), wp.mat33, (5, 4), wp.mat33),
        (np.zeros((4, 7)), wp.transform, (4,), wp.transform),
        (np.zeros((4, 3)), None, (4, 3), wp.float64),
        (range(4), int, (4,), wp.int32),
    ],
)
def test_construction_from_data(device, data, dtype, shape, expected):
    data = list(data) if isinstance(data, range) else data
    array = wp.array(data, device=device) if dtype is None else wp.array(data, dtype, device=device)
    assert array.shape == shape and array.dtype is expected


def test_values_survive_folding(device):
    data = data_of(4, 3, 2)
    assert same(wp.array(data, dtype=wp.vec2, device=device), data)
    matrices = np.arange(18, dtype=np.float64).reshape(2, 3, 3)
    assert same(wp.array(matrices, dtype=wp.mat33d, device=device), matrices)
    assert wp.array(matrices, dtype=wp.mat33d, device=device).list()[1] == wp.mat33d(*range(9, 18))
    halves = [wp.vec2h(0.1, 2), wp.vec2h(3, 4)]
    assert same(wp.array(halves, dtype=wp.vec2h, device=device), np.float16([[0.1, 2], [3, 4]]))


def test_shape_and_dtype_conversions(device):
    array = wp.array([1, 2, 3, 4], shape=(2, 2), dtype=float, device=device)
    assert same(array, [[1, 2], [3, 4]])
    assert same(wp.array([1, 2, 3, 4], shape=(2, -1), device=device), [[1, 2], [3, 4]])
    assert same(wp.array([1.5, -2.5], dtype=int, device=device), [1, -2])
    assert wp.array(array, dtype=int).dtype is wp.int32
    nan = wp.array([math.nan, math.inf, -0.0], dtype=float, device=device).numpy()
    assert math.isnan(nan[0]) and nan[1] == math.inf and np.signbit(nan[2])


@pytest.mark.parametrize(
    "arguments, error, message",
    [
        (dict(data=3.0), TypeError, "sequence"),
        (dict(data="abc"), TypeError, "numbers"),
        (dict(data=[1, None]), TypeError, "numbers"),
        (dict(data=[[1], [2, 3]]), ValueError, "cannot make"),
        (dict(data=[300], dtype=wp.uint8), OverflowError, "300 does not fit 'uint8'"),
        (dict(data=[-1], dtype=wp.uint32), OverflowError, "-1"),
        (dict(data=np.zeros(3, np.complex64)), TypeError, "complex64"),
        (dict(data=np.zeros((2,) * 5)), ValueError, "1 to 4 dimensions"),
        (dict(data=np.zeros((4, 2)), dtype=wp.vec3), ValueError, "inner dimensions"),
        (dict(data=[1, 2, 3], shape=(2, 2)), ValueError, "shape"),
        (dict(data=[1, 2, 3], dtype=float, ndim=2), ValueError, "2 dimensions"),
        (dict(data=[1], dtype=str), TypeError, "'str'"),
        (dict(data=[wp.vec3(), wp.vec2()], dtype=wp.vec3), TypeError, "one type"),
        (dict(shape=-1), ValueError, "at least 0"),
        (dict(shape=2**31), ValueError, "at most"),
        (dict(shape=()), ValueError, "1 to 4 dimensions"),
        (dict(shape=2.5), TypeError, "not iterable|integers"),
        (dict(shape=(2, 2), ptr=1000, strides=(4,), dtype=float), ValueError, "strides"),
        (dict(dtype=float, device="cpu"), ValueError, "expects `data`, `shape` or `ptr`"),
    ],
)
def test_bad_construction(arguments, error, message):
    with pytest.raises(error, match=message):
        wp.array(**{"device": "cpu", **arguments})


@pytest.mark.parametrize("name", ["foo", "cuda:99", "cuda:-1", "CPU"])
def test_unknown_device(name):
    with pytest.raises(ValueError, match=f"no device '{name}'"):
        wp.zeros(3, device=name)


def test_too_much_memory(device):
    with pytest.raises(MemoryError, match="requested|more bytes"):
        wp.zeros((2**31 - 1, 2**31 - 1), dtype=wp.int8, device=device)


def test_annotations_are_types():
    assert wp.array(dtype=wp.vec3) == wp.array[wp.vec3] == wp.array1d[wp.vec3]
    assert wp.array(dtype=float, ndim=2) == wp.array2d(dtype=float) == wp.array2d[float]
    assert wp.array(dtype=float) != wp.array(dtype=int)
    assert hash(wp.array(dtype=float)) == hash(wp.array[float])
    assert repr(wp.array3d(dtype=float)) == "wp.array3d[wp.float32]"
    assert (wp.array4d(dtype=int).ndim, wp.array4d(dtype=int).dtype) == (4, wp.int32)
    with pytest.raises(TypeError):
        wp.array(dtype=str)
    with pytest.raises(ValueError):
        wp.array(dtype=float, ndim=5)


def test_arrays_ascend_in_memory():
    source = data_of(4, 3)
    x = wp.array(source, dtype=float, device="cpu")
    with pytest.raises(NotImplementedError, match="Negative strides.*copy the elements"):
        last = x.ptr + x.strides[0] * 3
        wp.array(ptr=last, shape=4, strides=(-x.strides[0],), dtype=float, device="cpu")
    np.testing.assert_array_equal(
        wp.array(source[::-1], dtype=float, device="cpu").numpy(), source[::-1]
    )


def test_aliasing_numpy():
    source = data_of(4, 3)
    array = wp.array(source, dtype=wp.vec3, device="cpu", copy=False)
    source[1, 1] = 50
    assert array.numpy()[1, 1] == 50
    array.numpy()[2, 2] = 60
    assert source[2, 2] == 60
    column = wp.array(source[:, 1], dtype=float, device="cpu", copy=False)
    assert column.strides == (12,) and same(column, source[:, 1])
    copied = wp.array(source, dtype=wp.vec3, device="cpu")
    source[0, 0] = 70
    assert copied.numpy()[0, 0] == 0


def test_memory_outlives_its_maker():
    view = wp.array(data_of(1000), dtype=float, device="cpu", copy=False)[10:20]
    numbers = wp.full(1000, 7.0, device="cpu").numpy()
    gc.collect()
    assert same(view, np.arange(10, 20)) and (numbers == 7).all()


def test_borrowed_memory():
    source = data_of(6)
    freed = []

    def free(pointer, size):
        freed.append((pointer, size))

    array = wp.array(
        ptr=source.ctypes.data,
        dtype=float,
        shape=3,
        strides=8,
        device="cpu",
        deleter=free,
    )
    assert same(array, [0, 2, 4])
    assert array.deleter is free and array[1:].deleter is None
    with pytest.raises(ValueError, match="capacity"):
        wp.array(ptr=source.ctypes.data, dtype=float, shape=7, capacity=24, device="cpu")
    del array
    gc.collect()
    assert freed == [(source.ctypes.data, 20)]


@pytest.mark.parametrize(
    "key",
    [
        2,
        -1,
        slice(1, 3),
        slice(None, None, 2),
        slice(-3, None),
        slice(2, 2),
        (1, 2),
        (slice(None), 1),
        (slice(1, 4, 2), slice(0, 2)),
        (Ellipsis, 1),
        (0, Ellipsis, slice(1, 3)),
    ],
)
def test_indexing_matches_numpy(device, key):
    data = data_of(5, 4, 3)
    view = wp.array(data, dtype=float, device=device)[key]
    assert view.shape == data[key].shape and same(view, data[key])
    assert view.strides == data[key].strides or not view.size


@pytest.mark.parametrize("key", [5, -6, slice(1, 9), (0, 4), (0, 0, 0), slice(None, None, -1)])
def test_indices_out_of_bounds(device, key):
    array = wp.array(data_of(5, 4), dtype=float, device=device)
    with pytest.raises(IndexError):
        array[key]


def test_no_names_and_no_matrix_products(device):
    array = wp.zeros(3, device=device)
    with pytest.raises(TypeError):
        array["a"]
    with pytest.raises(TypeError):
        array @ array


def test_assignment_through_views(device):
    data = data_of(4, 3)
    array = wp.array(data, dtype=float, device=device)
    array[1] = 9.0
    data[1] = 9
    array[:, 2] = wp.full(4, 8.0, device=device)
    data[:, 2] = 8
    array[0, 0] = 7.0
    data[0, 0] = 7
    array[2:] = np.ones((2, 3))
    data[2:] = 1
    array[3] = [4, 5, 6]
    data[3] = [4, 5, 6]
    assert same(array, data)
    vectors = wp.zeros(3, dtype=wp.vec2, device=device)
    vectors[0] = (1, 2)
    vectors[1:] = [[3, 4], [5, 6]]
    vectors[2] = np.array([7, 8])
    assert same(vectors, [[1, 2], [3, 4], [7, 8]])
    with pytest.raises(ValueError):
        array[0] = [1, 2]


def test_reshape_flatten_transpose(device):
    data = data_of(2, 3, 4)
    array = wp.array(data, dtype=float, device=device)
    assert same(array.reshape((4, -1)), data.reshape(4, 6))
    assert same(array.reshape(24), data.ravel()) and same(array.flatten(), data.ravel())
    assert same(array.transpose(), data.T) and array.transpose().is_transposed
    assert same(array.transpose((1, 0, 2)), data.transpose(1, 0, 2))
    packed = array.transpose().contiguous()
    assert packed.is_contiguous and same(packed, data.T)
    assert array.contiguous() is array
    for bad in (7, (5, -1), (-1, -1), (2, 2)):
        with pytest.raises(ValueError):
            array.reshape(bad)
    with pytest.raises(ValueError, match="contiguous"):
        array.transpose().reshape(24)
    with pytest.raises(ValueError):
        array.transpose((0, 0, 1))


def test_views_of_other_types(device):
    array = wp.array(data_of(4, 3), dtype=wp.vec3, device=device)
    assert same(array.view(float), data_of(4, 3)) and array.view(float).shape == (4, 3)
    assert array.view(float).view(wp.vec3).shape == (4,)
    assert wp.zeros(3, device=device).view(wp.int32).dtype is wp.int32
    with pytest.raises(TypeError):
        array.view(wp.float64)
    with pytest.raises(TypeError):
        wp.zeros(6, device=device).view(wp.vec3)


@pytest.mark.parametrize(
    "dtype, value, expected",
    [
        (float, 2.5, 2.5),
        (int, np.int64(3), 3),
        (wp.bool, True, True),
        (wp.float16, 0.1, np.float16(0.1)),
        (wp.vec3, 2.0, [2, 2, 2]),
        (wp.vec3, (1, 2, 3), [1, 2, 3]),
        (wp.vec3, wp.vec3(1, 2, 3), [1, 2, 3]),
        (wp.mat22, [[1, 2], [3, 4]], [[1, 2], [3, 4]]),
        (wp.quat, (0, 0, 0, 1), [0, 0, 0, 1]),
    ],
)
def test_fill(device, dtype, value, expected):
    array = wp.zeros((4, 2), dtype=dtype, device=device)
    array[1:3].fill_(value)
    full = np.zeros_like(array.numpy())
    full[1:3] = expected
    assert same(array, full)
    array.zero_()
    assert not array.numpy().any()
    made = wp.full(2, value, dtype=dtype, device=device)
    assert same(made, np.broadcast_to(expected, full[0].shape))


def test_fill_strided(device):
    array = wp.zeros((4, 4), device=device)
    array[::2, 1::2].fill_(3.0)
    expected = np.zeros((4, 4))
    expected[::2, 1::2] = 3
    assert same(array, expected)
    array[::2].zero_()
    assert not array.numpy().any()


@pytest.mark.parametrize(
    "dtype, value", [(int, 1.5), (float, "a"), (float, None), (wp.vec3, (1, 2)), (float, (1, 2))]
)
def test_bad_fill(device, dtype, value):
    with pytest.raises((TypeError, ValueError)):
        wp.zeros(3, dtype=dtype, device=device).fill_(value)


def test_full_takes_the_type_of_its_value(device):
    assert wp.full(3, 2, device=device).dtype is wp.int32
    assert wp.full(3, True, device=device).dtype is wp.bool
    assert wp.full(3, wp.vec3(1, 2, 3), device=device).dtype is wp.vec3
    assert wp.full(3, np.float64(1), device=device).dtype is wp.float64


def test_like_and_clone(device):
    array = wp.array(data_of(2, 3), dtype=float, device=device, requires_grad=True)
    for made in (wp.zeros_like(array), wp.empty_like(array), wp.ones_like(array)):
        assert (made.shape, made.dtype, made.requires_grad) == (array.shape, array.dtype, True)
    assert same(wp.full_like(array, 4.0), np.full((2, 3), 4))
    copied = wp.clone(array.transpose(), requires_grad=False)
    assert same(copied, data_of(2, 3).T) and copied.is_contiguous and not copied.requires_grad
    assert array.to(device) is array
    assert same(array.to("cpu"), data_of(2, 3))
    with pytest.raises(TypeError):
        wp.zeros_like([1, 2])


def test_from_numpy_folds_short_rows(device):
    assert wp.from_numpy(data_of(5, 3), device=device).dtype is wp.vec3
    assert wp.from_numpy(np.zeros((5, 2, 2)), device=device).dtype is wp.mat22d
    assert wp.from_numpy(data_of(5, 7), device=device).shape == (5, 7)
    assert wp.from_numpy(data_of(5, 3), dtype=float, device=device).shape == (5, 3)


@pytest.mark.parametrize("dtype", [np.uint8, np.float16, np.float32, np.float64])
@pytest.mark.parametrize("shape", [(64, 128), (72, 200), (61, 40), (3, 40, 80)])
def test_copies_exchange_dimensions(device, dtype, shape):
    """Tiles that fit, a last group that is not full, extents that no tile divides, a stack."""
    data = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    order = (*range(len(shape) - 2), len(shape) - 1, len(shape) - 2)
    source = wp.array(data, device=device)
    turned = source.transpose(order)
    target = wp.zeros(turned.shape, dtype=source.dtype, device=device)
    wp.copy(target, turned)
    np.testing.assert_array_equal(target.numpy(), data.transpose(order))
    # The source begins in the middle of a tile.
    wp.copy(target[..., 1:], turned[..., 1:])
    np.testing.assert_array_equal(target.numpy(), data.transpose(order))


def test_copy_and_assign(device):
    source = wp.array(data_of(10), dtype=float, device=device)
    target = wp.zeros(10, device=device)
    wp.copy(target, source, dest_offset=2, src_offset=5, count=3)
    assert same(target, [0, 0, 5, 6, 7, 0, 0, 0, 0, 0])
    wp.copy(target[::2], source[5:])
    assert same(target, [5, 0, 6, 6, 7, 0, 8, 0, 9, 0])
    wp.copy(target, source)
    assert same(target, data_of(10))
    target.assign(list(range(10, 20)))
    assert same(target, np.arange(10, 20))
    grid = wp.zeros((2, 5), device=device)
    wp.copy(grid, source)
    assert same(grid, data_of(2, 5))
    vectors = wp.zeros(4, dtype=wp.vec3, device=device)
    vectors.assign(data_of(4, 3))
    assert same(vectors, data_of(4, 3))


@pytest.mark.parametrize(
    "arguments",
    [
        dict(src_offset=9, count=2),
        dict(dest_offset=9, count=2),
        dict(src_offset=-1, count=1),
        dict(count=11),
        dict(count=-1),
    ],
)
def test_copy_out_of_range(device, arguments):
    with pytest.raises(ValueError, match="out of range"):
        wp.copy(wp.zeros(10, device=device), wp.zeros(10, device=device), **arguments)


def test_bad_copies(device):
    with pytest.raises(ValueError, match="equal size"):
        wp.copy(wp.zeros(3, device=device), wp.zeros(3, dtype=wp.float64, device=device))
    with pytest.raises(TypeError):
        wp.copy(wp.zeros(3, device=device), [1, 2, 3])
    with pytest.raises(ValueError):
        wp.zeros(3, device=device).assign([1, 2, 3, 4])


def test_gradients_follow_views(device):
    array = wp.zeros((4, 3), device=device, requires_grad=True)
    assert array.grad.shape == (4, 3) and not array.grad.numpy().any()
    assert array.grad_ptr == array.grad.ptr
    row = array[1]
    row.grad.fill_(5.0)
    assert array.grad.numpy()[1].tolist() == [5, 5, 5] and array.grad.numpy().sum() == 15
    assert array.transpose().grad.shape == (3, 4)
    assert array.reshape(12).grad.shape == (12,)
    array.requires_grad = False
    assert array.grad is None and array.grad_ptr == 0
    with pytest.raises(ValueError):
        array.grad = wp.zeros(3, device=device)


def test_array_interface():
    array = wp.array(data_of(4, 3), dtype=wp.vec3, device="cpu")
    assert np.shares_memory(np.asarray(array), array.numpy())
    assert array.__array_interface__["shape"] == (4, 3)
    assert not hasattr(array, "__cuda_array_interface__")


def test_text(device):
    array = wp.zeros((2, 2), dtype=wp.vec3, device=device)
    assert repr(array) == "array(shape=(2, 2), dtype=vec3f)"
    assert str(wp.array([1, 2], dtype=int, device=device)) == "[1 2]"
    assert len(array) == 2 and bool(array) and array.size == 4 and array.capacity == 48
