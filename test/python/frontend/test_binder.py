"""Calls of builtins by the signatures of their records: binding, checks, write-back."""

import re
from pathlib import Path

import pytest
from warp._native import Builder

import warp as wp
from warp._src import builtin_calls
from warp._src.frontend import tiles, translator
from warp._src.frontend.binder import Call, Overload
from warp._src.frontend.build import translate_kernel
from warp._src.frontend.session import Session

HEAD = """
import warp as wp

def kernel(a: wp.array(dtype=float), m: wp.array2d(dtype=float), n: int, x: wp.vec3):
"""


def kernel_of(path, *lines):
    """A kernel with these lines as its body; the first is line 5 of its file."""
    path.write_text(HEAD + "".join(f"    {line}\n" for line in lines))
    space = {}
    exec(compile(path.read_text(), path, "exec"), space)
    return wp.Kernel(space["kernel"])


@pytest.fixture
def text_of(tmp_path):
    def text(*lines):
        module, _ = translate_kernel(kernel_of(tmp_path / "kernel.py", *lines))
        return module.text()

    return text


@pytest.fixture
def error_of(tmp_path):
    """The error of a line, and what the caret is under."""

    def error(*lines):
        with pytest.raises(wp.WarpCodegenError) as caught:
            kernel_of(tmp_path / "kernel.py", *lines).ir("warp")
        text = str(caught.value)
        place, source, carets = text.splitlines()[:3]
        assert place.startswith(f"{tmp_path / 'kernel.py'}:{4 + len(lines)}:"), text
        start = carets.index("^")
        return text, source[start : start + len(carets.strip())]

    return error


# One call, written by position, by name, in another order and with defaults.
@pytest.mark.parametrize(
    ("call", "same"),
    [
        ("wp.tile_load(a, 4)", "wp.tile_load(shape=4, a=a)"),
        ("wp.tile_load(a, 4, n)", "wp.tile_load(a, 4, offset=(n,), bounds_check=True)"),
        ("wp.tile_zeros(8)", "wp.tile_zeros((8,), wp.float32, 'register')"),
        ("wp.tile_arange(3)", "wp.tile_arange(0, 3, 1, dtype=int)"),
        ("wp.expect_near(a[0], 1.0)", "wp.expect_near(b=1.0, a=a[0], tolerance=1e-6)"),
        ("wp.atomic_add(m, n, 0, 1.0)", "wp.atomic_add(m, n, value=1.0, j=0)"),
        ("wp.tile_load(a, *(4, n))", "wp.tile_load(a, 4, n)"),
    ],
)
def test_ways_to_write_a_call(call, same, text_of):
    assert text_of(call) == text_of(same)


@pytest.mark.parametrize(
    ("call", "message", "place"),
    [
        ("wp.tile_load(a)", "tile_load() expects the argument 'shape'", None),
        ("wp.tile_load(a, 4, shap=3)", "has no parameter 'shap'", "3"),
        ("wp.tile_load(a, 4, shap=3)", "hint: did you mean `shape`?", "3"),
        ("wp.clamp(1.0, low=0.0, heigh=x)", "hint: did you mean `high`?", "x"),
        ("wp.tile_dot(n, n, m)", "expects at most 2 arguments by position, but got 3", "m"),
        ("wp.tid(n)", "tid() expects no arguments by position, but got 1", "n"),
        ("wp.tile_load(a, 4, shape=n)", "got 'shape' by position and by name", "n"),
        ("wp.atomic_add(a, 1.0)", "atomic_add() expects the argument 'value'", None),
        ("wp.tile_randi(4, 1, min=3)", "tile_randi() expects the argument 'max'", None),
        ("wp.tile_load(a, n)", "expects a shape of compile time constants", "n"),
        ("wp.identity(n, float)", "a compile-time constant 'int' as 'n', but got 'int32'", "n"),
        ("wp.tile_zeros(4, float, 'far')", "must be 'register' or 'shared', got 'far'", "'far'"),
        ("wp.tile_load(x, 4)", "expects an array as 'a', but got 'vec3f'", "x"),
        ("wp.tile_store(a, x)", "expects a tile as 't', but got 'vec3f'", "x"),
        ("wp.atomic_add(a, x, 1.0)", "expects an integer as 'i', but got 'vec3f'", "x"),
        (
            "wp.tile_load(a, 4, (n, n))",
            "as many indices as 'offset' as 'a' has",
            "(n, n)",
        ),
        ("wp.tile_randi(4, x)", "expects 'uint32' as 'rng', but got 'vec3f'", "x"),
        ("wp.tile_stack_clear(n)", "expects a stack as 's', but got 'int32'", "n"),
    ],
)
def test_arguments_that_do_not_fit(call, message, place, error_of):
    text, shown = error_of(call)
    assert message in text, text
    assert shown == (place or call), text


