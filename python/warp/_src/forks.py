"""Forks while another thread holds a lock of the package, or imports.

A child process has the forking thread alone. A lock that another thread held is taken for ever
there: ours, and Python's own of each module that is being imported, which is how rarely used parts
of this package are loaded. So a fork waits for both; they take milliseconds. Locks of native code
are looked after in `warp/Forks.h`.
"""

from __future__ import annotations

import os
import sys
from _thread import RLock, get_ident
from contextlib import suppress
from time import monotonic, sleep

# All locks that a fork waits for.
_locks: list = []

# Seconds for imports that themselves wait for the forking thread.
_PATIENCE = 5.0

# Seconds that a fork waits for one lock before it looks at the others.
_TURN = 0.01


def shared_lock():
    """A lock, which its thread may take again, that no child process finds taken by another."""
    _locks.append(RLock())
    return _locks[-1]


# Held while a kernel is translated.
translating = shared_lock()


def _take_all(awaited):
    """Takes all locks, or none: who has one may be waiting for another.

    Args:
        awaited: the lock to wait for, before the others are tried. Threads that take a lock again
            and again have it nearly always, so a look now and then would not find it free.

    Returns:
        The lock that another thread has, None if all are taken.
    """
    if awaited is not None and not awaited.acquire(timeout=_TURN):
        return awaited
    taken = [] if awaited is None else [awaited]
    for lock in _locks:
        if lock is awaited:
            continue
        if not lock.acquire(blocking=False):
            _release(taken)
            return lock
        taken.append(lock)
    return None


def _release(taken=_locks) -> None:
    for lock in taken:
        # Not taken where an exception has ended `_before_fork`.
        with suppress(RuntimeError):
            lock.release()


def _others_import() -> bool:
    """True if another thread holds the lock of a module."""
    locks = getattr(sys.modules.get("_frozen_importlib"), "_module_locks", {})
    held = (reference() for reference in list(locks.values()))
    return any(getattr(lock, "owner", None) not in (None, get_ident()) for lock in held)


def _before_fork() -> None:
    missing = _take_all(None)
    while missing is not None:
        missing = _take_all(missing)
    end = monotonic() + _PATIENCE
    while _others_import() and monotonic() < end:
        sleep(0.0002)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=_before_fork,
        after_in_parent=_release,
        after_in_child=_release,
    )
