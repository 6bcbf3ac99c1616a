"""Type checkers report nothing about programs that run."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import programs
import warp as wp

ROOT = Path(__file__).resolve().parents[3]
PACKAGE = Path(wp.__file__).parent
PROGRAMS = sorted((ROOT / "test" / "typing").glob("*.py"))
GUIDES = (
    "index",
    "start",
    "guide",
    "graphs",
    "differentiation",
    "extend",
    "geometry",
    "report",
    "tiles",
)
PAGES = [ROOT / "README.md", *(ROOT / "docs" / f"{page}.md" for page in GUIDES)]
for topic in ("tutorials", "how-to"):
    found = sorted((ROOT / "docs" / topic).glob("*.md"))
    PAGES += [page for page in found if page.stem != "index"]

WRONG = """
import warp as wp

@wp.kernel
def follow(mesh: wp.uint64, x: wp.array[wp.vec3], y: wp.array2d[float]):
    i = wp.tid()
    found = wp.mesh_query_point(mesh, x[i], 1.0)
    y[i, 0] = wp.mesh_eval_position(mesh, found.face, found.u, found.v)[0]

wp.mesh_query_point(wp.uint64(0), wp.vec2(), 1.0)
wp.config.quit = True
mesh: wp.Volume = wp.Mesh()
"""


@pytest.fixture(scope="module")
def check(tmp_path_factory):
    """Runs mypy on files and gives what it prints."""
    pytest.importorskip("mypy")
    folder = tmp_path_factory.mktemp("mypy")
    command = [sys.executable, "-m", "mypy", "--follow-imports=silent", f"--cache-dir={folder}"]
    command += [f"--config-file={ROOT / 'pyproject.toml'}", "--no-error-summary"]
    command += ["--check-untyped-defs"]

    def run(*files):
        paths = os.pathsep.join((str(PACKAGE.parent), str(ROOT / "examples")))
        return subprocess.run(
            [*command, *map(str, files)],
            env={**os.environ, "MYPYPATH": paths},
            cwd=folder,
            capture_output=True,
            text=True,
        ).stdout.splitlines()

    return run


def pyright_errors(folder, *files):
    """Errors that pyright reports about files, with the settings of the project."""
    pytest.importorskip("pyright")
    settings = {
        "include": [os.path.relpath(file, folder) for file in files],
        "extraPaths": [str(PACKAGE.parent), str(ROOT / "examples")],
        "typeCheckingMode": "standard",
        "reportMissingImports": False,
        "reportMissingModuleSource": False,
        # Pages define a kernel of one name several times.
        "reportRedeclaration": False,
    }
    (folder / "pyrightconfig.json").write_text(json.dumps(settings))
    command = [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", sys.executable]
    done = subprocess.run([*command, "-p", folder], capture_output=True, text=True, cwd=folder)
    report = json.loads(done.stdout)
    assert report["summary"]["filesAnalyzed"] >= len(files), done.stdout
    return [
        f"{one['file']}:{one['range']['start']['line'] + 1}: {one['message']}"
        for one in report["generalDiagnostics"]
        if one["severity"] == "error"
    ]


def page_programs(folder):
    """The Python blocks of each page as one program, which knows NumPy and the package."""
    for page in PAGES:
        blocks = re.findall(r"```python\n(.*?)```", page.read_text(), flags=re.DOTALL)
        if blocks:
            name = re.sub(r"\W", "_", str(page.relative_to(ROOT).with_suffix("")))
            file = folder / f"{name}.py"
            file.write_text("\n\n".join(blocks))
            yield file


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_programs_of_users_run(path):
    status, _, err = programs.run(path)
    assert status == 0, err


def test_mypy_reports_nothing_about_stubs_examples_and_programs(check):
    assert check(PACKAGE / "__init__.pyi", PACKAGE / "config.pyi") == []
    assert check(ROOT / "examples", *PROGRAMS) == []


def test_pyright_reports_nothing_about_examples_and_programs(tmp_path):
    assert pyright_errors(tmp_path, ROOT / "examples", *PROGRAMS) == []


def test_pyright_reports_nothing_about_documents(tmp_path):
    (tmp_path / "pages").mkdir()
    files = list(page_programs(tmp_path / "pages"))
    assert len(files) == len(PAGES)
    assert pyright_errors(tmp_path, *files) == []


def test_pyright_finds_errors(tmp_path):
    program = tmp_path / "wrong.py"
    program.write_text(WRONG)
    found = pyright_errors(tmp_path, program)
    assert {int(line.split(":")[1]) for line in found} == {10, 11, 12}


def test_errors_are_found(check, tmp_path):
    program = tmp_path / "wrong.py"
    program.write_text(WRONG)
    found = [line.split(":", 2) for line in check(program) if ": error:" in line]
    assert [int(line) for _, line, _ in found] == [10, 11, 12, 12]
    messages = [message for _, _, message in found]
    assert '"mesh_query_point"' in messages[0]
    assert 'Module has no attribute "quit"' in messages[1]


def test_every_builtin_of_the_stub_is_described():
    """An editor shows the summary beside the first overload."""
    import ast

    described, silent = set(), set()
    for node in ast.parse((PACKAGE / "__init__.pyi").read_text()).body:
        if isinstance(node, ast.FunctionDef):
            (described if ast.get_docstring(node) else silent).add(node.name)
    assert sorted(silent - described) == []
