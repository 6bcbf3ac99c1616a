"""The package's logger, which programs may replace."""

from __future__ import annotations

import sys
import typing
import warnings

from warp import _native, config
from warp._src import config as settings
from warp._src import errors
from warp._src.argument_kinds import INTEGER, TEXT, Kind
from warp._src.arguments import explained, spelled
from warp._src.config import LOG_WARNING


@typing.runtime_checkable
class Logger(typing.Protocol):
    """The protocol of a logger."""

    def debug(self, message: str) -> None:
        """Tells a message of level debug."""

    def info(self, message: str) -> None:
        """Tells a message of level info."""

    def warning(self, message: str, category=None, stacklevel: int = 1) -> None:
        """Tells a warning of a Python category, from so many callers up."""

    def error(self, message: str) -> None:
        """Tells a message of level error."""


def _text(message) -> str:
    return message if isinstance(message, str) else spelled(message)


class LoggerBasic:
    """Writes to standard output, errors to standard error, and issues Python warnings."""

    def debug(self, message: str) -> None:
        sys.stdout.write(f"{_text(message)}\n")

    info = debug

    def warning(self, message: str, category=None, stacklevel: int = 1) -> None:
        try:
            warnings.warn(message, category, stacklevel=stacklevel + 1)
        except TypeError as error:
            kinds = {
                "message": (TEXT, message),
                "category": (_CATEGORY, category),
                "stacklevel": (INTEGER, stacklevel),
            }
            raise explained(error, "wp.get_logger().warning", **kinds) from None

    def error(self, message: str) -> None:
        sys.stderr.write(f"Warp Error: {_text(message)}\n")


_CATEGORY = Kind(
    "a class of warnings or None",
    lambda value: value is None or (isinstance(value, type) and issubclass(value, Warning)),
)
_state = {"logger": LoggerBasic()}


def checked(logger):
    """The logger itself.

    Raises:
        TypeError: it lacks a method of `Logger`.
    """
    names = ("debug", "info", "warning", "error")
    if not all(callable(getattr(logger, name, None)) for name in names):
        raise TypeError(
            "logger must implement the Logger protocol (debug, info, warning, error), got "
            f"{type(logger)!r}"
        )
    return logger


def set_logger(logger: Logger | None) -> None:
    """Makes a logger the one that is used; None stands for that of the package.

    Raises:
        TypeError: it lacks a method of `Logger`.
    """
    _state["logger"] = LoggerBasic() if logger is None else checked(logger)


def get_logger() -> Logger:
    """The logger that is used."""
    return _state["logger"]


def notice(message: str) -> None:
    """A line of the runtime to the user, unless `config.quiet` or `config.log_level` says no."""
    if config.quiet or config.log_level > LOG_WARNING:
        return
    logger = _state["logger"]
    if type(logger) is LoggerBasic:
        print(message, file=sys.stderr)
    else:
        logger.warning(message)


class ScopedLogger(_native.Scope):
    """Uses a logger for a block; None stands for that of the package."""

    def __init__(self, logger: Logger | None):
        self.logger = None if logger is None else checked(logger)

    _saved = None

    def _enter(self):
        self._saved = get_logger()
        set_logger(self.logger)
        return self

    def _restore(self):
        if self._saved is not None:
            _state["logger"] = self._saved
        self._saved = None


class ScopedLogLevel(_native.Scope):
    """Sets `config.log_level` for a block, to one of `wp.LOG_DEBUG` to `wp.LOG_ERROR`."""

    def __init__(self, log_level: int):
        self.log_level = log_level

    _saved: tuple = ()

    def _enter(self):
        self._saved = (config.log_level,)
        config.log_level = self.log_level
        return self

    def _restore(self):
        if self._saved:
            (config.log_level,) = self._saved
        self._saved = ()


def _add_peer_sentences(value) -> None:
    """Lets messages of errors have the sentences of NVIDIA Warp, or not."""
    errors.peer_sentence = None
    if value:
        from warp._src.compat.peer_messages import sentence

        errors.peer_sentence = sentence


settings.on_change("peer_messages", _add_peer_sentences)
_add_peer_sentences(config.peer_messages)
