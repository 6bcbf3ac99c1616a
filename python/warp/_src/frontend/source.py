"""Source text and syntax tree of Python functions.

`inspect.getsource` tokenizes and takes milliseconds, so the block of a function is found by its
indentation instead and only that block is parsed. Trees are kept per code object: closures made by
one factory share theirs. Positions in a tree are relative to the block; `Source.place` turns them
into the file's.
"""

from __future__ import annotations

import ast
import linecache
import os
import types

from warp._src import errors
from warp._src.kernels import texts


class Source:
    """Tree of one function and the place it comes from."""

    __slots__ = (
        *("_words", "encoded_file", "file", "line_offset", "name", "outside", "plan"),
        "tree",
    )

    def __init__(self, tree: ast.FunctionDef, file: str, line_offset: int, name: str, words=None):
        self.tree = tree
        self.file = file
        # A path need not be valid text; locations in IR are.
        self.encoded_file = os.fsencode(file).decode(errors="replace")
        self.line_offset = line_offset
        self.name = name
        self.plan = None
        # Words that `kernels.statics` has found in it.
        self.outside = None
        self._words = words

    def words(self):
        """All that could be names and attributes in it."""
        if self._words is None:
            found = (getattr(n, "attr", None) or getattr(n, "id", "") for n in ast.walk(self.tree))
            self._words = frozenset(found)
        return self._words

    def line(self, node: ast.AST) -> int:
        return node.lineno + self.line_offset

    def place(self, node: ast.AST) -> dict:
        """Keyword arguments for an error at a node."""
        # The first character stands for a node of several lines.
        one_line = node.end_lineno == node.lineno
        end = node.end_col_offset if one_line else node.col_offset + 1
        line = node.lineno + self.line_offset
        return {
            "file": self.file,
            "line": line,
            "column": _characters(self.file, line, node.col_offset) + 1,
            "end_column": _characters(self.file, line, end) + 1,
        }


# By code object; `kernels.made_functions` adds those of functions that no file has.
sources = texts.ByCode()


def source_of(function: types.FunctionType) -> Source:
    """Source of a function, parsed once per code object."""
    code = function.__code__
    found = sources.get(code)
    if found is None:
        found = sources[code] = _read(function, code)
    return found


def _read(function: types.FunctionType, code: types.CodeType) -> Source:
    file, first = code.co_filename, code.co_firstlineno
    block = None
    if code.co_name != "<lambda>":
        # The identity of a kernel has to be the text that is parsed here.
        block = texts.block_of(function)
    lines = texts.lines_of(function, forget=True)
    if code.co_name == "<lambda>":
        raise errors.WarpCodegenError(
            "a lambda cannot be a kernel or function", file=file, line=first, hint="use `def`"
        )
    tree, offset = _parse(lines, first - 1, len(block.lines))
    if tree is None or tree.name != code.co_name:
        raise errors.WarpCodegenError(
            f"source of '{function.__name__}' does not match what was imported",
            file=file,
            line=first,
            hint="import the module again",
        )
    return Source(tree, texts.file_of(code), offset, function.__name__, block.words)


def _parse(lines: list[str], start: int, count: int) -> tuple[ast.FunctionDef | None, int]:
    """Parses the definition that starts at a line and has so many lines, if these are still what
    they were; gives its line offset too."""
    indent = _indent(lines[start])
    # An indented block is put under a header line so that columns stay true.
    header = ["if 1:\n"] if indent else []
    offset = start - len(header)
    end = start + count
    while end <= len(lines):
        while end < len(lines) and not _may_end(lines[end], indent):
            end += 1
        block = lines[start:end]
        if any(line.lstrip().startswith("def ") for line in block):
            try:
                body = ast.parse("".join(header + block)).body
            except SyntaxError:
                body = None
            if body:
                node = body[0].body[0] if header else body[0]
                return (node if isinstance(node, ast.FunctionDef) else None), offset
        end += 1
    return None, offset


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def _may_end(line: str, indent: int) -> bool:
    text = line.strip()
    return bool(text) and not text.startswith("#") and _indent(line) <= indent


def _characters(file: str, line: int, offset: int) -> int:
    """Column in characters of an offset in UTF-8 bytes."""
    text = linecache.getline(file, line)
    if text.isascii():
        return offset
    return len(text.encode()[:offset].decode(errors="replace"))
