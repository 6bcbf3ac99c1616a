"""Arrays indexed after slices, without memory, and by address."""

import numpy as np
import pytest

import warp as wp


@wp.struct
class Holder:
    values: wp.array(dtype=float)
    count: int


@wp.func
def total(a: wp.array(dtype=float)):
    result = float(0.0)
    for i in range(a.shape[0]):
        result += a[i]
    return result


def matrix(rows, columns):
    numbers = np.arange(rows * columns, dtype=np.float32).reshape(rows, columns)
    return numbers, wp.array(numbers, device="cpu")


def test_an_index_after_slices():
    @wp.kernel
    def kernel(a: wp.array2d(dtype=float), b: wp.array3d(dtype=float), out: wp.array(dtype=float)):
        j = wp.tid()
        out[j] = total(a[1:4, j]) + total(b[::-1, -1, j])

    numbers, a = matrix(5, 3)
    cube = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
    out = wp.zeros(3, dtype=float, device="cpu")
    wp.launch(kernel, 3, inputs=[a, wp.array(cube, device="cpu"), out], device="cpu")
    assert np.array_equal(out.numpy(), numbers[1:4].sum(0) + cube[:, -1].sum(0))


def test_the_derivative_of_a_column():
    @wp.kernel
    def kernel(a: wp.array2d(dtype=float), out: wp.array(dtype=float)):
        j = wp.tid()
        column = a[:, j]
        out[j] = column[0] * column[1]

    numbers, a = matrix(2, 4)
    a.requires_grad = True
    out = wp.zeros(4, dtype=float, requires_grad=True, device="cpu")
    with wp.Tape() as tape:
        wp.launch(kernel, 4, inputs=[a, out], device="cpu")
    tape.backward(grads={out: wp.ones(4, dtype=float, device="cpu")})
    assert np.array_equal(a.grad.numpy(), numbers[::-1])


def test_a_column_out_of_bounds_is_reported():
    @wp.kernel(module_options={"mode": "debug"})
    def kernel(a: wp.array2d(dtype=float), out: wp.array(dtype=float)):
        out[0] = total(a[:, 7])

    _, a = matrix(2, 4)
    with pytest.raises(wp.WarpError, match="out of"):
        wp.launch(kernel, 1, inputs=[a, wp.zeros(1, device="cpu")], device="cpu")
        wp.synchronize()


def test_a_struct_in_a_kernel_starts_without_arrays():
    @wp.kernel
    def kernel(x: wp.array(dtype=float), flag: int, out: wp.array(dtype=float)):
        h = Holder()
        h.count = 2
        if flag == 1:
            h.values = x
        out[0] = float(h.values.shape[0])
        if h.values:
            out[1] = h.values[h.count]

    x = wp.array([1.0, 2.0, 3.0], dtype=float, device="cpu")
    for flag, expected in ((0, [0.0, 0.0]), (1, [3.0, 3.0])):
        out = wp.zeros(2, dtype=float, device="cpu")
        wp.launch(kernel, 1, inputs=[x, flag, out], device="cpu")
        assert list(out.numpy()) == expected


def test_addresses_and_strides():
    @wp.kernel
    def kernel(
        a: wp.array2d(dtype=float), found: wp.array(dtype=wp.uint64), out: wp.array(dtype=float)
    ):
        found[0] = a.ptr
        found[1] = wp.address_of(a[1, 2])
        out[0] = float(a.strides[0])
        flat = wp.array(ptr=a.ptr, shape=(3, 4), dtype=float)
        out[1] = flat[2, 3]

    numbers, a = matrix(4, 3)
    found = wp.zeros(2, dtype=wp.uint64, device="cpu")
    out = wp.zeros(2, dtype=float, device="cpu")
    wp.launch(kernel, 1, inputs=[a, found, out], device="cpu")
    assert list(found.numpy()) == [a.ptr, a.ptr + 4 * (3 + 2)]
    assert list(out.numpy()) == [12.0, numbers.reshape(3, 4)[2, 3]]


@pytest.mark.parametrize("dtype", [wp.int8, wp.uint8, wp.int16, wp.uint16])
def test_exchange_of_small_numbers(dtype):
    @wp.kernel
    def kernel(a: wp.array(dtype=dtype), won: wp.array(dtype=int)):
        if wp.atomic_cas(a, 1, dtype(0), dtype(wp.tid() + 1)) == dtype(0):
            wp.atomic_add(won, 0, 1)

    a = wp.zeros(3, dtype=dtype, device="cpu")
    won = wp.zeros(1, dtype=int, device="cpu")
    wp.launch(kernel, 100, inputs=[a, won], device="cpu")
    assert won.numpy()[0] == 1
    assert a.numpy()[0] == 0 and a.numpy()[2] == 0 and 1 <= a.numpy()[1] <= 100
