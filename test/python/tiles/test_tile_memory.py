"""Block memory beyond what GPUs give without being asked, and beyond what they have."""

import numpy as np
import pytest

import warp as wp
from warp.extend import errors


def reversed_rows(rows):
    @wp.kernel(module="unique", module_options={"block_dim": 64})
    def work(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
        t = wp.tile_load(x, shape=(rows, 128))
        wp.tile_store(y, t[::-1])
        wp.tile_store(x, wp.tile_transpose(wp.tile_transpose(t)) * 2.0)

    return work


@pytest.mark.parametrize("rows", [16, 96, 128, 192])
def test_large_tiles(rows, device):
    values = np.random.default_rng(rows).random((rows, 128), dtype=np.float32)
    x = wp.array(values, dtype=float, device=device)
    y = wp.zeros_like(x)
    wp.launch_tiled(reversed_rows(rows), dim=[1], inputs=[x, y], block_dim=64, device=device)
    assert np.array_equal(y.numpy(), values[::-1])
    assert np.array_equal(x.numpy(), 2 * values)


def test_launches_ask_for_what_is_not_there_anyway():
    assert ".extern .shared" in reversed_rows(128).ir("ptx", arch=90)
    assert ".extern .shared" not in reversed_rows(64).ir("ptx", arch=90)


@pytest.mark.parametrize("arch, most", [(75, 65536), (86, 101376), (80, 166912), (90, 232448)])
def test_more_than_a_block_can_get(arch, most):
    fits = most // 512
    assert ".entry" in reversed_rows(fits).ir("ptx", arch=arch)
    with pytest.raises(errors.WarpCompileError, match=f"which has {most}; make") as error:
        reversed_rows(fits + 1).ir("ptx", arch=arch)
    assert f"tile(dtype=float32, shape=({fits + 1}, 128))" in str(error.value)
