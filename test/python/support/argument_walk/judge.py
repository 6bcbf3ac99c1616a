"""True if an exception is an answer: raised on purpose by the package, with a message.

An accident is an exception that Python or a library raised inside of the package, such as
`'NoneType' object has no attribute 'dtype'`.
"""

import dis
import os
import traceback

import warp as wp
from warp.extend import errors

_PACKAGE = os.path.dirname(wp.__file__)
_HERE = os.path.dirname(__file__)
# Messages that are clear wherever they are raised: files, memory, missing packages, DLPack's own
# error, and text that no encoding has.
_CLEAR = (errors.WarpError, OSError, ImportError, MemoryError, BufferError, UnicodeError)
# Functions of users, whose errors are theirs; Python names them in its messages.
CALLBACKS = ("nothing() ", "pair() ", "len() ")


def _raises(frame, position) -> bool:
    """True if the instruction that a frame has come to is a `raise` statement."""
    for instruction in dis.get_instructions(frame.f_code):
        if instruction.offset == position:
            return instruction.opname == "RAISE_VARARGS"
    return False


def problem(error) -> str | None:
    """The defect of an exception as an answer to wrong arguments, None if there is none."""
    if isinstance(error, _CLEAR):
        return None
    last = error.__traceback__
    depth = 0
    inside = False
    while last.tb_next is not None:
        last, depth = last.tb_next, depth + 1
        inside = inside or last.tb_frame.f_code.co_filename.startswith(_PACKAGE)
    file = last.tb_frame.f_code.co_filename
    text = str(error)
    if not inside or file.startswith(_HERE):
        # Python's own words for a call that does not fit, or what a hostile object has raised.
        own = isinstance(error, (TypeError, StopIteration)) or depth > 1
        return None if own else _described(error, last)
    if text.startswith(CALLBACKS):
        return None
    if file.startswith(_PACKAGE) and _raises(last.tb_frame, last.tb_lasti):
        return None if len(text.split()) > 1 else _described(error, last)
    return _described(error, last)


def _described(error, last) -> str:
    place = f"{last.tb_frame.f_code.co_filename}:{last.tb_lineno}"
    inner = [one for one in traceback.extract_tb(error.__traceback__) if _PACKAGE in one.filename]
    if inner:
        place = f"{os.path.relpath(inner[-1].filename, _PACKAGE)}:{inner[-1].lineno} ({place})"
    return f"{place}: {type(error).__name__}: {str(error)[:200]}"
