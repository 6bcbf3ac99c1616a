"""`wp.overload`, generic factories, and options of modules."""

import typing

import pytest

import warp as wp


@wp.kernel
def assign(x: wp.array(dtype=wp.Float), value: wp.Float):
    x[wp.tid()] = value + value


@pytest.mark.parametrize("dtype", [wp.float16, wp.float32, wp.float64])
def test_an_overload_has_the_types_chosen(device, dtype):
    by_place = wp.overload(assign, [wp.array(dtype=dtype), dtype])
    by_name = wp.overload(assign, {"x": wp.array(dtype=dtype), "value": dtype})
    assert by_place is by_name
    assert assign.add_overload([wp.array(dtype=dtype), dtype]) is by_place
    assert assign.get_overload([wp.array(dtype=dtype), dtype]) is by_place
    assert not by_place.is_generic
    x = wp.zeros(3, dtype=dtype, device=device)
    wp.launch(by_place, 3, [x, dtype(0.25)], device=device)
    assert x.numpy().tolist() == [0.5] * 3
    wrong = wp.zeros(3, dtype=wp.int32, device=device)
    with pytest.raises(wp.WarpLaunchError, match="argument 'x'"):
        wp.launch(by_place, 3, [wrong, 1], device=device)


def test_decorated_overload():
    @wp.kernel
    def scale(x: wp.array(dtype=typing.Any), value: typing.Any):
        x[0] = x[0] * value

    generic = scale

    @wp.overload
    def scale(x: wp.array(dtype=wp.vec2), value: float): ...

    assert scale is generic
    assert len(generic.overloads) == 1
    x = wp.array([[1.0, 2.0]], dtype=wp.vec2)
    wp.launch(next(iter(generic.overloads.values())), 1, [x, 4.0])
    assert x.numpy().tolist() == [[4.0, 8.0]]


def test_decorated_overload_of_a_kernel_with_a_name():
    @wp.kernel(name="another_name")
    def twice(x: wp.array(dtype=wp.Float)):
        x[0] = x[0] + x[0]

    generic = twice

    @wp.overload
    def twice(x: wp.array(dtype=wp.float16)) -> None: ...

    assert twice is generic and len(generic.overloads) == 1


def test_bad_overloads():
    def plain(x: int):
        pass

    with pytest.raises(wp.WarpError, match="not generic"):
        wp.overload(wp.Kernel(plain), [int])
    with pytest.raises(wp.WarpError, match="expects 2 types, but got 1"):
        wp.overload(assign, [float])
    with pytest.raises(wp.WarpError, match="no parameter 'y'"):
        wp.overload(assign, {"y": float})
    with pytest.raises(TypeError, match="parameter 'x' expects"):
        wp.overload(assign, [float, float])
    with pytest.raises(TypeError, match="parameter 'value' expects"):
        wp.overload(assign, [wp.array(dtype=float), int])
    with pytest.raises(TypeError, match="parameter 'value' expects"):
        wp.overload(assign, [wp.array(dtype=float), wp.Float])
    with pytest.raises(wp.WarpError, match="no generic kernel"):
        wp.overload(plain)

    def result(x: float) -> float:
        return x

    with pytest.raises(TypeError, match="return annotation"):
        wp.overload(result)
    with pytest.raises(TypeError, match="expects a generic kernel"):
        wp.overload(3)


def test_factories_leave_extents_open(device):
    @wp.func
    def total(v: wp.types.vector(length=typing.Any, dtype=wp.Float)):
        s = v[0]
        for i in range(1, len(v)):
            s += v[i]
        return s

    @wp.func
    def corner(m: wp.types.matrix((typing.Any, typing.Any), dtype=float)):
        return m[len(m) - 1, 0]

    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        out[0] = total(wp.vec2(1.0, 2.0))
        out[1] = total(wp.vec4(1.0, 2.0, 4.0, 8.0))
        out[2] = corner(wp.mat22(1.0, 2.0, 3.0, 4.0))

    out = wp.zeros(3, dtype=float, device=device)
    wp.launch(kernel, 1, [out], device=device)
    assert out.numpy().tolist() == [3.0, 15.0, 3.0]


def test_options_have_defaults():
    options = wp.get_module_options()
    assert options["enable_backward"] is True
    assert options["max_unroll"] == 16
    assert options["fast_math"] is False
    assert options["fuse_fp"] is True
    module = wp.get_module("a module of this test")
    assert module.options["enable_backward"] is True
    wp.set_module_options({"enable_backward": False, "fuse_fp": False}, module)
    assert module.options["enable_backward"] is False
    assert wp.get_module_options(module)["fuse_fp"] is False
    with pytest.raises(KeyError):
        module.options["no such option"]
