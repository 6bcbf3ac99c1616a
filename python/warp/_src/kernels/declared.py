"""The values of `wp.static` where a function is decorated.

A kernel is translated at its first launch, and what its static expressions name may be something
else by then, as the variable of a loop that declares kernels is. So those that can be evaluated
when the function is declared are; the others, which use its own variables or what is not there yet,
are left to the translation.
"""

from __future__ import annotations

import re

from warp._src.kernels import texts
from warp._src.language.checks import static

_CALL = re.compile(r"(?<![\w.])((?:\w+\.)*static)\s*\(")
# Text in which a parenthesis does not count: strings and comments.
_SKIPPED = re.compile(
    r"'''.*?'''|\"\"\".*?\"\"\"|'(?:\\.|[^'\\\n])*'|\"(?:\\.|[^\"\\\n])*\"|#[^\n]*", re.DOTALL
)
_NAME = "__warp_statics__"


class _Call:
    """A static expression in a text.

    Attributes:
        place: line in the file and column, in bytes, where the callee's name ends.
        callee: compiled.
        text: the expression as `ast.unparse` writes it.
        code: compiled.
        start, end: where it lies in the text of its function.
    """

    __slots__ = ("callee", "code", "end", "place", "start", "text")

    def __init__(self, place, span, callee, text, code):
        self.place = place
        self.start, self.end = span
        self.callee = callee
        self.text = text
        self.code = code


_calls = texts.ByCode()


def keep(function) -> None:
    """Keeps the text of a program's function when it is declared, and the values of its static
    expressions. Functions that are made from text or trees keep theirs (`made_functions`)."""
    if (function.__module__ or "").startswith("warp._src.") or texts.is_made(function):
        return
    texts.keep(function)
    evaluate(function)


def evaluate(function) -> None:
    """Evaluates the static expressions of a function that is being declared."""
    if "static" not in function.__code__.co_names:
        return
    calls = _calls.get(function.__code__)
    if calls is None:
        calls = _calls[function.__code__] = _find(function)
    if not calls:
        return
    space = names_of(function)
    values = {}
    # The end of the last one that was evaluated: those in it were, too.
    end = 0
    for call in calls:
        if call.start < end:
            continue
        # An error may go away until the kernel is translated; if not, it is reported then.
        try:
            if eval(call.callee, space) is static:
                values[call.place] = call.text, eval(call.code, space)
                end = call.end
        except Exception:
            continue
    function.__dict__[_NAME] = function.__code__, values


def names_of(function) -> dict:
    """The meaning of names in a function, but for its own variables."""
    space = dict(function.__globals__)
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=False):
        try:
            space[name] = cell.cell_contents
        except ValueError:
            continue
    return space


def at(function, place) -> tuple | None:
    """(text, value) of the expression whose callee ends at a place, None if it has to wait."""
    return _values(function).get(place)


def of_text(function, text) -> list:
    """The values of all expressions of a text."""
    return [value for other, value in _values(function).values() if other == text]


def _values(function) -> dict:
    code, values = function.__dict__.get(_NAME, (None, {}))
    return values if code is function.__code__ else {}


def _find(function) -> list:
    """The static expressions that use none of the function's own variables."""
    import ast

    try:
        text = texts.block_of(function).text
    except Exception:
        return []
    code = function.__code__
    # Text of the same length, without what only looks like code.
    plain = _SKIPPED.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    found = []
    for match in _CALL.finditer(plain):
        closing = _closing(plain, match.end())
        inner = text[match.end() : closing]
        try:
            expression = ast.parse(f"(\n{inner}\n)", mode="eval")
        except SyntaxError:
            continue
        names = [node for node in ast.walk(expression) if isinstance(node, ast.Name)]
        made = {node.id for node in names if isinstance(node.ctx, ast.Store)}
        if ({node.id for node in names} - made) & set(code.co_varnames):
            continue
        start = text.rfind("\n", 0, match.end(1)) + 1
        line = code.co_firstlineno + text.count("\n", 0, start)
        place = line, len(text[start : match.end(1)].encode())
        file = code.co_filename
        callee = compile(match[1], file, "eval")
        compiled = compile(expression, file, "eval")
        found.append(
            _Call(place, (match.start(), closing), callee, ast.unparse(expression), compiled)
        )
    return found


def _closing(text, position) -> int:
    """The position at which a parenthesis that is open at another one is closed."""
    depth = 1
    for bracket in re.compile(r"[()]").finditer(text, position):
        depth += 1 if bracket[0] == "(" else -1
        if not depth:
            return bracket.start()
    return len(text)
