"""Kernels that cannot be: each is refused with file, line, caret and, if there is one, the fix."""

import importlib.util
import tempfile
import typing
from pathlib import Path

import pytest

import warp as wp
from warp.extend import errors


def refused(define, *words, kind=errors.WarpCodegenError, inputs=()):
    """`define` makes a kernel that takes `inputs`; defining or launching it must raise `kind`.

    The message names this file and the line marked `# here`, and holds all `words`.
    """
    with pytest.raises(kind) as caught:
        wp.launch(define(), 1, inputs, device="cpu")
    message = str(caught.value)
    for word in words:
        assert word in message, f"'{word}' is not in: {message}"
    assert "test_bad_kernels.py:" in message, message
    line = int(message.split("test_bad_kernels.py:")[1].split(":")[0].split()[0].strip(",\"'"))
    with open(__file__, encoding="utf-8") as file:
        text = file.readlines()[line - 1]
    assert "# here" in text, f"line {line} is blamed: {text}\n{message}"
    return message


def test_message_shows_the_line_with_a_caret():
    def define():
        @wp.kernel
        def kernel():
            i = wp.tid()
            x = i + 1.5  # here

        return kernel

    message = refused(define, "i + 1.5", "^", "float(")
    lines = message.splitlines()
    caret = next(k for k, text in enumerate(lines) if "^" in text)
    assert "i + 1.5" in lines[caret - 1]
    assert lines[caret].index("^") == lines[caret - 1].index("i + 1.5")


def test_int_and_float_do_not_mix():
    def define():
        @wp.kernel
        def kernel():
            i = wp.tid()
            x = 2.0 * float(i)
            y = x * i  # here

        return kernel

    refused(define, "float", "int", kind=TypeError)


def test_call_of_a_kernel():
    def define():
        @wp.kernel
        def inner():
            wp.printf("")

        @wp.kernel
        def kernel():
            inner()  # here

        return kernel

    refused(define, "inner' cannot be called from a kernel", "make it a `@wp.func`")


def test_parameter_without_annotation():
    def define():
        @wp.kernel
        def kernel(x):  # here
            i = wp.tid()

        return kernel

    with pytest.raises(errors.WarpError) as caught:
        wp.launch(define(), 1, [1.0], device="cpu")
    assert "'x'" in str(caught.value) and "annotation" in str(caught.value)


@pytest.mark.parametrize("annotation", ["no type", 3, list, wp.sin, {}])
def test_annotation_that_is_no_type(annotation):
    with pytest.raises((errors.WarpError, TypeError)):

        @wp.kernel
        def kernel(x: annotation):
            i = wp.tid()

        wp.launch(kernel, 1, [1.0], device="cpu")


def test_undefined_names():
    def define():
        @wp.kernel
        def kernel():
            x = undefined_name + 1  # noqa: F821  # here

        return kernel

    refused(define, "undefined_name")

    def define_call():
        @wp.kernel
        def kernel():
            x = wp.no_such_builtin(1.0)  # here

        return kernel

    refused(define_call, "no_such_builtin")


def test_close_names_are_suggested():
    def define():
        @wp.kernel
        def kernel():
            x = wp.normalise(wp.vec3(1.0, 0.0, 0.0))  # here

        return kernel

    refused(define, "normalise", "normalize")


def test_name_used_before_assignment():
    def define():
        @wp.kernel
        def kernel():
            y = x + 1  # noqa: F821, F841  # here
            x = 1

        return kernel

    refused(define, "x")


def test_branches_of_different_type():
    def define():
        @wp.kernel
        def kernel():
            i = wp.tid()
            if i > 0:
                x = 1
            else:
                x = 2.0  # here

            y = x

        return kernel

    with pytest.raises(errors.WarpCodegenError) as caught:
        wp.launch(define(), 1, device="cpu")
    assert "'x'" in str(caught.value)

    def define_ternary():
        @wp.kernel
        def kernel():
            i = wp.tid()
            x = 1 if i > 0 else 2.0  # here

        return kernel

    refused(define_ternary)


