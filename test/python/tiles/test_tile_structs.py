"""Tiles of structs: operators, sums and derivatives are those of the fields."""

import numpy as np

import warp as wp


@wp.struct
class Inner:
    x: float
    v: wp.vec3


@wp.struct
class Body:
    key: int
    inner: Inner
    w: float


@wp.func
def weigh(b: Body) -> float:
    return b.inner.x * b.w + wp.dot(b.inner.v, b.inner.v)


@wp.kernel
def measure(a: wp.array(dtype=Body), out: wp.array(dtype=float), sums: wp.array(dtype=Body)):
    t = wp.tile_load(a, shape=8)
    u = t + t
    u -= t
    wp.tile_store(out, wp.tile_map(weigh, u) * wp.tile_map(weigh, t))
    wp.tile_store(sums, wp.tile_sum(t))
    wp.tile_atomic_add(sums, t, offset=1)


def bodies():
    rng = np.random.default_rng(0)
    kind = Body.numpy_dtype()
    a = np.zeros(8, dtype=kind)
    a["key"] = np.arange(8)
    a["w"] = rng.normal(size=8)
    a["inner"]["x"] = rng.normal(size=8)
    a["inner"]["v"] = rng.normal(size=(8, 3))
    return a


def test_fields_and_gradients(device):
    a = bodies()
    given = wp.array(a, dtype=Body, requires_grad=True, device=device)
    out = wp.zeros(8, dtype=float, requires_grad=True, device=device)
    sums = wp.zeros(9, dtype=Body, device=device)
    with wp.Tape() as tape:
        wp.launch_tiled(measure, dim=1, inputs=[given, out, sums], block_dim=32, device=device)
    x, v, w = (p.astype(float) for p in (a["inner"]["x"], a["inner"]["v"], a["w"]))
    m = x * w + (v * v).sum(1)
    np.testing.assert_allclose(out.numpy(), m * m, rtol=1e-5)
    found = sums.numpy()
    assert found["key"][0] == a["key"].sum()
    np.testing.assert_allclose(found["inner"]["v"][0], v.sum(0), rtol=1e-5)
    np.testing.assert_array_equal(found["key"][1:], a["key"])
    np.testing.assert_array_equal(found["inner"]["v"][1:], a["inner"]["v"])
    out.grad.fill_(1.0)
    tape.backward()
    gradient = given.grad.numpy()
    np.testing.assert_allclose(gradient["w"], 2 * m * x, rtol=1e-5)
    np.testing.assert_allclose(gradient["inner"]["x"], 2 * m * w, rtol=1e-5)
    np.testing.assert_allclose(gradient["inner"]["v"], 4 * m[:, None] * v, rtol=1e-5)


@wp.kernel
def collect(a: wp.array(dtype=Body), out: wp.array(dtype=Body)):
    t = wp.tile_zeros(shape=2, dtype=Body)
    for i in range(8):
        wp.tile_scatter_add(t, i % 2, a[i], wp.untile(wp.tile_arange(wp.block_dim())) == 0)
    wp.tile_store(out, t)


def test_scattered_sums(device):
    a = bodies()
    out = wp.zeros(2, dtype=Body, device=device)
    given = wp.array(a, dtype=Body, device=device)
    wp.launch_tiled(collect, dim=1, inputs=[given, out], block_dim=32, device=device)
    for i in range(2):
        assert out.numpy()["key"][i] == a["key"][i::2].sum()
        np.testing.assert_allclose(out.numpy()["w"][i], a["w"][i::2].astype(float).sum(), rtol=1e-5)


@wp.kernel
def scaled_sums(a: wp.array2d(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    s = wp.tile_zeros(shape=1, dtype=float)
    for j in range(a.shape[1] // 16):
        s += wp.tile_sum(wp.tile_load(a[i], shape=16, offset=16 * j)) * 0.5
    wp.tile_store(out, s, offset=i)


def test_sums_that_a_loop_carries_keep_nothing(device):
    a = np.random.default_rng(1).normal(size=(3, 48)).astype(np.float32)
    given = wp.array(a, requires_grad=True, device=device)
    out = wp.zeros(3, dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch_tiled(scaled_sums, dim=3, inputs=[given, out], block_dim=32, device=device)
    np.testing.assert_allclose(out.numpy(), 0.5 * a.astype(float).sum(1), rtol=1e-4, atol=1e-5)
    out.grad.fill_(1.0)
    tape.backward()
    np.testing.assert_array_equal(given.grad.numpy(), np.full((3, 48), 0.5))


@wp.kernel
def collect_vectors(a: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec3)):
    t = wp.tile_zeros(shape=2, dtype=wp.vec3)
    i = wp.untile(wp.tile_arange(wp.block_dim()))
    for j in range(4):
        wp.tile_scatter_add(t, j % 2, a[j], i == 0)
    wp.tile_store(out, t)


# Hopper adds floats in pairs to arrays, but not to shared memory.
def test_scattered_sums_of_vectors(device):
    a = np.random.default_rng(2).normal(size=(4, 3)).astype(np.float32)
    out = wp.zeros(2, dtype=wp.vec3, device=device)
    given = wp.array(a, dtype=wp.vec3, device=device)
    wp.launch_tiled(collect_vectors, dim=1, inputs=[given, out], block_dim=32, device=device)
    np.testing.assert_allclose(out.numpy(), [a[0] + a[2], a[1] + a[3]], rtol=1e-6)
    for kernel in (collect, collect_vectors):
        text = kernel.ir("ptx", arch=90)
        assert "atom.shared" in text or "red.shared" in text
        assert "global.add" not in text
