"""Values of `wp.static` when a kernel was translated, to be compared where it is found again.

A static expression may call any Python function, so the text of the kernel does not tell its value.
Where a translation comes from the cache, all of them are evaluated again: one that gives something
else makes the translation another one's.
"""

from __future__ import annotations

from warp._src.kernels import declared, texts
from warp._src.kernels.identity import Identity, of_value
from warp._src.kernels.names import UnnamedError
from warp._src.language.checks import static

_LITERALS = (bool, int, float, str)


class Evaluated:
    """One that was evaluated.

    Attributes:
        function: the one whose text has it.
        text: the expression.
        local: values of the function's own names in it.
        value: what it gave, with functions as they were.
        digest: what stands for the value; None if the expression cannot be evaluated elsewhere.
        functions: those that the value is made of.
    """

    __slots__ = ("digest", "function", "functions", "local", "text", "value")

    def __init__(self, function, expression, env, value):
        import ast

        names = {node.id for node in texts.walk(expression) if isinstance(node, ast.Name)}
        self.function = function
        self.text = ast.unparse(expression)
        self.local = {name: env[name] for name in sorted(names & env.keys())}
        self.value = value
        self.digest, self.functions = of_value(value)
        if any(type(one) not in _LITERALS for one in self.local.values()):
            self.digest = None


class Notes:
    """The values that a translation has to be compared with.

    Attributes:
        entries: (position of the function, text, local values, digest) of each expression.
            Positions are those in the kernel's functions, to which each value adds its own.
        identity: of the kernel together with the functions that values are made of; None without.
        together: its digest.
    """

    def __init__(self, records, functions):
        """
        Raises:
            UnnamedError: an expression cannot be evaluated elsewhere.
        """
        positions = {id(function): i for i, function in enumerate(functions)}
        count, found, values = len(functions), {}, []
        for one in records:
            if one.digest is None or id(one.function) not in positions:
                raise UnnamedError
            # The same expression counts once for the same local values.
            made = positions[id(one.function)], one.text, tuple(one.local.items())
            digest, first = found.setdefault(made, (one.digest, count))
            if digest != one.digest:
                raise UnnamedError
            if first == count and one.functions:
                values.append(one.value)
                count += len(one.functions)
            positions.update((id(function), first + i) for i, function in enumerate(one.functions))
        self.entries = [(*made, digest) for made, (digest, _) in found.items()]
        self.identity, self.together = _together(functions, values)


def _together(functions, values) -> tuple:
    """A kernel with functions that it gets from static expressions, for one may read what only the
    text of the other names."""
    if not values:
        return None, None
    found = Identity()
    found.function(functions[0])
    for value in values:
        found.add(value)
    return found, found.digest()


def evaluate(entries, functions) -> tuple:
    """The values of all expressions now, None for one that fails; and a name for all of
    them together with the kernel. That is what no translation was kept with if it has no name."""
    known, found, values = list(functions), [], []
    for position, text, local, _ in entries:
        value = digest = None
        held = ()
        if position < len(known):
            value, digest, held = _evaluate(text, local, known[position])
        found.append(digest)
        if held:
            values.append(value)
            known += held
    try:
        return found, _together(functions, values)[1]
    except Exception:
        return [None], None


def _evaluate(text, local, function) -> tuple:
    earlier = [] if local else declared.of_text(function, text)
    if earlier:
        found = [of_value(value) for value in earlier]
        if any(digest != found[0][0] for digest, _ in found):
            return None, None, ()
        return earlier[0], *found[0]
    space = declared.names_of(function)
    space.update(local)
    try:
        value = eval(compile(text, function.__code__.co_filename, "eval"), space)
    except Exception:
        return None, None, ()
    return value, *of_value(value)


def words_outside(source, function) -> tuple[set, set]:
    """Names, and attributes, that a function's body uses outside of static expressions; found once
    for a source."""
    known = source.outside
    if known is None or known[0] is not function.__globals__:
        words = _words_outside(source.tree, function)
        known = source.outside = function.__globals__, *words
    return known[1:]


def _words_outside(tree, function) -> tuple[set, set]:
    import ast

    words, attributes = set(), set()
    pending = list(tree.body)
    while pending:
        node = pending.pop()
        kind = type(node)
        if kind is ast.Name:
            words.add(node.id)
            continue
        if kind is ast.Attribute:
            attributes.add(node.attr)
        elif kind is ast.Call and _is_static(node.func, function):
            pending.append(node.func)
            continue
        pending += texts.children(node)
    return words, attributes


def _is_static(callee, function) -> bool:
    """True if a callee is the builtin `static`, by its name or as an attribute of a module."""
    import ast

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
