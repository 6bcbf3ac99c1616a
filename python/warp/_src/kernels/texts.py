"""The text of functions, as it was when they were decorated.

A function is translated at its first launch, and its file may be gone or changed by then: programs
write kernels to temporary files, import and delete them. So decorators keep the lines.
"""

from __future__ import annotations

from warp._src import errors

# Lines of the file of a code object, until the function is translated.
_kept: dict = {}


def keep(function) -> None:
    """Keeps the lines of a function's file."""
    import linecache

    code = function.__code__
    if code not in _kept:
        linecache.checkcache(code.co_filename)
        lines = linecache.getlines(code.co_filename, function.__globals__)
        if code.co_firstlineno <= len(lines):
            _kept[code] = lines


def lines_of(function, forget=False) -> list[str]:
    """The lines of a function's file.

    Raises:
        WarpCodegenError: the file has no such line.
    """
    import linecache

    code = function.__code__
    lines = _kept.pop(code, None) if forget else _kept.get(code)
    if lines is None:
        linecache.checkcache(code.co_filename)
        lines = linecache.getlines(code.co_filename, function.__globals__)
    if code.co_firstlineno > len(lines):
        raise errors.WarpCodegenError(
            f"source of '{function.__name__}' is not available",
            file=code.co_filename,
            line=code.co_firstlineno,
            hint="define the function in a file or a notebook cell",
        )
    return lines
