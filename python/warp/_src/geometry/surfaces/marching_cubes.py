"""`IsoSurfaceMarchingCubes`: the surface where a field on a grid has one value, as triangles.

Edges of the grid that the surface crosses are counted, then each gets its vertex; cells count and
write their triangles, which name the vertices of their edges. So each vertex is there once. Only
positions depend on the field continuously: their kernel is the one that derivatives see.
"""

from __future__ import annotations

import functools

import numpy as np

import warp as wp
from warp._src.geometry.surfaces import cases
from warp._src.types import dtypes


@wp.func
def _is_in(field: wp.array3d(dtype=float), threshold: float, i: int, j: int, k: int):
    return field[i, j, k] < threshold


@wp.func
def _crosses(
    field: wp.array3d(dtype=float), threshold: float, i: int, j: int, k: int, axis: int
) -> bool:
    """Whether the surface goes through the edge that starts at a node along an axis."""
    i1 = i + int(axis == 0)
    j1 = j + int(axis == 1)
    k1 = k + int(axis == 2)
    crosses = bool(False)
    if i1 < field.shape[0] and j1 < field.shape[1] and k1 < field.shape[2]:
        crosses = _is_in(field, threshold, i, j, k) != _is_in(field, threshold, i1, j1, k1)
    return crosses


@wp.kernel(enable_backward=False, module="unique")
def _count_vertices(
    field: wp.array3d(dtype=float), threshold: float, counts: wp.array4d(dtype=int)
):
    i, j, k, axis = wp.tid()
    counts[i, j, k, axis] = int(_crosses(field, threshold, i, j, k, axis))


@wp.kernel(enable_backward=False, module="unique")
def _list_edges(
    field: wp.array3d(dtype=float),
    threshold: float,
    places: wp.array4d(dtype=int),
    edges: wp.array(dtype=wp.vec4i),
):
    i, j, k, axis = wp.tid()
    if _crosses(field, threshold, i, j, k, axis):
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
    first = wp.float64(field[edge[0], edge[1], edge[2]])
    second = wp.float64(
        field[edge[0] + int(axis == 0), edge[1] + int(axis == 1), edge[2] + int(axis == 2)]
    )
    # In 64 bits no difference of two floats overflows or loses digits.
    t = float((wp.float64(threshold) - first) / (second - first))
    if not (t >= 0.0 and t <= 1.0):
        t = 0.5
    # Off the ends, where vertices of several edges would be one.
    t = wp.clamp(t, 5.9604645e-08, 0.99999994)
    vertices[vertex] = lower + wp.vec3(
        (float(edge[0]) + wp.where(axis == 0, t, 0.0)) * spacing[0],
        (float(edge[1]) + wp.where(axis == 1, t, 0.0)) * spacing[1],
        (float(edge[2]) + wp.where(axis == 2, t, 0.0)) * spacing[2],
    )


@wp.func
def _case_of(field: wp.array3d(dtype=float), threshold: float, i: int, j: int, k: int):
    case = int(0)
    for corner in range(8):
        # Corners go around the lower face, then around the upper one.
        x = ((corner + 1) >> 1) & 1
        y = (corner >> 1) & 1
        z = corner >> 2
        case += int(_is_in(field, threshold, i + x, j + y, k + z)) << corner
    return case


@wp.kernel(enable_backward=False, module="unique")
def _count_triangles(
    field: wp.array3d(dtype=float),
    threshold: float,
    starts: wp.array(dtype=int),
    counts: wp.array3d(dtype=int),
):
    i, j, k = wp.tid()
    case = _case_of(field, threshold, i, j, k)
    counts[i, j, k] = starts[case + 1] - starts[case]


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
    case = _case_of(field, threshold, i, j, k)
    count = starts[case + 1] - starts[case]
    first = ends[i, j, k] - count
    for n in range(count):
        triangle = triangles[starts[case] + n]
        for corner in range(3):
            place = edge_places[triangle[corner]]
            vertex = vertices[i + place[0], j + place[1], k + place[2], place[3]] - 1
            indices[3 * (first + n) + corner] = vertex


