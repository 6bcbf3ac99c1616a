"""Numbers take the type that is declared for them only if it holds them."""

import math

import pytest

import warp as wp
from frontend_programs import define, run

KERNEL = """
from typing import Any
import math
{head}
@wp.kernel
def kernel(out: wp.array(dtype=wp.float64)):
{body}
    out[0] = wp.float64(x)
"""


def value(body, head="", **names):
    """The value of `x` at the end of a kernel."""
    body = "".join(f"    {line}\n" for line in body.splitlines())
    kernel = define(KERNEL.format(head=head, body=body), **names)["kernel"]
    return run(kernel, dtype=wp.float64)[0]


@pytest.mark.parametrize(
    "text, expected",
    [
        ("int = 1.5", "'int32', but got 1.5"),
        ("int = 1.0", "'int32', but got 1.0"),
        ("'int' = 1.5", "'int32', but got 1.5"),
        ("int = -2.5", "'int32', but got -2.5"),
        ("int = math.pi", "'int32', but got 3.14"),
        ("int = math.nan", "'int32', but got nan"),
        ("wp.uint64 = HALF", "'uint64', but got 0.5"),
        ("int = 2147483648", "2147483648 does not fit 'int32'"),
        ("wp.uint8 = 256", "256 does not fit 'uint8'"),
        ("wp.uint8 = BYTE + 1", "256 does not fit 'uint8'"),
        ("wp.uint32 = -1", "-1 does not fit 'uint32'"),
        ("wp.int16 = -32769", "-32769 does not fit 'int16'"),
        ("bool = 2", "'bool', but got 2"),
        ("bool = 0.5", "'bool', but got 0.5"),
        ("wp.float16 = 65520.0", "65520.0 does not fit 'float16'"),
        ("wp.float16 = -70000", "-70000 does not fit 'float16'"),
        ("wp.bfloat16 = 3.4e38", "3.4e+38 does not fit 'bfloat16'"),
        ("float = 1e39", "1e+39 does not fit 'float32'"),
        ("int = wp.float64(1.5)", "annotation says 'int32', but got 'float64'"),
        ("wp.vec3 = 1.5", "annotation says 'vec3f', but got 'float32'"),
    ],
)
def test_annotations_refuse(text, expected):
    with pytest.raises(wp.WarpCodegenError) as caught:
        value(f"x: {text}", HALF=wp.constant(0.5), BYTE=255)
    assert expected in str(caught.value)


@pytest.mark.parametrize(
    "text, expected",
    [
        ("int = 5", 5),
        ("float = 5", 5),
        ("bool = 1", 1),
        ("int = True", 1),
        ("wp.uint8 = 255", 255),
        ("wp.int8 = -128", -128),
        ("wp.float16 = 65504", 65504),
        ("wp.float16 = 65519.0", 65504),
        ("wp.float16 = math.inf", math.inf),
        ("wp.float64 = 1e300", 1e300),
        ("wp.float64 = 0.1", 0.1),
        ("Any = 1.5", 1.5),
        ("wp.Float = 1.5", 1.5),
        ("'Unknown' = 1.5", 1.5),
    ],
)
def test_annotations_take(text, expected):
    assert value(f"x: {text}") == expected


def test_annotations_of_other_kinds():
    assert value("t: tuple[int, float] = (2, 3.0)\nx = float(t[0]) + t[1]") == 5.0
    assert value("a: wp.array(dtype=wp.float64) = out\nx = a.shape[0]") == 16.0
    with pytest.raises(TypeError, match="annotation says 'array.*', but got 'array"):
        value("a: wp.array(dtype=float) = out\nx = 1")
    with pytest.raises(TypeError, match="not a type of kernels"):
        value("x: math.sin = 1")


@pytest.mark.parametrize(
    "kind, default, expected",
    [
        ("int", "1.5", "'int32', but got 1.5"),
        ("wp.uint8", "-1", "-1 does not fit"),
        ("wp.float16", "1e6", "1000000.0 does not fit"),
    ],
)
def test_defaults(kind, default, expected):
    head = f"@wp.func\ndef f(n: {kind} = {default}):\n    return n\n"
    with pytest.raises(wp.WarpCodegenError, match=expected):
        value("x = f()", head)


@pytest.mark.parametrize(
    "made",
    [
        "wp.vec3i(1.5, 2, 3)",
        "wp.vec3i(2, 2.5, 3)",
        "wp.vec3i(1.5)",
        "wp.vector(1.5, 2.0, dtype=int)",
        "wp.matrix(1, 2, 3, 4.5, shape=(2, 2), dtype=int)",
        "wp.vec2ui(math.inf, 0)",
        "wp.vec3i(HALF, 2, 3)",
    ],
)
def test_components_keep_fractions(made):
    """As in Python."""
    with pytest.raises(TypeError, match=r"'u?int32'.*(1|2|4|0)\.5|got inf"):
        value(f"v = {made}\nx = v[0]", HALF=0.5)


def test_whole_components():
    assert value("v = wp.vec3i(4.0, 2, 3)\nx = v[0]") == 4.0


def test_checks_compare_with_the_number():
    """`expect_eq(1, 1.5)` does not hold, and is not taken for 1 == 1."""
    with pytest.raises(TypeError, match="'int32', but got 1.5"):
        value("x = int(1)\nwp.expect_eq(x, 1.5)")


def test_tiles_convert():
    """A fill value converts to the type of its tile, as in NumPy."""
    body = "t = wp.tile_full(shape=4, value=1.5, dtype=int)\nt[0] = 2.5\nx = t[0] + 10 * t[1]"
    assert value(body) == 12.0
    with pytest.raises(TypeError, match="'int32', but got 1.5"):
        value("t = wp.tile_ones(shape=4, dtype=int)\nwp.tile_axpy(1.5, t, t)\nx = t[0]")
