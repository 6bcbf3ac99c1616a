"""Give a wheel its final tag, make one for each other version of Python, compress them.

    finish_wheel.py dist/warp_mlir-*.whl [--pythons /usr/bin/python3.10 ...] [--level 2]

All wheels share `libwarp.so`; the extension module is compiled for each interpreter against the
headers of that interpreter, with the flags of the release build. A wheel is tagged
manylinux_2_28_x86_64, which `auditwheel show` in `make check-wheel` confirms.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from wheels import ROOT, read_wheel, write_wheel

RELEASE = ROOT / "build" / "release"
PLATFORM = "manylinux_2_28_x86_64"
ASK = (
    "import sysconfig as s; print(s.get_path('include')); print(s.get_config_var('EXT_SUFFIX')); "
    "print('cp' + s.get_config_var('py_version_nodot'))"
)


def commands(target: str) -> list[str]:
    """The commands by which the release build makes a target."""
    listed = subprocess.run(
        ["ninja", "-C", str(RELEASE), "-t", "commands", target],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    return listed.splitlines()


def module_commands(include: str, suffix: str, folder: Path) -> tuple[list[list[str]], list[str]]:
    """Commands that compile and link the extension module for other headers.

    They are those of the release build. The precompiled header is made anew, since it knows the
    Python that it was made with.
    """
    compiles: list[list[str]] = []
    link: list[str] = []
    own = next((RELEASE / "python" / "warp").glob("_native*.so")).relative_to(RELEASE)
    for line in commands(str(own)):
        words = shlex.split(line.replace(": && ", "").replace(" && :", ""))
        # Between double quotes a shell takes the backslash of `\\$ORIGIN` away, shlex does not.
        words = [word.replace("\\$", "$") for word in words]
        if "python/CMakeFiles/_native.dir/" not in line or "clang" not in line:
            continue
        words = words[next(i for i, word in enumerate(words) if "clang" in word) :]
        if "-c" in words:
            output = words.index("-o") + 1
            made = folder / Path(words[output]).name
            words[output] = str(made)
            compiles.append(headers(words, include, str(folder / "Pybind.pch")))
        else:
            link = words
    objects = [str(folder / Path(command[command.index("-o") + 1]).name) for command in compiles]
    result = str(folder / f"_native{suffix}")
    kept = [word for word in link if not word.endswith((".cpp.o", "Pybind.o"))]
    kept[kept.index("-o") + 1] = result
    return compiles, [*kept, *objects]


def headers(words: list[str], include: str, precompiled: str) -> list[str]:
    """A command that compiles, with the headers of another Python."""
    found: list[str] = []
    for word, before in zip(words, ["", *words]):
        if word in ("-MD", "-MT", "-MF") or before in ("-MT", "-MF"):
            continue
        if before == "-include-pch":
            word = precompiled
        found.append(include if re.search(r"include/python3\.\d+$", word) else word)
    return found


def precompile(words: list[str]) -> list[str]:
    """The command that makes the header which a command that compiles begins with."""
    at = words.index("-include-pch")
    made = words[at + 1]
    kept = [*words[:at], *words[at + 2 :]]
    kept = kept[: kept.index("-o")]
    header = str(ROOT / "python" / "bindings" / "Pybind.h")
    return [*kept, "-Xclang", "-fno-pch-timestamp", "-x", "c++-header", header, "-o", made]


def compile_module(python: str, folder: Path) -> tuple[str, Path]:
    """Compiles the extension module for an interpreter; its tag and the path."""
    asked = subprocess.run([python, "-c", ASK], check=True, capture_output=True, text=True).stdout
    include, suffix, tag = asked.split()
    compiles, link = module_commands(include, suffix, folder)
    subprocess.run(precompile(compiles[0]), check=True, cwd=RELEASE)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(lambda words: subprocess.run(words, check=True, cwd=RELEASE), compiles))
    subprocess.run(link, check=True, cwd=RELEASE)
    module = folder / f"_native{suffix}"
    subprocess.run(["strip", module], check=True)
    return tag, module


def missing_functions(module: Path, library: Path) -> list[str]:
    """Functions of the package that a module calls and a library does not have."""

    def names(which: str, path: Path) -> set[str]:
        listed = subprocess.run(
            ["nm", "-D", "--format=posix", which, str(path)],
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        return {line.split(" ")[0].partition("@")[0] for line in listed.splitlines()}

    needed = {name for name in names("--undefined-only", module) if "4warp" in name}
    return sorted(needed - names("--defined-only", library))


def check_module(tag: str, module: bytes, library: bytes) -> None:
    """Ends the program if a module does not belong to the library.

    A module that is compiled of later sources than `libwarp.so` of the wheel does not load.
    """
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / name for name in ("_native.so", "libwarp.so")]
        for path, data in zip(paths, (module, library)):
            path.write_bytes(data)
        missing = missing_functions(*paths)
    if missing:
        raise SystemExit(
            f"the module for {tag} calls {len(missing)} functions that the wheel's libwarp.so "
            f"does not have, such as '{missing[0]}': its sources are newer, run 'make wheels' anew"
        )


def retagged(entries: dict[str, bytes], python: str) -> dict[str, bytes]:
    """Entries with the tag of a version of Python and of the platform."""
    found = dict(entries)
    for name, data in entries.items():
        if name.endswith(".dist-info/WHEEL"):
            lines = [one for one in data.decode().splitlines() if not one.startswith("Tag:")]
            tag = f"Tag: {python}-{python}-{PLATFORM}"
            found[name] = "\n".join([*lines, tag, ""]).encode()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--pythons", nargs="*", default=[], help="interpreters with headers")
    parser.add_argument("--level", default="2", help="of advzip, 0 for none")
    options = parser.parse_args()
    entries = read_wheel(options.wheel)
    stem, own = re.fullmatch(r"(.*?-[^-]+)-(cp\d+)-.*\.whl", options.wheel.name).groups()
    native = next(name for name in entries if re.match(r"warp/_native\..*\.so$", name))
    made = {own: entries}
    for python in options.pythons:
        with tempfile.TemporaryDirectory() as folder:
            tag, module = compile_module(python, Path(folder))
            if tag not in made:
                others = {name: data for name, data in entries.items() if name != native}
                made[tag] = {**others, f"warp/{module.name}": module.read_bytes()}
    for tag, held in made.items():
        module = next(name for name in held if re.match(r"warp/_native\..*\.so$", name))
        check_module(tag, held[module], held["warp/libwarp.so"])
    options.wheel.unlink()
    for tag, held in made.items():
        wheel = options.wheel.parent / f"{stem}-{tag}-{tag}-{PLATFORM}.whl"
        write_wheel(wheel, retagged(held, tag), options.level)


if __name__ == "__main__":
    main()
