"""Forms whose values pass through arrays of the thread that are too long for registers: their
coefficients, and what is linear, are found through the memory."""

from typing import Any

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import extend, fem

REAL = wp.float64
COUNT, CELLS = 200, 3
gradient_by = extend.gradient_by


@fem.integrand
def by_memory(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    x = fem.position(domain, s)
    kept = wp.zeros(shape=(COUNT,), dtype=REAL)
    for i in range(COUNT):
        kept[(i * 7) % COUNT] = x[0] * REAL(i) + x[1]
    c = REAL(0.0)
    for i in range(COUNT):
        c += kept[i] * kept[(i + 3) % COUNT]
    return c * wp.dot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def by_formula(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    x = fem.position(domain, s)
    c = REAL(0.0)
    for i in range(COUNT):
        # 7 times 143 is 1 modulo 200.
        a, b = (i * 143) % COUNT, ((i + 3) * 143) % COUNT
        c += (x[0] * REAL(a) + x[1]) * (x[0] * REAL(b) + x[1])
    return c * wp.dot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def function_in_memory(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    """A sum over memory that is linear in both functions."""
    kept = wp.zeros(shape=(COUNT,), dtype=REAL)
    for i in range(COUNT):
        if i % 2 == 0:
            kept[i] = REAL(i) * u(s)
    total = REAL(0.0)
    for i in range(COUNT):
        total += kept[i] * v(s)
    return total


@fem.integrand
def square(s: fem.Sample, u: fem.Field, v: fem.Field):
    kept = wp.zeros(shape=(COUNT,), dtype=REAL)
    for i in range(COUNT):
        kept[i] = u(s) * REAL(i)
    total = REAL(0.0)
    for i in range(COUNT):
        total += kept[i] * kept[COUNT - 1 - i]
    return total * v(s)


@fem.integrand
def with_constant(s: fem.Sample, u: fem.Field, v: fem.Field):
    kept = wp.zeros(shape=(COUNT,), dtype=REAL)
    for i in range(COUNT):
        kept[i] = u(s) * REAL(i)
    total = REAL(1.0)
    for i in range(COUNT):
        total += kept[i]
    return total * v(s)


@pytest.mark.parametrize("order", [None, 6])
@pytest.mark.parametrize("name", ["tri", "tet", "grid2", "quad"])
def test_coefficients_pass_through_memory(name, order):
    geometry = programs.geometry(name, 2)
    space = fem.make_polynomial_space(geometry, degree=1, dtype=REAL)
    cells, fields = fem.Cells(geometry), programs.fields_of(space)
    found, expected = (
        programs.matrix_of(form, fields, cells, order) for form in (by_memory, by_formula)
    )
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-9)


def test_functions_pass_through_memory():
    space = fem.make_polynomial_space(programs.geometry("tri", 2), degree=2, dtype=REAL)
    fields = programs.fields_of(space)
    found = programs.matrix_of(function_in_memory, fields)
    scale = sum(range(0, COUNT, 2))
    np.testing.assert_allclose(found, scale * programs.matrix_of(programs.mass, fields), atol=1e-12)


@pytest.mark.parametrize(
    ("form", "reason"), [(square, "not linear"), (with_constant, "a term does not")]
)
def test_forms_that_are_not_linear_in_memory(form, reason):
    space = fem.make_polynomial_space(programs.geometry("tri", 2), degree=1, dtype=REAL)
    with pytest.raises(Exception, match=reason):
        fem.integrate(form, fields=programs.fields_of(space))


# Derivatives within a form keep what loops over nodes compute in memory.


@wp.func
def value_at(c: wp.vec3d, u: fem.Field, s: Any):
    return u(fem.make_free_sample(s.element_index, c))


@fem.integrand
def by_derivative(s: fem.Sample, u: fem.Field, v: fem.Field):
    slope = gradient_by(value_at, 1)(s.element_coords, u, s)[0]
    return wp.cos(REAL(CELLS) * slope[0]) * v(s)


@fem.integrand
def by_gradient(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.cos(fem.grad(u, s)[0]) * v(s)


@pytest.mark.parametrize("assembly", [None, "generic"])
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_gradients_of_fields_by_coordinates(degree, assembly):
    grid = fem.Grid2D(wp.vec2i(CELLS, 2), scalar_type=REAL)
    space = fem.make_polynomial_space(grid, degree=degree, dtype=REAL)
    u = programs.field_of(space, np.random.default_rng(0).random(space.node_count()))
    rule = fem.RegularQuadrature(fem.Cells(grid), 4)
    fields = {"u": u, "v": fem.make_test(space)}
    found, expected = (
        fem.integrate(form, quadrature=rule, fields=fields, assembly=assembly).numpy()
        for form in (by_derivative, by_gradient)
    )
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14)
