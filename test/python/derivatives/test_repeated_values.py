"""First derivatives where singular values or eigenvalues repeat: right, or counted by `report`.

Functions that do not depend on the choice of vectors are held against closed forms. A function that
tells the values of a pair apart, or weighs their vectors by functions of the values, has a part
that no cotangent shows; `wp.config.singular = "report"` names the line. Products that are
recognised are in test_spectral_products.py.
"""

import numpy as np
import pytest

import warp as wp

W = np.random.default_rng(11).normal(size=(3, 3))
EYE = np.eye(3)


@wp.func
def weigh(r: wp.mat33d):
    return wp.ddot(wp.static(wp.mat33d(*W.flatten())), r)


@wp.func
def cube_sum(a: wp.mat33d):
    u, s, v = wp.svd3(a)
    return s[0] * s[0] * s[0] + s[1] * s[1] * s[1] + s[2] * s[2] * s[2]


@wp.func
def rotation(a: wp.mat33d):
    u, s, v = wp.svd3(a)
    return weigh(u * wp.transpose(v))


@wp.func
def both(a: wp.mat33d):
    return cube_sum(a) + rotation(a)


@wp.func
def eigenvalue_squares(a: wp.mat33d):
    q, d = wp.eig3(a)
    return wp.dot(d, d)


@wp.func
def largest(a: wp.mat33d):
    u, s, v = wp.svd3(a)
    return s[0]


@wp.func
def entries(a: wp.mat33d):
    """With an unknown form; `u * diag(f(s)) * transpose(v)` is known, and sums of `outer`."""
    u, s, v = wp.svd3(a)
    total = wp.float64(0.0)
    for i in range(3):
        for j in range(3):
            for k in range(3):
                total += wp.static(wp.mat33d(*W.flatten()))[i, j] * s[k] * s[k] * u[i, k] * v[j, k]
    return total


@wp.func
def dyads(a: wp.mat33d):
    u, s, v = wp.svd3(a)
    b = wp.mat33d()
    for i in range(3):
        x = wp.vec3d(u[0, i], u[1, i], u[2, i])
        b += s[i] * s[i] * wp.outer(x, wp.vec3d(v[0, i], v[1, i], v[2, i]))
    return weigh(b)


def gradient(function, a, device):
    @wp.kernel(module="unique")
    def evaluate(a: wp.array(dtype=wp.mat33d), y: wp.array(dtype=wp.float64)):
        i = wp.tid()
        y[i] = function(a[i])

    a = wp.array(np.asarray(a)[None], dtype=wp.mat33d, requires_grad=True, device=device)
    y = wp.zeros(1, dtype=wp.float64, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(evaluate, 1, [a], [y], device=device)
    tape.backward(grads={y: wp.ones_like(y)})
    return a.grad.numpy()[0]


@pytest.fixture
def lines(monkeypatch, capfd):
    """The messages of `report` so far."""
    monkeypatch.setattr(wp.config, "singular", "report")
    return lambda: [line for line in capfd.readouterr().out.splitlines() if ".py:" in line]


# d(sum s^3) = 3 A |A|-like; of a multiple c of the identity 3 c^2 I. The rotation turns with the
# skew part: d tr(W^T R) = (W - W^T) / (2 c).
@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_invariant_functions_are_right_and_silent(device, lines, scale):
    skew = (W - W.T) / (2 * scale)
    expected = {
        cube_sum: 3 * scale**2 * EYE,
        rotation: skew,
        both: 3 * scale**2 * EYE + skew,
        eigenvalue_squares: 2 * scale * EYE,
    }
    for function, exact in expected.items():
        found = gradient(function, scale * EYE, device)
        np.testing.assert_allclose(found, exact, rtol=1e-13, atol=1e-13)
    assert lines() == []


# Daleckii and Krein: with f(s) = s^2, divided differences of f weigh the symmetric part of W, and
# divided sums the skew one.
@pytest.mark.parametrize("values", [(1.0, 1.0, 1.0), (2.0, 2.0, 1.0), (2.0, 1.0, 1.0)])
def test_sums_of_outer_products_are_right_and_silent(device, lines, values):
    s, t = np.array(values)[:, None], np.array(values)[None, :]
    symmetric, skew = (W + W.T) / 2, (W - W.T) / 2
    expected = (s + t) * symmetric + (s * s + t * t) / (s + t) * skew
    found = gradient(dyads, np.diag(values), device)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13)
    assert lines() == []


@pytest.mark.parametrize("function", [largest, entries])
@pytest.mark.parametrize("values", [(1.0, 1.0, 1.0), (2.0, 2.0, 1.0), (2.0, 1.0, 1.0)])
def test_what_no_cotangent_shows_is_counted(device, lines, function, values):
    gradient(function, np.diag(values), device)
    found = lines()
    if function is largest and values[0] != values[1]:
        assert found == []  # The largest value is a simple one.
        return
    assert len(found) == 1 and "test_repeated_values.py:" in found[0] and " 1 time" in found[0]


@pytest.mark.parametrize("function", [largest, dyads, entries])
def test_simple_values_are_silent(device, lines, function):
    gradient(function, np.diag((3.0, 2.0, 1.0)), device)
    assert lines() == []
