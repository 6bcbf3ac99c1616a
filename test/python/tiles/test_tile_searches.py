"""Searches that a block makes together: loops that add up over the block until all are content."""

import numpy as np
import pytest

import warp as wp

STEPS, ROWS = 40, 150
COUNTED = True


@wp.kernel
def find_root(
    a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), root: wp.array(dtype=float),
    steps: wp.array(dtype=int)
):  # fmt: skip
    """The x at which the rising function sum(max(a x - b, 0)) - 1 is 0, by bisection."""
    i, thread = wp.tid()
    low, high, taken = float(0.0), float(8.0), int(0)
    for _ in range(STEPS):
        x = 0.5 * (low + high)
        own = float(0.0)
        for k in range(thread, ROWS, wp.block_dim()):
            own += wp.max(a[i, k] * x - b[i, k], 0.0)
        total = wp.tile_reduce(wp.add, wp.tile(own))[0] - 1.0
        if wp.static(COUNTED):
            taken += 1
        if wp.abs(total) < 1.0e-4:
            low = x
            break
        if total > 0.0:
            high = x
        else:
            low = x
    if thread == 0:
        root[i] = low
        steps[i] = taken


@pytest.mark.parametrize("threads", [1, 32, 64])
def test_bisection_stops_when_it_has_the_root(device, threads, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    rng = np.random.default_rng(3)
    a, b = rng.uniform(0.1, 1.0, (2, 20, ROWS)).astype(np.float32)
    b *= np.linspace(0.2, 4.0, 20, dtype=np.float32)[:, None]
    root = wp.zeros(20, dtype=float, device=device)
    steps = wp.zeros(20, dtype=int, device=device)
    inputs = [wp.array(one, device=device) for one in (a, b)]
    wp.launch_tiled(
        find_root, dim=20, inputs=inputs, outputs=[root, steps], block_dim=threads, device=device
    )
    found = root.numpy().astype(float)[:, None]
    assert np.all(abs(np.maximum(a * found - b, 0.0).sum(axis=1) - 1.0) < 2e-4)
    assert np.all((steps.numpy() > 3) & (steps.numpy() < STEPS))


def test_the_loop_is_said_once():
    """It asks for a setting, which does not change from step to step."""
    assert find_root.ir("warp").count("warp.tile_reduce") == 1
