"""Matrix-free operators against assembled matrices; fixed values against dense algebra."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem
from warp.optim import linear

RNG = np.random.default_rng(4)


@fem.integrand
def transport(s: fem.Sample, u: fem.Field, v: fem.Field, c: float):
    g = fem.grad(u, s)
    return (c * u(s) + g[0]) * v(s) + wp.dot(g, fem.grad(v, s))


@fem.integrand
def strain(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.ddot(fem.D(u, s), fem.D(v, s)) + wp.dot(u(s), v(s))


@fem.integrand
def divergence(s: fem.Sample, u: fem.Field, q: fem.Field):
    return q(s) * fem.div(u, s)


def scalar_case(name):
    space = fem.make_polynomial_space(programs.geometry(name, 3, wp.float32), degree=2)
    return transport, programs.fields_of(space), {"c": 2.0}


def vector_case(name):
    geo = programs.geometry(name, 2, wp.float32)
    dtype = wp.types.vector(length=geo.dimension, dtype=float)
    return strain, programs.fields_of(fem.make_polynomial_space(geo, degree=2, dtype=dtype)), {}


def mixed_case(name):
    geo = programs.geometry(name, 2, wp.float32)
    dtype = wp.types.vector(length=geo.dimension, dtype=float)
    u = fem.make_polynomial_space(geo, degree=2, dtype=dtype)
    q = fem.make_polynomial_space(geo, degree=1)
    domain = fem.Cells(geo)
    fields = {"u": fem.make_trial(u, domain=domain), "q": fem.make_test(q, domain=domain)}
    return divergence, fields, {}


CASES = [
    (make, name) for make in (scalar_case, vector_case, mixed_case) for name in ("grid3", "tri")
]


@pytest.mark.parametrize(("make", "name"), CASES)
def test_action_and_adjoint(make, name):
    form, fields, values = make(name)
    a = programs.dense(fem.integrate(form, fields=fields, values=values))
    A = fem.operator(form, fields, values)
    assert A.shape == a.shape
    x, y = RNG.standard_normal(a.shape[1]), RNG.standard_normal(a.shape[0])
    vectors = [wp.array(v, dtype=float) for v in (x, y)]
    scale = np.abs(a).max()
    found = A.apply(vectors[0]).numpy().ravel()
    np.testing.assert_allclose(found, a @ x, atol=2e-5 * scale)
    found = A.adjoint.apply(vectors[1]).numpy().ravel()
    np.testing.assert_allclose(found, a.T @ y, atol=2e-5 * scale)
    z = wp.empty(len(y), dtype=float)
    A.matvec(vectors[0], vectors[1], z, 2.0, -0.5)
    np.testing.assert_allclose(z.numpy(), 2 * a @ x - 0.5 * y, atol=4e-5 * max(scale, 1))


@pytest.mark.parametrize("make", [scalar_case, vector_case])
def test_diagonal(make):
    form, fields, values = make("tet")
    a = programs.dense(fem.integrate(form, fields=fields, values=values))
    diagonal = fem.operator(form, fields, values).diagonal().numpy().ravel()
    np.testing.assert_allclose(diagonal, np.diag(a), rtol=1e-5, atol=1e-6)
    form, fields, values = mixed_case("tri")
    with pytest.raises(ValueError, match="expects the same space"):
        fem.operator(form, fields, values).diagonal()


def test_solver_takes_an_operator():
    form, fields, values = vector_case("grid3")
    A = fem.operator(form, fields, values)
    x = RNG.standard_normal(A.shape[1])
    b = A.apply(wp.array(x, dtype=float)).view(float).flatten()
    found = wp.zeros(A.shape[1], dtype=float)
    linear.cg(A, b, found, tol=1e-7)
    np.testing.assert_allclose(found.numpy(), x, atol=2e-4)


def test_operator_wants_test_and_trial():
    form, fields, values = scalar_case("grid2")
    with pytest.raises(ValueError, match="expects a test and a trial function"):
        u = programs.field_of(fields["u"].space, np.zeros(fields["u"].space.node_count()))
        fem.operator(form, {**fields, "u": u}, values)


def test_pattern_is_that_of_the_matrix():
    form, fields, values = mixed_case("tri")
    matrix = fem.integrate(form, fields=fields, values=values)
    pattern = fem.pattern(fields["q"], fields["u"])
    assert pattern.nnz == matrix.nnz and pattern.shape == (matrix.nrow, matrix.ncol)
    np.testing.assert_array_equal(pattern.columns.numpy(), matrix.columns.numpy()[: pattern.nnz])


@fem.integrand
def boundary_value(s: fem.Sample, domain: fem.Domain):
    x = fem.position(domain, s)
    return x[0] + 2.0 * x[1]


@pytest.mark.parametrize("name", ["grid2", "tri", "tet", "grid3"])
def test_fixed_values(name):
    space = fem.make_polynomial_space(programs.geometry(name, 3, wp.float32), degree=2)
    fields = programs.fields_of(space)
    A = fem.integrate(programs.diffusion, fields=fields)
    points = space.node_positions().numpy()
    exact = points[:, 0] + 2.0 * points[:, 1]
    bc = fem.dirichlet(space, value=boundary_value)
    fixed = programs.on_boundary(points)
    np.testing.assert_array_equal(bc.nodes.numpy(), np.flatnonzero(fixed))
    np.testing.assert_allclose(bc.values.numpy(), np.where(fixed, exact, 0.0), atol=1e-6)
    b, x = wp.zeros(space.node_count(), dtype=float), wp.zeros(space.node_count(), dtype=float)
    bc.project(A, b)
    linear.cg(A, b, x, tol=1e-7)
    np.testing.assert_allclose(x.numpy(), exact, atol=2e-5)
