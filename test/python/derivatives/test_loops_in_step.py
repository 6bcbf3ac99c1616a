"""Adjoints of loops that threads leave at different times, for any number of lanes."""

import numpy as np
import pytest

import warp as wp

F = wp.float64
LANES = [1, 4, 16]


def transmitted(weights, limit, depth):
    """A sum over layers that ends where little is left: value, and slopes by `depth` and `weights`.

    The formulas of `march` below in reverse, for one thread.
    """
    left, layers = 1.0, []
    total = 0.0
    for k, weight in enumerate(weights):
        share = weight * np.exp(-depth * k)
        if left * (1.0 - share) < limit:
            break
        layers.append((left, share))
        total += share * left
        left *= 1.0 - share
    by_weight, by_depth, by_left = np.zeros_like(weights), 0.0, 0.0
    for k in reversed(range(len(layers))):
        left, share = layers[k]
        by_share = left - by_left * left
        by_left = share + by_left * (1.0 - share)
        by_weight[k] = by_share * np.exp(-depth * k)
        by_depth -= by_share * share * k
    return total, by_depth, by_weight


def march(lanes):
    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def march(
        x: wp.array(dtype=F), a: wp.array(dtype=F), limits: wp.array(dtype=F),
        out: wp.array(dtype=F), n: int,
    ):  # fmt: skip
        i = wp.tid()
        left = F(1.0)
        total = F(0.0)
        for k in range(n):
            share = a[k] * wp.exp(-x[i] * F(k))
            if left * (F(1.0) - share) < limits[i]:
                break
            total += share * left
            left = left * (F(1.0) - share)
        out[i] = total

    return march


@pytest.mark.parametrize("lanes", LANES)
@pytest.mark.parametrize("n", [0, 1, 31, 33, 200])
@pytest.mark.parametrize("threads", [1, 37])
def test_loop_left_by_break(lanes, n, threads):
    """Each thread counts the layers that it came to, none at all among them."""
    rng = np.random.default_rng(n)
    x, a = rng.random(threads) * 0.05, rng.random(n + 1) * 0.1
    limits = rng.random(threads)
    seeds = rng.normal(size=threads)
    arrays = [wp.array(v, dtype=F, device="cpu", requires_grad=True) for v in (x, a, limits)]
    out = wp.zeros(threads, dtype=F, device="cpu", requires_grad=True)
    kernel = march(lanes)
    with wp.Tape() as tape:
        wp.launch(kernel, threads, [*arrays, out, n], device="cpu")
    tape.backward(grads={out: wp.array(seeds, dtype=F, device="cpu")})
    wanted = [transmitted(a[:n], limit, depth) for limit, depth in zip(limits, x)]
    np.testing.assert_allclose(out.numpy(), [w[0] for w in wanted], rtol=1e-12, atol=1e-14)
    by_depth = [seed * w[1] for seed, w in zip(seeds, wanted)]
    np.testing.assert_allclose(arrays[0].grad.numpy(), by_depth, rtol=1e-10, atol=1e-12)
    by_weight = sum(seed * w[2] for seed, w in zip(seeds, wanted))
    np.testing.assert_allclose(arrays[1].grad.numpy()[:n], by_weight, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("lanes", LANES)
def test_loop_until_small(lanes):
    """x -> x * x * c until it is below a limit: x^(2^k) c^(2^k - 1) after k steps."""

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def squares(x: wp.array(dtype=F), c: wp.array(dtype=F), out: wp.array(dtype=F)):
        i = wp.tid()
        v = x[i]
        while v > F(0.1):
            v = v * v * c[0]
        out[i] = v

    x = np.linspace(0.05, 0.999, 61)
    c = 0.9
    arrays = [wp.array(v, dtype=F, device="cpu", requires_grad=True) for v in (x, np.array([c]))]
    out = wp.zeros(len(x), dtype=F, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(squares, len(x), [*arrays, out], device="cpu")
    tape.backward(grads={out: wp.array(np.ones(len(x)), dtype=F, device="cpu")})
    steps = np.zeros(len(x))
    v = x.copy()
    while (v > 0.1).any():
        steps[v > 0.1] += 1
        v = np.where(v > 0.1, v * v * c, v)
    power = 2.0**steps
    np.testing.assert_allclose(out.numpy(), x**power * c ** (power - 1), rtol=1e-12)
    by_x = power * x ** (power - 1) * c ** (power - 1)
    np.testing.assert_allclose(arrays[0].grad.numpy(), by_x, rtol=1e-10)
    by_c = ((power - 1) * x**power * c ** (power - 2)).sum()
    np.testing.assert_allclose(arrays[1].grad.numpy(), [by_c], rtol=1e-10)


@pytest.mark.parametrize("lanes", LANES)
def test_loop_in_a_branch_and_in_a_loop(lanes):
    """Products of the elements before the first that is too large, twice, in odd threads."""

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def products(x: wp.array2d(dtype=F), out: wp.array(dtype=F)):
        i = wp.tid()
        total = F(1.0)
        if i % 2 == 1:
            for _ in range(2):
                part = F(1.0)
                k = int(0)
                while k < x.shape[1] and x[i, k] < F(1.5):
                    part = part * x[i, k]
                    k += 1
                total = total * part
        out[i] = total

    rng = np.random.default_rng(5)
    x = rng.uniform(0.8, 1.54, size=(40, 50))
    given = wp.array(x, dtype=F, device="cpu", requires_grad=True)
    out = wp.zeros(len(x), dtype=F, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(products, len(x), [given, out], device="cpu")
    tape.backward(grads={out: wp.array(np.ones(len(x)), dtype=F, device="cpu")})
    wanted = np.zeros_like(x)
    for i in range(1, len(x), 2):
        large = np.flatnonzero(x[i] >= 1.5)
        end = large[0] if len(large) else x.shape[1]
        wanted[i, :end] = 2.0 * np.prod(x[i, :end]) ** 2 / x[i, :end]
    np.testing.assert_allclose(given.grad.numpy(), wanted, rtol=1e-9)
