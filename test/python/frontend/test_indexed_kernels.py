"""Indexed arrays in kernels: accesses, functions, structs, and what is found wrong."""

import contextlib
import typing

import numpy as np
import pytest

import warp as wp
from warp.extend import errors


@wp.struct
class Holder:
    a: wp.indexedarray(dtype=float)


@wp.struct
class Outer:
    inner: Holder


@wp.func
def squared(a: wp.indexedarray2d(dtype=float), i: int, j: int):
    return a[i, j] * a[i, j]


@wp.func
def last(a: wp.indexedarray(dtype=typing.Any)):
    return a[-1]


@wp.kernel
def nested(o: Outer):
    o.inner.a[0] = 1.0


@wp.kernel
def square(x: wp.indexedarray(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


def ints(values, device):
    return wp.array(values, dtype=int, device=device)


def floats(values, device):
    return wp.array(values, dtype=float, device=device, requires_grad=True)


def test_accesses_of_every_rank(device):
    @wp.kernel
    def change1(a: wp.indexedarray(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = a[i]
        a[i] = a[i] + 1.0
        a[i] += 10.0
        wp.atomic_add(a, i, 100.0)

    @wp.kernel
    def change2(a: wp.indexedarray2d(dtype=float), y: wp.array2d(dtype=float)):
        i, j = wp.tid()
        row = a[i]
        y[i, j] = row[j]
        row[j] = row[j] + 1.0
        a[i][j] += 10.0
        wp.atomic_add(a, i, j, 100.0)

    @wp.kernel
    def change3(a: wp.indexedarray3d(dtype=float), y: wp.array3d(dtype=float)):
        i, j, k = wp.tid()
        y[i, j, k] = a[i][j][k]
        a[i, j][k] = a[i][j, k] + 1.0
        a[i][j][k] += 10.0
        wp.atomic_add(a[i], j, k, 100.0)

    @wp.kernel
    def change4(a: wp.indexedarray4d(dtype=float), y: wp.array4d(dtype=float)):
        i, j, k, m = wp.tid()
        y[i, j, k, m] = a[i, j][k][m]
        a[i][j, k, m] = a[i, j, k][m] + 1.0
        a[i, j, k, m] += 10.0
        wp.atomic_add(a[i][j], k, m, 100.0)

    shape, chosen = (3, 5, 4, 6), ([2, 0], None, [1, -1], [5, 0, 2])
    for rank, kernel in enumerate((change1, change2, change3, change4), 1):
        values = np.arange(np.prod(shape[:rank]), dtype=np.float32).reshape(shape[:rank])
        data = wp.array(values, device=device)
        given = [None if one is None else ints(one, device) for one in chosen[:rank]]
        some = wp.indexedarray(data, given)
        y = wp.zeros(some.shape, dtype=float, device=device)
        wp.launch(kernel, some.shape, [some], [y], device=device)
        places = np.ix_(
            *[
                np.arange(extent) if one is None else one
                for one, extent in zip(chosen, shape[:rank], strict=False)
            ]
        )
        np.testing.assert_array_equal(y.numpy(), values[places])
        values[places] += 111.0
        np.testing.assert_array_equal(data.numpy(), values)


def test_extents(device):
    @wp.kernel
    def measure(a: wp.indexedarray3d(dtype=wp.vec3), y: wp.array(dtype=int)):
        row = a[0]
        y[0] = a.shape[0]
        y[1] = a.shape[1]
        y[2] = a.shape[2]
        y[3] = len(a)
        y[4] = a.size
        y[5] = a.ndim
        y[6] = row.shape[0]
        y[7] = row.shape[1]
        y[8] = a[0, 0].size
        y[9] = a.dtype.length

    data, three = wp.zeros((5, 6, 7), dtype=wp.vec3, device=device), ints([1, 2, 3], device)
    for indices, expected in [
        ([three, None, None], (3, 6, 7)),
        ([None, three, three], (5, 3, 3)),
        ([None, None, three], (5, 6, 3)),
        ([three, ints([], device), None], (3, 0, 7)),
    ]:
        y = wp.zeros(10, dtype=int, device=device)
        wp.launch(measure, 1, [wp.indexedarray(data, indices)], [y], device=device)
        n, m, k = expected
        np.testing.assert_array_equal(y.numpy(), [n, m, k, n, n * m * k, 3, m, k, k, 3])


def test_components_and_negative_indices(device):
    @wp.kernel
    def update(a: wp.indexedarray(dtype=wp.vec3), y: wp.array(dtype=wp.vec3)):
        a[-1].x = 5.0
        a[0][2] += 2.0
        y[0] = a[-2]

    data = wp.array(np.arange(12.0).reshape(4, 3), dtype=wp.vec3, device=device)
    y = wp.zeros(1, dtype=wp.vec3, device=device)
    wp.launch(update, 1, [data[ints([3, 1, -4], device)]], [y], device=device)
    np.testing.assert_array_equal(data.numpy(), [[5, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 13]])
    np.testing.assert_array_equal(y.numpy(), [[3, 4, 5]])


def test_functions_and_generic_kernels(device):
    @wp.kernel
    def apply(a: wp.indexedarray2d(dtype=float), y: wp.array2d(dtype=float)):
        i, j = wp.tid()
        y[i, j] = squared(a, i, j) + last(a[i])

    @wp.kernel
    def increase(a: typing.Any):
        i = wp.tid()
        a[i] = a[i] + a.dtype(1)

    @wp.kernel
    def double(a: wp.indexedarray(dtype=wp.Float)):
        i = wp.tid()
        a[i] = a[i] + a[i]

    data = floats(np.arange(6.0).reshape(2, 3), device)
    y = wp.zeros((2, 2), dtype=float, device=device)
    wp.launch(apply, (2, 2), [data[:, ints([2, 1], device)]], [y], device=device)
    np.testing.assert_array_equal(y.numpy(), [[4 + 1, 1 + 1], [25 + 4, 16 + 4]])
    for dtype in (wp.float64, wp.int16):
        plain = wp.zeros(4, dtype=dtype, device=device)
        wp.launch(increase, 4, [plain], device=device)
        wp.launch(increase, 2, [plain[ints([3, 0], device)]], device=device)
        np.testing.assert_array_equal(plain.numpy(), [2, 1, 1, 2])
    for made in (wp.overload(double, [wp.indexedarray(dtype=wp.float64)]), double):
        plain = wp.full(3, 1.5, dtype=wp.float64, device=device)
        wp.launch(made, 1, [plain[ints([1], device)]], device=device)
        np.testing.assert_array_equal(plain.numpy(), [1.5, 3, 1.5])
    with pytest.raises(TypeError, match=r"expects a type for"):
        wp.overload(double, [wp.array(dtype=wp.float64)])


def test_structs(device):
    @wp.kernel
    def from_nested(o: Outer, y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = o.inner.a[i]
        o.inner.a[i] = -1.0

    @wp.kernel
    def from_memory(all: wp.array(dtype=Outer), y: wp.array(dtype=float)):
        i = wp.tid()
        one = all[1]
        y[i] += one.inner.a[i] * 10.0

    data = floats(np.arange(5.0), device)
    outer = Outer(inner=Holder(a=data[ints([4, 2], device)]))
    y = wp.zeros(2, dtype=float, device=device)
    items = wp.array([Outer(), outer], dtype=Outer, device=device)
    wp.launch(from_memory, 2, [items], [y], device=device)
    np.testing.assert_array_equal(y.numpy(), [40, 20])
    wp.launch(from_nested, 2, [outer], [y], device=device)
    np.testing.assert_array_equal(y.numpy(), [4, 2])
    np.testing.assert_array_equal(data.numpy(), [0, 1, -1, 3, -1])


def test_none_stands_for_no_elements(device):
    @wp.kernel
    def choose(a: wp.indexedarray2d(dtype=float), x: wp.array(dtype=float)):
        if a:
            x[0] = a[0, 0]
        else:
            x[0] = 10.0 + float(a.shape[0] + a.size)

    x = wp.zeros(1, dtype=float, device=device)
    some = wp.full((2, 2), 3.0, dtype=float, device=device)[ints([1], device)]
    for value, expected in ((None, 10.0), (some, 3.0), (None, 10.0)):
        wp.launch(choose, 1, [value, x], device=device)
        assert x.numpy() == expected
    with wp.Tape():
        wp.launch(choose, 1, [None, x], device=device)
    assert x.numpy() == 10.0


def test_recorded_launches(device):
    x, y = floats(np.arange(5.0), device), wp.zeros(2, dtype=float, device=device)
    some = x[ints([4, 2], device)]
    command = wp.launch(square, 2, [some], [y], device=device, record_cmd=True)
    command.launch()
    np.testing.assert_array_equal(y.numpy(), [16, 4])
    command.set_param_by_name("x", x[ints([1, 3], device)])
    command.launch()
    np.testing.assert_array_equal(y.numpy(), [1, 9])


# Mistakes.


def check_blamed(kernel, inputs, device, *words):
    with pytest.raises(errors.WarpError) as caught:
        wp.launch(kernel, 3, inputs, device=device)
        wp.synchronize_device(device)
    message = str(caught.value)
    number = int(message.split("test_indexed_kernels.py:")[1].split(":")[0].split()[0])
    with open(__file__, encoding="utf-8") as file:
        assert "y[i] = x[i] * x[i]" in file.readlines()[number - 1], message
    for word in words:
        assert word in message, message


def test_debug_mode_finds_indices_out_of_bounds(device, monkeypatch):
    monkeypatch.setattr(wp.config, "mode", "debug")
    x, y = wp.zeros(4, dtype=float, device=device), wp.zeros(3, dtype=float, device=device)
    check_blamed(square, [x[ints([1, 2], device)], y], device, "(2,)", "'x.indices0' of shape (2,)")
    check_blamed(square, [x[ints([1, 9, 2], device)], y], device, "(9,)", "'x.data' of shape (4,)")


def test_arguments_that_do_not_fit(device):
    x, y = wp.zeros(4, dtype=float, device=device), wp.zeros(3, dtype=float, device=device)
    some = x[ints([1], device)]
    with pytest.raises(TypeError, match=r"'x' expects 'indexedarray\(dtype=float32\)', but got"):
        wp.launch(square, 1, [x], [y], device=device)
    with pytest.raises(TypeError, match=r"'y' expects 'array\(.*but got 'indexedarray"):
        wp.launch(square, 1, [some], [some], device=device)
    with pytest.raises(TypeError, match="expects 'indexedarray"):
        wp.launch(square, 1, [wp.zeros((2, 2), device=device)[ints([1], device)]], [y])

    @wp.kernel
    def generic(a: wp.indexedarray(dtype=typing.Any)):
        a[0] = a[0]

    with pytest.raises(TypeError, match=r"'a' of kernel .* expects 'indexedarray\(dtype=.*Any\)'"):
        wp.launch(generic, 1, [x], device=device)
    with wp.Tape(), pytest.raises(TypeError, match="'x' expects 'indexedarray"):
        wp.launch(square, 1, [x], [y], device=device)
    for watch in (wp.Tape(), contextlib.nullcontext()):
        with watch, pytest.raises(TypeError, match="'o' expects 'Outer', but got 'None'"):
            wp.launch(nested, 1, [None], device=device)


@pytest.mark.cuda
def test_arguments_of_other_devices():
    some = wp.zeros(4, dtype=float, device="cpu")[ints([1], "cpu")]
    y = wp.zeros(1, dtype=float, device="cuda:0")
    with pytest.raises(TypeError, match="holds an array on 'cpu', the launch is on 'cuda:0'"):
        wp.launch(square, 1, [some], [y], device="cuda:0")


def test_what_kernels_cannot_do_with_them(device):
    @wp.kernel
    def slices(a: wp.indexedarray(dtype=float)):
        b = a[1:3]

    @wp.kernel
    def rows(a: wp.indexedarray2d(dtype=float)):
        a[0] = 1.0

    @wp.kernel
    def fields(a: wp.indexedarray(dtype=float)):
        b = a.indices0

    @wp.kernel
    def address(a: wp.indexedarray(dtype=float)):
        b = a.ptr

    @wp.kernel
    def indices(a: wp.indexedarray(dtype=float)):
        a[0, 1] = 1.0

    one = wp.zeros(4, dtype=float, device=device)[ints([1], device)]
    two = wp.zeros((4, 4), dtype=float, device=device)[ints([1], device)]
    for kernel, argument, message in [
        (slices, one, "a slice of an indexed array is not supported"),
        (rows, two, r"cannot assign to a whole 'indexedarray\(dtype=float32\)'"),
        (fields, one, "has no attribute 'indices0'"),
        (address, one, "(?s)has no attribute 'ptr'.*hint: pass the array itself"),
        (indices, one, r"at most 1 index for 'indexedarray\(dtype=float32\)', but got 2"),
    ]:
        with pytest.raises(errors.WarpCodegenError, match=message):
            wp.launch(kernel, 1, [argument], device=device)
