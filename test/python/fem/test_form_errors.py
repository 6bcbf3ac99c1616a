"""Arguments of forms that do not fit: errors name both sides, or the line."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem
from warp.sparse import bsr_zeros


@fem.integrand
def mass(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s)


@fem.integrand
def load(s: fem.Sample, v: fem.Field, k: float):
    return k * v(s)


@fem.integrand
def vector_load(s: fem.Sample, v: fem.Field):
    return wp.vec2(v(s), 0.0)


@fem.integrand
def gradient_of_number(s: fem.Sample, v: fem.Field):
    return fem.div(v, s)


@fem.integrand
def value(s: fem.Sample, u: fem.Field):
    return u(s)


@fem.integrand
def plain_position(s: fem.Sample, domain: fem.Domain):
    return domain(s)


@wp.func
def no_integrand(x: float):
    return x


@pytest.fixture
def grid():
    return fem.Grid2D(wp.vec2i(4, 3))


@pytest.fixture
def space(grid):
    return fem.make_polynomial_space(grid, degree=1)


def test_two_test_functions(space):
    fields = {"u": fem.make_test(space), "v": fem.make_test(space)}
    with pytest.raises(ValueError, match="expects one test function, but got 'u' and 'v'"):
        fem.integrate(mass, fields=fields)


def test_two_trial_functions(space):
    fields = {"u": fem.make_trial(space), "v": fem.make_trial(space)}
    with pytest.raises(ValueError, match="expects one trial function, but got 'u' and 'v'"):
        fem.integrate(mass, fields=fields)


def test_no_field(space):
    with pytest.raises(ValueError, match="field 'u' of 'mass' expects a field, but got '3.0'"):
        fem.integrate(mass, fields={"u": 3.0, "v": fem.make_test(space)})


def test_no_integrand(grid):
    with pytest.raises(ValueError, match="expects a function decorated by `@fem.integrand`"):
        fem.integrate(no_integrand, domain=fem.Cells(grid))


def test_value_of_another_type(space):
    fields = {"v": fem.make_test(space)}
    with pytest.raises((TypeError, ValueError), match="'k'.*expects 'float32'"):
        fem.integrate(load, fields=fields, values={"k": wp.vec3(1.0, 2.0, 3.0)})
    with pytest.raises(ValueError, match="has no parameter 'w' for a value, but \\['k'\\]"):
        fem.integrate(load, fields=fields, values={"k": 1.0, "w": 2.0})


def test_result_that_is_no_number(space):
    with pytest.raises(ValueError, match="expects a result of type 'float32'.*but gives 'vec2f'"):
        fem.integrate(vector_load, fields={"v": fem.make_test(space)})


def test_operator_without_meaning_has_the_line(space):
    with pytest.raises(wp.WarpCodegenError, match="'div' is not defined for fields") as caught:
        fem.integrate(gradient_of_number, fields={"v": fem.make_test(space)})
    assert "return fem.div(v, s)" in str(caught.value)


@pytest.mark.parametrize("count", [3, 21])
def test_array_of_another_length(space, count):
    field = space.make_field()
    with pytest.raises(ValueError, match=f"expects 20 values, one per node, but got {count}"):
        field.dof_values = wp.zeros(count, dtype=float)


def test_array_of_another_type(space):
    field = space.make_field()
    with pytest.raises(ValueError, match="expects an array of float32, but got one of 1"):
        field.dof_values = wp.zeros(20, dtype=wp.vec2)


def test_field_of_another_geometry(grid):
    other = fem.make_polynomial_space(fem.Grid2D(wp.vec2i(2, 2)), degree=1).make_field()
    with pytest.raises(ValueError, match="field 'u' is defined on .* over another geometry"):
        fem.integrate(value, domain=fem.Cells(grid), fields={"u": other})


def test_field_without_trace(grid, space):
    with pytest.raises(ValueError, match="is defined on cells, but the domain has sides; use its"):
        fem.integrate(value, domain=fem.Sides(grid), fields={"u": space.make_field()})
    with pytest.raises(ValueError, match="is defined on sides, but the domain has cells"):
        fem.integrate(value, domain=fem.Cells(grid), fields={"u": space.make_field().trace()})


def test_options(grid, space):
    fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
    with pytest.raises(ValueError, match="'assembly' expects 'dispatch', .* but got 'fast'"):
        fem.integrate(mass, fields=fields, assembly="fast")
    with pytest.raises(ValueError, match="expects one of 'domain', 'quadrature'"):
        fem.integrate(plain_position)
    with pytest.raises(ValueError, match="'reduction' expects one of"):
        fem.interpolate(plain_position, at=fem.Cells(grid), reduction="median")


def test_interpolation_of_test_and_trial_functions(space):
    dest = space.make_field()
    with pytest.raises(ValueError, match="test function 'u' cannot be used for interpolation"):
        fem.interpolate(value, dest=dest, fields={"u": fem.make_test(space)})
    with pytest.raises(ValueError, match="trial function 'u' expects a 'BsrMatrix' as 'dest'"):
        fem.interpolate(value, dest=dest, fields={"u": fem.make_trial(space)})
    with pytest.raises(ValueError, match="expects a trial function among the fields"):
        matrix = bsr_zeros(20, 20, float)
        fem.interpolate(value, dest=matrix, dest_space=space, fields={"u": space.make_field()})


def test_interpolated_value_of_another_type(grid, space):
    with pytest.raises(ValueError, match="gives 'vec2f', but values of the space are 'float32'"):
        fem.interpolate(plain_position, dest=space.make_field())


def test_values_after_an_error_are_right(grid, space):
    field = space.make_field()
    with pytest.raises(ValueError):
        field.dof_values = wp.zeros(1, dtype=float)
    field.dof_values.fill_(2.0)
    found = fem.integrate(value, domain=fem.Cells(grid), fields={"u": field})
    np.testing.assert_allclose(found, 2.0, rtol=1e-6)
