"""`IsoSurfaceNets`: the surface where a field has one value, with a vertex per cell it crosses.

A cell has a vertex for each sheet of the surface in it, a loop through edges of the cell (`cases`);
the vertex is the mean of the places where the loop crosses them. Each edge of the grid that the
surface crosses has a face, whose corners are in the four cells around it: those of the sheets
through that edge (Gibson, "Constrained elastic surface nets", MICCAI 1998; with sheets apart as in
Nielson, "Dual marching cubes", Visualization 2004).
"""

from __future__ import annotations

import functools

import warp as wp
from warp._src.argument_kinds import ARRAY, INTEGER, POINT, TEXT
from warp._src.arguments import checked
from warp._src.geometry.surfaces import cases
from warp._src.geometry.surfaces.fields import (
    IsoSurfaceBase,
    Sampled,
    case_of,
    count_of_cases,
    crosses,
    crossing,
    is_in,
    plain,
    scan,
)

_TOPOLOGIES = ("triangle", "quad")


@wp.kernel(enable_backward=False, module="unique")
def _list_sheets(
    field: wp.array3d(dtype=float),
    threshold: float,
    starts: wp.array(dtype=int),
    ends: wp.array3d(dtype=int),
    sheets: wp.array(dtype=wp.vec4i),
):
    i, j, k = wp.tid()
    case = case_of(field, threshold, i, j, k)
    count = starts[case + 1] - starts[case]
    for n in range(count):
        sheets[ends[i, j, k] - count + n] = wp.vec4i(i, j, k, starts[case] + n)


@wp.kernel(module="unique")
def _place_vertices(
    field: wp.array3d(dtype=float),
    threshold: float,
    lower: wp.vec3,
    spacing: wp.vec3,
    sheets: wp.array(dtype=wp.vec4i),
    edge_starts: wp.array(dtype=int),
    edges: wp.array(dtype=int),
    edge_places: wp.array(dtype=wp.vec4i),
    vertices: wp.array(dtype=wp.vec3),
):
    vertex = wp.tid()
    sheet = sheets[vertex]
    first = edge_starts[sheet[3]]
    count = edge_starts[sheet[3] + 1] - first
    total = wp.vec3()
    for n in range(count):
        place = edge_places[edges[first + n]]
        i = sheet[0] + place[0]
        j = sheet[1] + place[1]
        k = sheet[2] + place[2]
        axis = place[3]
        t = crossing(field, threshold, i, j, k, axis)
        total += wp.vec3(
            float(place[0]) + wp.where(axis == 0, t, 0.0),
            float(place[1]) + wp.where(axis == 1, t, 0.0),
            float(place[2]) + wp.where(axis == 2, t, 0.0),
        )
    inner = total / float(count)
    vertices[vertex] = lower + wp.vec3(
        (float(sheet[0]) + inner[0]) * spacing[0],
        (float(sheet[1]) + inner[1]) * spacing[1],
        (float(sheet[2]) + inner[2]) * spacing[2],
    )


@wp.func
def _has_face(
    field: wp.array3d(dtype=float), threshold: float, i: int, j: int, k: int, axis: int
) -> bool:
    """True if the surface crosses an edge that has four cells around it."""
    at = wp.vec3i(i, j, k)
    last = wp.vec3i(field.shape[0] - 1, field.shape[1] - 1, field.shape[2] - 1)
    found = crosses(field, threshold, i, j, k, axis)
    for side in range(3):
        if side != axis and (at[side] == 0 or at[side] == last[side]):
            found = False
    return found


@wp.kernel(enable_backward=False, module="unique")
def _count_faces(field: wp.array3d(dtype=float), threshold: float, counts: wp.array4d(dtype=int)):
    i, j, k, axis = wp.tid()
    counts[i, j, k, axis] = int(_has_face(field, threshold, i, j, k, axis))


@wp.kernel(enable_backward=False, module="unique")
def _write_faces(
    field: wp.array3d(dtype=float),
    threshold: float,
    starts: wp.array(dtype=int),
    loop_of: wp.array2d(dtype=int),
    around: wp.array2d(dtype=wp.vec4i),
    ends: wp.array3d(dtype=int),
    places: wp.array4d(dtype=int),
    faces: wp.array2d(dtype=int),
):
    i, j, k, axis = wp.tid()
    if _has_face(field, threshold, i, j, k, axis):
        row = places[i, j, k, axis] - 1
        # Counter-clockwise around the axis, if that is the way out.
        leads_out = is_in(field, threshold, i, j, k)
        for n in range(4):
            cell = around[axis, n]
            x = i + cell[0]
            y = j + cell[1]
            z = k + cell[2]
            case = case_of(field, threshold, x, y, z)
            first = ends[x, y, z] - (starts[case + 1] - starts[case])
            place = wp.where(leads_out, n, 3 - n)
            faces[row, place] = first + loop_of[case, cell[3]]


@wp.kernel(enable_backward=False, module="unique")
def _mark_corners(faces: wp.array(dtype=int), used: wp.array(dtype=int)):
    used[faces[wp.tid()]] = 1


@wp.kernel(enable_backward=False, module="unique")
def _keep_corners(
    sheets: wp.array(dtype=wp.vec4i), ends: wp.array(dtype=int), kept: wp.array(dtype=wp.vec4i)
):
    i = wp.tid()
    before = wp.where(i > 0, ends[wp.max(i - 1, 0)], 0)
    if ends[i] > before:
        kept[before] = sheets[i]


@wp.kernel(enable_backward=False, module="unique")
def _renumber_corners(ends: wp.array(dtype=int), faces: wp.array(dtype=int)):
    i = wp.tid()
    faces[i] = ends[faces[i]] - 1


