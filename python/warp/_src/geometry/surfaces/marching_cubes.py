"""`IsoSurfaceMarchingCubes`: the surface where a field on a grid has one value, as triangles.

Edges of the grid that the surface crosses are counted, then each gets its vertex; cells count and
write their triangles, which name the vertices of their edges. So each vertex is there once. Only
positions depend on the field continuously: their kernel is the one that derivatives see.
"""

from __future__ import annotations

import functools

import warp as wp
from warp._src.argument_kinds import ARRAY, INTEGER, POINT
from warp._src.arguments import checked
from warp._src.geometry.surfaces import cases
from warp._src.geometry.surfaces.fields import (
    IsoSurfaceBase,
    Sampled,
    case_of,
    count_of_cases,
    crosses,
    crossing,
    scan,
)


@wp.kernel(enable_backward=False, module="unique")
def _count_vertices(
    field: wp.array3d(dtype=float), threshold: float, counts: wp.array4d(dtype=int)
):
    i, j, k, axis = wp.tid()
    counts[i, j, k, axis] = int(crosses(field, threshold, i, j, k, axis))


@wp.kernel(enable_backward=False, module="unique")
def _list_edges(
    field: wp.array3d(dtype=float),
    threshold: float,
    places: wp.array4d(dtype=int),
    edges: wp.array(dtype=wp.vec4i),
):
    i, j, k, axis = wp.tid()
    if crosses(field, threshold, i, j, k, axis):
        edges[places[i, j, k, axis] - 1] = wp.vec4i(i, j, k, axis)


@wp.kernel(module="unique")
def _place_vertices(
    field: wp.array3d(dtype=float),
    threshold: float,
    lower: wp.vec3,
    spacing: wp.vec3,
    edges: wp.array(dtype=wp.vec4i),
    vertices: wp.array(dtype=wp.vec3),
):
    vertex = wp.tid()
    edge = edges[vertex]
    axis = edge[3]
    t = crossing(field, threshold, edge[0], edge[1], edge[2], axis)
    # Off the ends, where vertices of several edges would be one.
    t = wp.clamp(t, 5.9604645e-08, 0.99999994)
    vertices[vertex] = lower + wp.vec3(
        (float(edge[0]) + wp.where(axis == 0, t, 0.0)) * spacing[0],
        (float(edge[1]) + wp.where(axis == 1, t, 0.0)) * spacing[1],
        (float(edge[2]) + wp.where(axis == 2, t, 0.0)) * spacing[2],
    )


@wp.kernel(enable_backward=False, module="unique")
def _write_triangles(
    field: wp.array3d(dtype=float),
    threshold: float,
    starts: wp.array(dtype=int),
    triangles: wp.array(dtype=wp.vec3i),
    edge_places: wp.array(dtype=wp.vec4i),
    ends: wp.array3d(dtype=int),
    vertices: wp.array4d(dtype=int),
    indices: wp.array(dtype=int),
):
    i, j, k = wp.tid()
    case = case_of(field, threshold, i, j, k)
    count = starts[case + 1] - starts[case]
    first = ends[i, j, k] - count
    for n in range(count):
        triangle = triangles[starts[case] + n]
        for corner in range(3):
            place = edge_places[triangle[corner]]
            vertex = vertices[i + place[0], j + place[1], k + place[2], place[3]] - 1
            indices[3 * (first + n) + corner] = vertex


@functools.lru_cache(maxsize=16)
def tables(device):
    """The tables of cases on a device."""
    starts, triangles = cases.tables()
    return (
        wp.array(starts, dtype=int, device=device),
        wp.array(triangles, dtype=wp.vec3i, device=device),
        wp.array(cases.edge_places(), dtype=wp.vec4i, device=device),
    )


class _Table:
    """One of the public tables, made when it is asked for."""

    def __init__(self, number):
        self.number = number

    def __get__(self, one, kind):
        return cases.public_tables()[self.number]


