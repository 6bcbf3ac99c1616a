"""Import on systems that lack something: an error with its cause and what to do."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import warp as wp

PACKAGE = Path(wp.__file__).parent
NATIVE = next(PACKAGE.glob("_native*.so"))


def imported(folder, *options):
    """The last line that an import of the package of a folder prints, without other packages."""
    program = f"import sys; sys.path.insert(0, {str(folder)!r}); import warp"
    command = [sys.executable, "-I", *options, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    return done.stderr.strip().splitlines()[-1]


@pytest.fixture
def copy(tmp_path):
    """A package whose files are links, without its extension module."""
    (tmp_path / "warp").mkdir()
    for path in PACKAGE.iterdir():
        if path.name != NATIVE.name:
            (tmp_path / "warp" / path.name).symlink_to(path.resolve())
    return tmp_path


def test_old_glibc(copy):
    """The module asks for a symbol version that no system has."""
    data = NATIVE.read_bytes()
    assert data.count(b"\0GLIBC_2.14\0") == 1
    (copy / "warp" / NATIVE.name).write_bytes(data.replace(b"GLIBC_2.14\0", b"GLIBC_9.14\0"))
    said = imported(copy)
    assert "warp-mlir needs glibc with GLIBC_9.14, and this system has glibc 2." in said
    assert "newer system or container" in said


def test_another_python(copy):
    (copy / "warp" / "_native.cpython-39-x86_64-linux-gnu.so").write_bytes(b"")
    said = imported(copy)
    mine = ".".join(map(str, sys.version_info[:2]))
    assert f"is installed for Python 3.9, and this is {mine}: run" in said
    assert "-m pip install --force-reinstall warp-mlir" in said


def test_no_numpy():
    """Without packages of the site, NumPy among them."""
    said = imported(PACKAGE.parent, "-S")
    assert said == "ImportError: warp-mlir needs NumPy 1.24 or newer: run `pip install numpy`"


def test_no_display_and_a_read_only_home():
    """Pictures are drawn and kernels are compiled where nothing can be shown or kept."""
    program = (
        "import warp as wp, warp.render\n"
        "s = wp.render.Scene(8, 8, device='cpu')\n"
        "s.add_spheres([[0.0, 0.0, 0.0]], 1.0)\n"
        "print(s.render(1).shape)\n"
    )
    keep = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WARP_CACHE_PATH")}
    keep |= {"HOME": "/proc", "XDG_CACHE_HOME": "", "PYTHONPATH": str(PACKAGE.parent)}
    done = subprocess.run(
        [sys.executable, "-c", program], env=keep, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "(8, 8, 3)"
    assert "is not writable, compiled kernels are kept in memory only" in done.stdout + done.stderr
