"""Gradients of a few parameters that every thread uses, in short loops."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def polynomial(w: wp.array(dtype=float), x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    total = float(0.0)
    power = float(1.0)
    for k in range(8):
        total += w[k] * power
        power *= x[i]
    y[i] = total


@wp.kernel
def layer(
    w: wp.array2d(dtype=wp.float64),
    x: wp.array2d(dtype=wp.float64),
    y: wp.array(dtype=wp.float64),
):
    i = wp.tid()
    total = wp.float64(0.0)
    for r in range(2):
        row = wp.float64(0.0)
        for c in range(3, 0, -1):
            if x[i, c - 1] > wp.float64(-0.5):
                row += w[r, c - 1] * x[i, c - 1]
        total += wp.tanh(row)
    y[i] = total


def gradient(kernel, w, x, seed, dtype, device):
    arrays = [wp.array(v, dtype=dtype, device=device, requires_grad=True) for v in (w, x)]
    y = wp.zeros(len(x), dtype=dtype, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(kernel, len(x), [*arrays, y], device=device)
    tape.backward(grads={y: wp.array(seed, dtype=dtype, device=device)})
    return arrays[0].grad.numpy()


@pytest.mark.parametrize("count", [1, 31, 257, 200_000])
def test_polynomial(device, count):
    rng = np.random.default_rng(count)
    x = rng.uniform(-1.0, 1.0, count).astype(np.float32)
    seed = rng.standard_normal(count).astype(np.float32)
    found = gradient(polynomial, rng.standard_normal(8), x, seed, float, device)
    terms = seed.astype(float) * x.astype(float) ** np.arange(8)[:, None]
    # Rounding of the powers, and of what each of up to 800 blocks adds; a sum of 32 bits over
    # all threads would lose five times as much.
    assert np.abs(found - terms.sum(1)).max() < 5e-6 * np.linalg.norm(terms, axis=1).max()


@pytest.mark.parametrize("count", [1, 100, 10_000])
def test_layer(device, count):
    rng = np.random.default_rng(count)
    w, x = rng.standard_normal((2, 3)), rng.uniform(-1.0, 1.0, (count, 3))
    seed = rng.standard_normal(count)
    found = gradient(layer, w, x, seed, wp.float64, device)
    used = np.where(x > -0.5, x, 0.0)
    slopes = seed[:, None] / np.cosh(used @ w.T) ** 2
    np.testing.assert_allclose(found, slopes.T @ used, rtol=1e-10, atol=1e-10 * count**0.5)
