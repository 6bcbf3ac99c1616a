"""Parts of tiles by `slice(...)`, conversions in assignments, sums of structs, and refusals."""

import typing

import numpy as np
import pytest

import warp as wp


@wp.struct
class Inner:
    x: float
    y: wp.vec3


@wp.struct
class Outer:
    inner: Inner
    count: int


@wp.kernel
def slices(a: wp.array2d[float], b: wp.array2d[float], c: wp.array2d[float], d: wp.array[float]):
    t = wp.tile_load(a, shape=(6, 8))
    wp.tile_store(b, wp.tile_view(t, offset=(slice(1, -1, 2), slice(None, 3))))
    wp.tile_store(c, wp.tile_view(t, (slice(-2, None), slice(8))))
    wp.tile_store(d, wp.tile_view(t, (2, slice(6, 1, -2))))


@wp.kernel
def assigns(a: wp.array[wp.float64], out: wp.array[float]):
    t = wp.tile_zeros(shape=8, dtype=float)
    wp.tile_assign(t, wp.tile_load(a, shape=4), offset=2)
    wp.tile_store(out, t)


@wp.kernel(enable_backward=False)
def sums(a: wp.array[Outer], out: wp.array[Outer]):
    wp.tile_store(out, wp.tile_sum(wp.tile_load(a, shape=8)))


def test_slices_as_arguments(device):
    a = np.arange(48, dtype=np.float32).reshape(6, 8)
    expected = [a[1:-1:2, :3], a[-2:, :8], a[2, 6:1:-2]]
    found = [wp.zeros(one.shape, dtype=float, device=device) for one in expected]
    given = wp.array(a, device=device)
    wp.launch_tiled(slices, dim=[1], inputs=[given, *found], block_dim=32, device=device)
    for one, wanted in zip(found, expected):
        np.testing.assert_array_equal(one.numpy(), wanted)


def test_numbers_convert_when_they_are_assigned(device):
    a = np.array([0.1, 1e300, -2.5, 3.0])
    out = wp.zeros(8, dtype=float, device=device)
    given = wp.array(a, device=device, requires_grad=True)
    out.requires_grad = True
    with wp.Tape() as tape:
        wp.launch_tiled(assigns, [1], inputs=[given, out], block_dim=32, device=device)
    with np.errstate(over="ignore"):
        np.testing.assert_array_equal(out.numpy(), [0, 0, *a.astype(np.float32), 0, 0])
    tape.backward(grads={out: wp.array(np.arange(8, dtype=np.float32), device=device)})
    np.testing.assert_array_equal(given.grad.numpy(), [2, 3, 4, 5])


def test_structs_add_up_field_by_field():
    values = np.zeros(8, Outer.numpy_dtype())
    values["count"] = np.arange(8)
    values["inner"]["x"] = np.arange(8) * 0.5
    values["inner"]["y"] = np.arange(24).reshape(8, 3)
    out = wp.zeros(1, dtype=Outer, device="cpu")
    given = wp.array(values, dtype=Outer, device="cpu")
    wp.launch_tiled(sums, [1], inputs=[given, out], block_dim=32, device="cpu")
    found = out.numpy()[0]
    assert found["count"] == 28
    assert found["inner"]["x"] == 14.0
    np.testing.assert_array_equal(found["inner"]["y"], values["inner"]["y"].sum(axis=0))


@wp.func
def doubled(t: wp.tile[float]):
    return t * 2.0


@wp.func
def first_row(t: wp.tile[float, typing.Literal[2], 4]) -> wp.tile[float, 4]:
    return t[0]


@wp.kernel
def through_functions(a: wp.array2d[float], out: wp.array[float]):
    t = wp.tile_load(a, shape=(2, 4))
    wp.tile_store(out, doubled(first_row(doubled(t))))


def test_parameters_of_any_shape(device):
    a = np.arange(8, dtype=np.float32).reshape(2, 4)
    out = wp.zeros(4, dtype=float, device=device)
    given = wp.array(a, device=device)
    wp.launch_tiled(through_functions, [1], inputs=[given, out], block_dim=32, device=device)
    np.testing.assert_array_equal(out.numpy(), 4 * a[0])


def scan(t: wp.array[Inner]):
    wp.tile_store(t, wp.tile_scan_inclusive(wp.tile_load(t, shape=8)))


def wide(t: wp.array[Inner]):
    wp.tile_arange(0, 1180591620717411303424, 18446744073709551616, dtype=float)


def outside(t: wp.array[Inner]):
    wp.tile_arange(0, 1099511627776, dtype=int)


def uncountable(t: wp.array[Inner]):
    wp.tile_arange(0.0, 1.0, 5.0e-324, dtype=wp.float64)


def shape_and_slice(t: wp.array[Inner]):
    wp.tile_view(wp.tile_zeros(shape=4, dtype=float), offset=slice(0, 2), shape=2)


def half_an_index(t: wp.array[Inner]):
    wp.tile_view(wp.tile_zeros(shape=4, dtype=float), offset=1.5)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (scan, "expects a tile of numbers"),
        (wide, "too wide to use as an integer bound"),
        (outside, "stop=1099511627776 is out of range of int32"),
        (uncountable, "elements, but a tile has at most"),
        (shape_and_slice, "takes the extents from slices, so no shape"),
        (half_an_index, "expects an integer as index of a tile"),
    ],
)
def test_refusals(function, words):
    kernel = wp.kernel(enable_backward=False)(function)
    given = wp.zeros(8, dtype=Inner, device="cpu")
    with pytest.raises(wp.WarpCodegenError, match=words) as problem:
        wp.launch_tiled(kernel, [1], inputs=[given], block_dim=32, device="cpu")
    assert "test_tile_slices.py" in str(problem.value)
