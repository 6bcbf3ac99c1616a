"""Write dist/warp_mlir_runtime-*.whl: what C++ programs need that launch saved kernels and graphs.

    python scripts/make_runtime.py [FOLDER] [--library libwarp_runtime.so] [--level 2]

The library has no compiler and no LLVM. The wheel has the headers and a CMake configuration too;
`python -m warp_runtime` prints the folder of the latter. It needs neither `warp-mlir` nor NumPy.
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

from wheels import ROOT, pack_wheel, packing_options, project_version, read_wheel, write_wheel

PLATFORM = "manylinux_2_28_x86_64"
SUMMARY = "Runs saved kernels and graphs of Warp on MLIR from C and C++"
MODULE = '''"""Paths of the library, the headers and the CMake configuration."""

from pathlib import Path

FOLDER = Path(__file__).parent


def get_cmake_dir() -> str:
    """The folder for CMake's `warp_runtime_DIR`."""
    return str(FOLDER / "cmake")


def get_include() -> str:
    """The folder of the headers."""
    return str(FOLDER / "include")
'''
MAIN = "from warp_runtime import get_cmake_dir\n\nprint(get_cmake_dir())\n"


def cmake_config() -> str:
    """The configuration of `warp`, for the package, target and library of this wheel."""
    text = (ROOT / "cmake" / "warpConfig.cmake").read_text()
    names = {
        **{"find_package(warp)": "find_package(warp_runtime)", "warp::warp": "warp::runtime"},
        **{"libwarp.so": "libwarp_runtime.so", "`warp/cmake`": "`warp_runtime/cmake`"},
        "warp_FOUND": "warp_runtime_FOUND",
    }
    for name, own in names.items():
        text = text.replace(name, own)
    return text


def cmake_version(version: str) -> str:
    """The file that says for which versions `find_package` may take this one."""
    text = (ROOT / "cmake" / "warpConfigVersion.cmake.in").read_text()
    text = text.replace("find_package(warp ", "find_package(warp_runtime ")
    text = text.replace("@WARP_PACKAGE_VERSION@", version)
    return text.replace("@WARP_PACKAGE_MAJOR@", version.partition(".")[0])


def headers(build: Path) -> dict[str, bytes]:
    """The public headers, those that the build generates among them."""
    found = sorted((ROOT / "include" / "warp").glob("*.h"))
    found += [build / "include" / "warp" / name for name in GENERATED]
    return {f"warp_runtime/include/warp/{path.name}": path.read_bytes() for path in found}


GENERATED = ("LaunchContract.h.inc", "HandleKinds.inc")


def main() -> None:
    library = ROOT / "build/release/lib/libwarp_runtime.so"
    source = "'make runtime' builds and packs it"
    options = packing_options(__doc__, "--library", library, source)
    version = project_version()
    with tempfile.TemporaryDirectory() as folder:
        stripped = Path(folder) / "libwarp_runtime.so"
        subprocess.run(["strip", "-o", stripped, options.library], check=True)
        files = {"warp_runtime/libwarp_runtime.so": stripped.read_bytes()}
    files["warp_runtime/__init__.py"] = MODULE.encode()
    files["warp_runtime/__main__.py"] = MAIN.encode()
    files["warp_runtime/cmake/warp_runtimeConfig.cmake"] = cmake_config().encode()
    files["warp_runtime/cmake/warp_runtimeConfigVersion.cmake"] = cmake_version(version).encode()
    files |= headers(options.library.parent.parent)
    for name in ("LICENSE", "THIRD_PARTY.md"):
        info = f"warp_mlir_runtime-{version}.dist-info"
        files[f"{info}/licenses/{name}"] = (ROOT / name).read_bytes()
    wheel = pack_wheel(
        options.folder,
        "warp-mlir-runtime",
        version,
        f"py3-none-{PLATFORM}",
        files=files,
        pure=False,
        details=[f"Summary: {SUMMARY}", "License-Expression: Apache-2.0"],
    )
    write_wheel(wheel, read_wheel(wheel), options.level)


if __name__ == "__main__":
    main()
