"""Builtins for tiles, forwards and backwards, against NumPy in float64."""

import numpy as np
import pytest
from tile_programs import CASES

import warp as wp

EPS = float(np.finfo(np.float32).eps)


def inputs_of(shapes):
    rng = np.random.default_rng(7)
    return [rng.uniform(-1.0, 1.0, shape) for shape in shapes]


def run(name, device, threads):
    kernel, shapes, shape, reference = CASES[name]
    values = [one.astype(np.float32).astype(np.float64) for one in inputs_of(shapes)]
    arrays = [wp.array(one, dtype=float, device=device, requires_grad=True) for one in values]
    out = wp.zeros(shape, dtype=float, device=device, requires_grad=True)
    tape = wp.Tape()
    with tape:
        wp.launch_tiled(kernel, dim=1, inputs=[*arrays, out], block_dim=threads, device=device)
    return tape, values, arrays, out, reference


@pytest.mark.parametrize("threads", [32, 48])
@pytest.mark.parametrize("name", CASES)
def test_values(name, threads, device):
    _, values, _, out, reference = run(name, device, threads)
    expected = reference(*values)
    # Sums of at most 84 products of numbers below 1, and a few operations more.
    bound = 100 * EPS * np.maximum(1.0, np.abs(expected).max())
    np.testing.assert_allclose(out.numpy(), expected, rtol=0, atol=bound)


@pytest.mark.parametrize("name", CASES)
def test_gradients(name, device):
    """v . J u by central differences of the reference, for random u and v."""
    tape, values, arrays, out, reference = run(name, device, 32)
    rng = np.random.default_rng(11)
    weights = rng.uniform(-1.0, 1.0, out.shape).astype(np.float32)
    tape.backward(grads={out: wp.array(weights, dtype=float, device=device)})
    directions = [rng.uniform(-1.0, 1.0, one.shape) for one in values]
    step = 1e-6
    ahead = reference(*[x + step * u for x, u in zip(values, directions, strict=True)])
    behind = reference(*[x - step * u for x, u in zip(values, directions, strict=True)])
    expected = (weights * (ahead - behind)).sum() / (2 * step)
    found = sum(
        (a.grad.numpy().astype(np.float64) * u).sum()
        for a, u in zip(arrays, directions, strict=True)
    )
    np.testing.assert_allclose(found, expected, rtol=2e-4, atol=2e-4)
