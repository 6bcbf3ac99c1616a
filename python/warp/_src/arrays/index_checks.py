"""Checks of the arrays of indices that choose elements of an array."""

from __future__ import annotations

from warp import _native
from warp._src import errors
from warp._src.arrays.array import array
from warp._src.devices import devices
from warp._src.types import dtypes, scalars

MAX_DIMENSIONS = 4


def check_indices_lie_in(data, indices) -> None:
    """Looks for indices that lead out of an array; on the CPU, and not while a graph is captured.

    Raises:
        IndexError: names the first one.
    """
    if data.device_index != devices.CPU or _native.is_capturing(devices.CPU):
        return
    for axis, given in enumerate(indices[: data.ndim]):
        # Pinned memory that a GPU may still write is not looked at.
        if given is None or not given.size or given.pinned:
            continue
        found, extent = given._host_view(), data.shape[axis]
        if found.max() >= extent or found.min() < -extent:
            place = int(((found >= extent) | (found < -extent)).argmax())
            raise errors.WarpIndexError(
                f"index {found[place]} (number {place}) of dimension {axis} is out of bounds for "
                f"an array of shape {data.shape}"
            )


def checked_indices(indices, data) -> list:
    """An array of indices or None for each of the four dimensions that there can be."""
    given = [indices] if indices is None or isinstance(indices, array) else indices
    if not isinstance(given, (list, tuple)):
        raise ValueError(
            f"expects an array of indices or a list of them, but got '{type(indices).__name__}'"
        )
    if len(given) > data.ndim:
        raise ValueError(
            f"expects at most {data.ndim} arrays of indices for shape {data.shape}, "
            f"but got {len(given)}"
        )
    for axis, one in enumerate(given):
        if one is not None:
            _check_indices(one, axis, data)
    return [*given, *[None] * (MAX_DIMENSIONS - len(given))]


def _check_indices(given, axis, data) -> None:
    if not isinstance(given, array):
        raise ValueError(
            f"expects an array as indices of dimension {axis}, but got '{type(given).__name__}', "
            "use `wp.array(..., dtype=int)`"
        )
    if given.ndim != 1 or given.dtype is not scalars.int32:
        raise ValueError(
            f"expects a one-dimensional array of 'int32' as indices of dimension {axis}, but got "
            f"one of shape {given.shape} and '{dtypes.type_repr(given.dtype)}'"
        )
    if given.device_index != data.device_index:
        raise ValueError(
            f"expects indices of dimension {axis} on '{data.device}' like the data, but they are "
            f"on '{given.device}'"
        )
