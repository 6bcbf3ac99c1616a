"""Implicit differentiation: the compliance's derivative by the stiffness of each cell."""

import numpy as np

import fem_programs as programs
import warp as wp
from warp import fem
from warp.optim import linear


@fem.integrand
def stiffness(s: fem.Sample, u: fem.Field, v: fem.Field, c: wp.array(dtype=wp.float64)):
    return c[s.element_index] * wp.dot(fem.grad(u, s), fem.grad(v, s)) + u(s) * v(s)


@fem.integrand
def cell_energy(s: fem.Sample, u: fem.Field, e: int):
    g = fem.grad(u, s)
    if s.element_index == e:
        return wp.dot(g, g)
    return 0.0 * wp.dot(g, g)


@wp.kernel
def inner(
    x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float64)
):
    i = wp.tid()
    wp.atomic_add(out, 0, x[i] * y[i])


def test_gradient_of_the_compliance_is_minus_the_energy_of_cells():
    geo = programs.geometry("tri", 3, wp.float64, programs.warped)
    space = fem.make_polynomial_space(geo, degree=2, dtype=wp.float64)
    fields, n = programs.fields_of(space), space.node_count()
    rng = np.random.default_rng(1)
    c = wp.array(rng.uniform(1.0, 2.0, geo.cell_count()), dtype=wp.float64, requires_grad=True)
    b = wp.array(rng.standard_normal(n), dtype=wp.float64)
    x = wp.zeros(n, dtype=wp.float64, requires_grad=True)
    loss = wp.zeros(1, dtype=wp.float64, requires_grad=True)
    rule = fem.RegularQuadrature(fem.Cells(geo), order=4)
    with wp.Tape() as tape:
        K = fem.integrate(stiffness, quadrature=rule, fields=fields, values={"c": c})
        linear.cg(K, b, x, tol=1e-13, maxiter=1000)
        wp.launch(inner, n, [b, x], [loss])
    tape.backward(loss)
    u = programs.field_of(space, x.numpy())
    expected = [
        -fem.integrate(cell_energy, quadrature=rule, fields={"u": u}, values={"e": e})
        for e in range(geo.cell_count())
    ]
    np.testing.assert_allclose(c.grad.numpy(), expected, rtol=1e-5, atol=1e-10)
