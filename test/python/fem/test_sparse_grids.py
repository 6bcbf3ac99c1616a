"""Sparse grids against dense ones, sets of Python and the exact measures of their cells."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem
from warp._src.fem.types import make_free_sample

BOTH = pytest.mark.parametrize("real", [wp.float32, wp.float64])


def voxels_of(shape, origin=(0, 0, 0)):
    return np.stack(np.unravel_index(np.arange(np.prod(shape)), shape), 1).astype(np.int32) + origin


def volume(voxels, size=0.5, translation=(0.25, 0.25, 0.25), **options):
    points = wp.array(np.asarray(voxels, np.int32), dtype=wp.int32)
    return wp.Volume.allocate_by_voxels(points, size, translation, **options)


def sides_of(geometry):
    """Cells, mean positions, normals and measures of sides; errors of the way to cells."""
    f, real = geometry.functions, geometry.scalar_type
    vector, SideArg = wp.types.vector(3, real), f.SideArg
    on_side = geometry.coords_type(0.25, 0.5, 0.0)

    @wp.kernel
    def read(
        arg: SideArg,
        cells: wp.array(dtype=wp.vec2i),
        positions: wp.array(dtype=vector),
        normals: wp.array(dtype=vector),
        measures: wp.array(dtype=real),
        errors: wp.array(dtype=real),
    ):
        i = wp.tid()
        s = make_free_sample(i, on_side)
        inner = f.side_inner_sample(arg, s)
        outer = f.side_outer_sample(arg, s)
        x = f.side_position(arg, s)
        cells[i] = wp.vec2i(inner.element_index, outer.element_index)
        positions[i] = x
        normals[i] = f.side_normal(arg, s)
        measures[i] = f.side_measure(arg, s)
        error = wp.length(f.cell_position(arg.cell_arg, inner) - x)
        error += wp.length(f.cell_position(arg.cell_arg, outer) - x)
        error += wp.length(f.side_coordinates(arg, i, x) - on_side)
        back = f.side_from_cell_coords(arg, i, outer.element_index, outer.element_coords)
        error += wp.length(back - on_side)
        c = f.cell_coordinates(arg.cell_arg, inner.element_index, x)
        errors[i] = error + wp.length(c - inner.element_coords)

    n = geometry.side_count()
    types = (wp.vec2i, vector, vector, real, real)
    outputs = [wp.zeros(n, dtype=dtype) for dtype in types]
    wp.launch(read, n, [geometry.side_arg_value(wp.get_device())], outputs)
    return [array.numpy() for array in outputs]


def cell_centers(geometry):
    f, real = geometry.functions, geometry.scalar_type
    vector, CellArg = wp.types.vector(3, real), f.CellArg
    center = geometry.coords_type(0.5, 0.5, 0.5)

    @wp.kernel
    def read(arg: CellArg, x: wp.array(dtype=vector), v: wp.array(dtype=real)):
        s = make_free_sample(wp.tid(), center)
        x[wp.tid()] = f.cell_position(arg, s)
        v[wp.tid()] = f.cell_measure(arg, s)

    n = geometry.cell_count()
    x, v = wp.zeros(n, dtype=vector), wp.zeros(n, dtype=real)
    wp.launch(read, n, [geometry.cell_arg_value(wp.get_device())], [x, v])
    return x.numpy(), v.numpy()


@BOTH
def test_a_full_box_has_the_sides_of_a_dense_grid(real):
    sparse = fem.Nanogrid(volume(voxels_of((3, 4, 5))), scalar_type=real)
    dense = fem.Grid3D(wp.vec3i(3, 4, 5), None, (1.5, 2.0, 2.5), real)
    for count in ("cell_count", "vertex_count", "side_count", "boundary_side_count", "edge_count"):
        assert getattr(sparse, count)() == getattr(dense, count)()
    cells, x, normals, measures, errors = sides_of(sparse)
    assert errors.max() < (1e-5 if real is wp.float32 else 1e-13)
    centers, volumes = cell_centers(sparse)
    np.testing.assert_allclose(volumes, 0.125)
    np.testing.assert_allclose(measures, 0.25)
    outward = np.sum((x - centers[cells[:, 0]]) * normals, axis=1)
    np.testing.assert_allclose(outward, 0.25, rtol=1e-5)
    beside = cells[:, 0] != cells[:, 1]
    np.testing.assert_array_equal(np.flatnonzero(~beside), sparse._sides.boundary.numpy())
    # The outer cell is where the normal points to.
    step = centers[cells[beside, 1]] - centers[cells[beside, 0]]
    np.testing.assert_allclose(step, 0.5 * normals[beside], atol=1e-6)


def test_vertices_are_numbered_by_the_volume_of_vertices():
    sparse = fem.Nanogrid(volume([(0, 0, 0), (1, 0, 0), (5, 2, -3), (-9, 0, 0)]))
    table = sparse.entities().cells.numpy()
    corners = sparse._corners.numpy().reshape(-1, 8, 3)
    vertices = np.empty((sparse.vertex_count(), 3), np.int32)
    out = wp.empty(sparse.vertex_count(), dtype=wp.vec3i)
    sparse.vertex_grid.get_voxels(out=out)
    vertices[:] = out.numpy()
    np.testing.assert_array_equal(vertices[table], corners)


@BOTH
def test_lookup_against_all_boxes(real):
    rng = np.random.default_rng(0)
    voxels = np.unique(rng.integers(-4, 4, size=(60, 3)), axis=0)
    sparse = fem.Nanogrid(volume(voxels), scalar_type=real)
    f, vector, CellArg = sparse.functions, wp.types.vector(3, real), sparse.CellArg
    centers, _ = cell_centers(sparse)
    x = (rng.random((2000, 3)) - 0.5) * 6.0

    @wp.kernel
    def find(
        arg: CellArg,
        x: wp.array(dtype=vector),
        reach: real,
        cells: wp.array(dtype=int),
        near: wp.array(dtype=vector),
    ):
        s = f.cell_lookup(arg, x[wp.tid()], reach)
        cells[wp.tid()] = s.element_index
        if s.element_index >= 0:
            near[wp.tid()] = f.cell_position(arg, s)

    cells, near = wp.zeros(2000, dtype=int), wp.zeros(2000, dtype=vector)
    inputs = [sparse.cell_arg_value(wp.get_device()), wp.array(x, dtype=vector)]
    wp.launch(find, 2000, [*inputs, real(100.0)], [cells, near])
    closest = np.clip(x[:, None], centers - 0.25, centers + 0.25)
    distances = np.linalg.norm(closest - x[:, None], axis=2)
    got = np.linalg.norm(near.numpy() - x, axis=1)
    np.testing.assert_allclose(got, distances.min(axis=1), atol=2e-6)
    np.testing.assert_array_equal(cells.numpy(), distances.argmin(axis=1))
    wp.launch(find, 2000, [*inputs, real(0.3)], [cells, near])
    far = distances.min(axis=1) > 0.3001
    np.testing.assert_array_equal(cells.numpy() < 0, far | (distances.min(axis=1) > 0.3))


def hierarchy():
    """Three coarse cells, and a fourth in eight."""
    fine = volume(voxels_of((2, 2, 2), (2, 2, 0)), 0.5, (0.0, 0.0, 0.0))
    coarse = volume([(0, 0, 0), (0, 1, 0), (1, 0, 0), (1, 1, 0)], 1.0, (0.0, 0.0, 0.0))
    return fem.adaptive_nanogrid_from_hierarchy([fine, coarse]), coarse


def test_adaptive_grids_count_faces_between_levels_once():
    grid, _ = hierarchy()
    assert grid.cell_count() == 11 and grid.vertex_count() == 2 * 9 + 27 - 8
    assert grid.side_count() == 2 * 4 + 6 * 2 + 3 * 3 * 4 - 6
    assert grid.boundary_side_count() == 2 * 4 + 4 * 2 + 4 * 4 - 4
    assert grid.stacked_face_count() == grid.side_count() + 2
    cells, x, normals, measures, errors = sides_of(grid)
    assert errors.max() < 1e-5
    centers, volumes = cell_centers(grid)
    assert volumes.sum() == pytest.approx(4.0) and measures.sum() == pytest.approx(23.0)
    assert (np.sum((x - centers[cells[:, 0]]) * normals, axis=1) > 0.0).all()
    beside = cells[:, 0] != cells[:, 1]
    step = np.sum((centers[cells[beside, 1]] - x[beside]) * normals[beside], axis=1)
    assert (step > 0.0).all()


def test_partly_covered_faces_have_a_boundary_of_fine_squares():
    voxels, levels = [(0, 0, 0), (2, 0, 0), (2, 1, 0)], [1, 0, 0]
    grid_voxels = volume(voxels, 1.0)
    out = wp.empty(3, dtype=wp.vec3i)
    grid_voxels.get_voxels(out=out)
    order = [voxels.index(tuple(v)) for v in out.numpy().tolist()]
    level_array = wp.array(np.array(levels, np.uint8)[order], dtype=wp.uint8)
    grid = fem.AdaptiveNanogrid(grid_voxels, level_array, 2)
    cells, _, _, measures, errors = sides_of(grid)
    assert errors.max() < 1e-5
    is_boundary = cells[:, 0] == cells[:, 1]
    # 5 whole faces and 2 free squares of the coarse cell, 4 free faces of each fine cell.
    assert is_boundary.sum() == 5 + 2 + 8 and (~is_boundary).sum() == 3
    assert measures[is_boundary].sum() == pytest.approx(5 * 4 + 2 + 8)


@wp.func
def wanted_size(x: wp.vec3):
    return 4.0 * (wp.length(x) - 0.5)


def test_refinement_by_a_field_and_grading():
    grid, coarse = hierarchy()
    field = fem.ImplicitField(fem.Cells(grid), func=wanted_size)
    free = fem.adaptive_nanogrid_from_field(coarse, level_count=3, refinement_field=field)
    graded = fem.adaptive_nanogrid_from_field(coarse, 3, field, grading="face")
    assert graded.cell_count() == free.cell_count() + 7
    for one in (free, graded):
        _, volumes = cell_centers(one)
        assert sides_of(one)[-1].max() < 1e-5
        assert 3.0 < volumes.sum() <= 4.0
    with pytest.raises(ValueError, match="'grading' expects"):
        fem.adaptive_nanogrid_from_hierarchy([coarse, coarse], grading="edge")


def test_environments_lie_at_one_place():
    points = wp.array([[0, 0, 0], [1, 0, 0], [0, 0, 0], [9, 0, 0]], dtype=wp.vec3i)
    environments = wp.array([0, 0, 1, 0], dtype=int)
    mask = wp.array([1, 1, 1, 0], dtype=int)
    grid = fem.Nanogrid.from_environment_voxels(points, environments, 2, point_mask=mask)
    np.testing.assert_array_equal(grid.env_offsets.numpy(), [[0, 0, 0], [5, 0, 0]])
    centers, _ = cell_centers(grid)
    np.testing.assert_array_equal(grid.cell_env.numpy(), [0, 0, 1])
    np.testing.assert_allclose(centers, [[0, 0, 0], [1, 0, 0], [0, 0, 0]])
    with pytest.raises(ValueError, match=r"index 2 of point 1 is out of bounds"):
        bad = wp.array([0, 2, 0, 0], dtype=int)
        fem.Nanogrid.from_environment_voxels(points, bad, 2)


@fem.integrand
def one(s: fem.Sample, domain: fem.Domain):
    return 1.0 + domain(s)[0]


def test_rebuilt_grids_are_new_ones():
    first, second = voxels_of((2, 2, 1)), np.array([(5, 0, 0), (6, 0, 0), (0, 3, -2)])
    room = {"rebuildable": True, "max_active_voxels": 6}
    grid = fem.Nanogrid(volume(first, **room), rebuildable=True)
    assert grid.cell_count() == 6
    domain = fem.Cells(grid)
    total = fem.integrate(one, quadrature=fem.RegularQuadrature(domain, 1))
    assert total == pytest.approx(4 * 0.125 * 1.5)
    grid.rebuild(wp.array(second, dtype=wp.vec3i))
    fresh = fem.Nanogrid(volume(second))
    for left, right in zip(sides_of(grid), sides_of(fresh)):
        np.testing.assert_array_equal(left, right)
    total = fem.integrate(one, quadrature=fem.RegularQuadrature(domain, 1))
    expected = fem.integrate(one, quadrature=fem.RegularQuadrature(fem.Cells(fresh), 1))
    assert total == expected
    with pytest.raises(RuntimeError, match="not constructed in rebuildable mode"):
        fresh.rebuild(wp.array(second, dtype=wp.vec3i))


@fem.integrand
def mass(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s)


@fem.integrand
def stiffness(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(fem.grad(u, s), fem.grad(v, s))


def dense_matrix(form, geometry, degree):
    """A matrix as a NumPy array, and the positions of its nodes."""
    space = fem.make_polynomial_space(geometry, degree=degree)
    domain = fem.Cells(geometry)
    fields = {"u": fem.make_trial(space, domain=domain), "v": fem.make_test(space, domain=domain)}
    matrix = fem.integrate(form, fields=fields, output_dtype=float)
    out = np.zeros((space.node_count(), space.node_count()))
    offsets, columns = matrix.offsets.numpy(), matrix.columns.numpy()
    values = matrix.values.numpy().reshape(-1)
    for row in range(matrix.nrow):
        span = slice(offsets[row], offsets[row + 1])
        out[row, columns[span]] = values[span]
    return out, space.node_positions().numpy()


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("form", [mass, stiffness])
def test_matrices_are_those_of_a_dense_grid(form, degree):
    sparse = fem.Nanogrid(volume(voxels_of((3, 2, 4))))
    dense = fem.Grid3D(wp.vec3i(3, 2, 4), None, (1.5, 1.0, 2.0))
    (a, x), (b, y) = (dense_matrix(form, one, degree) for one in (sparse, dense))
    a_order, b_order = (np.lexsort(np.round(4.0 * p).T.astype(int)) for p in (x, y))
    np.testing.assert_allclose(x[a_order], y[b_order], atol=1e-6)
    np.testing.assert_array_equal(a[np.ix_(a_order, a_order)], b[np.ix_(b_order, b_order)])


def test_matrices_of_a_rebuilt_grid():
    second = np.array([(5, 0, 0), (6, 0, 0), (0, 3, -2)])
    room = {"rebuildable": True, "max_active_voxels": 6}
    grid = fem.Nanogrid(volume(voxels_of((2, 2, 1)), **room), rebuildable=True)
    grid.rebuild(wp.array(second, dtype=wp.vec3i))
    fresh = fem.Nanogrid(volume(second))
    a, b = dense_matrix(mass, grid, 1)[0], dense_matrix(mass, fresh, 1)[0]
    n = len(b)
    np.testing.assert_array_equal(a[:n, :n], b)
    assert not a[n:].any() and not a[:, n:].any()
