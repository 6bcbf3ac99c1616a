"""Two distributions of one package: the error at import, and the repair."""

import base64
import hashlib
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from warp import install
from warp._src import beside


def record(folder, name, version, files):
    """A distribution in a folder, with files and their hashes."""
    info = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    lines = []
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
        digest = base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).rstrip(b"=")
        lines.append(f"{path},sha256={digest.decode()},{len(text)}\n")
    (info / "RECORD").write_text("".join(lines) + f"{info.name}/METADATA,,\n")


@pytest.fixture
def site(tmp_path, monkeypatch):
    """A folder of packages that comes before all others."""
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


OURS = {"warp/__init__.py": "ours", "warp/_src/errors.py": "ours too"}
THEIRS = {"warp/__init__.py": "theirs", "warp/_src/context.py": "theirs"}


def test_files_of_both_are_an_error_with_the_command(tmp_path, monkeypatch):
    beside.check(str(tmp_path))
    (tmp_path / "_src").mkdir()
    (tmp_path / "_src" / "context.py").write_text("")
    with pytest.raises(ImportError, match="run `python -m warp.install --replace`"):
        beside.check(str(tmp_path))
    monkeypatch.setattr(sys, "orig_argv", ["python", "-m", "warp.install"])
    beside.check(str(tmp_path))


def test_an_init_of_theirs_over_ours_names_the_file_to_run(tmp_path):
    """`pip install warp-lang` over warp-mlir: even `python -m warp.install` imports their file."""
    package = tmp_path / "warp"
    for source in ("_src/types/__init__.py", "_src/beside.py", "install.py"):
        (package / source).parent.mkdir(parents=True, exist_ok=True)
        (package / source).write_bytes((Path(install.__file__).parent / source).read_bytes())
    (package / "__init__.py").write_text("from warp._src.types import Int as Int\n")
    for source in ("_src/__init__.py", "_src/context.py", "_src/types.py"):
        (package / source).write_text("Int = int\n")

    def run(*arguments):
        return subprocess.run(
            [sys.executable, *arguments], capture_output=True, text=True, cwd=tmp_path, env={}
        )

    for program in (("-c", "import warp"), ("-m", "warp.install", "--replace")):
        assert f"run `python -I '{package / 'install.py'}' --replace`" in run(*program).stderr
    assert "warp-mlir" in run("-I", str(package / "install.py")).stdout


def test_replace_restores_what_uninstalling_deletes(site, monkeypatch):
    record(site, "warp-lang", "1.19.0", THEIRS)
    record(site, "warp-mlir", "1.19.0", OURS)
    calls = []

    def pip(*arguments):
        calls.append(arguments)
        for path in THEIRS:
            (site / path).unlink()
        shutil.rmtree(site / "warp_lang-1.19.0.dist-info")

    monkeypatch.setattr(install, "pip", pip)
    said = install.replace()
    assert said == "removed warp-lang 1.19.0, restored 1 files of warp-mlir 1.19.0"
    assert calls == [("uninstall", "-y", "--quiet", "warp-lang")]
    assert {path: (site / path).read_text() for path in OURS} == OURS
    assert not (site / "warp" / "_src" / "context.py").exists()


def test_damaged_files_are_installed_again(site, monkeypatch):
    record(site, "warp-mlir", "1.19.0", OURS)
    record(site, "warp-lang", "1.19.0", THEIRS)
    calls = []

    def pip(*arguments, hint=""):
        calls.append(arguments)
        if arguments[0] == "wheel":
            (Path(arguments[4]) / "found.whl").write_text("")

    monkeypatch.setattr(install, "pip", pip)
    assert "1 files are missing or another's" in install.report()
    assert install.replace("dist") == ("removed warp-lang 1.19.0, installed warp-mlir 1.19.0 again")
    assert [call[0] for call in calls] == ["wheel", "uninstall", "install"]
    assert calls[0][-3:] == ("--find-links", "dist", "warp-mlir==1.19.0")
    assert calls[2][-1].endswith("found.whl")


def test_nothing_is_removed_where_no_wheel_is_found(site, monkeypatch):
    record(site, "warp-mlir", "1.19.0", OURS)
    record(site, "warp-lang", "1.19.0", THEIRS)
    ran = []

    def run(command):
        ran.append(command[3])
        return subprocess.CompletedProcess(command, 1)

    monkeypatch.setattr(install.subprocess, "run", run)
    with pytest.raises(SystemExit, match="nothing was removed: .* `--find-links FOLDER`"):
        install.replace()
    assert ran == ["wheel"]


def test_the_shim_is_no_clash(site):
    record(site, "warp-mlir", "1.19.0", OURS)
    record(site, "warp-lang", "1.19.0+mlir", {})
    assert install.replace() == "nothing to do: warp-mlir 1.19.0 is alone"
    assert "stands for warp-mlir" in install.report()
