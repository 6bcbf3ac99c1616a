"""Import graph: no cycles, and nothing heavy before it is needed."""

import ast
import re
import subprocess
import sys

import pytest

from import_graph import called, cycles, import_graph, modules

# Modules that `import warp` leaves to their users.
LAZY = ("numpy", "torch", "jax", "matplotlib", "inspect", "linecache", "pathlib", "ast")
LAZY += ("warp._src.frontend", "warp._src.derivatives.backward")
LAZY += (
    "warp._src.autograd",
    "warp._src.optim",
    "warp._src.interop.jax",
    "warp._src.interop.paddle",
)


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
        "distributed",
        "fem",
        "geometry.device",
        "geometry.meshing",
        "geometry.surfaces",
        "optim",
        "render",
        "sparse",
        "utils",
    )
    libraries = (
        "warp.compare.",
        "warp.fem.",
        "warp.examples.",
        "warp.report.",
        *(f"warp._src.{name}." for name in folders),
    )
    strangers = {name for name in importers if not name.startswith(libraries)}
    assert not strangers


# Parts of the package that stand on its public names and on `warp.extend`.
LIBRARIES = ("fem", "optim", "render", "sparse", "utils")
# Algorithms whose native code is a part of them.
NATIVE = {
    *("warp._src.sparse.number_product", "warp._src.utils.cuda_sequences"),
    *("warp._src.utils.sequences", "warp._src.optim.linear.direct_factors"),
    "warp._src.optim.linear.direct_cudss",
}


@pytest.mark.parametrize("library", [*(f"warp._src.{name}" for name in LIBRARIES), "warp.report"])
def test_libraries_import_public_names_alone(library):
    graph = import_graph()
    members = {name for name in graph if name == library or name.startswith(f"{library}.")}
    assert len(members) > 5
    for name in members:
        private = {one for one in graph[name] if one.startswith("warp._src.")}
        assert {one for one in private if one not in members} == set(), name
        text = modules()[name].read_text(encoding="utf-8")
        assert ("_native" in re.findall(r"\w+", text)) == (name in NATIVE), name


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
