"""Indexed arrays in Python: what they select, copies from and to them, what cannot be one."""

import typing

import numpy as np
import pytest

import warp as wp

mat23d = wp.types.matrix((2, 3), wp.float64)


@wp.struct
class Holder:
    numbers: wp.indexedarray(dtype=float)
    mass: wp.float16
    others: wp.array(dtype=int)


@wp.struct
class Outer:
    inner: Holder
    table: wp.indexedarray2d(dtype=wp.vec2)


def ints(values, device):
    return wp.array(values, dtype=int, device=device)


def whole(values, indices):
    """NumPy's copy of the elements at the indices of each dimension, all of one without."""
    places = [
        np.arange(extent) if given is None else np.array(given, int)
        for given, extent in zip(indices, values.shape, strict=True)
    ]
    return values[np.ix_(*places)]


@pytest.mark.parametrize(
    "indices",
    [
        ([2, 0, 2], None, None),
        (None, [1], None),
        (None, None, [4, 4, 3, -1]),
        ([1, 2], [0, 3, 1], None),
        (None, [3, 0], [2]),
        ([0], [-4, 1], [1, 2, 3]),
        (None, None, None),
        ([], None, [1]),
    ],
)
def test_elements_are_those_that_numpy_selects(indices, device):
    values = np.arange(60, dtype=np.float32).reshape(3, 4, 5)
    data = wp.array(values, device=device)
    given = [None if one is None else ints(one, device) for one in indices]
    expected = whole(values, indices)
    some = wp.indexedarray(data, given)
    assert (some.shape, some.size, len(some)) == (expected.shape, expected.size, len(expected))
    assert (some.dtype, some.ndim, some.device) == (wp.float32, 3, data.device)
    assert some.data is data
    assert some.indices == [*given, None]
    np.testing.assert_array_equal(some.numpy(), expected)
    np.testing.assert_array_equal(some.contiguous().numpy(), expected)
    assert some.list() == expected.ravel().tolist()
    assert str(some) == str(expected)


def test_arrays_as_indices_of_an_array(device):
    values = np.arange(60, dtype=np.int32).reshape(3, 4, 5)
    data = wp.array(values, device=device)
    rows, columns = ints([2, 0], device), ints([1, 1, 3], device)
    for key, expected in [
        (rows, values[[2, 0]]),
        ((slice(None), columns), values[:, [1, 1, 3]]),
        ((rows, columns), values[[2, 0]][:, [1, 1, 3]]),
        ((..., columns), values[..., [1, 1, 3]]),
        ((slice(1, 3), columns, slice(0, 5, 2)), values[1:3, [1, 1, 3], ::2]),
        ((1, columns), values[1][[1, 1, 3]]),
        ((rows, -1, slice(None)), values[[2, 0], -1]),
    ]:
        assert type(data[key]) is wp.indexedarray
        np.testing.assert_array_equal(data[key].numpy(), expected)


@pytest.mark.parametrize("dtype", [wp.bool, wp.int8, wp.float16, wp.uint64, wp.vec3h, mat23d])
def test_writes_go_to_the_chosen_elements(dtype, device):
    inner = getattr(dtype, "_shape_", ())
    number = wp.zeros(1, dtype=dtype, device="cpu").numpy().dtype
    rng = np.random.default_rng(5)
    values = rng.integers(0, 2, (4, 3, *inner)).astype(number)
    data = wp.array(values, dtype=dtype, device=device)
    some = data[ints([3, 1], device), ints([0, 2], device)]
    np.testing.assert_array_equal(some.numpy(), values[[3, 1]][:, [0, 2]])
    given = rng.integers(0, 2, (2, 2, *inner)).astype(number)
    some.assign(given)
    values[np.ix_([3, 1], [0, 2])] = given
    np.testing.assert_array_equal(data.numpy(), values)
    some.fill_(1)
    values[np.ix_([3, 1], [0, 2])] = 1
    np.testing.assert_array_equal(data.numpy(), values)
    some.zero_()
    values[np.ix_([3, 1], [0, 2])] = 0
    np.testing.assert_array_equal(data.numpy(), values)


def test_item_assignment(device):
    data = wp.array(np.arange(12.0).reshape(3, 4), dtype=float, device=device)
    data[ints([2, 0], device)] = 7.0
    data[:, ints([1, 3], device)] = [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]
    data[1, ints([0, 2], device)] = wp.array([-1.0, -2.0], dtype=float, device=device)
    np.testing.assert_array_equal(data.numpy(), [[7, 1, 7, 2], [-1, 3, -2, 4], [7, 5, 7, 6]])


