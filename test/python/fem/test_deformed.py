"""Deformed geometries: rigid motions, curved cells, look-up, gradients by the field."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem
from box_meshes import box_mesh
from warp._src.fem.types import make_free_sample

ANGLE = 0.7
TURN = np.array([[np.cos(ANGLE), -np.sin(ANGLE), 0], [np.sin(ANGLE), np.cos(ANGLE), 0], [0, 0, 1]])
SHIFT = np.array([1.0, -2.0, 0.5])


def make_geometry(kind, real):
    if kind.startswith("grid"):
        grid = fem.Grid2D if kind == "grid2" else fem.Grid3D
        counts = wp.vec2i(3, 4) if kind == "grid2" else wp.vec3i(3, 2, 2)
        return grid(counts, scalar_type=real)
    cells, positions = box_mesh(kind, 2, 0.2, seed=1)
    d = positions.shape[1]
    mesh = {"triangle": fem.Trimesh2D, "tet": fem.Tetmesh, "cube": fem.Hexmesh}[kind]
    return mesh(wp.array(cells), wp.array(positions, dtype=wp.types.vector(d, real)))


def deformed(kind, real, degree, move, relative=False):
    base = make_geometry(kind, real)
    d = base.dimension
    space = fem.make_polynomial_space(base, dtype=wp.types.vector(d, real), degree=degree)
    field = space.make_field()
    x = space.node_positions().numpy()
    y = move(x) - (x if relative else 0.0)
    field.dof_values = wp.array(y, dtype=wp.types.vector(d, real), requires_grad=True)
    return field.make_deformed_geometry(relative=relative), base, field


def rigid(x):
    d = x.shape[1]
    return x @ (2.0 * TURN[:d, :d]).T + SHIFT[:d]


def bend(x):
    y = x.copy()
    y[:, 0] += 0.3 * x[:, 1] ** 2
    y[:, 1] += 0.1 * np.sin(2.0 * x[:, 0])
    return y


@fem.integrand
def one(s: fem.Sample, domain: fem.Domain):
    return 1.0 + 0.0 * domain(s)[0]


@fem.integrand
def flux(s: fem.Sample, domain: fem.Domain):
    return wp.dot(domain(s), fem.normal(domain, s))


KINDS = ["grid2", "grid3", "triangle", "tet", "cube"]


@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("real", [wp.float32, wp.float64])
@pytest.mark.parametrize("kind", KINDS)
def test_rigid_motion_scales_measures(kind, real, relative):
    moved, base, _ = deformed(kind, real, 1, rigid, relative)
    d, tolerance = base.dimension, 2e-5 if real is wp.float32 else 1e-12
    rules = [fem.RegularQuadrature(fem.Cells(g), 2) for g in (moved, base)]
    volumes = [fem.integrate(one, quadrature=rule) for rule in rules]
    assert volumes[0] == pytest.approx(2.0**d * volumes[1], rel=tolerance)
    rules = [fem.RegularQuadrature(fem.BoundarySides(g), 2) for g in (moved, base)]
    areas = [fem.integrate(one, quadrature=rule) for rule in rules]
    assert areas[0] == pytest.approx(2.0 ** (d - 1) * areas[1], rel=tolerance)


def mirror(x):
    """Cells with negative Jacobians, whose normals have to point outward, too."""
    return bend(x) * np.array([-1.0, 1.0, 1.0])[: x.shape[1]]


@pytest.mark.parametrize("move", [bend, mirror])
@pytest.mark.parametrize("kind", KINDS)
def test_flux_of_positions_is_the_volume(kind, move):
    moved, base, _ = deformed(kind, wp.float64, 2, move)
    volume = fem.integrate(one, quadrature=fem.RegularQuadrature(fem.Cells(moved), 8))
    through = fem.integrate(flux, quadrature=fem.RegularQuadrature(fem.BoundarySides(moved), 8))
    assert through == pytest.approx(base.dimension * volume, rel=1e-10)


@pytest.mark.parametrize("kind", KINDS)
def test_lookup_finds_points_of_curved_cells(kind):
    moved, base, _ = deformed(kind, wp.float64, 2, bend)
    moved.build_bvh()
    f, d = moved.functions, base.dimension
    vector, CellArg = wp.types.vector(d, wp.float64), moved.CellArg
    rng = np.random.default_rng(0)
    n = 300
    cells = rng.integers(base.cell_count(), size=n).astype(np.int32)
    p = rng.dirichlet(np.ones(d + 1), size=n) * 0.98 + 0.005
    coords = np.zeros((n, 3))
    coords[:, :d] = p[:, :d]
    if kind == "triangle":
        coords = p / p.sum(axis=1)[:, None]

    @wp.kernel
    def find(
        arg: CellArg,
        cells: wp.array(dtype=int),
        coords: wp.array(dtype=wp.vec3d),
        found: wp.array(dtype=int),
        errors: wp.array(dtype=wp.float64),
        gaps: wp.array(dtype=wp.float64),
    ):
        i = wp.tid()
        x = f.cell_position(arg, make_free_sample(cells[i], coords[i]))
        s = f.cell_lookup(arg, x)
        found[i] = s.element_index
        errors[i] = wp.length(s.element_coords - coords[i])
        far = x
        far[0] += wp.float64(10.0)
        near = f.cell_lookup(arg, far)
        gaps[i] = wp.length(f.cell_position(arg, near) - far)

    found = wp.zeros(n, dtype=int)
    errors, gaps = wp.zeros(n, dtype=wp.float64), wp.zeros(n, dtype=wp.float64)
    inputs = [moved.cell_arg_value(), wp.array(cells), wp.array(coords, dtype=wp.vec3d)]
    wp.launch(find, n, inputs, [found, errors, gaps])
    np.testing.assert_array_equal(found.numpy(), cells)
    assert errors.numpy().max() < 1e-10
    assert (gaps.numpy() > 7.0).all() and (gaps.numpy() < 11.0).all()


@pytest.mark.parametrize("kind", ["grid2", "tet"])
def test_gradient_of_the_volume_by_the_field(kind):
    moved, _, field = deformed(kind, wp.float64, 2, bend)
    quadrature = fem.RegularQuadrature(fem.Cells(moved), 6)

    def volume(out=None):
        return fem.integrate(one, quadrature=quadrature, output=out)

    total = wp.zeros(1, dtype=wp.float64, requires_grad=True)
    with wp.Tape() as tape:
        volume(total)
    tape.backward(total)
    gradient = field.dof_values.grad.numpy()
    rng = np.random.default_rng(1)
    values = field.dof_values.numpy()
    direction = rng.standard_normal(values.shape)
    sums = []
    for step in (1e-5, -1e-5):
        dtype = field.dof_values.dtype
        field.dof_values = wp.array(values + step * direction, dtype=dtype)
        sums.append(volume())
    assert np.sum(gradient * direction) == pytest.approx((sums[0] - sums[1]) / 2e-5, rel=1e-7)


def test_a_field_of_numbers_is_refused():
    grid = fem.Grid2D(wp.vec2i(2, 2))
    field = fem.make_polynomial_space(grid).make_field()
    with pytest.raises(ValueError, match="'field' expects values of vec2"):
        field.make_deformed_geometry()


@fem.integrand
def advection(s: fem.Sample, u: fem.Field, v: fem.Field):
    return -u(s) * (fem.grad(v, s)[0] + 0.5 * fem.grad(v, s)[1])


@fem.integrand
def upwind(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    n = fem.normal(domain, s)
    speed = n[0] + 0.5 * n[1]
    return (fem.average(u, s) * speed + 0.5 * wp.abs(speed) * fem.jump(u, s)) * fem.jump(v, s)


def dense(matrix):
    offsets, columns, values = (a.numpy() for a in (matrix.offsets, matrix.columns, matrix.values))
    made = np.zeros(matrix.shape)
    for r in range(matrix.nrow):
        part = slice(offsets[r], offsets[r + 1])
        made[r, columns[part]] = values[part]
    return made


def test_discontinuous_positions_make_a_torus():
    """Vertices wrap around, positions do not: upwind advection conserves mass, keeps constants and
    adds no energy."""
    n = 5
    corners = np.array([(0, 0), (0, 1), (1, 0), (1, 1)])
    cells = np.array([(i, j) for i in range(n) for j in range(n)])
    around = (cells[:, None] + corners[[0, 2, 3, 1]]) % n
    base = fem.Quadmesh2D(
        wp.array(around[..., 0] * n + around[..., 1], dtype=int),
        wp.array(cells / n, dtype=wp.vec2d),
    )
    space = fem.make_polynomial_space(base, degree=1, dtype=wp.vec2d, discontinuous=True)
    field = space.make_field()
    field.dof_values = wp.array(((cells[:, None] + corners) / n).reshape(-1, 2), dtype=wp.vec2d)
    torus = field.make_deformed_geometry(relative=False)
    assert torus.boundary_side_count() == 0 and torus.side_count() == 2 * n * n
    assert fem.integrate(one, domain=fem.Cells(torus)) == pytest.approx(1.0, rel=1e-13)
    space = fem.make_polynomial_space(torus, degree=2, dtype=wp.float64, discontinuous=True)
    matrices = []
    for form, domain in ((advection, fem.Cells(torus)), (upwind, fem.Sides(torus))):
        fields = {
            "u": fem.make_trial(space, domain=domain),
            "v": fem.make_test(space, domain=domain),
        }
        matrices.append(dense(fem.integrate(form, fields=fields)))
    whole = sum(matrices)
    ones = np.ones(len(whole))
    np.testing.assert_allclose(whole @ ones, 0.0, atol=1e-13)
    np.testing.assert_allclose(ones @ whole, 0.0, atol=1e-13)
    assert np.linalg.eigvalsh(whole + whole.T).min() > -1e-13
