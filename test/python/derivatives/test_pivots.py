"""Gradients through an elimination whose pivots are searched for at run time."""

import numpy as np

import warp as wp


@wp.kernel
def solve(a: wp.array(dtype=wp.mat33d), b: wp.array(dtype=wp.vec3d), x: wp.array(dtype=wp.vec3d)):
    t = wp.tid()
    m = a[t]
    r = b[t]
    for k in range(3):
        p = k
        for i in range(k + 1, 3):
            if wp.abs(m[i, k]) > wp.abs(m[p, k]):
                p = i
        if p != k:
            for j in range(3):
                held = m[k, j]
                m[k, j] = m[p, j]
                m[p, j] = held
            last = r[k]
            r[k] = r[p]
            r[p] = last
        for i in range(k + 1, 3):
            f = m[i, k] / m[k, k]
            for j in range(k, 3):
                m[i, j] = m[i, j] - f * m[k, j]
            r[i] = r[i] - f * r[k]
    y = wp.vec3d()
    for n in range(3):
        i = 2 - n
        s = r[i]
        for j in range(i + 1, 3):
            s = s - m[i, j] * y[j]
        y[i] = s / m[i, i]
    x[t] = y


def test_gradients_are_those_of_the_solution():
    random = np.random.default_rng(5)
    n = 67
    values = random.uniform(-1, 1, (n, 3, 3))
    values += 2 * np.eye(3)[np.stack([random.permutation(3) for _ in range(n)])]
    rights, seeds = random.random((n, 3)), random.random((n, 3))
    a = wp.array(values, dtype=wp.mat33d, device="cpu", requires_grad=True)
    b = wp.array(rights, dtype=wp.vec3d, device="cpu", requires_grad=True)
    x = wp.zeros(n, dtype=wp.vec3d, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(solve, n, inputs=[a, b, x], device="cpu")
    tape.backward(grads={x: wp.array(seeds, dtype=wp.vec3d, device="cpu")})
    wanted = np.linalg.solve(values, rights[..., None])[..., 0]
    by_right = np.linalg.solve(values.transpose(0, 2, 1), seeds[..., None])[..., 0]
    by_matrix = -by_right[:, :, None] * wanted[:, None, :]
    np.testing.assert_allclose(x.numpy(), wanted, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(b.grad.numpy(), by_right, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(a.grad.numpy(), by_matrix, rtol=1e-10, atol=1e-10)
