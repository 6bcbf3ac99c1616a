"""Look-up in grids and meshes against brute force in float64, at all scales and forms."""

import itertools

import numpy as np
import pytest

import warp as wp
import warp.fem as fem
from box_meshes import box_mesh

MESHES = {"triangle": fem.Trimesh2D, "square": fem.Quadmesh2D, "tet": fem.Tetmesh}
MESHES["cube"] = fem.Hexmesh
SCALES = [(1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e3)]


def make(cell, real, scale=1.0, offset=0.0, n=4):
    """A mesh of n cells per axis, `offset` cells away from the origin, and its arrays."""
    cells, positions = box_mesh(cell, n, 0.3, seed=1)
    vector = wp.types.vector(positions.shape[1], real)
    array = wp.array((positions + offset / n) * scale, dtype=vector)
    mesh = MESHES[cell](wp.array(cells), array, build_bvh=True)
    return mesh, cells, array.numpy().astype(float)


def find(mesh, x):
    """Cells, coordinates and positions of a look-up."""
    f, real = mesh.functions, mesh.scalar_type
    vector, CellArg = wp.types.vector(mesh.dimension, real), mesh.CellArg
    lookup, position = f.cell_lookup, f.cell_position

    @wp.kernel(enable_backward=False)
    def kernel(
        arg: CellArg,
        x: wp.array(dtype=vector),
        cells: wp.array(dtype=int),
        coords: wp.array(dtype=mesh.coords_type),
        near: wp.array(dtype=vector),
    ):
        i = wp.tid()
        s = lookup(arg, x[i])
        cells[i] = s.element_index
        coords[i] = s.element_coords
        near[i] = position(arg, s)

    n = len(x)
    outputs = [wp.zeros(n, dtype=dtype) for dtype in (int, mesh.coords_type, vector)]
    wp.launch(kernel, n, [mesh.cell_arg_value(wp.get_device()), wp.array(x, dtype=vector)], outputs)
    return [array.numpy() for array in outputs]


def sample(positions, real, n, margin):
    rng = np.random.default_rng(3)
    low, high = positions.min(axis=0), positions.max(axis=0)
    x = low - margin * (high - low)
    x = x + rng.random((n, len(low))) * (high - low) * (1.0 + 2.0 * margin)
    return x.astype(np.float32 if real is wp.float32 else np.float64).astype(float)


@pytest.mark.parametrize("scale, offset", SCALES)
@pytest.mark.parametrize("real", [wp.float32, wp.float64])
@pytest.mark.parametrize("cell", ["triangle", "tet"])
def test_cells_and_coordinates_of_simplices(cell, real, scale, offset):
    mesh, cells, positions = make(cell, real, scale, offset, 3)
    # As many at one scale as have found rare defects, fewer at others.
    many = scale == 1.0 and not offset and cell == "triangle"
    x = sample(positions, real, 100_000 if many else 10_000, 0.0)
    got, coords, _ = find(mesh, x)
    best = np.full(len(x), -1)
    exact = np.zeros((len(x), x.shape[1] + 1))
    margins = np.full(len(x), np.inf)
    for number, corners in enumerate(positions[cells]):
        inverse = np.linalg.inv((corners[1:] - corners[0]).T)
        b = (x - corners[0]) @ inverse.T
        b = np.column_stack((1.0 - b.sum(axis=1), b))
        lowest = b.min(axis=1)
        inside = (lowest >= 0.0) & (best < 0)
        best[inside], exact[inside] = number, b[inside]
        margins = np.minimum(margins, np.abs(lowest))
    clear = (best >= 0) & (margins > 1e-5)
    assert clear.mean() > 0.7
    np.testing.assert_array_equal(got[clear], best[clear])
    expected = exact if cell == "triangle" else exact[:, 1:]
    np.testing.assert_allclose(
        coords[clear], expected[clear], atol=1e-5 if real is wp.float32 else 1e-10
    )


