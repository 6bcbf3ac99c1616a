"""Which module imports which: no cycles, and nothing heavy before it is needed."""

import ast
import subprocess
import sys

import pytest

from import_graph import called, cycles, import_graph

# Modules that `import warp` leaves to their users.
LAZY = ("numpy", "torch", "jax", "matplotlib", "inspect", "linecache", "pathlib", "ast")
LAZY += ("warp._src.frontend", "warp._src.derivatives.backward")
LAZY += ("warp._src.autograd", "warp._src.optim")


def test_no_cycles():
    assert cycles(import_graph()) == []


# The search for cycles sees those that only a function closes, and whole packages.
def test_cycles_are_found():
    assert cycles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [["a", "b", "c"]]
    graph = import_graph()
    graph["warp._src.version"].add("warp._src.arrays.array")
    (found,) = cycles(graph)
    assert {"warp._src.version", "warp._src.arrays.array"} <= set(found)
    assert "warp._src.frontend.build" in import_graph()["warp._src.kernels.translations"]
    assert "warp._src.frontend.build" not in import_graph(False)["warp._src.kernels.translations"]


# A module that is named in a string is imported, too.
@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("importlib.import_module('warp._src.errors')", {"warp._src.errors"}),
        ("__import__('warp._src.version')", {"warp._src.version"}),
        ("import_module(f'warp._src.{name}')", {"warp._src.errors", "warp._src.version"}),
        ("import_module(name)", {"warp", "warp._src.errors", "warp._src.version"}),
        ("find_module('warp._src.errors')", set()),
    ],
)
def test_imports_by_name_are_seen(text, found):
    known = ("warp", "warp._src.errors", "warp._src.version")
    assert called(ast.parse(text, mode="eval").body, known) == found


# Nothing but the package itself asks for names of the package.
def test_nothing_imports_the_public_names():
    graph = import_graph()
    importers = {name for name, found in graph.items() if "warp" in found}
    folders = (
        "compat",
        "geometry.device",
        "geometry.meshing",
        "geometry.surfaces",
        "optim",
        "sparse",
        "utils",
    )
    libraries = ("warp.fem.", "warp.report.", *(f"warp._src.{name}." for name in folders))
    strangers = {name for name in importers if not name.startswith(libraries)}
    assert not strangers


@pytest.mark.parametrize("name", LAZY)
def test_import_is_lazy(name, loaded):
    assert name not in loaded


@pytest.fixture(scope="module")
def loaded():
    """Modules that a process has after `import warp`, and not before."""
    code = "import sys; before = set(sys.modules); import warp; print(*sys.modules.keys() - before)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.parametrize("name", ["add_builtin", "add_native_type"])
def test_what_needs_generated_code_is_refused(name):
    from warp import build_experimental

    with pytest.raises(RuntimeError, match=f"{name}' is not in this package, as kernels are not"):
        getattr(build_experimental, name)("name", {})
