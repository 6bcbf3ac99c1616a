"""Hash grids built by kernels, where their points are.

Every point gets the number of its cell, pairs of cell and point are sorted by it, stably, and the
first point of each cell is searched for. The arrays are those that lib/Geometry/HashGrid.cpp makes.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

import warp as wp
from warp import _native
from warp._src import errors
from warp._src.devices import devices
from warp._src.geometry.grid_queries import cells
from warp._src.geometry.handles import GRID
from warp._src.types.dtypes import Float


@wp.func
def _number_of(point: wp.types.vector(3, Float), inverse: Float, counts: wp.vec3i) -> int:
    """The number of a point's cell; one beyond all for NaN."""
    found = counts[0] * counts[1] * counts[2]
    if point[0] == point[0] and point[1] == point[1] and point[2] == point[2]:
        x, _x, y, _y, z, _z = cells(
            point, type(inverse)(0.0), inverse, counts[0], counts[1], counts[2]
        )
        found = (z * counts[1] + y) * counts[0] + x
    return found


@wp.kernel(enable_backward=False, module="unique")
def _number_points(
    points: wp.array(dtype=Any),
    inverse: Any,
    counts: wp.vec3i,
    keys: wp.array(dtype=wp.uint32),
    order: wp.array(dtype=int),
):
    i = wp.tid()
    p = points[i]
    # Cells are computed in the type of `inverse`.
    at = wp.vector(type(inverse)(p[0]), type(inverse)(p[1]), type(inverse)(p[2]))
    keys[i] = wp.uint32(_number_of(at, inverse, counts))
    order[i] = i


# Threads that are neighbours, and how many of their cells each has: every so-manieth.
_THREADS, _CELLS = wp.constant(32), wp.constant(8)


@wp.func
def _search(keys: wp.array(dtype=wp.uint32), low: int, high: int, cell: wp.uint32) -> int:
    """The first point of [low, high) that is not before a cell."""
    first = int(low)
    end = int(high)
    while first < end:
        middle = (first + end) // 2
        if keys[middle] < cell:
            first = middle + 1
        else:
            end = middle
    return first


@wp.kernel(enable_backward=False, module="unique")
def _find_starts(keys: wp.array(dtype=wp.uint32), count: int, starts: wp.array(dtype=int)):
    i = wp.tid()
    begin = i // _THREADS * (_THREADS * _CELLS)
    # The same for all the threads, which then search among few.
    low = _search(keys, 0, count, wp.uint32(begin))
    high = _search(keys, low, count, wp.uint32(begin + _THREADS * _CELLS))
    for k in range(_CELLS):
        cell = begin + _THREADS * k + i % _THREADS
        if cell < len(starts):
            starts[cell] = _search(keys, low, high, wp.uint32(cell))


class DeviceGrid:
    """Arrays of a `HashGrid` on a GPU; on a CPU it makes the same arrays as the runtime.

    Args:
        cells: cells along the axes.
        device: where the points are.
    """

    def __init__(self, cells, device):
        self.device, self._counts = device, wp.vec3i(*cells)
        self._cells = tuple(cells)
        self._total = cells[0] * cells[1] * cells[2]
        self._handle = _native.GeometryHandle(GRID, devices.resolve_index(device))
        self.id = self._handle.id
        self.starts = wp.zeros(self._total + 1, dtype=int, device=device)
        self._keys = self._order = None
        self._count, self._written, self._inverse = 0, None, 1.0
        # Where the order begins in its array.
        self._first = 0
        # Launches, and what they were recorded for.
        self._number, self._starts, self._recorded = None, None, None
        self.reserve(0)
        self._publish(None)

    @property
    def skipped(self) -> int:
        """Points of the last build that are NaN; waits for it."""
        return self._count - int(self.starts[self._total :].numpy()[0])

    @property
    def order(self) -> wp.array:
        """The points in the order of their cells."""
        return self._order[self._first : self._first + self._count]

    def reserve(self, points):
        """Makes room for a number of points, which sorting needs twice."""
        if self._keys is None or len(self._keys) < 2 * points:
            room = max(2 * points, 2)
            self._keys = wp.empty(room, dtype=wp.uint32, device=self.device)
            self._order = wp.empty(room, dtype=int, device=self.device)

    def build(self, points, scalar_size, width, groups=None):
        """Sorts points of floats of so many bytes into cells of a width."""
        count = self._count = len(points)
        self.reserve(count)
        recorded = (points.ptr, count, scalar_size, width, self._keys.ptr)
        if self._recorded != recorded:
            self._record(points, scalar_size, width)
            self._recorded = recorded
        self._number.launch()
        bits = self._total.bit_length()
        behind = count > 1 and _native.sort_pairs_anywhere(
            self._keys, self._order, "uint32", count, 0, bits
        )
        self._starts[behind].launch()
        self._first = count if behind else 0
        self._publish(groups)

    def _record(self, points, scalar_size, width):
        """Prepares the launches of a build."""
        count = len(points)
        kind, scalar = (np.float64, wp.float64) if scalar_size == 8 else (np.float32, wp.float32)
        with np.errstate(over="ignore"):
            self._inverse = float(kind(1) / kind(width))

        def record(kernel, dim, inputs):
            return wp.launch(kernel, dim, inputs, device=self.device, record_cmd=True)

        inputs = [points, scalar(self._inverse), self._counts, self._keys, self._order]
        self._number = record(_number_points, count, inputs)
        threads = (self._total // int(_THREADS * _CELLS) + 1) * int(_THREADS)
        halves = [self._keys[:count], self._keys[count : 2 * count]]
        self._starts = [record(_find_starts, threads, [one, count, self.starts]) for one in halves]

    def _publish(self, groups):
        """Writes the slot, unless it says the same already, as when a graph is captured."""
        slot = struct.pack("<4id", *self._cells, self._count, self._inverse)
        for array, length in (
            (self.starts, self._total + 1),
            (self._order, self._count),
            (groups, 0 if groups is None else len(groups)),
        ):
            address = 0 if array is None else array.ptr or 0
            if array is self._order:
                address += 4 * self._first
            slot += struct.pack("<2Q10i", address, 0, length, 0, 0, 0, 4, 0, 0, 0, 1, 0)
        if slot == self._written:
            return
        if not self.device.is_cpu:
            if _native.is_capturing(self.device.index):
                raise errors.WarpError(
                    "a graph captures a HashGrid that was built before with as many points, the "
                    "same radius and the same groups; build it once outside"
                )
            # Kernels that run may read it.
            devices.synchronize_device(self.device)
        self._handle.write(slot)
        self._written = slot
