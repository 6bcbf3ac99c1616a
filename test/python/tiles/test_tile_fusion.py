"""Values that need no memory have none: chains of loads, functions of elements, sums, stores."""

import re

import numpy as np

import warp as wp


@wp.kernel
def stream(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    t = wp.tile_load(x, shape=1024, offset=i * 1024)
    wp.tile_store(y, wp.tile_map(wp.sqrt, t) * 2.0 + t, offset=i * 1024)


@wp.kernel
def total(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    t = wp.tile_load(x, shape=1024, offset=i * 1024)
    wp.tile_store(y, wp.tile_sum(t * 2.0 + t), offset=i)


@wp.kernel
def shifted(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    wp.tile_store(y, wp.tile_load(x, shape=64) * 2.0)


def test_chain_on_a_gpu_has_no_memory_and_no_barrier():
    """For arrays that do not overlap, which this variant is for."""
    ptx = stream.ir("ptx", arch=90)
    assert "sqrt" in ptx
    assert ".shared" not in ptx and "bar.sync" not in ptx


def test_sum_on_a_gpu_has_the_memory_of_its_threads():
    """A number and a position per thread, and the sum."""
    ptx = total.ir("ptx", arch=90)
    (found,) = re.findall(r"\.shared .align \d+ .b8 \w+\[(\d+)\]", ptx)
    assert int(found) <= 256 * (4 + 8) + 64


def test_chain_on_a_cpu_is_one_loop_in_vectors():
    text = stream.ir("thread")
    # With and without tests of what is inside.
    assert text.count("scf.for") == 2 and "block_bytes = 0" in text
    assert re.search(r"sqrtps\t.*[xyz]mm", stream.ir("asm"))


def test_load_and_store_of_parts_that_overlap(device):
    """A block loads all of its elements before it stores one."""
    for source, target in ((0, 1), (1, 0)):
        values = np.arange(65, dtype=np.float32)
        a = wp.array(values, dtype=float, device=device)
        inputs = [a[source : source + 64], a[target : target + 64]]
        wp.launch_tiled(shifted, dim=1, inputs=inputs, block_dim=32, device=device)
        expected = values.copy()
        expected[target : target + 64] = 2.0 * values[source : source + 64]
        np.testing.assert_array_equal(a.numpy(), expected)
