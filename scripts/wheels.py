"""Writes wheels of files that are there already."""

from __future__ import annotations

import argparse
import base64
import hashlib
import subprocess
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def project_version() -> str:
    """The version that pyproject.toml states."""
    for line in (ROOT / "pyproject.toml").read_text().splitlines():
        if line.startswith("version = "):
            return line.split('"')[1]
    raise SystemExit("pyproject.toml states no version")


def packing_options(text: str, option: str, file: Path, source: str) -> argparse.Namespace:
    """Options of a script that packs a built file into a wheel; makes the folder.

    Args:
        text: of the script, whose first line is the description.
        option: names the file, with hyphens before it.
        file: the one by default.
        source: what builds the file, for the message where it is absent.
    """
    parser = argparse.ArgumentParser(description=text.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "dist")
    parser.add_argument(option, type=Path, default=file)
    parser.add_argument("--level", default="2", help="of advzip, 0 for none")
    options = parser.parse_args()
    chosen = vars(options)[option.lstrip("-")]
    if not chosen.is_file():
        raise SystemExit(f"no '{chosen}': {source}")
    options.folder.mkdir(parents=True, exist_ok=True)
    return options


def entry(path: str) -> zipfile.ZipInfo:
    """The description of a file; programs are executable, which pip keeps."""
    found = zipfile.ZipInfo(path, (1980, 1, 1, 0, 0, 0))
    found.external_attr = (0o100755 if ".data/scripts/" in path else 0o100644) << 16
    return found


def pack_wheel(
    folder: Path, name, version, tag, requires=(), files=(), pure=True, details=()
) -> Path:
    """Writes a wheel and returns its path; entries are stored, not compressed.

    Args:
        name: of the distribution, with hyphens.
        tag: which interpreters and machines it is for.
        requires: what the distribution depends on.
        files: contents by path in the wheel.
        pure: whether nothing in it is compiled.
        details: further lines of its metadata.
    """
    stem = f"{name.replace('-', '_')}-{version}"
    info = f"{stem}.dist-info"
    lines = [f"Name: {name}", f"Version: {version}", *(f"Requires-Dist: {one}" for one in requires)]
    entries = {
        f"{info}/METADATA": "\n".join(["Metadata-Version: 2.4", *lines, *details, ""]).encode(),
        f"{info}/WHEEL": (
            f"Wheel-Version: 1.0\nGenerator: wheels\n"
            f"Root-Is-Purelib: {str(pure).lower()}\nTag: {tag}\n"
        ).encode(),
        **dict(files),
    }
    record = []
    for path, data in entries.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=")
        record.append(f"{path},sha256={digest.decode()},{len(data)}\n")
    record.append(f"{info}/RECORD,,\n")
    entries[f"{info}/RECORD"] = "".join(record).encode()
    wheel = folder / f"{stem}-{tag}.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for path, data in entries.items():
            archive.writestr(entry(path), data)
    return wheel


def read_wheel(wheel: Path) -> dict[str, bytes]:
    """Contents of a wheel by path."""
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def write_wheel(wheel: Path, entries: dict[str, bytes], level: str) -> None:
    """Writes a compressed wheel, with a record of its entries in place of the one they have.

    Prints its size.

    Args:
        level: of advzip, which makes it smaller; "0" for none.
    """
    record = next(name for name in entries if name.endswith(".dist-info/RECORD"))
    lines = []
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, data in entries.items():
            if name != record:
                digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=")
                lines.append(f"{name},sha256={digest.decode()},{len(data)}\n")
                archive.writestr(entry(name), data, zipfile.ZIP_DEFLATED, 1)
        archive.writestr(record, "".join(lines) + f"{record},,\n")
    if level != "0":
        subprocess.run(["advzip", "-z", f"-{level}", "-q", wheel], check=True)
    print(f"{wheel} {wheel.stat().st_size:,} bytes", flush=True)
