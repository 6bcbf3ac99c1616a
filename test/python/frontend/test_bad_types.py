"""Messages about types: what was given is named as it was written, and what there is instead."""

import typing

import numpy as np
import pytest

import warp as wp
from frontend_programs import define, run
from warp.extend import errors


@pytest.mark.parametrize(
    "dtype, message",
    [
        ("float32", r"got the string 'float32', use `wp\.float32`$"),
        ("f4", "got the string 'f4'$"),
        (np.int16, r"got 'numpy\.int16', use `wp\.int16`$"),
        (np.dtype("f4"), r"got dtype\('float32'\), use `wp\.float32`$"),
        (list[float], r"got 'list\[float\]'$"),
    ],
)
@pytest.mark.parametrize(
    "make",
    [
        lambda dtype: wp.zeros(3, dtype=dtype),
        lambda dtype: wp.array([1.0], dtype=dtype),
        lambda dtype: wp.array2d(dtype=dtype),
        lambda dtype: wp.types.vector(3, dtype),
        lambda dtype: wp.types.matrix((2, 2), dtype),
        lambda dtype: wp.types.quaternion(dtype),
    ],
)
def test_element_types(make, dtype, message):
    with pytest.raises(TypeError, match=message) as caught:
        make(dtype)
    assert "''" not in str(caught.value)


@pytest.mark.parametrize(
    "annotation, shown, has_way",
    [
        (typing.List[wp.vec3], r"typing\.List\[.*vec3f\]", True),  # noqa: UP006
        (list[float], r"list\[float\]", True),
        (list, "list", True),
        (np.ndarray, r"numpy\.ndarray", True),
        (typing.Sequence[int], r"typing\.Sequence\[int\]", True),  # noqa: UP006
        (dict[str, int], r"dict\[str, int\]", False),
        (typing.Optional[int], r"(typing\.Optional\[int\]|int \| None)", False),  # noqa: UP045
        ("typing.List[int]", r"typing\.List\[int\]", True),
    ],
)
def test_annotations(annotation, shown, has_way):
    """Kernels and functions alike."""

    def body(a: annotation, out: wp.array(dtype=float)):
        out[0] = 1.0

    inner = wp.func(body)

    @wp.kernel
    def caller(out: wp.array(dtype=float)):
        inner(1, out)

    for kernel in (wp.Kernel(body), caller):
        with pytest.raises(
            errors.WarpCodegenTypeError, match=f"'a' of 'body'.*'{shown}'"
        ) as caught:
            kernel.prepare()
        assert ("`wp.array(dtype=...)`" in str(caught.value)) == has_way


def test_what_functions_alone_take():
    def body(a: tuple[int, float]):
        pass

    with pytest.raises(TypeError, match=r"is a 'tuple\[int, float\]', which functions alone take"):
        wp.Kernel(body).prepare()


@wp.func
def several(a: int, b: wp.vec2):
    return 1.0


@wp.func
def several(a: float, b: wp.vec3):  # noqa: F811
    return 2.0


@pytest.mark.parametrize(
    "call, shown",
    [
        ("several(1, b=wp.vec3())", "'int32', b='vec3f'"),
        ("several(b=wp.vec3(), a=1)", "b='vec3f', a='int32'"),
        ("wp.curlnoise(wp.uint32(1), xy=wp.vec3())", "'uint32', xy='vec3f'"),
        ("wp.curlnoise(state=wp.uint32(1), xyz=wp.vec2())", "state='uint32', xyz='vec2f'"),
    ],
)
def test_arguments_by_name(call, shown):
    source = f"""
@wp.kernel
def kernel(out: wp.array(dtype=float)):
    x = {call}
"""
    with pytest.raises(TypeError, match=rf"no overload of '\w+' takes \({shown}\)"):
        run(define(source, several=several)["kernel"])
    if "curlnoise" in call:
        with pytest.raises(TypeError, match=rf"no overload of 'curlnoise' takes \({shown}\)"):
            eval(call)


@pytest.mark.parametrize(
    "left, op, right, way",
    [
        ("wp.vec3()", "@", "wp.vec3()", "`wp.dot(a, b)`"),
        ("wp.vec2()", "*", "wp.vec2()", "`wp.cw_mul(a, b)`"),
        ("wp.vec2()", "@", "wp.vec3()", "`wp.dot(a, b)`"),
        ("wp.quat()", "*", "wp.vec3()", "`wp.quat_rotate(q, v)`"),
        ("wp.transform()", "@", "wp.vec3()", "`wp.transform_point(t, v)`"),
        ("wp.mat22()", "@", "wp.vec3()", None),
    ],
)
def test_products(left, op, right, way):
    for statement in (f"x = {left} {op} {right}", f"x = {left}\n    x {op}= {right}"):
        source = f"@wp.kernel\ndef kernel(out: wp.array(dtype=float)):\n    {statement}\n"
        with pytest.raises(TypeError) as caught:
            run(define(source)["kernel"])
        message = str(caught.value)
        assert f"no overload of '{op}' takes" in message
        assert (way or "hint") in message if way else "hint" not in message
