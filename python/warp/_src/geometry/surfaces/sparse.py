"""`volume_marching_cubes`: the surface where a volume has one value, as triangles.

Cells that touch a leaf are looked at. Their lowest corners are in leaves or in tiles next to them,
on the lower side; an index grid of all these tiles numbers their voxels. An edge has the number of
the voxel that it starts from, and from there on all is as in `marching_cubes`.
"""

from __future__ import annotations

import itertools

import numpy as np

import warp as wp
from warp._src.argument_kinds import VOLUME
from warp._src.arguments import checked
from warp._src.geometry.surfaces.fields import scan
from warp._src.geometry.surfaces.marching_cubes import tables


@wp.func
def _voxel(tiles: wp.array(dtype=wp.vec3i), number: int):
    n = number % 512
    return tiles[number // 512] + wp.vec3i(n >> 6, (n >> 3) & 7, n & 7)


@wp.func
def _along(voxel: wp.vec3i, axis: int):
    return voxel + wp.vec3i(int(axis == 0), int(axis == 1), int(axis == 2))


@wp.func
def _is_in(volume: wp.uint64, threshold: float, voxel: wp.vec3i):
    return wp.volume_lookup_f(volume, voxel[0], voxel[1], voxel[2]) < threshold


@wp.func
def _case_of(volume: wp.uint64, threshold: float, voxel: wp.vec3i):
    case = int(0)
    for corner in range(8):
        # Corners go around the lower face, then around the upper one.
        place = wp.vec3i(((corner + 1) >> 1) & 1, (corner >> 1) & 1, corner >> 2)
        case += int(_is_in(volume, threshold, voxel + place)) << corner
    return case


@wp.kernel(enable_backward=False, module="unique")
def _count_vertices(
    volume: wp.uint64,
    threshold: float,
    tiles: wp.array(dtype=wp.vec3i),
    counts: wp.array2d(dtype=int),
):
    number = wp.tid()
    voxel = _voxel(tiles, number)
    inside = _is_in(volume, threshold, voxel)
    for axis in range(3):
        counts[number, axis] = int(_is_in(volume, threshold, _along(voxel, axis)) != inside)


@wp.kernel(enable_backward=False, module="unique")
def _list_edges(
    volume: wp.uint64,
    threshold: float,
    tiles: wp.array(dtype=wp.vec3i),
    places: wp.array2d(dtype=int),
    edges: wp.array(dtype=wp.vec4i),
):
    number = wp.tid()
    voxel = _voxel(tiles, number)
    inside = _is_in(volume, threshold, voxel)
    for axis in range(3):
        if _is_in(volume, threshold, _along(voxel, axis)) != inside:
            edges[places[number, axis] - 1] = wp.vec4i(voxel[0], voxel[1], voxel[2], axis)


@wp.kernel(module="unique")
def _place_vertices(
    volume: wp.uint64,
    threshold: float,
    edges: wp.array(dtype=wp.vec4i),
    vertices: wp.array(dtype=wp.vec3),
):
    vertex = wp.tid()
    edge = edges[vertex]
    axis = edge[3]
    low = wp.vec3i(edge[0], edge[1], edge[2])
    high = _along(low, axis)
    first = wp.float64(wp.volume_lookup_f(volume, low[0], low[1], low[2]))
    second = wp.float64(wp.volume_lookup_f(volume, high[0], high[1], high[2]))
    # In 64 bits no difference of two floats overflows or loses digits.
    t = float((wp.float64(threshold) - first) / (second - first))
    if not (t >= 0.0 and t <= 1.0):
        t = 0.5
    # Off the ends, where vertices of several edges would be one.
    t = wp.clamp(t, 5.9604645e-08, 0.99999994)
    place = wp.vec3(
        float(low[0]) + wp.where(axis == 0, t, 0.0),
        float(low[1]) + wp.where(axis == 1, t, 0.0),
        float(low[2]) + wp.where(axis == 2, t, 0.0),
    )
    vertices[vertex] = wp.volume_index_to_world(volume, place)


@wp.kernel(enable_backward=False, module="unique")
def _count_triangles(
    volume: wp.uint64,
    threshold: float,
    tiles: wp.array(dtype=wp.vec3i),
    starts: wp.array(dtype=int),
    counts: wp.array(dtype=int),
):
    number = wp.tid()
    case = _case_of(volume, threshold, _voxel(tiles, number))
    counts[number] = starts[case + 1] - starts[case]


@wp.kernel(enable_backward=False, module="unique")
def _write_triangles(
    volume: wp.uint64,
    threshold: float,
    tiles: wp.array(dtype=wp.vec3i),
    starts: wp.array(dtype=int),
    triangles: wp.array(dtype=wp.vec3i),
    edge_places: wp.array(dtype=wp.vec4i),
    ends: wp.array(dtype=int),
    numbers: wp.uint64,
    places: wp.array2d(dtype=int),
    indices: wp.array(dtype=int),
):
    number = wp.tid()
    voxel = _voxel(tiles, number)
    case = _case_of(volume, threshold, voxel)
    count = starts[case + 1] - starts[case]
    first = ends[number] - count
    for n in range(count):
        triangle = triangles[starts[case] + n]
        for corner in range(3):
            place = edge_places[triangle[corner]]
            i = voxel[0] + place[0]
            j = voxel[1] + place[1]
            k = voxel[2] + place[2]
            start = wp.volume_lookup_index(numbers, i, j, k)
            indices[3 * (first + n) + corner] = places[start, place[3]] - 1


@checked(volume=VOLUME)
def volume_marching_cubes(volume, threshold=0.0):
    """Vertices and triangles of the surface where a volume has one value, in the world.

    Cells with a corner in a leaf are looked at, with the background outside of leaves; so the
    surface is closed around what is less than the threshold unless tiles without leaves are.
    Positions have derivatives by `volume.leaf_values` if that has gradients. Values are those of
    voxels, which are places of index space.

    Args:
        volume: a `Volume` of float32.
        threshold: the value; a voxel is inside if its value is less.

    Returns:
        Vertices, an array of vec3, and an array of int32 with three of them per triangle. Seen from
        larger values they go counter-clockwise, if the volume's transform keeps orientation.

    Raises:
        TypeError: the values are of another type.

    Example:
        >>> import numpy as np, warp as wp
        >>> x, y, z = np.indices((9, 9, 9)) - 4.0
        >>> distance = np.sqrt(x * x + y * y + z * z)
        >>> volume = wp.Volume.load_from_numpy(distance, bg_value=9.0, device="cpu")
        >>> vertices, indices = wp.geometry.volume_marching_cubes(volume, 3.0)
        >>> len(indices) // 3 == 2 * len(vertices) - 4
        True
    """
    if volume.dtype is not wp.float32:
        shown = getattr(volume.dtype, "__name__", "numbers of voxels")
        raise TypeError(f"expects a volume of float32, but got one of {shown}")
    device, threshold = volume.device, float(getattr(threshold, "value", threshold))
    leaves = volume.get_tiles().numpy()[: volume.get_active_stats().leaf_node_count]
    around = np.array(list(itertools.product((0, -8), repeat=3)), dtype=np.int32)
    tiles = np.unique((leaves[:, None] + around[None]).reshape(-1, 3), axis=0)
    if not len(tiles):
        return wp.empty(0, dtype=wp.vec3, device=device), wp.empty(0, dtype=int, device=device)
    given = wp.array(tiles, dtype=wp.vec3i, device=device)
    numbers = wp.Volume.allocate_by_tiles(given, 1.0, bg_value=None, device=device)
    tiles = wp.array(numbers.get_tiles().numpy(), dtype=wp.vec3i, device=device)
    total, known = 512 * len(tiles), [volume.id, threshold, tiles]
    places = wp.empty((total, 3), dtype=int, device=device)
    wp.launch(_count_vertices, total, inputs=[*known, places], device=device)
    count = scan(places)
    edges = wp.empty(count, dtype=wp.vec4i, device=device)
    wp.launch(_list_edges, total, inputs=[*known, places, edges], device=device)
    wanted = volume.leaf_values.requires_grad
    vertices = wp.empty(count, dtype=wp.vec3, device=device, requires_grad=wanted)
    given = [volume.id, threshold, edges, vertices]
    wp.launch(_place_vertices, count, inputs=given, device=device)
    starts, triangles, edge_places = tables(device)
    ends = wp.empty(total, dtype=int, device=device)
    wp.launch(_count_triangles, total, inputs=[*known, starts, ends], device=device)
    indices = wp.empty(3 * scan(ends), dtype=int, device=device)
    given = [*known, starts, triangles, edge_places, ends, numbers.id, places, indices]
    wp.launch(_write_triangles, total, inputs=given, device=device)
    return vertices, indices
