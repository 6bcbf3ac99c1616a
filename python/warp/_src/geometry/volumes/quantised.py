"""Grids whose voxels are numbers of 1 to 16 bits, made grids of float32 when they are loaded.

Types Fp4, Fp8 and Fp16 have as many bits, FpN has 1, 2, 4, 8 or 16 in each leaf. A voxel is its
number times the leaf's quantum, plus the leaf's minimum. All but the leaves is as in a grid of
float32.
"""

from __future__ import annotations

import numpy as np

from warp._src.geometry.volumes.checks import Nodes, broken, children_of, header_of, tree_of
from warp._src.geometry.volumes.layout import HEADER, layout_of

# Bits of a voxel; of FpN each leaf has its own.
_BITS = {13: 4, 14: 8, 15: 16, 16: None}
_FLOAT = 1
_HEAD = 96
_LEAF = np.dtype(
    [
        *(("origin", "<i4", 3), ("extent", "u1", 3), ("flags", "u1"), ("values", "u1", 64)),
        *(("minimum", "<f4"), ("quantum", "<f4"), ("stats", "<u2", 4)),
    ]
)
assert _LEAF.itemsize == _HEAD


def expanded(buffer):
    """The grids of a buffer, one behind the other; the same buffer if none is quantised.

    Raises:
        WarpError: a grid is damaged.
    """
    grids, start, found = [], 0, False
    while start < buffer.size:
        header = header_of(buffer[start:])
        size = int(header["size"])
        if not HEADER.itemsize < size <= buffer.size - start:
            raise broken(f"it says it has {size} bytes, but there are {buffer.size - start}")
        grid = buffer[start : start + size]
        if int(header["type"]) in _BITS:
            grid, found = _expand(grid), True
        grids.append(grid)
        start += size
        if int(header["index"]) + 1 >= int(header["count"]):
            break
    if not found:
        return buffer
    return np.concatenate([*grids, buffer[start:]])


def _expand(grid):
    bits = _BITS[int(header_of(grid)["type"])]
    above = Nodes(grid, layout_of(_FLOAT))
    parent, place, offsets = children_of(above.lowers, above.starts[1])
    leaves, which = np.unique(offsets, return_inverse=True)
    count, ends = int(tree_of(grid)["counts"][0]), above.end
    if len(leaves) != count:
        raise broken(f"it says it has {count} leaves, but its nodes have {len(leaves)}")
    if len(leaves) and not (leaves[0] >= ends and leaves[-1] + _HEAD <= grid.size):
        raise broken("a leaf is not behind its other nodes")
    heads = _gather(grid, leaves, _HEAD).view(_LEAF).reshape(-1)
    widths = np.full(len(leaves), bits) if bits else 1 << (heads["flags"] >> 5).astype(np.int64)
    if (widths > 16).any():
        raise broken("a leaf has voxels of more than 16 bits")
    stops = leaves + _HEAD + 64 * widths
    if (stops > np.append(leaves[1:], grid.size)).any():
        raise broken("a leaf is not within its bytes")
    made = np.zeros(len(leaves), dtype=above.layout.leaf_node)
    for field in ("origin", "extent", "flags", "values"):
        made[field] = heads[field]
    # The width of FpN.
    made["flags"] &= 0x1F
    table = np.zeros((len(leaves), 512), dtype=np.float32)
    for width in np.unique(widths):
        of = np.flatnonzero(widths == width)
        numbers = _numbers(_gather(grid, leaves[of] + _HEAD, 64 * width), width)
        with np.errstate(all="ignore"):
            scaled = numbers * heads["quantum"][of, None] + heads["minimum"][of, None]
        table[of] = scaled
    made["table"] = table.view(made["table"].dtype)
    start = _up(ends)
    tail = grid[stops[-1] :] if len(leaves) else grid[ends:]
    body = np.concatenate([grid[:ends], np.zeros(start - ends, np.uint8), made.view(np.uint8)])
    whole = np.concatenate([body, tail, np.zeros(-(body.size + tail.size) % 32, np.uint8)])
    _relink(whole, above, parent, place, start + which * made.itemsize)
    _describe(whole, start, body.size - (grid.size - tail.size))
    return whole


def _up(n):
    return n + -n % 32


def _gather(grid, starts, size):
    """Rows of bytes from starts."""
    return np.ascontiguousarray(grid[starts[:, None] + np.arange(size)])


def _numbers(rows, width):
    """Numbers of a width in bits, the lowest first, as float32."""
    if width >= 8:
        return rows.view("<u2" if width == 16 else "u1").astype(np.float32)
    places = np.arange(0, 8, width, dtype=np.uint8)
    mask = np.uint8((1 << width) - 1)
    return (rows[:, :, None] >> places & mask).reshape(len(rows), 512).astype(np.float32)


def _relink(whole, above, parent, place, leaves):
    """Lets the entries of lower nodes lead to leaves."""
    layout, size = above.layout, above.lowers.dtype.itemsize
    nodes = above.starts[1] + parent * size
    entries = nodes + layout.lower_table + place * layout.entry
    relative = (leaves - nodes).astype("<i8").reshape(-1, 1).view(np.uint8)
    whole[entries[:, None] + np.arange(8)] = relative


def _describe(whole, leaf_at, moved):
    header = whole[: HEADER.itemsize].view(HEADER)
    header["type"], header["size"] = _FLOAT, whole.size
    # Nobody checks a sum that is all ones.
    header["checksum"] = ~np.uint64(0)
    if int(header["blind_count"][0]):
        header["blind_offset"] += moved
    whole[HEADER.itemsize : HEADER.itemsize + 8].view("<i8")[:] = leaf_at - HEADER.itemsize
