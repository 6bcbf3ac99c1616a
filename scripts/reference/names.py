"""Public modules of the package, and the public names of each."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import types
from collections.abc import Iterator

# Modules whose contents are data of a program: scenes and cases of reports, programs by packages.
DATA = ("warp.report.scenes.", "warp.report.stability.", "warp.compare.packages")
# Not Python.
SKIPPED = ("warp.libwarp", "warp.libwarp_eigen", "warp.libwarp_openvdb")


def public_modules() -> list[str]:
    """Names of all modules that a user may import."""
    import warp

    found = ["warp"]
    for module in pkgutil.walk_packages(warp.__path__, "warp."):
        hidden = any(part.startswith("_") for part in module.name.split("."))
        if not hidden and not module.name.startswith(DATA) and module.name not in SKIPPED:
            found.append(module.name)
    return sorted(found)


def is_ours(value: object) -> bool:
    home = getattr(value, "__module__", None) or getattr(type(value), "__module__", None) or ""
    return isinstance(home, str) and home.split(".")[0] == "warp"


def lazy_names(module: types.ModuleType) -> set[str]:
    """Names that a module imports for type checkers, `as` themselves, and loads when asked for."""
    found = set()
    for node in ast.walk(ast.parse(inspect.getsource(module))):
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            for one in ast.walk(node):
                if isinstance(one, ast.alias) and one.asname == one.name:
                    found.add(one.name)
    return found


def public_names(name: str) -> Iterator[tuple[str, object]]:
    """Public names of a module with their values, in alphabetical order.

    `__all__` decides where there is one. Elsewhere they are the names of `dir`, lazy ones too,
    but for modules and for what comes from other packages.
    """
    module = importlib.import_module(name)
    listed = getattr(module, "__all__", None)
    for each in sorted(listed or {*dir(module), *lazy_names(module)}):
        if each.startswith("_") or each == "annotations":
            continue
        try:
            value = getattr(module, each)
        except (AttributeError, ImportError, RuntimeError):
            continue
        if listed or name == "warp" or not isinstance(value, types.ModuleType):
            foreign = isinstance(value, (type, types.FunctionType, types.BuiltinFunctionType))
            if listed or name == "warp" or is_ours(value) or not foreign:
                yield each, value
