"""`appdirs`: Newton asks it for the folder of its downloads."""

from __future__ import annotations

import os
import sys


def user_cache_dir(appname=None, appauthor=None, version=None, opinion=True) -> str:
    """The folder for files that can be made again, by the conventions of the platform.

    Args:
        appname: folder of the application; without it the folder of all applications.
        appauthor: folder around it on Windows, by default `appname`; False for none.
        version: folder in that of the application.
        opinion: on Windows, add a folder `Cache`.
    """
    if sys.platform == "win32":
        path = os.environ.get("LOCALAPPDATA") or os.path.expanduser(r"~\AppData\Local")
        if appname and appauthor is not False:
            path = os.path.join(path, appauthor or appname)
    elif sys.platform == "darwin":
        path = os.path.expanduser("~/Library/Caches")
    else:
        path = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    if appname:
        path = os.path.join(path, appname)
        if sys.platform == "win32" and opinion:
            path = os.path.join(path, "Cache")
        if version:
            path = os.path.join(path, version)
    return path
