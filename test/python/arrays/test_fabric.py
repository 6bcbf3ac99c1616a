"""Arrays in buckets (`wp.fabricarray`), against NumPy on the same buffers."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def double(a: wp.fabricarray[wp.vec3], out: wp.array[wp.vec3]):
    i = wp.tid()
    out[i] = 2.0 * a[i]
    a[i] = a[i] + wp.vec3(1.0)


@wp.kernel
def count(a: wp.indexedfabricarray[int]):
    wp.atomic_add(a, wp.tid(), 10)


def interface(device, pointers, counts, about):
    """The dictionary that describes one attribute, "q"."""
    attribute = {"type": about, "access": 2, "pointers": pointers, "counts": counts}
    return {"version": 1, "device": str(device), "attribs": {"q": attribute}}


def buckets(values, starts, counts, about, device):
    """An array of buckets of `values`, which start at these elements; and the memory."""
    memory = wp.array(values, device=device)
    pointers = [memory.ptr + start * memory.item_size for start in starts]
    return wp.fabricarray(interface(device, pointers, counts, about), "q"), memory


def test_kernels_read_and_write_buckets_in_their_order(device):
    values = np.arange(30, dtype=np.float32).reshape(10, 3)
    memory = wp.array(values, dtype=wp.vec3, device=device)
    pointers = [memory.ptr + 12 * start for start in (6, 0)]
    made = wp.fabricarray(interface(device, pointers, [3, 4], (True, "f4", 3, 0, "vector")), "q")
    order = [6, 7, 8, 0, 1, 2, 3]
    assert (made.shape, made.dtype, made.ndim) == ((7,), wp.vec3, 1)
    np.testing.assert_array_equal(made.numpy(), values[order])
    out = wp.zeros(7, dtype=wp.vec3, device=device)
    wp.launch(double, 7, inputs=[made], outputs=[out], device=device)
    np.testing.assert_array_equal(out.numpy(), 2 * values[order])
    values[order] += 1
    np.testing.assert_array_equal(memory.numpy(), values)


def test_chosen_elements(device):
    made, memory = buckets(
        np.arange(8, dtype=np.int32), [5, 0], [3, 2], (True, "i4", 1, 0, ""), device
    )
    chosen = made[wp.array([0, 4], dtype=int, device=device)]
    assert isinstance(chosen, wp.indexedfabricarray)
    wp.launch(count, chosen.size, inputs=[chosen], device=device)
    np.testing.assert_array_equal(memory.numpy(), [0, 11, 2, 3, 4, 15, 6, 7])
    chosen.fill_(-1)
    np.testing.assert_array_equal(made.numpy(), [-1, 6, 7, 0, -1])


@pytest.mark.parametrize(
    ("about", "dtype"),
    [
        ((True, "b", 1, 0, ""), wp.bool),
        ((True, "f2", 4, 0, "quat"), wp.quath),
        ((True, "f8", 16, 0, "matrix"), wp.mat44d),
        ((True, "u1", 2, 0, "vector"), wp.vec2ub),
    ],
)
def test_element_types(about, dtype):
    memory = wp.zeros(2, dtype=dtype, device="cpu")
    assert wp.fabricarray(interface("cpu", [memory.ptr], [2], about), "q").dtype is dtype


def test_no_elements(device):
    made = wp.fabricarray(interface(device, [], [], (True, "f4", 1, 0, "")), "q")
    assert made.shape == (0,)
    assert made.numpy().shape == (0,)
    made.fill_(1.0)


@pytest.mark.parametrize(
    ("about", "message"),
    [
        ((True, "f4", 1, 0), "must contain five elements, got 4"),
        ((True, "f4", 6, 0, "matrix"), "must have a square element count, got 6"),
        ((False, "f4", 1, 0, ""), "kernels have no type for attribute 'q'"),
        ((True, "f4", 1, 0, "vector"), "whole number of elements apart"),
    ],
)
def test_malformed(about, message):
    memory = wp.zeros(8, dtype=float, device="cpu")
    with pytest.raises(ValueError, match=message):
        wp.fabricarray(interface("cpu", [memory.ptr, memory.ptr + 10], [1, 1], about), "q")


def test_what_is_not_there_is_refused():
    memory = wp.zeros(8, dtype=wp.uint64, device="cpu")
    about = interface("cpu", [memory.ptr], [1], (True, "f4", 1, 1, ""))
    with pytest.raises(NotImplementedError, match="elements are arrays"):
        wp.fabricarray(about, "q")
    with pytest.raises(NotImplementedError, match="elements are arrays"):
        wp.fabricarrayarray(about, "q")
    with pytest.raises(ValueError, match="no attribute 'other'"):
        wp.fabricarray(about, "other")
    with pytest.raises(ValueError, match="expects a fabric array"):
        wp.indexedfabricarray(memory, memory)


class Named(wp.array):
    """A class of a program, with an argument of its own."""

    def __init__(self, *args, name, **kwargs):
        super().__init__(*args, **kwargs)
        self.name = name


def test_derived_arrays_have_plain_gradients():
    made = Named([1.0, 2.0], dtype=float, device="cpu", requires_grad=True, name="x")
    assert type(made.grad) is wp.array
    np.testing.assert_array_equal(made.grad.numpy(), [0.0, 0.0])
