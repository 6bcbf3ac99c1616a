"""The wheel of `warp-opt`."""

import subprocess
import sys
from pathlib import Path

import pytest

import warp as wp

ROOT = Path(__file__).resolve().parents[3]
TOOL = ROOT / "build" / "bin" / "warp-opt"


@pytest.mark.parametrize(
    ("script", "option"),
    [("make_tools", "--tool"), ("make_runtime", "--library"), ("make_vdb", "--library")],
)
def test_what_is_not_built_is_named(tmp_path, script, option):
    """One line names the absent file and the command that builds it."""
    command = [sys.executable, ROOT / "scripts" / f"{script}.py", tmp_path / "dist"]
    done = subprocess.run([*command, option, tmp_path / "absent"], capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith(f"no '{tmp_path}/absent': 'make {script.removeprefix('make_')}'")
    assert done.stderr.count("\n") == 1


@wp.kernel
def scale(x: wp.array(dtype=float), a: float):
    i = wp.tid()
    x[i] = a * x[i]


@pytest.mark.skipif(not TOOL.is_file(), reason="needs warp-opt")
def test_pip_installs_a_tool_that_runs_passes(tmp_path):
    """pip puts it among the scripts; it lowers a kernel's IR and emits PTX."""
    script = ROOT / "scripts" / "make_tools.py"
    made = [sys.executable, script, tmp_path / "dist", "--tool", TOOL, "--level", "0"]
    subprocess.run(made, check=True, capture_output=True)
    (wheel,) = (tmp_path / "dist").iterdir()
    assert wheel.name.startswith("warp_mlir_tools-") and "-py3-none-manylinux_2_28_" in wheel.name
    place = tmp_path / "prefix"
    install = [sys.executable, "-m", "pip", "install", "-q", "--no-index", "--ignore-installed"]
    subprocess.run([*install, "--prefix", place, wheel], check=True, capture_output=True)
    (info,) = place.rglob("warp_mlir_tools-*.dist-info")
    assert (info / "licenses" / "THIRD_PARTY.md").is_file()
    (source := tmp_path / "scale.mlir").write_text(scale.ir("warp"))

    def run(*options):
        done = [place / "bin" / "warp-opt", source, *options]
        return subprocess.run(done, check=True, capture_output=True, text=True).stdout

    assert "warp.group" in run("--warp-pipeline=to-launch")
    assert ".visible .entry" in run("--warp-emit=ptx", "--warp-options=target=sm_80")
