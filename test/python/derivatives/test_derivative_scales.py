"""Derivatives of homogeneous builtins far from 1.

If every result f_i(s x) = s^p_i f_i(x), the sum of s^-p_i w_i f_i(s x) is the same for all s, and
its gradient by s x falls like 1 / s. Scales are powers of two, so what holds near 1 holds elsewhere
to rounding, unless something in between leaves the range of the numbers.
"""

import numpy as np
import pytest
from warp._src.builtin_table import BUILTINS, DERIVATIVES

import warp as wp
from derivative_values import Overload

SMOOTH = [name for name, derivative in DERIVATIVES.items() if derivative == "differentiable"]
# The functions that a simulation scales; others join if they are found to be homogeneous.
HOMOGENEOUS = {
    "add", "mul", "div", "dot", "cross", "length", "normalize", "inverse", "determinant", "solve3",
    "quat_inverse", "svd3", "qr3", "polar", "hypot", "angle_between",
}  # fmt: skip
# Slopes are the derivative of the values, so they do not scale as the values do.
BY_CONTRACT = {"sym_spectral3"}
EXPONENTS = (340, -340, 500, -500, 900, -900)
# Exponents beyond which gradients are no normal numbers.
LARGEST = 960


@pytest.fixture(autouse=True)
def quiet(monkeypatch):
    monkeypatch.setattr(wp.config, "quiet", True)


def degrees(values, doubled):
    """The power of two of each result, or None if one is not homogeneous."""
    found = np.zeros(values.shape[1], int)
    for i, (value, other) in enumerate(zip(values.T, doubled.T)):
        known = (value != 0) & (other != 0) & np.isfinite(value) & np.isfinite(other)
        if not known.any():
            continue
        powers = np.log2(np.abs(other[known] / value[known]))
        found[i] = np.round(np.median(powers))
        if np.abs(powers - found[i]).max() > 1e-6:
            return None
    return found


def check(overload, device):
    """True if an overload is homogeneous; if so its gradients have been compared."""
    random = np.random.default_rng(3)
    rows = overload.sample(random)
    values = overload.run(rows, device)
    powers = degrees(values, overload.run(2.0 * rows, device))
    if powers is None:
        return False
    weights = random.standard_normal(values.shape)
    expected = overload.adjoint(rows, weights, device)
    for exponent in EXPONENTS:
        # Gradients of the results, before they are weighted.
        if max(np.abs(powers).max(), np.abs(powers - 1).max()) * abs(exponent) > LARGEST:
            continue
        scaled = np.ldexp(weights, -powers * exponent)
        found = overload.adjoint(np.ldexp(rows, exponent), scaled, device)
        np.testing.assert_allclose(
            np.ldexp(found, exponent),
            expected,
            rtol=1e-7,
            atol=1e-9 * np.abs(expected).max(),
            err_msg=f"{overload.name} at 2^{exponent}",
        )
    return True


@pytest.mark.parametrize("name", [name for name in SMOOTH if name not in BY_CONTRACT])
def test_scales(device, name):
    found = []
    for index in range(len(BUILTINS[name][2])):
        overload = Overload(name, index)
        if overload.is_smooth:
            found.append(check(overload, device))
    assert name not in HOMOGENEOUS or any(found)