def test_variable_changes_type_in_a_loop():
    def define():
        @wp.kernel
        def kernel(n: int):
            x = 1
            for k in range(n):  # here
                x = wp.vec3(float(k), 2.0, 3.0)  # here

        return kernel

    refused(define, "'x'", kind=TypeError, inputs=[3])


def test_recursion():
    @wp.func
    def factorial(n: int) -> int:
        if n < 2:
            return 1
        return n * factorial(n - 1)  # here

    def define():
        @wp.kernel
        def kernel():
            x = factorial(5)

        return kernel

    with pytest.raises(errors.WarpCodegenError) as caught:
        wp.launch(define(), 1, device="cpu")
    assert "recurs" in str(caught.value) and "factorial" in str(caught.value)


@wp.func
def even(n: int) -> bool:
    return odd(n - 1)


@wp.func
def odd(n: int) -> bool:
    return even(n - 1)


def test_mutual_recursion():
    @wp.kernel
    def kernel():
        x = even(4)

    with pytest.raises(errors.WarpCodegenError) as caught:
        wp.launch(kernel, 1, device="cpu")
    assert "recurs" in str(caught.value)


@pytest.mark.parametrize("index", [3, -4, 100])
def test_constant_index_out_of_range(index):
    def define():
        @wp.kernel
        def kernel():
            v = wp.vec3(1.0, 2.0, 3.0)
            x = v[index]  # here

        return kernel

    refused(define, str(index), "3", kind=IndexError)


def test_constant_matrix_index_out_of_range():
    def define():
        @wp.kernel
        def kernel():
            m = wp.mat22(1.0, 2.0, 3.0, 4.0)
            x = m[1, 2]  # here

        return kernel

    refused(define, "2", kind=IndexError)


def test_slice_of_step_zero():
    def define():
        @wp.kernel
        def kernel(x: wp.array(dtype=float)):
            y = x[::0]  # here

        return kernel

    refused(define, "zero", kind=ValueError, inputs=[None])


def test_components_and_attributes_that_do_not_exist():
    def define():
        @wp.kernel
        def kernel():
            v = wp.vec2(1.0, 2.0)
            x = v.z  # here

        return kernel

    refused(define, "z", kind=AttributeError)


@pytest.mark.parametrize("literal", [5_000_000_000, 2**31, -(2**31) - 1])
def test_literal_that_does_not_fit(literal):
    def define():
        @wp.kernel
        def kernel():
            x = literal  # here

        return kernel

    refused(define, str(literal), "int64")


def test_else_of_a_loop_is_refused():
    def define_for():
        @wp.kernel
        def kernel():
            x = int(0)
            for i in range(3):  # here
                x += i
            else:  # here
                x = 5  # here

        return kernel

    refused(define_for, "else")

    def define_while():
        @wp.kernel
        def kernel():
            x = int(0)
            while x < 3:  # here
                x += 1
            else:  # here
                x = 5  # here

        return kernel

    refused(define_while, "else")


def test_wrong_number_of_indices_and_arguments():
    @wp.func
    def f(a: int, b: int):
        return a + b

    def define():
        @wp.kernel
        def kernel():
            x = f(1)  # here

        return kernel

    refused(define, "f", "b")

    def define_extra():
        @wp.kernel
        def kernel():
            x = f(1, 2, 3)  # here

        return kernel

    refused(define_extra, "f")

    def define_builtin():
        @wp.kernel
        def kernel():
            x = wp.dot(wp.vec3(), wp.vec2())  # here

        return kernel

    refused(define_builtin, "dot", "vec")


