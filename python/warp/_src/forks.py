"""Forks while another thread translates its first kernel.

Translating imports what few programs need. A child process made in the middle of such an import
would find the lock of the module taken by a thread that it does not have, and wait for ever. So a
fork waits for translations, which take milliseconds.
"""

from __future__ import annotations

import os
from _thread import RLock

# Held while a kernel is translated, and for a fork.
translating = RLock()

if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=translating.acquire,
        after_in_parent=translating.release,
        after_in_child=translating.release,
    )
