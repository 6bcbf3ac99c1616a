"""Globals of a notebook that change behind a kernel's back: one warning for each.

A kernel has the numbers that its globals had when it was compiled. In a notebook a cell that
assigns another number is often run without the cell that defines the kernel. After each cell, the
numbers are compared. Programs without IPython have none of this.
"""

from __future__ import annotations

import sys
import warnings

from warp._src.kernels.function import Function

# (kernel, the kernel's name, global's name, value when it was compiled), each until it is reported.
_watched: list = []
_shells: list = []


def watch(kernel) -> None:
    """Notes the numbers among the globals of a kernel that a notebook defines."""
    shell = sys.modules["IPython"].get_ipython()
    if shell is None or kernel.func.__module__ != "__main__":
        return
    if shell not in _shells:
        _shells.append(shell)
        shell.events.register("post_run_cell", lambda result: _report(shell))
    for name, value in _numbers(kernel.func, set()).items():
        _watched.append((kernel, name, value))


def _numbers(func, seen) -> dict:
    """Global numbers that a function names, and the functions of kernels that it names."""
    found, space = {}, func.__globals__
    seen.add(func)
    for name in func.__code__.co_names:
        value = space.get(name)
        if isinstance(value, (bool, int, float)):
            found[name] = value
        elif isinstance(value, Function) and value.func not in seen:
            found |= _numbers(value.func, seen)
    return found


def _report(shell) -> None:
    for one in list(_watched):
        kernel, name, value = one
        if shell.user_ns.get(kernel.func.__name__) is not kernel:
            # It was defined anew, or deleted.
            _watched.remove(one)
            continue
        now = shell.user_ns.get(name, value)
        if now is not value and (type(now) is not type(value) or now != value):
            _watched.remove(one)
            warnings.warn(
                f"global '{name}' is {now!r} now, but kernel '{kernel.func.__name__}' was compiled "
                f"with {value!r}: run the cell that defines the kernel again",
                stacklevel=2,
            )
