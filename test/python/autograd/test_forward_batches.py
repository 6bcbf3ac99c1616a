"""Forward mode along several directions at once: `jvp`, `hvp`, Jacobians and Hessians."""

import numpy as np
import pytest
from test_autograd_forward import Body, chain, rosenbrock_hessian, rosenbrock_of, values, weigh

import warp as wp

COUNTS = [1, 3, 8, 13]


@wp.kernel
def advance(
    x: wp.array(dtype=wp.vec3d), v: wp.array(dtype=wp.vec3d), mass: wp.array(dtype=wp.float64)
):
    i = wp.tid()
    v[i] = v[i] - wp.float64(0.1) * x[i] / (mass[i] * wp.length(x[i]))
    x[i] = x[i] + wp.float64(0.1) * v[i]


@wp.kernel
def sum_squares(x: wp.array(dtype=wp.vec3d), loss: wp.array(dtype=wp.float64)):
    wp.atomic_add(loss, 0, wp.dot(x[wp.tid()], x[wp.tid()]))


def steps(x, v, mass):
    for _ in range(4):
        wp.launch(advance, x.size, [x, v, mass], device=x.device)
    total = wp.zeros(1, dtype=wp.float64, requires_grad=True, device=x.device)
    wp.launch(sum_squares, x.size, [x, total], device=x.device)
    return x, total


def vectors(numbers, device):
    return wp.array(numbers, dtype=wp.vec3d, requires_grad=True, device=device)


