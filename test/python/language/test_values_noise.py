"""Noise against its definition in float64 and by its properties; random draws by distribution."""

import numpy as np
import pytest

import warp as wp
from builtin_values import to_numpy
from noise_values import STATE, noise

SEED = 42


@pytest.fixture(autouse=True)
def quiet(monkeypatch):
    monkeypatch.setattr(wp.config, "quiet", True)


def point_type(n):
    return wp.float32 if n == 1 else wp.types.vector(n, wp.float32)


def points_of(n, low=-4.0, high=4.0, count=300):
    points = np.random.default_rng(SEED).uniform(low, high, (count, n))
    return points.astype(np.float32).astype(np.float64)


def evaluate(function, points, target, n):
    """function(state, point) of each point."""

    @wp.kernel
    def apply(x: wp.array(dtype=point_type(n)), y: wp.array(dtype=target)):
        i = wp.tid()
        y[i] = function(wp.uint32(STATE), x[i])

    values = points[:, 0] if n == 1 else points
    x = wp.array(values, dtype=point_type(n))
    y = wp.zeros(len(points), dtype=target)
    wp.launch(apply, dim=len(points), inputs=[x], outputs=[y])
    return to_numpy(y)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_noise(n):
    points = points_of(n)
    result = evaluate(wp.noise, points, wp.float32, n)
    np.testing.assert_allclose(result, noise(points), atol=3e-6)
    assert not evaluate(wp.noise, np.round(points), wp.float32, n).any()


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_gradient_of_noise(n):
    points, h = points_of(n), 1e-5
    result = evaluate(wp.noise_gradient, points, point_type(n), n).reshape(-1, n)
    for axis, step in enumerate(h * np.eye(n)):
        difference = (noise(points + step) - noise(points - step)) / (2 * h)
        np.testing.assert_allclose(result[:, axis], difference, atol=2e-5)


@wp.func
def repeated(state: wp.uint32, x: float):
    return wp.pnoise(state, x, 3)


@wp.func
def repeated(state: wp.uint32, x: wp.vec2):  # noqa: F811
    return wp.pnoise(state, x, 3, 4)


@wp.func
def repeated(state: wp.uint32, x: wp.vec3):  # noqa: F811
    return wp.pnoise(state, x, 3, 4, 5)


@wp.func
def repeated(state: wp.uint32, x: wp.vec4):  # noqa: F811
    return wp.pnoise(state, x, 3, 4, 5, 6)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_periodic_noise(n):
    period = np.array([3, 4, 5, 6][:n])
    points = np.round(points_of(n) * 16) / 16
    result = evaluate(repeated, points, wp.float32, n)
    np.testing.assert_allclose(result, noise(points, period), atol=3e-6)
    np.testing.assert_array_equal(evaluate(repeated, points + period, wp.float32, n), result)


@wp.func
def octaves(state: wp.uint32, x: wp.vec2):
    return wp.curlnoise(state, x, wp.uint32(3), 2.0, 0.5)


@wp.func
def in_space(state: wp.uint32, x: wp.vec3):
    return wp.curlnoise(state, x, wp.uint32(2))


def test_curl_noise_has_no_divergence():
    points = points_of(2)
    result = evaluate(octaves, points, wp.vec2, 2)
    h, expected = 1e-5, np.zeros_like(points)
    for octave in range(3):
        f = 2.0**octave
        x, y = ((noise(f * points + s) - noise(f * points - s)) / (2 * h) for s in h * np.eye(2))
        expected += 0.5**octave * np.stack([-y, x], axis=1)
    np.testing.assert_allclose(result, expected, atol=1e-4)

    points, h, divergence = points_of(3), 2.0**-6, 0.0
    for axis, step in enumerate(h * np.eye(3)):
        ahead = evaluate(in_space, points + step, wp.vec3, 3)[:, axis]
        divergence += (ahead - evaluate(in_space, points - step, wp.vec3, 3)[:, axis]) / (2 * h)
    size = np.abs(evaluate(in_space, points, wp.vec3, 3)).mean()
    assert np.abs(divergence).mean() <= 0.02 * size


@pytest.mark.parametrize("mean", [0.0, 0.5, 4.0, 9.99, 10.0, 30.0, 1000.0])
def test_poisson(mean):
    @wp.kernel
    def draw(y: wp.array(dtype=wp.uint32), after: wp.array(dtype=wp.uint32), lam: float):
        i = wp.tid()
        state = wp.rand_init(7, i)
        y[i] = wp.poisson(state, lam)
        after[i] = state

    count = 40000
    y, after = wp.zeros(count, dtype=wp.uint32), wp.zeros(count, dtype=wp.uint32)
    wp.launch(draw, dim=count, inputs=[y, after, mean])
    drawn = y.numpy().astype(np.float64)
    # Five standard errors of the mean and of the variance.
    assert abs(drawn.mean() - mean) <= 5 * np.sqrt(mean / count)
    assert abs(drawn.var() - mean) <= 5 * np.sqrt((2 * mean**2 + mean) / count)
    assert len(np.unique(after.numpy())) > 0.99 * count


def test_sampling_by_cumulative_probabilities():
    @wp.kernel
    def draw(cdf: wp.array(dtype=float), y: wp.array(dtype=int)):
        i = wp.tid()
        state = wp.rand_init(3, i)
        first = wp.sample_cdf(state, cdf)
        y[i] = wp.sample_cdf(state, cdf) * 4 + first

    shares = np.array([0.1, 0.2, 0.0, 0.7])
    y = wp.zeros(20000, dtype=int)
    wp.launch(draw, dim=20000, inputs=[wp.array(np.cumsum(shares), dtype=float), y])
    found = np.bincount(y.numpy(), minlength=16).reshape(4, 4) / 20000
    np.testing.assert_allclose(found, np.outer(shares, shares), atol=0.015)
