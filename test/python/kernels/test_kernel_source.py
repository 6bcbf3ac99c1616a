"""Kernels and functions from text: `wp.kernel(source=...)`, `wp.func(source=...)`."""

import subprocess
import sys

import numpy as np
import pytest

import warp as wp

SCALE = 3.0


def values(kernel, *arguments, dim=4):
    x = wp.zeros(dim, dtype=float, device="cpu")
    wp.launch(kernel, dim, [x, *arguments], device="cpu")
    return x.numpy()


def test_a_kernel_from_text():
    kernel = wp.kernel(source="def fill(x: wp.array(dtype=float)):\n    x[wp.tid()] = 2.0\n")
    assert isinstance(kernel, wp.Kernel) and kernel.key == "fill"
    np.testing.assert_array_equal(values(kernel), np.full(4, 2.0))


def test_names_are_those_of_the_caller():
    offset = 0.5

    @wp.func
    def square(a: float):
        return a * a

    kernel = wp.kernel(
        source="""
        def squares(x: wp.array(dtype=float), s: float = 2.0):
            i = wp.tid()
            x[i] = SCALE * square(float(i)) + offset * s
        """
    )
    expected = SCALE * np.arange(4.0) ** 2 + offset * 4.0
    np.testing.assert_allclose(values(kernel, 4.0), expected)


def test_texts_of_a_loop_are_kernels_of_their_own():
    kernels = [
        wp.kernel(source=f"def fill(x: wp.array(dtype=float)): x[wp.tid()] = {value}", name=name)
        for name, value in (("one", 1.0), ("two", 2.0))
    ]
    assert [values(kernel)[0] for kernel in kernels] == [1.0, 2.0]
    assert [kernel.key for kernel in kernels] == ["one", "two"]


def test_gradients_and_functions_from_text():
    cube = wp.func(source="def cube(a: float):\n    return a * a * a\n")
    assert cube(2.0) == 8.0
    kernel = wp.kernel(
        source="""
        def cubes(x: wp.array(dtype=float), y: wp.array(dtype=float)):
            y[wp.tid()] = cube(x[wp.tid()])
        """
    )
    points = np.array([-1.5, 0.25, 2.0], np.float32)
    x = wp.array(points, dtype=float, requires_grad=True, device="cpu")
    y = wp.zeros(3, dtype=float, requires_grad=True, device="cpu")
    with wp.Tape() as tape:
        wp.launch(kernel, 3, [x, y], device="cpu")
    tape.backward(grads={y: wp.ones(3, dtype=float, device="cpu")})
    np.testing.assert_allclose(x.grad.numpy(), 3.0 * points**2, rtol=1e-6)


def test_text_in_place_of_that_of_a_function():
    def fill(x: wp.array(dtype=float), value: float):
        x[wp.tid()] = value

    text = "@wp.kernel\ndef fill(x, value):\n    x[wp.tid()] = value + SCALE\n"
    for kernel in (wp.Kernel(fill, "a", source=text), wp.kernel(fill, name="b", source=text)):
        np.testing.assert_array_equal(values(kernel, 1.0), np.full(4, 4.0))

    def double(a: float):
        return a

    assert wp.Function(double, source="def double(a):\n    return 2.0 * a\n")(1.5) == 3.0
    with pytest.raises(ValueError, match=r"expects the parameters \(x, value\), but got \(y\)"):
        wp.Kernel(fill, source="def fill(y):\n    y[0] = 1.0\n")


@pytest.mark.parametrize(
    ("source", "error", "message"),
    [
        (3, TypeError, "expects text as `source`"),
        ("x = 1", ValueError, "expects one `def` without decorators"),
        ("", ValueError, "expects one `def`"),
        ("@wp.kernel\ndef k(): pass", ValueError, "without decorators"),
        ("def k(:", SyntaxError, "invalid syntax"),
    ],
)
def test_texts_that_are_no_kernel(source, error, message):
    with pytest.raises(error, match=message):
        wp.kernel(source=source)


def test_messages_show_the_text():
    kernel = wp.kernel(source="def k(x: wp.array(dtype=float)):\n    x[wp.tid()] = nothing\n")
    with pytest.raises(Exception, match="x\\[wp.tid\\(\\)\\] = nothing"):
        values(kernel)


def test_a_program_that_comes_through_a_pipe():
    program = """
import warp as wp
wp.config.quiet = True
C = 3.0
k = wp.kernel(source="def k(x: wp.array(dtype=float)): x[wp.tid()] = C")
x = wp.zeros(3, dtype=float, device="cpu")
wp.launch(k, 3, [x], device="cpu")
print(x)
"""
    done = subprocess.run(
        [sys.executable, "-"], input=program, capture_output=True, text=True, timeout=120
    )
    assert done.stdout.strip() == "[3. 3. 3.]", done.stderr
