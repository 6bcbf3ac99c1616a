"""Texels as kernels read them and as users have them, on the device."""

from __future__ import annotations

from warp._src.arrays import hooks
from warp._src.arrays.casts import cast


def read(source, most, target) -> None:
    """Writes the float32 texels of numbers.

    Args:
        source: packed array of numbers.
        most: what integers are divided by, None for numbers that stay as they are.
        target: packed array of as many float32.
    """
    if most is None:
        return cast(source, target)
    _apply(source, target, f"wp.max(kind(wp.float64(x0) / wp.float64({most})), kind(-1.0))", most)


def write(source, most, target) -> None:
    """Writes the numbers that float32 texels stand for; the arguments are those of `read`."""
    if most is None:
        return cast(source, target)
    _apply(source, target, f"kind(wp.rint(wp.float64(x0) * wp.float64({most})))", most)


def _apply(source, target, expression, most):
    from warp._src.language import namespace

    kind = target.dtype
    name = f"texels_{kind.__name__}_{int(most)}"
    names = {"kind": kind, "wp": namespace}
    hooks.apply(name, expression, names, name, [(None, source)], target, False, None, None)
