"""Views of tiles are other names for their elements, as NumPy's are, which are the reference."""

import numpy as np
import pytest
from support.block_program import run_launch

import warp as wp

N = 4
Matrix = wp.array2d(dtype=float)


@wp.func
def bump(v: wp.tile[float, N]):
    v += wp.tile_ones(N, dtype=float)


@wp.kernel
def through_rows(x: Matrix, y: Matrix, z: Matrix):
    t = wp.tile_load(x, shape=(N, N))
    row = t[1]
    t[1, 2] = 99.0
    row += wp.tile_ones(N, dtype=float)
    row[0] += 5.0
    wp.tile_axpy(2.0, wp.tile_ones(N, dtype=float), t[3])
    wp.tile_assign(wp.tile_view(t, offset=(2, 1), shape=(1, 2)), wp.tile_ones((1, 2), dtype=float))
    bump(t[0])
    bump(row)
    wp.tile_store(y, t)
    wp.tile_store(z[0], row)


def rows_of_numpy(t, z, threads):
    row = t[1]
    t[1, 2] = 99
    row += 1
    row[0] += 5 * threads
    t[3] += 2
    t[2:3, 1:3] = 1
    t[0] += 1
    row += 1
    z[0] = row


@wp.kernel
def through_orders(x: Matrix, y: Matrix, z: Matrix):
    t = wp.tile_load(x, shape=(N, N))
    turned = wp.tile_transpose(t)
    turned[0, 3] = 7.0
    turned += wp.tile_ones((N, N), dtype=float)
    flat = wp.tile_reshape(t, shape=(N * N,))
    flat[7] = 70.0
    low = wp.tile_squeeze(wp.tile_view(turned, offset=(2, 0), shape=(1, N)))
    low *= low
    wp.tile_assign(wp.tile_transpose(t)[3], wp.tile_ones(N, dtype=float))
    wp.tile_store(y, t)
    wp.tile_store(z, turned)


def orders_of_numpy(t, z, _threads):
    turned = t.T
    turned[0, 3] = 7
    turned += 1
    t.reshape(-1)[7] = 70
    low = turned[2]
    low *= low
    t.T[3] = 1
    z[:] = turned


@wp.kernel
def through_repeats(x: Matrix, y: Matrix, z: Matrix):
    t = wp.tile_load(x[1], shape=N)
    many = wp.tile_broadcast(t, shape=(N, N))
    many[2, 3] = 50.0
    wp.tile_axpy(2.0, wp.tile_load(x, shape=(N, N)), many)
    many -= wp.tile_ones((N, N), dtype=float)
    wp.tile_store(y, many)
    wp.tile_store(z[0], t)


def repeats_of_numpy(t, z, _threads):
    x, row = t.copy(), t[1].copy()
    row[3] = 50
    row += 2 * x.sum(axis=0) - N
    t[:] = row
    z[0] = row


@wp.kernel
def on_paths(x: Matrix, y: Matrix, z: Matrix):
    t = wp.tile_load(x, shape=(N, N))
    row = t[1]
    last = wp.tile_transpose(t)[3]
    if x[0, 1] > 0.5:
        row += wp.tile_ones(N, dtype=float)
    else:
        t[0, 0] = 40.0
    for i in range(int(x[0, 3])):
        row += last
        if i > 0:
            last += row
        t[2, i] = 3.0
    wp.tile_store(y, t)
    wp.tile_store(z[0], row)


def paths_of_numpy(t, z, _threads):
    row, last = t[1], t[:, 3]
    row += 1
    for i in range(3):
        row += last.copy()
        if i > 0:
            last += row.copy()
        t[2, i] = 3
    z[0] = row


@wp.kernel
def after_others(x: Matrix, y: Matrix, z: Matrix):
    t = wp.tile_load(x, shape=(N, N))
    row = t[1]
    t = wp.tile_zeros((N, N), dtype=float)
    row += wp.tile_ones(N, dtype=float)
    wp.tile_store(y, t)
    wp.tile_store(z[0], row)


def others_of_numpy(t, z, _threads):
    z[0] = t[1] + 1
    t[:] = 0


@wp.kernel
def of_its_own(x: Matrix, y: Matrix, z: Matrix):
    t = wp.tile_load(x, shape=(N, N))
    t = wp.tile_transpose(t)
    row = t[0]
    for _i in range(3):
        t = wp.tile_transpose(t)
        t[0, 1] += 1.0
    t = t[::-1, :]
    wp.tile_store(y, t)
    wp.tile_store(z[0], row + wp.tile_ones(N, dtype=float))


def own_of_numpy(t, z, threads):
    turned = t.T.copy()
    z[0] = turned[0] + 1
    for _i in range(3):
        turned = turned.T
        turned[0, 1] += threads
    t[:] = turned[::-1]