@pytest.mark.parametrize("scale, offset", SCALES)
@pytest.mark.parametrize("real", [wp.float32, wp.float64])
@pytest.mark.parametrize("cell", MESHES)
def test_points_outside_have_the_distance_of_the_boundary(cell, real, scale, offset):
    mesh, _, positions = make(cell, real, scale, offset, 2)
    x = sample(positions, real, 150, 0.4)
    _, _, near = find(mesh, x)
    size = scale / 2.0
    got = np.linalg.norm(near - x, axis=1) / size
    sides = mesh._sides.vertices.numpy()[mesh._sides.boundary.numpy()]
    steps = np.linspace(0.0, 1.0, 21)
    weights = np.array(list(itertools.product(steps, repeat=mesh.dimension - 1)))
    if cell == "tet":
        weights = weights[weights.sum(axis=1) <= 1.0 + 1e-9]
    expected = np.full(len(x), np.inf)
    for p in positions[sides]:
        s = weights[:, :1]
        points = p[0] + s * (p[1] - p[0])
        if cell in ("tet", "cube"):
            t = weights[:, 1:]
            points = points + t * (p[-1] - p[0])
            points += 0.0 if cell == "tet" else s * t * (p[0] - p[1] + p[2] - p[3])
        gaps = np.linalg.norm(x[:, None] - points, axis=2).min(axis=1)
        expected = np.minimum(expected, gaps)
    outside = got > 1e-3
    assert outside.mean() > 0.4
    # Samples of the boundary are never nearer than the closest point, and hardly farther.
    rounding = 1e-4 if real is wp.float32 else 1e-9
    assert (expected[outside] / size - got[outside] > -rounding).all()
    assert (expected[outside] / size - got[outside] < 0.05).all()


@pytest.mark.parametrize("cell", MESHES)
def test_points_of_faces_go_to_the_lowest_cell(cell):
    cells, positions = box_mesh(cell, 4, 0.0, seed=1)
    vector = wp.types.vector(positions.shape[1], wp.float32)
    mesh = MESHES[cell](wp.array(cells), wp.array(positions, dtype=vector), build_bvh=True)
    got, _, near = find(mesh, positions)
    lowest = [np.flatnonzero((cells == v).any(axis=1)).min() for v in range(len(positions))]
    np.testing.assert_array_equal(got, lowest)
    np.testing.assert_allclose(near, positions, atol=1e-6)


@pytest.mark.parametrize("cell", MESHES)
def test_a_guess_finds_the_same(cell):
    mesh, cells, positions = make(cell, wp.float32)
    x = sample(positions, wp.float32, 2000, 0.3)
    f, CellArg = mesh.functions, mesh.CellArg
    vector, lookup = wp.types.vector(mesh.dimension, wp.float32), f.cell_lookup
    count = len(cells)

    @wp.kernel(enable_backward=False)
    def compare(arg: CellArg, x: wp.array(dtype=vector), same: wp.array(dtype=int)):
        i = wp.tid()
        s = lookup(arg, x[i])
        guess = s
        guess.element_index = (7 * i) % count
        t = lookup(arg, x[i], guess)
        gap = wp.length(f.cell_position(arg, s) - f.cell_position(arg, t))
        same[i] = wp.where(gap < 1.0e-5, 1, 0)

    same = wp.zeros(len(x), dtype=int)
    wp.launch(
        compare, len(x), [mesh.cell_arg_value(wp.get_device()), wp.array(x, dtype=vector)], [same]
    )
    assert same.numpy().all()


@pytest.mark.parametrize("kind", ["mesh", "grid"])
def test_filters_choose_among_cells(kind):
    if kind == "mesh":
        mesh, _, positions = make("tet", wp.float32, n=3)
    else:
        mesh, positions = fem.Grid3D(wp.vec3i(3)), np.array([[0.0] * 3, [1.0] * 3])
    x = sample(positions, wp.float32, 500, 0.2)
    chosen = np.random.default_rng(0).random(mesh.cell_count()) < 0.3
    f, CellArg = mesh.functions, mesh.CellArg

    @wp.kernel(enable_backward=False)
    def compare(
        arg: CellArg,
        x: wp.array(dtype=wp.vec3),
        mask: wp.array(dtype=int),
        count: int,
        cells: wp.array(dtype=int),
        gaps: wp.array(dtype=float),
        least: wp.array(dtype=float),
    ):
        i = wp.tid()
        s = f.cell_lookup(arg, x[i], 10.0, mask, 1)
        cells[i] = s.element_index
        gaps[i] = wp.length(f.cell_position(arg, s) - x[i])
        best = float(1.0e30)
        for cell in range(count):
            if mask[cell] == 1:
                _coords, distance_sq = f.cell_closest_point(arg, cell, x[i])
                best = wp.min(best, distance_sq)
        least[i] = wp.sqrt(best)

    mask = wp.array(chosen.astype(np.int32))
    inputs = [
        mesh.cell_arg_value(wp.get_device()),
        wp.array(x, dtype=wp.vec3),
        mask,
        mesh.cell_count(),
    ]
    outputs = [wp.zeros(len(x), dtype=dtype) for dtype in (int, float, float)]
    wp.launch(compare, len(x), inputs, outputs)
    cells, gaps, least = (array.numpy() for array in outputs)
    assert chosen[cells].all()
    np.testing.assert_allclose(gaps, least, atol=2e-6)


