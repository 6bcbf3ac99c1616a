"""Fields of vector families: continuity, and what interpolation gives back, on meshes and grids."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem
from warp.examples.fem import utils

CURL, DIV = fem.ElementBasis.NEDELEC_FIRST_KIND, fem.ElementBasis.RAVIART_THOMAS


def quads():
    positions, cells = utils.gen_quadmesh(wp.vec2i(3, 2))
    return fem.Quadmesh2D(cells, positions)


def triangles():
    positions, cells = utils.gen_trimesh(wp.vec2i(3, 4))
    return fem.Trimesh2D(cells, positions)


def hexes():
    positions, cells = utils.gen_hexmesh(wp.vec3i(2, 3, 2))
    return fem.Hexmesh(cells, positions)


def tets():
    """Cells of both orientations."""
    positions, cells = utils.gen_tetmesh(wp.vec3i(2, 2, 2))
    return fem.Tetmesh(cells, positions)


def grid():
    return fem.Grid3D(wp.vec3i(2, 2, 2))


@fem.integrand
def normal_jump(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    n = fem.normal(domain, s)
    jump = wp.dot(fem.inner(u, s) - fem.outer(u, s), n)
    return jump * jump


@fem.integrand
def tangential_jump(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    n = fem.normal(domain, s)
    jump = fem.inner(u, s) - fem.outer(u, s)
    jump -= wp.dot(jump, n) * n
    return wp.length_sq(jump)


@fem.integrand
def size(s: fem.Sample, u: fem.Field):
    return wp.length_sq(fem.inner(u, s))


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("basis", [CURL, DIV], ids=lambda b: b.name)
@pytest.mark.parametrize("make", [quads, triangles, hexes, tets, grid])
def test_continuity(make, basis, degree):
    geometry = make()
    space = fem.make_polynomial_space(geometry, degree=degree, element_basis=basis)
    field = space.make_field()
    values = np.random.default_rng(1).standard_normal(space.node_count())
    field.dof_values = wp.array(values, dtype=float)
    jump = tangential_jump if basis is CURL else normal_jump
    sides = fem.Sides(geometry)
    jump, whole = (
        fem.integrate(f, domain=sides, fields={"u": field.trace()}) for f in (jump, size)
    )
    assert whole > 1.0
    assert jump < 1e-8 * whole


@fem.integrand
def quadratic(s: fem.Sample, domain: fem.Domain):
    x = domain(s)
    value = x - x
    value[0] = 1.0 + x[1] * x[0] - 2.0 * x[0] * x[0]
    value[1] = x[0] * x[1] - x[0]
    return value


@fem.integrand
def difference(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    return wp.length_sq(u(s) - quadratic(s, domain))


@pytest.mark.parametrize("basis", [CURL, DIV], ids=lambda b: b.name)
@pytest.mark.parametrize("make", [quads, triangles, hexes, tets, grid])
def test_interpolation_is_exact_for_polynomials(make, basis):
    """Elements of degree 3 have all polynomials of degree 2."""
    geometry = make()
    space = fem.make_polynomial_space(geometry, degree=3, element_basis=basis)
    field = space.make_field()
    fem.interpolate(quadratic, dest=field)
    cells = fem.Cells(geometry)
    error = fem.integrate(difference, domain=cells, fields={"u": field})
    assert error < 1e-9


@fem.integrand
def planar(s: fem.Sample, domain: fem.Domain):
    """A field along the plane z = x."""
    x = domain(s)
    along = 1.0 + x[1]
    return wp.vec3(along, x[0], along)


@fem.integrand
def planar_difference(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    return wp.length_sq(u(s) - planar(s, domain))


@pytest.mark.parametrize("basis", [CURL, DIV], ids=lambda b: b.name)
@pytest.mark.parametrize("kind", ["triangles", "quads"])
def test_surfaces(kind, basis):
    """Fields along a surface in space."""
    generate = utils.gen_trimesh if kind == "triangles" else utils.gen_quadmesh
    mesh = fem.Trimesh3D if kind == "triangles" else fem.Quadmesh3D
    positions, cells = generate(wp.vec2i(3, 2))
    x = positions.numpy()
    x = np.column_stack((x, x[:, 0]))
    geometry = mesh(cells, wp.array(x, dtype=wp.vec3))
    space = fem.make_polynomial_space(geometry, degree=2, element_basis=basis)
    field = space.make_field()
    fem.interpolate(planar, dest=field)
    cells = fem.Cells(geometry)
    assert fem.integrate(planar_difference, domain=cells, fields={"u": field}) < 1e-9
