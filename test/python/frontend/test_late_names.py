"""Names that loops assign first on some paths: what was assigned stays for later iterations."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def once(first: int, second: int, out: wp.array(dtype=float)):
    for i in range(6):
        if i == first:
            if second > 0:
                x = float(10 * i + second)
        out[i] = x


@wp.kernel
def deeper(first: int, second: int, out: wp.array(dtype=float)):
    for j in range(2):
        for i in range(3):
            if 3 * j + i >= first:
                if second > 0:
                    if 3 * j + i == first:
                        x = float(10 * first + second)
            else:
                x = -1.0
            out[3 * j + i] = x


@wp.kernel
def guarded(first: int, second: int, out: wp.array(dtype=float)):
    i = int(0)
    while i < 6:
        if i == first:
            if second > 0:
                x = float(10 * i + second)
        if second < 0:
            break
        out[i] = x
        i += 1


def run(kernel, *arguments):
    out = wp.zeros(6, dtype=float, device="cpu")
    wp.launch(kernel, 1, [*arguments, out], device="cpu")
    return out.numpy()


@pytest.mark.parametrize("first", [0, 2, 5, 7])
@pytest.mark.parametrize("second", [0, 3])
def test_value_of_an_earlier_iteration(first, second):
    late = [10 * first + second if second and i >= first else 0 for i in range(6)]
    np.testing.assert_array_equal(run(once, first, second), late)
    np.testing.assert_array_equal(run(guarded, first, second), late)
    before = [-1.0] * min(first, 6) + [-1.0 if first else 0.0] * max(0, 6 - first)
    expected = [late[i] if second and i >= first else before[i] for i in range(6)]
    np.testing.assert_array_equal(run(deeper, first, second), expected)


@wp.kernel
def tile_once(x: wp.array2d(dtype=float), c: int, out: wp.array2d(dtype=float)):
    for i in range(4):
        if i == 1:
            t = wp.tile_load(x[i], shape=8)
            if c > 0:
                u = wp.tile_map(wp.add, t, t)
        if i > 0:
            wp.tile_store(out[i], t)
            if c > 0:
                wp.tile_store(out[i], u)


@pytest.mark.parametrize("c", [0, 1])
def test_tiles_of_an_earlier_iteration(c):
    x = wp.array(np.arange(32.0).reshape(4, 8), dtype=float, device="cpu")
    out = wp.zeros((4, 8), dtype=float, device="cpu")
    wp.launch_tiled(tile_once, 1, [x, c, out], device="cpu")
    expected = np.zeros((4, 8))
    expected[1:] = (1 + c) * np.arange(8.0, 16.0)
    np.testing.assert_array_equal(out.numpy(), expected)


def test_gradient_of_an_earlier_iteration():
    @wp.kernel
    def product(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        for i in range(4):
            if i == 1:
                if x[0] > 0.0:
                    late = x[i] * x[i]
            y[0] += late

    x = wp.array([1.0, 3.0], dtype=float, requires_grad=True, device="cpu")
    y = wp.zeros(1, requires_grad=True, device="cpu")
    with wp.Tape() as tape:
        wp.launch(product, 1, [x, y], device="cpu")
    tape.backward(y)
    np.testing.assert_array_equal(y.numpy(), [27.0])
    np.testing.assert_array_equal(x.grad.numpy(), [0.0, 18.0])
