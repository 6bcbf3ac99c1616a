"""Kernels whose tiles of a block's threads fit blocks of several threads only."""

from typing import Any

import numpy as np
import pytest

import warp as wp
from warp.extend import errors


@pytest.fixture
def blocks(monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)


@wp.kernel
def reshaped(out: wp.array2d(dtype=float)):
    _, thread = wp.tid()
    wp.tile_store(out, wp.tile_reshape(wp.tile(float(thread)), shape=(6, 8)))


@wp.kernel
def picked(out: wp.array2d(dtype=Any)):
    _, thread = wp.tid()
    t = wp.tile(out.dtype(thread))
    out[0, 0] = t[25]
    out[0, 1] = t[-2]


@wp.kernel
def part(out: wp.array2d(dtype=float)):
    _, thread = wp.tid()
    wp.tile_store(out[0], wp.tile(float(thread))[8:16])


@wp.kernel
def product(x: wp.array2d(dtype=float), out: wp.array2d(dtype=float)):
    """x x^T of 6 x 8 numbers, one of each thread."""
    _, thread = wp.tid()
    a = wp.tile_reshape(wp.tile(x[thread // 8, thread % 8]), shape=(6, 8))
    wp.tile_store(out, wp.tile_matmul(a, wp.tile_transpose(a)))


@wp.kernel
def wrong(out: wp.array2d(dtype=float)):
    t = wp.tile(1.0)
    out[0, 0] = t[2000]


def launched(kernel, threads=48, shape=(6, 8), inputs=(), dtype=float):
    out = wp.zeros(shape, dtype=dtype, device="cpu")
    wp.launch_tiled(kernel, 1, [*inputs, out], block_dim=threads, device="cpu")
    return out.numpy()


def test_blocks_of_the_launch(blocks):
    """48 is no number of threads that anybody else would try."""
    assert launched(reshaped).ravel().tolist() == list(range(48))
    assert launched(part)[0].tolist() == list(range(8, 16))
    for threads, dtype in ((48, float), (40, wp.float64), (64, wp.float16)):
        assert launched(picked, threads, dtype=dtype)[0, :2].tolist() == [25, threads - 2]


def test_gradients(blocks):
    given = np.random.default_rng(3).normal(size=(6, 8)).astype(np.float32)
    x = wp.array(given, dtype=float, device="cpu", requires_grad=True)
    out = wp.zeros((6, 6), dtype=float, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch_tiled(product, 1, [x, out], block_dim=48, device="cpu")
    np.testing.assert_allclose(out.numpy(), given @ given.T, rtol=1e-5, atol=1e-5)
    seed = np.random.default_rng(4).normal(size=(6, 6)).astype(np.float32)
    tape.backward(grads={out: wp.array(seed, dtype=float, device="cpu")})
    np.testing.assert_allclose(x.grad.numpy(), (seed + seed.T) @ given, rtol=1e-4, atol=1e-4)


def test_code_for_gpus():
    for kernel in (reshaped, part):
        fitting = wp.Kernel(kernel.func, key=f"{kernel.key}_48", options={"block_dim": 48})
        assert ".entry" in fitting.ir("ptx", arch=90)


@pytest.mark.parametrize("kernel", [picked, part, wrong])
def test_blocks_of_one_thread(kernel):
    """Each launch says what is wrong, and what would do where something would."""
    for _ in range(2):
        with pytest.raises(errors.WarpCodegenError, match=r"\(1,\)|size 1|1 elements") as caught:
            launched(kernel, 64)
        has_way = "enable_cpu_blocks = True" in str(caught.value)
        assert has_way == (kernel is not wrong)


def test_too_few_threads(blocks):
    with pytest.raises(errors.WarpCodegenError, match="offset 25 is out of bounds .* size 16"):
        launched(picked, 16)
    with pytest.raises(errors.WarpCodegenError, match="offset 2000 is out of bounds"):
        launched(wrong, 64)


def test_recorded_launches(blocks):
    out = wp.zeros((6, 8), dtype=float, device="cpu")
    given = {"block_dim": 48, "device": "cpu", "record_cmd": True}
    recorded = wp.launch(reshaped, (1, 48), [out], **given)
    recorded.launch()
    assert out.numpy().ravel().tolist() == list(range(48))
