"""Exported symbols, dependencies and committed docs of the build."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
LIBRARY = ROOT / "build" / "python" / "warp" / "libwarp.so"
LLVM_BIN = Path("/usr/lib/llvm-22/bin")

needs_build = pytest.mark.skipif(
    not (LIBRARY.is_file() and (LLVM_BIN / "llvm-nm").is_file()),
    reason="needs a build tree and LLVM's tools",
)


def run(*command: object) -> str:
    return subprocess.run(
        [str(part) for part in command], check=True, capture_output=True, text=True
    ).stdout


def c_functions():
    """The functions that warp/warp.h declares."""
    header = (ROOT / "include" / "warp" / "warp.h").read_text()
    return set(re.findall(r"^WARP_C_API [^(;]*?\b(warp_\w+)\(", header, re.MULTILINE))


# GDB's interface for JIT compilers finds them by these names.
DEBUGGER = {"__jit_debug_descriptor", "__jit_debug_register_code"}


@needs_build
def test_only_namespace_warp_and_the_c_interface_are_exported():
    names = [
        line.split()[-1]
        for line in run(LLVM_BIN / "llvm-nm", "-D", "--defined-only", LIBRARY).splitlines()
    ]
    prefixes = ("_ZN4warp", "_ZNK4warp", "_ZTIN4warp", "_ZTSN4warp", "_ZTVN4warp")
    others = {name for name in names if not name.startswith(prefixes)}
    assert len(c_functions()) > 10
    assert others == c_functions() | DEBUGGER
    assert len(names) > 1


@needs_build
def test_library_needs_only_the_c_and_cpp_run_time():
    lines = run(LLVM_BIN / "llvm-readelf", "-d", LIBRARY).splitlines()
    needed = {line.split("[")[1].rstrip("]") for line in lines if "(NEEDED)" in line}
    allowed = {"libc.so.6", "libm.so.6", "libstdc++.so.6", "libgcc_s.so.1", "ld-linux-x86-64.so.2"}
    assert needed <= allowed


PROGRAM = """
import ctypes
{first}
{second}
import warp as wp

@wp.kernel
def scale(x: wp.array(dtype=float), a: float):
    i = wp.tid()
    x[i] = a * x[i]

x = wp.ones(5, dtype=float, device="cpu")
wp.launch(scale, dim=5, inputs=[x, 3.0], device="cpu")
print(x.numpy().sum())
"""


@needs_build
@pytest.mark.parametrize("order", ["warp-first", "other-first"])
def test_lives_beside_another_mlir(order, tmp_path):
    """The same LLVM and MLIR with public symbols in the process change nothing."""
    others = sorted(LLVM_BIN.parent.joinpath("lib").glob("libMLIR.so.*"))
    if not others:
        pytest.skip("no shared MLIR here")
    steps = ["import warp", f"ctypes.CDLL({str(others[0])!r}, ctypes.RTLD_GLOBAL)"]
    if order == "other-first":
        steps.reverse()
    script = tmp_path / "program.py"
    script.write_text(PROGRAM.format(first=steps[0], second=steps[1]))
    environment = os.environ | {"WARP_CACHE_PATH": str(tmp_path / "cache")}
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().endswith("15.0")


@needs_build
def test_committed_references_are_up_to_date(tmp_path):
    subprocess.run([ROOT / "scripts" / "make_docs.sh", tmp_path], check=True)
    stale = [
        page.name
        for page in sorted(tmp_path.iterdir())
        if not (ROOT / "docs" / page.name).is_file()
        or (ROOT / "docs" / page.name).read_text() != page.read_text()
    ]
    assert stale == [], "run 'make docs' and commit the result"


def test_a_wheel_takes_the_objects_of_the_optimised_build():
    """`make wheel` builds in the folder of `make release`: nothing is compiled again only if the
    settings are the same, but for what is built beside the package."""
    tomllib = pytest.importorskip("tomllib")
    presets = json.loads((ROOT / "CMakePresets.json").read_text())["configurePresets"]
    settings = {}
    for preset in presets:
        if preset["name"] in ("base", "release"):
            settings |= preset["cacheVariables"]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["scikit-build"]
    wheel = dict(project["cmake"]["define"], CMAKE_BUILD_TYPE=project["cmake"]["build-type"])
    for beside in ("WARP_BUILD_TESTS", "WARP_BUILD_TOOLS"):
        settings.pop(beside, None)
        wheel.pop(beside, None)
    assert wheel == settings
    wheel_rule = (ROOT / "Makefile").read_text().partition("\nwheel: release\n")[2]
    assert "-C build-dir=build/release" in wheel_rule.partition("\n\n")[0]


@needs_build
def test_wheels_get_no_module_of_later_sources(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import finish_wheel

    module = next(LIBRARY.parent.glob("_native*.so"))
    assert finish_wheel.missing_functions(module, LIBRARY) == []
    # The library that only loads has fewer functions, as an older one has.
    fewer = (ROOT / "build" / "lib" / "libwarp_runtime.so").read_bytes()
    with pytest.raises(
        SystemExit, match=r"calls \d+ functions that the wheel's libwarp.so .* run 'make wheel"
    ):
        finish_wheel.check_module("cp311", module.read_bytes(), fewer)