def test_constructs_outside_the_language():
    bodies = {
        "list": "x = [1, 2]",
        "dict": "x = {1: 2}",
        "lambda": "x = lambda a: a",
        "comprehension": "x = [k for k in range(3)]",
        "f-string": "x = f'{1}'",
        "try": "try:\n        x = 1\n    except ValueError:\n        x = 2",
        "with": "with open('f') as f:\n        x = 1",
        "raise": "raise ValueError('x')",
        "yield": "yield 1",
        "global": "global GLOBAL_LIST",
        "import": "import math",
        "del": "x = 1\n    del x",
        "nested def": "def g():\n        return 1",
        "class": "class C:\n        pass",
        "is": "x = wp.tid() is None",
        "in": "x = wp.tid() in (1, 2)",
        "captured list": "x = GLOBAL_LIST",
        "captured dict": "x = {1: GLOBAL_LIST}[1]",
        "python function": "x = sorted(3)",
        "value of a kernel": "return 3",
        "loop over a value": "for k in wp.vec3():\n        x = k",
    }
    for name, body in bodies.items():
        assert_refused_source(
            name,
            f"import warp as wp\nGLOBAL_LIST = [1, 2]\n\n@wp.kernel\ndef kernel():\n    {body}\n",
        )


def test_constructs_outside_the_language_name_one_inside():
    """The hint's own construct is accepted in the place of the refused one."""
    source = "import math\nimport warp as wp\n\n@wp.func\ndef g(a: int):\n    return a\n\n"
    source += "@wp.kernel\ndef kernel():\n    {}\n"
    for refused_body, hint, body in (
        ("print(f'{1}')", '`wp.printf("%d\\n", i)`', 'i = 1\n    wp.printf("%d\\n", i)'),
        ("x = (lambda a: a)(1)", "`@wp.func`", "x = g(1)"),
        ("def h():\n        return 1", "`@wp.func`", "x = g(1)"),
        ("x = [k for k in range(3)]", "`wp.zeros(shape, dtype)`", "x = wp.zeros(3, dtype=int)"),
        ("if (x := wp.tid()) > 0:\n        x = 1", "statement before", "x = wp.tid()"),
        ("match wp.tid():\n        case 0: x = 1", "`elif`", "if wp.tid() == 0:\n        x = 1"),
        ("raise ValueError('x')", "`assert`", "assert wp.tid() == 0"),
        ("import math", "top of the file", "x = math.sin(1.0)"),
    ):
        message = assert_refused_source(refused_body, source.format(refused_body))
        assert hint in message.partition("hint:")[2], message
        wp.launch(module_of(source.format(body)).kernel, 1, device="cpu")


def module_of(source):
    """The module of a source text."""
    path = Path(tempfile.mkdtemp(prefix="warp-test-source-")) / "refused_module.py"
    path.write_text(source)
    spec = importlib.util.spec_from_file_location("refused_module", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def assert_refused_source(name, source):
    with pytest.raises(errors.WarpCodegenError) as caught:
        wp.launch(module_of(source).kernel, 1, device="cpu")
        pytest.fail(f"{name} was accepted")
    assert "refused_module.py:" in str(caught.value), f"{name}: {caught.value}"
    return str(caught.value)


def test_one_bad_kernel_does_not_spoil_its_module():
    @wp.kernel
    def bad():
        x = undefined_name  # noqa: F821

    @wp.kernel
    def good(out: wp.array(dtype=float)):
        out[wp.tid()] = 1.0

    with pytest.raises(errors.WarpCodegenError):
        wp.launch(bad, 1, device="cpu")
    out = wp.zeros(1, dtype=float, device="cpu")
    wp.launch(good, 1, [out], device="cpu")
    assert out.numpy()[0] == 1.0


def test_errors_in_a_function_point_into_it():
    @wp.func
    def helper(x: float):
        return x + 1  # here

    def define():
        @wp.kernel
        def kernel():
            y = helper(2.0)

        return kernel

    refused(define)


def test_generic_parameter_needs_a_value():
    @wp.kernel
    def kernel(x: typing.Any):
        i = wp.tid()

    with pytest.raises(errors.WarpError):
        wp.launch(kernel, 1, [], device="cpu")
