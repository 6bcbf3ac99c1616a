"""NanoVDB buffers, version 32: where a grid has what.

A buffer is a header, a tree, a root with a table of tiles, then upper nodes of 32^3 children, lower
nodes of 16^3 and leaves of 8^3 voxels, each aligned to 32 bytes. Offsets of values follow from
their size and alignment as C++ lays out the structs of the format.
"""

from __future__ import annotations

import functools

import numpy as np

MAGICS = (0x304244566F6E614E, 0x314244566F6E614E)
MAJOR = 32
VERSION = MAJOR << 21 | 3 << 10 | 3

HEADER = np.dtype(
    [
        *(("magic", "<u8"), ("checksum", "<u8"), ("version", "<u4"), ("flags", "<u4")),
        *(("index", "<u4"), ("count", "<u4"), ("size", "<u8"), ("name", "S256")),
        *(("single", "<f4", 9), ("single_inverse", "<f4", 9), ("single_shift", "<f4", 3)),
        *(("single_taper", "<f4"), ("matrix", "<f8", (3, 3)), ("inverse", "<f8", (3, 3))),
        *(("shift", "<f8", 3), ("taper", "<f8"), ("world_box", "<f8", 6)),
        *(("voxel_size", "<f8", 3), ("grid_class", "<u4"), ("type", "<u4")),
        *(("blind_offset", "<i8"), ("blind_count", "<u4"), ("data", "<u4")),
        *(("data1", "<u8"), ("data2", "<u8")),
    ]
)
TREE = np.dtype(
    [("offsets", "<i8", 4), ("counts", "<u4", 3), ("tile_counts", "<u4", 3), ("voxels", "<u8")]
)
BLIND = np.dtype(
    [
        *(("offset", "<i8"), ("count", "<u8"), ("size", "<u4"), ("semantic", "<u4")),
        *(("data_class", "<u4"), ("type", "<u4"), ("name", "S256")),
    ]
)
assert (HEADER.itemsize, TREE.itemsize, BLIND.itemsize) == (672, 64, 288)

# Name in `get_grid_info`, bytes of a value, its alignment, bytes of a mean.
TYPES = {
    1: ("float", 4, 4, 4),
    2: ("double", 8, 8, 8),
    3: ("int16", 2, 2, 4),
    4: ("int32", 4, 4, 4),
    5: ("int64", 8, 8, 8),
    6: ("Vec3f", 12, 4, 4),
    7: ("Vec3d", 24, 8, 8),
    9: ("Half", 2, 2, 4),
    10: ("uint32", 4, 4, 4),
    17: ("Vec4f", 16, 4, 4),
    18: ("Vec4d", 32, 8, 8),
    19: ("Index", 8, 8, 8),
    20: ("OnIndex", 8, 8, 8),
    21: ("IndexMask", 8, 8, 8),
    22: ("OnIndexMask", 8, 8, 8),
    26: ("uint8", 1, 1, 4),
}
NAMES = {number: entry[0] for number, entry in TYPES.items()}
INDEX, ON_INDEX, INDEX_MASK, ON_INDEX_MASK = INDICES = (19, 20, 21, 22)


def _up(n: int, to: int) -> int:
    return (n + to - 1) // to * to


class Layout:
    """Offsets of the nodes of a grid of one type.

    Attributes:
        value, is_index: bytes of a value; whether voxels have numbers in place of values.
        background, root, tile, tile_value: in the root and its tiles.
        upper_table, upper, lower_table, lower, entry: in inner nodes, and what a child takes.
        leaf_table, leaf: in leaves.
    """

    def __init__(self, number: int):
        _, size, align, mean = TYPES[number]
        self.value, self.number, self.is_index = size, number, number in INDICES
        self.background = _up(28, align)
        self.root = self._after(self.background, size, align, mean)
        self.tile_value = _up(20, align)
        self.tile = _up(self.tile_value + size, 32)
        self.entry = _up(max(size, 8), 8)
        self.upper_table = self._after(32 + 2 * 4096, size, align, mean)
        self.upper = self.upper_table + 32**3 * self.entry
        self.lower_table = self._after(32 + 2 * 512, size, align, mean)
        self.lower = self.lower_table + 16**3 * self.entry
        if self.is_index:
            self.leaf_table = 80
            self.leaf = 160 if number in (INDEX_MASK, ON_INDEX_MASK) else 96
        else:
            self.leaf_table = self._after(80, size, align, mean)
            self.leaf = _up(self.leaf_table + 512 * size, 32)

    @staticmethod
    def _after(start, size, align, mean) -> int:
        """Behind smallest and largest value (of the root, also its background), mean and spread."""
        values = 3 if start <= 32 else 2
        return _up(_up(start + values * size, mean) + 2 * mean, 32)

    def inner(self, table, size, cells) -> np.dtype:
        """An upper or lower node; children are 8 bytes of an entry."""
        mask = cells // 8
        fields = {
            "box": ("<i4", (6,), 0),
            "flags": ("<u8", (), 24),
            "values": ("u1", (mask,), 32),
            "children": ("u1", (mask,), 32 + mask),
            "table": (np.dtype((np.void, self.entry)), (cells,), table),
        }
        return _record(fields, size)

    @property
    def upper_node(self):
        return self.inner(self.upper_table, self.upper, 32**3)

    @property
    def lower_node(self):
        return self.inner(self.lower_table, self.lower, 16**3)

    @property
    def leaf_node(self):
        fields = {
            "origin": ("<i4", (3,), 0),
            "extent": ("u1", (3,), 12),
            "flags": ("u1", (), 15),
            "values": ("u1", (64,), 16),
        }
        if self.is_index:
            fields |= {"first": ("<u8", (), 80), "sums": ("<u8", (), 88)}
        else:
            fields["table"] = (np.dtype((np.void, self.value)), (512,), self.leaf_table)
        return _record(fields, self.leaf)

    @property
    def root_tile(self):
        fields = {
            "key": ("<u8", (), 0),
            "child": ("<i8", (), 8),
            "state": ("<u4", (), 16),
            "value": (np.dtype((np.void, self.value)), (), self.tile_value),
        }
        return _record(fields, self.tile)


def _record(fields, size) -> np.dtype:
    """A struct: type, shape and offset by name."""
    return np.dtype(
        {
            "names": list(fields),
            "formats": [(kind, shape) for kind, shape, _ in fields.values()],
            "offsets": [offset for *_, offset in fields.values()],
            "itemsize": size,
        }
    )


@functools.cache
def layout_of(number: int) -> Layout:
    """The layout of grids of a type, made once."""
    return Layout(number)


def keys_of(roots):
    """The key of a root's tile: 21 bits of each coordinate, in units of 4096 voxels."""
    part = (np.asarray(roots, dtype=np.int64) & 0xFFFFF).astype(np.uint64)
    return part[..., 2] | part[..., 1] << np.uint64(21) | part[..., 0] << np.uint64(42)


def roots_of(keys):
    """Coordinates that keys stand for."""
    keys = np.asarray(keys, dtype=np.uint64)
    parts = [(keys >> np.uint64(shift)) & np.uint64(0xFFFFF) for shift in (42, 21, 0)]
    roots = np.stack(parts, axis=-1).astype(np.int64)
    return roots - ((roots >> 19) << 20)
