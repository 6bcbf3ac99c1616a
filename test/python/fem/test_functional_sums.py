"""Sums over elements: against exact sums, and their adjoint."""

import math

import numpy as np
import pytest

import warp as wp
from warp import fem
from warp._src.fem.assembly.functional import sum_totals


@pytest.mark.parametrize("count", [0, 1, 64, 65, 70000])
def test_sum(count):
    numbers = np.random.default_rng(count).standard_normal(count).astype(np.float32)
    totals = wp.array(numbers, dtype=float, device="cpu")
    exact = math.fsum(numbers.astype(float))
    assert sum_totals(totals, output_dtype=wp.float64) == pytest.approx(exact, abs=1e-12)
    assert sum_totals(totals) == np.float32(exact)
    out = wp.array([2.0, 5.0], dtype=wp.float64, device="cpu")
    assert sum_totals(totals, output=out, add=True) is out
    np.testing.assert_allclose(out.numpy(), [2.0 + exact, 5.0], rtol=1e-13)


def test_sum_of_vectors():
    numbers = np.random.default_rng(1).standard_normal((300, 3))
    totals = wp.array(numbers, dtype=wp.vec3d, device="cpu")
    np.testing.assert_allclose(sum_totals(totals), numbers.sum(0), atol=1e-13)
    with pytest.raises(ValueError, match="expects an element of 3 numbers, but got 1 of type"):
        sum_totals(totals, output=wp.zeros(1, dtype=float, device="cpu"))


@pytest.mark.parametrize("add", [False, True])
def test_adjoint(add):
    totals = wp.zeros(100, dtype=wp.float32, device="cpu", requires_grad=True)
    out = wp.zeros(1, dtype=wp.float64, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        sum_totals(totals, output=out, add=add)
    tape.backward(grads={out: wp.array([3.0], dtype=wp.float64, device="cpu")})
    np.testing.assert_array_equal(totals.grad.numpy(), np.full(100, 3.0, np.float32))
    assert out.grad.numpy()[0] == (3.0 if add else 0.0)


@fem.integrand
def literal(s: fem.Sample):
    return 1.0


@fem.integrand
def whole(s: fem.Sample):
    return 2


@fem.integrand
def narrow(s: fem.Sample):
    return wp.vec3(1.0, 2.0, 4.0)


@fem.integrand
def wide(s: fem.Sample, domain: fem.Domain):
    return wp.float64(fem.position(domain, s)[0])


@fem.integrand
def nothing(s: fem.Sample):
    s.qp_index  # noqa: B018


@pytest.mark.parametrize("real", [wp.float32, wp.float64])
def test_types_of_integrands(real):
    """Integrals over the unit square have at least the precision of its positions."""
    cells = fem.Cells(fem.Grid2D(wp.vec2i(3, 4), scalar_type=real))
    digits = {wp.float32: 1e-6, wp.float64: 1e-15}[real]
    names = {wp.float32: "float32", wp.float64: "float64"}
    for form, exact in ((literal, 1.0), (whole, 2.0), (narrow, [1.0, 2.0, 4.0])):
        found = fem.integrate(form, domain=cells)
        assert found.dtype == names[real]
        np.testing.assert_allclose(found, exact, rtol=digits)
    found = fem.integrate(wide, domain=cells)
    assert found.dtype == "float64" and found == pytest.approx(0.5, rel=digits)
    with pytest.raises(ValueError, match="'nothing' gives no value to integrate"):
        fem.integrate(nothing, domain=cells)