@pytest.mark.parametrize("count", COUNTS)
def test_batch_equals_one_by_one(device, count):
    """Batches of a function that overwrites its inputs, with an input that has no tangents.

    Not to the last bit: a product that directions share is not contracted with a sum.
    """
    rng = np.random.default_rng(4)
    start = rng.normal(size=(5, 3)), rng.normal(size=(5, 3)), rng.uniform(1, 2, 5)
    dx, dm = rng.normal(size=(count, 5, 3)), rng.normal(size=(count, 5))

    def inputs():
        return [vectors(start[0], device), vectors(start[1], device), values(start[2], device)]

    given = inputs()
    found = wp.autograd.jvp(
        steps, given, [wp.array(dx, dtype=wp.vec3d, device=device), None, values(dm, device)]
    )
    assert found[0].shape == (count, 5) and found[1].shape == (count, 1)
    once = inputs()
    steps(*once)
    for one, other in zip(given, once, strict=True):
        assert np.array_equal(one.numpy(), other.numpy())
    for k in range(count):
        tangents = [vectors(dx[k], device), None, values(dm[k], device)]
        alone = wp.autograd.jvp(steps, inputs(), tangents)
        for batch, single in zip(found, alone, strict=True):
            np.testing.assert_allclose(batch.numpy()[k], single.numpy(), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("count", COUNTS)
def test_batch_against_adjoints(device, count):
    """<J v, w> = <v, J^T w> for each direction."""
    rng = np.random.default_rng(count)
    x, w = values(rng.normal(size=6), device), values(rng.normal(size=6), device)
    v = values(rng.normal(size=(count, 6)), device)

    def function(x):
        y = wp.zeros_like(x)
        wp.launch(chain, 6, [x, 9, y], device=device)
        return y

    tangents = wp.autograd.jvp(function, [x], [v]).numpy()
    with wp.Tape() as tape:
        y = function(x)
    tape.backward(grads={y: w})
    np.testing.assert_allclose(tangents @ w.numpy(), v.numpy() @ x.grad.numpy(), rtol=1e-11)


@wp.kernel
def cube(x: wp.array(dtype=wp.float16), y: wp.array(dtype=wp.float16)):
    i = wp.tid()
    y[i] = x[i] * x[i] * x[i]


def test_batch_of_narrow_floats_is_wide(device):
    x = values([3.0, 2.0], device, wp.float16)
    v = wp.array(np.diag([1.0, 2.0**-20]), dtype=wp.float32, device=device)

    def function(x):
        y = wp.zeros_like(x)
        wp.launch(cube, 2, [x, y], device=device)
        return y

    found = wp.autograd.jvp(function, [x], [v])
    assert found.dtype is wp.float32
    assert np.array_equal(found.numpy(), np.diag([27.0, 12.0 * 2.0**-20]))


def test_batch_for_arrays_in_structs(device):
    x = values([3.0, 4.0], device)
    v = values(np.arange(6.0).reshape(3, 2), device)

    def function(x):
        y = wp.zeros_like(x)
        wp.launch(weigh, 2, [Body(mass=2.0, position=x), y], device=device)
        return y

    found = wp.autograd.jvp(function, [x], [v])
    assert np.array_equal(found.numpy(), 4 * x.numpy() * v.numpy())


def test_batch_on_a_tape(device):
    """Reverse mode over several tangents, with more of them than one launch has."""
    x = values([0.5, 2.0], device)
    v = values(np.arange(20.0).reshape(10, 2), device)
    w = np.random.default_rng(1).normal(size=(10, 2))
    with wp.Tape() as tape:
        tangents = wp.autograd.jvp(lambda x: x * x * x, [x], [v])
    assert np.allclose(tangents.numpy(), 3 * x.numpy() ** 2 * v.numpy())
    tape.backward(grads={tangents: values(w, device)})
    assert np.allclose(x.grad.numpy(), (6 * x.numpy() * v.numpy() * w).sum(0))


@pytest.mark.parametrize("count", COUNTS)
def test_hessian_times_several_vectors(device, count):
    rng = np.random.default_rng(count)
    numbers, v = rng.normal(size=12), rng.normal(size=(count, 12))
    x = values(numbers, device)
    x.grad.fill_(7.0)
    found = wp.autograd.hvp(rosenbrock_of, [x], [values(v, device)]).numpy()
    assert np.allclose(found, v @ rosenbrock_hessian(numbers), rtol=1e-12)
    assert (x.grad.numpy() == 7).all()


def test_hessian(device):
    x, y = values([1.0, 2.0, 3.0], device), values(np.arange(9.0), device)

    def function(x, y):
        z = x * x * x * y[:3]
        loss = wp.zeros(1, dtype=wp.float64, requires_grad=True, device=device)
        wp.launch(add_up, 3, [z, loss], device=device)
        return loss

    found = wp.autograd.hessian(function, [x, y])
    mixed = np.zeros((3, 9))
    mixed[:, :3] = np.diag(3 * x.numpy() ** 2)
    assert np.allclose(found[0, 0].numpy(), np.diag(6 * x.numpy() * y.numpy()[:3]))
    assert np.allclose(found[0, 1].numpy(), mixed)
    assert np.allclose(found[1, 0].numpy(), mixed.T)
    assert np.array_equal(found[1, 1].numpy(), np.zeros((9, 9)))


@wp.kernel
def add_up(z: wp.array(dtype=wp.float64), loss: wp.array(dtype=wp.float64)):
    wp.atomic_add(loss, 0, z[wp.tid()])


def test_hessian_of_vectors(device):
    numbers = np.array([[1.0, 2.0, 3.0], [-1.0, 0.5, 2.0]])

    def function(x):
        loss = wp.zeros(1, dtype=wp.float64, requires_grad=True, device=device)
        wp.launch(sum_cubes, 2, [x, loss], device=device)
        return loss

    found = wp.autograd.hessian(function, [vectors(numbers, device)])[0, 0]
    assert found.shape == (6, 2) and found.dtype is wp.vec3d
    expected = np.zeros((6, 6))
    for i, x in enumerate(numbers):
        size = np.linalg.norm(x)
        block = 3 * (size * np.eye(3) + np.outer(x, x) / size)
        expected[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = block
    np.testing.assert_allclose(found.numpy().reshape(6, 6), expected, rtol=1e-12, atol=1e-13)


@wp.kernel
def sum_cubes(x: wp.array(dtype=wp.vec3d), loss: wp.array(dtype=wp.float64)):
    size = wp.length(x[wp.tid()])
    wp.atomic_add(loss, 0, size * size * size)


def test_jacobian_by_forward_mode(device):
    rng = np.random.default_rng(2)
    arrays = [vectors(rng.normal(size=(3, 3)), device), vectors(rng.normal(size=(3, 3)), device)]
    mass = values(rng.uniform(1, 2, 3), device)
    reverse = wp.autograd.jacobian(advance, 3, [*arrays, mass])
    forward = wp.autograd.jacobian(advance, 3, [*arrays, mass], mode="forward")
    assert set(forward) == set(reverse) and len(forward) == 6
    for key, matrix in forward.items():
        assert matrix.dtype is reverse[key].dtype
        np.testing.assert_allclose(matrix.numpy(), reverse[key].numpy(), rtol=1e-13, atol=1e-15)
    few = wp.autograd.jacobian(advance, 3, [*arrays, mass], max_outputs_per_var=2, mode="forward")
    assert np.array_equal(few[0, 0].numpy()[:2], forward[0, 0].numpy()[:2])
    assert np.isnan(few[0, 0].numpy()[2:]).all()
    with pytest.raises(ValueError, match="'reverse' or 'forward'"):
        wp.autograd.jacobian(advance, 3, [*arrays, mass], mode="sideways")


def test_bad_batches(device):
    x = values([1.0, 2.0], device)
    two, three = values(np.ones((2, 2)), device), values(np.ones((3, 2)), device)
    with pytest.raises(ValueError, match="2 for input 0, 3 for input 1"):
        wp.autograd.jvp(lambda x, y: x + y, [x, x], [two, three])
    with pytest.raises(ValueError, match="2 for input 0, one for input 1"):
        wp.autograd.jvp(lambda x, y: x + y, [x, x], [two, x])
    with pytest.raises(ValueError, match=r"shape \(2,\), or \(k, 2\) for k directions, but got"):
        wp.autograd.jvp(lambda x: x, [x], [values(np.ones((2, 3)), device)])
    with pytest.raises(ValueError, match="at least one direction"):
        wp.autograd.jvp(lambda x: x, [x], [values(np.ones((0, 2)), device)])
    box = wp.zeros((1, 1, 1, 2), dtype=wp.float64, device=device)
    with pytest.raises(ValueError, match="one direction at a time"):
        wp.autograd.jvp(lambda x: x.reshape((1, 1, 1, 2)), [x], [two])
    assert wp.autograd.jvp(lambda x: x, [box], [box]).shape == box.shape


real_array = wp.array(dtype=wp.float64)


@wp.kernel
def sum_of_many(
    a: real_array, b: real_array, c: real_array, d: real_array, e: real_array, f: real_array,
    g: real_array, h: real_array, j: real_array, k: real_array, y: real_array,
):  # fmt: skip
    i = wp.tid()
    y[i] = a[i] * b[i] + c[i] * d[i] + e[i] * f[i] + g[i] * h[i] + j[i] * k[i]


def test_batch_for_many_arrays(device):
    """With all twins more arguments than 4096 bytes."""
    rng = np.random.default_rng(9)
    numbers, along = rng.normal(size=(10, 3)), rng.normal(size=(10, 8, 3))

    def function(*inputs):
        y = wp.zeros(3, dtype=wp.float64, device=device)
        wp.launch(sum_of_many, 3, [*inputs, y], device=device)
        return y

    found = wp.autograd.jvp(
        function, [values(x, device) for x in numbers], [values(v, device) for v in along]
    )
    pairs = numbers.reshape(5, 2, 3)[:, ::-1].reshape(10, 1, 3)
    np.testing.assert_allclose(found.numpy(), (pairs * along).sum(0), rtol=1e-13, atol=1e-14)