@pytest.mark.parametrize("cell", MESHES)
def test_gradients_of_coordinates_by_positions_and_vertices(cell):
    real = wp.float64
    cells, vertices = box_mesh(cell, 2, 0.3, seed=1)
    vector = wp.types.vector(vertices.shape[1], real)
    positions = wp.array(vertices, dtype=vector, requires_grad=True)
    mesh = MESHES[cell](wp.array(cells), positions, build_bvh=True)
    lookup, CellArg = mesh.functions.cell_lookup, mesh.CellArg

    @wp.kernel
    def read(arg: CellArg, x: wp.array(dtype=vector), total: wp.array(dtype=real)):
        c = lookup(arg, x[wp.tid()]).element_coords
        wp.atomic_add(total, 0, c[0] * c[0] + real(2.0) * c[1] * c[2] + c[1])

    rng = np.random.default_rng(0)
    x = 0.1 + 0.8 * rng.random((20, vertices.shape[1]))

    def total(x, vertices, tape=None):
        positions.assign(wp.array(vertices, dtype=vector))
        points = wp.array(x, dtype=vector, requires_grad=True)
        out = wp.zeros(1, dtype=real, requires_grad=True)
        with wp.Tape() as tape:
            wp.launch(read, len(x), [mesh.cell_arg_value(wp.get_device()), points], [out])
        tape.backward(out)
        return out.numpy()[0], points.grad.numpy(), positions.grad.numpy().copy()

    _, by_points, by_vertices = total(x, vertices)
    step = 1e-6
    for by, shift in (
        (by_points, lambda s, d: (x + s * d, vertices)),
        (by_vertices, lambda s, d: (x, vertices + s * d)),
    ):
        direction = rng.standard_normal(by.shape)
        above, below = (total(*shift(s, direction))[0] for s in (step, -step))
        assert np.sum(by * direction) == pytest.approx((above - below) / (2 * step), rel=1e-6)


@fem.integrand
def moved(s: fem.Sample, domain: fem.Domain, u: fem.Field, velocity: fem.Field):
    return u(fem.lookup(domain, domain(s) - velocity(s), guess=s))


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("kind", ["grid", "mesh"])
def test_gradients_of_moved_points_at_all_borders(kind, degree):
    """The derivative of u(x - v) by v at v = 0 is -grad u, at upper borders, too."""
    if kind == "grid":
        geometry = fem.Grid2D(res=wp.vec2i(4, 3))
    else:
        geometry = make("square", wp.float32)[0]
    space = fem.make_polynomial_space(geometry, degree=degree)
    u, out = fem.make_discrete_field(space), fem.make_discrete_field(space)
    velocity = fem.make_discrete_field(
        fem.make_polynomial_space(geometry, degree=degree, dtype=wp.vec2)
    )
    x = space.node_positions().numpy().astype(float)
    values = x[:, 0] + 2.0 * x[:, 1]
    u.dof_values.assign(values.astype(np.float32))
    velocity.dof_values.requires_grad = out.dof_values.requires_grad = True
    with wp.Tape() as tape:
        fem.interpolate(moved, fields={"u": u, "velocity": velocity}, dest=out)
    tape.backward(grads={out.dof_values: wp.ones(len(x))})
    np.testing.assert_allclose(out.dof_values.numpy(), values, atol=2e-6)
    expected = np.broadcast_to([-1.0, -2.0], (len(x), 2))
    np.testing.assert_allclose(velocity.dof_values.grad.numpy(), expected, atol=5e-5)
