"""Colours of graphs: no edge joins two nodes of one colour, so each colour's nodes can be changed
at once.

Runs on the host. The number of colours is at most one more than the largest degree.
"""

from __future__ import annotations

import enum
import operator

import warp as wp
from warp import types as dtypes
from warp.extend import checked, errors, notice
from warp.extend.kinds import ARRAY, COUNT, FLAG, NUMBER
from warp.types import int32


class GraphColoringAlgorithm(enum.IntEnum):
    """In which order nodes get the smallest colour that no neighbour has.

    MCS: next is a node with most coloured neighbours (maximum cardinality search), unless `GREEDY`
        needs fewer colours.
    GREEDY: by ascending degree of what is left, from the end: nodes of few neighbours come last.
    """

    MCS = 0
    GREEDY = 1


@checked(edges=ARRAY, node_colors=ARRAY)
def graph_coloring_assign(edges, node_colors, algorithm=GraphColoringAlgorithm.MCS) -> int:
    """Colours the nodes of a graph.

    Args:
        edges: (m, 2) int32 on the CPU: two nodes of each edge; twice the same edge does no harm.
        node_colors: (n,) int32 on the CPU: receives the colours, n is the number of nodes.
        algorithm: a `GraphColoringAlgorithm`.

    Returns:
        The number of colours.

    Raises:
        RuntimeError: an array has another type, shape or device, there is no node, or an edge
            names none.
    """
    _check(edges, node_colors)
    count = node_colors.size
    if count == 0:
        raise errors.WarpError("cannot color an empty graph")
    try:
        algorithm = GraphColoringAlgorithm(algorithm)
    except ValueError:
        raise errors.WarpError(f"there is no algorithm {algorithm!r} for colors") from None
    near = _neighbours(edges, count, "Graph coloring failed")
    used, colors = _colored(near, _by_degree(near))
    if algorithm == GraphColoringAlgorithm.MCS:
        searched = _colored(near, _by_cardinality(near))
        if searched[0] <= used:
            used, colors = searched
    node_colors.assign(colors)
    return used


def _colored(near, order):
    """The number of colours, and those of nodes that in turn get the first which is free."""
    colors = [-1] * len(near)
    used = 0
    for node in order:
        taken = {colors[other] for other in near[node]}
        color = next(color for color in range(used + 1) if color not in taken)
        colors[node] = color
        used = max(used, color + 1)
    return used, colors


@checked(
    edges=ARRAY,
    node_colors=ARRAY,
    color_count=COUNT,
    target_max_min_ratio=NUMBER,
    max_iterations=COUNT,
)
def graph_coloring_balance(
    edges, node_colors, color_count, target_max_min_ratio, *, max_iterations=None
) -> float:
    """Moves nodes into the smallest group, one by one, while that brings groups closer.

    Args:
        edges: (m, 2) int32 on the CPU.
        node_colors: (n,) int32 on the CPU, in [0, color_count); changed in place.
        color_count: number of colours.
        target_max_min_ratio: largest by smallest group at which it stops.
        max_iterations: most moves, by default n; a warning says if it stopped there.

    Returns:
        The ratio reached, infinite with an empty group.

    Raises:
        TypeError, ValueError: `max_iterations` is no int in [0, 2^31).
        RuntimeError: an array has another type, shape or device, or holds what is out of range.
    """
    _check(edges, node_colors)
    colors = node_colors.numpy().tolist()
    limit = _iterations(max_iterations, len(colors))
    near = _neighbours(edges, len(colors), "Graph coloring balance failed")
    groups = [[] for _ in range(color_count)]
    for node, color in enumerate(colors):
        if not 0 <= color < color_count:
            raise errors.WarpError(
                f"Graph coloring balance failed: Node {node} has color {color}, but valid colors "
                f"are in the range [0, {color_count})."
            )
        groups[color].append(node)
    if not groups:
        return 1.0
    ratio, stopped = _balance(near, colors, groups, target_max_min_ratio, limit)
    node_colors.assign(colors)
    if stopped:
        notice(
            "Warp UserWarning: Graph coloring stopped because it reached the "
            f"{limit}-iteration limit (achieved ratio {ratio:g}, target {target_max_min_ratio:g})."
        )
    return ratio


@checked(node_colors=ARRAY, color_count=COUNT, return_wp_array=FLAG)
def graph_coloring_get_groups(node_colors, color_count, return_wp_array=True, device="cpu"):
    """The nodes of each colour, in ascending order.

    Args:
        node_colors: (n,) int32 on the CPU.
        color_count: number of colours.
        return_wp_array: False gives NumPy arrays.
        device: where the arrays are made.

    Raises:
        RuntimeError: `node_colors` has another type, shape or device, or `color_count` is negative.
    """
    import numpy

    if color_count < 0:
        raise errors.WarpError(f"expects `color_count` of at least 0, but got {color_count}")
    _check_int32("node_colors", node_colors, 1)
    colors = node_colors.numpy()
    groups = tuple(numpy.flatnonzero(colors == i).astype(numpy.int32) for i in range(color_count))
    if not return_wp_array:
        return groups
    return tuple(wp.array(group, dtype=int32, device=device) for group in groups)


