"""`warp.extend`: what libraries outside of the package build on."""

import ast
import doctest
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import programs
import warp as wp
from warp import extend
from warp.extend import kinds

DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "extend.md"
PROGRAM = """
import sys
import quadrature
translates = "warp._src.frontend.build" in sys.modules
print("translates" if translates else "from the cache")
"""


def test_every_name_is_in_the_document():
    text = DOCUMENT.read_text(encoding="utf-8")
    names = {name for name in vars(extend) if not name.startswith("_")}
    assert len(names) > 25
    assert {name for name in names if not re.search(rf"`{name}\b", text)} == set()


FINDER = doctest.DocTestFinder(recurse=False)
OPTIONS = doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL
# Exceptions, a line on the screen, and a frame.
WITHOUT_EXAMPLE = {"errors", "notice", "calling_frame"}


@pytest.mark.parametrize(
    "name", sorted(name for name in vars(extend) if name[0] != "_" and name not in WITHOUT_EXAMPLE)
)
def test_examples_of_docstrings(name):
    (found,) = FINDER.find(getattr(extend, name), name, globs={})
    assert found.examples
    result = doctest.DocTestRunner(optionflags=OPTIONS).run(found)
    assert result.failed == 0 and result.attempted > 0


def test_a_library_in_a_folder(tmp_path):
    """The document's library: gradients are right, and a second process translates nothing."""
    blocks = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text("utf-8"), flags=re.DOTALL)
    library = tmp_path / "quadrature.py"
    library.write_text("".join(blocks), encoding="utf-8")
    assert "_src" not in library.read_text("utf-8")
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    said = [run(program, tmp_path) for _ in range(2)]
    assert said == ["integral 8.575\ntranslates", "integral 8.575\nfrom the cache"]
    # Another transformer makes another kernel of the same text.
    changed = library.read_text("utf-8").replace('node.args[0], "x"', 'node.args[0], "weight"')
    library.write_text(changed.partition("u, v = (")[0], encoding="utf-8")
    assert run(program, tmp_path) == "translates"


def run(program, folder):
    status, out, err = programs.run(program, WARP_CACHE_PATH=folder / "cache")
    assert status == 0, err
    return out.strip()


def value_of(function, *arguments):
    """The result of a function of kernels for numbers."""
    text = "def apply(out: wp.array(dtype=float)):\n    out[0] = function({})\n"
    text = text.format(", ".join(map(repr, arguments)))
    kernel = wp.Kernel(extend.function_from_text(text, {"wp": wp, "function": function}))
    out = wp.zeros(1, dtype=float, device="cpu")
    wp.launch(kernel, 1, [out], device="cpu")
    return float(out.numpy()[0])


class Scaled(ast.NodeTransformer):
    def __init__(self, factor):
        self.factor = factor

    def visit_Constant(self, node):
        return ast.Constant(self.factor * node.value)


def shifted(x: float):
    return x + 1.5


def test_functions_take_transformers():
    made = wp.Function(shifted, code_transformers=[Scaled(2.0), Scaled(-1.0)])
    assert value_of(made, 0.0) == -3.0 and made(0.0) == -3.0
    assert value_of(wp.Function(shifted), 0.0) == 1.5
    # Equal trees share their code, others do not.
    codes = [extend.transformed_function(shifted, [Scaled(f)]).__code__ for f in (2.0, 2.0, 3.0)]
    assert codes[0] is codes[1] and codes[0] is not codes[2]


def test_transformed_functions_keep_what_they_see():
    offset = 2.0

    def first(x: float):
        return scale(x) + offset

    class Renamed(ast.NodeTransformer):
        def visit_Name(self, node):
            return ast.Name("other", node.ctx) if node.id == "scale" else node

    @wp.func
    def other(x: float):
        return 10.0 * x

    made = extend.transformed_function(first, [Renamed()], names={"other": other})
    assert value_of(wp.Function(made), 1.0) == 12.0
    offset = 3.0
    assert made(1.0) == 13.0 and made.__defaults__ is None


def test_functions_with_overloads():
    function = wp.Function(extend.function_from_text("def size(x: float):\n    return x", {}))
    text = "def size(v: wp.vec2):\n    return size(wp.length(v))"
    function.add_overload(extend.function_from_text(text, {"wp": wp, "size": function}))
    assert value_of(function, 2.0) == 2.0
    names = {"wp": wp, "size": function}
    text = "def both(x: float):\n    return size(wp.vec2(3.0, 4.0)) + size(x)\n"
    assert value_of(wp.Function(extend.function_from_text(text, names)), 1.0) == 6.0


def test_text_that_is_indented_with_annotations_and_defaults():
    text = """
        def scaled(x: real, factor: real = real(0.5)):
            return factor * x
    """
    made = extend.function_from_text(text, {"real": wp.float64}, module="somewhere")
    assert made.__annotations__ == {"x": wp.float64, "factor": wp.float64}
    assert (made.__module__, made.__qualname__) == ("somewhere", "scaled")
    assert made(3.0) == 1.5


