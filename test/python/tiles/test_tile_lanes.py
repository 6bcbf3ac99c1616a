"""Blocks of several threads, on a GPU and, with `enable_cpu_blocks`, on a CPU, against NumPy."""

import numpy as np
import pytest

import warp as wp

B = 32


@pytest.fixture(autouse=True)
def blocks(monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)


@wp.kernel
def attract(x: wp.array(dtype=wp.vec3), a: wp.array(dtype=wp.vec3), blocks: int):
    i, lane = wp.tid()
    mine = x[i * wp.block_dim() + lane]
    sum = wp.vec3()
    for b in range(blocks):
        others = wp.tile_load(x, shape=wp.block_dim(), offset=b * wp.block_dim())
        for j in range(wp.block_dim()):
            d = others[j] - mine
            sum += d / (wp.dot(d, d) + 0.1)
    a[i * wp.block_dim() + lane] = sum


def attraction(x):
    d = x[None] - x[:, None]
    return (d / ((d * d).sum(-1, keepdims=True) + 0.1)).sum(1)


def test_elements_that_all_threads_read(device):
    x = np.random.default_rng(0).normal(size=(4 * B, 3)).astype(np.float32)
    a = wp.zeros(4 * B, dtype=wp.vec3, device=device)
    given = wp.array(x, dtype=wp.vec3, device=device)
    wp.launch_tiled(attract, dim=4, inputs=[given, a, 4], block_dim=B, device=device)
    np.testing.assert_allclose(a.numpy(), attraction(x.astype(float)), rtol=2e-5, atol=2e-5)


