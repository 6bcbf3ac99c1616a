"""Where a volume's values are, for lanes that ask for distant voxels at once.

Where leaves are dense the host adds a table of them (slot.py): there the place of a voxel follows
from one number of the table, no lane waits for another and nothing is called. A place is a number
of scalars, from the first leaf on. Where other values are says the device library, for one thread
at a time; these are addresses.
"""

from warp._src.arrays.gradients import has_gradient
from warp._src.geometry.handles import VOLUME, integers, words
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.dtypes import type_size, type_size_in_bytes
from warp._src.types.native import ArrayType
from warp._src.types.scalars import int32, uint32, uint64

# Words of the slot, of 64 and of 32 bits.
GRID, LEAVES, GRADIENTS, LEAVES_END, _NUMBERS = 1, 3, 6, 12, 13
_TYPE, _LEAF_TABLE, _LEAF_BYTES, _LOWEST, _EXTENT = 8, 21, 23, 28, 31
# Memory without an end is rows of this many bytes.
_ROW, _MOST = 64, 2**31 - 1


def _facts(id: uint64):
    return integers(wp._library_call("warp_slot", id, VOLUME), 34)


def _table(id: uint64):
    """The numbers of leaves in a box of them, z fastest; -1 for none."""
    box = facts(id)
    count = box[_EXTENT] * box[_EXTENT + 1] * box[_EXTENT + 2]
    return integers(words(id, VOLUME)[_NUMBERS], count)


def _leaf_bytes(id: uint64):
    slot = words(id, VOLUME)
    return slot[LEAVES_END] - slot[LEAVES]


def _ends(first: int32, lowest: int32):
    """The leaves along an axis of a voxel and of the next one."""
    return (first >> 3) - lowest, ((first + 1) >> 3) - lowest


def _are_within(first: int32, second: int32, extent: int32):
    return wp.max(uint32(first), uint32(second)) < uint32(extent)


facts, table = Function(_facts, "facts"), Function(_table, "table")
leaf_bytes, ends = Function(_leaf_bytes, "leaf_bytes"), Function(_ends, "ends")
are_within = Function(_are_within, "are_within")


