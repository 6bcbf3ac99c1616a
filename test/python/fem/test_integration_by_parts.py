"""Integration by parts holds for whole matrices: on nine geometries, by scalar and vector bases.

With a constant matrix C, the integral over cells of u C : grad(v) + v . C grad(u) is that of
u v . C n over their sides. It takes every component of every gradient, of cells that are curved,
too, where maps of vector families have derivatives of their own.
"""

from typing import Any

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem

Basis = fem.ElementBasis
REAL = wp.float64


def volume(voxels, size):
    points = wp.array(np.array(voxels), dtype=wp.vec3i)
    return wp.Volume.allocate_by_voxels(points, voxel_size=size, translation=(0.5 * size,) * 3)


def bend(x):
    y = x.copy()
    y[:, 0] += 0.15 * x[:, 1] ** 2
    y[:, -1] += 0.1 * x[:, 0] * x[:, 1]
    return y


@wp.func
def moved(x: wp.vec2d):
    bump = REAL(0.1) * x[0] * wp.exp(x[1])
    return x + wp.vec2d(REAL(0.15) * wp.sin(REAL(2.0) * x[1]), bump)


def by_function(**options):
    """Cells whose map is no polynomial."""
    cells = fem.Cells(programs.geometry("grid2", 2, REAL))
    return fem.ImplicitField(cells, moved, **options).make_deformed_geometry(relative=False)


def make(name):
    if name == "by function":
        return by_function(grad_func=True)
    if name.startswith("curved "):
        return programs.curved(make(name[7:]), bend)
    if name == "adaptive":
        return programs.two_levels()
    if name == "nanogrid":
        return fem.Nanogrid(volume(list(np.ndindex(3, 2, 2)), 0.5), scalar_type=REAL)
    return programs.geometry(name, 2, REAL, None if "grid" in name else programs.warped)


@fem.integrand
def in_cells(s: fem.Sample, u: fem.Field, v: fem.Field, C: Any):
    return u(s) * wp.ddot(C, fem.grad(v, s)) + wp.dot(v(s), C * fem.grad(u, s))


@fem.integrand
def between(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field, C: Any):
    n = C * fem.normal(domain, s)
    inner = fem.average(u, s) * wp.dot(fem.jump(v, s), n)
    return inner + fem.jump(u, s) * wp.dot(fem.average(v, s), n)


@fem.integrand
def around(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field, C: Any):
    return u(s) * wp.dot(v(s), C * fem.normal(domain, s))


@fem.integrand
def divergences(s: fem.Sample, u: fem.Field, v: fem.Field, C: Any):
    return (
        u(s) * fem.div(v, s)
        + wp.dot(v(s), fem.grad(u, s))
        + REAL(0.0) * wp.trace(C) * u(s) * v(s)[0]
    )


def matrix(form, u, v, domain, order, C):
    fields = {"u": fem.make_trial(u, domain=domain), "v": fem.make_test(v, domain=domain)}
    rule = fem.RegularQuadrature(domain, order=order)
    return programs.dense(fem.integrate(form, quadrature=rule, fields=fields, values={"C": C}))


def check(name, scalar, vector, order):
    geometry = make(name)
    d = geometry.dimension
    basis, degree, discontinuous = scalar
    options = {"element_basis": basis, "discontinuous": discontinuous}
    u = fem.make_polynomial_space(geometry, degree=degree, dtype=REAL, **options)
    basis, degree, discontinuous = vector
    dtype = wp.types.vector(d, REAL) if basis is Basis.LAGRANGE else REAL
    options = {"element_basis": basis, "discontinuous": discontinuous}
    v = fem.make_polynomial_space(geometry, degree=degree, dtype=dtype, **options)
    cells, sides, border = fem.Cells(geometry), fem.Sides(geometry), fem.BoundarySides(geometry)
    mixed = np.array([[1.0, 0.3, -0.7], [-1.1, 0.5, 0.2], [0.4, 0.9, -0.6]])[:d, :d]
    worst = []
    for form, constant in ((in_cells, mixed), (divergences, np.eye(d))):
        C = wp.types.matrix((d, d), REAL)(constant)
        left = matrix(form, u, v, cells, order, C)
        right = matrix(between, u, v, sides, order, C) + matrix(around, u, v, border, order, C)
        worst.append(np.abs(left - right).max() / np.abs(left).max())
    return worst


LAGRANGE, CURL, DIV = Basis.LAGRANGE, Basis.NEDELEC_FIRST_KIND, Basis.RAVIART_THOMAS
P1, P2, P3 = ((LAGRANGE, k, False) for k in (1, 2, 3))
BROKEN = (LAGRANGE, 2, True)
# Cells whose maps leave quotients: their rules are of a higher order.
CASES = [("grid2", (Basis.BSPLINE, 3, False), (CURL, 2, False), 10)]
CASES += [("tri", P3, (DIV, 2, False), 8), ("tri", BROKEN, (CURL, 2, True), 8)]
CASES += [("quad", P1, (CURL, 1, False), 22), ("quad", BROKEN, (CURL, 2, False), 22)]
CASES += [("quad", (Basis.SERENDIPITY, 2, False), (DIV, 2, False), 22), ("quad", P2, P2, 12)]
CASES += [("curved grid2", P1, (CURL, 1, False), 26), ("curved grid2", P1, (DIV, 1, False), 26)]
CASES += [("by function", P1, (CURL, 1, False), 26), ("by function", P1, (DIV, 1, False), 26)]
CASES += [("tet", P2, (CURL, 1, False), 8), ("hex", P1, (CURL, 1, False), 16)]
CASES += [("hex", P1, (DIV, 1, False), 16), ("nanogrid", P1, (CURL, 1, False), 8)]
CASES += [("adaptive", BROKEN, (DIV, 1, False), 8)]


@pytest.mark.parametrize(("name", "scalar", "vector", "order"), CASES)
def test_integration_by_parts(name, scalar, vector, order):
    assert max(check(name, scalar, vector, order)) < 1e-11


def test_functions_without_a_gradient_move_no_cells():
    with pytest.raises(ValueError, match="expects a field with a gradient"):
        by_function()
