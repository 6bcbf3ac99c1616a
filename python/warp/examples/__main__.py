"""List and run the examples of the package.

python -m warp.examples                    list them
python -m warp.examples NAME [OPTION ...]  run one with its options
python -m warp.examples NAME --source      print its path
"""

from __future__ import annotations

import ast
import importlib.util
import os
import runpy
import sys
from pathlib import Path

PROGRAMS = Path(__file__).absolute().parent / "programs"


def examples() -> dict[str, Path]:
    """Paths of all examples that are programs, by name."""
    found = {}
    for path in sorted(PROGRAMS.rglob("*.py")):
        if "__main__" in path.read_text(encoding="utf-8"):
            found[path.stem] = path
    return found


def summary(path: Path) -> str:
    """The first line of a program's docstring."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0]


def listing() -> str:
    found = examples()
    width = max(map(len, found), default=0)
    lines = [f"{name:<{width}}  {summary(path)}" for name, path in found.items()]
    return "\n".join([*lines, "", "run one: python -m warp.examples NAME [--help]"])


def run(path: Path, arguments: list[str]) -> None:
    """Runs a program as `python path arguments` would.

    Raises:
        SystemExit: it needs a package that is not installed.
    """
    sys.argv = [str(path), *arguments]
    sys.path.insert(0, str(path.parent))
    try:
        runpy.run_path(str(path), run_name="__main__")
    except ModuleNotFoundError as missing:
        name = (missing.name or "").partition(".")[0]
        if not name or name == "warp" or importlib.util.find_spec(name):
            raise
        extra = name if name in ("torch", "jax") else "examples"
        raise SystemExit(
            f"example '{path.stem}' needs '{name}': run `pip install \"warp-mlir[{extra}]\"`"
        ) from None


def main() -> None:
    if len(sys.argv) < 2 or sys.argv[1] in ("-h", "--help", "--list"):
        try:
            print(listing(), flush=True)
        except BrokenPipeError:
            # The reader, `head` for one, has seen enough; Python would write again at its end.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return
    name, arguments = sys.argv[1], sys.argv[2:]
    path = examples().get(name)
    if path is None:
        raise SystemExit(f"no example '{name}', there are: {', '.join(examples())}")
    if arguments == ["--source"]:
        print(path)
    else:
        run(path, arguments)


if __name__ == "__main__":
    main()
