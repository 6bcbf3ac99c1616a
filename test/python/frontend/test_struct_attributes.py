"""Attributes of types: `x.dtype` of numbers, and what a struct's class has besides its fields."""

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import warp as wp
from frontend_programs import define, run
from warp.extend import errors


@wp.func
def half(x: Any):
    return x.dtype(0.5) * x


@wp.func
def logistic(x: Any):
    one = x.dtype(1)
    return one / (one + wp.exp(-x))


@wp.kernel
def halves(x: wp.array(dtype=Any), y: wp.array(dtype=Any)):
    i = wp.tid()
    y[i] = half(x[i])


@wp.kernel
def mapped(x: wp.array(dtype=Any), y: wp.array(dtype=Any)):
    t = wp.tile_load(x, shape=8)
    wp.tile_store(y, wp.tile_map(logistic, t))


@pytest.mark.parametrize("dtype", [wp.float16, wp.float32, wp.float64])
def test_constants_in_the_type_of_an_argument(dtype, device):
    given = np.arange(8.0) - 3.0
    x = wp.array(given, dtype=dtype, device=device)
    y = wp.zeros(8, dtype=dtype, device=device)
    wp.launch(halves, 8, [x, y], device=device)
    assert y.numpy().tolist() == (given / 2).tolist()
    wp.launch_tiled(mapped, 1, [x, y], block_dim=32, device=device)
    tolerance = {wp.float16: 2e-3, wp.float32: 2e-7, wp.float64: 1e-15}[dtype]
    np.testing.assert_allclose(y.numpy(), 1 / (1 + np.exp(-given)), rtol=tolerance)


@pytest.mark.parametrize(
    "value, dtype",
    [
        ("wp.uint8(3)", wp.uint8),
        ("wp.int64(3)", wp.int64),
        ("out[0] > 1.0", wp.bool),
        ("3", wp.int32),
        ("1.5", wp.float32),
        ("True", wp.bool),
        ("N", wp.uint16),
        ("wp.bfloat16(2.0)", wp.bfloat16),
    ],
)
def test_types_of_numbers(value, dtype):
    source = f"""
@wp.kernel
def kernel(out: wp.array(dtype=float)):
    x = {value}
    y: DTYPE = x.dtype(1)
    out[0] = float(y)
"""
    kernel = define(source, DTYPE=dtype, N=wp.constant(wp.uint16(4)))["kernel"]
    assert run(kernel)[0] == 1.0


@wp.func
def side() -> float:
    return 3.0


@wp.func
def scaled(x: float, by: float) -> float:
    return x * by


@wp.struct
class Inner:
    y: float
    LIMIT = wp.constant(wp.vec2(5.0, 6.0))
    scaled = scaled


@wp.struct
class Shape:
    x: float
    inner: Inner
    side = side
    scaled = scaled
    sine = wp.sin
    COUNT = 7
    Number = wp.float64

    @wp.func
    def area(s: Any):
        return s.x * s.x

    @staticmethod
    @wp.func
    def two():
        return 2.0

    def size(self):
        return 4

    @property
    def double(self):
        return 2 * self.x


@wp.func
def of_any(s: Any):
    return s.side() + s.area(s)


@wp.kernel
def attributes(s: Shape, a: wp.array(dtype=Shape), out: wp.array(dtype=float)):
    out[0] = s.side()
    out[1] = s.scaled(s.x, 2.0) + s.two()
    out[2] = s.inner.scaled(a[0].x, by=s.inner.LIMIT[1])
    out[3] = a[0].side() + float(a[0].COUNT)
    out[4] = of_any(s)
    local = Shape()
    out[5] = local.sine(local.x + 0.5)
    for i in range(s.COUNT):
        out[6] += float(s.Number(i))
    out[7] = type(s).side() + a.dtype.two()


def test_attributes_of_structs(device):
    s = Shape(x=1.5)
    a = wp.array([Shape(x=4.0)], dtype=Shape, device=device)
    out = wp.zeros(8, dtype=float, device=device)
    wp.launch(attributes, 1, [s, a], [out], device=device)
    expected = [3, 5, 24, 10, 5.25, np.sin(0.5), 21, 5]
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-6)


