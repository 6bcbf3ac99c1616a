"""Arrays of nested lists: composites beside sequences, lists that contain themselves, shapes."""

import numpy as np
import pytest

import warp as wp
from random_runs import seeds

KINDS = [wp.vec3, wp.vec2h, wp.types.vector(3, wp.bfloat16), wp.vec4d, wp.vec3i, wp.quat]
KINDS += [wp.transform, wp.mat22, wp.mat33d, wp.types.matrix((2, 3), wp.float16)]


def numbers(dtype, seed):
    """Small integers, which every type holds, in the shape of an element."""
    return np.random.default_rng(seed).integers(0, 100, dtype._shape_)


def forms(dtype, value):
    """One element in all the ways that it can be given."""
    return [
        dtype(*value.ravel().tolist()),
        value.tolist(),
        tuple(map(tuple, value.tolist())) if value.ndim == 2 else tuple(value.tolist()),
        value.astype(np.float64),
        value.astype(np.int16),
        value.astype(np.float32).tolist(),
    ]


@pytest.mark.parametrize("dtype", KINDS, ids=lambda one: one.__name__)
def test_composites_beside_sequences(device, dtype):
    """Any order of vectors, tuples, lists and NumPy arrays, in one or two dimensions."""
    for seed in seeds(12):
        rng = np.random.default_rng(seed)
        values = [numbers(dtype, 10 * seed + i) for i in range(4)]
        given = [forms(dtype, value)[rng.integers(6)] for value in values]
        for data, shape in ((given, (4,)), ([given[:2], tuple(given[2:])], (2, 2))):
            a = wp.array(data, dtype=dtype, device=device)
            assert a.shape == shape and a.dtype is dtype
            flat = a.to("cpu").flatten().list()
            assert flat == [dtype(*value.ravel().tolist()) for value in values]


@pytest.mark.parametrize("dtype", [wp.mat22, wp.mat33d, wp.types.matrix((2, 3), wp.float16)])
def test_matrices_beside_their_numbers_in_a_row(device, dtype):
    """The numbers of a matrix may stand in one sequence, row after row."""
    first, second = numbers(dtype, 1), numbers(dtype, 2)
    row = second.ravel().tolist()
    for one in (row, tuple(row), second.ravel().astype(np.float32)):
        for data in ([dtype(*first.ravel().tolist()), one], [one, dtype(*first.ravel().tolist())]):
            a = wp.array(data, dtype=dtype, device=device)
            want = [first, second] if data[1] is one else [second, first]
            np.testing.assert_array_equal(a.numpy(), want)
    with pytest.raises(TypeError, match="one type"):
        wp.array([dtype(*first.ravel().tolist()), row[:-1]], dtype=dtype, device=device)


def test_without_a_type_it_is_that_of_the_composites(device):
    a = wp.array([(1, 2), wp.vec2h(3.0, 4.0)], device=device)
    assert a.dtype is wp.float16 and a.numpy().tolist() == [[1, 2], [3, 4]]


@pytest.mark.parametrize(
    ("data", "dtype"),
    [
        ([wp.vec3(1.0), 1.0], wp.vec3),
        ([(1.0, 2.0, 3.0), wp.vec2(1.0)], wp.vec3),
        ([wp.vec3(1.0), "abc"], wp.vec3),
        ([wp.vec3(1.0), (1.0, 2.0)], None),
        ([wp.vec3(1.0), None], wp.vec3),
    ],
)
def test_what_does_not_fit_is_named(data, dtype):
    with pytest.raises((TypeError, ValueError), match="one type|expects numbers|inner dimensions"):
        wp.array(data, dtype=dtype, device="cpu")


def cyclic():
    alone, pair, behind, twice, mutual = [], [], [1.0], [], []
    alone.append(alone)
    pair.extend([pair, pair])
    behind.append(behind)
    twice.append(([[1.0, 2.0]], twice))
    mutual.append((mutual,))
    return [alone, pair, behind, twice, mutual]


@pytest.mark.parametrize("case", range(5))
def test_data_that_contains_itself(device, case):
    """An error wherever nested sequences are read, and no hang."""
    x = cyclic()[case]
    a = wp.zeros(5, dtype=float, device=device)
    v = wp.zeros((2, 3), dtype=wp.vec3, device=device)
    some = wp.indexedarray(a, [wp.array([1, 3], dtype=int, device=device)])
    uses = [
        lambda: wp.array(x, device=device),
        lambda: wp.array(x, dtype=wp.vec3, device=device),
        lambda: wp.array([wp.vec3(), x], dtype=wp.vec3, device=device),
        lambda: wp.array(x, dtype=float, shape=(2, 2), device=device),
        lambda: a.assign(x),
        lambda: some.assign(x),
        lambda: a.__setitem__(slice(0, 2), x),
        lambda: v.fill_(x),
        lambda: wp.full(3, x, dtype=wp.vec2, device=device),
        lambda: wp.vec3(x),
        lambda: wp.mat22(x),
        lambda: wp.vec2(x, 1.0),
        lambda: wp.normalize(x),
    ]
    for use in uses:
        with pytest.raises((TypeError, ValueError)):
            use()


