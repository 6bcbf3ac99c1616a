"""Type checkers report nothing about programs that run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import warp as wp

ROOT = Path(__file__).resolve().parents[3]
PACKAGE = Path(wp.__file__).parent

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


def test_stubs_and_examples_have_no_errors(check):
    assert check(PACKAGE / "__init__.pyi", PACKAGE / "config.pyi") == []
    assert check(ROOT / "examples") == []


def test_errors_are_found(check, tmp_path):
    program = tmp_path / "wrong.py"
    program.write_text(WRONG)
    found = [line.split(":", 2) for line in check(program) if ": error:" in line]
    assert [int(line) for _, line, _ in found] == [10, 11, 12, 12]
    messages = [message for _, _, message in found]
    assert '"mesh_query_point"' in messages[0]
    assert 'Module has no attribute "quit"' in messages[1]
