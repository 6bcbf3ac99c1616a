"""Element matrices axis by axis and row by row against the plan by pairs, in float64."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem
from warp._src.fem.forms.factored import factored_text
from warp._src.fem.forms.form import Form

REAL = wp.float64


@fem.integrand
def convection(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field, p: fem.Field):
    """Values and gradients of both functions; not symmetric."""
    x = fem.position(domain, s)
    slope = fem.grad(u, s)
    total = p(s) * wp.dot(slope, fem.grad(v, s)) + u(s) * v(s)
    return total + (slope[0] + x[0] * slope[1]) * v(s)


@fem.integrand
def diffusion(s: fem.Sample, u: fem.Field, v: fem.Field, p: fem.Field):
    return p(s) * wp.dot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def elasticity(s: fem.Sample, u: fem.Field, v: fem.Field, p: fem.Field):
    return p(s) * (wp.ddot(fem.D(u, s), fem.D(v, s)) + fem.div(u, s) * fem.div(v, s))


@fem.integrand
def divergence(s: fem.Sample, u: fem.Field, v: fem.Field, p: fem.Field):
    return p(s) * fem.div(u, s) * v(s)


CASES = {
    "convection": (convection, "hex", 2, 2, 1, 1),
    "degrees": (convection, "hex", 3, 2, 1, 1),
    "symmetric": (diffusion, "hex", 3, 3, 1, 1),
    "squares": (convection, "quad", 4, 4, 1, 1),
    "elasticity": (elasticity, "hex", 2, 2, 3, 3),
    "pressure": (divergence, "hex", 2, 2, 3, 1),
}


def case(name):
    form, cells, trial_degree, test_degree, *sizes = CASES[name]
    geo = programs.geometry(cells, 1, move=programs.warped)
    spaces = []
    for degree, size in zip((trial_degree, test_degree), sizes, strict=True):
        dtype = REAL if size == 1 else wp.types.vector(size, REAL)
        spaces.append(fem.make_polynomial_space(geo, degree=degree, dtype=dtype))
    p = fem.make_polynomial_space(geo, degree=1, dtype=REAL).make_field()
    values = np.random.default_rng(1).uniform(1.0, 2.0, p.dof_values.shape[0])
    p.dof_values = wp.array(values, dtype=REAL, requires_grad=True)
    fields = {"u": fem.make_trial(spaces[0]), "v": fem.make_test(spaces[1]), "p": p}
    return form, fem.RegularQuadrature(fem.Cells(geo), order=2 * trial_degree + 1), fields


@pytest.mark.parametrize("name", CASES)
def test_matrix_equals_that_by_pairs(name, threads):
    form, rule, fields = case(name)
    made = Form(form, rule.domain, rule, fields, {}, "cpu")
    by_axes, by_rows = factored_text(made.plan) is not None, made.plan.row_blocks is not None
    assert by_axes if threads == "elements" else by_rows
    found = programs.dense(fem.integrate(form, quadrature=rule, fields=fields))
    exact = programs.dense(fem.integrate(form, quadrature=rule, fields=fields, assembly="generic"))
    np.testing.assert_allclose(found, exact, rtol=1e-11, atol=1e-12 * np.abs(exact).max())
    if name in ("symmetric", "elasticity"):
        assert (found == found.T).all()


@pytest.mark.parametrize("name", ["symmetric", "convection", "elasticity"])
def test_gradient_by_a_coefficient(name, threads):
    """The matrix is linear in the coefficient: differences are exact up to rounding."""
    form, rule, fields = case(name)
    p, rng = fields["p"], np.random.default_rng(5)
    start = p.dof_values.numpy()
    step = rng.uniform(-1.0, 1.0, start.shape)

    with wp.Tape() as tape:
        matrix = fem.integrate(form, quadrature=rule, fields=fields)
    weights = rng.uniform(-1.0, 1.0, matrix.values.numpy().shape)
    grad = wp.array(weights, dtype=matrix.values.dtype)
    tape.backward(grads={matrix.values: grad})
    found = p.dof_values.grad.numpy() @ step

    ends = []
    for sign in (1.0, -1.0):
        p.dof_values = wp.array(start + 0.5 * sign * step, dtype=REAL)
        moved = fem.integrate(form, quadrature=rule, fields=fields)
        ends.append((moved.values.numpy() * weights).sum())
    assert found == pytest.approx(ends[0] - ends[1], rel=1e-9)
