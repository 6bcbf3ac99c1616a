"""Cells anywhere whose corners have numbers, and the surface through them.

Corners that cells share are found by sorting their numbers; each is a node then, and an edge has
the number of the node that it starts from. From there on all is as in `marching_cubes`.
"""

from __future__ import annotations

import functools

import warp as wp
from warp._src.geometry.surfaces import cases
from warp._src.geometry.surfaces.fields import plain, scan
from warp._src.geometry.surfaces.marching_cubes import tables

_MOST_CELLS = (2**31 - 1) // 24


@wp.kernel(enable_backward=False, module="unique")
def _number_corners(
    cells: wp.array(dtype=wp.vec3i),
    low: wp.vec3i,
    row: wp.int64,
    layer: wp.int64,
    codes: wp.array(dtype=wp.int64),
    sources: wp.array(dtype=int),
):
    i, corner = wp.tid()
    cell = cells[i]
    # Corners go around the lower face, then around the upper one.
    x = wp.int64(cell[0]) - wp.int64(low[0]) + wp.int64(((corner + 1) >> 1) & 1)
    y = wp.int64(cell[1]) - wp.int64(low[1]) + wp.int64((corner >> 1) & 1)
    z = wp.int64(cell[2]) - wp.int64(low[2]) + wp.int64(corner >> 2)
    codes[8 * i + corner] = x * layer + y * row + z
    sources[8 * i + corner] = 8 * i + corner


@wp.kernel(enable_backward=False, module="unique")
def _mark_first(codes: wp.array(dtype=wp.int64), counts: wp.array(dtype=int)):
    i = wp.tid()
    first = int(1)
    if i > 0:
        first = int(codes[i] != codes[i - 1])
    counts[i] = first


