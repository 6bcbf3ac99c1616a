"""Linear elasticity: fields in equilibrium are found exactly on distorted meshes."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem

MU, LAM = 0.5, 1.0


@fem.integrand
def elasticity(s: fem.Sample, u: fem.Field, v: fem.Field, lame: wp.vec2d):
    e = fem.D(u, s)
    return lame[0] * fem.div(u, s) * fem.div(v, s) + 2.0 * lame[1] * wp.ddot(e, fem.D(v, s))


@fem.integrand
def elasticity_f32(s: fem.Sample, u: fem.Field, v: fem.Field, lame: wp.vec2):
    e = fem.D(u, s)
    return lame[0] * fem.div(u, s) * fem.div(v, s) + 2.0 * lame[1] * wp.ddot(e, fem.D(v, s))


@fem.integrand
def force(s: fem.Sample, v: fem.Field, f: wp.vec3d):
    return wp.dot(f, v(s))


def displacement(points, degree):
    """A field, and the constant force that holds it."""
    x = points.T
    if points.shape[1] == 2:
        linear = np.stack([x[0] + 0.5 * x[1], x[1] - 2.0 * x[0]], 1)
        return linear, np.zeros(2)
    if degree == 1:
        return np.stack([x[0] + x[1], x[2] - x[0], x[0] + 2.0 * x[1]], 1), np.zeros(3)
    # div u = 1 is constant, so the force is -mu times the Laplacian.
    field = [x[0] + x[1] * x[2], x[2] ** 2 - x[0], x[0] ** 2 + 2.0 * x[1]]
    return np.stack(field, 1), -MU * np.array([0.0, 2.0, 2.0])


def patch_error(geo, degree, form, scalar):
    dim = geo.dimension
    dtype = wp.types.vector(length=dim, dtype=scalar)
    space = fem.make_polynomial_space(geo, degree=degree, dtype=dtype)
    fields = programs.fields_of(space)
    lame = wp.types.vector(length=2, dtype=scalar)(LAM, MU)
    a = programs.dense(fem.integrate(form, fields=fields, values={"lame": lame}))
    points = space.node_positions().numpy().astype(np.float64)
    exact, f = displacement(points, degree)
    b = np.zeros(exact.size)
    if f.any():
        loads = fem.integrate(force, fields={"v": fields["v"]}, values={"f": wp.vec3d(*f)})
        b = loads.numpy().ravel().astype(np.float64)
    fixed = np.repeat(programs.on_boundary(points), dim)
    return np.abs(programs.solve(a, b, fixed, exact.ravel()) - exact.ravel()).max()


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", ["grid3", "tet", "hex", "tri", "quad"])
def test_patch(name, degree):
    if degree == 2 and name in ("tri", "quad"):
        pytest.skip("quadratic fields are of three dimensions")
    n = 2 if degree == 2 else 3

    def move(points):
        return programs.shaken(points, n)

    # A quadratic map of a hexahedron takes quadratic fields out of the space.
    move = None if (name, degree) == ("hex", 2) else move
    geo = programs.geometry(name, n, wp.float64, move)
    assert patch_error(geo, degree, elasticity, wp.float64) < 1e-13
    if degree == 1:
        geo = programs.geometry(name, n, wp.float32, move)
        assert patch_error(geo, degree, elasticity_f32, wp.float32) < 2e-6
