"""Forms whose values pass through arrays of the thread that are too long for registers: their
coefficients, and what is linear, are found through the memory."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem

REAL = wp.float64
COUNT = 200


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
