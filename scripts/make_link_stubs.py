"""Write stubs of the C and C++ run-time libraries that end at a version, to link against.

    make_link_stubs.py FOLDER [--glibc 2.28] [--glibcxx 3.4.24] [--cxxabi 1.3.11] [--gcc 7.0.0]

A library that is linked on Debian 12 asks for symbol versions of glibc 2.36 and GCC 12, and older
systems refuse to load it. A stub has the symbols of the library on this machine, but only in
versions up to the given ones, so the linker takes `pthread_create@GLIBC_2.2.5` in place of
`pthread_create@GLIBC_2.34`. A symbol that no old version has is undefined: functions of C++ come
from `libstdc++.a`, those of C from lib/Portable, and a new one is an error when the library is
linked, not when a user loads it.
"""

from __future__ import annotations

import argparse
import re
import subprocess
from pathlib import Path

# The system's libraries by the name that the compiler's driver links.
LIBRARIES = {
    "ld": "ld-linux-x86-64.so.2",
    "c": "libc.so.6",
    "m": "libm.so.6",
    "pthread": "libpthread.so.0",
    "dl": "libdl.so.2",
    "rt": "librt.so.1",
    "stdc++": "libstdc++.so.6",
    "gcc_s": "libgcc_s.so.1",
}
SYMBOL = re.compile(
    r"^\s*\d+: [0-9a-f]+\s+(?P<size>\S+) (?P<kind>FUNC|IFUNC|OBJECT|NOTYPE)\s+(GLOBAL|WEAK|UNIQUE)"
    r"\s+DEFAULT\s+(?!UND)\S+ (?P<name>[^@\s]+)@+(?P<version>\S+)"
)


def numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, version.split(".")))


def find(compiler: str, name: str) -> Path:
    shown = subprocess.run(
        [compiler, f"-print-file-name={name}"], check=True, capture_output=True, text=True
    ).stdout.strip()
    path = Path(shown)
    if not path.is_file():
        raise SystemExit(f"'{compiler}' finds no '{name}'")
    return path.resolve()


def symbols(library: Path, limits: dict) -> dict[str, tuple[str, str]]:
    """The newest version of each symbol within the limits, with its kind."""
    found: dict[str, tuple[str, str]] = {}
    listed = subprocess.run(
        ["readelf", "--dyn-syms", "-W", library], check=True, capture_output=True, text=True
    ).stdout
    for line in listed.splitlines():
        match = SYMBOL.match(line)
        if not match or match["name"] == match["version"]:
            continue
        prefix, _, number = match["version"].partition("_")
        if prefix not in limits or not re.fullmatch(r"[\d.]+", number):
            continue
        if numbers(number) > limits[prefix]:
            continue
        known = found.get(match["name"])
        if not known or numbers(known[0].partition("_")[2]) < numbers(number):
            found[match["name"]] = (match["version"], match["kind"])
    return found


def write_stub(folder: Path, soname: str, held: dict[str, tuple[str, str]], compiler: str) -> Path:
    """Assembles and links a library that has the symbols and no code."""
    lines, versions = [], {version for version, _ in held.values()}
    for number, (name, (version, kind)) in enumerate(sorted(held.items())):
        type_of = "object" if kind == "OBJECT" else "function"
        lines += [
            f".globl stub.{number}",
            f".type stub.{number}, @{type_of}",
            f"stub.{number}: .byte 0",
        ]
        lines += [f".size stub.{number}, 1", f'.symver stub.{number}, "{name}@@{version}"']
    assembly = folder / f"{soname}.s"
    assembly.write_text("\n".join([".data", *lines, '.section .note.GNU-stack,"",@progbits', ""]))
    script = folder / f"{soname}.map"
    nodes = [f"{version} {{}};\n" for version in sorted(versions)]
    script.write_text("".join(nodes or ["NONE {};\n"]) + "LOCAL { local: stub.*; };\n")
    stub = folder / soname
    command = [compiler, "-shared", "-nostdlib", "-fuse-ld=lld", f"-Wl,-soname,{soname}"]
    command += [f"-Wl,--version-script={script}", str(assembly), "-o", str(stub)]
    subprocess.run(command, check=True)
    return stub


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--compiler", default="clang-22")
    # As manylinux_2_28 allows.
    for name, limit in (("glibc", "2.28"), ("glibcxx", "3.4.24"), ("cxxabi", "1.3.11")):
        parser.add_argument(f"--{name}", default=limit)
    parser.add_argument("--gcc", default="7.0.0")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    limits = {
        name.upper(): numbers(getattr(options, name))
        for name in ("glibc", "glibcxx", "cxxabi", "gcc")
    }
    for name, soname in LIBRARIES.items():
        held = symbols(find(options.compiler, soname), limits)
        stub = write_stub(options.folder, soname, held, options.compiler)
        members = [str(stub.resolve())]
        if name == "c":
            loader = (options.folder / LIBRARIES["ld"]).resolve()
            members += [str(find(options.compiler, "libc_nonshared.a")), f"AS_NEEDED({loader})"]
        elif name == "stdc++":
            members.append(str(find(options.compiler, "libstdc++.a")))
        script = options.folder / f"lib{name}.so"
        script.write_text(f"GROUP({' '.join(members)})\n")


if __name__ == "__main__":
    main()
