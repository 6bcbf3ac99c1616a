"""Slices of vectors, matrices and rotations: updates in place, their gradients, empty slices."""

import itertools

import numpy as np
import pytest

import warp as wp

vec1 = wp.types.vector(1, float)
mat23 = wp.types.matrix((2, 3), float)


@wp.kernel
def update_local(v: wp.array(dtype=wp.vec4), m: wp.array(dtype=mat23), q: wp.array(dtype=wp.quat)):
    a = v[0]
    a[1:3] += wp.vec2(10.0, 20.0)
    a[::2] -= a[2:]
    a[:2] *= 3.0
    v[0] = a
    b = m[0]
    b[:, 1] += wp.vec2(1.0, 2.0)
    b[1, 1:] -= wp.vec2(5.0, 5.0)
    m[0] = b
    c = q[0]
    c[:-1] += wp.vec3(1.0, 2.0, 3.0)
    q[0] = c


def test_updates_of_slices_are_those_of_numpy(device):
    v = wp.array([[1, 2, 3, 4]], dtype=wp.vec4, device=device)
    m = wp.array([[[1, 2, 3], [4, 5, 6]]], dtype=mat23, device=device)
    q = wp.array([[1, 2, 3, 4]], dtype=wp.quat, device=device)
    a, b, c = (one.numpy()[0].copy() for one in (v, m, q))
    wp.launch(update_local, 1, [v, m, q], device=device)
    a[1:3] += [10, 20]
    a[::2] -= a[2:].copy()
    a[:2] *= 3
    b[:, 1] += [1, 2]
    b[1, 1:] -= 5
    c[:-1] += [1, 2, 3]
    for array, expected in ((v, a), (m, b), (q, c)):
        assert np.array_equal(array.numpy()[0], expected)


@wp.kernel
def update_element(
    x: wp.array(dtype=wp.vec2), y: wp.array(dtype=wp.vec4), m: wp.array(dtype=mat23)
):
    i = wp.tid()
    y[0][1:3] += 2.0 * x[i]
    m[0][:, 2] -= x[i]


