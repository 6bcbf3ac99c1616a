"""Buffers of grids made of tiles of 8^3 voxels, or of single voxels.

Tiles are sorted by the nodes that they lie in, so that every level of nodes is a run; the masks and
tables of a level follow from the places of its children.
"""

from __future__ import annotations

import numpy as np

from warp._src import errors
from warp._src.geometry.volumes.layout import (
    HEADER,
    INDEX,
    MAGICS,
    ON_INDEX,
    TREE,
    VERSION,
    keys_of,
    layout_of,
)

_START = HEADER.itemsize + TREE.itemsize
_INDEX_CLASS = 8


class Topology:
    """Sorted leaves of a grid and the nodes over them.

    Attributes:
        leaves: number of each leaf in units of 8 voxels, without repetition.
        order: which leaf each of the given tiles is.
        roots, uppers, lowers: per leaf, its ancestors' numbers.
        upper_at, lower_at: per lower node and per leaf, its place in its parent.
    """

    def __init__(self, tiles):
        tiles = np.asarray(tiles, dtype=np.int64).reshape(-1, 3)
        if tiles.size and (tiles.min() < -(2**28) or tiles.max() >= 2**28):
            raise errors.WarpError("a voxel's coordinates have 32 bits")
        over = (tiles >> 9) + 2**19
        packed = over[:, 0] << 40 | over[:, 1] << 20 | over[:, 2]
        root_keys, root = np.unique(packed, return_inverse=True)
        inner = _cell(tiles >> 4, 5).astype(np.int64) << 12 | _cell(
            tiles, 4
        )  # place among uppers' and lowers' children
        keys, first, self.order = np.unique(
            root << 27 | inner, return_index=True, return_inverse=True
        )
        self.leaves = tiles[first]
        self.roots = np.stack(
            [(root_keys >> shift & 0xFFFFF) - 2**19 for shift in (40, 20, 0)], axis=-1
        )
        lower_keys, self.lower_of_leaf = np.unique(keys >> 12, return_inverse=True)
        self.upper_of_lower = lower_keys >> 15
        self.lower_at, self.upper_at = keys & 0xFFF, lower_keys & 0x7FFF
        self.counts = len(self.leaves), len(lower_keys), len(self.roots)
        self.lower_origins = self._origins(self.lower_of_leaf, self.counts[1], 4)

    def _origins(self, parents, count, bits):
        origins = np.zeros((count, 3), dtype=np.int64)
        origins[parents] = self.leaves >> bits
        return origins


def _cell(coordinates, bits):
    """The place of a child in a node with 2^bits along each axis."""
    part = coordinates & ((1 << bits) - 1)
    return part[:, 0] << 2 * bits | part[:, 1] << bits | part[:, 2]


def grid_of_tiles(tiles, number, background, transform, name=b""):
    """A buffer of whole tiles with the background as their values, and its `Topology`.

    Args:
        tiles: coordinates of tiles, in units of 8 voxels; may repeat.
        number: type of the values (layout.TYPES).
        background: bytes of a value.
        transform: matrix and shift from index space to the world.
    """
    topology = Topology(tiles)
    masks = np.full((topology.counts[0], 64), 255, dtype=np.uint8)
    buffer = _fill(topology, number, background, transform, masks, name)
    return buffer, topology


def grid_of_voxels(voxels, transform, name=b""):
    """A buffer in which each of the given voxels has a number."""
    voxels = np.asarray(voxels, dtype=np.int64).reshape(-1, 3)
    topology = Topology(voxels >> 3)
    bits = np.zeros((topology.counts[0], 512), dtype=bool)
    bits[topology.order, _cell(voxels, 3)] = True
    masks = np.packbits(bits, axis=1, bitorder="little")
    return _fill(topology, ON_INDEX, bytes(8), transform, masks, name), topology


def _fill(topology, number, background, transform, masks, name):
    layout = layout_of(number)
    leaves, lowers, uppers = topology.counts
    offsets = np.cumsum(
        [_START, layout.root + uppers * layout.tile, uppers * layout.upper, lowers * layout.lower]
    )
    root_at, upper_at, lower_at, leaf_at = (int(offset) for offset in offsets)
    buffer = np.zeros(leaf_at + leaves * layout.leaf, dtype=np.uint8)
    active = np.unpackbits(masks).sum() if number == ON_INDEX else leaves * 512
    header = buffer[: HEADER.itemsize].view(HEADER)[0]
    _fill_header(header, buffer.size, number, transform, name)
    tree = buffer[HEADER.itemsize : _START].view(TREE)[0]
    start = HEADER.itemsize
    tree["offsets"] = [leaf_at - start, lower_at - start, upper_at - start, root_at - start]
    tree["counts"], tree["voxels"] = topology.counts, active
    _fill_root(buffer, layout, topology, background, root_at, upper_at)
    value = np.frombuffer(background, dtype=np.dtype((np.void, len(background))))
    nodes = buffer[upper_at:lower_at].view(layout.upper_node)
    _fill_inner(nodes, value, topology.upper_of_lower, topology.upper_at)
    children = lower_at + np.arange(lowers) * layout.lower
    _link(nodes, topology.upper_of_lower, topology.upper_at, children, upper_at)
    nodes["box"] = _boxes(topology.roots << 12, 4096)
    nodes = buffer[lower_at:leaf_at].view(layout.lower_node)
    _fill_inner(nodes, value, topology.lower_of_leaf, topology.lower_at)
    children = leaf_at + np.arange(leaves) * layout.leaf
    _link(nodes, topology.lower_of_leaf, topology.lower_at, children, lower_at)
    nodes["box"] = _boxes(topology.lower_origins << 7, 128)
    _fill_leaves(buffer[leaf_at:].view(layout.leaf_node), number, topology, masks, value)
    _fill_boxes(buffer, header, topology, root_at)
    return buffer