def _check(edges, node_colors) -> None:
    _check_int32("edges", edges, 2)
    if edges.shape[1] != 2:
        raise errors.WarpError(f"'edges' expects shape (edge_count, 2), but got {edges.shape}")
    _check_int32("node_colors", node_colors, 1)


def _check_int32(name, given, ndim) -> None:
    if not given.device.is_cpu:
        raise errors.WarpError(f"'{name}' expects an array on 'cpu', but got '{given.device}'")
    if given.dtype is not int32:
        found = dtypes.type_repr(given.dtype)
        raise errors.WarpError(f"'{name}' expects elements of type 'int32', but got '{found}'")
    if given.ndim != ndim:
        raise errors.WarpError(f"'{name}' expects {ndim} dimensions, but got {given.ndim}")


def _iterations(given, count) -> int:
    if given is None:
        return count
    try:
        value = operator.index(given) if not isinstance(given, bool) else None
    except TypeError:
        value = None
    if value is None:
        raise TypeError(f"`max_iterations` expects an int or None, but got {given!r}")
    if not 0 <= value < 1 << 31:
        raise ValueError(f"`max_iterations` expects 0 to 2147483647, but got {value}")
    return value


def _neighbours(edges, count, what) -> list[set[int]]:
    """The neighbours of each node."""
    near = [set() for _ in range(count)]
    for number, (a, b) in enumerate(edges.numpy().tolist()):
        if not (0 <= a < count and 0 <= b < count):
            raise errors.WarpError(
                f"{what}: Graph edge {number} has endpoints ({a}, {b}), but valid node indices "
                f"are in the range [0, {count})."
            )
        if a != b:
            near[a].add(b)
            near[b].add(a)
    return near


def _by_cardinality(near) -> list[int]:
    """Nodes so that each has, of those left, most neighbours before it."""
    weights = [0] * len(near)
    # Nodes by weight; what has moved on since is skipped.
    buckets = [list(range(len(near) - 1, -1, -1))]
    order, top = [], 0
    while len(order) < len(near):
        while not buckets[top]:
            top -= 1
        node = buckets[top].pop()
        if weights[node] != top:
            continue
        order.append(node)
        weights[node] = -1
        for other in near[node]:
            weight = weights[other] + 1
            if weight == 0:
                continue
            weights[other] = weight
            if weight == len(buckets):
                buckets.append([])
            buckets[weight].append(other)
            top = max(top, weight)
    return order


def _by_degree(near) -> list[int]:
    """Nodes in the reverse of: always take away one that has fewest neighbours left."""
    degrees = [len(others) for others in near]
    buckets = [[] for _ in range(max(degrees, default=0) + 1)]
    for node in range(len(near) - 1, -1, -1):
        buckets[degrees[node]].append(node)
    order, low = [], 0
    while len(order) < len(near):
        while not buckets[low]:
            low += 1
        node = buckets[low].pop()
        if degrees[node] != low:
            continue
        order.append(node)
        degrees[node] = -1
        for other in near[node]:
            if degrees[other] > 0:
                degrees[other] -= 1
                buckets[degrees[other]].append(other)
                low = min(low, degrees[other])
    return order[::-1]


def _balance(near, colors, groups, target, limit) -> tuple[float, bool]:
    """Changes colours and groups; the ratio, and whether moves were left at the limit."""
    reached, last = None, None
    for step in range(limit + 1):
        sizes = [len(group) for group in groups]
        large, small = sizes.index(max(sizes)), sizes.index(min(sizes))
        ratio = sizes[large] / sizes[small] if sizes[small] else float("inf")
        if reached is not None and ratio > reached:
            # The last move made it worse.
            colors[last[0]] = last[1]
            return reached, False
        if sizes[large] - sizes[small] <= 2 or ratio <= target:
            return ratio, False
        rest = (color for color in range(len(groups)) if color not in (large, small))
        move = next(
            (
                (color, place)
                for color in (large, *rest)
                for place, node in enumerate(groups[color])
                if all(colors[other] != small for other in near[node])
            ),
            None,
        )
        if move is None or step == limit:
            return ratio, move is not None
        color, place = move
        source = groups[color]
        node, source[place] = source[place], source[-1]
        source.pop()
        groups[small].append(node)
        colors[node] = small
        reached, last = ratio, (node, color)
    raise AssertionError("a return is in the last step")