@functools.lru_cache(maxsize=16)
def _tables(device):
    """The tables of cases on a device."""
    starts, triangles = cases.tables()
    return (
        wp.array(starts, dtype=int, device=device),
        wp.array(triangles, dtype=wp.vec3i, device=device),
        wp.array(cases.edge_places(), dtype=wp.vec4i, device=device),
    )


def _check_field(field):
    if not dtypes.is_array(field) or len(field.shape) != 3:
        raise ValueError(
            f"expects a 3D array as 'field', but got one of shape {getattr(field, 'shape', None)}"
        )
    if min(field.shape) < 2:
        raise ValueError(
            f"'field' has at least 2 nodes on each axis, but its shape is {field.shape}"
        )
    if field.dtype is not dtypes.float32:
        raise TypeError(f"expects a 'field' of float32, but got {field.dtype.__name__}")


def _total(ends) -> int:
    return int(ends.flatten()[-1:].numpy()[0])


def _scan(counts):
    """Sums up to and with each element; waits for the last one."""
    flat = counts.flatten()
    wp.utils.array_scan(flat, flat, inclusive=True)
    return _total(counts)


class IsoSurfaceMarchingCubes:
    """Triangles of surfaces in fields of one shape.

    Args:
        nx, ny, nz: nodes of the grid.
        lower, upper: where its first and its last node are; by default at their indices.

    Attributes:
        verts: vertices, an array of vec3, of the last `surface`.
        indices: three vertices per triangle. Seen from larger values they go counter-clockwise.

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
        self.nx, self.ny, self.nz = nx, ny, nz
        self.lower = domain_bounds_lower_corner if lower is None else lower
        self.upper = domain_bounds_upper_corner if upper is None else upper
        self.verts = self.indices = None

    def resize(self, nx, ny, nz) -> None:
        """Takes fields of another shape from now on."""
        self.nx, self.ny, self.nz = nx, ny, nz

    def surface(self, field, threshold) -> None:
        """Finds the surface of a field, as `verts` and `indices`.

        Raises:
            ValueError: the field is of another shape than this object.
        """
        if tuple(field.shape) != (self.nx, self.ny, self.nz):
            raise ValueError(
                f"the field has the shape {tuple(field.shape)}, but expected "
                f"{(self.nx, self.ny, self.nz)}"
            )
        self.verts, self.indices = self.extract(
            field, threshold, lower=self.lower, upper=self.upper
        )

    @classmethod
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
        _check_field(field)
        device, shape = field.device, tuple(field.shape)
        threshold = float(getattr(threshold, "value", threshold))
        low = np.zeros(3) if lower is None else np.array(list(lower), dtype=np.float64)
        high = np.array(shape) - 1.0 if upper is None else np.array(list(upper), dtype=np.float64)
        spacing = (high - low) / (np.array(shape) - 1)
        places = wp.empty((*shape, 3), dtype=int, device=device)
        # What is counted has no derivative.
        plain = wp.array(
            ptr=field.ptr or 0, dtype=float, shape=shape, strides=field.strides, device=device
        )
        given = [plain, threshold]
        wp.launch(_count_vertices, places.shape, inputs=[*given, places], device=device)
        count = _scan(places)
        vertices = wp.empty(count, dtype=wp.vec3, device=device, requires_grad=field.requires_grad)
        edges = wp.empty(count, dtype=wp.vec4i, device=device)
        wp.launch(_list_edges, places.shape, inputs=[*given, places, edges], device=device)
        wp.launch(
            _place_vertices,
            count,
            inputs=[field, threshold, wp.vec3(*low), wp.vec3(*spacing), edges, vertices],
            device=device,
        )
        return vertices, cls._faces(given, places, device)

    @staticmethod
    def _faces(given, places, device):
        starts, triangles, edge_places = _tables(device)
        cells = [extent - 1 for extent in given[0].shape]
        ends = wp.empty(cells, dtype=int, device=device)
        wp.launch(_count_triangles, cells, inputs=[*given, starts, ends], device=device)
        indices = wp.empty(3 * _scan(ends), dtype=int, device=device)
        tables = [starts, triangles, edge_places, ends, places]
        wp.launch(_write_triangles, cells, inputs=[*given, *tables, indices], device=device)
        return indices

    @staticmethod
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