def places(number, value, scalar):
    """What finds voxels of a type by the table: one, and the corners of a cell, z fastest.

    A place is -1 where the table does not help; those of a cell are, all or none.
    """
    size, length = type_size_in_bytes(scalar), type_size(value)

    def _is_usable(id: uint64):
        return facts(id)[_TYPE] == number and leaf_bytes(id) >> uint64(31) < uint64(size)

    def _row(id: uint64, i: int32, j: int32):
        """The place of z = 0 of two coordinates in leaf 0."""
        return facts(id)[_LEAF_TABLE] // size + (((i & 7) << 6) + ((j & 7) << 3)) * length

    def _place(id: uint64, i: int32, j: int32, k: int32):
        box = facts(id)
        x, y, z = (i >> 3) - box[_LOWEST], (j >> 3) - box[_LOWEST + 1], (k >> 3) - box[_LOWEST + 2]
        place = int32(-1)
        if (
            is_usable(id)
            and are_within(x, x, box[_EXTENT])
            and are_within(y, y, box[_EXTENT + 1])
            and are_within(z, z, box[_EXTENT + 2])
        ):
            leaf = table(id)[(x * box[_EXTENT + 1] + y) * box[_EXTENT + 2] + z]
            if leaf >= 0:
                place = leaf * (box[_LEAF_BYTES] // size) + row(id, i, j) + (k & 7) * length
        return place

    def _cell(id: uint64, i: int32, j: int32, k: int32):
        box = facts(id)
        x, u = ends(i, box[_LOWEST])
        y, v = ends(j, box[_LOWEST + 1])
        z, w = ends(k, box[_LOWEST + 2])
        a, b, c, d = int32(-1), int32(-1), int32(-1), int32(-1)
        e, f, g, h = int32(-1), int32(-1), int32(-1), int32(-1)
        if (
            is_usable(id)
            and are_within(x, u, box[_EXTENT])
            and are_within(y, v, box[_EXTENT + 1])
            and are_within(z, w, box[_EXTENT + 2])
        ):
            leaf, wide, deep = table(id), box[_EXTENT + 1], box[_EXTENT + 2]
            p, q = (x * wide + y) * deep, (x * wide + v) * deep
            r, s = (u * wide + y) * deep, (u * wide + v) * deep
            la, lb, lc, ld = leaf[p + z], leaf[p + w], leaf[q + z], leaf[q + w]
            le, lf, lg, lh = leaf[r + z], leaf[r + w], leaf[s + z], leaf[s + w]
            low, high = (
                wp.min(wp.min(la, lb), wp.min(lc, ld)),
                wp.min(wp.min(le, lf), wp.min(lg, lh)),
            )
            if wp.min(low, high) >= 0:
                size_of_leaf = box[_LEAF_BYTES] // size
                m, n = (k & 7) * length, ((k + 1) & 7) * length
                p, q = row(id, i, j), row(id, i, j + 1)
                r, s = row(id, i + 1, j), row(id, i + 1, j + 1)
                a, b = la * size_of_leaf + (p + m), lb * size_of_leaf + (p + n)
                c, d = lc * size_of_leaf + (q + m), ld * size_of_leaf + (q + n)
                e, f = le * size_of_leaf + (r + m), lf * size_of_leaf + (r + n)
                g, h = lg * size_of_leaf + (s + m), lh * size_of_leaf + (s + n)
        return a, b, c, d, e, f, g, h

    is_usable, row = Function(_is_usable, "is_usable"), Function(_row, "row")
    return Function(_place, "place"), Function(_cell, "places_of_cell")


def reading(value, scalar):
    """What reads a value at a place, and one at an address; 0 where no such value is."""
    size, length = type_size_in_bytes(scalar), type_size(value)
    in_row = _ROW // size

    def _twin(id: uint64):
        slot = words(id, VOLUME)
        return wp.where(slot[GRADIENTS] != uint64(0), slot[LEAVES] + slot[GRADIENTS], uint64(0))

    def _leaves(id: uint64, count: int32):
        return wp.array(ptr=words(id, VOLUME)[LEAVES], shape=count, dtype=scalar)

    def _leaves_with_gradients(id: uint64, count: int32):
        start = words(id, VOLUME)[LEAVES]
        return wp.array(ptr=start, shape=count, dtype=scalar, grad=twin(id))

    def _rows(id: uint64):
        return wp.array(ptr=words(id, VOLUME)[LEAVES], shape=(_MOST, in_row), dtype=scalar)

    def _rows_with_gradients(id: uint64):
        start = words(id, VOLUME)[LEAVES]
        return wp.array(ptr=start, shape=(_MOST, in_row), dtype=scalar, grad=twin(id))

    def _number(numbers: ArrayType(scalar, 1), at: int32):
        return numbers[at]

    def _numbers(numbers: ArrayType(scalar, 1), at: int32):
        result = value()
        for n in range(length):
            result[n] = numbers[at + n]
        return result

    def _far_number(rows: ArrayType(scalar, 2), at: uint64):
        return rows[at // uint64(in_row), at % uint64(in_row)]

    def _far_numbers(rows: ArrayType(scalar, 2), at: uint64):
        result = value()
        for n in range(length):
            result[n] = far_number(rows, at + uint64(n))
        return result

    def _at_place(id: uint64, place: int32):
        count = wp.min(leaf_bytes(id) // uint64(size), uint64(_MOST))
        return take(leaves(id, int(count)), place)

    def _at_address(id: uint64, address: uint64):
        slot = words(id, VOLUME)
        result = value()
        if address - slot[LEAVES] < leaf_bytes(id):
            result = take_far(rows(id), (address - slot[LEAVES]) // uint64(size))
        elif address != uint64(0):
            others = wp.array(ptr=slot[GRID], shape=(_MOST, in_row), dtype=scalar)
            result = take_far(others, (address - slot[GRID]) // uint64(size))
        return result

    twin, far_number = Function(_twin, "twin"), Function(_far_number, "far_number")
    has_twin, is_one = has_gradient(value), value is scalar
    leaves = Function(_leaves_with_gradients if has_twin else _leaves, "leaves")
    rows = Function(_rows_with_gradients if has_twin else _rows, "rows")
    take = Function(_number if is_one else _numbers, "take")
    take_far = far_number if is_one else Function(_far_numbers, "take_far")
    return Function(_at_place, "at_place"), Function(_at_address, "at_address")
