"""The values of a volume at the places that the device library finds.

A place is in numbers of a value's kind: from the first leaf on, or from the grid's first byte on
for values that are not in leaves; of a value of another type than the grid's it is nowhere
(lib/DeviceLib/geometry/Volume.h). Values in leaves have derivatives.
"""

from warp._src.arrays.gradients import has_gradient
from warp._src.geometry.handles import VOLUME, words
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.dtypes import type_size, type_size_in_bytes
from warp._src.types.native import ArrayType
from warp._src.types.scalars import uint64

# Words of the slot.
_GRID, _LEAVES, GRADIENTS = 1, 3, 6
# Memory without an end is rows of this many bytes.
_ROW, _MOST = 64, 2**31 - 1
_OUTSIDE_LEAVES, _NOWHERE = 1 << 63, 2**64 - 1


def reading(value, scalar):
    """Leaves and grid as memory, and what reads a value there; 0 where no such value is."""
    size, length = type_size_in_bytes(scalar), type_size(value)
    in_row = _ROW // size

    def _twin(id: uint64):
        slot = words(id, VOLUME)
        return wp.where(slot[GRADIENTS] != uint64(0), slot[_LEAVES] + slot[GRADIENTS], uint64(0))

    def _leaves(id: uint64):
        return wp.array(ptr=words(id, VOLUME)[_LEAVES], shape=(_MOST, in_row), dtype=scalar)

    def _leaves_with_gradients(id: uint64):
        start = words(id, VOLUME)[_LEAVES]
        return wp.array(ptr=start, shape=(_MOST, in_row), dtype=scalar, grad=twin(id))

    def _number(rows: ArrayType(scalar, 2), at: uint64):
        return rows[at // uint64(in_row), at % uint64(in_row)]

    def _numbers(rows: ArrayType(scalar, 2), at: uint64):
        result = value()
        for n in range(length):
            result[n] = number(rows, at + uint64(n))
        return result

    def _grid(id: uint64):
        return wp.array(ptr=words(id, VOLUME)[_GRID], shape=(_MOST, in_row), dtype=scalar)

    def _at_place(near: ArrayType(scalar, 2), far: ArrayType(scalar, 2), place: uint64):
        result = value()
        if place < uint64(_OUTSIDE_LEAVES):
            result = take(near, place)
        elif place != uint64(_NOWHERE):
            result = take(far, place - uint64(_OUTSIDE_LEAVES))
        return result

    twin, number = Function(_twin, "twin"), Function(_number, "number")
    leaves = Function(_leaves_with_gradients if has_gradient(value) else _leaves, "leaves")
    take = number if value is scalar else Function(_numbers, "take")
    return leaves, Function(_grid, "grid"), Function(_at_place, "at_place")
