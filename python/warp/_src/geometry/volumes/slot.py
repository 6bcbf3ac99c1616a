"""What kernels find of a volume (lib/DeviceLib/geometry/Volume.h: VolumeSlot)."""

from __future__ import annotations

import numpy as np

SLOT = np.dtype(
    [
        *(("grid", "<u8"), ("root", "<u8"), ("leaves", "<u8"), ("type", "<u4"), ("tiles", "<u4")),
        *(("voxels", "<u8"), ("gradient", "<u8"), ("background", "<u4"), ("root_size", "<u4")),
        *(("tile", "<u4"), ("tile_value", "<u4"), ("upper_table", "<u4"), ("lower_table", "<u4")),
        *(("entry", "<u4"), ("leaf_table", "<u4"), ("value", "<u4"), ("leaf", "<u4")),
        *(("leaves_end", "<u8"), ("numbers", "<u8"), ("lowest", "<i4", 3), ("extent", "<u4", 3)),
    ]
)


# Entries of the table of leaves for each leaf, at most: a word beside the 512 of its voxels.
TABLE_ROOM = 16
NO_LEAF = 0xFFFFFFFF


def table_of(nodes):
    """The numbers of leaves in the box around all of them, and its lowest leaf.

    None where the box has much more room than there are leaves.
    """
    places = (nodes.leaves["origin"] & ~7).astype(np.int64) >> 3
    if not len(places):
        return None
    lowest = places.min(axis=0)
    extent = places.max(axis=0) - lowest + 1
    if np.prod(extent.astype(float)) > TABLE_ROOM * len(places):
        return None
    numbers = np.full(extent, NO_LEAF, dtype=np.uint32)
    numbers[tuple((places - lowest).T)] = np.arange(len(places), dtype=np.uint32)
    return numbers, lowest


def slot_of(nodes, address, voxels, numbers_at, table) -> bytes:
    """The slot of a checked grid that lies at an address, without its first word.

    numbers_at: where the table of `table_of` is, if there is one.
    """
    layout = nodes.layout
    slot = np.zeros(1, dtype=SLOT)[0]
    slot["grid"], slot["root"] = address, address + nodes.root_at
    slot["leaves"] = address + nodes.leaf_at
    slot["leaves_end"] = address + nodes.leaf_at + nodes.leaves.nbytes
    slot["type"], slot["tiles"], slot["voxels"] = layout.number, len(nodes.tiles), voxels
    slot["background"], slot["root_size"] = layout.background, layout.root
    slot["tile"], slot["tile_value"] = layout.tile, layout.tile_value
    slot["upper_table"], slot["lower_table"] = layout.upper_table, layout.lower_table
    slot["entry"], slot["leaf_table"] = layout.entry, layout.leaf_table
    slot["value"], slot["leaf"] = layout.value, layout.leaf
    if table is not None:
        numbers, slot["lowest"] = table
        slot["numbers"], slot["extent"] = numbers_at, numbers.shape
    return slot.tobytes()
