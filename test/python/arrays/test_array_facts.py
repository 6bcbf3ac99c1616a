"""Facts that launches read off arrays: found when an array is made, and again when it changes."""

import numpy as np
import pytest

import warp as wp


@wp.struct
class Pair:
    x: wp.array(dtype=float)
    y: wp.array(dtype=float)


def add(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    wp.atomic_add(y, wp.tid(), x[wp.tid()])


def add_fields(pair: Pair):
    wp.atomic_add(pair.y, wp.tid(), pair.x[wp.tid()])


N = 12


def memory():
    """Room for two arrays, and one array over the first half."""
    whole = wp.array(np.arange(2 * N), dtype=float, device="cpu")
    return whole, wp.array(ptr=whole.ptr, shape=N, dtype=float, device="cpu")


def at_pointer(whole, start):
    return wp.array(ptr=whole.ptr + 4 * start, shape=N, dtype=float, device="cpu")


def moved(whole, start):
    one = at_pointer(whole, 0)
    one.ptr = whole.ptr + 4 * start
    return one


def sliced(whole, start):
    return whole[start : start + N]


def of_numpy(whole, start):
    return whole.numpy()[start : start + N]


def launch(kernel, x, y, form):
    if form == "struct":
        pair = Pair()
        pair.x, pair.y = x, y
        wp.launch(kernel, N, [pair], device="cpu")
    elif form == "recorded":
        wp.launch(kernel, N, [x, y], device="cpu", record_cmd=True).launch()
    elif form == "descriptor":
        wp.launch(kernel, N, [x.__ctype__(), y.__ctype__()], device="cpu")
    else:
        wp.launch(kernel, N, [x, y], device="cpu")


FORMS = ["launch", "struct", "recorded", "descriptor"]
CASES = [(make, form) for make in (at_pointer, moved, sliced) for form in FORMS]
CASES.append((of_numpy, "launch"))


@pytest.mark.parametrize("make, form", CASES, ids=lambda one: getattr(one, "__name__", one))
@pytest.mark.parametrize("start", [N, N - 1, 0])
def test_overlaps_are_seen(make, form, start):
    """The last element of one array may be the first of the other."""
    function = add_fields if form == "struct" else add
    kernel = wp.Kernel(function, key=f"add_{make.__name__}_{form}_{start}")
    whole, x = memory()
    launch(kernel, x, make(whole, start), form)
    (made,) = kernel.schedule("cpu")
    assert ("arrays may overlap" in str(made)) == (start < N)


@pytest.mark.parametrize("start", [N, N - 1])
def test_a_moved_array_is_looked_at_again(start):
    """One array object, whose address is set between two launches."""
    kernel = wp.Kernel(add, key=f"add_moved_{start}")
    whole, x = memory()
    y = at_pointer(whole, N)
    wp.launch(kernel, N, [x, y], device="cpu")
    y.ptr = whole.ptr + 4 * start
    wp.launch(kernel, N, [x, y], device="cpu")
    texts = [str(one) for one in kernel.schedule("cpu")]
    assert sum("arrays may overlap" in text for text in texts) == (start < N)


def test_contiguity_follows_the_array():
    a = wp.zeros((3, 4), dtype=float, device="cpu")
    assert a.is_contiguous and a[1:].is_contiguous and not a[:, 1:].is_contiguous
    assert not a.transpose([1, 0]).is_contiguous
    a.ptr = None
    assert a.is_contiguous
