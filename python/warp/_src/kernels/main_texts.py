"""The text of programs without a file: `-c`, standard input from a file, and strings for `exec`.

Python calls all of them `<string>` or `<stdin>`, so a text counts as that of a code object only if
it compiles to it.
"""

from __future__ import annotations
import __future__

import os
import stat
import sys
import types

_FUTURE = 0
for _feature in __future__.all_feature_names:
    _FUTURE |= getattr(__future__, _feature).compiler_flag


def lines_of_main(code) -> tuple[list[str], str]:
    """The lines of the program that a code object is of, and their name in `linecache`.

    There are none if no text is known to be the program.
    """
    import linecache

    file = code.co_filename
    registered = linecache.getlines(file)
    if registered and _holds("".join(registered), code):
        return registered, file
    texts = [{"<string>": _of_command, "<stdin>": _of_input}[file](), *_of_callers(code)]
    text = next((one for one in texts if one and _holds(one, code)), None)
    if text is None:
        return [], file
    if registered:
        file = f"{file[:-1]} {hash(text) & 0xFFFFFFFF:08x}>"
    lines = text.splitlines(keepends=True)
    linecache.cache[file] = len(text), None, lines, file
    return lines, file


def _of_callers(code):
    """Strings that functions which run `exec` know by a name or as a constant."""
    definition = f"def {code.co_name}"
    frame = sys._getframe(1)
    while frame is not None and frame.f_back is not None:
        caller = frame.f_back
        if (frame.f_code.co_filename, frame.f_code.co_name) == (code.co_filename, "<module>"):
            known = *caller.f_code.co_consts, *caller.f_locals.values(), *caller.f_globals.values()
            yield from (one for one in known if type(one) is str and definition in one)
        frame = caller


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
    """True if a text compiles to this code object."""
    import warnings

    flags = code.co_flags & _FUTURE
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = [compile(text, code.co_filename, "exec", flags, dont_inherit=True)]
    except (SyntaxError, ValueError):
        return False
    while found:
        one = found.pop()
        if (one.co_name, one.co_firstlineno) == (code.co_name, code.co_firstlineno):
            return _same(one, code)
        found += [const for const in one.co_consts if isinstance(const, types.CodeType)]
    return False


def _same(one, other) -> bool:
    """True if two code objects differ in nothing but the columns of their parts."""
    if isinstance(one, types.CodeType) and isinstance(other, types.CodeType):
        return all(
            getattr(one, name) == getattr(other, name)
            for name in ("co_code", "co_names", "co_varnames", "co_freevars")
        ) and all(map(_same, one.co_consts, other.co_consts))
    return type(one) is type(other) and one == other and repr(one) == repr(other)
