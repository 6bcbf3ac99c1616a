"""The documentation: every public name, every printed program, every notebook, no warning."""

import ast
import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

import programs
import warp as wp

ROOT = Path(__file__).resolve().parents[3]
DOCS = ROOT / "docs"
STUB = Path(wp.__file__).with_suffix(".pyi")
RECIPES = sorted(path for path in (DOCS / "how-to").glob("*.md") if path.stem != "index")
TUTORIALS = sorted(path for path in (DOCS / "tutorials").glob("*.md") if path.stem != "index")
# Packages that a page asks for.
NEEDED = {"inverse": ["torch"], "jax": ["jax"], "output": ["pxr", "trimesh"]}
MODULES = ["warp.autograd", "warp.fem", "warp.geometry", "warp.optim", "warp.optim.linear"]
MODULES += ["warp.extend", "warp.render", "warp.report", "warp.sparse", "warp.utils"]


def blocks(path):
    return re.findall(r"```python\n(.*?)```", path.read_text(), flags=re.DOTALL)


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The pages of the reference by name."""
    folder = tmp_path_factory.mktemp("reference")
    script = ROOT / "scripts" / "make_reference.py"
    subprocess.run([sys.executable, script, folder], check=True)
    return {page.stem: page.read_text() for page in folder.glob("*.md")}


def documented(text) -> set:
    """Names of the directives of a page, not those of members."""
    return set(re.findall(r"^`{6}\{py:\w+\} (\w+)", text, flags=re.MULTILINE))


def stub_names():
    for node in ast.parse(STUB.read_text()).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            yield node.name
        elif isinstance(node, ast.ImportFrom):
            yield from (alias.asname for alias in node.names if alias.asname)
        elif isinstance(node, ast.AnnAssign):
            yield node.target.id


def test_reference_has_every_name_of_the_stub(reference):
    found = {
        name
        for page, text in reference.items()
        if page.startswith("warp-")
        for name in documented(text)
    }
    public = {name for name in stub_names() if not name.startswith("_")}
    assert len(public) > 600
    assert sorted(public - found) == []


@pytest.mark.parametrize("name", MODULES)
def test_reference_has_every_name_of_a_module(reference, name):
    module = importlib.import_module(name)
    public = {
        each
        for each in getattr(module, "__all__", None) or dir(module)
        if not each.startswith("_")
        and (getattr(getattr(module, each), "__module__", None) or "").startswith("warp")
    }
    assert public
    assert sorted(public - documented(reference[name])) == []


def test_reference_has_every_setting(reference):
    from warp._src.config import SETTINGS

    assert [name for name in SETTINGS if f"| `{name}` |" not in reference["settings"]] == []


def test_reference_has_every_header_that_programs_include(reference):
    """Headers of the examples, the tutorial, and what these include of arrays and kernels."""
    programs = [*(ROOT / "examples" / "cpp").glob("*.cpp"), *(ROOT / "examples" / "c").glob("*.c")]
    text = "".join(path.read_text() for path in programs)
    text += (DOCS / "tutorials" / "cpp.md").read_text()
    included = set(re.findall(r'#include "(warp/\w+\.h)"', text))
    assert {"warp/warp.h", "warp/SavedModule.h", "warp/Array.h"} <= included
    assert included <= set(re.findall(r"^## `(warp/\w+\.h)`", reference["cpp"], re.MULTILINE))
    for guard in re.findall(r'start-after: "#define (\w+)"', reference["cpp"]):
        assert re.fullmatch(r"WARP_\w+_H", guard)


def test_decisions_are_listed_by_their_titles():
    """Each page has evidence, and a line with its number and title in the index, in order."""
    pages = sorted((DOCS / "decisions").glob("0*.md"))
    lines = []
    for path in pages:
        number, title = path.read_text().splitlines()[0].removeprefix("# ").split(". ", 1)
        assert path.name.startswith(f"{number}-"), path.name
        assert "## Evidence" in path.read_text(), path.name
        lines.append(f"- [{number}]({path.name}) {title}")
    index = (DOCS / "decisions" / "README.md").read_text()
    assert re.findall(r"^- \[.*$", index, re.MULTILINE) == lines


def test_there_are_ten_tutorials_and_forty_recipes():
    assert len(TUTORIALS) == 10
    text = "".join(re.sub(r"```.*?```", "", path.read_text(), flags=re.DOTALL) for path in RECIPES)
    assert len(re.findall(r"^## ", text, flags=re.MULTILINE)) >= 40


@pytest.mark.parametrize(
    "path", [DOCS / "index.md", DOCS / "start.md", *RECIPES], ids=lambda path: path.stem
)
def test_printed_programs_run(path):
    for package in NEEDED.get(path.stem, []):
        pytest.importorskip(package)
    status, _, err = programs.run(programs.write_program("\n\n".join(blocks(path))))
    assert status == 0, err


@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_tutorials_run_as_notebooks(path, tmp_path):
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    for package in NEEDED.get(path.stem, []):
        pytest.importorskip(package)
    script = ROOT / "scripts" / "make_notebooks.py"
    subprocess.run([sys.executable, script, tmp_path], check=True)
    notebook = nbformat.read(tmp_path / f"{path.stem}.ipynb", as_version=4)
    nbformat.validate(notebook)
    nbclient.NotebookClient(
        notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert len(code) == len(blocks(path))
    assert any(cell.outputs for cell in code)


def test_links_of_pages_lead_somewhere():
    for path in [
        *RECIPES,
        *TUTORIALS,
        DOCS / "how-to" / "index.md",
        DOCS / "tutorials" / "index.md",
    ]:
        for target in re.findall(r"\]\(([^)#:]+)[^)]*\)", path.read_text()):
            generated = target.startswith("../api/")
            assert generated or (path.parent / target).exists(), f"{path.name}: {target}"


def test_the_site_builds_without_warnings(tmp_path):
    pytest.importorskip("sphinx.application")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html"]
    done = subprocess.run([*command, DOCS, tmp_path / "site"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-4000:]
    for page in ("index", "start", "api/index", "tutorials/fem", "how-to/arrays"):
        assert (tmp_path / "site" / f"{page}.html").is_file()
