"""Threads of a block that change rows, fields and nested parts of one element of a tile."""

import numpy as np
import pytest

import warp as wp


@pytest.fixture(autouse=True)
def cpu_blocks(monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)


@wp.struct
class Inner:
    n: wp.int32
    v: wp.vec3


@wp.struct
class Outer:
    x: wp.float32
    inner: Inner
    m: wp.mat22


@wp.kernel
def of_matrices(o: wp.array(dtype=wp.mat33), q: wp.array(dtype=wp.quat)):
    i = wp.tid()
    t = wp.tile_zeros(shape=(2,), dtype=wp.mat33)
    u = wp.tile_zeros(shape=(3,), dtype=wp.mat33)
    w = wp.tile_zeros(shape=(3,), dtype=wp.quat)
    t[i // 9][i // 3 % 3, i % 3] = float(i)
    # All threads that share a row or a component assign the same value.
    u[i // 9][i // 3 % 3] = wp.vec3(float(i // 3), 0.0, -1.0)
    u[i // 9][i // 3 % 3][1] = float(i // 3 + 50)
    u[2][i % 3][i % 3] += 1.0
    w[i // 6][i % 4] = float(i % 4)
    wp.tile_store(o, t)
    wp.tile_store(o, u, offset=2)
    wp.tile_store(q, w)


def test_matrices_rows_and_quaternions(device):
    o, q = wp.zeros(5, dtype=wp.mat33, device=device), wp.zeros(3, dtype=wp.quat, device=device)
    wp.launch(of_matrices, dim=18, inputs=[o, q], block_dim=18, device=device)
    rows = np.array([[k, k + 50, -1] for k in range(6)])
    expected = [*np.arange(18.0).reshape(2, 3, 3), *rows.reshape(2, 3, 3), 6 * np.eye(3)]
    np.testing.assert_array_equal(o.numpy(), expected)
    np.testing.assert_array_equal(q.numpy(), np.tile([0, 1, 2, 3], (3, 1)))


@wp.kernel
def of_structs(o: wp.array(dtype=Outer)):
    i = wp.tid()
    t = wp.tile_load(o, shape=4)
    # Each element gets every part from another thread.
    t[i].x = float(i)
    t[(i + 1) % 4].inner.n = 7 + i
    t[(i + 2) % 4].inner.v[i % 3] = float(10 + i)
    t[(i + 3) % 4].m[i // 2, i % 2] += float(20 + i)
    t[i].inner.n += 100
    t[0].inner.n -= 1
    wp.tile_store(o, t)


def test_fields_and_nested_parts(device):
    o = wp.zeros(4, dtype=Outer, device=device)
    wp.launch(of_structs, dim=4, inputs=[o], block_dim=4, device=device)
    expected = np.zeros(4, dtype=o.numpy().dtype)
    for i in range(4):
        expected[i]["x"] = i
        expected[(i + 1) % 4]["inner"]["n"] = 107 + i - 4 * ((i + 1) % 4 == 0)
        expected[(i + 2) % 4]["inner"]["v"][i % 3] = 10 + i
        expected[(i + 3) % 4]["m"][i // 2, i % 2] = 20 + i
    for got, wanted in zip(o.numpy(), expected, strict=True):
        assert got["x"] == wanted["x"] and got["inner"]["n"] == wanted["inner"]["n"]
        np.testing.assert_array_equal(got["inner"]["v"], wanted["inner"]["v"])
        np.testing.assert_array_equal(got["m"], wanted["m"])


@wp.kernel
def of_transforms(o: wp.array(dtype=wp.transform), a: wp.array(dtype=wp.transform)):
    i = wp.tid()
    t = wp.tile_zeros(shape=(3,), dtype=wp.transform)
    t[i].p = wp.vec3(1.0, 2.0, 3.0)
    t[(i + 1) % 3].q = wp.quat(4.0, 5.0, 6.0, float(i))
    t[(i + 2) % 3].p[i] += 10.0
    t[i].q[(i + 1) % 3] = float(-i)
    wp.tile_store(o, t)
    if i == 0:
        a[0].p = wp.vec3(1.0, 2.0, 3.0)
    elif i == 1:
        a[0].q = wp.quat(4.0, 5.0, 6.0, 7.0)
    a[1].p[i] += 1.0
    a[1].p += wp.vec3(1.0, 2.0, 3.0)
    a[2].q[i] = float(i)


def test_parts_of_transforms_of_tiles_and_arrays(device):
    o, a = (wp.zeros(3, dtype=wp.transform, device=device) for _ in range(2))
    wp.launch(of_transforms, dim=3, inputs=[o, a], block_dim=3, device=device)
    expected = np.zeros((3, 7))
    expected[:, :6] = [1, 2, 3, 4, 5, 6]
    for i in range(3):
        expected[(i + 1) % 3, 6] = i
        expected[(i + 2) % 3, i] += 10
        expected[i, 3 + (i + 1) % 3] = -i
    np.testing.assert_array_equal(o.numpy(), expected)
    expected = [[1, 2, 3, 4, 5, 6, 7], [4, 7, 10, 0, 0, 0, 0], [0, 0, 0, 0, 1, 2, 0]]
    np.testing.assert_array_equal(a.numpy(), expected)


@wp.kernel
def weighted(x: wp.array(dtype=float), y: wp.array(dtype=wp.vec3), s: wp.array(dtype=Outer)):
    i = wp.tid()
    v = x[i]
    t = wp.tile_zeros(shape=2, dtype=wp.vec3)
    u = wp.tile_full(2, Outer(), dtype=Outer)
    t[i // 3][i % 3] = v * v
    t[i // 3][(i + 1) % 3] += 3.0 * v
    u[i // 3].inner.v[i % 3] = 2.0 * v
    wp.tile_store(y, t)
    wp.tile_store(s, u)


def test_gradients(device):
    given = np.arange(1.0, 7.0, dtype=np.float32)
    x = wp.array(given, requires_grad=True, device=device)
    y = wp.zeros(2, dtype=wp.vec3, requires_grad=True, device=device)
    s = wp.zeros(2, dtype=Outer, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(weighted, dim=6, inputs=[x, y, s], block_dim=6, device=device)
    rows = given.reshape(2, 3)
    np.testing.assert_array_equal(y.numpy(), rows**2 + 3 * np.roll(rows, 1, axis=1))
    rng = np.random.default_rng(0)
    gy, gs = rng.normal(size=(2, 2, 3)).astype(np.float32)
    of_structs = np.zeros(2, dtype=s.numpy().dtype)
    of_structs["inner"]["v"] = gs
    y.grad.assign(gy)
    s.grad.assign(wp.array(of_structs, dtype=Outer, device=device))
    tape.backward()
    expected = 2 * rows * gy + 3 * np.roll(gy, -1, axis=1) + 2 * gs
    np.testing.assert_allclose(x.grad.numpy().reshape(2, 3), expected, rtol=1e-6)
