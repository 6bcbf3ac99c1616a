"""Arrays of one thread: `wp.zeros(shape, dtype)` in a kernel."""

import numpy as np
import pytest

import warp as wp


@wp.struct
class Mark:
    number: int
    place: wp.vec2


@wp.func
def count_up(a: wp.array2d(dtype=int)):
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            a[i, j] = i * a.shape[1] + j


@wp.func
def powers(x: float) -> wp.fixedarray(shape=(4,), dtype=float):
    p = wp.zeros(shape=4, dtype=float)
    p[0] = 1.0
    for i in range(1, 4):
        p[i] = p[i - 1] * x
    return p


def run(kernel, *inputs, out=8):
    result = wp.zeros(out, dtype=float, device="cpu")
    wp.launch(kernel, 1, inputs=[*inputs, result], device="cpu")
    return result.numpy()


def test_elements_by_constant_and_computed_indices():
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=float)):
        a = wp.zeros(shape=(2, 3), dtype=int)
        count_up(a)
        out[0] = float(a[1][2])
        out[1] = float(a[n, n + 1])
        out[2] = float(a[-1, -n - 1])
        out[3] = float(a.shape[0] * 10 + a.shape[1])
        out[4] = float(a.shape[2] + a.ndim + a.size)

    expected = np.arange(6).reshape(2, 3)
    found = run(kernel, 1)
    assert found[0] == expected[1, 2]
    assert found[1] == expected[1, 2]
    assert found[2] == expected[-1, -2]
    assert found[3] == 23
    assert found[4] == 0 + 2 + 6


def test_updates_in_branches_and_loops_keep_the_others():
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=float)):
        a = wp.zeros(shape=(4,), dtype=float)
        for i in range(n):
            if i % 2 == 0:
                a[i % 4] += float(i)
            else:
                a[3] = a[0] + 0.5
        for j in range(4):
            out[j] = a[j]

    expected = np.zeros(4)
    for i in range(7):
        if i % 2 == 0:
            expected[i % 4] += i
        else:
            expected[3] = expected[0] + 0.5
    assert np.array_equal(run(kernel, 7)[:4], expected)


def test_elements_of_vectors_and_structs():
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=float)):
        v = wp.zeros(shape=(2,), dtype=wp.vec3)
        v[n] = wp.vec3(1.0, 2.0, 3.0)
        v[n][1] += 5.0
        v[0].z = 4.0
        s = wp.zeros(shape=(3,), dtype=Mark)
        s[n + 1].number = 7
        s[n + 1].place = wp.vec2(8.0, 9.0)
        out[0] = v[1][1]
        out[1] = v[0][2]
        out[2] = float(s[2].number)
        out[3] = s[2].place[1] + s[1].place[1]

    assert list(run(kernel, 1)[:4]) == [7.0, 4.0, 7.0, 9.0]


def test_parts_are_copies():
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        a = wp.zeros(shape=(2, 3), dtype=int)
        count_up(a)
        row = a[1]
        part = a[:, 1:]
        out[0] = float(row[2])
        out[1] = float(part[1, 0])
        out[2] = float(part.shape[1])
        b = wp.array(ptr=a.ptr, shape=(3,), dtype=wp.vec2i)
        out[3] = float(b[1][1])

    assert list(run(kernel)[:4]) == [5.0, 4.0, 2.0, 3.0]

    @wp.kernel
    def writes(out: wp.array(dtype=float)):
        a = wp.zeros(shape=(2, 3), dtype=int)
        row = a[1]
        row[0] = 1

    with pytest.raises(wp.WarpCodegenError, match="is a copy and cannot be assigned to"):
        run(writes)


