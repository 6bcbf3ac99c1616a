"""Write dist/warp_mlir_vdb-*.whl: the component that reads and writes files of OpenVDB.

    python scripts/make_vdb.py [FOLDER] [--library libwarp_openvdb.so] [--level 2]

The wheel has the component, the libraries of this system that it is linked with, but for those that
every Linux has, in the order in which they are loaded, and their licences. Its tag names the glibc
of this system. `wp.Volume.load_from_vdb` finds it where the package has no component of its own.
"""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

from wheels import ROOT, pack_wheel, packing_options, project_version, read_wheel, write_wheel

SUMMARY = "Files of OpenVDB for Warp on MLIR"
MODULE = '''"""The component of `warp` for files of OpenVDB, and the libraries that it needs."""

from pathlib import Path

FOLDER = Path(__file__).parent
LIBRARIES = {libraries!r}
'''
# Every system with this glibc has these.
COMMON = re.compile(r"(lib(c|m|dl|rt|pthread|gcc_s|stdc\+\+)\.so|ld-linux|linux-vdso)")
NEEDED = re.compile(r"NEEDED.*\[(.*)\]")


def run(*command: object) -> str:
    return subprocess.run(
        [str(part) for part in command], check=True, capture_output=True, text=True
    ).stdout


def libraries_of(library: Path) -> list[Path]:
    """The libraries that one needs, each behind those that it needs itself."""
    resolved = dict(re.findall(r"(\S+) => (/\S+)", run("ldd", library)))
    found: list[Path] = []

    def visit(path: Path) -> None:
        for name in NEEDED.findall(run("readelf", "-d", path)):
            if not COMMON.match(name) and Path(resolved[name]) not in found:
                visit(Path(resolved[name]))
                found.append(Path(resolved[name]))

    visit(library)
    return found


def licence_of(library: Path) -> tuple[str, bytes]:
    """Name and licence of the system's package that a library is from."""
    places = {str(library), str(library.resolve()), f"/usr{library.resolve()}"}
    for place in sorted(places):
        asked = subprocess.run(["dpkg", "-S", place], capture_output=True, text=True, check=False)
        if asked.returncode == 0:
            package = asked.stdout.partition(":")[0]
            return package, Path(f"/usr/share/doc/{package}/copyright").read_bytes()
    raise SystemExit(f"no package of this system has '{library}', so its licence is not known")


def main() -> None:
    library = ROOT / "build/release/python/warp/libwarp_openvdb.so"
    source = "'make vdb' builds it where libopenvdb-dev and libnanovdb-dev are installed"
    options = packing_options(__doc__, "--library", library, source)
    others = libraries_of(options.library)
    version, glibc = project_version(), os.confstr("CS_GNU_LIBC_VERSION").split()[1]
    info = f"warp_mlir_vdb-{version}.dist-info"
    licences = {"LICENSE": (ROOT / "LICENSE").read_bytes(), **dict(map(licence_of, others))}
    module = MODULE.format(libraries=[path.name for path in others])
    files = {
        "warp_mlir_vdb/__init__.py": module.encode(),
        "warp_mlir_vdb/libwarp_openvdb.so": options.library.read_bytes(),
        **{f"warp_mlir_vdb/{path.name}": path.read_bytes() for path in others},
        **{f"{info}/licenses/{name}": text for name, text in licences.items()},
    }
    wheel = pack_wheel(
        options.folder,
        "warp-mlir-vdb",
        version,
        f"py3-none-manylinux_{glibc.replace('.', '_')}_x86_64",
        files=files,
        pure=False,
        details=[
            f"Summary: {SUMMARY}",
            "License-Expression: Apache-2.0 AND MPL-2.0",
            *(f"License-File: {name}" for name in licences),
            "Requires-Python: >=3.10",
        ],
    )
    write_wheel(wheel, read_wheel(wheel), options.level)


if __name__ == "__main__":
    main()
