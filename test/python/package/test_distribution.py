"""The distribution as other programs see it: its name and version, and the stand-in."""

import re
import subprocess
import sys
import zipfile
from importlib import metadata
from pathlib import Path

import pytest

import warp as wp

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "scripts"))

from install_package import PACKAGE, write_wheel  # noqa: E402
from wheels import project_version  # noqa: E402


def installed(folder) -> dict:
    """Names and versions of the distributions in a folder."""
    return {one.metadata["Name"]: one for one in metadata.distributions(path=[str(folder)])}


def unpacked(wheel, folder):
    with zipfile.ZipFile(wheel) as archive:
        names = [name for name in archive.namelist() if ".dist-info/" in name]
        archive.extractall(folder, names)
    return installed(folder)


def numbers(version) -> tuple:
    return tuple(int(number) for number in re.findall(r"\d+", version)[:2])


def test_one_version():
    """The package says the version of its distribution."""
    assert wp.__version__ == wp.config.version == project_version()


def test_clients_find_a_recent_warp(tmp_path):
    """Clients look for a distribution `warp` or `warp-...` and ask for 0.6.0 or more."""
    if not (PACKAGE / "__init__.py").is_file():
        pytest.skip("needs a build tree")
    found = unpacked(write_wheel(tmp_path), tmp_path / "there")
    assert list(found) == ["warp-mlir"]
    assert numbers(found["warp-mlir"].version) >= (1, 19)
    assert found["warp-mlir"].requires == ["numpy>=1.24"]


def test_stand_in_for_warp_lang(tmp_path):
    """The shim satisfies `warp-lang>=1.19`, needs this very package and holds no files."""
    command = [sys.executable, ROOT / "scripts" / "make_shim.py", tmp_path]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    (found,) = unpacked(wheel, tmp_path / "there").values()
    assert found.metadata["Name"] == "warp-lang"
    assert found.version == f"{project_version()}+mlir"
    assert found.requires == [f"warp-mlir=={project_version()}"]
    with zipfile.ZipFile(wheel) as archive:
        assert all(".dist-info/" in name for name in archive.namelist())


def test_pip_takes_the_stand_in(tmp_path):
    """pip installs the shim, and then a requirement of `warp-lang` is met."""
    command = [sys.executable, ROOT / "scripts" / "make_shim.py", tmp_path]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    pip = [sys.executable, "-m", "pip", "install", "-q", "--disable-pip-version-check"]
    options = ["--no-index", "--no-deps", "--target", str(tmp_path / "there")]
    subprocess.run([*pip, *options, wheel], check=True, capture_output=True)
    assert list(installed(tmp_path / "there")) == ["warp-lang"]
