"""The kernel cache on disk: what is in it, how much it takes, and how to clear it.

    python -m warp.cache                        # folder, entries and bytes by kind
    python -m warp.cache list                   # a line per kernel, the last used first
    python -m warp.cache clear                  # all
    python -m warp.cache clear --older-than 30  # what was not used for 30 days
    python -m warp.cache clear --kernel saxpy   # what belongs to kernels of that name
    python -m warp.cache trim                   # down to `wp.config.kernel_cache_limit`

`WARP_CACHE_PATH`, or `--folder`, names another cache than that of the user. Processes that run
meanwhile compile what they miss, and keep what they have loaded.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import typing

from warp._src.argument_kinds import NONE as _NONE
from warp._src.argument_kinds import NUMBER as _NUMBER
from warp._src.argument_kinds import TEXT as _TEXT
from warp._src.arguments import checked as _checked

# Meaning of the ends of file names.
_KINDS = {
    "code": "code",
    "machine": "machine code of GPUs",
    "kernel": "translations",
    "lanes": "measured times of lanes",
}
_DAY = 86400


class Entry(typing.NamedTuple):
    """A file of the cache.

    Attributes:
        file: its name.
        kind: `code` (objects and PTX), `machine` (of GPUs), `kernel` (a translation) or `lanes`
            (times by which lanes were checked).
        kernel: the kernel; empty if the file is damaged.
        bytes: its size.
        used: when it was last used, in seconds since 1970, to an hour.
    """

    file: str
    kind: str
    kernel: str
    bytes: int
    used: int


def entries() -> list[Entry]:
    """The files of the cache, those used last first."""
    from warp import _native

    return [Entry(*entry) for entry in _native.cache_entries()]


def size() -> int:
    """Bytes that the files of the cache take."""
    return sum(entry.bytes for entry in entries())


@_checked(kernel=_TEXT | _NONE, older_than=_NUMBER | _NONE)
def clear(kernel: str | None = None, older_than: float | None = None) -> int:
    """Removes entries; kernels of this process stay usable.

    Args:
        kernel: only those of kernels of this name.
        older_than: only what was not used for so many days.

    Returns:
        The number of files removed.

    Raises:
        ValueError: `older_than` is negative.
    """
    from warp import _native

    if older_than is not None and older_than < 0:
        raise ValueError(f"older_than expects no negative number of days, but got {older_than!r}")
    now, count = time.time(), 0
    for entry in entries():
        if kernel is not None and entry.kernel != kernel:
            continue
        if older_than is not None and now - entry.used < older_than * _DAY:
            continue
        _native.remove_cached(entry.file)
        count += 1
    if kernel is None and older_than is None:
        _native.clear_cache()
    return count


def _shown(count: float) -> str:
    for unit in ("bytes", "KiB", "MiB"):
        if count < 1024:
            return f"{count:.0f} {unit}" if unit == "bytes" else f"{count:.1f} {unit}"
        count /= 1024
    return f"{count:.1f} GiB"


def _print_summary() -> None:
    from warp import _native, config

    found = entries()
    print(_native.cache_directory())
    for kind, words in _KINDS.items():
        sizes = [entry.bytes for entry in found if entry.kind == kind]
        print(f"  {words:22} {len(sizes):6}  {_shown(sum(sizes)):>12}")
    total = _shown(sum(entry.bytes for entry in found))
    limit = config.kernel_cache_limit
    bound = f"of at most {limit:g} GiB" if limit else "without a limit"
    print(f"  {'in all':22} {len(found):6}  {total:>12} {bound}")


def _print_kernels() -> None:
    kernels: dict = {}
    for entry in entries():
        known = kernels.setdefault(entry.kernel or "(damaged)", [0, 0, 0])
        known[0] += 1
        known[1] += entry.bytes
        known[2] = max(known[2], entry.used)
    for name, (count, taken, used) in sorted(kernels.items(), key=lambda item: -item[1][2]):
        when = time.strftime("%Y-%m-%d %H:%M", time.localtime(used))
        print(f"{when}  {_shown(taken):>10}  {count:4} files  {name}")


def main(arguments=None) -> int:
    """The command line, `python -m warp.cache`; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m warp.cache",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("command", nargs="?", default="size", choices=_COMMANDS)
    parser.add_argument("--folder", help="the cache's folder, by default that of the user")
    parser.add_argument("--kernel", help="clear: only kernels of this name")
    parser.add_argument("--older-than", type=float, metavar="DAYS", help="clear: what is so old")
    given = parser.parse_args(arguments)
    if given.command != "clear" and (given.kernel is not None or given.older_than is not None):
        parser.error("--kernel and --older-than go with clear")
    if given.older_than is not None and not given.older_than >= 0:
        parser.error("--older-than expects no negative number")
    if given.folder is not None:
        if not os.path.isdir(given.folder):
            parser.error(f"no folder '{given.folder}'")
        from warp import config

        config.kernel_cache_dir = given.folder
    if given.command == "list":
        _print_kernels()
    elif given.command == "clear":
        print(f"{clear(given.kernel, given.older_than)} files removed")
    elif given.command == "trim":
        from warp import _native

        print(f"{_shown(_native.trim_cache())} removed")
    else:
        _print_summary()
    return 0


_COMMANDS = ("size", "list", "clear", "trim")

if __name__ == "__main__":
    sys.exit(main())
