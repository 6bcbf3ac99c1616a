"""Repair an environment that has NVIDIA Warp and this package in one folder.

    python -m warp.install             say which distributions provide `warp`, and what is damaged
    python -m warp.install --replace   remove warp-lang, then restore files of warp-mlir
    ... --find-links FOLDER            where pip finds the wheel of warp-mlir, as in `pip install`

Both distributions install the package `warp`. The one that came last has overwritten files of the
other, and uninstalling one deletes files of both. This program uses the standard library alone, so
it runs whichever files are there. Where `warp/__init__.py` is NVIDIA's, `python -m` fails, but
`python -I .../warp/install.py` does not.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import importlib.metadata
import json
import subprocess
import sys
import tempfile
from pathlib import Path

OURS, THEIRS = "warp-mlir", "warp-lang"


def distribution(name: str) -> importlib.metadata.Distribution | None:
    """The installed distribution of a name, or None."""
    try:
        return importlib.metadata.distribution(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def holds_files(found: importlib.metadata.Distribution) -> bool:
    """False for a distribution that stands for another and has no files of its own."""
    return any(file.parts[0] == "warp" for file in found.files or ())


def recorded(found: importlib.metadata.Distribution) -> dict[Path, str]:
    """The files that a distribution has installed, with the hashes of its record."""
    return {
        Path(str(file.locate())): file.hash.value
        for file in found.files or ()
        if file.hash is not None and file.parts[0] == "warp"
    }


def contents(files: dict[Path, str]) -> tuple[dict[Path, bytes], list[Path]]:
    """Contents of the files that are as recorded, and the paths of all others."""
    good, damaged = {}, []
    for path, expected in files.items():
        data = path.read_bytes() if path.is_file() else b""
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        if digest == expected:
            good[path] = data
        else:
            damaged.append(path)
    return good, damaged


def pip(*arguments: str, hint: str = "") -> None:
    """Runs pip in this environment.

    Raises:
        SystemExit: pip is missing or has failed.
    """
    done = subprocess.run([sys.executable, "-m", "pip", *arguments])
    if done.returncode:
        raise SystemExit(f"`pip {' '.join(arguments)}` failed with status {done.returncode}{hint}")


def source(ours: importlib.metadata.Distribution) -> str:
    """A requirement by which pip finds this very version again: its file, or its name."""
    text = ours.read_text("direct_url.json")
    url = json.loads(text).get("url", "") if text else ""
    return url or f"{OURS}=={ours.version}"


def replace(find_links: str = "") -> str:
    """Removes warp-lang and restores the files of warp-mlir; returns a line about it.

    Where files of warp-mlir are damaged its wheel is fetched before anything is removed, from the
    folder or address `find_links`, too.

    Raises:
        SystemExit: warp-mlir is not installed, or pip has failed.
    """
    ours, theirs = distribution(OURS), distribution(THEIRS)
    if ours is None:
        raise SystemExit(f"{OURS} is not installed: run `pip install {OURS}`")
    if theirs is None or not holds_files(theirs):
        return f"nothing to do: {OURS} {ours.version} is alone"
    good, damaged = contents(recorded(ours))
    # The metadata of a removed distribution can no longer be read.
    removed, kept = f"{THEIRS} {theirs.version}", f"{OURS} {ours.version}"
    with tempfile.TemporaryDirectory() as folder:
        if damaged:
            places = ["--find-links", find_links] if find_links else []
            hint = ", nothing was removed: name the folder of the wheel, `--find-links FOLDER`"
            fetch = ["wheel", "--quiet", "--no-deps", "--wheel-dir", folder, *places, source(ours)]
            pip(*fetch, hint=hint)
        pip("uninstall", "-y", "--quiet", THEIRS)
        if damaged:
            wheels = map(str, sorted(Path(folder).iterdir()))
            pip("install", "--quiet", "--force-reinstall", "--no-deps", *wheels)
            return f"removed {removed}, installed {kept} again"
    restored = 0
    for path, data in good.items():
        if not path.is_file():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
            restored += 1
    return f"removed {removed}, restored {restored} files of {kept}"


def report() -> str:
    """Lines about what is installed."""
    lines = []
    for name in (OURS, THEIRS):
        found = distribution(name)
        if found is None:
            lines.append(f"{name}: not installed")
        elif not holds_files(found):
            lines.append(f"{name} {found.version}: stands for {OURS}")
        else:
            damaged = contents(recorded(found))[1]
            state = f"{len(damaged)} files are missing or another's" if damaged else "complete"
            lines.append(f"{name} {found.version}: {state}")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> None:
    about = "Repair an environment that has NVIDIA Warp and this package in one folder"
    parser = argparse.ArgumentParser(prog="python -m warp.install", description=about)
    parser.add_argument("--replace", action="store_true", help="remove NVIDIA Warp")
    parser.add_argument("--find-links", default="", metavar="FOLDER", help="of warp-mlir's wheel")
    options = parser.parse_args(arguments)
    print(replace(options.find_links) if options.replace else report())


if __name__ == "__main__":
    main()
