"""What kernels find of a volume (lib/DeviceLib/geometry/Volume.h: VolumeSlot)."""

from __future__ import annotations

import numpy as np

_SLOT = np.dtype(
    [
        *(("grid", "<u8"), ("root", "<u8"), ("leaves", "<u8"), ("type", "<u4"), ("tiles", "<u4")),
        *(("voxels", "<u8"), ("gradient", "<u8"), ("background", "<u4"), ("root_size", "<u4")),
        *(("tile", "<u4"), ("tile_value", "<u4"), ("upper_table", "<u4"), ("lower_table", "<u4")),
        *(("entry", "<u4"), ("leaf_table", "<u4"), ("value", "<u4"), ("leaf", "<u4")),
    ]
)


def slot_of(nodes, address, voxels) -> bytes:
    """The slot of a checked grid that lies at an address, without its first word."""
    layout = nodes.layout
    slot = np.zeros(1, dtype=_SLOT)[0]
    slot["grid"], slot["root"] = address, address + nodes.root_at
    slot["leaves"] = address + nodes.leaf_at
    slot["type"], slot["tiles"], slot["voxels"] = layout.number, len(nodes.tiles), voxels
    slot["background"], slot["root_size"] = layout.background, layout.root
    slot["tile"], slot["tile_value"] = layout.tile, layout.tile_value
    slot["upper_table"], slot["lower_table"] = layout.upper_table, layout.lower_table
    slot["entry"], slot["leaf_table"] = layout.entry, layout.leaf_table
    slot["value"], slot["leaf"] = layout.value, layout.leaf
    return slot.tobytes()
