"""Adjoints of what kernels do to memory: gradients by all contents before a launch.

They are those of a weighted sum of all contents after it, against central differences of the kernel
itself in float64.
"""

import numpy as np
import pytest

import warp as wp

F = wp.float64
STEP = 1e-5


def launch(kernel, dim, values, rest, dtypes, **options):
    arrays = [
        wp.array(v, dtype=t, device="cpu", requires_grad=True) for v, t in zip(values, dtypes)
    ]
    wp.launch(kernel, dim, inputs=[*arrays, *rest], device="cpu")
    return arrays


def gradients(kernel, dim, values, rest, dtypes, weights):
    with wp.Tape() as tape:
        arrays = launch(kernel, dim, values, rest, dtypes)
    seeds = [wp.array(w, dtype=t, device="cpu") for w, t in zip(weights, dtypes)]
    tape.backward(grads=dict(zip(arrays, seeds)))
    return [a.grad.numpy() for a in arrays]


def check(kernel, dim, *values, rest=(), dtypes=None):
    """Gradients of arrays as the launch found them."""
    values = [np.array(v, dtype=np.float64) for v in values]
    dtypes = dtypes or [F] * len(values)
    weights = [np.cos(1.0 + np.arange(v.size)).reshape(v.shape) for v in values]
    got = gradients(kernel, dim, values, rest, dtypes, weights)

    def total(moved):
        after = launch(kernel, dim, moved, rest, dtypes)
        return sum(float((w * a.numpy()).sum()) for w, a in zip(weights, after))

    for which, value in enumerate(values):
        for at in np.ndindex(value.shape):
            ends = []
            for sign in (1.0, -1.0):
                moved = [v.copy() for v in values]
                moved[which][at] += sign * STEP
                ends.append(total(moved))
            slope = (ends[0] - ends[1]) / (2.0 * STEP)
            assert got[which][at] == pytest.approx(slope, rel=1e-6, abs=1e-8), (which, at)


def wave(*shape):
    return np.sin(1.0 + 0.7 * np.arange(int(np.prod(shape)))).reshape(shape) + 1.2


def test_branches_with_stores():
    @wp.kernel
    def k(x: wp.array(dtype=F), y: wp.array(dtype=F), n: int):
        i = wp.tid()
        if i >= n:
            return
        t = x[i] * x[i]
        if t > F(1.0):
            y[i] = t * y[i]
            t = wp.sin(t)
        elif i == 2:
            y[i] = F(3.0)
        x[i] = t

    check(k, 6, wave(6), wave(6), rest=[5])


def test_values_of_outer_branches():
    @wp.kernel
    def k(x: wp.array(dtype=F), y: wp.array(dtype=F)):
        i = wp.tid()
        a = x[i]
        b = wp.exp(a)
        c = F(0.0)
        if a > F(0.5):
            if b > F(3.0):
                c = a * b
            else:
                c = b / a
                b = c
        y[i] = b * c + a

    check(k, 5, wave(5) - 0.5, wave(5))


def test_rows_of_a_thread():
    """The first index tells threads apart, the others are known to differ or to be equal."""

    @wp.kernel
    def k(x: wp.array2d(dtype=F), y: wp.array(dtype=F)):
        i = wp.tid()
        a = x[i, 0]
        x[i, 1] = a * x[i, 2]
        x[i, 2] = x[i, 1] * y[i]
        x[i][0] = a * a * x[i, 1]
        y[2 * 2 - 4 + i] = x[i, 0]

    check(k, 3, wave(3, 3), wave(3))


def test_interleaved_elements():
    @wp.kernel
    def k(x: wp.array(dtype=F), y: wp.array(dtype=F)):
        i = wp.tid()
        x[2 * i + 1] = x[2 * i] * x[2 * i + 1] * y[i]

    check(k, 4, wave(8), wave(4))


def test_values_through_memory():
    @wp.kernel
    def k(x: wp.array(dtype=F), y: wp.array(dtype=F), z: wp.array(dtype=F)):
        i = wp.tid()
        y[i] = x[i] * z[i]
        y[i] = y[i] * y[i]
        z[i] = y[i] + wp.sin(y[i])
        if z[i] > F(1.0):
            z[i] = z[i] * x[i]
        y[i] = z[i]

    check(k, 4, wave(4), wave(4), wave(4))


