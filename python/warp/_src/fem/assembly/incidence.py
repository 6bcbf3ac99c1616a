"""Incidence - positions of each node in an element-node table, in element order.

A table has a row per element and a column per local node; numbers below 0 are nodes that take no
part. The position of local node i of element e is e n + i.
"""

from __future__ import annotations

import dataclasses

import numpy as np

import warp as wp
from warp._src.fem.types import Ints, IntTable


@wp.kernel(enable_backward=False)
def _fill_keys(table: IntTable, first: int, unused: int, keys: Ints, positions: Ints):
    e, i = wp.tid()
    node = table[first + e, i]
    at = e * table.shape[1] + i
    # Nodes that take no part go to the end of the sorted positions.
    keys[at] = wp.where(node < 0 or node > unused, unused, node)
    positions[at] = at


@wp.kernel(enable_backward=False)
def _mark_begins(keys: Ints, count: int, begins: Ints):
    at = wp.tid()
    key = wp.int32(-1)
    if at > 0:
        key = keys[at - 1]
    last = begins.shape[0] - 1
    if at < count:
        last = wp.min(keys[at], last)
    for node in range(key + 1, last + 1):
        begins[node] = at


@dataclasses.dataclass
class Incidence:
    """Positions of nodes.

    Attributes:
        begins: int32, `node_count + 1`: the positions of node r are `begins[r]` to `begins[r + 1]`.
        positions: int32, sorted by node, then ascending: in element order.
    """

    begins: wp.array
    positions: wp.array


# Numbers that NumPy sorts in less time than kernels take to compile.
_FEW = 1 << 17


def is_small(size: int, device) -> bool:
    """True if NumPy finds the sparsity of so many numbers."""
    return device.is_cpu and size <= _FEW and not device.is_capturing


def sorted_runs(keys, key_count: int, device) -> tuple:
    """Begins of each key from 0, one more, and places in the order of the keys."""
    places = np.argsort(keys, kind="stable")
    begins = np.searchsorted(keys[places], np.arange(key_count + 1))
    return tuple(wp.array(one, dtype=wp.int32, device=device) for one in (begins, places))


def find_incidence(
    table, node_count: int, first: int = 0, count: int | None = None, is_repeated: bool = False
) -> Incidence:
    """Sorts the positions of a range of elements by node.

    Args:
        table: int32 (elements, n), node numbers; unused are negative ones and those from
            `node_count` on.
        node_count: number of nodes.
        first, count: the elements; positions count from the first one.
        is_repeated: small tables are sorted by kernels, too, as those of moving particles.
    """
    device, width = table.device, table.shape[1]
    count = table.shape[0] - first if count is None else count
    size = count * width
    if size >= 2**31 - 1:
        raise ValueError(
            f"expects fewer than 2^31 nodes of elements, but got {count} x {width}; "
            "integrate over subdomains"
        )
    if is_small(table.shape[0] * width, device) and not is_repeated:
        keys = table.numpy()[first : first + count].ravel()
        return Incidence(*sorted_runs(np.where(keys < 0, node_count, keys), node_count, device))
    keys = wp.empty(2 * size, dtype=int, device=device)
    positions = wp.empty(2 * size, dtype=int, device=device)
    begins = wp.empty(node_count + 1, dtype=int, device=device)
    wp.launch(
        _fill_keys, (count, width), [table, first, node_count, keys, positions], device=device
    )
    wp.utils.radix_sort_pairs(keys, positions, size, end_bit=node_count.bit_length())
    wp.launch(_mark_begins, size + 1, [keys, size, begins], device=device)
    return Incidence(begins, positions[:size].contiguous() if device.is_cuda else positions[:size])


@wp.kernel(enable_backward=False)
def mark_used(begins: Ints, mask: Ints):
    """1 for nodes that have positions, else 0."""
    node = wp.tid()
    mask[node] = wp.where(begins[node + 1] > begins[node], 1, 0)
