"""Forks while another thread translates its first kernel, or imports.

A child process has the forking thread alone. A lock that another thread held is taken for ever
there: ours while a kernel is translated, and Python's own of each module that is being imported,
which is how rarely used parts of this package are loaded. So a fork waits for both; they take
milliseconds.
"""

from __future__ import annotations

import os
import sys
from _thread import RLock, get_ident
from time import monotonic, sleep

# Held while a kernel is translated, and for a fork.
translating = RLock()

# Seconds for imports that themselves wait for the forking thread.
_PATIENCE = 5.0


def _others_import() -> bool:
    """Whether another thread holds the lock of a module."""
    locks = getattr(sys.modules.get("_frozen_importlib"), "_module_locks", {})
    held = (reference() for reference in list(locks.values()))
    return any(getattr(lock, "owner", None) not in (None, get_ident()) for lock in held)


def _before_fork() -> None:
    translating.acquire()
    end = monotonic() + _PATIENCE
    while _others_import() and monotonic() < end:
        sleep(0.0002)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=_before_fork,
        after_in_parent=translating.release,
        after_in_child=translating.release,
    )
