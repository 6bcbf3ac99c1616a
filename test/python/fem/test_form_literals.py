"""Literals of forms: they have the type of what stands beside them, else that of the geometry."""

import math

import numpy as np
import pytest

import warp as wp
from warp import fem


@wp.func
def product(x: wp.float64, y: wp.float64):
    return x * y


@wp.func
def halved(x: wp.float32):
    return 0.5 * x


@fem.integrand
def component(s: fem.Sample, domain: fem.Domain):
    x = domain(s)
    x[0] = 0.3
    return x[0] + x[1]


@fem.integrand
def updated_component(s: fem.Sample, domain: fem.Domain):
    x = domain(s)
    x[0] += 0.3
    x[1] *= 0.7
    return x[0] + x[1]


@fem.integrand
def choice(s: fem.Sample, domain: fem.Domain):
    x = domain(s)
    return x[1] if x[0] > 0.5 else 0.1


@fem.integrand
def first_return(s: fem.Sample, domain: fem.Domain):
    x = domain(s)
    if x[0] > 0.5:
        return 0.1
    return x[1]


@fem.integrand
def branch(s: fem.Sample, domain: fem.Domain):
    x = domain(s)
    t = 0.1
    if x[0] > 0.5:
        t = x[1]
    return t


@fem.integrand
def loop(s: fem.Sample, domain: fem.Domain):
    x = domain(s)
    t = float(0.1)
    for k in range(2):
        t += x[k]
    return t


@fem.integrand
def dynamic_loop(s: fem.Sample, domain: fem.Domain):
    x = domain(s)
    t, i = 1.0, int(0)
    while i < 3:
        t = t * x[0] + 0.1
        i += 1
    return t


@fem.integrand
def argument(s: fem.Sample, domain: fem.Domain):
    k = 0.1
    return product(0.3, domain(s)[0]) + product(k, domain(s)[1])


@fem.integrand
def root(s: fem.Sample, domain: fem.Domain):
    return wp.sqrt(0.1) * domain(s)[0]


@fem.integrand
def nested(s: fem.Sample, domain: fem.Domain):
    return 0.1 + choice(s, domain)


@fem.integrand
def narrow_values(s: fem.Sample, k: wp.float32, v: wp.vec2):
    # Values in float32 keep their type beside literals.
    v[0] = 0.5
    t = 0.25
    return wp.float64(2.0 * k + halved(0.5) + v[0] + t * k + halved(t))


_FORMS = {
    component: lambda x, y: 0.3 + y,
    updated_component: lambda x, y: x + 0.3 + 0.7 * y,
    choice: lambda x, y: np.where(x > 0.5, y, 0.1),
    first_return: lambda x, y: np.where(x > 0.5, 0.1, y),
    branch: lambda x, y: np.where(x > 0.5, y, 0.1),
    loop: lambda x, y: 0.1 + x + y,
    dynamic_loop: lambda x, y: ((x + 0.1) * x + 0.1) * x + 0.1,
    argument: lambda x, y: 0.3 * x + 0.1 * y,
    root: lambda x, y: math.sqrt(0.1) * x,
    nested: lambda x, y: 0.1 + np.where(x > 0.5, y, 0.1),
}


def _integral(function):
    """Over the unit square, by points of Gauss's rule in each quarter."""
    points, weights = np.polynomial.legendre.leggauss(8)
    at = np.concatenate([(points + 1.0) / 4.0, (points + 3.0) / 4.0])
    weights = np.tile(weights / 4.0, 2)
    x, y = np.meshgrid(at, at, indexing="ij")
    return weights @ np.broadcast_to(function(x, y), x.shape) @ weights


# `argument` calls a function of float64.
_CASES = [(form, wp.float64, 1e-15) for form in _FORMS]
_CASES += [(form, wp.float32, 3e-7) for form in _FORMS if form is not argument]


@pytest.mark.parametrize(("form", "real", "limit"), _CASES)
def test_literals_have_the_precision_of_the_geometry(form, real, limit):
    """Integrals of forms with literals are exact, to the last digits of the geometry's type."""
    grid = fem.Grid2D(res=wp.vec2i(2, 2), scalar_type=real)
    rule = fem.RegularQuadrature(fem.Cells(grid), order=8)
    found = float(fem.integrate(form, quadrature=rule))
    assert abs(found - _integral(_FORMS[form])) <= 2 * limit


def test_values_of_another_type_keep_it():
    """Literals beside values in float32 are float32, on a geometry in float64."""
    grid = fem.Grid2D(res=wp.vec2i(1, 1), scalar_type=wp.float64)
    values = {"k": 4.0, "v": wp.vec2(3.0, 3.0)}
    found = fem.integrate(narrow_values, domain=fem.Cells(grid), values=values)
    assert float(found) == 2.0 * 4.0 + 0.25 + 0.5 + 0.25 * 4.0 + 0.125