@pytest.mark.parametrize(
    ("call", "message", "place"),
    [
        ("wp.tile_transpose(s)", "expects a 2D tile as 'a', but got 'tile(", "s"),
        ("wp.tile_matmul(t, t)", "[M, K] of 'a' and [K, N] of 'b', but got (2, 3) and (2, 3)", "t"),
        ("wp.tile_matmul(q, q, out=n)", "a 2D tile as 'out', but got 'int32'", "n"),
        ("wp.tile_cholesky(t)", "expects a square tile as 'A', but got shape (2, 3)", "t"),
        ("wp.tile_dot(s, t)", "tiles of one shape as 'a' and 'b', got (4,) and (2, 3)", "t"),
        ("wp.tile_sum(t, 2)", "axis must be a dimension of the tile, which has 2, got 2", "2"),
        ("wp.tile_min(v)", "expects a tile of numbers as 'a', but got 'tile(", "v"),
        ("wp.tile_fft(v)", "expects a tile of vec2 of floats as 'inout', but got 'tile(", "v"),
        ("wp.tile_store(a, i)", "must have the same dtype, got float32 and int32", "i"),
        ("wp.tile_broadcast(s, 3)", "cannot broadcast shape (4,) to (3,)", None),
    ],
)
def test_tiles_that_do_not_fit(call, message, place, error_of):
    text, shown = error_of(
        "s = wp.tile_load(a, 4)",
        "t = wp.tile_load(m, (2, 3))",
        "v, q = wp.tile_zeros(4, wp.vec3), wp.tile_zeros((4, 4))",
        "i = wp.tile_zeros(4, int)",
        call,
    )
    assert message in text, text
    assert shown == (place or call), text


# A variable has the new value of an argument from then on: in loops, too.
def test_updated_arguments(text_of):
    body = "t = wp.tile_load(m, (4, 4))", "for i in range(n):"
    text = text_of(*body, "    wp.tile_cholesky_inplace(A=t)", "wp.tile_store(m, t)")
    assert "iter_args" in text
    assert text == text_of(*body, "    t = wp.tile_cholesky(t)", "wp.tile_store(m, t)")


def _home(part):
    """The class with the fields of a part of a call."""
    homes = {**translator._PARTS, **tiles._TOPICS, "builder": Builder, "session": Session}
    return tiles.Tiles if part == "tiles" else homes[part]


# Expressions of records begin with fields of the call, or of the parts of the front end.
def test_records_name_what_there_is():
    text = Path(builtin_calls.__file__).read_text()
    chains = set(re.findall(r"\bcall\.(\w+(?:\.\w+)*)", text))
    assert len(chains) > 30
    for chain in chains:
        *parts, name = chain.split(".")
        parts = parts[:-1] if parts[-1:] == ["node"] else parts
        assert hasattr(_home(parts[-1]) if parts else Call, name), chain
    assert all(Overload(*one) for entry in builtin_calls.CALLS.values() for one in entry)