class IsoSurfaceMarchingCubes(IsoSurfaceBase):
    """Triangles of surfaces in fields of one shape.

    Args:
        nx, ny, nz: nodes of the grid.
        lower, upper: where its first and its last node are; by default at their indices.

    Attributes:
        verts: vertices, an array of vec3, of the last `surface`.
        indices: three vertices per triangle. Seen from larger values they go counter-clockwise.
        CUBE_CORNER_OFFSETS: the eight corners of a cell as offsets.
        EDGE_TO_CORNERS: the two corners of its twelve edges.
        CASE_TO_TRI_RANGE: where in `TRI_LOCAL_INDICES` the triangles of each case start, 257
            numbers; bit i of a case is set if the value at corner i is not less than the threshold.
        TRI_LOCAL_INDICES: three edges for each triangle.

    Example:
        >>> import numpy as np, warp as wp
        >>> x, y, z = np.indices((9, 9, 9)) - 4.0
        >>> field = wp.array(np.sqrt(x * x + y * y + z * z), dtype=float, device="cpu")
        >>> surface = wp.MarchingCubes(9, 9, 9)
        >>> surface.surface(field, 3.0)
        >>> len(surface.indices) // 3 == 2 * len(surface.verts) - 4
        True
    """

    CUBE_CORNER_OFFSETS = cases.CORNERS
    EDGE_TO_CORNERS = cases.EDGES
    CASE_TO_TRI_RANGE = _Table(0)
    TRI_LOCAL_INDICES = _Table(1)

    @checked(
        nx=INTEGER,
        ny=INTEGER,
        nz=INTEGER,
        lower=POINT,
        upper=POINT,
        domain_bounds_lower_corner=POINT,
        domain_bounds_upper_corner=POINT,
    )
    def __init__(
        self,
        nx,
        ny,
        nz,
        lower=None,
        upper=None,
        *,
        domain_bounds_lower_corner=None,
        domain_bounds_upper_corner=None,
    ):
        former = {"lower": domain_bounds_lower_corner, "upper": domain_bounds_upper_corner}
        given = {"lower": lower, "upper": upper}
        for name, corner in former.items():
            if corner is not None and given[name] is not None:
                both = f"`{name}` and `domain_bounds_{name}_corner`"
                raise TypeError(f"Cannot specify both {both}, which mean the same")
            given[name] = corner if given[name] is None else given[name]
        super().__init__(nx, ny, nz, **given)

    @classmethod
    @checked(field=ARRAY, lower=POINT, upper=POINT)
    def extract(cls, field, threshold=0.0, *, lower=None, upper=None):
        """Vertices and indices of the surface where a field crosses a value.

        A node is inside if its value is less than the threshold. Positions have derivatives by
        the field, on a tape, if it has gradients.

        Args:
            field: float32 array of three dimensions, two nodes or more along each.
            threshold: the value.
            lower, upper: where the first and the last node are; by default at their indices.

        Raises:
            ValueError: the field has other dimensions.
            TypeError: it is not of float32.
        """
        sampled = Sampled(field, threshold, lower, upper)
        places = wp.empty((*sampled.shape, 3), dtype=int, device=sampled.device)
        sampled.launch(_count_vertices, places.shape, places)
        count = scan(places)
        edges = wp.empty(count, dtype=wp.vec4i, device=sampled.device)
        sampled.launch(_list_edges, places.shape, places, edges)
        return sampled.place(_place_vertices, count, edges), cls._faces(sampled, places)

    @staticmethod
    def _faces(sampled, places):
        starts, triangles, edge_places = tables(sampled.device)
        cells = [extent - 1 for extent in sampled.shape]
        ends = wp.empty(cells, dtype=int, device=sampled.device)
        sampled.launch(count_of_cases, cells, starts, ends)
        indices = wp.empty(3 * scan(ends), dtype=int, device=sampled.device)
        given = [starts, triangles, edge_places, ends, places]
        sampled.launch(_write_triangles, cells, *given, indices)
        return indices

    @staticmethod
    @checked(field=ARRAY, domain_bounds_lower_corner=POINT, domain_bounds_upper_corner=POINT)
    def extract_surface_marching_cubes(
        field, threshold=0.0, domain_bounds_lower_corner=None, domain_bounds_upper_corner=None
    ):
        """The former name of `extract`."""
        return IsoSurfaceMarchingCubes.extract(
            field,
            threshold,
            lower=domain_bounds_lower_corner,
            upper=domain_bounds_upper_corner,
        )
