"""Surfaces of functions: what an octree keeps, and that the surface is that of the whole grid."""

import numpy as np
import pytest
from test_marching_cubes import is_closed, volume_of

import warp as wp
from warp.geometry import (
    IsoSurfaceMarchingCubes,
    lipschitz_octree,
    sparse_marching_cubes,
    sparse_marching_cubes_from_cells,
)

RADIUS, TUBE = 0.6, 0.25


@wp.kernel
def measure_torus(
    points: wp.array(dtype=wp.vec3), tube: wp.array(dtype=float), values: wp.array(dtype=float)
):
    i = wp.tid()
    p = points[i]
    around = wp.sqrt(p[0] * p[0] + p[1] * p[1]) - RADIUS
    values[i] = wp.sqrt(around * around + p[2] * p[2]) - tube[0]


def torus(device, tube=TUBE, requires_grad=False):
    """The function, and the array with the radius of its tube."""
    tube = wp.array([tube], dtype=float, device=device, requires_grad=requires_grad)

    def field(points):
        values = wp.empty(len(points), dtype=float, device=device, requires_grad=requires_grad)
        wp.launch(measure_torus, len(points), inputs=[points, tube, values], device=device)
        return values

    return field, tube


def grid_values(field, nodes, lower, upper, device):
    axes = [np.linspace(a, b, n) for a, b, n in zip(lower, upper, nodes, strict=True)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).astype(np.float32)
    values = field(wp.array(places.reshape(-1, 3), dtype=wp.vec3, device=device))
    return values.numpy().reshape(nodes)


def triangles_of(points, indices):
    """Corners of triangles, in an order of their own."""
    corners = points.numpy()[indices.numpy().reshape(-1, 3)]
    # A triangle begins with its least corner; then triangles are sorted.
    first = np.lexsort(np.moveaxis(corners.round(5), 2, 0)[::-1], axis=1)[:, 0]
    turned = np.stack([np.roll(c, -f, axis=0) for c, f in zip(corners, first, strict=True)])
    rows = turned.reshape(-1, 9)
    return rows[np.lexsort(rows.round(4).T[::-1])]


@pytest.mark.parametrize("nodes", [(33, 33, 33), (40, 35, 20)])
def test_surface_is_that_of_the_whole_grid(device, nodes):
    lower, upper = (-1.0, -1.0, -0.5), (1.0, 1.0, 0.5)
    field, _ = torus(device)
    points, indices, stats = sparse_marching_cubes(
        field, *nodes, lower=lower, upper=upper, device=device, return_stats=True
    )
    whole = wp.array(grid_values(field, nodes, lower, upper, device), dtype=float, device=device)
    expected = IsoSurfaceMarchingCubes.extract(
        whole, 0.0, lower=wp.vec3(*lower), upper=wp.vec3(*upper)
    )
    assert len(points) == len(expected[0]) and len(indices) == len(expected[1])
    got, wanted = triangles_of(points, indices), triangles_of(*expected)
    assert np.abs(got - wanted).max() < 1e-5
    assert stats["field_evaluations"] < np.prod(nodes) and stats["leaf_cells"] > 0
    assert stats["requested_ncells"] == tuple(n - 1 for n in nodes)


def test_torus_is_closed_with_its_volume_and_its_hole(device):
    field, _ = torus(device)
    points, indices = sparse_marching_cubes(
        field, 129, 129, 129, lower=(-1.0,) * 3, upper=(1.0,) * 3, device=device
    )
    faces = indices.numpy().reshape(-1, 3)
    assert is_closed(faces)
    assert len(points) - len(faces) * 3 // 2 + len(faces) == 0
    exact = 2 * np.pi**2 * RADIUS * TUBE**2
    assert abs(volume_of(points.numpy(), faces) / exact - 1) < 2e-3


