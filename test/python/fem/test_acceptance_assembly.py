"""Assembled matrices: exact sparsity, equal bits, symmetry, actions, sums over parts."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem

PAIRS = [
    (name, degree) for name in ("grid2", "grid3", "tri", "quad", "tet", "hex") for degree in (1, 2)
]


def element_nodes(space):
    """Node numbers of each cell, through the topology's public function of kernels."""
    geo, topology = space.geometry, space.topology
    count = topology.MAX_NODES_PER_ELEMENT
    table = wp.zeros((geo.cell_count(), count), dtype=int)
    node_index = topology.element_node_index
    ElementArg, TopologyArg = geo.CellArg, topology.TopologyArg

    @wp.kernel(module="unique")
    def read(elements: ElementArg, arg: TopologyArg, table: wp.array2d(dtype=int)):
        e, k = wp.tid()
        table[e, k] = node_index(elements, arg, e, k)

    device = table.device
    inputs = [geo.cell_arg_value(device), topology.topo_arg_value(device), table]
    wp.launch(read, table.shape, inputs)
    return table.numpy()


def space_of(name, degree, scalar=wp.float32, n=3, **options):
    return fem.make_polynomial_space(
        programs.geometry(name, n, scalar), degree=degree, dtype=scalar, **options
    )


@pytest.mark.parametrize(("name", "degree"), PAIRS)
def test_sparsity_is_the_union_of_cells(name, degree):
    space = space_of(name, degree)
    matrix = fem.integrate(programs.mass, fields=programs.fields_of(space))
    expected = [set() for _ in range(space.node_count())]
    for nodes in element_nodes(space).tolist():
        for node in nodes:
            expected[node].update(nodes)
    offsets, columns = matrix.offsets.numpy(), matrix.columns.numpy()
    found = [columns[a:b].tolist() for a, b in zip(offsets[:-1], offsets[1:], strict=True)]
    assert found == [sorted(c) for c in expected]


@pytest.mark.parametrize("name", ["grid3", "tet", "hex"])
def test_equal_bits(name):
    fields = programs.fields_of(space_of(name, 2))
    first = fem.integrate(programs.diffusion, fields=fields)
    values = first.values.numpy()
    for construction in ("auto", "triplets", "row_compress", "mapped", "mapped_atomic"):
        options = {"construction": construction}
        again = fem.integrate(programs.diffusion, fields=fields, bsr_options=options)
        np.testing.assert_array_equal(again.values.numpy(), values)
        reuse = {"construction": construction, "capacity": "reuse"}
        fem.integrate(programs.diffusion, fields=fields, output=again, bsr_options=reuse)
        np.testing.assert_array_equal(again.values.numpy(), values)


@pytest.mark.parametrize(("name", "degree"), PAIRS)
def test_symmetric_forms_are_symmetric(name, degree):
    move = None if "grid" in name else programs.warped
    geo = programs.geometry(name, 3, wp.float32, move)
    space = fem.make_polynomial_space(geo, degree=degree)
    for form in (programs.diffusion, programs.mass):
        a = programs.dense(fem.integrate(form, fields=programs.fields_of(space)))
        np.testing.assert_allclose(a, a.T, atol=1e-7 * np.abs(a).max())


def test_scaling_by_a_power_of_two_keeps_the_bits():
    results = []
    for scale in (1.0, 2.0**-12):
        geo = programs.geometry(
            "hex", 3, wp.float32, lambda x, s=scale: s * programs.warped(x).astype(np.float32)
        )
        space = fem.make_polynomial_space(geo, degree=1)
        a = fem.integrate(programs.diffusion, fields=programs.fields_of(space))
        results.append(a.values.numpy() / np.float32(scale))
    np.testing.assert_array_equal(*results)


@fem.integrand
def convection(s: fem.Sample, u: fem.Field, v: fem.Field):
    g = fem.grad(u, s)
    return (g[0] + 2.0 * g[1]) * v(s)


@fem.integrand
def convection_transposed(s: fem.Sample, u: fem.Field, v: fem.Field):
    g = fem.grad(v, s)
    return (g[0] + 2.0 * g[1]) * u(s)


@pytest.mark.parametrize("name", ["grid2", "tri", "hex"])
def test_action_and_transpose(name):
    space = space_of(name, 2)
    fields = programs.fields_of(space)
    a = programs.dense(fem.integrate(convection, fields=fields))
    b = programs.dense(fem.integrate(convection_transposed, fields=fields))
    np.testing.assert_allclose(a, b.T, atol=3e-6 * np.abs(a).max())
    x = np.random.default_rng(0).standard_normal(space.node_count())
    u = programs.field_of(space, x)
    rule = fem.RegularQuadrature(fem.Cells(space.geometry), order=4)
    y = fem.integrate(convection, quadrature=rule, fields={"u": u, "v": fields["v"]}).numpy()
    exact = programs.dense(fem.integrate(convection, quadrature=rule, fields=fields)) @ x
    np.testing.assert_allclose(y, exact, atol=3e-6 * np.abs(exact).max())


def test_sum_over_parts_is_the_whole():
    space = space_of("grid3", 1, n=4)
    geo = space.geometry
    whole = programs.dense(fem.integrate(programs.diffusion, fields=programs.fields_of(space)))
    total = np.zeros_like(whole)
    mask = np.random.default_rng(1).integers(0, 2, geo.cell_count()).astype(np.int32)
    for part in (mask, 1 - mask):
        chosen = fem.Subdomain(fem.Cells(geo), element_mask=wp.array(part, dtype=int))
        fields = programs.fields_of(space, chosen)
        total += programs.dense(fem.integrate(programs.diffusion, fields=fields))
    np.testing.assert_allclose(total, whole, atol=3e-7)


@fem.integrand
def half_of_mass(s: fem.Sample, u: fem.Field, v: fem.Field):
    half = 0.25
    return (half + 0.5 * half) * u(s) * v(s) + 0.125 * v(s) * u(s)


@pytest.mark.parametrize("name", ["grid3", "tet"])
def test_literals_follow_float64(name):
    space = space_of(name, 2, wp.float64)
    fields = programs.fields_of(space)
    half = programs.dense(fem.integrate(half_of_mass, fields=fields))
    whole = programs.dense(fem.integrate(programs.mass, fields=fields))
    assert half.dtype == np.float64
    np.testing.assert_allclose(2.0 * half, whole, atol=1e-14 * np.abs(whole).max())
    assert whole.sum() == pytest.approx(1.0, abs=1e-14)


def test_nodal_assembly_is_diagonal():
    space = space_of("grid2", 1, n=4)
    fields = programs.fields_of(space)
    matrix = fem.integrate(programs.mass, fields=fields, assembly="nodal")
    np.testing.assert_array_equal(matrix.columns.numpy()[: space.node_count()], range(25))
    a = programs.dense(matrix)
    np.testing.assert_allclose(a.sum(), 1.0, rtol=1e-6)
    np.testing.assert_array_equal(a, np.diag(np.diag(a)))
    boundary = fem.BoundarySides(space.geometry)
    projector = fem.integrate(
        programs.mass, fields=programs.fields_of(space, boundary), assembly="nodal"
    )
    fixed = programs.on_boundary(space.node_positions().numpy())
    np.testing.assert_array_equal(np.diag(programs.dense(projector)) > 0.0, fixed)
