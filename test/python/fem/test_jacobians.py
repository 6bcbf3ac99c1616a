"""Matrices of interpolation applied to degrees of freedom give the interpolated values."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem
from warp.sparse import bsr_mv, bsr_zeros


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
