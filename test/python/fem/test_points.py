"""Bases of points: radial functions around particles, in one cell each."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem

RADIUS = 0.2


@wp.func
def hat(squared: float, point: int, radius: float):
    return wp.max(0.0, 1.0 - squared / (radius * radius)) * float(point + 1)


@wp.func
def hat_slope(squared: float, point: int, radius: float):
    inside = squared < radius * radius
    return wp.where(inside, -float(point + 1) / (radius * radius), 0.0)


@wp.func
def wrong(squared: int, point: int):
    return 1.0


def particles(scale=1.0):
    geometry = fem.Grid2D(wp.vec2i(2), bounds_hi=wp.vec2(scale))
    points = np.array([[0.1, 0.2], [0.2, 0.2], [0.8, 0.7]]) * scale
    quadrature = fem.PicQuadrature(fem.Cells(geometry), wp.array(points, dtype=wp.vec2))
    return geometry, quadrature, points


@fem.integrand
def value(s: fem.Sample, u: fem.Field):
    return u(s)


@fem.integrand
def gradient(s: fem.Sample, u: fem.Field):
    return fem.grad(u, s)


@pytest.mark.parametrize("space", ["reference", "world"])
def test_radial_functions(space):
    """Values at centres of cells are the sums over the points of the cell."""
    geometry, quadrature, points = particles(scale=2.0)
    basis = fem.PointBasisSpace(
        quadrature,
        kernel_func=hat,
        kernel_grad_func=hat_slope,
        kernel_values={"radius": RADIUS * 4.0},
        distance_space=space,
    )
    field = fem.make_collocated_function_space(basis).make_field()
    field.dof_values = wp.array([1.0, 2.0, 3.0], dtype=float)
    dest = fem.make_polynomial_space(geometry, degree=0).make_field()
    fem.interpolate(value, fields={"u": field}, dest=dest)
    slopes = fem.make_polynomial_space(geometry, degree=0, dtype=wp.vec2).make_field()
    fem.interpolate(gradient, fields={"u": field}, dest=slopes)
    centers = np.array([[0.5, 0.5], [0.5, 1.5], [1.5, 0.5], [1.5, 1.5]])
    expected, expected_slopes = np.zeros(4), np.zeros((4, 2))
    for k, (point, cell) in enumerate(zip(points, [0, 0, 3], strict=True)):
        delta = centers[cell] - point
        radius = RADIUS * 4.0
        weight = (k + 1) * (k + 1)
        expected[cell] += weight * max(0.0, 1.0 - delta @ delta / radius**2)
        inside = delta @ delta < radius**2
        expected_slopes[cell] -= weight * 2.0 * delta / radius**2 * inside
    np.testing.assert_allclose(dest.dof_values.numpy(), expected, rtol=1e-5)
    np.testing.assert_allclose(slopes.dof_values.numpy(), expected_slopes, rtol=1e-5)


def test_points_alone():
    """Without a radial function, a node counts at its point alone."""
    _, quadrature, _ = particles()
    space = fem.make_collocated_function_space(fem.PointBasisSpace(quadrature))
    assert space.node_count() == 3
    total = fem.integrate(value, quadrature=quadrature, fields={"u": fem.make_test(space)})
    np.testing.assert_allclose(total.numpy(), [0.125, 0.125, 0.25], rtol=1e-6)


def test_errors():
    geometry, quadrature, _ = particles()
    with pytest.raises(TypeError, match=r"must be \(float32, int32\), got \(int32, int32\)"):
        fem.PointBasisSpace(quadrature, kernel_func=wrong)
    with pytest.raises(ValueError, match="'kernel_values' expects"):
        fem.PointBasisSpace(quadrature, kernel_func=hat)
    with pytest.raises(ValueError, match="'reference' or 'world'"):
        fem.PointBasisSpace(quadrature, distance_space="screen")
    with pytest.raises(ValueError, match="need a domain of all cells"):
        fem.PointBasisSpace(fem.RegularQuadrature(fem.Sides(geometry), order=1))


def test_cells_without_points_count_nothing():
    """A quadrature of all cells sees the particles of their own cells alone."""
    geometry, quadrature, _ = particles()
    basis = fem.PointBasisSpace(quadrature, kernel_func=hat, kernel_values={"radius": 2.0})
    test = fem.make_test(fem.make_collocated_function_space(basis))
    centers = fem.RegularQuadrature(fem.Cells(geometry), order=0)
    total = fem.integrate(value, quadrature=centers, fields={"u": test}).numpy()
    # Squared distances of coordinates to the centres of the cells.
    squared = np.array([0.3**2 + 0.1**2, 0.1**2 + 0.1**2, 0.1**2 + 0.1**2])
    expected = 0.25 * np.array([1, 2, 3]) * (1.0 - squared / 4.0)
    np.testing.assert_allclose(total, expected, rtol=1e-5)
