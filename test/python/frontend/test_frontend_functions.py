"""Functions that kernels call, and what functions capture from Python."""

import enum
import importlib
import math
import sys
from typing import Any, Callable

import numpy as np
import pytest

import warp as wp
from frontend_programs import run


class Mode(enum.IntEnum):
    OFF = 0
    FAST = 3


class Holder:
    """Stands for a user's module or settings object."""

    scale = 2.5
    table = (1.0, 10.0, 100.0)


LIMIT = wp.constant(7)
AXIS = wp.vec3(1.0, 2.0, 3.0)
DOUBLE = wp.float64(0.1)
NUMPY = np.float32(1.5)


def test_defaults_keywords_and_multiple_results():
    @wp.func
    def mix(a: float, b: float = 2.0, c: float = 3.0):
        return a + b * c, a - b

    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        s, d = mix(5.0)
        out[0] = s
        out[1] = d
        s, d = mix(c=1.0, a=1.0)
        out[2] = s
        pair = mix(1.0, 1.0, c=4.0)
        out[3] = pair[0]

    assert run(kernel)[:4] == [11.0, 3.0, 3.0, 5.0]


def test_overloads_and_generics():
    @wp.func
    def pick(x: int):
        return x + 1

    @wp.func
    def pick(x: float):  # noqa: F811
        return x + 100.0

    @wp.func
    def pick(x: Any):  # noqa: F811
        return wp.length(x)

    @wp.func
    def twice(x: Any, y: Any):
        return x * y

    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        out[0] = float(pick(1))
        out[1] = pick(1.0)
        out[2] = pick(wp.vec2(3.0, 4.0))
        out[3] = twice(wp.vec2(1.0, 2.0), 3.0)[1]

    assert run(kernel)[:4] == [2.0, 101.0, 5.0, 6.0]


def test_functions_as_arguments_and_closures():
    def make(amount):
        @wp.func
        def shift(x: float):
            return x + amount

        return shift

    @wp.func
    def apply(f: Callable, x: float):
        return f(f(x))

    up, down = make(1.0), make(-10.0)

    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        out[0] = apply(up, 0.0)
        out[1] = apply(down, 0.0)
        g = up
        out[2] = g(5.0)

    assert run(kernel)[:3] == [2.0, -20.0, 6.0]


def test_captured_constants():
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        out[0] = float(LIMIT)
        out[1] = AXIS[2]
        out[2] = float(Mode.FAST)
        out[3] = Holder.scale
        out[4] = math.pi
        out[5] = float(DOUBLE * wp.float64(10.0))
        out[6] = NUMPY
        for i in range(len(Holder.table)):
            out[7 + i] = Holder.table[i]
        if Mode.OFF == 1:
            out[10] = never_defined

    expected = [7.0, 3.0, 3.0, 2.5, np.float32(math.pi), 1.0, 1.5, 1.0, 10.0, 100.0, 0.0]
    assert run(kernel)[:11] == expected


def test_static_expressions():
    sizes = [2, 3]

    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        out[0] = wp.static(float(sum(sizes)))
        for i in range(2):
            out[1 + i] = wp.static(float(sizes[i]))
        if wp.static(len(sizes) == 5):
            out[3] = undefined

    assert run(kernel)[:4] == [5.0, 2.0, 3.0, 0.0]


def test_same_function_object_is_seen_anew_per_closure():
    def make(k):
        @wp.kernel
        def kernel(out: wp.array(dtype=float)):
            out[0] = k * 2.0

        return kernel

    assert [run(make(k))[0] for k in (1.0, 2.0, 3.0)] == [2.0, 4.0, 6.0]


@pytest.mark.parametrize("mode", ["debug", "release"])
def test_assertions_hold_in_debug_mode_only(mode, config):
    config.mode = mode

    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        assert out[0] == 0.0, "starts at zero"
        out[1] = 1.0

    assert run(kernel)[1] == 1.0


def test_kernels_call_what_a_reloaded_module_defines(tmp_path, monkeypatch, device):
    source = "import warp as wp\n\n@wp.func\ndef weight(x: float):\n    return {} * x\n"
    path = tmp_path / "reloaded_functions.py"
    path.write_text(source.format("1.0"))
    monkeypatch.syspath_prepend(tmp_path)
    module = importlib.import_module("reloaded_functions")

    @wp.kernel
    def kernel(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        y[0] = module.weight(x[0])

    for factor in (1.0, 20.0, 300.0):
        path.write_text(source.format(factor))
        importlib.reload(module)
        x = wp.ones(1, device=device, requires_grad=True)
        y = wp.zeros(1, device=device, requires_grad=True)
        with wp.Tape() as tape:
            wp.launch(kernel, 1, [x, y], device=device)
        tape.backward(grads={y: wp.ones(1, device=device)})
        assert y.numpy()[0] == factor and x.grad.numpy()[0] == factor
    del sys.modules["reloaded_functions"]


def test_modules_that_others_add_to_the_package_may_change(tmp_path, monkeypatch):
    source = "import warp as wp\n\n@wp.func\ndef weight():\n    return {}\n"
    path = tmp_path / "added_functions.py"
    monkeypatch.setattr(wp, "__path__", [*wp.__path__, str(tmp_path)])
    path.write_text(source.format("1.0"))
    module = importlib.import_module("warp.added_functions")

    @wp.kernel
    def kernel(y: wp.array(dtype=float)):
        y[0] = module.weight()

    for value in (1.0, 20.0, 300.0):
        path.write_text(source.format(value))
        importlib.reload(module)
        y = wp.zeros(1, device="cpu")
        wp.launch(kernel, 1, [y], device="cpu")
        assert y.numpy()[0] == value
    del sys.modules["warp.added_functions"]
    del wp.added_functions


def test_annotations_of_variables_are_those_of_the_reloaded_text(tmp_path, monkeypatch):
    """Python counts code that differs in nothing else as the same."""
    source = (
        "import warp as wp\n\n@wp.func\ndef tenth():\n    x: wp.{} = 0.1\n    return float(x)\n"
    )
    path = tmp_path / "reloaded_annotations.py"
    path.write_text(source.format("float16"))
    monkeypatch.syspath_prepend(tmp_path)
    module = importlib.import_module("reloaded_annotations")

    @wp.kernel
    def kernel(y: wp.array(dtype=float)):
        y[0] = module.tenth()

    for kind in ("float16", "float32", "float16"):
        path.write_text(source.format(kind))
        importlib.reload(module)
        y = wp.zeros(1, device="cpu")
        wp.launch(kernel, 1, [y], device="cpu")
        assert y.numpy()[0] == np.dtype(kind).type(0.1)
    del sys.modules["reloaded_annotations"]
