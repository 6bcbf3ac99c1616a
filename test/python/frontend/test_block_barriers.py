"""Native code that lets the threads of a block wait: a barrier, without a compiler of C++."""

import numpy as np
import pytest

import warp as wp


@wp.func_native("WP_TILE_SYNC();")
def wait(): ...


@wp.func_native("#if defined(__CUDA_ARCH__)\n  __syncthreads();\n#endif")
def wait_on_gpus(): ...


@wp.kernel
def exchange(
    x: wp.array2d(dtype=float),
    shared: wp.array2d(dtype=float),
    y: wp.array2d(dtype=float),
    done: wp.array(dtype=bool),
):
    block, thread = wp.tid()
    if done[block]:
        return
    count = wp.block_dim()
    for k in range(3):
        shared[block, thread] = x[block, thread] + float(k)
        wait()
        y[block, thread] += shared[block, (thread + 1) % count]
        wait_on_gpus()


@wp.kernel
def some_wait(x: wp.array(dtype=float)):
    thread = wp.tid()
    if thread > 3:
        wait()
    x[thread] = 1.0


@pytest.mark.parametrize("threads", [1, 32, 48, 256])
def test_threads_see_what_others_wrote(device, threads, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    x = np.random.default_rng(threads).random((50, threads), np.float32)
    done = np.arange(50) % 3 == 1
    y, shared = (wp.zeros(x.shape, dtype=float, device=device) for _ in range(2))
    given = [wp.array(x, device=device), shared, y, wp.array(done, device=device)]
    wp.launch_tiled(exchange, 50, given, block_dim=threads, device=device)
    neighbors = np.roll(x.astype(np.float64), -1, axis=1)
    expected = np.where(done[:, None], 0.0, 3.0 * neighbors + 3.0)
    np.testing.assert_allclose(y.numpy(), expected, rtol=4e-7)


def test_all_threads_have_to_come_by(device, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    x = wp.zeros(64, dtype=float, device=device)
    with pytest.raises(RuntimeError, match="all threads of a block have to come by") as problem:
        wp.launch(some_wait, 64, [x], device=device, block_dim=64)
        wp.synchronize()
    assert "wait()" in str(problem.value)