def test_octree_misses_no_crossed_cell(device):
    field, _ = torus(device)
    cells, width = lipschitz_octree(field, (-1.0, -1.0, -1.0), 2.0, 5, device=device)
    assert width == 2.0 / 32
    inside = grid_values(field, (33,) * 3, (-1.0,) * 3, (1.0,) * 3, device) < 0
    corners = np.stack(
        [inside[x : x + 32, y : y + 32, z : z + 32] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    )
    crossed = {*map(tuple, np.argwhere(corners.any(axis=0) & ~corners.all(axis=0)).tolist())}
    kept = [tuple(cell) for cell in cells.numpy().tolist()]
    assert crossed <= {*kept} and len({*kept}) == len(kept) < 4 * len(crossed)


def test_surface_follows_what_the_function_depends_on(device):
    """Moving every vertex along the normal changes the volume by the area of the surface."""
    field, tube = torus(device, requires_grad=True)
    given = dict(lower=(-1.0,) * 3, upper=(1.0,) * 3, device=device)

    @wp.kernel(module="unique")
    def volume(
        points: wp.array(dtype=wp.vec3), faces: wp.array(dtype=int), out: wp.array(dtype=float)
    ):
        i = wp.tid()
        a, b, c = points[faces[3 * i]], points[faces[3 * i + 1]], points[faces[3 * i + 2]]
        wp.atomic_add(out, 0, wp.dot(a, wp.cross(b, c)) / 6.0)

    out = wp.zeros(1, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        points, indices = sparse_marching_cubes(field, 65, 65, 65, **given)
        wp.launch(volume, len(indices) // 3, inputs=[points, indices, out], device=device)
    tape.backward(out)
    area = 4 * np.pi**2 * RADIUS * TUBE
    assert abs(float(tube.grad.numpy()[0]) / area - 1) < 5e-3


def test_given_cells_far_from_zero_share_vertices(device):
    """A plane through a row of cells at 10^8, of which each has its own corner values."""
    far = 100_000_000
    cells = np.array([[far + i, -far, 5] for i in range(4)])
    heights = np.array([-0.25] * 4 + [0.75] * 4, dtype=np.float32)
    points, indices = sparse_marching_cubes_from_cells(
        cells, np.tile(heights, (4, 1)), origin=(-far, far, 0.0), device=device
    )
    at = points.numpy()
    assert len(at) == 10 and len(indices) == 24
    assert np.array_equal(np.unique(at[:, 0]), [0, 1, 2, 3, 4])
    assert np.allclose(at[:, 2], 5.25, atol=0, rtol=0)


def test_nothing_there(device):
    field, _ = torus(device)
    far = dict(lower=(3.0,) * 3, upper=(4.0,) * 3, device=device)
    points, indices, stats = sparse_marching_cubes(field, 9, 9, 9, return_stats=True, **far)
    assert len(points) == len(indices) == stats["leaf_cells"] == 0
    assert stats["field_evaluations"] == 1
    points, indices = sparse_marching_cubes_from_cells(
        np.zeros((0, 3), dtype=int), np.zeros((0, 8)), device=device
    )
    assert len(points) == len(indices) == 0


def test_bad_input_is_refused(device):
    field, _ = torus(device)
    with pytest.raises(ValueError, match="at least 2 nodes"):
        sparse_marching_cubes(field, 1, 9, 9, device=device)
    with pytest.raises(ValueError, match="lipschitz_bound >= 0"):
        sparse_marching_cubes(field, 9, 9, 9, lipschitz_bound=-1.0, device=device)
    with pytest.raises(TypeError, match="called with an array of points"):
        sparse_marching_cubes(3.0, 9, 9, 9, device=device)
    with pytest.raises(TypeError, match="array of float32, but gave float64"):
        sparse_marching_cubes(
            lambda p: wp.zeros(len(p), dtype=wp.float64, device=device), 9, 9, 9, device=device
        )
    with pytest.raises(ValueError, match="a value for each of 1 points"):
        sparse_marching_cubes(
            lambda p: wp.zeros(7, dtype=float, device=device), 9, 9, 9, device=device
        )
    with pytest.raises(ValueError, match="max_depth >= 0"):
        lipschitz_octree(field, (0, 0, 0), 1.0, -1, device=device)
    with pytest.raises(ValueError, match="root_width > 0"):
        lipschitz_octree(field, (0, 0, 0), 0.0, 2, device=device)
    with pytest.raises(ValueError, match="8 'corner_values' for each of 2 cells"):
        sparse_marching_cubes_from_cells(np.zeros((2, 3), dtype=int), np.zeros(8), device=device)
    with pytest.raises(TypeError, match="of integers"):
        sparse_marching_cubes_from_cells(np.zeros((2, 3)), np.zeros((2, 8)), device=device)
    with pytest.raises(ValueError, match="cell_width > 0"):
        sparse_marching_cubes_from_cells(
            np.zeros((1, 3), dtype=int), np.zeros((1, 8)), cell_width=-1.0, device=device
        )
