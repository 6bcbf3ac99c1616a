"""The text of functions, as it was when they were decorated.

A function is translated at its first launch, and its file may be gone or changed by then: programs
write kernels to temporary files, import and delete them. So decorators keep the lines.
"""

from __future__ import annotations

import re
import types

from warp._src import errors

_IDENTIFIER = re.compile(r"[^\W\d]\w*")


# By the file that a code object names.
_HINTS = {
    "<string>": "Python keeps no text of `exec`: give the text to `wp.kernel(source=...)` or "
    "`wp.func(source=...)`, or its lines to `linecache.cache['<string>']`",
    "<stdin>": "Python keeps no text that comes through a pipe or a prompt: put it into a file, "
    "run it by `python -c`, or give the text of each kernel to `wp.kernel(source=...)`",
    "<dynamic-code>": "cloudpickle sent the function around it without source: define the kernel "
    "outside of that function, kernels travel with theirs",
}


class ByCode:
    """The facts about code objects, of each for itself: Python counts them as equal if they differ
    in nothing but annotations of local variables, which say something here."""

    def __init__(self):
        # The objects are kept, so that none has the address of another one.
        self._known: dict = {}

    def get(self, code):
        return self._known.get(id(code), (None, None))[1]

    def pop(self, code):
        return self._known.pop(id(code), (None, None))[1]

    def __setitem__(self, code, value):
        self._known[id(code)] = code, value


# Lines of the file of a code object, until the function is translated.
_kept = ByCode()


def keep(function) -> None:
    """Keeps the lines of a function's file."""
    code = function.__code__
    if _kept.get(code) is None:
        lines = _lines_of_file(function)
        if code.co_firstlineno <= len(lines):
            _kept[code] = lines


# Files whose lines messages show, of code objects that share the name of theirs with other texts.
_files = ByCode()


def file_of(code) -> str:
    """The file that `linecache` has the lines of a code object in."""
    return _files.get(code) or code.co_filename


def _lines_of_file(function) -> list[str]:
    import linecache

    code = function.__code__
    file = code.co_filename
    if file in ("<string>", "<stdin>"):
        from warp._src.kernels.main_texts import lines_of_main

        lines, _files[code] = lines_of_main(code)
        return lines
    linecache.checkcache(file)
    return linecache.getlines(file, function.__globals__)


def lines_of(function, forget=False) -> list[str]:
    """The lines of a function's file.

    Raises:
        WarpCodegenError: the file has no such line.
    """
    code = function.__code__
    lines = _kept.pop(code) if forget else _kept.get(code)
    if lines is None:
        lines = _lines_of_file(function)
    if code.co_firstlineno > len(lines):
        raise errors.WarpCodegenError(
            f"source of '{function.__name__}' is not available",
            file=code.co_filename,
            line=code.co_firstlineno,
            hint=_HINTS.get(code.co_filename, "define the function in a file or a notebook cell"),
        )
    return lines


class Block:
    """The text of one function, with its decorators.

    Attributes:
        text: its lines.
        words: all that could be names in it.
        lines: its lines without the indentation that they share.
        identity: names of a function that has it, and the text by which it counts; None so far.
    """

    __slots__ = ("identity", "lines", "text", "words")

    def __init__(self, lines):
        self.identity = None
        self.text = "".join(lines)
        plain = self.text
        if not plain.isascii():
            import unicodedata

            plain = unicodedata.normalize("NFKC", plain)
        self.words = frozenset(_IDENTIFIER.findall(plain))
        indent = len(lines[0]) - len(lines[0].lstrip())
        self.lines = tuple([line[indent:].rstrip() for line in lines])


_blocks = ByCode()


# Code objects that were compiled from text or from a tree, and not from a file's lines.
_made = ByCode()


def keep_made(code, lines) -> None:
    """Keeps the text of a code object that no file has."""
    _blocks[code], _made[code] = Block(lines), True


def is_made(function) -> bool:
    """True if a function was made from text or from a tree."""
    return bool(_made.get(function.__code__))


def block_of(function) -> Block:
    """The text of a function, read once: later changes of its file do not count.

    Raises:
        WarpCodegenError: there is no such text.
    """
    code = function.__code__
    found = _blocks.get(code)
    if found is None:
        found = _blocks[code] = Block(_block(lines_of(function), code))
    return found


def _block(lines, code) -> list[str]:
    """From the first line of a function to the last one that is indented below it."""
    first = code.co_firstlineno - 1
    codes, last = [code], first + 1
    while codes:
        one = codes.pop()
        codes += [const for const in one.co_consts if isinstance(const, types.CodeType)]
        last = max([last, *[line or 0 for _, _, line in one.co_lines()]])
    indent = len(lines[first]) - len(lines[first].lstrip())
    while last < len(lines):
        line = lines[last].strip()
        inside = len(lines[last]) - len(lines[last].lstrip()) > indent
        if line and not inside and not line.startswith("#"):
            break
        last += 1
    return lines[first:last]


class _Fields(dict):
    """By class of a syntax node: its fields that may hold nodes, and whether one is a list that may
    hold something else, too."""

    def __missing__(self, kind):
        fields = () if kind.__name__ in ("Constant", "MatchSingleton") else kind._fields
        found = tuple((field, field in _MIXED) for field in fields if field not in _LEAVES)
        self[kind] = found
        return found


# Fields that hold names, numbers, and the nodes that only say which operator or context is meant.
_LEAVES = frozenset(
    ("arg", "asname", "attr", "conversion", "ctx", "id", "is_async", "kind", "level", "module")
    + ("name", "op", "ops", "simple", "type_comment", "type_ignores")
)
_MIXED = frozenset(("cls", "keys", "kw_defaults", "kwd_attrs", "names", "rest"))
_FIELDS = _Fields()


def children(node) -> list:
    """The nodes right below one of a syntax tree, without those that only say which operator or
    context is meant; many times faster than `ast.iter_child_nodes`."""
    found = []
    for field, is_mixed in _FIELDS[type(node)]:
        value = getattr(node, field, None)
        if value is None:
            continue
        if type(value) is list:
            found += [one for one in value if hasattr(one, "_fields")] if is_mixed else value
        elif not is_mixed or hasattr(value, "_fields"):
            found.append(value)
    return found


def walk(node) -> list:
    """A node of a syntax tree with all below it that `children` gives, in the order of levels."""
    found = [node]
    for one in found:
        found += children(one)
    return found
