"""Forms and fields that do not fit: errors that name both sides."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem


@fem.integrand
def mass(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s)


@fem.integrand
def square_of_test(s: fem.Sample, v: fem.Field):
    return v(s) * v(s)


@fem.integrand
def with_constant(s: fem.Sample, v: fem.Field):
    return v(s) + 1.0


@fem.integrand
def nonlinear_in_trial(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.sin(u(s)) * v(s)


@fem.integrand
def load(s: fem.Sample, v: fem.Field, c: float):
    return c * v(s)


@pytest.fixture(scope="module")
def space():
    return fem.make_polynomial_space(fem.Grid2D(res=wp.vec2i(3, 3)), degree=1)


def test_forms_that_are_not_linear(space):
    fields = programs.fields_of(space)
    for form in (square_of_test, with_constant):
        with pytest.raises(wp.WarpCodegenError, match="is not linear in 'v', its test function"):
            fem.integrate(form, fields={"v": fields["v"]})
    with pytest.raises(wp.WarpCodegenError, match="is not linear in 'u', its trial function"):
        fem.integrate(nonlinear_in_trial, fields=fields)


def test_fields_that_are_missing_or_too_many(space):
    fields = programs.fields_of(space)
    u, v = fields["u"], fields["v"]
    with pytest.raises(ValueError, match="expects a field 'v', but got"):
        fem.integrate(mass, fields={"u": u})
    with pytest.raises(ValueError, match="has no field 'w', but"):
        fem.integrate(mass, fields={**fields, "w": v})
    with pytest.raises(ValueError, match="expects one test function, but got 'u' and 'v'"):
        fem.integrate(mass, fields={"u": v, "v": v})
    field = space.make_field()
    with pytest.raises(ValueError, match="has a trial function, but no test function"):
        fem.integrate(mass, fields={"u": u, "v": field})
    with pytest.raises(ValueError, match="expects a field, but got"):
        fem.integrate(mass, fields={"u": 3.0, "v": v})
    with pytest.raises(ValueError, match="and a test function, but 'v' is .*Space.*, no field"):
        fem.integrate(load, fields={"v": space}, values={"c": 1.0})
    with pytest.raises(ValueError, match="decorated by `@fem.integrand`"):
        fem.integrate(len, fields=fields)


def test_values_that_are_missing_or_of_another_type(space):
    v = fem.make_test(space)
    with pytest.raises(ValueError, match="expects a value 'c', but got none"):
        fem.integrate(load, fields={"v": v})
    with pytest.raises(ValueError, match="has no parameter 'd' for a value"):
        fem.integrate(load, fields={"v": v}, values={"c": 1.0, "d": 2.0})
    with pytest.raises((TypeError, ValueError)):
        fem.integrate(load, fields={"v": v}, values={"c": "two"})


def test_geometries_and_kinds_of_elements(space):
    other = fem.make_polynomial_space(fem.Grid2D(res=wp.vec2i(2, 2)), degree=1)
    v = fem.make_test(space)
    with pytest.raises(ValueError, match="is defined on .*, but the form is integrated over"):
        fem.integrate(mass, fields={"u": other.make_field(), "v": v})
    sides = fem.make_test(space, domain=fem.Sides(space.geometry))
    with pytest.raises(ValueError, match=r"is defined on cells, but .* sides.*trace"):
        fem.integrate(mass, fields={"u": space.make_field(), "v": sides})
    with pytest.raises(ValueError, match="the form is integrated over"):
        fem.integrate(
            mass, domain=fem.Sides(space.geometry), fields={"u": space.make_field(), "v": v}
        )


def test_rules_of_another_geometry(space):
    rule = fem.RegularQuadrature(fem.Cells(fem.Grid2D(res=wp.vec2i(2, 2))), order=1)
    with pytest.raises(ValueError, match="is defined on 'Grid2D_Cells' of another geometry"):
        fem.integrate(load, quadrature=rule, fields={"v": fem.make_test(space)}, values={"c": 1.0})


@pytest.mark.parametrize("number", [-1, 9])
def test_numbers_of_no_element(space, number):
    cells = fem.Cells(space.geometry)
    numbers = wp.array([0, number], dtype=int)
    with pytest.raises(ValueError, match=rf"numbers in \[0, 9\), but got {number} at index 1"):
        fem.Subdomain(cells, element_indices=numbers)
    with pytest.raises(ValueError, match="expects an array \\(n,\\) of int32"):
        fem.Subdomain(cells, element_indices=[0, 1])


def test_degrees_of_freedom(space):
    field = space.make_field()
    with pytest.raises(ValueError, match="expects 16 values, one per node, but got 3"):
        field.dof_values = wp.zeros(3, dtype=float)
    with pytest.raises(ValueError, match="'dof_values' expects an array of"):
        field.dof_values = wp.zeros(16, dtype=wp.vec2)


def test_options(space):
    fields = programs.fields_of(space)
    with pytest.raises(ValueError, match="'assembly' expects"):
        fem.integrate(mass, fields=fields, assembly="magic")
    with pytest.raises(ValueError, match="add=True"):
        fem.integrate(load, fields={"v": fields["v"]}, values={"c": 1.0}, add=True)
    with pytest.raises(ValueError, match="expects one of 'domain', 'quadrature'"):
        fem.integrate(load, fields={"v": space.make_field()}, values={"c": 1.0})


@pytest.mark.parametrize("resolution", [0, -1])
def test_empty_grids(resolution):
    try:
        geo = fem.Grid2D(res=wp.vec2i(resolution, 2))
    except ValueError as problem:
        assert "resolution" in str(problem) or "res" in str(problem)
        return
    assert resolution == 0 and geo.cell_count() == 0
    space = fem.make_polynomial_space(geo, degree=1)
    assert fem.integrate(mass, fields=programs.fields_of(space)).nnz == 0


def test_meshes_without_cells():
    positions = wp.array(np.zeros((3, 2)), dtype=wp.vec2)
    geo = fem.Trimesh2D(wp.zeros((0, 3), dtype=int), positions)
    space = fem.make_polynomial_space(geo, degree=1)
    matrix = fem.integrate(mass, fields=programs.fields_of(space))
    assert matrix.shape == (3, 3) and matrix.nnz == 0
    with pytest.raises((ValueError, IndexError)):
        fem.Trimesh2D(wp.array([[0, 1, 7]], dtype=int), positions)


def test_negative_degree(space):
    with pytest.raises(ValueError, match="degree"):
        fem.make_polynomial_space(space.geometry, degree=-1)


def test_geometries_and_orders_in_place_of_domains_and_rules(space):
    values = {"fields": {"v": space.make_field()}, "values": {"c": 1.0}}
    with pytest.raises(ValueError, match=r"'domain' expects .*fem.Cells.*, but got 'Grid2D'"):
        fem.integrate(load, domain=space.geometry, **values)
    with pytest.raises(ValueError, match=r"'quadrature' expects a rule .*, but got '3'"):
        fem.integrate(load, quadrature=3, **values)


def test_arrays_of_other_types(space):
    cells = fem.Cells(space.geometry)
    with pytest.raises(ValueError, match=r"shape \(9,\) of int32, but got \(9,\) of float32"):
        fem.Subdomain(cells, element_mask=wp.ones(9, dtype=float))
    with pytest.raises(ValueError, match=r"'positions' expects .* of vec2f, but got vec3f"):
        fem.PicQuadrature(cells, wp.zeros(4, dtype=wp.vec3))
    with pytest.raises(ValueError, match="has vectors of 2 components, but 'dtype' is vec3f"):
        fem.make_polynomial_space(
            space.geometry, dtype=wp.vec3, element_basis=fem.ElementBasis.NEDELEC_FIRST_KIND
        )
