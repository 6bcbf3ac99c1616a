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


@wp.kernel
def in_place(a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), c: wp.array2d(dtype=float)):
    i, j = wp.tid()
    at = (i * TILE, j * TILE)
    t = wp.tile_load(c, shape=(TILE, TILE), offset=at)
    x = wp.tile_load(a, shape=(TILE, TILE), offset=at)
    wp.tile_matmul(x, wp.tile_load(b, shape=(TILE, TILE)), t, alpha=0.5, beta=-1.25)
    wp.tile_store(c, t, offset=at)


# An array may be read and written by blocks whose windows lie side by side.
def test_arrays_that_are_read_and_written(device):
    rng = np.random.default_rng(6)
    shape = (2 * TILE, 3 * TILE)
    given = [rng.normal(size=s).astype(np.float32) for s in (shape, (TILE, TILE), shape)]
    a, b, c = (wp.array(one, requires_grad=True, device=device) for one in given)
    with wp.Tape() as tape:
        wp.launch_tiled(in_place, dim=(2, 3), inputs=[a, b, c], block_dim=32, device=device)

    def by_blocks(x):
        return x.astype(float).reshape(2, TILE, 3, TILE).transpose(0, 2, 1, 3)

    x, y, z = by_blocks(given[0]), given[1].astype(float), by_blocks(given[2])
    np.testing.assert_allclose(by_blocks(c.numpy()), 0.5 * x @ y - 1.25 * z, rtol=1e-5, atol=1e-5)
    weights = rng.normal(size=shape).astype(np.float32)
    tape.backward(grads={c: wp.array(weights, device=device)})
    g = by_blocks(weights)
    np.testing.assert_allclose(by_blocks(a.grad.numpy()), 0.5 * g @ y.T, rtol=1e-4, atol=1e-5)
    expected = 0.5 * (x.transpose(0, 1, 3, 2) @ g).sum(axis=(0, 1))
    np.testing.assert_allclose(b.grad.numpy(), expected, rtol=1e-4, atol=1e-4)


def test_windows_that_overlap_are_refused():
    @wp.kernel(module="unique")
    def shifted(x: wp.array(dtype=float)):
        i = wp.tid()
        t = wp.tile_load(x, shape=TILE, offset=i * (TILE - 1))
        wp.tile_store(x, t * t, offset=i * (TILE - 1))

    with pytest.raises(wp.WarpError, match="other threads of the launch may write"):
        shifted.ir("thread", derivative="adjoint", inputs=["x"])