@pytest.mark.parametrize(
    "use, message",
    [
        ("s.size()", "'size' is a plain Python function"),
        ("s.double", "struct 'Shape' has no field 'double', it has: x, inner"),
        ("s.missing()", "struct 'Shape' has no field 'missing'"),
        ("s.area()", "argument 's' is missing"),
    ],
)
def test_refused(use, message):
    source = f"""
@wp.kernel
def kernel(s: Shape, out: wp.array(dtype=float)):
    out[0] = float({use})
"""
    with pytest.raises(errors.WarpCodegenError, match=message):
        run(define(source, Shape=Shape)["kernel"], Shape())


def made(number):
    """A struct of the same name and fields each time, and kernels that take its attributes."""

    @wp.func
    def number_of_class() -> float:
        return float(wp.static(number))

    @wp.struct
    class Made:
        x: float
        NUMBER = number
        get = number_of_class

    @wp.struct
    class Around:
        made: Made

    @wp.func
    def of_any(m: Any):
        return m.get()

    @wp.kernel
    def kernel(m: Made, a: wp.array(dtype=Around), out: wp.array(dtype=float)):
        out[0] = m.get() + 10.0 * float(m.NUMBER)
        out[1] = a[0].made.get() + 10.0 * of_any(m)
        out[2] = type(m).get()
        new = Made()
        out[3] = new.get()

    return Made, Around, kernel


def test_structs_of_one_name():
    """The class counts that a kernel mentions, not the one that was declared last."""
    for Made, Around, kernel in [made(number) for number in (1, 2, 3)]:
        around = wp.zeros(1, dtype=Around, device="cpu")
        one = Made.NUMBER
        assert run(kernel, Made(), around)[:4] == [11.0 * one, 11.0 * one, one, one]


def test_structs_that_cannot_be_told_apart():
    (_, first, *_), (_, second, *_) = made(4), made(5)

    @wp.kernel
    def kernel(a: first, b: second, out: wp.array(dtype=float)):
        out[0] = a.made.get()

    with pytest.raises(errors.WarpCodegenError, match=r"structs 'Made' .* attributes differ"):
        run(kernel, first(), second())


PROGRAM = """
import sys
import warp as wp

@wp.struct
class Inner:
    y: float
    N = int(sys.argv[1])

@wp.struct
class Outer:
    inner: Inner

@wp.kernel
def kernel(s: Outer, out: wp.array(dtype=float)):
    out[0] = float(s.inner.N)

out = wp.zeros(1, dtype=float, device="cpu")
wp.launch(kernel, 1, [Outer(), out], device="cpu")
print(out.numpy()[0])
"""


def test_attributes_are_part_of_what_a_kernel_is(tmp_path):
    """Code from an earlier process, in which an attribute was another, is not used."""
    path = tmp_path / "program.py"
    path.write_text(PROGRAM)
    for number in ("5", "6", "5"):
        found = subprocess.run(
            [sys.executable, path, number], capture_output=True, text=True, timeout=120
        )
        assert found.stdout.strip().endswith(f"{number}.0"), found.stderr


@wp.struct
class Fieldless:
    pass


@wp.kernel
def beside_nothing(empty: Fieldless, n: int, more: Fieldless, x: wp.array(dtype=int)):
    i = wp.tid()
    if n > 0:
        x[i] = n * x[i] + 1


@wp.kernel
def of_nothing(empty: Fieldless):
    i = wp.tid()


def test_structs_without_fields_are_arguments(device):
    x = wp.array([1, 2], dtype=int, device=device)
    for n, expected in ((3, [4, 7]), (0, [4, 7]), (1, [5, 8])):
        wp.launch(beside_nothing, 2, [Fieldless(), n, Fieldless(), x], device=device)
        assert x.numpy().tolist() == expected
    wp.launch(of_nothing, 2, [Fieldless()], device=device)
