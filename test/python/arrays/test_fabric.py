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
    about = interface("cpu", [memory.ptr], [1], (True, "f4", 1, 2, ""))
    with pytest.raises(ValueError, match="no type for attribute 'q'"):
        wp.fabricarray(about, "q")
    about = interface("cpu", [memory.ptr], [1], (True, "f4", 1, 1, ""))
    with pytest.raises(ValueError, match="1 buckets, but 0 'array_lengths'"):
        wp.fabricarrayarray(about, "q")
    about = interface("cpu", [memory.ptr], [1], (True, "f4", 1, 0, ""))
    with pytest.raises(ValueError, match=r"expects 2 dimension\(s\), but 'q' has 1"):
        wp.fabricarrayarray(about, "q")
    with pytest.raises(ValueError, match="no attribute 'other'"):
        wp.fabricarray(about, "other")
    with pytest.raises(ValueError, match="expects a fabric array"):
        wp.indexedfabricarray(memory, memory)


@wp.kernel
def sum_rows(a: wp.fabricarrayarray(dtype=float), sums: wp.array[float]):
    i = wp.tid()
    row = a[i]
    for j in range(row.shape[0]):
        sums[i] += row[j]
    a[i, 0] = float(a.shape[0])
    wp.atomic_add(a, i, row.shape[0] - 1, 0.5)


@wp.kernel
def scale_rows(a: wp.indexedfabricarrayarray(dtype=wp.vec3), by: float):
    row = a[wp.tid()]
    for j in range(len(row)):
        row[j] = by * row[j]
        row[j].x = 0.0


def rows_in_buckets(rows, starts, counts, about, device):
    """An attribute whose elements are arrays; the memory with their addresses and lengths."""
    addresses = wp.array([row.ptr for row in rows], dtype=wp.uint64, device=device)
    lengths = wp.array([row.size for row in rows], dtype=wp.uint64, device=device)
    pointers, sizes = ([one.ptr + 8 * start for start in starts] for one in (addresses, lengths))
    described = interface(device, pointers, counts, about)
    described["attribs"]["q"]["array_lengths"] = sizes
    return wp.fabricarrayarray(described, "q"), (addresses, lengths)


def test_elements_that_are_arrays(device):
    values = [np.arange(1, n + 2, dtype=np.float32) for n in range(5)]
    rows = [wp.array(one, device=device) for one in values]
    made, memory = rows_in_buckets(rows, [2, 0], [3, 2], (True, "f4", 1, 1, ""), device)
    assert (made.shape, made.size, made.dtype, made.ndim) == ((5,), 5, wp.float32, 2)
    assert isinstance(made, wp.fabricarray)
    sums = wp.zeros_like(made)
    wp.launch(sum_rows, 5, inputs=[made], outputs=[sums], device=device)
    order = [2, 3, 4, 0, 1]
    np.testing.assert_array_equal(sums.numpy(), [values[i].sum() for i in order])
    for one, row in zip(values, rows, strict=True):
        one[0] = 5.0
        one[-1] += 0.5
        np.testing.assert_array_equal(row.numpy(), one)
    # The application may put other arrays there.
    memory[0].assign(np.full(5, rows[4].ptr, np.uint64))
    sums.zero_()
    wp.launch(sum_rows, 1, inputs=[made], outputs=[sums], device=device)
    assert sums.numpy()[0] == values[4][:3].sum()


def test_chosen_arrays(device):
    values = [np.arange(3 * n, dtype=np.float32).reshape(n, 3) for n in (1, 2, 3)]
    rows = [wp.array(one, dtype=wp.vec3, device=device) for one in values]
    made, _memory = rows_in_buckets(rows, [0], [3], (True, "f4", 3, 1, "vector"), device)
    chosen = made[wp.array([2, 0], dtype=int, device=device)]
    assert isinstance(chosen, wp.indexedfabricarray)
    assert (chosen.shape, chosen.dtype, chosen.ndim) == ((2,), wp.vec3, 2)
    wp.launch(scale_rows, 2, inputs=[chosen, 2.0], device=device)
    for i in (0, 2):
        values[i] *= 2
        values[i][:, 0] = 0
    for one, row in zip(values, rows, strict=True):
        np.testing.assert_array_equal(row.numpy(), one)
    for refused in (made.numpy, chosen.list, lambda: made.fill_(0.0)):
        with pytest.raises(TypeError, match="has arrays as elements"):
            refused()


class Named(wp.array):
    """A class of a program, with an argument of its own."""

    def __init__(self, *args, name, **kwargs):
        super().__init__(*args, **kwargs)
        self.name = name


def test_derived_arrays_have_plain_gradients():
    made = Named([1.0, 2.0], dtype=float, device="cpu", requires_grad=True, name="x")
    assert type(made.grad) is wp.array
    np.testing.assert_array_equal(made.grad.numpy(), [0.0, 0.0])
