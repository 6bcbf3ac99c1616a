"""A misfit is an error at its place."""

import subprocess
import sys

import pytest

import warp as wp


def expect(function, *words):
    """Translates a kernel, which has to fail with these words, at a line of this file."""
    with pytest.raises(wp.WarpCodegenError) as caught:
        wp.Kernel(function).ir("warp")
    text = str(caught.value)
    for word in (*words, "test_tile_errors.py", "^"):
        assert word in text, text


def test_shapes_of_a_product():
    def kernel(a: wp.array2d(dtype=float)):
        s = wp.tile_load(a, shape=(4, 3))
        wp.tile_matmul(s, s)

    expect(kernel, "(4, 3) and (4, 3)", "shapes [M, K] of 'a' and [K, N] of 'b'")


def test_shapes_of_a_sum():
    def kernel(a: wp.array(dtype=float)):
        s = wp.tile_load(a, shape=4) + wp.tile_load(a, shape=5)
        wp.tile_store(a, s)

    expect(kernel, "shape=(4,)", "shape=(5,)", "wp.tile_broadcast")


@wp.struct
class Pair:
    low: float
    high: float


@wp.func
def lowest(a: Pair, b: Pair):
    return wp.min(a.low, b.low)


def test_operators_of_reductions():
    def ordered(a: wp.array(dtype=Pair)):
        wp.tile_store(a, wp.tile_reduce(wp.min, wp.tile_load(a, shape=4)))

    def other(a: wp.array(dtype=Pair)):
        wp.tile_store(a, wp.tile_reduce(lowest, wp.tile_load(a, shape=4)))

    expect(ordered, "tile_reduce() operator 'min' has no overload", "a Warp struct")
    expect(other, "must return the tile element type Pair, but gives float32")


def test_shape_that_is_not_constant():
    def kernel(a: wp.array(dtype=float), n: int):
        wp.tile_store(a, wp.tile_zeros(shape=n, dtype=float))

    expect(kernel, "compile time constants")


def test_element_type_of_a_store():
    def kernel(a: wp.array(dtype=wp.float64)):
        wp.tile_store(a, wp.tile_zeros(shape=4, dtype=float))

    expect(kernel, "float64", "float32", "same dtype")


def test_rank_of_a_load():
    def kernel(a: wp.array2d(dtype=float)):
        wp.tile_load(a, shape=4)

    expect(kernel, "1 dimensional load from an array with 2 dimensions")


def test_index_outside():
    def kernel(a: wp.array(dtype=float)):
        t = wp.tile_load(a, shape=4)
        a[0] = t[4]

    expect(kernel, "offset 4 is out of bounds", "size 4")


def test_bits_of_floats():
    def kernel(a: wp.array(dtype=float)):
        t = wp.tile_load(a, shape=4)
        t[0] &= 2.0

    expect(kernel, "bits of elements of type 'float32'")


def test_kernel_without_tiles_knows_nothing_of_blocks():
    def plain(a: wp.array(dtype=float)):
        a[wp.tid()] = 1.0

    kernel = wp.Kernel(plain)
    assert "block_threads" not in kernel.ir("warp")
    assert kernel.hooks == ()


def test_kernel_without_tiles_loads_nothing_of_their_translation(tmp_path):
    code = """
import sys, warp as wp

def plain(a: wp.array(dtype=float)):
    a[wp.tid()] = wp.sin(1.0)

def tiled(a: wp.array(dtype=float)):
    wp.tile_store(a, wp.tile_map(wp.sin, wp.tile_ones(shape=4, dtype=float)))

found = []
for function in (plain, tiled):
    wp.Kernel(function).ir("warp")
    found.append(any(name.startswith("warp._src.frontend.tiles") for name in sys.modules))
print(*found)
"""
    # In a folder of its own: that of a script comes first where modules are looked for.
    script = tmp_path / "script.py"
    script.write_text(code)
    command = [sys.executable, str(script)]
    made = subprocess.run(command, capture_output=True, text=True, check=True)
    assert made.stdout.split() == ["False", "True"]