def test_trees_show_the_lines_of_their_file(tmp_path):
    file = tmp_path / "model.txt"
    file.write_text("# a model\n\n@rate\ndef flow(x: float):\n    return x.inflow\n")
    tree = ast.parse(file.read_text()).body[0]
    made = extend.function_from_tree(tree, file=str(file))
    with pytest.raises(wp.WarpCodegenError) as caught:
        value_of(wp.Function(made), 1.0)
    assert (caught.value.file, caught.value.line) == (str(file), 5)
    assert "return x.inflow" in str(caught.value)
    assert len(tree.decorator_list) == 1
    tree.body[0].value = ast.Constant(2.5)
    assert value_of(wp.Function(extend.function_from_tree(tree)), 1.0) == 2.5


def test_errors_show_lines_of_the_text():
    made = wp.Function(extend.function_from_text("def f(x: float):\n    return x.y\n"))
    with pytest.raises(wp.WarpCodegenError, match=r"<f \w+>:2:12: .*\n    return x\.y\n"):
        value_of(made, 1.0)
    line = shifted.__code__.co_firstlineno + 1

    class Broken(ast.NodeTransformer):
        def visit_Constant(self, node):
            return ast.Name("nowhere", ast.Load())

    made = wp.Function(extend.transformed_function(shifted, [Broken()]))
    with pytest.raises(wp.WarpCodegenError, match="nowhere") as caught:
        value_of(made, 1.0)
    assert (caught.value.file, caught.value.line) == (__file__, line)


@pytest.mark.parametrize(
    ("text", "error"),
    [("x = 1", ValueError), ("@d\ndef f(): pass", ValueError), ("def f(:", SyntaxError)],
)
def test_bad_text(text, error):
    with pytest.raises(error):
        extend.function_from_text(text)


def test_bad_transformers():
    class Gone(ast.NodeTransformer):
        def visit_FunctionDef(self, node):
            return None

    with pytest.raises(TypeError, match="code transformer 'Gone' of 'shifted'.*'NoneType'"):
        extend.transformed_function(shifted, [Gone()])
    with pytest.raises(TypeError, match="'transformers' expects a list of `ast.NodeTransformer`s"):
        extend.transformed_function(shifted, [3])


def test_structs_from_fields():
    inner = extend.struct_from_fields("Inner", {"w": wp.vec2})
    outer = extend.struct_from_fields("Outer", {"n": int, "inner": inner, "x": wp.array(dtype=int)})
    value = outer()
    value.inner.w = wp.vec2(1.0, 2.0)
    assert value.inner.w == wp.vec2(1.0, 2.0) and outer.__module__ == __name__
    assert extend.type_is_struct(outer) and extend.type_size(inner) == 1
    for fields, error in (({"a b": int}, ValueError), ({"a": object}, TypeError)):
        with pytest.raises(error):
            extend.struct_from_fields("Bad", fields)


def test_adjoints_are_recorded_where_a_tape_records(device):
    x = wp.array([1.0, 2.0], dtype=wp.float64, requires_grad=True, device=device)
    y = wp.zeros_like(x)

    def backward():
        x.grad.assign(x.grad.numpy() + 2.0 * x.numpy() * y.grad.numpy())

    assert not extend.record_adjoint(backward, [x, y]) and not extend.is_recording()
    with wp.Tape() as tape:
        assert extend.is_recording() and extend.is_differentiating()
        assert extend.record_adjoint(backward, [x, y])
        with extend.unrecorded():
            assert not extend.is_recording()
            y.assign(x.numpy() ** 2)
    tape.backward(grads={y: wp.array([1.0, 10.0], dtype=wp.float64, device=device)})
    np.testing.assert_array_equal(x.grad.numpy(), [2.0, 40.0])


def test_writes_that_a_library_notes_are_seen(device):
    x = wp.ones(3, dtype=float, device=device, requires_grad=True)
    y = wp.zeros_like(x)

    @wp.kernel(module="unique")
    def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = x[i] * x[i]

    with wp.Tape() as tape:
        wp.launch(square, 3, [x], [y], device=device)
        extend.note_writes("solve", x)
        with extend.unrecorded():
            x.fill_(5.0)
    tape.backward(grads={y: wp.ones_like(y)})
    np.testing.assert_array_equal(x.grad.numpy(), [2.0] * 3)


def test_captures_pause(device):
    x = wp.zeros(2, dtype=int, device=device)

    @wp.kernel(module="unique")
    def add(x: wp.array(dtype=int), n: int):
        x[wp.tid()] += n

    wp.load_module(add.module, device)
    with wp.ScopedCapture(device=device) as capture:
        wp.launch(add, 2, [x, 1], device=device)
        paused = extend.capture_pause(device)
        assert not extend.is_capturing(device) and x.numpy().tolist() == [0, 0]
        extend.capture_resume(paused, device)
        assert extend.is_capturing(device)
        wp.launch(add, 2, [x, 10], device=device)
    for _ in range(2):
        wp.capture_launch(capture.graph)
    assert x.numpy().tolist() == [22, 22]
    with pytest.raises(wp.WarpError, match="no graph is being captured"):
        extend.capture_pause(device)


def test_arguments_are_named_as_the_library_spells_them():
    @extend.checked(count=kinds.COUNT)
    def solve(values, count=1):
        return values[count]

    assert solve([1, 2]) == 2
    with pytest.raises(extend.errors.WarpArgumentError) as caught:
        solve([1, 2], count="three")
    assert str(caught.value).startswith(f"{__name__}.")
    assert "argument 'count' expects an integer of at least 0, but got 'three'" in str(caught.value)
    assert sys.modules["warp.extend.kinds"].COUNT is kinds.COUNT
