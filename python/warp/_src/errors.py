"""Exceptions of the package and how they are shown.

One small hierarchy: everything a user can cause derives from `WarpError`. Errors about kernel code
also derive from the Python class that says what went wrong (`TypeError`, `IndexError`, ...), so a
caller may catch either. An error knows the place in the user's source and prints it with a caret:

    particles.py:12:12: expects operands of one type for 'add', but got 'si32' and 'f32'
        y[i] = i + x[i]
               ^~~~~~~~
    hint: use `float(i)`

The C++ side throws one exception class; `from_native` turns its kind into a class from here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


class WarpError(RuntimeError):
    """Base of all errors raised by this package.

    Args:
        message: what is wrong, lower case, both sides stated.
        file, line, column: place in the user's source; lines and columns count from 1.
        end_column: column after the last character at fault.
        hint: what to do about it, when there is one answer.
        notes: further places or facts, one per line.
        source: text of the source line, when it cannot be read from `file`.
        code: names the mistake, for programs and tests; None where the class says it.
        facts: values that belong to the code, by name.
    """

    code: str | None = None

    def __init__(
        self,
        message: str = "",
        *,
        file: str | None = None,
        line: int = 0,
        column: int = 0,
        end_column: int = 0,
        hint: str | None = None,
        notes: tuple[str, ...] = (),
        source: str | None = None,
        code: str | None = None,
        facts: dict[str, object] | None = None,
    ):
        super().__init__(message)
        self.message = message
        self.file = file
        self.line = line
        self.column = column
        self.end_column = end_column
        self.hint = hint
        self.notes = tuple(notes)
        self.source = source
        if code is not None:
            self.code = code
        self.facts = dict(facts or {})

    def coded(self, code: str | None, **facts) -> WarpError:
        """Sets code and facts; returns the error."""
        self.code, self.facts = code, facts
        return self

    def __str__(self) -> str:
        return format_error(self)

    def __reduce__(self):
        # Facts may be objects that no other process has.
        return (_rebuild, (type(self), self.message, {**self.__dict__, "facts": {}}))


def _rebuild(cls, message, state):
    error = cls(message)
    error.__dict__.update(state)
    return error


class WarpCodegenError(WarpError):
    """A kernel or function cannot be translated."""

    # True if what was translated so far depends on how many threads a block has.
    depends_on_threads = False


class WarpCodegenTypeError(WarpCodegenError, TypeError):
    """Operands, arguments or annotations have the wrong type."""


class WarpCodegenValueError(WarpCodegenError, ValueError):
    """The type is right but the value cannot be used."""


class WarpCodegenOverflowError(WarpCodegenError, OverflowError):
    """A literal does not fit the type it needs to have."""


class WarpCodegenAttributeError(WarpCodegenError, AttributeError):
    """No such attribute, component or field."""


class WarpCodegenIndexError(WarpCodegenError, IndexError):
    """A constant index is out of range."""


class WarpCodegenKeyError(WarpCodegenError, KeyError):
    """An undefined name or unsupported construct."""


class WarpCompileError(WarpCodegenError):
    """A compiler pass or the code generator failed."""


class WarpParseError(WarpCodegenError):
    """Malformed IR text."""


class WarpLaunchError(WarpError):
    """Bad arguments or dimensions of a launch, or a failed access found in debug mode."""


class WarpLaunchTypeError(WarpLaunchError, TypeError):
    """A launch argument has the wrong type, rank or device."""


class WarpLaunchConversionError(WarpLaunchTypeError, ValueError):
    """A launch argument cannot be made the number or the composite that is expected."""


class WarpLaunchValueError(WarpLaunchError, ValueError):
    """A launch dimension or option has an impossible value."""


class WarpIndexError(WarpError, IndexError):
    """An array is indexed out of its bounds."""


class WarpKeyError(WarpError, KeyError, TypeError):
    """A key that is no index."""


class WarpTypeError(WarpError, TypeError):
    """Data of a type that cannot be used."""


class WarpArgumentError(WarpTypeError, ValueError):
    """An argument of a public function is of another kind than it expects."""


class WarpRowError(WarpTypeError, ValueError):
    """A row of a matrix has more or fewer components."""


class WarpOverflowError(WarpError, OverflowError):
    """A number does not fit its type."""


class WarpShapeError(WarpError, ValueError):
    """Shapes do not fit together."""


class WarpOutputError(WarpShapeError, TypeError):
    """An array for results has another shape than they, or another type."""


class WarpMemoryError(WarpError, MemoryError):
    """A device has not enough free memory."""


class WarpGradientError(WarpError):
    """A gradient cannot be computed from what is there, or is not finite."""


class WarpGradientMismatch(WarpGradientError, ValueError):  # noqa: N818
    """Gradients by two methods differ."""


class WarpDeterminismError(WarpError):
    """A kernel cannot be made deterministic."""


_KINDS = {
    "type": WarpCodegenTypeError,
    "value": WarpCodegenValueError,
    "index": WarpCodegenIndexError,
    "attribute": WarpCodegenAttributeError,
    "key": WarpCodegenKeyError,
    "overflow": WarpCodegenOverflowError,
    "parse": WarpParseError,
    "compile": WarpCompileError,
    "launch": WarpLaunchError,
    "launchtype": WarpLaunchTypeError,
    "launchvalue": WarpLaunchValueError,
    "memory": WarpMemoryError,
    "runtime": WarpError,
}


# Errors of the C++ side whose code says more than their kind.
_CODES = {"launch-conversion": WarpLaunchConversionError}

# peer_sentence(code, facts): how NVIDIA Warp says the same, or None; there if
# `config.peer_messages` is set.
peer_sentence: Callable[[str, dict[str, object]], str | None] | None = None


def from_native(
    kind: str, message: str, file: str = "", line: int = 0, column: int = 0
) -> WarpError:
    """Builds the exception for an error reported by the C++ side.

    Last lines of the message that start with `hint: ` and `code: ` become the hint and the code.
    """
    message, _, code = message.partition("\ncode: ")
    head, separator, hint = message.rpartition("\nhint: ")
    if not separator:
        head, hint = message, None
    error = _CODES.get(code) or _KINDS.get(kind.lower(), WarpError)
    facts = {"message": head}
    return error(
        head, file=file or None, line=line, column=column, hint=hint, code=code or None, facts=facts
    )


def format_error(error: WarpError) -> str:
    """The text of an error: place, message, source line with caret, notes, hint."""
    place = error.file or ""
    if place and error.line:
        place += f":{error.line}"
        if error.column:
            place += f":{error.column}"
    lines = [f"{place}: {error.message}" if place else error.message]
    source = error.source
    if source is None and error.file and error.line:
        import linecache

        source = linecache.getline(error.file, error.line)
    if source and source.strip():
        lines += _caret(source.rstrip("\n"), error.column, error.end_column)
    lines += [f"note: {note}" for note in error.notes]
    if error.hint:
        lines.append(f"hint: {error.hint}")
    return "\n".join(with_peer_sentence(lines, error.code, **error.facts))


def absent(package: str, purpose: str, install: str | None = None) -> ImportError:
    """An error with the command that installs a package; `install` where pip's name is another."""
    text = f"{purpose} needs the package '{package}': pip install {install or package}"
    return ImportError(text, name=package)


def with_peer_sentence(lines: list[str], code: str | None, **facts) -> list[str]:
    """Lines of a message, with the sentence of NVIDIA Warp if `config.peer_messages` is set."""
    if peer_sentence is None or code is None:
        return lines
    sentence = peer_sentence(code, facts)
    return [*lines, f"as Warp says: {sentence}"] if sentence else lines


def _caret(source: str, column: int, end_column: int) -> list[str]:
    text = source.lstrip()
    shown = ["    " + text.rstrip()]
    offset = column - 1 - (len(source) - len(text))
    if column <= 0 or offset < 0 or offset > len(text):
        return shown
    width = max(1, min(end_column - column, len(text) - offset)) if end_column else 1
    lead = "".join("\t" if c == "\t" else " " for c in text[:offset])
    shown.append("    " + lead + "^" + "~" * (width - 1))
    return shown
