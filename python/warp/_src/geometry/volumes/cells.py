"""The values of a volume at the places that the device library finds.

A place is in numbers of a value's kind, from the grid's first byte on
(lib/DeviceLib/geometry/Volume.h). Values in leaves have derivatives: only where these are computed
does it matter which ones are there.
"""

from warp._src.arrays.gradients import has_gradient
from warp._src.device_table import WORDS
from warp._src.geometry.handles import VOLUME, words
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.dtypes import type_size, type_size_in_bytes
from warp._src.types.native import ArrayType
from warp._src.types.scalars import int32, uint32, uint64

_SLOT = WORDS["Volume"]
_GRID, _TYPE, GRADIENTS = _SLOT["grid"], _SLOT["type"], _SLOT["gradient"]
_LEAVES, _LEAVES_END = _SLOT["leaves"], _SLOT["leaves_end"]
# Words of two numbers each: sizes and offsets, then the box of leaves.
_NUMBERS, _BOX, _OFFSETS = _SLOT["numbers"], _SLOT["box"], _SLOT["offsets"]
# Memory without an end is rows of this many bytes.
_ROW, _MOST = 64, 2**31 - 1


def _low(word: uint64):
    return uint32(word)


def _high(word: uint64):
    return uint32(word >> uint64(32))


low, high = Function(_low, "low"), Function(_high, "high")


def _leaf_of(id: uint64, i: int32, j: int32, k: int32):
    """The number of a voxel's leaf by the table of leaves, -1 if that does not have it.

    Lookups of neighbours share its parts, and lanes make vectors of it. On GPUs the library has it.
    """
    slot = words(id, VOLUME)
    leaf = int32(-1)
    if wp._library_call("warp_is_cpu") != 0 and slot[_NUMBERS] != uint64(0):
        x = uint32(i >> 3) - low(slot[_BOX])
        y = uint32(j >> 3) - high(slot[_BOX])
        z = uint32(k >> 3) - low(slot[_BOX + 1])
        wide, deep = low(slot[_BOX + 2]), high(slot[_BOX + 2])
        is_within = x < high(slot[_BOX + 1]) and y < wide and z < deep
        numbers = wp.array(ptr=slot[_NUMBERS], shape=_MOST, dtype=int32)
        leaf = numbers[wp.where(is_within, (x * wide + y) * deep + z, uint32(0))]
        leaf = wp.where(is_within, leaf, int32(-1))
    return leaf


leaf_of = Function(_leaf_of, "leaf_of")


def access(value, scalar, number):
    """True if a grid has values of a type, its memory, and what reads and writes a value there.

    A value is written if it is one of a leaf: others are those of many voxels.
    """
    size, length = type_size_in_bytes(scalar), type_size(value)
    in_row = _ROW // size

    def _fits(id: uint64):
        return (words(id, VOLUME)[_TYPE] & uint64(0xFFFFFFFF)) == uint64(number)

    def _grid(id: uint64):
        return wp.array(ptr=words(id, VOLUME)[_GRID], shape=(_MOST, in_row), dtype=scalar)

    def _twin(id: uint64):
        slot = words(id, VOLUME)
        return wp.where(slot[GRADIENTS] != uint64(0), slot[_GRID] + slot[GRADIENTS], uint64(0))

    def _leaves(id: uint64):
        start = words(id, VOLUME)[_GRID]
        return wp.array(ptr=start, shape=(_MOST, in_row), dtype=scalar, grad=twin(id))

    def _is_in_leaf(id: uint64, place: uint64):
        slot = words(id, VOLUME)
        at = slot[_GRID] + place * uint64(size)
        return at >= slot[_LEAVES] and at < slot[_LEAVES_END]

    def _number(rows: ArrayType(scalar, 2), at: uint64):
        return rows[at // uint64(in_row), at % uint64(in_row)]

    def _numbers(rows: ArrayType(scalar, 2), at: uint64):
        result = value()
        for n in range(length):
            result[n] = number_at(rows, at + uint64(n))
        return result

    def _put(id: uint64, place: uint64, given: value):
        if is_in_leaf(id, place):
            rows = grid(id)
            rows[place // uint64(in_row), place % uint64(in_row)] = given

    def _put_numbers(id: uint64, place: uint64, given: value):
        if is_in_leaf(id, place):
            rows = grid(id)
            for n in range(length):
                at = place + uint64(n)
                rows[at // uint64(in_row), at % uint64(in_row)] = given[n]

    def _at_place(rows: ArrayType(scalar, 2), id: uint64, place: uint64):
        return take(rows, place)

    def _at_place_or_leaf(rows: ArrayType(scalar, 2), id: uint64, place: uint64):
        result = take(rows, place)
        if wp._library_call("warp_is_differentiated") != 0 and is_in_leaf(id, place):
            result = take(leaves(id), place)
        return result

    def _voxel(id: uint64, i: int32, j: int32, k: int32):
        slot = words(id, VOLUME)
        leaf = leaf_of(id, i, j, k)
        start = slot[_LEAVES] - slot[_GRID] + uint64(high(slot[_OFFSETS + 3]))
        stride = uint64(high(slot[_OFFSETS + 4]))
        in_leaf = ((i & 7) << 6) | ((j & 7) << 3) | (k & 7)
        place = (start + uint64(leaf) * stride) // uint64(size) + uint64(in_leaf * length)
        if leaf < 0:
            place = wp._library_call("warp_volume_voxel", id, i, j, k)
        return place

    twin, number_at = Function(_twin, "twin"), Function(_number, "number_at")
    fits, grid = Function(_fits, "fits"), Function(_grid, "grid")
    leaves, is_in_leaf = Function(_leaves, "leaves"), Function(_is_in_leaf, "is_in_leaf")
    take = number_at if value is scalar else Function(_numbers, "take")
    read = _at_place_or_leaf if has_gradient(value) else _at_place
    put = Function(_put if value is scalar else _put_numbers, "put")
    return fits, grid, Function(read, "at_place"), put, Function(_voxel, "voxel")