def test_a_list_may_stand_at_many_places(device):
    """That is no list in itself: equal rows, and equal matrices of rows."""
    row = [1.0, 2.0]
    data = [[[row, row], [row, row]]] * 3
    np.testing.assert_array_equal(wp.array(data, device=device).numpy(), np.array(data))
    deep = [[[[[[1.0, 2.0]] * 2] * 2] * 2] * 2]
    with pytest.raises(ValueError, match="1 to 4 dimensions"):
        wp.array(deep, device=device)


@pytest.mark.parametrize(
    ("given", "dtype", "shape"),
    [
        ((0, 13), wp.types.vector(12, float), (1, 0)),
        ((6, 6), wp.mat33, (4,)),
        ((6, 6), wp.mat33, (2, 2)),
        ((4, 5), wp.vec2, (10,)),
        ((4, 5), wp.vec2, (5, -1)),
        ((3, 4), wp.vec3, 4),
        ((2, 6), wp.mat22, (3, 1)),
        ((14,), wp.transform, (2,)),
        ((3, 4), float, (2, 6)),
        ((2, 2, 2, 2, 3), wp.vec3, (16,)),
        ((0,), wp.vec3, (0, 7)),
    ],
)
@pytest.mark.parametrize("source", ["numpy", "strided", "list", "array"])
def test_an_explicit_shape_counts_whatever_the_data_is_nested_like(
    device, given, dtype, shape, source
):
    """Elements are those of the data in row-major order."""
    data = np.arange(np.prod(given), dtype=np.float32).reshape(given)
    if source == "array" and data.ndim > 4:
        data = data.reshape(-1)
    forms = {
        "numpy": lambda: data,
        "strided": lambda: np.stack([data, data], axis=-1)[..., 0],
        "list": data.tolist,
        "array": lambda: wp.array(data, dtype=float, device=device),
    }
    for share in (True, False):
        a = wp.array(forms[source](), dtype=dtype, shape=shape, device=device, copy=share)
        wanted = np.empty(a.size).reshape(shape).shape
        assert a.shape == wanted and a.dtype is (wp.float32 if dtype is float else dtype)
        np.testing.assert_array_equal(a.numpy().ravel(), data.ravel())


def test_memory_is_shared_where_that_is_asked_for():
    data = np.zeros((6, 6), dtype=np.float32)
    a = wp.array(data, dtype=wp.mat33, shape=(4,), device="cpu", copy=False)
    a.fill_(2.0)
    assert (data == 2).all()
    b = wp.array(a, dtype=wp.mat33, shape=(2, 2), device="cpu", copy=False)
    same = wp.array(data, device="cpu", copy=False)
    c = wp.array(same, dtype=wp.vec2, shape=(18,), device="cpu", copy=False)
    assert a.ptr == b.ptr == c.ptr == data.ctypes.data
    data[:] = 3
    assert (c.numpy() == 3).all() and b.shape == (2, 2)


@pytest.mark.parametrize(
    ("given", "dtype", "shape"), [((4, 5), wp.vec2, (9,)), ((5,), wp.vec2, (-1,)), ((6,), int, 5)]
)
def test_a_shape_of_other_numbers_is_named(given, dtype, shape):
    for data in (np.zeros(given, np.float32), wp.zeros(given, dtype=float, device="cpu")):
        with pytest.raises(ValueError, match=r"expects .*shape"):
            wp.array(data, dtype=dtype, shape=shape, device="cpu")


PAIR = wp.types.vector(2, wp.uint64)
MOST = 2**64 - 1


