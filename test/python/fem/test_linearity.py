"""Forms that are not linear in their test or trial function are errors with their line."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem


@fem.integrand
def square(s: fem.Sample, v: fem.Field):
    return v(s) * v(s)


@fem.integrand
def constant_term(s: fem.Sample, v: fem.Field):
    return v(s) + 1.0


@fem.integrand
def absolute(s: fem.Sample, v: fem.Field):
    return wp.abs(v(s))


@fem.integrand
def lone_test(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s) + v(s)


@fem.integrand
def quadratic_trial(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(fem.grad(u, s), fem.grad(u, s)) * v(s)


@fem.integrand
def branches_and_loops(s: fem.Sample, u: fem.Field, v: fem.Field, k: int):
    total = float(0.0)
    for i in range(k):
        total += wp.dot(fem.grad(u, s), fem.grad(v, s)) * float(i)
    if s.qp_index % 2 == 0:
        total = total + u(s) * v(s) / 2.0
    else:
        total += 0.5 * v(s) * u(s)
    return total


@fem.integrand
def plain(s: fem.Sample, u: fem.Field, v: fem.Field, k: float):
    return k * wp.dot(fem.grad(u, s), fem.grad(v, s)) + 0.5 * u(s) * v(s)


@pytest.fixture
def space():
    return fem.make_polynomial_space(fem.Grid2D(wp.vec2i(3, 2)), degree=1)


@pytest.mark.parametrize(
    "form, line",
    [
        (square, "return v(s) * v(s)"),
        (constant_term, "return v(s) + 1.0"),
        (absolute, "return wp.abs(v(s))"),
    ],
)
def test_form_is_linear_in_the_test_function(space, form, line):
    with pytest.raises(wp.WarpCodegenError, match="is not linear in 'v', its test") as caught:
        fem.integrate(form, fields={"v": fem.make_test(space)})
    assert line in str(caught.value)


@pytest.mark.parametrize("form", [lone_test, quadratic_trial])
def test_form_is_linear_in_the_trial_function(space, form):
    fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
    with pytest.raises(wp.WarpCodegenError, match="is not linear in 'u', its trial"):
        fem.integrate(form, fields=fields)


def test_branches_and_loops_are_linear(space):
    fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
    found = fem.integrate(branches_and_loops, fields=fields, values={"k": 4})
    exact = fem.integrate(plain, fields=fields, values={"k": 6.0})
    np.testing.assert_allclose(found.values.numpy(), exact.values.numpy(), atol=1e-5)