@wp.kernel(enable_backward=False, module="unique")
def _cut_faces(
    vertices: wp.array(dtype=wp.vec3),
    faces: wp.array2d(dtype=int),
    triangles: wp.array2d(dtype=int),
):
    i = wp.tid()
    first = wp.length_sq(vertices[faces[i, 2]] - vertices[faces[i, 0]])
    second = wp.length_sq(vertices[faces[i, 3]] - vertices[faces[i, 1]])
    # Which corner the shorter diagonal starts from.
    start = int(first > second)
    for n in range(3):
        triangles[i, n] = faces[i, (start + n) % 4]
        triangles[i, 3 + n] = faces[i, (start + (n + 1) * int(n > 0)) % 4]


@functools.lru_cache(maxsize=16)
def _tables(device):
    """The tables of cases on a device."""
    return (
        *(wp.array(table, dtype=int, device=device) for table in cases.loop_tables()),
        wp.array(cases.edge_places(), dtype=wp.vec4i, device=device),
        wp.array(cases.edges_around(), dtype=wp.vec4i, device=device),
    )


class IsoSurfaceNets(IsoSurfaceBase):
    """Surfaces of fields of one shape, with rounder faces and fewer slivers than marching cubes.

    Args:
        nx, ny, nz: nodes of the grid.
        lower, upper: where its first and its last node are; by default at their indices.
        topology: "triangle", or "quad" for faces of four vertices.

    Attributes:
        verts: vertices, an array of vec3, of the last `surface`.
        indices: three or four vertices per face. Seen from larger values they go counter-clockwise.

    Raises:
        ValueError: there is no such topology.

    Example:
        >>> import numpy as np, warp as wp
        >>> x, y, z = np.indices((9, 9, 9)) - 4.0
        >>> field = wp.array(np.sqrt(x * x + y * y + z * z), dtype=float, device="cpu")
        >>> surface = wp.geometry.IsoSurfaceNets(9, 9, 9, topology="quad")
        >>> surface.surface(field, 3.0)
        >>> len(surface.indices) // 4 == len(surface.verts) - 2
        True
    """

    @checked(nx=INTEGER, ny=INTEGER, nz=INTEGER, lower=POINT, upper=POINT, topology=TEXT)
    def __init__(self, nx, ny, nz, *, lower=None, upper=None, topology="triangle"):
        super().__init__(nx, ny, nz, lower=lower, upper=upper)
        _check_topology(topology)
        self.topology = topology

    def _options(self):
        return {"topology": self.topology}

    @classmethod
    @checked(field=ARRAY, lower=POINT, upper=POINT, topology=TEXT)
    def extract(cls, field, threshold=0.0, *, lower=None, upper=None, topology="triangle"):
        """Vertices and indices of the surface where a field crosses a value.

        A node is inside if its value is less than the threshold. Positions have derivatives by
        the field, on a tape, if it has gradients. Faces of four vertices, which need not be flat,
        are cut along their shorter diagonal. Where the surface leaves the grid it ends half a cell
        before.

        Args: as of this class, and of `IsoSurfaceMarchingCubes.extract`.

        Raises:
            ValueError: the field has other dimensions, or there is no such topology.
            TypeError: it is not of float32.
        """
        _check_topology(topology)
        sampled = Sampled(field, threshold, lower, upper)
        device = sampled.device
        starts, edge_starts, edges, loop_of, edge_places, around = _tables(device)
        cells = [extent - 1 for extent in sampled.shape]
        ends = wp.empty(cells, dtype=int, device=device)
        sampled.launch(count_of_cases, cells, starts, ends)
        count = scan(ends)
        sheets = wp.empty(count, dtype=wp.vec4i, device=device)
        sampled.launch(_list_sheets, cells, starts, ends, sheets)
        places = wp.empty((*sampled.shape, 3), dtype=int, device=device)
        sampled.launch(_count_faces, places.shape, places)
        faces = wp.empty((scan(places), 4), dtype=int, device=device)
        given = [starts, loop_of, around, ends, places]
        sampled.launch(_write_faces, places.shape, *given, faces)
        sheets = _with_faces(sheets, faces.flatten())
        vertices = sampled.place(
            _place_vertices, len(sheets), sheets, edge_starts, edges, edge_places
        )
        if topology == "quad":
            return vertices, faces.flatten()
        triangles = wp.empty((faces.shape[0], 6), dtype=int, device=device)
        wp.launch(
            _cut_faces, faces.shape[0], inputs=[plain(vertices), faces, triangles], device=device
        )
        return vertices, triangles.flatten()


def _with_faces(sheets, corners):
    """The sheets that are corners of faces, and gives the corners their new numbers: a sheet that
    crosses edges on the border of the grid alone is none."""
    if not len(sheets):
        return sheets
    ends = wp.zeros(len(sheets), dtype=int, device=sheets.device)
    wp.launch(_mark_corners, len(corners), inputs=[corners, ends], device=sheets.device)
    count = scan(ends)
    if count == len(sheets):
        return sheets
    kept = wp.empty(count, dtype=wp.vec4i, device=sheets.device)
    wp.launch(_keep_corners, len(sheets), inputs=[sheets, ends, kept], device=sheets.device)
    wp.launch(_renumber_corners, len(corners), inputs=[ends, corners], device=sheets.device)
    return kept


def _check_topology(topology):
    if topology not in _TOPOLOGIES:
        raise ValueError(f"expects 'triangle' or 'quad' as 'topology', but got {topology!r}")