@wp.kernel
def copied(x: Matrix, y: Matrix, z: Matrix):
    t = wp.tile_load(x, shape=(N, N), storage="shared")
    row = t[1]
    other = t
    other[1, 1] = 50.0
    other += wp.tile_ones((N, N), dtype=float)
    row -= wp.tile_ones(N, dtype=float)
    wp.tile_store(y, t)
    wp.tile_store(z, other)


def copies_of_numpy(t, z, _threads):
    z[:] = t + 1
    z[1, 1] = 51
    t[1] -= 1


PAIRS = [
    (through_rows, rows_of_numpy),
    (through_orders, orders_of_numpy),
    (through_repeats, repeats_of_numpy),
    (on_paths, paths_of_numpy),
    (after_others, others_of_numpy),
    (of_its_own, own_of_numpy),
    (copied, copies_of_numpy),
]


# Every thread of the block makes an update of one element (`row[0] += 5.0`).
@pytest.mark.parametrize("threads", [1, 32, 48])
@pytest.mark.parametrize(("kernel", "reference"), PAIRS, ids=lambda one: getattr(one, "key", ""))
def test_views_share_elements(device, kernel, reference, threads, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    given = np.arange(N * N, dtype=np.float64).reshape(N, N)
    y, z = given.copy(), np.zeros((N, N))
    reference(y, z, threads)
    x = wp.array(given, dtype=float, device=device)
    got = [wp.zeros((N, N), dtype=float, device=device) for _ in range(2)]
    wp.launch_tiled(kernel, dim=1, inputs=[x, *got], block_dim=threads, device=device)
    np.testing.assert_array_equal(got[0].numpy(), y)
    np.testing.assert_array_equal(got[1].numpy(), z)


# The code for a GPU, by threads in any order between barriers.
@pytest.mark.parametrize(("kernel", "reference"), PAIRS, ids=lambda one: getattr(one, "key", ""))
def test_views_wait_for_other_threads(kernel, reference):
    given = np.arange(N * N, dtype=np.float32).reshape(N, N)
    y, z = given.astype(float), np.zeros((N, N))
    reference(y, z, 48)
    for seed in range(3):
        got = [np.zeros((N, N), dtype=np.float32) for _ in range(2)]
        run_launch(kernel, [given.copy(), *got], (1, 48), 48, seed)
        np.testing.assert_array_equal(got[0], y)
        np.testing.assert_array_equal(got[1], z)


# Each element of a broadcast tile is read as often as it is seen; gradients add the other way.
def test_gradients_through_repeats(device):
    @wp.kernel
    def biased(b: wp.array(dtype=float), x: Matrix, y: wp.array(dtype=float)):
        t = wp.tile_load(b, shape=N)
        wp.tile_axpy(3.0, wp.tile_load(x, shape=(N, N)), wp.tile_broadcast(t, shape=(N, N)))
        wp.tile_store(y, t)

    rng = np.random.default_rng(2)
    x = wp.array(rng.normal(size=(N, N)), dtype=float, requires_grad=True, device=device)
    b = wp.array(rng.normal(size=N), dtype=float, requires_grad=True, device=device)
    y = wp.zeros(N, dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch_tiled(biased, dim=1, inputs=[b, x, y], block_dim=32, device=device)
    expected = b.numpy() + 3 * x.numpy().astype(np.float64).sum(axis=0)
    np.testing.assert_allclose(y.numpy(), expected, rtol=1e-6, atol=1e-6)
    weights = rng.normal(size=N).astype(np.float32)
    tape.backward(grads={y: wp.array(weights, device=device)})
    np.testing.assert_array_equal(b.grad.numpy(), weights)
    np.testing.assert_allclose(x.grad.numpy(), np.broadcast_to(3 * weights, (N, N)), rtol=1e-6)


def test_what_views_cannot_take():
    @wp.kernel
    def part_of_repeats(y: Matrix):
        t = wp.tile_zeros(N, dtype=float)
        wp.tile_assign(wp.tile_broadcast(t, shape=(N, N))[1], t)
        wp.tile_store(y[0], t)

    with pytest.raises(wp.WarpError, match="a tile that is seen more than once"):
        part_of_repeats.ir("warp")

    @wp.kernel
    def gone(y: Matrix):
        t = wp.tile_zeros((N, N), dtype=float)
        row = t[1]
        other = t[2]
        t = wp.tile_ones((N, N), dtype=float)
        row += other
        wp.tile_store(y, t)

    with pytest.raises(wp.WarpError, match="a view of a tile that its variable no longer holds"):
        gone.ir("warp")

    @wp.kernel
    def other_type(y: Matrix):
        t = wp.tile_zeros(N, dtype=int)
        t += wp.tile_ones(N, dtype=float)
        wp.tile_store(y[0], t)

    with pytest.raises(wp.WarpError, match=r"test_tile_aliases\.py:\d+"):
        other_type.ir("warp")
