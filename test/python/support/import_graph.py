"""Import graph of the package, read from its text: at the top and in functions."""

import ast
import re
from pathlib import Path

import warp

ROOT = Path(warp.__file__).parent
# Modules whose `__getattr__` finds names when somebody asks for them; the package itself does not.
FACADES = frozenset(
    (
        *("warp._src", "warp._src.types", "warp._src.utils", "warp._src.language.public"),
        *("warp._src.compat.type_names", "warp._src.compat.utility_names"),
    )
)


def modules() -> dict[str, Path]:
    """The files of the package by the names of their modules."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        parts = ("warp", *path.relative_to(ROOT).with_suffix("").parts)
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported(statement, known) -> set[str]:
    """Modules of the package that an import statement runs.

    Importing from the package itself is no dependence on it where what is meant is a module in
    it: a settings module or the native one.
    """
    if isinstance(statement, ast.Import):
        return {alias.name for alias in statement.names if alias.name in known}
    assert not statement.level, "the package has absolute imports only"
    found = set()
    for alias in statement.names:
        inner = f"{statement.module}.{alias.name}"
        if inner in known:
            found.add(inner)
        elif inner != "warp._native" and statement.module in known:
            found.add(statement.module)
    return found


def called(node, known) -> set[str]:
    """Modules that a call of `import_module` or `__import__` may run; none of other nodes."""
    if not isinstance(node, ast.Call):
        return set()
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    if name not in ("import_module", "__import__") or not node.args:
        return set()
    parts = getattr(node.args[0], "values", [node.args[0]])
    pattern = "".join(
        re.escape(part.value) if isinstance(part, ast.Constant) else ".*" for part in parts
    )
    return {module for module in known if re.fullmatch(pattern, module)}


def with_parents(names) -> set[str]:
    """The same with the packages that hold them, whose `__init__` runs first; not the outermost."""
    found = set()
    for name in names:
        found.add(name)
        while name.count(".") > 1:
            name = name.rpartition(".")[0]
            found.add(name)
    return found


def import_graph(in_functions=True) -> dict[str, set[str]]:
    """The modules that each module imports, for more than type checkers.

    Args:
        in_functions: what functions import when they are called, too.
    """
    known = modules()
    graph = {}
    for name, path in known.items():
        found = set()
        pending = [ast.parse(path.read_text(encoding="utf-8"))]
        while pending:
            for node in ast.iter_child_nodes(pending.pop()):
                if isinstance(node, (ast.Import, ast.ImportFrom)):
                    found |= imported(node, known)
                elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
                    pending.extend(node.orelse)
                elif name not in FACADES and (more := called(node, known)):
                    found |= more
                elif in_functions or not isinstance(node, ast.FunctionDef):
                    pending.append(node)
        graph[name] = (with_parents(found) & known.keys()) - {name}
        # Its own package runs before it, and knows nothing of it.
        graph[name] -= {parent for parent in with_parents({name}) if parent != name}
    return graph


def cycles(graph) -> list[list[str]]:
    """Sets of modules each of which reaches all others (Tarjan)."""
    index, low, stack, found = {}, {}, [], []

    def visit(name):
        index[name] = low[name] = len(index)
        stack.append(name)
        for other in sorted(graph[name]):
            if other not in index:
                visit(other)
                low[name] = min(low[name], low[other])
            elif other in stack:
                low[name] = min(low[name], index[other])
        if low[name] == index[name]:
            members = stack[stack.index(name) :]
            del stack[stack.index(name) :]
            if len(members) > 1:
                found.append(sorted(members))

    for name in sorted(graph):
        if name not in index:
            visit(name)
    return found
