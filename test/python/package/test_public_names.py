"""Public names: the stub, `dir(warp)` and the reference hold the same ones."""

import ast
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest
from warp._src.builtin_table import BUILTINS, LIBRARY

import warp as wp
from warp._src.language.public import library_function

STUB = Path(wp.__file__).with_suffix(".pyi")
REFERENCE = Path(__file__).resolve().parents[3] / "docs" / "builtins.md"


def stub_definitions():
    """(name, node) of what the stub defines or imports under a name."""
    for node in ast.parse(STUB.read_text()).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            yield node.name, node
        elif isinstance(node, ast.AnnAssign):
            yield node.target.id, node
        elif isinstance(node, ast.Assign):
            yield from ((target.id, node) for target in node.targets)
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            yield from ((alias.asname, node) for alias in node.names if alias.asname)


def public(names):
    return {name for name in names if not name.startswith("_")}


@pytest.fixture(scope="module")
def held():
    """`dir(warp)` of a program that has imported nothing else of the package."""
    program = "import warp, sys; sys.stderr.write(' '.join(dir(warp)))"
    shown = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True)
    return public(shown.stderr.decode().split())


def test_stub_has_all_public_names(held):
    in_stub = public(name for name, _ in stub_definitions())
    assert sorted(held ^ in_stub) == []


def test_all_public_names_are_found(held):
    assert [name for name in held if getattr(wp, name, None) is None] == []


def test_reference_has_all_names_that_kernels_may_call():
    headings = set(re.findall(r"^### (\w+)", REFERENCE.read_text(), re.MULTILINE))
    assert headings == {*BUILTINS, *LIBRARY}


def calls_of(overloads):
    """The parameters that calls may give, of (names, number of defaults) of each overload."""
    return {
        tuple(names[: len(names) - missing])
        for names, defaults in overloads
        for missing in range(defaults + 1)
    }


def calls_in_stub(name):
    nodes = [node.args for defined, node in stub_definitions() if defined == name]
    return calls_of(([arg.arg for arg in node.args], len(node.defaults)) for node in nodes)


@pytest.mark.parametrize("name", LIBRARY)
def test_records_of_library_functions_have_their_parameters(name):
    overloads = library_function(name).overloads
    written = [
        (list(inspect.signature(one).parameters), len(one.__defaults__ or ())) for one in overloads
    ]
    assert calls_in_stub(name) == calls_of(written)


def test_absent_names_have_hints():
    import numpy  # noqa: F401

    with pytest.raises(AttributeError, match=r"'linspace', NumPy has: `wp.array\(np.linspace"):
        _ = wp.linspace
    code = "import warp as wp; wp.aray"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "module 'warp' has no attribute 'aray'. Did you mean: 'array'?" in run.stderr
    assert not hasattr(wp, "nothing_of_this_name")