def test_copies(device):
    data = wp.array(np.arange(8.0), dtype=float, device=device)
    some = data[ints([6, 1, 3], device)]
    plain = wp.zeros(5, dtype=float, device=device)
    wp.copy(plain, some, dest_offset=1)
    np.testing.assert_array_equal(plain.numpy(), [0, 6, 1, 3, 0])
    wp.copy(some, plain, dest_offset=1, src_offset=3, count=2)
    np.testing.assert_array_equal(data.numpy(), [0, 3, 2, 0, 4, 5, 6, 7])
    wp.copy(data[ints([4, 5, 7], device)], some)
    np.testing.assert_array_equal(data.numpy(), [0, 3, 2, 0, 6, 3, 6, 0])
    for made in (wp.clone(some), wp.empty_like(some), wp.zeros_like(some), wp.full_like(some, 2)):
        assert (type(made), made.shape, made.dtype) == (wp.array, (3,), wp.float32)
    plain.assign(wp.indexedarray(data, [ints([0, 1, 1, 1, 0], device)]))
    np.testing.assert_array_equal(plain.numpy(), [0, 3, 3, 3, 0])
    bits = wp.zeros(3, dtype=wp.uint32, device=device)
    wp.copy(bits, some)
    np.testing.assert_array_equal(bits.numpy().view(np.float32), [6, 3, 0])
    with pytest.raises(ValueError, match=r"elements 2 to 4 are out of range for 'src' with 3"):
        wp.copy(plain, some, src_offset=2, count=2)
    with pytest.raises(ValueError, match="'src' to be one-dimensional"):
        wp.copy(plain, wp.zeros((2, 2), device=device)[ints([0], device)], src_offset=1, count=1)
    with pytest.raises(ValueError, match=r"expects shape \(3,\) to assign, but got \(5,\)"):
        some.assign(plain)


@pytest.mark.cuda
def test_copies_between_devices():
    data = wp.array(np.arange(8.0), dtype=float, device="cuda:0")
    some = data[ints([6, 1], "cuda:0")]
    there = some.to("cpu")
    assert type(there) is wp.array
    np.testing.assert_array_equal(there.numpy(), [6, 1])
    assert some.to("cuda:0") is some
    here = wp.zeros(4, dtype=float, device="cpu")
    wp.copy(here[ints([3, 0], "cpu")], some)
    np.testing.assert_array_equal(here.numpy(), [1, 0, 0, 6])
    wp.copy(some, here[ints([1, 3], "cpu")])
    np.testing.assert_array_equal(data.numpy(), [0, 6, 2, 3, 4, 5, 0, 7])


def test_structs_as_elements(device):
    one = Holder(mass=2.5, others=wp.zeros(3, dtype=int, device=device))
    data = wp.zeros(4, dtype=Holder, device=device)
    data[ints([3, 1], device)].fill_(one)
    np.testing.assert_array_equal(data.numpy()["mass"], [0, 2.5, 0, 2.5])
    expected = np.zeros(4, Holder.numpy_dtype())
    expected[[1, 3]] = one.numpy_value()
    np.testing.assert_array_equal(data.numpy(), expected)


def test_fields_of_structs(device):
    data = wp.array([1.0, 2.0, 3.0], dtype=float, device=device)
    some = data[ints([2, 0], device)]
    holder = Holder()
    assert holder.numbers is None
    holder.numbers = some
    assert holder.numbers.data is some.data
    assert holder.numbers.indices == some.indices
    outer = Outer(inner=holder)
    np.testing.assert_array_equal(outer.inner.numbers.numpy(), [3, 1])
    assert [one.ptr for one in outer.arrays()] == [data.ptr, some.indices[0].ptr]
    for wrong in (data, wp.zeros((2, 2), device=device)[ints([0], device)], 3):
        with pytest.raises(TypeError, match=r"expects 'indexedarray\(dtype=float32\)', but got"):
            holder.numbers = wrong
    holder.numbers = None
    assert holder.numbers is None
    assert list(holder.arrays()) == []


@pytest.mark.cuda
def test_structs_move_to_other_devices():
    data = wp.array([1.0, 2.0, 3.0], dtype=float, device="cpu")
    outer = Outer(inner=Holder(numbers=data[ints([2, 0], "cpu")]))
    moved = outer.to("cuda:0")
    assert moved.inner.numbers.indices == [None] * 4
    assert moved.inner.numbers.device == wp.get_device("cuda:0")
    np.testing.assert_array_equal(moved.inner.numbers.numpy(), [3, 1])
    assert moved.table is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (lambda a, i: {"data": [1.0]}, "expects an array as `data`, but got 'list'"),
        (lambda a, i: {"indices": [i]}, "expects `data` to make an indexed array"),
        (lambda a, i: {"data": a, "indices": [i, i, i]}, "expects at most 2 arrays of indices"),
        (lambda a, i: {"data": a, "indices": [[0]]}, "expects an array as indices of dimension 0"),
        (lambda a, i: {"data": a, "indices": 1}, "or a list of them, but got 'int'"),
        (lambda a, i: {"data": a, "indices": [None, a]}, "'int32' as indices of dimension 1"),
        (
            lambda a, i: {"data": a, "indices": [wp.zeros(2, dtype=wp.int64, device=i.device)]},
            r"but got one of shape \(2,\) and 'int64'",
        ),
        (lambda a, i: {"data": a, "dtype": int}, "elements of 'int32', but got 'float32'"),
        (lambda a, i: {"data": a, "ndim": 3}, r"expects 3 dimensions, but got shape \(2, 2\)"),
    ],
)
def test_what_cannot_be_one(arguments, message, device):
    a, i = wp.zeros((2, 2), dtype=float, device=device), ints([0], device)
    with pytest.raises(ValueError, match=message):
        wp.indexedarray(**arguments(a, i))


