"""Orders of convergence of interpolation and projection in each family of elements."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem
from warp.examples.fem import utils
from warp.optim import linear

Basis = fem.ElementBasis


def box(kind, n):
    if kind == "grid2":
        return fem.Grid2D(wp.vec2i(n), scalar_type=wp.float64)
    if kind == "grid3":
        return fem.Grid3D(wp.vec3i(n), scalar_type=wp.float64)
    make = {
        "tri": (utils.gen_trimesh, fem.Trimesh2D),
        "quad": (utils.gen_quadmesh, fem.Quadmesh2D),
        "tet": (utils.gen_tetmesh, fem.Tetmesh),
        "hex": (utils.gen_hexmesh, fem.Hexmesh),
    }
    generate, mesh = make[kind]
    d = 2 if kind in ("tri", "quad") else 3
    positions, cells = generate((wp.vec2i if d == 2 else wp.vec3i)(n))
    x = positions.numpy().astype(np.float64)
    # A smooth map of the box to itself that bends cells.
    if kind in ("quad", "hex"):
        bend = 0.1 * np.prod(np.sin(np.pi * x), axis=1)
        x[:, 0] += bend
        x[:, 1] -= 0.7 * bend
    return mesh(cells, wp.array(x, dtype=wp.vec2d if d == 2 else wp.vec3d))


@fem.integrand
def wave(s: fem.Sample, domain: fem.Domain):
    x = domain(s)
    return wp.sin(2.0 * x[0] + 0.3) * wp.cos(1.5 * x[1] + 0.2)


@fem.integrand
def wave_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    error = u(s) - wave(s, domain)
    return error * error


@fem.integrand
def flow(s: fem.Sample, domain: fem.Domain):
    x = domain(s)
    value = x - x
    value[0] = wp.sin(2.0 * x[1] + 0.3) * wp.cos(x[0])
    value[1] = wp.cos(1.5 * x[0] + 0.2) * wp.sin(x[1])
    return value


@fem.integrand
def flow_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    return wp.length_sq(u(s) - flow(s, domain))


@fem.integrand
def divergence_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    x = domain(s)
    exact = wp.cos(1.5 * x[0] + 0.2) * wp.cos(x[1]) - wp.sin(2.0 * x[1] + 0.3) * wp.sin(x[0])
    error = fem.div(u, s) - exact
    return error * error


@fem.integrand
def rotation_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    x = domain(s)
    exact = -1.5 * wp.sin(1.5 * x[0] + 0.2) * wp.sin(x[1])
    exact -= 2.0 * wp.cos(2.0 * x[1] + 0.3) * wp.cos(x[0])
    slope = fem.grad(u, s)
    error = slope[1, 0] - slope[0, 1] - exact
    return error * error


def norm(form, geometry, field):
    fields = {"u": field}
    quadrature = fem.RegularQuadrature(fem.Cells(geometry), order=10)
    return fem.integrate(form, quadrature=quadrature, fields=fields) ** 0.5


def interpolated(integrand, geometry, degree, basis):
    space = fem.make_polynomial_space(geometry, degree=degree, element_basis=basis)
    field = space.make_field()
    fem.interpolate(integrand, dest=field)
    return field


def order_of(errors, ratio):
    return np.log(errors[0] / errors[1]) / np.log(ratio)


SCALARS = [
    (kind, basis, degree)
    for basis, kinds in (
        (Basis.SERENDIPITY, ("grid2", "grid3")),
        (Basis.NONCONFORMING_POLYNOMIAL, ("grid2", "tri", "tet")),
    )
    for kind in kinds
    for degree in (2, 3)
]


@pytest.mark.parametrize(("kind", "basis", "degree"), SCALARS)
def test_scalar_families(kind, basis, degree):
    errors = []
    for n in (4, 8):
        geometry = box(kind, n)
        errors.append(norm(wave_error, geometry, interpolated(wave, geometry, degree, basis)))
    assert order_of(errors, 2.0) == pytest.approx(degree + 1, abs=0.15)


VECTORS = [
    (kind, basis, degree)
    for basis in (Basis.NEDELEC_FIRST_KIND, Basis.RAVIART_THOMAS)
    for kind in ("grid2", "tri", "quad", "tet", "hex")
    for degree in (1, 2, 3)
    if kind not in ("tet", "hex") or degree < 3
]


@pytest.mark.parametrize(("kind", "basis", "degree"), VECTORS)
def test_interpolation_in_vector_families(kind, basis, degree):
    """Values have the order of the degree; so have rotations and divergences on grids."""
    coarse = 2 if kind in ("tet", "hex") else 6
    derivative = divergence_error if basis is Basis.RAVIART_THOMAS else rotation_error
    values, slopes = [], []
    for n in (coarse, 2 * coarse):
        geometry = box(kind, n)
        field = interpolated(flow, geometry, degree, basis)
        values.append(norm(flow_error, geometry, field))
        slopes.append(norm(derivative, geometry, field))
    assert order_of(values, 2.0) > degree - 0.15
    if kind == "grid2":
        assert order_of(slopes, 2.0) > degree - 0.15


@wp.func
def rotation(slope: wp.mat22d):
    return slope[1, 0] - slope[0, 1]


@fem.integrand
def curl_product(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(u(s), v(s)) + rotation(fem.grad(u, s)) * rotation(fem.grad(v, s))


@fem.integrand
def curl_load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    x = domain(s)
    exact = -1.5 * wp.sin(1.5 * x[0] + 0.2) * wp.sin(x[1])
    exact -= 2.0 * wp.cos(2.0 * x[1] + 0.3) * wp.cos(x[0])
    return wp.dot(flow(s, domain), v(s)) + exact * rotation(fem.grad(v, s))


@fem.integrand
def div_product(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(u(s), v(s)) + fem.div(u, s) * fem.div(v, s)


@fem.integrand
def div_load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    x = domain(s)
    exact = wp.cos(1.5 * x[0] + 0.2) * wp.cos(x[1]) - wp.sin(2.0 * x[1] + 0.3) * wp.sin(x[0])
    return wp.dot(flow(s, domain), v(s)) + exact * fem.div(v, s)


def projected(product, load, geometry, degree, basis):
    """The nearest function of a space in the norm of a product."""
    space = fem.make_polynomial_space(geometry, degree=degree, element_basis=basis)
    domain = fem.Cells(geometry)
    test, trial = fem.make_test(space), fem.make_trial(space)
    quadrature = fem.RegularQuadrature(
        domain, order=12 if basis is Basis.BSPLINE else 2 * degree + 4
    )
    types = {"output_dtype": wp.float64}
    matrix = fem.integrate(product, quadrature=quadrature, fields={"u": trial, "v": test}, **types)
    right = fem.integrate(load, quadrature=quadrature, fields={"v": test}, **types)
    field = space.make_field()
    linear.cg(matrix, right, field.dof_values, tol=1e-12, maxiter=20000)
    return field


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("basis", [Basis.NEDELEC_FIRST_KIND, Basis.RAVIART_THOMAS])
@pytest.mark.parametrize("kind", ["tri", "grid2"])
def test_orders_in_energy_norms(kind, basis, degree):
    """Best approximations in H(curl) and H(div) have the order of the degree, with derivatives."""
    is_curl = basis is Basis.NEDELEC_FIRST_KIND
    forms = (curl_product, curl_load) if is_curl else (div_product, div_load)
    values, slopes = [], []
    for n in (4, 8):
        geometry = box(kind, n)
        field = projected(*forms, geometry, degree, basis)
        values.append(norm(flow_error, geometry, field))
        slopes.append(norm(rotation_error if is_curl else divergence_error, geometry, field))
    assert order_of(values, 2.0) == pytest.approx(degree, abs=0.15)
    assert order_of(slopes, 2.0) == pytest.approx(degree, abs=0.15)


@fem.integrand
def mass(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s)


@fem.integrand
def load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    return wave(s, domain) * v(s)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_projections_on_splines(degree):
    """Splines of degree 2 have breaks at centres of cells, where a fine rule has to see them."""
    errors = []
    for n in (6, 12):
        geometry = box("grid2", n)
        field = projected(mass, load, geometry, degree, Basis.BSPLINE)
        errors.append(norm(wave_error, geometry, field))
    assert order_of(errors, 2.0) == pytest.approx(degree + 1, abs=0.25)