@wp.kernel
def exchange(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    i, lane = wp.tid()
    v = x[i * wp.block_dim() + lane]
    t = wp.tile(v * 2.0)
    # The result belongs to another thread.
    w = wp.untile(wp.tile_map(wp.neg, t)) + t[wp.block_dim() - 1 - lane]
    total = wp.tile_sum(wp.tile(w))
    if lane % 2 == 0:
        w = w + 1.0
    out[i * wp.block_dim() + lane] = w + total[0]


@pytest.mark.parametrize("threads", [2, 32, 48, 256])
def test_values_of_threads_go_through_tiles(device, threads):
    x = np.random.default_rng(1).normal(size=(3, threads)).astype(np.float32)
    out = wp.zeros(3 * threads, dtype=float, device=device)
    given = wp.array(x.ravel(), device=device)
    wp.launch_tiled(exchange, dim=3, inputs=[given, out], block_dim=threads, device=device)
    x = x.astype(float)
    w = 2 * x[:, ::-1] - 2 * x
    expected = w + w.sum(1, keepdims=True) + (np.arange(threads) % 2 == 0)
    np.testing.assert_allclose(out.numpy().reshape(3, -1), expected, rtol=1e-5, atol=1e-4)


@wp.kernel
def update(keys: wp.array(dtype=int), counts: wp.array2d(dtype=int)):
    i, lane = wp.tid()
    t = wp.tile_zeros(shape=8, dtype=int)
    key = keys[i * wp.block_dim() + lane]
    t[key] += 1
    wp.tile_scatter_add(t, 0, 100, lane < 3)
    wp.tile_store(counts[i], t)


def test_threads_change_elements(device):
    keys = np.random.default_rng(2).integers(0, 8, (5, B)).astype(np.int32)
    counts = wp.zeros((5, 8), dtype=int, device=device)
    given = wp.array(keys.ravel(), device=device)
    wp.launch_tiled(update, dim=5, inputs=[given, counts], block_dim=B, device=device)
    expected = np.array([np.bincount(row, minlength=8) for row in keys])
    expected[:, 0] += 300
    np.testing.assert_array_equal(counts.numpy(), expected)


@wp.kernel
def smooth(x: wp.array(dtype=float), out: wp.array(dtype=float), rounds: int):
    i = wp.tid()
    lane = i % wp.block_dim()
    v = x[i]
    for _r in range(rounds):
        t = wp.tile(v)
        v = 0.5 * (t[lane] + t[(lane + 1) % wp.block_dim()])
    out[i] = wp.sin(v)


def smoothed(x, rounds):
    for _ in range(rounds):
        x = 0.5 * (x + np.roll(x, -1, axis=1))
    return np.sin(x)


def test_loops_carry_what_threads_have(device):
    x = np.random.default_rng(3).normal(size=(4, B)).astype(np.float32)
    out = wp.zeros(4 * B, dtype=float, device=device)
    given = wp.array(x.ravel(), device=device)
    wp.launch(smooth, dim=4 * B, inputs=[given, out, 5], block_dim=B, device=device)
    np.testing.assert_allclose(out.numpy().reshape(4, B), smoothed(x.astype(float), 5), atol=1e-6)


@wp.kernel
def correlate(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    i, lane = wp.tid()
    v = x[i * wp.block_dim() + lane]
    t = wp.tile(v * v)
    s = wp.tile_sum(t)
    out[i * wp.block_dim() + lane] = s[0] * v + t[(lane + 3) % wp.block_dim()]


def test_gradients(device):
    rng = np.random.default_rng(4)
    x, g = rng.normal(size=(2, 2, B)).astype(np.float32)
    given = wp.array(x.ravel(), requires_grad=True, device=device)
    out = wp.zeros(2 * B, dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch_tiled(correlate, dim=2, inputs=[given, out], block_dim=B, device=device)
    tape.backward(grads={out: wp.array(g.ravel(), device=device)})
    x, g = x.astype(float), g.astype(float)
    s = (x * x).sum(1, keepdims=True)
    expected = g * s + 2 * x * (g * x).sum(1, keepdims=True) + 2 * x * np.roll(g, 3, axis=1)
    np.testing.assert_allclose(given.grad.numpy().reshape(2, B), expected, rtol=2e-5, atol=2e-4)


@wp.kernel
def double_and_sum(
    x: wp.array(dtype=float), out: wp.array(dtype=float), sums: wp.array(dtype=float)
):
    i = wp.tid()
    out[i] = 2.0 * x[i]
    wp.tile_store(sums, wp.tile_sum(wp.tile(x[i])), offset=i // 32)


def test_the_last_block_of_a_cpu_may_be_smaller():
    x = np.random.default_rng(5).normal(size=75).astype(np.float32)
    out, sums = (wp.zeros(count, dtype=float, device="cpu") for count in (75, 3))
    inputs = [wp.array(x, device="cpu"), out, sums]
    wp.launch(double_and_sum, dim=75, inputs=inputs, block_dim=32, device="cpu")
    np.testing.assert_array_equal(out.numpy(), 2 * x)
    expected = np.pad(x.astype(float), (0, 21)).reshape(3, 32).sum(1)
    np.testing.assert_allclose(sums.numpy(), expected, rtol=1e-5, atol=1e-5)


def test_blocks_have_at_most_1024_threads(device):
    with pytest.raises(wp.WarpLaunchError, match="at most 1024"):
        wp.launch_tiled(update, dim=1, inputs=[None, None], block_dim=1025, device=device)


@wp.kernel
def elsewhere(
    x: wp.array(dtype=float), places: wp.array(dtype=int), loaded: wp.array(dtype=float),
    stored: wp.array(dtype=float), rows: wp.array2d(dtype=float), sums: wp.array(dtype=float),
):  # fmt: skip
    _i, lane = wp.tid()
    by = places[lane] - lane
    t = wp.tile_load(x, shape=B, offset=by)
    wp.tile_store(loaded, t)
    u = wp.tile_load(x, shape=B)
    wp.tile_store(stored, u, offset=by)
    v = wp.tile_load(rows, shape=(2, B)) + wp.tile_ones((2, B), dtype=float)
    wp.tile_store(rows, v, offset=(0, by))
    wp.tile_atomic_add(sums, u, offset=places[lane] % 2 - lane)


def test_offsets_that_differ_between_threads(device):
    """Element e goes where thread e mod B says; outside of the array, nowhere."""
    rng = np.random.default_rng(6)
    x = rng.normal(size=B).astype(np.float32)
    places = rng.permutation(B).astype(np.int32)
    places[3] = -1
    rows = np.arange(2.0 * B, dtype=np.float32).reshape(2, B)
    given = [wp.array(one, device=device) for one in (x, places)]
    loaded, stored = (wp.zeros(B, dtype=float, device=device) for _ in range(2))
    changed, sums = wp.array(rows, device=device), wp.zeros(2, dtype=float, device=device)
    inputs = [*given, loaded, stored, changed, sums]
    wp.launch_tiled(elsewhere, dim=1, inputs=inputs, block_dim=B, device=device)
    inside = places >= 0
    np.testing.assert_array_equal(loaded.numpy(), np.where(inside, x[places], 0))
    expected = np.zeros(B, dtype=np.float32)
    expected[places[inside]] = x[inside]
    np.testing.assert_array_equal(stored.numpy(), expected)
    expected = rows.copy()
    expected[:, places[inside]] = rows[:, inside] + 1
    np.testing.assert_array_equal(changed.numpy(), expected)
    expected = [x[np.fmod(places, 2) == k].astype(float).sum() for k in range(2)]
    np.testing.assert_allclose(sums.numpy(), expected, rtol=1e-5, atol=1e-6)
