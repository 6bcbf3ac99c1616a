"""Lanes that share a quotient of the thread index, in launches that end or begin anywhere."""

import numpy as np
import pytest

import warp as wp


@wp.kernel(module="unique")
def blend(
    x: wp.array(dtype=float), weight: wp.array(dtype=float), items: wp.array2d(dtype=int),
    out: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    tile = i // 16
    total = float(0.0)
    for k in range(items.shape[1]):
        total += weight[items[tile, k]] * wp.sin(x[i] * float(k))
    out[i] = total


@pytest.mark.parametrize("n", [1, 15, 16, 17, 100, 1000, 40003])
def test_list_for_each_tile(n):
    rng = np.random.default_rng(n)
    x, weight = rng.random(n), rng.random(50)
    items = rng.integers(0, 50, size=(n // 16 + 1, 20))
    given = [
        wp.array(x, dtype=float, device="cpu", requires_grad=True),
        wp.array(weight, dtype=float, device="cpu", requires_grad=True),
        wp.array(items, dtype=int, device="cpu"),
    ]
    out = wp.zeros(n, dtype=float, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(blend, n, [*given, out], device="cpu")
    tape.backward(grads={out: wp.ones(n, dtype=float, device="cpu")})
    k = np.arange(20)
    picked = items[np.arange(n) // 16]
    waves = np.sin(np.outer(x, k))
    np.testing.assert_allclose(out.numpy(), (weight[picked] * waves).sum(1), rtol=1e-4, atol=1e-5)
    by_x = (weight[picked] * np.cos(np.outer(x, k)) * k).sum(1)
    np.testing.assert_allclose(given[0].grad.numpy(), by_x, rtol=1e-4, atol=1e-4)
    by_weight = np.zeros(50)
    np.add.at(by_weight, picked, waves)
    np.testing.assert_allclose(given[1].grad.numpy(), by_weight, rtol=1e-4, atol=1e-3)


@wp.kernel(module="unique")
def columns(
    x: wp.array2d(dtype=float), weight: wp.array3d(dtype=float), shift: int,
    out: wp.array2d(dtype=float),
):  # fmt: skip
    i, j = wp.tid()
    tile = (j + 16 * shift) // 16
    total = float(0.0)
    for k in range(weight.shape[2]):
        total += weight[i // 8, tile, k] * wp.sin(x[i, j] + float(k))
    out[i, j] = total


@pytest.mark.parametrize("shape", [(1, 1), (3, 37), (50, 64), (301, 133)])
@pytest.mark.parametrize("shift", [0, 2])
def test_rows_of_tiles(shape, shift):
    """Threads of a row begin at its first column, whatever the length of rows."""
    rng = np.random.default_rng(3)
    x = rng.random(shape)
    weight = rng.random((shape[0] // 8 + 1, shape[1] // 16 + 3, 12))
    out = wp.zeros(shape, dtype=float, device="cpu")
    given = [wp.array(v, dtype=float, device="cpu") for v in (x, weight)]
    wp.launch(columns, shape, [*given, shift, out], device="cpu")
    i, j = np.indices(shape)
    picked = weight[i // 8, j // 16 + shift]
    wanted = (picked * np.sin(x[:, :, None] + np.arange(12))).sum(2)
    np.testing.assert_allclose(out.numpy(), wanted, rtol=1e-4, atol=1e-5)


def test_lanes_are_aligned():
    assert "groups that share a quotient" in str(blend.schedule("cpu"))
