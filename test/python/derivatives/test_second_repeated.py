"""Second derivatives where singular values or eigenvalues repeat.

The functions are smooth there. They are held against differences of first derivatives beside the
point, where values differ and the ordinary formulas hold.
"""

import numpy as np
import pytest

import warp as wp

real, mat33, mat22 = wp.float64, wp.mat33d, wp.mat22d
RNG = np.random.default_rng(5)
W = RNG.normal(size=(3, 3))
STEP = 1e-3
# A fourth-order rule.
WEIGHTS = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}


@wp.func
def weigh(r: mat33):
    return wp.ddot(wp.static(mat33(*W.flatten())), r)


@wp.func
def cubes(s: wp.vec3d):
    return s[0] * s[0] * s[0] + s[1] * s[1] * s[1] + s[2] * s[2] * s[2]


@wp.func
def by_values(a: mat33):
    u, s, v = wp.svd3(a)
    return cubes(s) + wp.log(s[0] * s[1] * s[2])


@wp.func
def by_rotation(a: mat33):
    u, s, v = wp.svd3(a)
    r = weigh(u * wp.transpose(v))
    return r * r + cubes(s)


@wp.func
def by_eigenvalues(a: mat33):
    q, d = wp.eig3(a)
    return cubes(d) + wp.log(d[0] * d[1] * d[2])


@wp.func
def by_projection(a: mat33):
    """The vector that is alone does not move to another place."""
    q, d = wp.eig3(a)
    x = wp.vec3d(q[0, 2], q[1, 2], q[2, 2])
    return weigh(wp.outer(x, x)) + cubes(d)


@wp.func
def by_logarithm(a: mat33):
    return weigh(wp.sym_log3(a))


@wp.func
def by_exponential(a: mat33):
    return weigh(wp.sym_exp3(a))


@wp.func
def by_root(a: mat33):
    return weigh(wp.sym_sqrt3(a))


@wp.func
def by_function(a: mat33):
    return weigh(wp.sym_fn3(a, wp.tanh))


@wp.func
def by_values_of_2(a: mat22):
    u, s, v = wp.svd2(a)
    r = u * wp.transpose(v)
    return s[0] * s[0] * s[0] + s[1] * s[1] * s[1] + (r[0, 1] - r[1, 0]) * s[0] * s[1]


def evaluation(function, dtype):
    @wp.kernel(module="unique")
    def evaluate(a: wp.array(dtype=dtype), loss: wp.array(dtype=real)):
        i = wp.tid()
        wp.atomic_add(loss, 0, function(a[i]))

    def run(a):
        loss = wp.zeros(1, dtype=real, requires_grad=True, device=a.device)
        wp.launch(evaluate, a.size, [a, loss], device=a.device)
        return loss

    return run


def gradient(run, points, dtype, device):
    a = wp.array(points, dtype=dtype, requires_grad=True, device=device)
    with wp.Tape() as tape:
        loss = run(a)
    tape.backward(loss)
    return a.grad.numpy()


def second_differences(run, point, dtype, device):
    """Hessian by a gradient per point beside the given one."""
    size = point.size
    units = np.eye(size).reshape(size, *point.shape)
    result = np.zeros((size, size))
    for step, weight in WEIGHTS.items():
        beside = gradient(run, point + step * STEP * units, dtype, device)
        result += weight / STEP * beside.reshape(size, size)
    return result.T


def turn(seed, size):
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(size, size)))[0]
    q[:, 0] *= np.linalg.det(q)
    return q


def check(function, dtype, point, device, symmetric=False):
    run = evaluation(function, dtype)
    a = wp.array(point[None], dtype=dtype, requires_grad=True, device=device)
    found = wp.autograd.hessian(run, [a])[0, 0].numpy().reshape(point.size, point.size)
    expected = second_differences(run, point, dtype, device)
    if symmetric:
        swap = np.eye(9).reshape(3, 3, 3, 3).transpose(0, 1, 3, 2).reshape(9, 9)
        mean = (np.eye(9) + swap) / 2
        found, expected = mean @ found @ mean, mean @ expected @ mean
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("stretch", [(1, 1, 1), (2, 2, 1), (3, 2, 2), (3, 2, 1)])
@pytest.mark.parametrize("function", [by_values, by_rotation])
def test_functions_of_singular_values(device, function, stretch, turned, capsys):
    left, right = (turn(seed, 3) if turned else np.eye(3) for seed in (1, 2))
    check(function, mat33, left @ np.diag(stretch).astype(float) @ right.T, device)
    assert "singular" not in capsys.readouterr().out


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("stretch", [(1, 1, 1), (2, 2, 1), (3, 2, 2)])
@pytest.mark.parametrize(
    "function", [by_eigenvalues, by_logarithm, by_exponential, by_root, by_function]
)
def test_functions_of_eigenvalues(device, function, stretch, turned, capsys):
    q = turn(3, 3) if turned else np.eye(3)
    check(function, mat33, q @ np.diag(stretch).astype(float) @ q.T, device, symmetric=True)
    assert "singular" not in capsys.readouterr().out


@pytest.mark.parametrize("turned", [False, True])
def test_vectors_beside_repeated_values(device, turned):
    q = turn(4, 3) if turned else np.eye(3)
    check(by_projection, mat33, q @ np.diag((2.0, 2.0, 1.0)) @ q.T, device, symmetric=True)


@pytest.mark.parametrize("stretch", [(1.5, 1.5), (2.0, 1.0)])
def test_two_rows(device, stretch):
    point = turn(6, 2) @ np.diag(stretch) @ turn(7, 2).T
    check(by_values_of_2, mat22, point, device)


def test_along_one_vector_and_along_many(device):
    """Gradients count once, however often the adjoint runs."""
    run = evaluation(by_rotation, mat33)
    points = np.stack([np.eye(3), np.diag((2.0, 2.0, 1.0)), turn(8, 3)])
    vectors = RNG.normal(size=(5, 3, 3, 3))
    a = wp.array(points, dtype=mat33, requires_grad=True, device=device)
    many = wp.array(vectors, dtype=mat33, device=device)
    found = wp.autograd.hvp(run, [a], [many]).numpy()
    for one, vector in zip(found, vectors, strict=True):
        alone = wp.autograd.hvp(run, [a], [wp.array(vector, dtype=mat33, device=device)])
        np.testing.assert_allclose(one, alone.numpy(), rtol=1e-12, atol=1e-12)
