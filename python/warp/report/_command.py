"""Shared parts of the command lines of the reports: their options, and scenes by name."""

import argparse
from pathlib import Path

from warp.report._scene import registered
from warp.report._worker import load

SCENES = Path(__file__).parent / "scenes"


def make_parser(tool, limit=None, device="cpu or cuda:0", output="the pages", description=None):
    """A parser with the options of every tool; `limit` is what may take so many seconds, if any."""
    prog = f"python -m warp.report {tool}".rstrip()
    parser = argparse.ArgumentParser(prog=prog, description=description)
    parser.add_argument("--device", default="cpu", help=device)
    if limit:
        parser.add_argument("--limit", type=float, default=60.0, help=f"seconds {limit} may take")
    parser.add_argument("--output", default="build/report", help=f"folder of {output}")
    return parser


def choose(names):
    """Scenes by file, by name, or all that come with the package."""
    files = [str(Path(name).resolve()) for name in names if name.endswith(".py")]
    for file in files:
        if not Path(file).is_file():
            raise ValueError(f"no file '{file}'")
        load(file)
    names = [name for name in names if not name.endswith(".py")]
    chosen = [scene for scene in registered().values() if scene.file in files]
    unknown = [name for name in names if name not in registered()]
    if unknown or not (files or names):
        own = [str(file) for file in sorted(SCENES.glob("[a-z]*.py"))]
        for file in own:
            load(file)
        if not (files or names):
            return [scene for scene in registered().values() if scene.file in own]
    for name in names:
        if name not in registered():
            known = ", ".join(f"'{key}'" for key in registered())
            raise ValueError(f"no scene '{name}'; there are {known}")
        chosen.append(registered()[name])
    return chosen
