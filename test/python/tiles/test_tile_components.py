"""Threads of a block that change parts of one element of a tile: each changes its own part."""

import numpy as np
import pytest
from support.block_program import run_launch

import warp as wp


@pytest.fixture(autouse=True)
def cpu_blocks(monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)


@wp.kernel
def components(o: wp.array(dtype=wp.vec4)):
    i = wp.tid()
    t = wp.tile_zeros(shape=(2,), dtype=wp.vec4)
    t[i // 4][i % 4] = float(i + 1)
    wp.tile_store(o, t)


@wp.kernel
def in_shared_memory(o: wp.array(dtype=wp.vec4)):
    i = wp.tid()
    t = wp.tile_zeros(shape=(2,), dtype=wp.vec4, storage="shared")
    t[i // 4][i % 4] = float(i + 1)
    wp.tile_store(o, t)


@wp.kernel
def counted_from_the_end(o: wp.array(dtype=wp.vec4)):
    i = wp.tid()
    t = wp.tile_zeros(shape=(2,), dtype=wp.vec4)
    t[i // 4 - 2][i % 4 - 4] = float(i + 1)
    wp.tile_store(o, t)


@wp.kernel
def through_a_row(o: wp.array(dtype=wp.vec4)):
    i = wp.tid()
    t = wp.tile_zeros(shape=(3, 2), dtype=wp.vec4)
    row = t[1]
    row[i // 4][i % 4] = float(i + 1)
    wp.tile_store(o, t[1])


@wp.kernel
def by_augmented_assignment(o: wp.array(dtype=wp.vec4)):
    i = wp.tid()
    t = wp.tile_ones(shape=(2,), dtype=wp.vec4)
    # Two threads add to each component, and one takes something off.
    t[i // 4][i % 4] += float(i)
    t[1 - i // 4][i % 4] += 1.0
    t[i // 4][i % 4] -= 1.0
    wp.tile_store(o, t)


COMPONENTS = (components, in_shared_memory, counted_from_the_end, through_a_row,
              by_augmented_assignment)  # fmt: skip


@pytest.mark.parametrize("kernel", COMPONENTS, ids=lambda one: one.key)
def test_components_of_vectors(device, kernel):
    o = wp.zeros(2, dtype=wp.vec4, device=device)
    wp.launch(kernel, dim=8, inputs=[o], block_dim=8, device=device)
    np.testing.assert_array_equal(o.numpy(), np.arange(1.0, 9.0).reshape(2, 4))


@pytest.mark.parametrize("kernel", COMPONENTS, ids=lambda one: one.key)
@pytest.mark.parametrize("seed", range(3))
def test_code_for_a_gpu(kernel, seed):
    """By threads in any order."""
    o = np.zeros((2, 4), dtype=np.float32)
    run_launch(kernel, [o], 8, 8, seed)
    np.testing.assert_array_equal(o, np.arange(1.0, 9.0).reshape(2, 4))


@wp.kernel
def by_slices(o: wp.array(dtype=wp.vec4), a: wp.array(dtype=wp.vec4)):
    i = wp.tid()
    t = wp.tile_ones(shape=(2,), dtype=wp.vec4)
    t[i][0:2] = wp.vec2(5.0, 6.0)
    t[1 - i][2:4] = wp.vec2(7.0 + float(i), 8.0)
    t[0][1:3] += wp.vec2(1.0, 2.0)
    t[i][3:4] *= 2.0
    wp.tile_store(o, t)
    if i == 0:
        a[0][0:2] = wp.vec2(5.0, 6.0)
    else:
        a[0][2:4] *= 2.0


def test_slices_of_components(device):
    o, a = wp.zeros(2, dtype=wp.vec4, device=device), wp.ones(1, dtype=wp.vec4, device=device)
    wp.launch(by_slices, dim=2, inputs=[o, a], block_dim=2, device=device)
    np.testing.assert_array_equal(o.numpy(), [[5, 6 + 2, 8 + 4, 16], [5, 6, 7, 16]])
    np.testing.assert_array_equal(a.numpy(), [[5, 6, 2, 2]])
