"""The text of programs that Python was given by `-c` or through standard input from a file."""

from __future__ import annotations

import os
import stat
import sys
import types


def lines_of_main(code) -> list[str]:
    """The lines of the program, none if the code object is not of it; `linecache` has them then."""
    import linecache

    text = {"<string>": _of_command, "<stdin>": _of_input}.get(code.co_filename, str)()
    if not text or not _holds(text, code):
        return []
    lines = text.splitlines(keepends=True)
    linecache.cache[code.co_filename] = len(text), None, lines, code.co_filename
    return lines


def _of_command() -> str:
    """The argument of `-c`."""
    arguments = iter(sys.orig_argv[1:])
    for argument in arguments:
        if argument in ("-X", "-W"):
            next(arguments, None)
        elif not argument.startswith("-") or argument.startswith("--"):
            return ""
        elif "c" in argument:
            return argument[argument.index("c") + 1 :] or next(arguments, "")
    return ""


def _of_input() -> str:
    """A file that standard input comes from, read without moving it."""
    try:
        if not stat.S_ISREG(os.fstat(0).st_mode):
            return ""
        return os.pread(0, os.fstat(0).st_size, 0).decode()
    except (OSError, UnicodeDecodeError):
        return ""


def _holds(text, code) -> bool:
    """True if a text compiles to this code object: `exec` uses the same names of files."""
    import warnings

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = [compile(text, code.co_filename, "exec", dont_inherit=True)]
    except (SyntaxError, ValueError):
        return False
    while found:
        one = found.pop()
        if (one.co_name, one.co_firstlineno) == (code.co_name, code.co_firstlineno):
            return (one.co_code, one.co_names, one.co_varnames) == (
                code.co_code,
                code.co_names,
                code.co_varnames,
            )
        found += [const for const in one.co_consts if isinstance(const, types.CodeType)]
    return False
