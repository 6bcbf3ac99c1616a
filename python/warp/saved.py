"""The contents of saved code, for tools that read objects, PTX and cubins.

    python -m warp.saved FILE... [--extract FOLDER]

Lists the variants in `.warp` files (`compile_aot_module`) and in `.code` files of the kernel cache:
kernel, target, launches that it fits, kind and bytes. With `--extract` each is written to a file of
its own: an object for `readelf` and `objdump`, PTX for `ptxas`, a cubin for `cuobjdump`.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from pathlib import Path

from warp._src.argument_kinds import BYTES as _BYTES
from warp._src.arguments import checked as _checked

# Number of NVIDIA's GPUs in the header of an ELF file.
_GPU_MACHINE = 190
# Characters of a kernel's name that are in that of a file.
_LONGEST = 200


@_checked(code=_BYTES)
def kind_of(code: bytes) -> str:
    """`o` for an object, `cubin`, or `ptx`."""
    code = bytes(memoryview(code))
    if not code.startswith(b"\x7fELF"):
        return "ptx"
    return "cubin" if int.from_bytes(code[18:20], "little") == _GPU_MACHINE else "o"


@_checked()
def read(path) -> list[dict]:
    """The variants in a file.

    Args:
        path: a `.warp` file, or a `.code` file of the kernel cache.

    Returns:
        For each variant `kernel`, `target`, `fits` (text), `kind` and `code` (bytes).

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged, or of another release.
    """
    from warp import _native

    path = Path(os.fsdecode(path))
    with path.open("rb") as file:
        magic = file.read(8)
    if magic == b"WARPCODE":
        found = _native.read_cached(path.read_bytes())
        if found is None:
            raise ValueError(f"{path} is damaged, or of another release")
        entry, code = found
        return [{"kernel": entry, "target": "", "fits": "", "kind": kind_of(code), "code": code}]
    try:
        module = _native.SavedModule(str(path))
    except Exception as error:
        raise ValueError(str(error)) from None
    return [
        {
            "kernel": one["kernel"],
            "target": one["target"],
            "fits": _fits(one),
            "kind": kind_of(one["code"]),
            "code": one["code"],
        }
        for one in module.codes
    ]


def _fits(one) -> str:
    parts = [f"{one['rank']} dimension{'s' if one['rank'] > 1 else ''}"]
    parts.append("packed arrays" if one["packed"] else "any arrays")
    parts.append("32-bit indices" if one["index32"] else "64-bit indices")
    if one["block_dim"]:
        parts.append(f"blocks of {one['block_dim']}")
    return ", ".join(parts)


def _component(name) -> str:
    """A name from a file as that of a file in any folder: letters, digits and `_ . < > -`."""
    return re.sub(r"[^\w.<>-]", "_", name)[:_LONGEST].lstrip(".") or "_"


def _name(number, one) -> str:
    return f"{_component(one['kernel'])}.{number}.{one['kind']}"


@_checked()
def extract(path, folder) -> list[Path]:
    """Writes each variant in a file to a file of its own, in a folder that has the file's name.

    Names of kernels are what the file says, so of other characters than letters, digits and
    `_ . < > -` each becomes `_`. Nothing is written through symbolic links in the folder.

    Raises:
        FileNotFoundError, ValueError: as `read` does.
        OSError: a file cannot be written, or is a symbolic link.
    """
    path = Path(os.fsdecode(path))
    folder = Path(os.fsdecode(folder)) / _component(path.stem)
    variants = read(path)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    inside = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        for number, one in enumerate(variants):
            written.append(folder / _name(number, one))
            _write(written[-1].name, one["code"], inside)
    finally:
        os.close(inside)
    return written


def _write(name, contents, folder) -> None:
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW
    with open(os.open(name, flags, 0o666, dir_fd=folder), "wb") as file:
        file.write(contents)


def main(arguments=None) -> int:
    """The command; returns its exit status."""
    parser = argparse.ArgumentParser(prog="warp.saved", description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+", metavar="FILE", help="a .warp or .code file")
    parser.add_argument("--extract", type=Path, metavar="FOLDER", help="write the code there")
    options = parser.parse_args(arguments)
    status = 0
    for file in options.files:
        try:
            variants = read(file)
        except (OSError, ValueError) as error:
            print(f"{file}: {error}", file=sys.stderr)
            status = 1
            continue
        print(file)
        for number, one in enumerate(variants):
            text = "  ".join(filter(None, (one["target"], one["fits"])))
            print(f"  {_name(number, one):40} {len(one['code']):8} bytes  {text}")
        if options.extract:
            try:
                extract(file, options.extract)
            except OSError as error:
                print(f"{file}: cannot be extracted: {error}", file=sys.stderr)
                status = 1
    return status


if __name__ == "__main__":
    sys.exit(main())
