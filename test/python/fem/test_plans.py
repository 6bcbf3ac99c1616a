"""Plans agree: by points, by pairs of nodes, at nodes; operators of nodes."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
import warp.fem as fem


@fem.integrand
def elasticity(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.ddot(fem.D(u, s), fem.D(v, s)) + fem.div(u, s) * fem.div(v, s) + wp.dot(u(s), v(s))


@fem.integrand
def moved_to_node(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(fem.at_node(v, s))


@fem.integrand
def mass(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s)


@fem.integrand
def mixed(s: fem.Sample, u: fem.Field, q: fem.Field):
    return q(s) * fem.div(u, s) + wp.dot(fem.grad(q, s), u(s))


@fem.integrand
def load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    return wp.dot(v(s), domain(s)) + fem.div(v, s)


@fem.integrand
def jumps(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    n = fem.normal(domain, s)
    return wp.dot(fem.jump(u, s), fem.average(v, s)) + wp.dot(
        fem.grad_average(u, s) * n, fem.jump(v, s)
    )


def spaces(grid, degree):
    return fem.make_polynomial_space(grid, degree=degree, dtype=wp.vec2)


@pytest.mark.parametrize("degree", [1, 2])
def test_points_and_pairs_agree(degree):
    grid = fem.Grid2D(wp.vec2i(3, 2))
    space = spaces(grid, degree)
    fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
    one = fem.integrate(elasticity, fields=fields, assembly="dispatch")
    other = fem.integrate(elasticity, fields=fields, assembly="generic")
    np.testing.assert_allclose(one.values.numpy(), other.values.numpy(), atol=5e-6)
    fields = {"v": fields["v"]}
    one = fem.integrate(load, fields=fields, assembly="dispatch")
    other = fem.integrate(load, fields=fields, assembly="generic")
    np.testing.assert_allclose(one.numpy(), other.numpy(), atol=1e-6)


def test_mixed_spaces_agree():
    grid = fem.Grid2D(wp.vec2i(3, 2))
    pressure = fem.make_polynomial_space(grid, degree=1)
    fields = {"u": fem.make_trial(spaces(grid, 2)), "q": fem.make_test(pressure)}
    one = fem.integrate(mixed, fields=fields)
    other = fem.integrate(mixed, fields=fields, assembly="generic")
    assert one.block_shape == (1, 2)
    np.testing.assert_allclose(one.values.numpy(), other.values.numpy(), atol=1e-6)


def test_sides_agree():
    grid = fem.Grid2D(wp.vec2i(3, 2))
    space = fem.make_polynomial_space(grid, degree=1, dtype=wp.vec2, discontinuous=True)
    sides = fem.Sides(grid)
    fields = {"u": fem.make_trial(space, domain=sides), "v": fem.make_test(space, domain=sides)}
    one = fem.integrate(jumps, fields=fields)
    other = fem.integrate(jumps, fields=fields, assembly="generic")
    np.testing.assert_allclose(one.values.numpy(), other.values.numpy(), atol=2e-6)


def test_node_operators_select_the_plan_by_pairs():
    grid = fem.Grid2D(wp.vec2i(3, 2))
    space = fem.make_polynomial_space(grid, degree=1)
    fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
    matrix = fem.integrate(moved_to_node, fields=fields)
    # Each of the 4 test functions of a cell is 1 at its node.
    assert matrix.values.numpy().sum() == pytest.approx(4.0, rel=1e-6)
    with pytest.raises(ValueError, match="needs assembly='generic', not 'dispatch'"):
        fem.integrate(moved_to_node, fields=fields, assembly="dispatch")


@fem.integrand
def laplace(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(fem.grad(u, s), fem.grad(v, s))


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("is_vector", [False, True])
@pytest.mark.parametrize("is_warped", [False, True])
@pytest.mark.usefixtures("threads")
def test_symmetric_forms_have_symmetric_bits(degree, is_vector, is_warped):
    grid = fem.Grid2D(wp.vec2i(3, 2))
    if is_warped:
        rng = np.random.default_rng(degree)
        positions, quads = _quads()
        positions = positions + rng.uniform(-0.05, 0.05, positions.shape)
        grid = fem.Quadmesh2D(quads, wp.array(positions, dtype=wp.vec2))
    space = fem.make_polynomial_space(grid, degree=degree, dtype=wp.vec2 if is_vector else float)
    fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
    matrix = fem.integrate(elasticity if is_vector else laplace, fields=fields)
    dense = _dense(matrix)
    np.testing.assert_array_equal(dense, dense.T)
    other = _dense(
        fem.integrate(elasticity if is_vector else laplace, fields=fields, assembly="generic")
    )
    np.testing.assert_allclose(dense, other, atol=1e-5)


def _quads():
    x = np.stack(np.meshgrid(np.arange(4) / 3, np.arange(3) / 2, indexing="ij"), -1).reshape(-1, 2)
    cells = [
        [3 * i + j, 3 * (i + 1) + j, 3 * (i + 1) + j + 1, 3 * i + j + 1]
        for i in range(3)
        for j in range(2)
    ]
    return x, wp.array(cells, dtype=int)


def _dense(matrix):
    rows, columns = matrix.block_shape
    dense = np.zeros((matrix.nrow * rows, matrix.ncol * columns))
    offsets, values = matrix.offsets.numpy(), matrix.values.numpy().reshape(-1, rows, columns)
    for row in range(matrix.nrow):
        for at in range(offsets[row], offsets[row + 1]):
            column = matrix.columns.numpy()[at]
            dense[row * rows : (row + 1) * rows, column * columns : (column + 1) * columns] += (
                values[at]
            )
    return dense


@fem.integrand
def vector_mass(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(u(s), v(s))


@fem.integrand
def divided(s: fem.Sample, u: fem.Field, v: fem.Field, density: float):
    return wp.dot(fem.grad(u, s) / density, fem.grad(v, s))


@pytest.mark.parametrize("basis", ["NEDELEC_FIRST_KIND", "RAVIART_THOMAS"])
@pytest.mark.parametrize("is_simplex", [False, True])
def test_signed_families_agree(basis, is_simplex):
    positions, quads = _quads()
    mesh = fem.Quadmesh2D(quads, wp.array(positions, dtype=wp.vec2))
    if is_simplex:
        a, b, c, d = quads.numpy().T
        triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
        mesh = fem.Trimesh2D(wp.array(triangles, dtype=int), wp.array(positions, dtype=wp.vec2))
    space = fem.make_polynomial_space(mesh, element_basis=fem.ElementBasis[basis])
    fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
    one = fem.integrate(vector_mass, fields=fields)
    other = fem.integrate(vector_mass, fields=fields, assembly="generic")
    np.testing.assert_allclose(one.values.numpy(), other.values.numpy(), atol=1e-6)


def test_division_by_a_number_is_linear():
    space = fem.make_polynomial_space(fem.Grid2D(wp.vec2i(3, 2)), degree=1)
    fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
    one = fem.integrate(divided, fields=fields, values={"density": 4.0})
    other = fem.integrate(laplace, fields=fields)
    np.testing.assert_allclose(one.values.numpy(), 0.25 * other.values.numpy(), atol=1e-6)


def test_kernel_of_a_mass_has_no_gradients():
    from warp._src.fem.forms.form import Form

    positions, quads = _quads()
    a, b, c, d = quads.numpy().T
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    mesh = fem.Trimesh2D(wp.array(triangles, dtype=int), wp.array(positions, dtype=wp.vec2))
    space = fem.make_polynomial_space(mesh, degree=1)
    fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
    rule = fem.RegularQuadrature(fem.Cells(mesh), 2)
    form = Form(mass, fem.Cells(mesh), rule, fields, {}, wp.get_device())
    assert [slot.is_gradient for _, slot in form.plan.test.used_slots] == [False]
    assert "inverse" not in form.plan.blocks.ir("warp")
    assert form.plan.tensors.shape == (1, 9)


@fem.integrand
def squared_length(s: fem.Sample, u: fem.Field):
    return wp.dot(u(s), u(s))


@fem.integrand
def moment(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(u(s), v(s)) + wp.ddot(fem.grad(u, s), fem.grad(v, s))


@pytest.mark.parametrize(("name", "degree"), [("grid3", 7), ("tet", 8)])
def test_elements_of_more_numbers_than_an_array_of_a_thread(name, degree):
    """Sums and degrees of freedom of large elements are in arrays of the launch."""
    geo = programs.geometry(name, 1, wp.float64)
    space = fem.make_polynomial_space(geo, degree=degree, dtype=wp.vec3d)
    assert 3 * space.topology.MAX_NODES_PER_ELEMENT > 450
    x = space.node_positions().numpy()
    u = programs.field_of(space, np.stack([x[:, 0] ** 2, x[:, 1] * x[:, 2], 0.0 * x[:, 0]], -1))
    rule = fem.RegularQuadrature(fem.Cells(geo), order=8)
    total = fem.integrate(squared_length, quadrature=rule, fields={"u": u})
    assert total == pytest.approx(1.0 / 5.0 + 1.0 / 9.0, rel=1e-12)
    test = fem.make_test(space)
    r = fem.integrate(moment, quadrature=rule, fields={"u": u, "v": test}).numpy()
    # With v = u: the squares of the values and of the gradients.
    found = (r * u.dof_values.numpy()).sum()
    assert found == pytest.approx(total + 4.0 / 3.0 + 2.0 / 3.0, rel=1e-11)


@fem.integrand
def beside_a_field(s: fem.Sample, c: fem.Field, u: fem.Field, v: fem.Field):
    weight = c(s) + fem.grad(c, s)[0]
    if weight > 1.0e9:
        weight = 1.0
    return wp.dot(fem.grad(u, s), fem.grad(v, s))


def test_constant_coefficients_beside_a_field():
    """The plan by reference tensors evaluates no field; the form reads one in vain."""
    grid = fem.Grid2D(wp.vec2i(3, 2))
    space = fem.make_polynomial_space(grid, degree=2)
    fields = {"c": space.make_field(), "u": fem.make_trial(space), "v": fem.make_test(space)}
    one, other = (
        fem.integrate(beside_a_field, fields=fields, assembly=assembly)
        for assembly in ("dispatch", "generic")
    )
    np.testing.assert_allclose(one.values.numpy(), other.values.numpy(), atol=2e-6)


@fem.integrand
def weighted_by_element(s: fem.Sample, u: fem.Field, v: fem.Field, weights: wp.array(dtype=float)):
    return weights[s.element_index] * wp.dot(fem.grad(u, s), fem.grad(v, s)) + u(s) * v(s)


@fem.integrand
def numbered(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(fem.grad(u, s), fem.grad(v, s)) * float(s.element_index) + u(s) * v(s)


@fem.integrand
def plain(s: fem.Sample, u: fem.Field, v: fem.Field, weight: float):
    return weight * wp.dot(fem.grad(u, s), fem.grad(v, s)) + u(s) * v(s)


@pytest.mark.parametrize("entries", [1 << 20, 64])
@pytest.mark.parametrize("cells", ["all", "some"])
def test_equal_elements_of_grids(entries, cells, monkeypatch):
    """One element's matrix stands for all where elements do not differ, in any batches."""
    from warp._src.fem.assembly import pattern as patterns

    monkeypatch.setattr(patterns, "ENTRIES", entries)
    grid = fem.Grid3D(wp.vec3i(2, 3, 2), bounds_hi=wp.vec3(1.0, 2.0, 0.5))
    space, domain = fem.make_polynomial_space(grid, degree=2), fem.Cells(grid)
    if cells == "some":
        mask = wp.array([1, 0, 1, 1, 0, 1] * 2, dtype=int)
        domain = fem.Subdomain(domain, element_mask=mask)
    fields = programs.fields_of(space, domain)
    weights = {"weights": wp.full(12, 3.0, dtype=float)}
    one = fem.integrate(plain, fields=fields, values={"weight": 3.0})
    other = fem.integrate(weighted_by_element, fields=fields, values=weights)
    np.testing.assert_array_equal(one.columns.numpy(), other.columns.numpy())
    values = other.values.numpy()
    np.testing.assert_allclose(one.values.numpy(), values, atol=1e-6 * np.abs(values).max())
    # The same values with weights that do differ by element, which the coefficient tells.
    weights = {"weights": wp.array(np.arange(12), dtype=float)}
    one = fem.integrate(numbered, fields=fields)
    other = fem.integrate(weighted_by_element, fields=fields, values=weights)
    values = other.values.numpy()
    np.testing.assert_allclose(one.values.numpy(), values, atol=1e-6 * np.abs(values).max())
