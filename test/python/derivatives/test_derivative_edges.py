"""Every derivative on small integers, where vectors vanish, matrices are singular, operands equal.

Nothing comes of a cotangent of zero, and a gradient of finite results is never NaN.
"""

import numpy as np
import pytest
from warp._src.builtin_table import BUILTINS, DERIVATIVES

import warp as wp
from derivative_values import COUNT, Overload

# Outside of their domain: results are NaN there, or the launch fails.
PARTIAL = ("pow", "sym_log3", "sym_sqrt3")
SMOOTH = [
    name
    for name, derivative in DERIVATIVES.items()
    if derivative == "differentiable" and name not in PARTIAL
]


@pytest.fixture(autouse=True)
def quiet(monkeypatch):
    monkeypatch.setattr(wp.config, "quiet", True)


def check(overload, rows, random, device):
    results = overload.run(rows, device)
    none = overload.adjoint(rows, np.zeros_like(results), device)
    np.testing.assert_array_equal(none, 0, err_msg=overload.name)
    weights = random.integers(0, 2, results.shape).astype(float)
    gradients = overload.adjoint(rows, weights, device)
    finite = np.isfinite(results).all(axis=1)
    bad = np.isnan(gradients).any(axis=1) & finite
    assert not bad.any(), (overload.name, rows[bad][0], weights[bad][0], gradients[bad][0])


@pytest.mark.parametrize("name", SMOOTH)
def test_edges(device, name):
    random = np.random.default_rng(11)
    for index in range(len(BUILTINS[name][2])):
        overload = Overload(name, index)
        if not overload.is_smooth:
            continue
        width = overload.sample(random).shape[1]
        for _ in range(4):
            rows = random.choice([0.0, -0.0, 1.0, -1.0, 2.0], (COUNT, width))
            rows[0], rows[1] = 0, 1
            check(overload, rows, random, device)


@pytest.mark.parametrize("real", [wp.float32, wp.float64])
def test_reciprocal_of_a_root(device, real):
    """Derivatives of 1 / sqrt(x) multiply by it instead of dividing again, at no cost in digits."""

    @wp.kernel(module="unique")
    def invert(x: wp.array(dtype=real), y: wp.array(dtype=real)):
        i = wp.tid()
        y[i] = real(1.0) / wp.sqrt(x[i])

    values = np.concatenate([np.geomspace(1e-24, 1e24, 97), [np.inf, 0.0]])
    x = wp.array(values, dtype=real, device=device, requires_grad=True)
    y = wp.zeros(len(values), dtype=real, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(invert, len(values), [x, y], device=device)
    tape.backward(grads={y: wp.ones(len(values), dtype=real, device=device)})
    got, held = x.grad.numpy(), x.numpy().astype(np.longdouble)
    wanted = -0.5 * held[:-2] ** np.longdouble(-1.5)
    np.testing.assert_allclose(got[:-2], wanted, rtol=4 * np.finfo(got.dtype).eps)
    np.testing.assert_array_equal(got[-2:], 0.0)
