"""Write the type hints of `warp.config` from its settings.

make_config_stub.py SETTINGS STUB   reads warp/_src/config.py, writes warp/config.pyi
"""

import importlib.util
import sys
from pathlib import Path


def load(path):
    """The module of the settings, which needs nothing else of the package."""
    spec = importlib.util.spec_from_file_location("settings", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def type_of(setting):
    return " | ".join("None" if kind is type(None) else kind.__name__ for kind in setting.kinds)


def stub(settings):
    lines = ['"""Settings of the package, with their types."""\n']
    for name in ("DeterministicMode", "LaunchArrayAccessMode"):
        lines.append(f"from warp._src.config import {name} as {name}")
    lines.append("\nversion: str")
    for setting in settings.values():
        lines.append(f'{setting.name}: {type_of(setting)}\n"""{setting.doc}"""')
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    source, target = map(Path, sys.argv[1:])
    target.write_text(stub(load(source).SETTINGS))
