"""Functions known when they are called only change what they are given, in loops, too."""

import typing

import pytest

import warp as wp
from frontend_programs import define, run


@wp.func
def fill(a: wp.array(dtype=float), i: int):
    a[i] = 1.0


@wp.func
def add(x: wp.ref[float], by: int):
    x += float(by)


@wp.func
def keep(x: float, by: int):
    x += float(by)


@wp.func
def put(t: typing.Any, i: int):
    t[i] = 2.0


class Space:
    fill = fill
    add = add
    put = put
    draw = wp.randf


@wp.struct
class Held:
    x: float
    fill = fill
    add = add


TABLE = (fill, add)
draw = wp.randf


@wp.func
def through(f: typing.Callable, g: typing.Callable, n: int):
    a = wp.zeros(shape=3, dtype=float)
    x = float(0.0)
    for i in range(n):
        f(a, i)
        g(x, i + 1)
    return a[0] + 10.0 * a[1] + 100.0 * a[2] + 1000.0 * x


CALLS = ["fill add", "Space.fill Space.add", "h.fill h.add", "TABLE[0] TABLE[1]", "f g"]


@pytest.mark.parametrize("calls", CALLS)
def test_arrays_of_a_thread_and_references(calls):
    filled, added = calls.split()
    source = f"""
@wp.kernel
def kernel(n: int, out: wp.array(dtype=float)):
    h = Held()
    f = fill
    g = add
    a = wp.zeros(shape=3, dtype=float)
    x = float(0.0)
    for i in range(n):
        {filled}(a, i)
        if i > 0:
            {added}(x, i)
            {added}(by=i, x=h.x)
    out[0] = a[0] + 10.0 * a[1] + 100.0 * a[2] + 1000.0 * x + 10000.0 * h.x
"""
    names = {"fill": fill, "add": add, "Space": Space, "Held": Held, "TABLE": TABLE}
    assert run(define(source, **names)["kernel"], 3)[0] == 111.0 + 33000.0


def test_parameters():
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=float)):
        out[0] = through(fill, add, n)

    assert run(kernel, 2)[0] == 11.0 + 3000.0


def test_tiles():
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=float)):
        t = wp.tile_zeros(shape=4, dtype=float)
        for i in range(n):
            Space.put(t, i)
        for i in range(4):
            out[i] = t[i]

    assert run(kernel, 3)[:4] == [2.0, 2.0, 2.0, 0.0]


def test_builtins_of_other_names():
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=float)):
        one = wp.uint32(3)
        two = wp.uint32(3)
        three = wp.uint32(3)
        for i in range(n):
            out[3 * i] = wp.randf(one)
            out[3 * i + 1] = draw(two)
            out[3 * i + 2] = Space.draw(three)

    found = run(kernel, 3)[:9]
    assert found[0:3] == [found[0]] * 3 and found[6:9] == [found[6]] * 3
    assert len({found[0], found[3], found[6]}) == 3


def test_kernels_of_one_text():
    """One kernel's function may write a variable that another of the same text only reads."""

    def made(f):
        @wp.kernel
        def kernel(n: int, out: wp.array(dtype=float)):
            x = float(0.0)
            for i in range(n):
                f(x, i)
            out[0] = x

        return kernel

    assert [run(made(f), 4)[0] for f in (keep, add, keep)] == [0.0, 6.0, 0.0]