@wp.kernel(enable_backward=False, module="unique")
def _list_nodes(
    codes: wp.array(dtype=wp.int64),
    sources: wp.array(dtype=int),
    ends: wp.array(dtype=int),
    row: wp.int64,
    layer: wp.int64,
    corners: wp.array(dtype=int),
    nodes: wp.array(dtype=wp.vec3i),
    first_sources: wp.array(dtype=int),
):
    i = wp.tid()
    code = codes[i]
    node = ends[i] - 1
    corners[sources[i]] = node
    first = bool(True)
    if i > 0:
        first = codes[i - 1] != code
    if first:
        rest = code % layer
        nodes[node] = wp.vec3i(int(code // layer), int(rest // row), int(rest % row))
        first_sources[node] = sources[i]


@wp.kernel(enable_backward=False, module="unique")
def _place_nodes(
    nodes: wp.array(dtype=wp.vec3i),
    lower: wp.vec3,
    spacing: wp.vec3,
    places: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    node = nodes[i]
    places[i] = lower + wp.vec3(
        float(node[0]) * spacing[0], float(node[1]) * spacing[1], float(node[2]) * spacing[2]
    )


@wp.kernel(module="unique")
def _take_values(
    sources: wp.array(dtype=int), given: wp.array(dtype=float), values: wp.array(dtype=float)
):
    i = wp.tid()
    values[i] = given[sources[i]]


@wp.kernel(enable_backward=False, module="unique")
def _mark_edges(
    corners: wp.array2d(dtype=int),
    values: wp.array(dtype=float),
    threshold: float,
    edges: wp.array(dtype=wp.vec3i),
    ends: wp.array(dtype=int),
):
    i, n = wp.tid()
    edge = edges[n]
    first = corners[i, edge[0]]
    second = corners[i, edge[1]]
    # Cells at an edge write the same.
    if (values[first] < threshold) != (values[second] < threshold):
        ends[3 * first + edge[2]] = second


@wp.kernel(enable_backward=False, module="unique")
def _count_edges(ends: wp.array(dtype=int), counts: wp.array(dtype=int)):
    i = wp.tid()
    counts[i] = int(ends[i] >= 0)


@wp.kernel(enable_backward=False, module="unique")
def _list_edges(
    ends: wp.array(dtype=int), places: wp.array(dtype=int), edges: wp.array(dtype=wp.vec2i)
):
    i = wp.tid()
    if ends[i] >= 0:
        edges[places[i] - 1] = wp.vec2i(i, ends[i])


@wp.kernel(module="unique")
def _place_vertices(
    nodes: wp.array(dtype=wp.vec3i),
    values: wp.array(dtype=float),
    threshold: float,
    lower: wp.vec3,
    spacing: wp.vec3,
    edges: wp.array(dtype=wp.vec2i),
    vertices: wp.array(dtype=wp.vec3),
):
    vertex = wp.tid()
    start = edges[vertex][0] // 3
    axis = edges[vertex][0] % 3
    first = wp.float64(values[start])
    second = wp.float64(values[edges[vertex][1]])
    # In 64 bits no difference of two floats overflows or loses digits.
    t = float((wp.float64(threshold) - first) / (second - first))
    if not (t >= 0.0 and t <= 1.0):
        t = 0.5
    # Off the ends, where vertices of several edges would be one.
    t = wp.clamp(t, 5.9604645e-08, 0.99999994)
    node = nodes[start]
    vertices[vertex] = lower + wp.vec3(
        (float(node[0]) + wp.where(axis == 0, t, 0.0)) * spacing[0],
        (float(node[1]) + wp.where(axis == 1, t, 0.0)) * spacing[1],
        (float(node[2]) + wp.where(axis == 2, t, 0.0)) * spacing[2],
    )


@wp.func
def _case_of(
    corners: wp.array2d(dtype=int), values: wp.array(dtype=float), threshold: float, i: int
):
    case = int(0)
    for corner in range(8):
        case += int(values[corners[i, corner]] < threshold) << corner
    return case


@wp.kernel(enable_backward=False, module="unique")
def _count_triangles(
    corners: wp.array2d(dtype=int),
    values: wp.array(dtype=float),
    threshold: float,
    starts: wp.array(dtype=int),
    counts: wp.array(dtype=int),
):
    i = wp.tid()
    case = _case_of(corners, values, threshold, i)
    counts[i] = starts[case + 1] - starts[case]


@wp.kernel(enable_backward=False, module="unique")
def _write_triangles(
    corners: wp.array2d(dtype=int),
    values: wp.array(dtype=float),
    threshold: float,
    starts: wp.array(dtype=int),
    triangles: wp.array(dtype=wp.vec3i),
    edges: wp.array(dtype=wp.vec3i),
    ends: wp.array(dtype=int),
    places: wp.array(dtype=int),
    indices: wp.array(dtype=int),
):
    i = wp.tid()
    case = _case_of(corners, values, threshold, i)
    count = starts[case + 1] - starts[case]
    first = ends[i] - count
    for n in range(count):
        triangle = triangles[starts[case] + n]
        for corner in range(3):
            edge = edges[triangle[corner]]
            place = 3 * corners[i, edge[0]] + edge[2]
            indices[3 * (first + n) + corner] = places[place] - 1


@functools.lru_cache(maxsize=16)
def _edge_table(device):
    """Per edge of a cell its two corners and its axis."""
    axes = cases.edge_places()[:, 3]
    table = [(a, b, axis) for (a, b), axis in zip(cases.EDGES, axes, strict=True)]
    return wp.array(table, dtype=wp.vec3i, device=device)


class NumberedCells:
    """Cells whose corners have numbers.

    Attributes:
        corners: numbers of nodes, of shape (cells, 8).
        nodes: what they are, as indices from `low` on.
        sources: for each the first place in `corners` where it is.
    """

    def __init__(self, cells, low, high):
        self.device, count = cells.device, len(cells)
        if count > _MOST_CELLS:
            raise ValueError(f"expects at most {_MOST_CELLS} cells, but got {count}")
        # One number for a corner; the sorting goes by 64 bits.
        extents = [int(b) - int(a) + 2 for a, b in zip(low, high, strict=True)]
        row, layer = extents[2], extents[1] * extents[2]
        if extents[0] * layer >= 2**63:
            raise ValueError(f"cells are within {extents} nodes, more than 64 bits can number")
        self.low = low
        codes = wp.empty(16 * count, dtype=wp.int64, device=self.device)
        sources = wp.empty(16 * count, dtype=int, device=self.device)
        strides = [wp.int64(row), wp.int64(layer)]
        self._launch(_number_corners, (count, 8), cells, wp.vec3i(*low), *strides, codes, sources)
        wp.utils.radix_sort_pairs(codes, sources, 8 * count)
        ends = wp.empty(8 * count, dtype=int, device=self.device)
        self._launch(_mark_first, 8 * count, codes, ends)
        total = scan(ends)
        self.nodes = wp.empty(total, dtype=wp.vec3i, device=self.device)
        self.sources = wp.empty(total, dtype=int, device=self.device)
        flat = wp.empty(8 * count, dtype=int, device=self.device)
        given = [codes, sources, ends, *strides, flat, self.nodes, self.sources]
        self._launch(_list_nodes, 8 * count, *given)
        self.corners = flat.reshape((count, 8))

    def _launch(self, kernel, dim, *inputs):
        wp.launch(kernel, dim, inputs=inputs, device=self.device)

    def places(self, lower, spacing):
        """Positions of the nodes."""
        places = wp.empty(len(self.nodes), dtype=wp.vec3, device=self.device)
        self._launch(_place_nodes, len(places), self.nodes, lower, spacing, places)
        return places

    def first_values(self, given):
        """The values of the nodes, of those of all corners of cells."""
        values = wp.empty(
            len(self.nodes), dtype=float, device=self.device, requires_grad=given.requires_grad
        )
        self._launch(_take_values, len(values), self.sources, given, values)
        return values

    def surface(self, values, threshold, lower, spacing):
        """Vertices and indices; vertices follow the values of nodes."""
        slots, known = 3 * len(self.nodes), [self.corners, plain(values), threshold]
        edge_table = _edge_table(self.device)
        upper = wp.full(slots, -1, dtype=int, device=self.device)
        self._launch(_mark_edges, (len(self.corners), 12), *known, edge_table, upper)
        places = wp.empty(slots, dtype=int, device=self.device)
        self._launch(_count_edges, slots, upper, places)
        count = scan(places)
        edges = wp.empty(count, dtype=wp.vec2i, device=self.device)
        self._launch(_list_edges, slots, upper, places, edges)
        wanted = values.requires_grad
        vertices = wp.empty(count, dtype=wp.vec3, device=self.device, requires_grad=wanted)
        given = [self.nodes, values, threshold, lower, spacing, edges, vertices]
        self._launch(_place_vertices, count, *given)
        starts, triangles, _ = tables(self.device)
        ends = wp.empty(len(self.corners), dtype=int, device=self.device)
        self._launch(_count_triangles, len(ends), *known, starts, ends)
        indices = wp.empty(3 * scan(ends), dtype=int, device=self.device)
        given = [starts, triangles, edge_table, ends, places, indices]
        self._launch(_write_triangles, len(ends), *known, *given)
        return vertices, indices