def test_derivative_through_the_array():
    @wp.kernel
    def kernel(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        p = powers(x[i])
        total = float(0.0)
        for k in range(p.shape[0]):
            total += float(k + 1) * p[k]
        y[i] = total

    points = np.array([0.5, -1.25, 2.0])
    x = wp.array(points, dtype=float, requires_grad=True, device="cpu")
    y = wp.zeros(3, dtype=float, requires_grad=True, device="cpu")
    with wp.Tape() as tape:
        wp.launch(kernel, 3, inputs=[x, y], device="cpu")
    tape.backward(grads={y: wp.ones(3, dtype=float, device="cpu")})
    assert np.allclose(y.numpy(), 1 + 2 * points + 3 * points**2 + 4 * points**3)
    assert np.allclose(x.grad.numpy(), 2 + 6 * points + 12 * points**2)


def test_what_cannot_be_is_refused_with_the_reason():
    @wp.kernel
    def computed(out: wp.array(dtype=float)):
        wp.zeros(shape=(wp.tid(),), dtype=int)

    with pytest.raises(wp.WarpCodegenValueError, match="shape at compile time"):
        run(computed)

    @wp.kernel
    def large(out: wp.array(dtype=float)):
        wp.zeros(shape=(4096,), dtype=int)

    with pytest.raises(wp.WarpCodegenValueError, match="at most 1024 numbers"):
        run(large)

    @wp.kernel
    def outside(out: wp.array(dtype=float)):
        a = wp.zeros(shape=(2,), dtype=float)
        out[0] = a[2]

    with pytest.raises(wp.WarpCodegenIndexError, match="out of range for 2"):
        run(outside)


@wp.func
def fill_from(p: wp.array(dtype=wp.vec2), n: int, v: float):
    for i in range(n):
        p[i] = wp.vec2(float(i) + v, v)


@wp.kernel
def overlap(out: wp.array2d(dtype=wp.vec2), n: wp.array(dtype=int)):
    t = wp.tid()
    whole = wp.zeros(shape=(10,), dtype=wp.vec2f)
    end = wp.array(ptr=whole.ptr + wp.uint64(5 * 8), shape=(5,), dtype=wp.vec2f)
    fill_from(end, 5, 10.0 * float(t))
    chosen = end
    if n[t] > 3:
        chosen = wp.array(ptr=whole.ptr, shape=(5,), dtype=wp.vec2)
    fill_from(chosen, 3, 0.5)
    whole[n[t]] = whole[n[t]] + wp.vec2(100.0, 0.0)
    for i in range(10):
        out[t, i] = whole[i] + end[i % 5]


def overlap_in_numpy(numbers):
    out = np.zeros((len(numbers), 10, 2))
    for t, n in enumerate(numbers):
        whole = np.zeros((10, 2))
        end = whole[5:]
        for part, count, v in ((end, 5, 10.0 * t), (whole[:5] if n > 3 else end, 3, 0.5)):
            for i in range(count):
                part[i] = (i + v, v)
        whole[n] += (100, 0)
        out[t] = whole + end[np.arange(10) % 5]
    return out


# Arrays at parts of an address share the memory of the thread.
def test_addresses_within_an_array(device):
    numbers = np.arange(300) % 7
    out = wp.zeros((len(numbers), 10), dtype=wp.vec2, device=device)
    wp.launch(
        overlap, len(numbers), [out, wp.array(numbers, dtype=int, device=device)], device=device
    )
    np.testing.assert_array_equal(out.numpy(), overlap_in_numpy(numbers))


@wp.kernel
def doubled(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    whole = wp.zeros(shape=(4,), dtype=float)
    end = wp.array(ptr=whole.ptr + wp.uint64(8), shape=(2,), dtype=float)
    end[1] = 2.0 * x[wp.tid()]
    y[wp.tid()] = whole[3]


def test_addresses_within_an_array_have_no_derivative(device):
    x = wp.array([1.0, 2.0], dtype=float, requires_grad=True, device=device)
    y = wp.zeros_like(x)
    with wp.Tape() as tape:
        wp.launch(doubled, 2, [x], [y], device=device)
    assert y.numpy().tolist() == [2.0, 4.0]
    with pytest.raises(wp.WarpError, match="reached by its address has no derivative") as error:
        tape.backward(grads={y: wp.ones_like(y)})
    assert "test_local_arrays.py" in str(error.value)
