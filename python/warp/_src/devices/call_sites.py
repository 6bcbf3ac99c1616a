"""The place in the program that an allocation belongs to, for the memory tracker."""

from __future__ import annotations

import os
import threading

from warp._src.version import calling_frame

# `names` are those of the trackers that are open in a thread, outermost first.
scopes = threading.local()


def call_site() -> str:
    """File, line and function outside of the package that led here, after the scopes."""
    frame = calling_frame()
    code = frame.f_code
    site = f"{os.path.basename(code.co_filename)}:{frame.f_lineno} ({code.co_name})"
    names = getattr(scopes, "names", None)
    return f"{'/'.join(names)}: {site}" if names else site
