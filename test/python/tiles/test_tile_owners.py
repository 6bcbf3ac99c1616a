"""Updates of windows that no other block of a CPU touches are plain, and only those."""

import numpy as np
import pytest

import warp as wp

N, TILE = 24, 8


@wp.kernel
def beside(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    t = wp.tile_load(x, shape=TILE, offset=i * TILE)
    wp.tile_store(y, t * t, offset=i * TILE)


@wp.kernel
def overlapping(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    t = wp.tile_load(x, shape=TILE + 1, offset=i * TILE)
    wp.tile_atomic_add(y, t * t, offset=i * TILE)


@wp.kernel
def twice(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    t = wp.tile_load(x, shape=TILE, offset=i * TILE)
    u = wp.tile_load(x, shape=TILE)
    wp.tile_store(y, t * u, offset=i * TILE)


@wp.kernel
def element(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    t = wp.tile_load(x, shape=TILE, offset=i * TILE)
    wp.tile_store(y, t * x[i], offset=i * TILE)


@wp.kernel
def rows(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
    i = wp.tid()
    t = wp.tile_load(x[i], shape=TILE)
    wp.tile_store(y[i], t * t)


@wp.kernel
def columns(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
    i = wp.tid()
    t = wp.tile_load(x, shape=(N, 2), offset=(0, 2 * i))
    wp.tile_store(y, t * t, offset=(0, 2 * i))


def squares(x):
    return 2 * x


def overlapping_squares(x):
    times = np.ones(x.size)
    times[TILE::TILE] = 2
    return 2 * x * times


def products(x):
    gradient = np.tile(x[:TILE], N // TILE)
    gradient[:TILE] += x.reshape(-1, TILE).sum(axis=0)
    return gradient


def scaled(x):
    gradient = np.repeat(x[: N // TILE], TILE)
    gradient[: N // TILE] += x.reshape(-1, TILE).sum(axis=1)
    return gradient


CASES = [
    (beside, (N,), N // TILE, squares, True),
    (overlapping, (N,), N // TILE, overlapping_squares, False),
    (twice, (N,), N // TILE, products, False),
    (element, (N,), N // TILE, scaled, False),
    (rows, (N, TILE), N, squares, True),
    (columns, (N, TILE), TILE // 2, squares, True),
]


@pytest.mark.parametrize(
    ("kernel", "shape", "blocks", "reference", "plain"), CASES, ids=lambda c: getattr(c, "key", "")
)
def test_gradients(device, kernel, shape, blocks, reference, plain):
    given = np.random.default_rng(1).integers(1, 9, shape).astype(np.float32)
    x = wp.array(given, requires_grad=True, device=device)
    y = wp.zeros(shape, dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch_tiled(kernel, dim=blocks, inputs=[x, y], block_dim=32, device=device)
    x.grad.fill_(3.0)
    tape.backward(grads={y: wp.ones_like(y, requires_grad=False)})
    np.testing.assert_array_equal(x.grad.numpy(), 3.0 + reference(given))
    adjoint = kernel.ir("thread", derivative="adjoint", inputs=["x", "y"])
    assert ("launch_extent" in adjoint) == plain


# A launch over a dimension that the kernel does not ask for has several threads per window.
@pytest.mark.parametrize("others", [1, 7, 100])
def test_dimensions_without_windows(others):
    @wp.kernel(module="unique")
    def add(y: wp.array(dtype=float)):
        i = wp.tid()
        wp.tile_atomic_add(y, wp.tile_ones(TILE, dtype=float), offset=i * TILE)

    y = wp.zeros(N * 64, dtype=float, device="cpu")
    wp.launch(add, dim=(N * 64 // TILE, others), inputs=[y], device="cpu")
    np.testing.assert_array_equal(y.numpy(), float(others))
