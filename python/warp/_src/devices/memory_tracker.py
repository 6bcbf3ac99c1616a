"""Memory tracker: allocations of arrays by call site.

`wp.config.track_memory = True`, or a `ScopedMemoryTracker`, switches it on. Allocations made
before are not seen. Out-of-memory errors name the largest users while something is tracked.
"""

from __future__ import annotations

import sys

from warp import _native
from warp._src import config as settings
from warp._src.argument_kinds import TEXT
from warp._src.arguments import checked
from warp._src.devices import allocators
from warp._src.devices.call_sites import scopes

_PINNED = -2

_state = {"config": False}
# Blocks that are entered, by their ids.
_blocks: dict = {}


def _update() -> None:
    on = bool(_blocks) or _state["config"]
    (allocators.special.add if on else allocators.special.discard)("tracker")


def _set_from_config(value) -> None:
    _state["config"] = value
    _update()


settings.on_change("track_memory", _set_from_config)


class ScopedMemoryTracker(_native.Scope):
    """Notes the allocations of arrays made in a block, and prints a summary at its end.

    Args:
        name: put before the places in the report; nested names are joined by a slash.
        active: False makes it do nothing.
        print: False leaves the report to the caller.
        report_func: called with the text instead of printing it.
    """

    @checked()
    def __init__(self, name="root", active=True, print=True, report_func=None):
        self.name = name
        self.active = active
        self.print = print
        self.report_func = report_func

    # Names around the block, while it is entered.
    _outer = None

    def _enter(self):
        if self.active:
            self._outer = getattr(scopes, "names", [])
            scopes.names = [*self._outer, self.name]
            _blocks[id(self)] = self
            _update()
        return self

    def _leave(self, *exception):
        if self.active:
            scopes.names = self._outer
            if self.print:
                self.report()

    def _restore(self):
        if self._outer is not None:
            scopes.names = self._outer
            _blocks.pop(id(self), None)
            _update()
        self._outer = None

    @checked(sort=TEXT)
    def report(self, file=None, sort="size", max_items=10):
        """Prints what is allocated now; `sort` is "size" or "chronological"."""
        text = report_text(sort, max_items)
        if self.report_func is not None:
            self.report_func(text)
        else:
            print(text, file=file or sys.stdout)

    def clear(self):
        """Forgets the allocations noted so far."""
        _native.tracker_clear()


@checked(sort=TEXT)
def print_memory_report(file=None, sort="size", max_items=10) -> None:
    """Prints what is allocated now.

    Raises:
        RuntimeError: nothing is tracked.
    """
    if "tracker" not in allocators.special:
        raise RuntimeError(
            "no memory is tracked, set `wp.config.track_memory = True` or use "
            "`wp.ScopedMemoryTracker`"
        )
    print(report_text(sort, max_items), file=file or sys.stdout)


def report_text(sort="size", max_items=10) -> str:
    """Totals by device and the allocations that were not freed yet."""
    if sort not in ("size", "chronological"):
        raise ValueError(f"expects 'size' or 'chronological' as 'sort', but got {sort!r}")
    lines = ["memory by device:"]
    for device, (current, peak, count, frees) in sorted(_native.tracker_totals().items()):
        lines.append(
            f"  {_name(device)}: {_size(current)} now, {_size(peak)} peak, {count} allocations, "
            f"{frees} freed"
        )
    live = _native.tracker_live()
    if sort == "size":
        live.sort(key=lambda item: -item[1])
    if live:
        lines.append("not freed:")
    for _number, size, device, pinned, site in live[:max_items]:
        lines.append(f"  {_size(size):>10}  {_name(_PINNED if pinned else device)}  {site}")
    if len(live) > max_items:
        lines.append(f"  and {len(live) - max_items} more")
    return "\n".join(lines)


def _name(device: int) -> str:
    return {_PINNED: "pinned", -1: "cpu"}.get(device) or f"cuda:{device}"


def _size(size: int) -> str:
    if size < 1024:
        return f"{size} bytes"
    value = float(size)
    for unit in ("KiB", "MiB", "GiB"):
        value /= 1024
        if value < 1024 or unit == "GiB":
            return f"{value:.1f} {unit}"
    return ""
