"""Exceptions: hierarchy, places, carets."""

import pickle

import pytest

import warp as wp
from warp.extend import errors


@pytest.mark.parametrize(
    "kind, cls, base",
    [
        ("type", wp.WarpCodegenTypeError, TypeError),
        ("value", wp.WarpCodegenValueError, ValueError),
        ("index", wp.WarpCodegenIndexError, IndexError),
        ("attribute", wp.WarpCodegenAttributeError, AttributeError),
        ("key", wp.WarpCodegenKeyError, KeyError),
        ("overflow", wp.WarpCodegenOverflowError, OverflowError),
        ("compile", wp.WarpCodegenError, RuntimeError),
        ("parse", wp.WarpCodegenError, RuntimeError),
        ("launch", wp.WarpLaunchError, RuntimeError),
        ("launchtype", wp.WarpLaunchError, TypeError),
        ("launchvalue", wp.WarpLaunchError, ValueError),
        ("memory", wp.WarpError, MemoryError),
        ("runtime", wp.WarpError, RuntimeError),
        ("unheard of", wp.WarpError, RuntimeError),
    ],
)
def test_kinds_from_the_runtime(kind, cls, base):
    error = errors.from_native(kind, "no\nhint: yes")
    assert isinstance(error, cls) and isinstance(error, base) and isinstance(error, wp.WarpError)
    assert str(error) == "no\nhint: yes" and error.hint == "yes"


def test_place_and_caret(tmp_path):
    path = tmp_path / "kernel.py"
    path.write_text("def f(x):\n\ty = x + 1\n    z = x\n")
    error = wp.WarpCodegenTypeError(
        "bad operands", file=str(path), line=2, column=6, end_column=11, notes=("n",), hint="h"
    )
    assert str(error) == (
        f"{path}:2:6: bad operands\n    y = x + 1\n        ^~~~~\nnote: n\nhint: h"
    )


@pytest.mark.parametrize("line, column, end", [(1, 0, 0), (1, 99, 3), (77, 1, 2), (1, 1, 0)])
def test_places_that_make_no_sense_are_harmless(tmp_path, line, column, end):
    path = tmp_path / "kernel.py"
    path.write_text("x = 1\n")
    text = str(wp.WarpError("m", file=str(path), line=line, column=column, end_column=end))
    assert text.startswith(f"{path}:{line}") and "m" in text


def test_missing_file_shows_the_place_only():
    assert str(wp.WarpError("m", file="/none.py", line=3, column=2)) == "/none.py:3:2: m"


def test_key_errors_are_not_quoted():
    assert str(wp.WarpCodegenKeyError("'x' is not defined")) == "'x' is not defined"


def test_errors_can_be_pickled():
    error = pickle.loads(pickle.dumps(wp.WarpCodegenTypeError("m", file="f", line=3, hint="h")))
    assert (error.message, error.line, error.hint) == ("m", 3, "h")
