"""Tangents of what kernels do: loops, branches, functions, atomics, memory of their own."""

import numpy as np
import pytest

import warp as wp


def push(kernel, inputs, tangents, output, device, dim=None):
    """The output of a launch and its tangent."""
    made = [wp.array(x, dtype=wp.float64, device=device) for x in inputs]
    along = [None if t is None else wp.array(t, dtype=wp.float64, device=device) for t in tangents]
    results = []

    def function(*arrays):
        result = wp.array(output, dtype=wp.float64, device=device)
        results.append(result)
        wp.launch(kernel, dim or arrays[0].size, [*arrays, result], device=device)
        return result

    tangent = wp.autograd.jvp(function, made, along)
    return results[0].numpy(), tangent.numpy()


@wp.kernel
def polynomial(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    total = wp.float64(0.0)
    power = wp.float64(1.0)
    for k in range(i + 3):
        total += wp.float64(float(k + 1)) * power
        power *= x[i]
    y[i] = total


def test_loop_with_two_carried_values(device):
    x = np.array([0.5, -1.0, 2.0])
    value, tangent = push(polynomial, [x], [np.ones(3)], np.zeros(3), device)
    for i, at in enumerate(x):
        p = np.polynomial.Polynomial(np.arange(1.0, i + 4))
        assert value[i] == pytest.approx(p(at), rel=1e-14)
        assert tangent[i] == pytest.approx(p.deriv()(at), rel=1e-14)


@wp.func
def newton_step(x: wp.float64, a: wp.float64):
    return wp.float64(0.5) * (x + a / x)


@wp.kernel
def newton(a: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    x = a[i]
    steps = wp.int32(0)
    while wp.abs(x * x - a[i]) > wp.float64(1e-14) * a[i]:
        x = newton_step(x, a[i])
        steps += 1
        if steps > 50:
            break
    y[i] = newton_step(x, a[i])


def test_while_with_break(device):
    a = np.array([2.0, 9.0, 0.01])
    value, tangent = push(newton, [a], [np.ones(3)], np.zeros(3), device)
    np.testing.assert_allclose(value, np.sqrt(a), rtol=1e-13)
    np.testing.assert_allclose(tangent, 0.5 / np.sqrt(a), rtol=1e-10)


@wp.kernel
def branches(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    v = x[i]
    if v < wp.float64(0.0):
        y[i] = wp.exp(v)
    elif v < wp.float64(1.0):
        y[i] = wp.floor(v)
    else:
        v = v * v
        y[i] = v * v


def test_branches(device):
    x = np.array([-1.0, 0.5, 2.0])
    _, tangent = push(branches, [x], [np.full(3, 2.0)], np.zeros(3), device)
    np.testing.assert_allclose(tangent, [2 * np.exp(-1.0), 0.0, 64.0], rtol=1e-14)


@wp.kernel
def sums(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    wp.atomic_add(y, 0, x[i] * x[i])
    wp.atomic_sub(y, 1, wp.sin(x[i]))


def test_atomic_sums(device):
    random = np.random.default_rng(3)
    x, v = random.uniform(-1, 1, (2, 1000))
    value, tangent = push(sums, [x], [v], np.zeros(2), device)
    np.testing.assert_allclose(value, [x @ x, -np.sin(x).sum()], rtol=1e-12)
    np.testing.assert_allclose(tangent, [2 * x @ v, -np.cos(x) @ v], rtol=1e-10, atol=1e-12)


@wp.kernel
def extremes(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    for k in range(x.shape[0]):
        wp.atomic_max(y, 0, x[k])
        wp.atomic_min(y, 1, wp.float64(2.0) * x[k])


def test_atomic_extremes_of_one_thread(device):
    x, v = np.array([0.5, 3.0, -2.0, 1.0]), np.array([1.0, 10.0, 100.0, 1000.0])
    value, tangent = push(extremes, [x], [v], np.zeros(2), device, dim=1)
    np.testing.assert_array_equal(value, [3.0, -4.0])
    np.testing.assert_array_equal(tangent, [10.0, 200.0])
    value, tangent = push(extremes, [x], [v], np.zeros(2), device, dim=64)
    np.testing.assert_array_equal(tangent, [10.0, 200.0])


@wp.kernel
def extremes_of_rows(x: wp.array2d(dtype=wp.float64), y: wp.array2d(dtype=wp.float64)):
    i, j = wp.tid()
    wp.atomic_min(y[0], i, x[i, j] * x[i, j])
    wp.atomic_max(y, 1, i, wp.sin(x[i, j]))


def test_atomic_extremes_of_many_threads(device):
    """The tangent is the winner's, or that of the initial value where nobody wins."""
    random = np.random.default_rng(5)
    x, v = random.uniform(0.1, 1.5, (2, 7, 1000))
    start, v_start = np.full((2, 7), [[9.0], [-9.0]]), random.normal(size=(2, 7))
    start[:, 3] = 0.0, 2.0
    y = wp.array(start, dtype=wp.float64, device=device)

    def function(x, y):
        y = wp.clone(y)
        wp.launch(extremes_of_rows, (7, 1000), [x, y], device=device)
        return y

    made = [wp.array(one, dtype=wp.float64, device=device) for one in (x, v, v_start)]
    tangent = wp.autograd.jvp(function, [made[0], y], [made[1], made[2]]).numpy()
    rows, low, high = np.arange(7), x.argmin(1), x.argmax(1)
    expected = np.stack([2 * x[rows, low] * v[rows, low], np.cos(x[rows, high]) * v[rows, high]])
    expected[:, 3] = v_start[:, 3]
    np.testing.assert_allclose(tangent, expected, rtol=1e-15)


@wp.kernel
def largest(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    wp.atomic_max(y, 0, x[wp.tid()])


def test_equal_extremes_have_one_winner(device):
    """The same one for all directions, so that what comes out is a row of one matrix."""
    x = wp.array([1.0, 5.0, 2.0, 5.0, 5.0], dtype=wp.float64, device=device)
    v = wp.array(np.eye(5), dtype=wp.float64, device=device)

    def function(x):
        y = wp.zeros(1, dtype=wp.float64, device=device)
        wp.launch(largest, 5, [x, y], device=device)
        return y

    found = wp.autograd.jvp(function, [x], [v]).numpy()[:, 0]
    assert found.sum() == 1 and found @ [0, 1, 0, 1, 1] == 1 and found.max() == 1


@wp.kernel
def bounds(x: wp.array(dtype=wp.vec3d), box: wp.array2d(dtype=wp.vec3d)):
    i, j = wp.tid()
    wp.atomic_min(box, i, 0, x[j] * wp.float64(float(i + 1)))
    wp.atomic_max(box[i], 1, x[j])


@pytest.mark.parametrize("count", [1, 500])
def test_atomic_extremes_of_vectors(device, count):
    """Each component has a winner of its own."""
    random = np.random.default_rng(6)
    x, v = random.normal(size=(count, 3)), random.normal(size=(4, count, 3))
    box = np.array([[[9.0] * 3, [-9.0] * 3]] * 2)

    def function(x):
        made = wp.array(box, dtype=wp.vec3d, device=device)
        wp.launch(bounds, (2, count), [x, made], device=device)
        return made

    found = wp.autograd.jvp(
        function,
        [wp.array(x, dtype=wp.vec3d, device=device)],
        [wp.array(v, dtype=wp.vec3d, device=device)],
    ).numpy()
    axes = np.arange(3)
    low, high = v[:, x.argmin(0), axes], v[:, x.argmax(0), axes]
    expected = np.stack([np.stack([low, high], 1), np.stack([2 * low, high], 1)], 1)
    np.testing.assert_allclose(found, expected, rtol=1e-15)


@wp.kernel
def overwritten(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    x[i] = wp.float64(2.0) * x[i]
    wp.atomic_max(y, 0, x[i])


def test_extremes_of_what_is_overwritten(device):
    x = np.ones(2)
    with pytest.raises(wp.WarpError, match="but this reads 'x', which the launch changes"):
        push(overwritten, [x], [x], np.zeros(1), device)
    x = wp.array([3.0, 4.0], dtype=wp.float64, device=device)
    with pytest.raises(wp.WarpError, match="but this reads 'x', which the launch changes"):
        wp.autograd.jvp(
            lambda x: wp.launch(largest, 2, [x, x], device=device) or x, [x], [wp.ones_like(x)]
        )


def test_inactive_operand_has_no_twin(device):
    @wp.kernel
    def scale(a: wp.array(dtype=wp.float64), x: wp.array(dtype=wp.float64),
              y: wp.array(dtype=wp.float64)):  # fmt: skip
        i = wp.tid()
        y[i] = a[i] * x[i]

    a, x = np.array([2.0, 3.0]), np.array([5.0, 7.0])
    _, tangent = push(scale, [a, x], [None, np.array([1.0, 10.0])], np.zeros(2), device)
    np.testing.assert_array_equal(tangent, [2.0, 30.0])
