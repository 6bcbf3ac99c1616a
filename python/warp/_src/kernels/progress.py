"""A bar for waits for the compiler: with tqdm where it is installed, otherwise a line of text.

Nothing is shown in the first two seconds of a wait, and nothing where nobody looks.
"""

from __future__ import annotations

import sys
import time

from warp import config

# Seconds of a wait until a bar appears.
_PATIENCE = 2.0
# Seconds between two changes of a line.
_PERIOD = 0.1
_WIDTH = 30


class _Line:
    """A line of a terminal that is written again."""

    def __init__(self, all_kernels):
        self._start = time.monotonic()
        self.total = all_kernels
        self._shown = ""

    def update_to(self, done, all_kernels) -> None:
        full = _WIDTH * done // max(all_kernels, 1)
        seconds = time.monotonic() - self._start
        text = (
            f"warp: compiling [{'#' * full}{'.' * (_WIDTH - full)}] "
            f"{done} of {all_kernels} kernels, {seconds + _PATIENCE:.0f} s"
        )
        sys.stderr.write("\r" + text.ljust(len(self._shown)))
        sys.stderr.flush()
        self._shown = text

    def close(self) -> None:
        sys.stderr.write("\r" + " " * len(self._shown) + "\r")
        sys.stderr.flush()


class _Tqdm:
    def __init__(self, bars, all_kernels):
        self._bar = bars(total=all_kernels, desc="warp: compiling", unit="kernel", leave=False)

    def update_to(self, done, all_kernels) -> None:
        self._bar.total = all_kernels
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        self._bar.close()


class _Wait:
    """The wait in progress; only one thread waits at a time."""

    begin = last = None
    bar = None


def is_watched() -> bool:
    """True if a bar is wanted and somebody can see it."""
    if config.progress is not None:
        return config.progress
    if config.quiet:
        return False
    if "ipykernel" in sys.modules:
        return True
    return sys.stderr is not None and sys.stderr.isatty()


def _make_bar(all_kernels):
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return _Line(all_kernels)
    return _Tqdm(tqdm, all_kernels)


def show(done, all_kernels) -> None:
    """Says how far a wait is: so many of all kernels have their code; None ends it."""
    if done is None:
        if _Wait.bar is not None:
            _Wait.bar.close()
        _Wait.begin = _Wait.last = _Wait.bar = None
        return
    now = time.monotonic()
    if _Wait.begin is None:
        _Wait.begin = now
    if _Wait.bar is None and now - _Wait.begin > _PATIENCE and is_watched():
        _Wait.bar = _make_bar(all_kernels)
    if _Wait.bar is not None and (_Wait.last is None or now - _Wait.last >= _PERIOD):
        _Wait.bar.update_to(done, all_kernels)
        _Wait.last = now
