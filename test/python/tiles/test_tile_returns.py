"""Threads that return before others work on tiles: those that stay, and the block, go on."""

import numpy as np
import pytest
from support.block_program import run_launch

import warp as wp

B, BLOCKS = 32, 5


@pytest.fixture(autouse=True)
def cpu_blocks(monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)


@wp.kernel
def leave(
    x: wp.array2d(dtype=float), y: wp.array2d(dtype=float), sums: wp.array(dtype=float),
    left: wp.array(dtype=int),
):  # fmt: skip
    i, lane = wp.tid()
    if x[i, lane] < 0.0:
        wp.atomic_add(left, i, 1)
        return
    v = x[i, lane]
    t = wp.tile(v)
    s = wp.tile_sum(t)
    y[i, lane] = v + s[0]
    if v > 2.0:
        return
    u = wp.tile(wp.sqrt(v) + 1.0)
    wp.tile_atomic_add(sums, wp.tile_sum(u), offset=i)


def test_sums_of_those_that_stay(device):
    rng = np.random.default_rng(1)
    given = rng.uniform(-1.0, 4.0, (BLOCKS, B)).astype(np.float32)
    given[1] = -1.0
    given[2] = 3.0
    x = wp.array(given, device=device)
    y = wp.full((BLOCKS, B), -7.0, dtype=float, device=device)
    sums, left = (wp.zeros(BLOCKS, dtype=kind, device=device) for kind in (float, int))
    wp.launch_tiled(leave, dim=BLOCKS, inputs=[x, y, sums, left], block_dim=B, device=device)
    stays = given >= 0
    np.testing.assert_array_equal(left.numpy(), (~stays).sum(1))
    kept = np.where(stays, given.astype(float), 0)
    expected = np.where(stays, given + kept.sum(1, keepdims=True), -7.0)
    np.testing.assert_allclose(y.numpy(), expected, rtol=1e-6)
    last = stays & (given <= 2)
    expected = np.where(last, np.sqrt(kept) + 1, 0).sum(1)
    np.testing.assert_allclose(sums.numpy(), expected, rtol=1e-6)


@wp.kernel
def count_down(
    x: wp.array2d(dtype=int), y: wp.array2d(dtype=int), sums: wp.array(dtype=int),
    left: wp.array(dtype=int),
):  # fmt: skip
    i, lane = wp.tid()
    if x[i, lane] < 0:
        wp.atomic_add(left, i, 1)
        return
    v = x[i, lane]
    s = wp.tile_sum(wp.tile(v))
    y[i, lane] = v + s[0]
    if v > 50:
        return
    wp.tile_atomic_add(sums, wp.tile_sum(wp.tile(v + 1)), offset=i)


@pytest.mark.parametrize("seed", range(4))
def test_code_for_a_gpu(seed):
    """By threads in any order; none waits for one that has left."""
    x = np.random.default_rng(seed).integers(-30, 100, (4, 6)).astype(np.int32)
    x[1], x[2] = -3, 60
    y = np.full_like(x, -7)
    sums, left = (np.zeros(4, dtype=np.int32) for _ in range(2))
    run_launch(count_down, [x, y, sums, left], x.shape, x.shape[1], seed)
    stays = x >= 0
    np.testing.assert_array_equal(left, (~stays).sum(1))
    all_of = np.where(stays, x, 0).sum(1, keepdims=True)
    np.testing.assert_array_equal(y, np.where(stays, x + all_of, -7))
    np.testing.assert_array_equal(sums, np.where(stays & (x <= 50), x + 1, 0).sum(1))


@wp.kernel
def guarded(
    x: wp.array(dtype=float), n: int, out: wp.array(dtype=float), count: wp.array(dtype=int)
):
    i = wp.tid()
    if i >= n:
        return
    t = wp.tile(x[i])
    wp.tile_atomic_add(out, wp.tile_sum(t * t))
    if i % wp.block_dim() == 0:
        wp.atomic_add(count, 0, 1)


@pytest.mark.parametrize("n", [0, 1, 63, 64, 65, 128])
def test_guards_of_padded_launches(device, n):
    """A block of which no thread stays does nothing."""
    given = np.random.default_rng(n).normal(size=max(n, 1)).astype(np.float32)
    out, count = wp.zeros(1, dtype=float, device=device), wp.zeros(1, dtype=int, device=device)
    inputs = [wp.array(given, device=device), n, out, count]
    wp.launch(guarded, dim=128, inputs=inputs, block_dim=B, device=device)
    expected = (given[:n].astype(float) ** 2).sum()
    np.testing.assert_allclose(out.numpy()[0], expected, rtol=1e-5)
    assert count.numpy()[0] == -(-n // B)


@wp.kernel
def in_parts(x: wp.array(dtype=float), y: wp.array(dtype=float), z: wp.array(dtype=float)):
    _i, lane = wp.tid()
    t = wp.tile_zeros(4, dtype=float)
    if x[0] > 0.5:
        if lane >= 3:
            return
        t[lane] = 5.0
    t += wp.tile_ones(4, dtype=float)
    z[lane] = t[lane % 4]
    for k in range(2):
        wp.tile_store(y, t, offset=4 * k)


@pytest.mark.parametrize("first", [0.0, 1.0])
def test_returns_in_a_branch(device, first):
    x = wp.array([first], dtype=float, device=device)
    y, z = (wp.zeros(count, dtype=float, device=device) for count in (8, B))
    wp.launch_tiled(in_parts, dim=1, inputs=[x, y, z], block_dim=B, device=device)
    expected = np.array([6.0, 6, 6, 1] if first else [1.0, 1, 1, 1])
    np.testing.assert_array_equal(y.numpy(), np.tile(expected, 2))
    stays = 3 if first else B
    np.testing.assert_array_equal(z.numpy()[:stays], np.tile(expected, 8)[:stays])
    np.testing.assert_array_equal(z.numpy()[stays:], 0)


@wp.kernel
def squares(x: wp.array2d(dtype=float), y: wp.array(dtype=float)):
    i, lane = wp.tid()
    if x[i, lane] < 0.0:
        return
    v = x[i, lane]
    wp.tile_atomic_add(y, wp.tile_sum(wp.tile(v * v)), offset=i)


def test_gradients_of_those_that_stay(device):
    given = np.random.default_rng(3).normal(size=(BLOCKS, B)).astype(np.float32)
    x = wp.array(given, requires_grad=True, device=device)
    y = wp.zeros(BLOCKS, dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch_tiled(squares, dim=BLOCKS, inputs=[x, y], block_dim=B, device=device)
    weights = np.arange(1.0, BLOCKS + 1)
    tape.backward(grads={y: wp.array(weights, dtype=float, device=device)})
    expected = np.where(given < 0, 0, 2 * given * weights[:, None])
    np.testing.assert_allclose(x.grad.numpy(), expected, rtol=1e-6)


@wp.kernel
def leave_in_a_loop(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    _i, lane = wp.tid()
    for k in range(4):
        if x[lane] > float(k):
            return
        wp.tile_store(y, wp.tile_ones(4, dtype=float))


def test_returns_within_loops_are_refused(device):
    """Each iteration would have other threads."""
    x = wp.zeros(B, dtype=float, device=device)
    with pytest.raises(wp.WarpError, match="differs between them"):
        wp.launch_tiled(leave_in_a_loop, dim=1, inputs=[x, x], block_dim=B, device=device)
        wp.synchronize()
