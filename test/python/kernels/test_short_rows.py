"""Launches on a CPU whose rows, along the last dimension, are shorter than its vectors."""

import numpy as np
import pytest

import warp as wp

rng = np.random.default_rng(5)


def make(lanes=0):
    """A kernel that tells a thread's indices apart and adds up what threads have."""

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def mixed(
        x: wp.array3d(dtype=float),
        y: wp.array3d(dtype=float),
        place: wp.array3d(dtype=wp.vec3i),
        total: wp.array(dtype=int),
    ):
        i, j, k = wp.tid()
        v = x[i, j, k]
        for n in range(j + 1):
            v = wp.sin(v) + float(n) * 0.25
        y[i, j, k] = v
        place[i, j, k] = wp.vec3i(i, j, k)
        wp.atomic_add(total, k, i + 2 * j)

    return mixed


def run(kernel, shape, values):
    x = wp.array(values, dtype=float, device="cpu")
    y, place = (wp.zeros(shape, dtype=dtype, device="cpu") for dtype in (float, wp.vec3i))
    total = wp.zeros(shape[2], dtype=int, device="cpu")
    wp.launch(kernel, shape, [x, y, place, total], device="cpu")
    return [one.numpy() for one in (y, place, total)]


SHAPES = [
    *[(7, 3, row) for row in (1, 2, 3, 4, 5, 8, 9, 16, 17, 31, 32, 33, 64, 65)],
    *[(37, 1, 1), (1, 1, 1), (1, 40, 1), (40, 1, 3), (1, 1, 100), (300, 5, 6)],
]


@pytest.mark.parametrize("shape", SHAPES)
def test_rows_of_any_length(shape):
    values = rng.normal(size=shape).astype(np.float32)
    kernel = make()
    found = run(kernel, shape, values)
    # The same kernel, after code for other rows has been made.
    for other in ((9, 2, 3), (9, 2, 1), (9, 2, 50)):
        run(kernel, other, rng.normal(size=other).astype(np.float32))
    again = run(kernel, shape, values)
    scalar = run(make(lanes=1), shape, values)
    for one, same, by_one in zip(found, again, scalar):
        np.testing.assert_array_equal(one, same)
        np.testing.assert_array_equal(one, by_one)
    indices = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    np.testing.assert_array_equal(found[1], indices)
    np.testing.assert_array_equal(found[2], (indices[..., 0] + 2 * indices[..., 1]).sum((0, 1)))


def lanes_of(kernel, shape):
    """Lanes of the code for packed arrays and such a launch."""
    (launch,) = kernel.schedule("cpu", dim=shape)
    return int(next(one.value for one in launch.choices if one.what == "lanes"))


def test_lanes_are_as_many_as_a_row_has_threads():
    kernel = make()
    for row in (2, 3, 4, 5, 8):
        assert lanes_of(kernel, (100, 100, row)) <= max(4, 1 << (row - 1).bit_length())
    # A dimension with one index is none.
    for shape in ((100, 100, 1), (1000, 1, 1)):
        assert lanes_of(kernel, shape) >= lanes_of(kernel, (100, 100, 16))


def test_adjoints_of_short_rows():
    kernel = make()
    shape = (5, 2, 3)
    values = rng.normal(size=shape)
    x = wp.array(values, dtype=float, device="cpu", requires_grad=True)
    y = wp.zeros(shape, dtype=float, device="cpu", requires_grad=True)
    place = wp.zeros(shape, dtype=wp.vec3i, device="cpu")
    total = wp.zeros(3, dtype=int, device="cpu")
    with wp.Tape() as tape:
        wp.launch(kernel, shape, [x, y, place, total], device="cpu")
    tape.backward(grads={y: wp.ones(shape, dtype=float, device="cpu")})
    slope = np.cos(values)
    slope[:, 1] *= np.cos(np.sin(values[:, 1]))
    np.testing.assert_allclose(x.grad.numpy(), slope, atol=1e-5)
