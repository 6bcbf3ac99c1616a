"""Public names that are made when first asked for: builtins, library functions, lazy imports.

The compiler's registry has the functions; `warp/__init__.py` has the imports.
"""

from __future__ import annotations

import importlib
import sys

from warp._src.builtin_table import BUILTINS, LAZY, LIBRARY
from warp._src.language import namespace


def library_function(name: str):
    """The function of the kernel language that the package has under a name, or None."""
    home = LIBRARY.get(name)
    return home and importlib.import_module(home).FUNCTIONS[name]


def _lazy_import(name: str):
    """The value of a name that `warp/__init__.py` imports for type checkers only, or None."""
    if name not in LAZY:
        return None
    home, attribute = LAZY[name]
    if home == "warp":
        return importlib.import_module(f"warp.{attribute}")
    found = getattr(importlib.import_module(home), attribute)
    # Found without this function from now on, as `launch_tiled` is in loops.
    vars(sys.modules["warp"])[name] = found
    return found


def find(name: str):
    """The value of `warp.<name>`, for names that the package does not hold itself.

    Raises:
        AttributeError: there is no such name.
    """
    found = _lazy_import(name) or library_function(name)
    if found is None and not name.startswith("_"):
        found = namespace.find(name) or importlib.import_module("warp._src.absent").find(name)
    if found is None:
        numpy = sys.modules.get("numpy")
        is_numpys = not name.startswith("_") and callable(getattr(numpy, name, None))
        hint = f", NumPy has: `wp.array(np.{name}(...))`" if is_numpys else ""
        # Python suggests a name that is alike, of those that the module has.
        raise AttributeError(
            f"module 'warp' has no attribute '{name}'{hint}", name=name, obj=sys.modules["warp"]
        )
    return found


def names(held) -> list[str]:
    """All public names."""
    public = {name for name in held if not name.startswith("_")}
    return sorted(public | {*BUILTINS, *LIBRARY, *LAZY})
