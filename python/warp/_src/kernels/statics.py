"""What `wp.static` gave when a kernel was translated, to be compared where it is found again.

A static expression may call any Python function, so the text of the kernel does not tell its value.
Where a translation comes from the cache, all of them are evaluated again: one that gives something
else makes the translation another one's.
"""

from __future__ import annotations

import ast

from warp._src.kernels.identity import digest_of
from warp._src.language.checks import static

_LITERALS = (bool, int, float, str)


def evaluated(function, expression, env, value) -> tuple:
    """The record of one: function, text, values of local names, and a digest of what it gave.

    Args:
        expression: the syntax node in the parentheses.
        env: bindings of local names.

    The digest is None if the expression cannot be evaluated elsewhere with the same names.
    """
    names = {node.id for node in ast.walk(expression) if isinstance(node, ast.Name)}
    local = {name: env[name] for name in sorted(names & env.keys())}
    if any(type(one) not in _LITERALS for one in local.values()):
        return function, "", {}, None
    return function, ast.unparse(expression), local, digest_of(value)


def notes(records, functions) -> list | None:
    """Records without references, each with the position of its function; None if one has no name.

    The same expression counts once for the same values of local names.
    """
    positions = {id(function): i for i, function in enumerate(functions)}
    found: dict = {}
    for function, text, local, digest in records:
        if digest is None or id(function) not in positions:
            return None
        made = (positions[id(function)], text, tuple(local.items()))
        if found.setdefault(made, digest) != digest:
            return None
    return [(*made, digest) for made, digest in found.items()]


def digests(noted, functions) -> list:
    """What stands for the values of all expressions now; None for one that fails."""
    return [_digest(text, local, functions[position]) for position, text, local, _ in noted]


def _digest(text, local, function) -> str | None:
    code = function.__code__
    space = dict(function.__globals__)
    for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
        try:
            space[name] = cell.cell_contents
        except ValueError:
            continue
    space.update(local)
    try:
        return digest_of(eval(compile(text, code.co_filename, "eval"), space))
    except Exception:
        return None


def words_outside(tree, function) -> tuple[set, set]:
    """Names, and attributes, that a function's body uses outside of static expressions."""
    words, attributes = set(), set()
    pending = list(tree.body)
    while pending:
        node = pending.pop()
        if isinstance(node, ast.Call) and _is_static(node.func, function):
            pending.append(node.func)
            continue
        if isinstance(node, ast.Name):
            words.add(node.id)
        elif isinstance(node, ast.Attribute):
            attributes.add(node.attr)
        pending += ast.iter_child_nodes(node)
    return words, attributes


def _is_static(callee, function) -> bool:
    """Whether a callee is the builtin `static`, by its name or as an attribute of a module."""
    name = callee.value if isinstance(callee, ast.Attribute) else callee
    if not isinstance(name, ast.Name):
        return False
    code = function.__code__
    if name.id in code.co_freevars or name.id in code.co_varnames:
        return False
    found = function.__globals__.get(name.id)
    if isinstance(callee, ast.Attribute):
        found = getattr(found, callee.attr, None)
    return found is static
