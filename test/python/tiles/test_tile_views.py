"""Views of tiles that are written, also in loops; products that replace; structs; exact ranges."""

import numpy as np
import pytest

import warp as wp

ROWS, COLUMNS = 6, 16


@wp.kernel
def copy_rows(src: wp.array2d(dtype=float), dst: wp.array2d(dtype=float), n: int):
    a = wp.tile_load(src, shape=(ROWS, COLUMNS))
    b = wp.tile_zeros(shape=(ROWS, COLUMNS), dtype=float)
    for i in range(n):
        target = b[i]
        wp.tile_assign(target, a[i])
    wp.tile_store(dst, b)


@wp.kernel
def copy_parts(src: wp.array2d(dtype=float), dst: wp.array2d(dtype=float), n: int):
    a = wp.tile_load(src, shape=(ROWS, COLUMNS))
    b = wp.tile_zeros(shape=(ROWS, COLUMNS), dtype=float)
    for i in range(n):
        row = wp.tile_view(b, offset=(i, 0), shape=(1, COLUMNS))
        part = wp.tile_view(row, offset=(0, 4), shape=(1, 8))
        wp.tile_assign(part, wp.tile_view(a, offset=(i, 4), shape=(1, 8)))
    wp.tile_store(dst, b)


# The tile under a view that a loop makes and writes is carried from iteration to iteration.
@pytest.mark.parametrize(
    ("kernel", "columns"), [(copy_rows, slice(None)), (copy_parts, slice(4, 12))]
)
@pytest.mark.parametrize("count", [0, 1, ROWS])
def test_views_written_in_loops(device, kernel, columns, count):
    given = np.random.default_rng(4).normal(size=(ROWS, COLUMNS)).astype(np.float32)
    x = wp.array(given, requires_grad=True, device=device)
    y = wp.full((ROWS, COLUMNS), 7.0, dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch_tiled(kernel, dim=[1], inputs=[x, y, count], block_dim=32, device=device)
    tape.backward(grads={y: wp.ones_like(y, requires_grad=False)})
    copied = np.zeros((ROWS, COLUMNS), np.float32)
    copied[:count, columns] = 1.0
    np.testing.assert_array_equal(y.numpy(), copied * given)
    np.testing.assert_array_equal(x.grad.numpy(), copied)


# Zero times what is no number is no number; a product with beta = 0 does not look at its result.
def test_products_that_replace(device):
    @wp.kernel
    def product(a: wp.array2d(dtype=float), c: wp.array2d(dtype=float)):
        x = wp.tile_load(a, shape=(4, 4))
        z = wp.tile_load(c, shape=(4, 4))
        wp.tile_matmul(x, x, z, alpha=2.0, beta=0.0)
        wp.tile_store(c, z)

    given = np.arange(16, dtype=np.float32).reshape(4, 4)
    a = wp.array(given, requires_grad=True, device=device)
    c = wp.array(np.full((4, 4), np.nan, np.float32), requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch_tiled(product, dim=[1], inputs=[a, c], block_dim=32, device=device)
    np.testing.assert_array_equal(c.numpy(), 2.0 * given @ given)
    tape.backward(grads={c: wp.ones_like(c, requires_grad=False)})
    ones = np.ones((4, 4))
    np.testing.assert_array_equal(a.grad.numpy(), 2.0 * (ones @ given.T + given.T @ ones))


@wp.struct
class Particle:
    mass: float
    velocity: wp.vec3


@wp.func
def faster(p: Particle, by: Particle) -> Particle:
    q = Particle()
    q.mass = p.mass + by.mass
    q.velocity = 2.0 * p.velocity
    return q


@wp.kernel
def accelerate(a: wp.array(dtype=Particle), b: wp.array(dtype=Particle)):
    by = Particle()
    by.mass = 3.0
    t = wp.tile_map(faster, wp.tile_load(a, shape=4), by)
    wp.tile_store(b, t)


def test_tiles_of_structs(device):
    given = np.zeros(4, Particle.numpy_dtype())
    given["mass"], given["velocity"] = np.arange(4), np.arange(12).reshape(4, 3)
    a = wp.array(given, dtype=Particle, requires_grad=True, device=device)
    b = wp.zeros(4, dtype=Particle, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch_tiled(accelerate, dim=[1], inputs=[a, b], block_dim=32, device=device)
    np.testing.assert_array_equal(b.numpy()["mass"], given["mass"] + 3.0)
    np.testing.assert_array_equal(b.numpy()["velocity"], 2.0 * given["velocity"])
    seeds = np.zeros(4, Particle.numpy_dtype())
    seeds["mass"], seeds["velocity"] = 1.0 + np.arange(4), 1.0
    tape.backward(grads={b: wp.array(seeds, dtype=Particle, device=device)})
    np.testing.assert_array_equal(a.grad.numpy()["mass"], seeds["mass"])
    np.testing.assert_array_equal(a.grad.numpy()["velocity"], 2.0 * seeds["velocity"])


# Counted in the numbers that the elements can be: doubles would miss one, or find one too many.
def test_ranges_are_counted_exactly(device):
    big, stop = wp.constant(wp.int64(2**53)), wp.constant(wp.int64(2**53 + 1))

    @wp.kernel
    def ranges(
        wide: wp.array(dtype=wp.int64),
        narrow: wp.array(dtype=wp.float32),
        tenths: wp.array(dtype=wp.float32),
    ):
        wp.tile_store(wide, wp.tile_arange(0, stop, big, dtype=wp.int64))
        wp.tile_store(narrow, wp.tile_arange(0.0, 3.00000001, 0.99999999, dtype=wp.float32))
        wp.tile_store(tenths, wp.tile_arange(0.0, 0.3, 0.1, dtype=wp.float32))

    wide = wp.full(4, -1, dtype=wp.int64, device=device)
    narrow = wp.full(4, -1.0, dtype=wp.float32, device=device)
    tenths = wp.full(4, -1.0, dtype=wp.float32, device=device)
    wp.launch_tiled(ranges, dim=[1], inputs=[wide, narrow, tenths], block_dim=32, device=device)
    np.testing.assert_array_equal(wide.numpy(), [0, 2**53, -1, -1])
    np.testing.assert_array_equal(narrow.numpy(), [0, 1, 2, -1])
    np.testing.assert_allclose(tenths.numpy(), [*np.arange(0.0, 0.3, 0.1), -1], rtol=1e-6)

    @wp.kernel
    def uneven(out: wp.array(dtype=int)):
        wp.tile_store(out, wp.tile_arange(0.0, 2.0, 0.5, dtype=int))

    with pytest.raises(wp.WarpError, match="of int32 expects integers, but got 0.5"):
        uneven.ir("warp")
