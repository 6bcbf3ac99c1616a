"""Matrices of interpolation applied to degrees of freedom give the interpolated values."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
import warp.fem as fem
from warp.sparse import bsr_copy, bsr_mv, bsr_zeros


@fem.integrand
def gradient(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    return fem.grad(u, s) * domain(s)[0]


@fem.integrand
def divergence(s: fem.Sample, u: fem.Field):
    return fem.div(u, s)


def field_of(space, seed):
    field = space.make_field()
    rng = np.random.default_rng(seed)
    shape = field.dof_values.numpy().shape
    field.dof_values.assign(rng.uniform(-1.0, 1.0, shape))
    return field


def test_values_at_points():
    grid = fem.Grid2D(wp.vec2i(3, 2))
    space = fem.make_polynomial_space(grid, degree=2)
    field, rule = field_of(space, 1), fem.RegularQuadrature(fem.Cells(grid), 2)
    count = rule.total_point_count()
    values = wp.zeros(count, dtype=wp.vec2)
    fem.interpolate(gradient, dest=values, at=rule, fields={"u": field})
    matrix = bsr_zeros(count, space.node_count(), wp.types.matrix((2, 1), wp.float32))
    fem.interpolate(gradient, dest=matrix, at=rule, fields={"u": fem.make_trial(space)})
    product = wp.zeros(count, dtype=wp.vec2)
    bsr_mv(matrix, field.dof_values, product)
    np.testing.assert_allclose(product.numpy(), values.numpy(), atol=2e-5)


@pytest.mark.parametrize("reduction", ["weighted_average", "mean", "sum", "first"])
def test_values_at_nodes(reduction):
    grid = fem.Grid2D(wp.vec2i(3, 2))
    space = fem.make_polynomial_space(grid, degree=2, dtype=wp.vec2)
    target = fem.make_polynomial_space(grid, degree=1)
    field, dest = field_of(space, 2), target.make_field()
    fem.interpolate(divergence, dest=dest, fields={"u": field}, reduction=reduction)
    matrix = bsr_zeros(target.node_count(), space.node_count(), wp.types.matrix((1, 2), wp.float32))
    fields = {"u": fem.make_trial(space)}
    fem.interpolate(divergence, dest=matrix, dest_space=target, fields=fields, reduction=reduction)
    product = wp.zeros(target.node_count(), dtype=wp.types.vector(1, wp.float32))
    bsr_mv(matrix, field.dof_values, product)
    np.testing.assert_allclose(product.numpy().ravel(), dest.dof_values.numpy(), atol=1e-4)


def test_reductions_that_are_not_linear_are_errors():
    grid = fem.Grid2D(wp.vec2i(3, 2))
    space = fem.make_polynomial_space(grid, degree=1, dtype=wp.vec2)
    target = fem.make_polynomial_space(grid, degree=1)
    matrix = bsr_zeros(12, 12, wp.types.matrix((1, 2), wp.float32))
    fields = {"u": fem.make_trial(space)}
    with pytest.raises(ValueError, match="'reduction' expects one of .* but got 'max'"):
        fem.interpolate(divergence, dest=matrix, dest_space=target, fields=fields, reduction="max")


@fem.integrand
def broken_value(s: fem.Sample, u: fem.Field):
    return u(s)


@pytest.mark.parametrize("capacity", ["auto", "reuse"])
@pytest.mark.parametrize("reduction", ["first", "mean"])
def test_rows_with_room_follow_their_elements(reduction, capacity):
    """A matrix whose rows have room takes those of other elements after a rebuild, too."""
    grid = fem.Grid3D(res=wp.vec3i(4))
    chosen = wp.array([1, 3, 5, 6], dtype=int)
    domain = fem.Subdomain(fem.Cells(grid), element_indices=chosen)
    space = fem.make_polynomial_space(grid, degree=2)
    broken = fem.make_polynomial_space(grid, degree=1, discontinuous=True)
    nodes = fem.make_space_restriction(space_topology=space.topology, domain=domain)
    trial = fem.make_trial(broken, domain=domain)

    def into(matrix, **options):
        places = {"dest_space": space, "at": nodes, "reduction": reduction}
        form = broken_value, matrix
        fem.interpolate(*form, fields={"u": trial}, bsr_options=options, **places)
        return programs.dense(bsr_copy(matrix))

    shape = space.node_count(), broken.node_count()
    roomy = bsr_zeros(*shape, block_type=float)
    into(roomy, topology="padded")
    for cells in ([0, 2, 4, 7], [63, 62, 61, 60]):
        chosen.assign(np.array(cells, dtype=np.int32))
        nodes.rebuild()
        found = into(roomy, topology="padded", capacity=capacity)
        assert roomy.status_sync() == 0
        np.testing.assert_array_equal(found, into(bsr_zeros(*shape, block_type=float)))
        # Values of hats at a point of a cell have the sum 1.
        sums = found.sum(axis=1)
        table = space.topology.element_node_indices().numpy()
        expected = np.isin(np.arange(shape[0]), table[cells])
        np.testing.assert_allclose(sums, expected, atol=1e-6)