@pytest.mark.parametrize(
    ("data", "dtype", "expected"),
    [
        ([MOST, 0], wp.uint64, [MOST, 0]),
        ((2**63 + 1, 5), wp.uint64, [2**63 + 1, 5]),
        ([[MOST, 1], [2, 3]], wp.uint64, [[MOST, 1], [2, 3]]),
        ([[MOST, 1], [2, 3]], PAIR, [[MOST, 1], [2, 3]]),
        ([PAIR(MOST, 1), [3, 2**63 + 1]], PAIR, [[MOST, 1], [3, 2**63 + 1]]),
        ([wp.uint64(MOST), wp.uint64(0)], wp.uint64, [MOST, 0]),
        ([np.uint64(MOST), 0], wp.uint64, [MOST, 0]),
        ([2**62 + 1, 0.5], wp.int64, [2**62 + 1, 0]),
        ([-(2**62) - 1, 7.9], wp.int64, [-(2**62) - 1, 7]),
        ([1.0e19, 1.5], wp.uint64, [10**19, 1]),
    ],
)
def test_integers_beyond_those_of_floats(data, dtype, expected):
    """NumPy makes floats of such lists, which hold 53 bits."""
    assert wp.array(data, dtype=dtype, device="cpu").numpy().tolist() == expected
    kept = wp.zeros_like(wp.array(data, dtype=dtype, device="cpu"))
    kept.assign(data)
    assert kept.numpy().tolist() == expected


@pytest.mark.parametrize(
    ("data", "dtype", "value"),
    [([MOST, -1], wp.uint64, -1), ([2**63, -1], wp.int64, 2**63), ([MOST, 0], wp.int64, MOST)],
)
def test_integers_beyond_the_element_type(data, dtype, value):
    with pytest.raises(OverflowError, match=f"{value} does not fit"):
        wp.array(data, dtype=dtype, device="cpu")


@pytest.mark.parametrize("dtype", [None, wp.uint64, wp.vec2ul, wp.int8])
def test_integers_beyond_64_bits(dtype):
    with pytest.raises(OverflowError, match="18446744073709551616 (does not fit|fits no integer)"):
        wp.array([[2**64, 1], [2, 3]], dtype=dtype, device="cpu")


def test_large_integers_become_floats():
    given = [2**64 + 2**20, 1, -(2**70)]
    made = wp.array(given, dtype=wp.float64, device="cpu").numpy()
    assert made.tolist() == [float(one) for one in given]
    with pytest.raises(OverflowError, match="an integer of 1025 bits does not fit 'float64'"):
        wp.array([2**1024], dtype=wp.float64, device="cpu")


@wp.struct
class Counter:
    number: wp.uint64


def set_component(number):
    wp.vec2ul()[1] = number


def set_field(number):
    Counter().number = number


@pytest.mark.parametrize("bits", [63, 64, 1400, 17000])
@pytest.mark.parametrize(
    "store",
    [
        wp.uint64,
        wp.int8,
        wp.vec2ul,
        lambda number: wp.vec2ul(1, number),
        set_component,
        set_field,
        lambda number: wp.full(3, number, dtype=wp.uint64, device="cpu"),
        lambda number: wp.full(3, number, dtype=wp.vec2ul, device="cpu"),
        lambda number: wp.full_like(wp.zeros(3, dtype=wp.int8, device="cpu"), number),
        lambda number: wp.zeros(6, dtype=wp.int64, device="cpu")[::2].fill_(number),
    ],
)
def test_numbers_that_no_integer_type_holds(store, bits):
    with pytest.raises((OverflowError, ValueError), match="does not fit|is too large"):
        store(-(2**63) - 1 if bits == 63 else 2**bits)


@pytest.mark.parametrize(
    ("dtype", "number"),
    [(wp.int8, 300), (wp.uint8, -1), (wp.uint64, -(2**63)), (wp.int64, 2**64 - 1)],
)
def test_numbers_of_64_bits_wrap(dtype, number):
    bits = dtype._bits_
    wrapped = number % 2**bits
    if dtype in (wp.int8, wp.int64) and wrapped >= 2 ** (bits - 1):
        wrapped -= 2**bits
    assert wp.full(1, number, dtype=dtype, device="cpu").numpy().tolist() == [wrapped]
    assert int(dtype(number)) == wrapped
    assert wp.full(1, 2**64, dtype=wp.bool, device="cpu").numpy().tolist() == [True]


@pytest.mark.parametrize("number", [2**64, -(2**63) - 1])
@pytest.mark.parametrize("dtype", ["uint64", "int8"])
def test_literals_that_no_integer_type_holds(dtype, number):
    text = f"def keep(x: wp.array(dtype=wp.{dtype})):\n    x[0] = wp.{dtype}({number})\n"
    x = wp.zeros(1, dtype=getattr(wp, dtype), device="cpu")
    with pytest.raises(OverflowError, match=f"2:12: integer {number} does not fit 64 bits"):
        wp.launch(wp.kernel(source=text), 1, [x], device="cpu")