def test_elements_are_updated_by_many_threads(device):
    n = 1000
    values = np.arange(2 * n).reshape(n, 2) % 7
    x = wp.array(values, dtype=wp.vec2, device=device, requires_grad=True)
    y = wp.zeros(1, dtype=wp.vec4, device=device, requires_grad=True)
    m = wp.zeros(1, dtype=mat23, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(update_element, n, [x, y, m], device=device)
    total = values.sum(axis=0)
    assert np.array_equal(y.numpy()[0], [0, 2 * total[0], 2 * total[1], 0])
    assert np.array_equal(m.numpy()[0], [[0, 0, -total[0]], [0, 0, -total[1]]])
    tape.backward(grads={y: wp.array([[1, 2, 3, 4]], dtype=wp.vec4, device=device)})
    assert np.array_equal(x.grad.numpy(), np.tile([4, 6], (n, 1)))


@wp.kernel
def overwrite(x: wp.array(dtype=wp.vec2), y: wp.array(dtype=wp.transform)):
    i = wp.tid()
    t = y[i]
    t[:2] = x[i]
    t[1:3] += x[i]
    t[3:1:-1] -= x[i][0:]
    y[i] = t


def test_gradient_of_updated_slices(device):
    x = wp.array([[2, 3]], dtype=wp.vec2, device=device, requires_grad=True)
    y = wp.zeros(1, dtype=wp.transform, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(overwrite, 1, [x, y], device=device)
    # t is (x0, x1 + x0, x1 - x1, -x0, 0, 0, 1).
    assert np.array_equal(y.numpy()[0, :4], [2, 5, 0, -2])
    seed = wp.array([[1, 10, 100, 1000, 0, 0, 0]], dtype=wp.transform, device=device)
    tape.backward(grads={y: seed})
    assert np.array_equal(x.grad.numpy(), [[1 + 10 - 1000, 10 + 100 - 100]])


def test_updates_of_slices_are_what_their_operator_is():
    @wp.kernel
    def product(x: wp.array(dtype=wp.vec3)):
        v = x[0]
        v[:2] *= v[1:]
        x[0] = v

    @wp.kernel
    def shift(x: wp.array(dtype=wp.vec3)):
        x[0][:2] += 1.0

    @wp.kernel
    def lengths(x: wp.array(dtype=wp.vec3)):
        x[0][:2] += x[1]

    x = wp.zeros(2, dtype=wp.vec3, device="cpu")
    for kernel, message in (
        (product, r"no overload of '\*' takes \(vec2f, vec2f\)"),
        (shift, r"no overload of '\+' takes \(vec2f, float32\)"),
        (lengths, "slice has 2 components, but 'vec3f' has 3"),
    ):
        with pytest.raises(wp.WarpCodegenError, match=message):
            wp.launch(kernel, 1, [x], device="cpu")


vec0 = wp.types.vector(0, float)


@wp.func
def ends_are_empty(v: wp.vec3):
    return v[3:] == vec0() and v[:-3] == vec0() and v[2:] == vec1(v[2])


@wp.kernel
def compare(v: wp.array(dtype=wp.vec3), out: wp.array(dtype=bool)):
    out[0] = ends_are_empty(v[0])


def test_empty_slices(device):
    v = wp.array([[1, 2, 3]], dtype=wp.vec3, device=device)
    out = wp.zeros(1, dtype=bool, device=device)
    wp.launch(compare, 1, [v, out], device=device)
    assert out.numpy()[0]
    assert wp.vec3(1, 2, 3)[5:] == vec0() and len(vec0()) == 0
    assert wp.mat33()[3:] == wp.types.matrix((0, 0), float)() and str(wp.mat33()[3:]) == "[]"

    @wp.kernel
    def kernel(x: wp.array(dtype=wp.vec3)):
        v = x[0]
        x[0] = wp.vec3(wp.length(v[3:]))

    with pytest.raises(wp.WarpCodegenTypeError, match="a slice without components"):
        wp.launch(kernel, 1, [v], device=device)
    with pytest.raises(ValueError, match="at least 0, but got '-1'"):
        wp.types.vector(-1, float)


@wp.kernel
def translate(out: wp.array(dtype=wp.transform)):
    out[0] = wp.transform(p=wp.vec3(1.0, 2.0, 3.0))
    out[1] = wp.transform(wp.vec3(4.0, 5.0, 6.0))


def test_transforms_without_rotation(device):
    out = wp.zeros(2, dtype=wp.transform, device=device)
    wp.launch(translate, 1, [out], device=device)
    assert np.array_equal(out.numpy(), [[1, 2, 3, 0, 0, 0, 1], [4, 5, 6, 0, 0, 0, 1]])


@wp.kernel
def part(a: wp.array(dtype=float), start: int, stop: int, step: int, out: wp.array(dtype=float)):
    v = a[start:stop:step]
    out[0] = float(v.shape[0])
    for i in range(v.shape[0]):
        out[i + 1] = v[i]


def test_slices_of_arrays_are_those_of_numpy(device):
    for count in (1, 4, 5):
        numbers = np.arange(count) + 1.0
        a = wp.array(numbers, dtype=float, device=device)
        bounds = (-count - 2, -count, -1, 0, 1, count - 1, count, count + 2)
        for start, stop, step in itertools.product(bounds, bounds, (-3, -1, 1, 2)):
            out = wp.zeros(count + 1, device=device)
            wp.launch(part, 1, [a, start, stop, step, out], device=device)
            expected = numbers[start:stop:step]
            found = out.numpy()
            assert found[0] == len(expected), (count, start, stop, step)
            assert np.array_equal(found[1 : len(expected) + 1], expected)
    out = wp.zeros(6, device=device)
    with pytest.raises(wp.WarpLaunchError, match="slice step is zero"):
        wp.launch(part, 1, [a, 0, 5, 0, out], device=device)
        wp.synchronize()


@wp.kernel
def reverse(a: wp.array(dtype=float), step: int, out: wp.array2d(dtype=float)):
    i = wp.tid()
    out[0, i] = a[::-1][i]
    out[1, i] = a[::step][i]
    out[2, i] = 2.0 * a[2::-1][wp.min(i, 2)]
    v = a[:1:step]
    if i < v.shape[0]:
        out[3, i] = v[i]


def test_slices_with_open_ends(device):
    a = wp.array([1.0, 2.0, 3.0, 4.0], dtype=float, device=device, requires_grad=True)
    out = wp.zeros((4, 4), dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(reverse, 4, [a, -1, out], device=device)
    expected = [[4, 3, 2, 1], [4, 3, 2, 1], [6, 4, 2, 2], [4, 3, 0, 0]]
    assert np.array_equal(out.numpy(), expected)
    seed = np.arange(16.0).reshape(4, 4)
    tape.backward(grads={out: wp.array(seed, dtype=float, device=device)})
    exact = seed[0, ::-1] + seed[1, ::-1]
    exact[:3] += 2 * np.array([seed[2, 2] + seed[2, 3], seed[2, 1], seed[2, 0]])
    exact[3:1:-1] += seed[3, :2]
    assert np.array_equal(a.grad.numpy(), exact)
    out.zero_()
    wp.launch(reverse, 4, [a, 1, out], device=device)
    assert np.array_equal(out.numpy()[[1, 3]], [[1, 2, 3, 4], [1, 0, 0, 0]])