@pytest.mark.cuda
def test_indices_are_on_the_device_of_the_data():
    with pytest.raises(ValueError, match="dimension 0 on 'cuda:0' like the data, .* on 'cpu'"):
        wp.indexedarray(wp.zeros(2, device="cuda:0"), [ints([0], "cpu")])


def test_subclasses_are_indexed_arrays(device):
    class Mine(wp.indexedarray):
        pass

    data = wp.array([1.0, 2.0], dtype=float, device=device)
    mine = Mine(data, [ints([1, 1, 0], device)])
    assert type(mine) is Mine
    np.testing.assert_array_equal(mine.numpy(), [2, 2, 1])


def test_they_count_as_arrays():
    some = wp.zeros(3, device="cpu")[ints([1], "cpu")]
    for one in (some, wp.indexedarray(dtype=float)):
        assert wp.types.is_array(one) and not wp.types.type_is_array(one)
    assert wp.types.type_is_array(wp.indexedarray) and not wp.types.is_array(wp.indexedarray)


def test_annotations():
    kind = wp.indexedarray(dtype=wp.vec3, ndim=2)
    assert kind == wp.indexedarray2d(dtype=wp.vec3) == wp.indexedarray[wp.vec3, typing.Literal[2]]
    assert kind == wp.indexedarray2d[wp.vec3]
    assert kind not in (wp.array2d(dtype=wp.vec3), wp.indexedarray(dtype=wp.vec3))
    assert repr(kind) == "wp.indexedarray[wp.vec3f, Literal[2]]"
    with pytest.raises(TypeError, match="is an annotation"):
        kind(3)
    with pytest.raises(ValueError, match="1 to 4 dimensions"):
        wp.indexedarray(dtype=float, ndim=5)


def test_ranked_names(device):
    data = wp.zeros((2, 3), dtype=float, device=device)
    made = wp.indexedarray2d(data, [ints([1], device)])
    assert isinstance(made, wp.indexedarray2d)
    assert not isinstance(made, wp.indexedarray1d)
    with pytest.raises(ValueError, match=r"expects 3 dimensions, but got shape \(2, 3\)"):
        wp.indexedarray3d(data, [ints([1], device)])


def test_arithmetic(device):
    data = wp.array([1.0, 2.0, 4.0], dtype=float, device=device)
    some = data[ints([2, 0], device)]
    np.testing.assert_array_equal((some + 1.0).numpy(), [5, 2])
    np.testing.assert_array_equal((2.0 * some - some).numpy(), [4, 1])
    np.testing.assert_array_equal((-some).numpy(), [-4, -1])
    np.testing.assert_array_equal((data[:2] / some).numpy(), [0.25, 2])
    some += 10.0
    np.testing.assert_array_equal(data.numpy(), [11, 2, 14])
    wp.map(wp.neg, some, out=some)
    np.testing.assert_array_equal(data.numpy(), [-11, 2, -14])


def test_data_and_indices_can_be_replaced(device):
    """Misfits are errors that change nothing, and kernels see the rest."""
    some = wp.indexedarray(
        wp.array([1.0, 2.0, 3.0], dtype=float, device=device), ints([2, -3], device)
    )
    for name, value in {
        "data": None,
        "data ": np.zeros(3),
        "data  ": wp.zeros(3, dtype=int, device=device),
        "data   ": wp.zeros((3, 3), dtype=float, device=device),
        "indices": wp.zeros(3, dtype=float, device=device),
        "indices ": [ints([0], device)] * 2,
    }.items():
        with pytest.raises(ValueError):
            setattr(some, name.strip(), value)
    assert some.numpy().tolist() == [3.0, 1.0]
    some.data = wp.array([5.0, 6.0, 7.0], dtype=float, device=device)
    assert some.numpy().tolist() == [7.0, 5.0]
    some.indices = [ints([1], device)]
    some.fill_(9.0)
    assert some.data.numpy().tolist() == [5.0, 9.0, 7.0] and some.shape == (1,)


@pytest.mark.parametrize("bad", [3, -4, 10**8, -(2**31)])
def test_indices_that_lead_out_are_named(bad):
    """On the CPU everything but a launch looks at them."""
    data = wp.zeros(3, dtype=float, device="cpu")
    some = wp.indexedarray(data, ints([0, bad], "cpu"))
    good = wp.indexedarray(data, ints([0, 1], "cpu"))
    two = wp.zeros(2, dtype=float, device="cpu")
    uses = [
        lambda: some.numpy(),
        lambda: some.fill_(1.0),
        lambda: some.assign([1.0, 2.0]),
        lambda: wp.copy(two, some),
        lambda: wp.clone(some),
        lambda: some + 1.0,
        lambda: some.__iadd__(two),
        lambda: setattr(good, "indices", ints([bad], "cpu")),
    ]
    for use in uses:
        with pytest.raises(IndexError, match=rf"index {bad} \(number \d\) of dimension 0"):
            use()
