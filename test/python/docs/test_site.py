"""The documentation: every public name, every printed program, every notebook, no warning."""

import ast
import functools
import http.server
import importlib
import re
import shutil
import subprocess
import sys
import threading
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


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder with the site, which has to build without warnings."""
    pytest.importorskip("sphinx.application")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html"]
    done = subprocess.run([*command, DOCS, folder], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-4000:]
    return folder


def test_the_site_builds_without_warnings(site):
    for page in ("index", "start", "api/index", "tutorials/fem", "how-to/arrays"):
        assert (site / f"{page}.html").is_file()


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *arguments):
        pass


@pytest.fixture
def versions(site, tmp_path):
    """A folder with the site and an older version, which has no page of tutorials."""
    new, old = tmp_path / wp.__version__, tmp_path / "1.18.0"
    for folder in (new, old):
        shutil.copytree(site, folder)
        (folder / "versions.js").write_text(
            f'window.siteVersions = ["{wp.__version__}", "1.18.0"];\n'
        )
    for page in old.rglob("*.html"):
        page.write_text(
            page.read_text().replace(
                f"<option>{wp.__version__}</option>", "<option>1.18.0</option>"
            )
        )
    (old / "tutorials" / "fem.html").unlink()
    return tmp_path


@pytest.fixture
def server(versions):
    """The address of these versions."""
    handler = functools.partial(Quiet, directory=versions)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as found:
        threading.Thread(target=found.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{found.server_port}"
        found.shutdown()


def switched(browser, address, name):
    """Opens a page, checks its versions, chooses one; the address that opens, and after going back
    the version that is shown."""
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    page.set_default_timeout(120_000)
    page.goto(address)
    shown = page.eval_on_selector_all("#version option", "all => all.map(one => one.text)")
    assert shown == [wp.__version__, "1.18.0"]
    before = page.input_value("#version")
    with page.expect_navigation():
        page.select_option("#version", name)
    found, after = page.url, page.input_value("#version")
    page.go_back()
    back = page.input_value("#version")
    page.close()
    assert back == before
    return found, before, after


def test_a_site_of_one_version_names_it(site, browser):
    assert f'["{wp.__version__}"' in (DOCS / "versions.js").read_text()
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    problems = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda said: problems.append(said.text) if said.type == "error" else None)
    page.goto((site / "tutorials" / "fem.html").as_uri())
    shown = page.eval_on_selector_all("#version option", "all => all.map(one => one.text)")
    assert shown == [wp.__version__]
    assert page.is_visible("#version")
    assert problems == []
    page.close()


def test_the_switch_opens_the_same_page_of_another_version(server, browser):
    """Or the first page, where the other version has no such page."""
    new, old = f"{server}/{wp.__version__}", f"{server}/1.18.0"
    found = switched(browser, f"{new}/how-to/arrays.html", "1.18.0")
    assert found == (f"{old}/how-to/arrays.html", wp.__version__, "1.18.0")
    found = switched(browser, f"{old}/index.html", wp.__version__)
    assert found == (f"{new}/index.html", "1.18.0", wp.__version__)
    found = switched(browser, f"{new}/tutorials/fem.html", "1.18.0")
    assert found[0] == f"{old}/index.html"


def test_the_switch_works_without_a_server(versions, browser):
    address = (versions / wp.__version__ / "how-to" / "arrays.html").as_uri()
    found = switched(browser, address, "1.18.0")
    assert found == ((versions / "1.18.0" / "index.html").as_uri(), wp.__version__, "1.18.0")
