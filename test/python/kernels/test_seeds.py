"""Programs as NVIDIA's introduction and FAQ print them, older spellings included."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def integrate(
    x: wp.array(dtype=wp.vec3),
    v: wp.array(dtype=wp.vec3),
    f: wp.array(dtype=wp.vec3),
    w: wp.array(dtype=float),
    gravity: wp.vec3,
    dt: float,
):

    # thread id
    tid = wp.tid()

    x0 = x[tid]
    v0 = v[tid]

    # Semi-implicit Euler step
    f_ext = f[tid]
    inv_mass = w[tid]

    v1 = v0 + (f_ext * inv_mass + gravity) * dt
    x1 = x0 + v1 * dt

    # store results
    x[tid] = x1
    v[tid] = v1


@pytest.mark.parametrize("n", [1, 3, 1000, 100_003])
def test_integrate(device, n):
    rng = np.random.default_rng(n)
    x0, v0, f0 = (rng.normal(size=(n, 3)).astype(np.float32) for _ in range(3))
    w0 = rng.uniform(0.1, 2.0, n).astype(np.float32)
    x, v, f = (wp.array(a, dtype=wp.vec3, device=device) for a in (x0, v0, f0))
    w = wp.array(w0, dtype=float, device=device)
    gravity = wp.vec3(0.0, -9.81, 0.0)
    wp.launch(kernel=integrate, dim=n, inputs=[x, v, f, w, gravity, 0.01], device=device)
    v1 = v0 + (f0.astype(np.float64) * w0[:, None] + [0.0, -9.81, 0.0]) * 0.01
    np.testing.assert_allclose(v.numpy(), v1, atol=2e-6)
    np.testing.assert_allclose(x.numpy(), x0 + v1 * 0.01, atol=2e-6)


def test_launch_by_keywords_and_by_position(device):
    @wp.kernel
    def simple_kernel(
        a: wp.array(dtype=wp.vec3), b: wp.array(dtype=wp.vec3), c: wp.array(dtype=float)
    ):
        tid = wp.tid()
        c[tid] = wp.dot(a[tid], b[tid])

    n = 1024
    a, b = (wp.array(np.full((n, 3), k, np.float32), dtype=wp.vec3, device=device) for k in (1, 2))
    c = wp.zeros(n, dtype=float, device=device)
    wp.launch(kernel=simple_kernel, dim=1024, inputs=[a, b, c], device=device)
    assert (c.numpy() == 6.0).all()
    wp.launch(simple_kernel, 1024, [a, a, c], device=device)
    assert (c.numpy() == 3.0).all()


def test_allocation_by_length(device):
    n = 10
    v = wp.empty(length=n, dtype=wp.vec3, device=device)
    q = wp.zeros(length=n, dtype=wp.quat, device=device)
    older = wp.ones(n=n, dtype=float, device=device)
    assert v.shape == q.shape == older.shape == (n,)
    assert (q.numpy() == np.zeros((n, 4))).all()


def test_from_numpy_and_back(device):
    data = np.arange(30, dtype=np.float32).reshape(10, 3)
    v = wp.from_numpy(data, dtype=wp.vec3, device=device)
    assert v.shape == (10,) and v.dtype == wp.vec3
    assert (v.numpy() == data).all()


def test_load_and_store_functions(device):
    @wp.kernel
    def project(positions: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec3)):
        tid = wp.tid()
        x = wp.load(positions, tid)
        wp.store(out, tid, x * 2.0)

    data = np.arange(12, dtype=np.float32).reshape(4, 3)
    positions = wp.array(data, dtype=wp.vec3, device=device)
    out = wp.zeros(4, dtype=wp.vec3, device=device)
    wp.launch(project, 4, [positions, out], device=device)
    assert (out.numpy() == 2 * data).all()


def test_fill_forms_of_the_faq(device):
    assert wp.full(8, 1.23, dtype=float, device=device).numpy().tolist() == [np.float32(1.23)] * 8
    a = wp.zeros(8, dtype=float, device=device)
    a.fill_(1.5)
    a[:4].fill_(2.5)
    assert a.numpy().tolist() == [2.5] * 4 + [1.5] * 4


def test_chain_of_kernels_needs_no_synchronisation(device):
    @wp.kernel
    def kernel_1(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = x[i] + 1.0

    @wp.kernel
    def kernel_2(y: wp.array(dtype=float), z: wp.array(dtype=float)):
        i = wp.tid()
        z[i] = y[i] * 2.0

    dim = 100_000
    array_x = wp.zeros(dim, dtype=float, device=device)
    array_y, array_z = wp.empty_like(array_x), wp.empty_like(array_x)
    wp.launch(kernel_1, dim, [array_x, array_y], device=device)
    wp.launch(kernel_2, dim, [array_y, array_z], device=device)
    assert (array_z.numpy() == 2.0).all()


def test_copies_to_the_cpu(device):
    sources = [wp.full(100, k, dtype=float, device=device) for k in range(3)]
    targets = [wp.zeros(100, dtype=float, device="cpu") for _ in range(3)]
    for target, source in zip(targets, sources):
        wp.copy(target, source)
    wp.synchronize()
    assert [target.numpy()[0] for target in targets] == [0.0, 1.0, 2.0]


def test_array_interface_views_share_memory():
    a = wp.array([1.0, 2.0, 3.0], dtype=float, device="cpu")
    view = np.asarray(a)
    view[1] = 20.0
    assert a.numpy().tolist() == [1.0, 20.0, 3.0]


def test_both_annotation_forms(device):
    @wp.kernel
    def kernel(a: wp.array[wp.vec3], b: wp.array2d[float], c: wp.array(dtype=wp.vec3, ndim=1)):
        i = wp.tid()
        c[i] = a[i] * b[i, 1]

    a = wp.array(np.ones((2, 3), np.float32), dtype=wp.vec3, device=device)
    b = wp.array(np.array([[0, 2], [0, 3]], np.float32), dtype=float, device=device)
    c = wp.zeros(2, dtype=wp.vec3, device=device)
    wp.launch(kernel, 2, [a, b], [c], device=device)
    assert c.numpy().tolist() == [[2.0] * 3, [3.0] * 3]