def test_components_in_place():
    @wp.kernel
    def k(p: wp.array(dtype=wp.vec3d), m: wp.array(dtype=wp.mat22d), x: wp.array(dtype=F)):
        i = wp.tid()
        p[i][1] = p[i][0] * x[i]
        p[i].z += x[i]
        a = m[i]
        m[i][0, 1] = a[1, 0] * a[0, 0]
        x[i] = a[0][1] * a[1][1]

    dtypes = [wp.vec3d, wp.mat22d, F]
    check(k, 2, wave(2, 3), wave(2, 2, 2), wave(2), dtypes=dtypes)


def test_components_by_index():
    @wp.kernel
    def k(p: wp.array(dtype=wp.vec4d), x: wp.array(dtype=F), j: int):
        i = wp.tid()
        v = p[i]
        v[i] = v[j] * x[i]
        v[-1] = v[i] * v[i]
        x[i] = wp.dot(v, v)
        p[i] = v * v[j]

    check(k, 3, wave(3, 4), wave(3), rest=[1], dtypes=[wp.vec4d, F])


def test_chains_of_one_thread():
    @wp.kernel
    def forward(x: wp.array(dtype=F), p: wp.array(dtype=F), n: int):
        for k in range(n):
            p[k + 1] = x[k] * p[k] + p[k + 1]

    @wp.kernel
    def backward(x: wp.array(dtype=F), n: int):
        for k in range(n - 1, -1, -1):
            x[k] = x[k] * x[k + 1]

    @wp.kernel
    def in_place(x: wp.array(dtype=F), n: int):
        for k in range(n):
            x[k] = x[k] * x[k]

    @wp.kernel
    def twice(x: wp.array(dtype=F), n: int):
        for k in range(n):
            x[k // 2] = x[k // 2] * x[k // 2]

    check(forward, 1, wave(4), wave(5), rest=[4])
    check(backward, 1, wave(5), rest=[4])
    check(in_place, 1, wave(5), rest=[5])
    check(twice, 1, wave(2), rest=[4])


def test_elements_that_loops_update():
    @wp.kernel
    def k(x: wp.array2d(dtype=F), y: wp.array(dtype=F), z: wp.array2d(dtype=F), n: int):
        i = wp.tid()
        for j in range(n):
            y[i] = y[i] * x[i, j]
            for _ in range(2):
                z[1, i] = wp.sin(z[1, i]) * y[i]
                if z[1, i] < F(0.4):
                    y[i] = y[i] + z[1, i]
        y[i] = y[i] * y[i]
        for j in range(n):
            y[i] = y[i] * x[i, j]

    values = 0.6 * wave(2, 5), 0.5 * wave(2), wave(2, 2)
    check(k, 2, *values, rest=[4])
    check(k, 2, *values, rest=[0])


def test_elements_that_some_iterations_update():
    @wp.kernel
    def k(x: wp.array2d(dtype=F), y: wp.array(dtype=F), n: int):
        i = wp.tid()
        total = y[i] * y[i]
        for j in range(n):
            if x[i, j] > F(1.0):
                y[i] = y[i] * x[i, j]
            if y[i] > F(6.0):
                break
            total += y[i] * y[i]
        y[i] = total

    check(k, 3, wave(3, 5), wave(3), rest=[5])


def test_values_overwritten_twice():
    """The kernel keeps what neither the array nor a copy of it has."""

    @wp.kernel
    def k(
        x: wp.array(dtype=F), y: wp.array(dtype=F), z: wp.array(dtype=F), order: wp.array(dtype=int)
    ):
        i = wp.tid()
        j = order[i]
        if x[i] > F(0.0):
            x[i] = x[i] + y[i]
        x[i] = x[i] * x[i]
        if y[i] > F(1.0):
            x[i] = wp.exp(x[i])
        order[1 - i] = 7
        z[j] = x[i]

    order = wp.array([1, 0], dtype=int, device="cpu")
    values, w = [wave(2) - 1.0, wave(2), wave(2)], np.array([0.5, 1.5])
    x, y, z = (wp.array(v, dtype=F, device="cpu", requires_grad=True) for v in values)
    with wp.Tape() as tape:
        wp.launch(k, 1, [x, y, z, order], device="cpu")
    tape.backward(grads={z: wp.array(w, dtype=F, device="cpu")})
    s = values[0][0] + values[1][0]
    slope = 2.0 * s * np.exp(s * s) * w[1]
    np.testing.assert_allclose(x.grad.numpy(), [slope, 0.0])
    np.testing.assert_allclose(y.grad.numpy(), [slope, 0.0])
    np.testing.assert_allclose(z.grad.numpy(), [0.5, 0.0])


def test_many_threads_of_a_chain():
    @wp.kernel
    def k(x: wp.array(dtype=F), n: int):
        for k in range(n):
            x[k + 1] = x[k + 1] + x[k]

    check(k, 1, wave(4), rest=[3])
    x = wp.array(wave(4), dtype=F, device="cpu", requires_grad=True)
    with pytest.raises(Exception, match="one thread"):
        wp.launch(k, 2, [x, 3], device="cpu", adjoint=True)


def test_atomics():
    @wp.kernel
    def k(x: wp.array(dtype=F), y: wp.array(dtype=F), v: wp.array(dtype=wp.vec2d)):
        i = wp.tid()
        wp.atomic_add(y, 0, x[i] * x[i])
        wp.atomic_sub(y, 1, wp.sin(x[i]))
        wp.atomic_max(y, 2, x[i] * F(2.0))
        wp.atomic_min(y, 3, x[i])
        for j in range(3):
            wp.atomic_add(v, j % 2, wp.vec2d(x[i], x[i] * x[i]))

    check(k, 4, wave(4), wave(4) + 0.5, wave(2, 2), dtypes=[F, F, wp.vec2d])


def test_extrema_of_components():
    @wp.kernel
    def k(x: wp.array(dtype=wp.vec2d), y: wp.array(dtype=wp.vec2d)):
        i = wp.tid()
        wp.atomic_max(y, 0, x[i] * F(2.0))

    check(k, 3, wave(3, 2), [[4.0, 0.5]], dtypes=[wp.vec2d, wp.vec2d])


def test_extrema_that_no_thread_moved():
    @wp.kernel
    def k(x: wp.array(dtype=F), y: wp.array(dtype=F)):
        wp.atomic_max(y, 0, x[wp.tid()])

    check(k, 3, wave(3), [9.0])


def test_places_from_atomics():
    @wp.kernel
    def k(x: wp.array(dtype=F), y: wp.array(dtype=F), count: wp.array(dtype=int)):
        i = wp.tid()
        if x[i] > F(1.0):
            j = wp.atomic_add(count, 0, 1)
            y[j] = wp.sqrt(x[i])

    x = np.array([1.5, 0.2, 2.5, 0.7, 1.1])
    given = wp.array(x, dtype=F, device="cpu", requires_grad=True)
    y = wp.zeros(5, dtype=F, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(k, 5, [given, y, wp.zeros(1, dtype=int, device="cpu")], device="cpu")
    tape.backward(grads={y: wp.ones(5, dtype=F, device="cpu")})
    np.testing.assert_allclose(given.grad.numpy(), np.where(x > 1.0, 0.5 / np.sqrt(x), 0.0))


def test_structs_everywhere():
    @wp.struct
    class Inner:
        a: F
        v: wp.vec2d

    @wp.struct
    class Outer:
        n: int
        inner: Inner
        b: F

    @wp.func
    def step(s: Outer, by: F):
        t = s
        t.inner.a = s.b * by
        t.b = s.inner.a + s.inner.v[1]
        t.inner.v = t.inner.v * by
        return t

    @wp.kernel
    def k(x: wp.array(dtype=F), y: wp.array(dtype=F), given: Outer):
        i = wp.tid()
        s = given
        s.inner.a = x[i]
        s.b = x[i] * x[i]
        for _ in range(given.n):
            s = step(s, wp.sin(s.b))
        if x[i] > F(1.0):
            s = step(s, s.inner.a)
        y[i] = s.inner.a * s.b + wp.dot(s.inner.v, s.inner.v)

    given = Outer()
    given.n, given.b, given.inner.a, given.inner.v = 3, 0.5, 0.25, wp.vec2d(0.3, 0.7)
    check(k, 4, wave(4), wave(4), rest=[given])


def test_arrays_of_structs_in_place():
    @wp.struct
    class Body:
        m: F
        x: wp.vec2d

    @wp.kernel
    def k(bodies: wp.array(dtype=Body), x: wp.array(dtype=F)):
        i = wp.tid()
        b = bodies[i]
        b.m = b.m * x[i]
        b.x[0] = b.x[1] * b.m
        bodies[i] = b
        x[i] = bodies[i].x[0]

    bodies = wp.zeros(2, dtype=Body, device="cpu", requires_grad=True)
    data = bodies.numpy()
    data["m"] = [2.0, 3.0]
    data["x"] = [[0.5, 0.25], [0.75, 1.5]]
    bodies = wp.array(data, dtype=Body, device="cpu", requires_grad=True)
    x = wp.array([1.5, 0.5], dtype=F, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(k, 2, [bodies, x], device="cpu")
    tape.backward(grads={x: wp.ones(2, dtype=F, device="cpu")})
    got = bodies.grad.numpy()
    np.testing.assert_allclose(got["m"].ravel(), [0.25 * 1.5, 1.5 * 0.5])
    np.testing.assert_allclose(np.reshape(got["x"], (2, 2)), [[0.0, 3.0], [0.0, 1.5]])
    np.testing.assert_allclose(x.grad.numpy(), [0.25 * 2.0, 1.5 * 3.0])


def test_arms_that_are_not_chosen():
    @wp.kernel
    def k(x: wp.array(dtype=F), t: wp.array(dtype=F), y: wp.array(dtype=F)):
        i = wp.tid()
        y[i] = x[i] if t[i] == F(0.0) else x[i] / t[i]
        y[i] += wp.where(x[i] > F(1.0), wp.log(x[i] - F(1.0)), F(0.0))

    x = wp.array([0.5, 1.5, 1.0], dtype=F, device="cpu", requires_grad=True)
    t = wp.array([0.0, 2.0, 0.0], dtype=F, device="cpu", requires_grad=True)
    y = wp.zeros(3, dtype=F, device="cpu", requires_grad=True)
    y.grad.fill_(1.0)
    wp.launch(k, 3, [x, t, y], device="cpu", adjoint=True)
    np.testing.assert_allclose(x.grad.numpy(), [1.0, 0.5 + 2.0, 1.0])
    np.testing.assert_allclose(t.grad.numpy(), [0.0, -1.5 / 4.0, 0.0])


def test_products_that_vanish_in_half():
    @wp.kernel
    def k(x: wp.array(dtype=wp.float16), y: wp.array(dtype=wp.float16)):
        i = wp.tid()
        t = wp.float16(1e-4) * x[i]
        y[i] = t * x[i] if x[i] > wp.float16(0.0) else x[i]

    wide = {"requires_grad": True, "grad_dtype": wp.float32}
    x = wp.array([1e-4, -1.0], dtype=wp.float16, device="cpu", **wide)
    y = wp.zeros(2, dtype=wp.float16, device="cpu", requires_grad=True)
    y.grad.fill_(1.0)
    wp.launch(k, 2, [x, y], device="cpu", adjoint=True)
    np.testing.assert_allclose(x.grad.numpy(), [2e-8, 1.0], rtol=1e-3)


def test_races_are_refused():
    @wp.kernel
    def k(x: wp.array(dtype=F)):
        i = wp.tid()
        x[i] = x[i] + x[i + 1]

    x = wp.zeros(4, dtype=F, device="cpu", requires_grad=True)
    with pytest.raises(RuntimeError, match=r"(?s)other threads.*py:\d+: 'x' is written here"):
        wp.launch(k, 3, [x], device="cpu", adjoint=True)


def test_orders_are_refused():
    @wp.kernel
    def k(x: wp.array(dtype=F), y: wp.array(dtype=F)):
        wp.atomic_exch(y, 0, x[wp.tid()])

    x, y = (wp.zeros(4, dtype=F, device="cpu", requires_grad=True) for _ in range(2))
    with pytest.raises(RuntimeError, match="order of threads"):
        wp.launch(k, 3, [x, y], device="cpu", adjoint=True)