def _fill_header(header, size, number, transform, name):
    matrix, shift = (np.asarray(part, dtype=np.float64) for part in transform)
    inverse = np.linalg.inv(matrix)
    header["magic"], header["version"], header["checksum"] = MAGICS[0], VERSION, 2**64 - 1
    header["count"], header["size"], header["name"] = 1, size, name
    header["flags"] = 1 << 1 | 1 << 5
    header["single"], header["single_inverse"] = matrix.ravel(), inverse.ravel()
    header["single_shift"], header["single_taper"] = shift, 1.0
    header["matrix"], header["inverse"], header["shift"] = matrix, inverse, shift
    # As NanoVDB has it: where a step of one voxel along all axes leads.
    header["taper"], header["voxel_size"] = 1.0, matrix @ np.ones(3)
    header["type"] = number
    header["grid_class"] = _INDEX_CLASS if number in (INDEX, ON_INDEX) else 0


def _fill_root(buffer, layout, topology, background, root_at, upper_at):
    uppers = topology.counts[2]
    buffer[root_at + 24 : root_at + 28].view("<u4")[0] = uppers
    start = root_at + layout.background
    buffer[start : start + layout.value] = np.frombuffer(background, dtype=np.uint8)
    tiles = buffer[root_at + layout.root : upper_at].view(layout.root_tile)
    tiles["key"] = keys_of(topology.roots)
    tiles["child"] = upper_at - root_at + np.arange(uppers) * layout.upper


def _fill_inner(nodes, value, parents, places):
    """The masks of inner nodes, and the background where they have no child."""
    bits = np.zeros((len(nodes), nodes["table"].shape[1]), dtype=bool)
    bits[parents, places] = True
    nodes["children"] = np.packbits(bits, axis=1, bitorder="little")
    table = nodes["table"]
    raw = np.zeros(table.dtype.itemsize, dtype=np.uint8)
    raw[: value.dtype.itemsize] = value.view(np.uint8)
    if raw.any():
        table[:] = raw.view(table.dtype)[0]


def _link(nodes, parents, places, children, first):
    """Offsets of children, each from its parent."""
    entries = np.zeros((len(children), nodes["table"].dtype.itemsize), dtype=np.uint8)
    own = first + parents * nodes.dtype.itemsize
    entries[:, :8] = np.ascontiguousarray(children - own).view(np.uint8).reshape(-1, 8)
    nodes["table"][parents, places] = entries.view(nodes["table"].dtype)[:, 0]


def _fill_leaves(nodes, number, topology, masks, value):
    nodes["origin"], nodes["values"] = topology.leaves << 3, masks
    nodes["extent"], nodes["flags"] = 7, 1 << 1
    if number == INDEX:
        nodes["first"] = 1 + 512 * np.arange(len(nodes), dtype=np.uint64)
    elif number == ON_INDEX:
        words = np.bitwise_count(np.ascontiguousarray(masks).view("<u8")).astype(np.uint64)
        totals = words.sum(axis=1, dtype=np.uint64)
        nodes["first"] = np.uint64(1) + np.cumsum(totals, dtype=np.uint64) - totals
        # Seven numbers of nine bits: voxels before the words but the first.
        before = np.cumsum(words, axis=1, dtype=np.uint64)[:, :7]
        nodes["sums"] = (before << (9 * np.arange(7, dtype=np.uint64))).sum(axis=1, dtype=np.uint64)
    elif value.view(np.uint8).any():
        nodes["table"][:] = value[0]


def _boxes(low, edge):
    return np.concatenate([low, low + edge - 1], axis=1)


def _fill_boxes(buffer, header, topology, root_at):
    box = buffer[root_at : root_at + 24].view("<i4")
    if len(topology.leaves) == 0:
        box[:3], box[3:] = 2**31 - 1, -(2**31)
        return
    low = topology.leaves.min(axis=0) << 3
    high = (topology.leaves.max(axis=0) << 3) + 7
    box[:3], box[3:] = low, high
    corners = np.stack(np.meshgrid(*zip(low, high + 1, strict=True)), axis=-1).reshape(-1, 3)
    world = corners @ header["matrix"].T + header["shift"]
    header["world_box"] = np.concatenate([world.min(axis=0), world.max(axis=0)])
