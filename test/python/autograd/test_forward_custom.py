"""Derivatives that functions have of their own, in forward mode."""

import numpy as np
import pytest

import warp as wp

real = wp.float64


def push(kernel, inputs, tangents, output, device):
    """The tangent of a launch's output, for tangents of which any may be None."""
    arrays = [wp.array(x, dtype=dtype, device=device) for x, dtype in inputs]
    along = [
        None if t is None else wp.array(t, dtype=dtype, device=device)
        for t, (_, dtype) in zip(tangents, inputs, strict=True)
    ]

    def function(*arrays):
        result = wp.zeros(arrays[0].shape[0], dtype=output, device=device)
        wp.launch(kernel, arrays[0].shape[0], [*arrays, result], device=device)
        return result

    return wp.autograd.jvp(function, arrays, along).numpy()


def pull(kernel, inputs, seed, output, device):
    """The gradients of the inputs for cotangents of the output."""
    arrays = [wp.array(x, dtype=dtype, device=device, requires_grad=True) for x, dtype in inputs]
    result = wp.zeros(len(seed), dtype=output, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(kernel, len(seed), [*arrays, result], device=device)
    tape.backward(grads={result: wp.array(seed, dtype=output, device=device)})
    return [one.grad.numpy() for one in arrays]


def check_dots(kernel, inputs, output, device):
    """<J v, w> = <v, J^T w> for random v and w."""
    rng = np.random.default_rng(7)
    tangents = [rng.normal(size=np.shape(x)) for x, _ in inputs]
    forward = push(kernel, inputs, tangents, output, device)
    seed = rng.normal(size=forward.shape)
    gradients = pull(kernel, inputs, seed, output, device)
    left = (forward * seed).sum()
    right = sum((t * g).sum() for t, g in zip(tangents, gradients, strict=True))
    assert abs(left) > 0.1 and abs(left - right) <= 1e-13 * np.abs(forward * seed).sum()
    return forward


@wp.func
def steep(x: real):
    return wp.floor(x)


@wp.func_grad(steep)
def steep_grad(x: real, adj_ret: real):
    wp.adjoint[x] += real(3.0) * adj_ret


@wp.kernel
def use_steep(x: wp.array(dtype=real), y: wp.array(dtype=real)):
    i = wp.tid()
    y[i] = steep(x[i] * x[i]) * x[i]


def test_func_grad(device):
    x = np.array([1.5, -0.7, 2.2])
    found = push(use_steep, [(x, real)], [np.ones(3)], real, device)
    np.testing.assert_allclose(found, 3.0 * 2.0 * x * x + np.floor(x * x), rtol=1e-15)
    check_dots(use_steep, [(x, real)], real, device)


@wp.func
def turned(v: wp.vec3d, angle: real, n: int):
    c = wp.cos(angle)
    return wp.vec3d(c * v[0], v[1] * real(float(n)), v[2]), c


@wp.func
def turned_pullback(v: wp.vec3d, angle: real, n: int, c: real, g: wp.vec3d):
    # Not that of the function, so that it shows whose derivative is taken.
    return wp.vec3d(c * g[1], g[2], real(2.0) * g[0]), wp.dot(v, g) * c


turn = wp.custom_vjp(turned, turned_pullback)


@wp.kernel
def use_turn(v: wp.array(dtype=wp.vec3d), a: wp.array(dtype=real), y: wp.array(dtype=wp.vec3d)):
    i = wp.tid()
    y[i] = turn(v[i], a[i], 3) * wp.exp(a[i])


def test_pullback_with_residuals_and_components(device):
    rng = np.random.default_rng(1)
    v, a = rng.normal(size=(4, 3)), rng.normal(size=4)
    found = check_dots(use_turn, [(v, wp.vec3d), (a, real)], wp.vec3d, device)
    rng = np.random.default_rng(7)
    dv, da = rng.normal(size=(4, 3)), rng.normal(size=4)
    c, e = np.cos(a), np.exp(a)
    value = np.stack([c * v[:, 0], 3 * v[:, 1], v[:, 2]], 1)
    # Column k of the transposed pullback, with (dv, da).
    tangent = np.stack(
        [2 * dv[:, 2] + v[:, 0] * c * da, c * dv[:, 0] + v[:, 1] * c * da,
         dv[:, 1] + v[:, 2] * c * da], 1)  # fmt: skip
    np.testing.assert_allclose(found, e[:, None] * (tangent + value * da[:, None]), rtol=1e-13)
    only = push(use_turn, [(v, wp.vec3d), (a, real)], [dv, None], wp.vec3d, device)
    tangent = np.stack([2 * dv[:, 2], c * dv[:, 0], dv[:, 1]], 1)
    np.testing.assert_allclose(only, e[:, None] * tangent, rtol=1e-13)


@wp.func
def root(x: real):
    return wp.sqrt(x)


@wp.func
def root_pushforward(x: real, tangent: real):
    return real(5.0) * tangent / wp.sqrt(x)


own_root = wp.custom_jvp(root, root_pushforward)


@wp.kernel
def use_root(x: wp.array(dtype=real), y: wp.array(dtype=real)):
    i = wp.tid()
    y[i] = x[i] * own_root(x[i])


def test_pushforward_gives_both_modes(device):
    x = np.array([1.0, 4.0, 9.0])
    found = push(use_root, [(x, real)], [np.ones(3)], real, device)
    np.testing.assert_allclose(found, 5.0 * np.sqrt(x) + np.sqrt(x), rtol=1e-15)
    check_dots(use_root, [(x, real)], real, device)
    assert own_root(4.0) == 2.0


@wp.func
def two_results(x: wp.vec3d, y: real, n: int):
    return wp.cross(x, x), y * real(float(n))


@wp.func
def two_tangents(x: wp.vec3d, y: real, n: int, dx: wp.vec3d, dy: real):
    return wp.cross(x, dx) * y, wp.dot(x, dx) + real(float(n)) * dy * y


pair = wp.custom_jvp(two_results, two_tangents)


@wp.kernel
def use_pair(x: wp.array(dtype=wp.vec3d), y: wp.array(dtype=real), out: wp.array(dtype=wp.vec3d)):
    i = wp.tid()
    first, second = pair(x[i], y[i], 2)
    out[i] = first + second * wp.vec3d(real(1.0), real(2.0), real(3.0))


def test_pushforward_of_two_results(device):
    rng = np.random.default_rng(3)
    x, y = rng.normal(size=(3, 3)), rng.normal(size=3)
    found = check_dots(use_pair, [(x, wp.vec3d), (y, real)], wp.vec3d, device)
    rng = np.random.default_rng(7)
    dx, dy = rng.normal(size=(3, 3)), rng.normal(size=3)
    second = (x * dx).sum(1) + 2 * dy * y
    expected = np.cross(x, dx) * y[:, None] + second[:, None] * np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(found, expected, rtol=1e-13)


@wp.func
def halved(x: wp.float16):
    return x * wp.float16(0.5)


@wp.func_grad(halved)
def halved_grad(x: wp.float16, adj_ret: wp.float16):
    wp.adjoint[x] += wp.float16(4.0) * adj_ret


@wp.kernel
def use_halved(x: wp.array(dtype=wp.float16), y: wp.array(dtype=wp.float16)):
    i = wp.tid()
    y[i] = halved(x[i])


def test_narrow_floats(device):
    x = wp.array([1.0, 2.0], dtype=wp.float16, device=device)
    v = wp.array([[1.0, 3.0], [0.5, 2.0**-30]], dtype=wp.float32, device=device)

    def function(x):
        y = wp.zeros_like(x)
        wp.launch(use_halved, 2, [x, y], device=device)
        return y

    found = wp.autograd.jvp(function, [x], [v])
    assert np.array_equal(found.numpy(), 4.0 * v.numpy())


@wp.func
def take_slot(counter: wp.array(dtype=int)):
    return wp.atomic_add(counter, 0, 1)


@wp.func_replay(take_slot)
def take_slot_again(counter: wp.array(dtype=int)):
    return 0


@wp.kernel
def compact(x: wp.array(dtype=real), counter: wp.array(dtype=int), y: wp.array(dtype=real)):
    i = wp.tid()
    if x[i] > real(0.0):
        y[take_slot(counter)] = x[i] * x[i]


def test_a_replay_is_for_reverse_mode(device):
    """The launch runs the function itself, so tangents go where values go."""
    x = wp.array([1.0, -2.0, 3.0, 4.0], dtype=real, device=device)
    counter = wp.zeros(1, dtype=int, device=device)
    made = []

    def function(x):
        made.append(wp.zeros(3, dtype=real, device=device))
        wp.launch(compact, 4, [x, counter, made[0]], device=device)
        return made[0]

    found = wp.autograd.jvp(function, [x], [wp.ones(4, dtype=real, device=device)]).numpy()
    assert sorted(made[0].numpy()) == [1.0, 9.0, 16.0]
    np.testing.assert_array_equal(found, 2.0 * np.sqrt(made[0].numpy()))


@wp.func
def lookup(table: wp.array(dtype=real), x: real):
    return table[0] * x


@wp.func_grad(lookup)
def lookup_grad(table: wp.array(dtype=real), x: real, adj_ret: real):
    wp.adjoint[x] += real(7.0) * table[0] * adj_ret
    wp.adjoint[table][0] += x * adj_ret


@wp.kernel
def use_lookup(x: wp.array(dtype=real), table: wp.array(dtype=real), y: wp.array(dtype=real)):
    i = wp.tid()
    y[i] = lookup(table, x[i])


def test_arrays_that_a_pullback_updates(device):
    """Constant, they are read; with tangents, they are an error that says where."""
    x, table = (np.array([1.0, 2.0]), real), (np.array([10.0, 0.0]), real)
    found = push(use_lookup, [x, table], [np.ones(2), None], real, device)
    np.testing.assert_array_equal(found, [70.0, 70.0])
    with pytest.raises(wp.WarpError, match=r"'lookup.*' has no tangents of its array, argument 1"):
        push(use_lookup, [x, table], [np.ones(2), np.ones(2)], real, device)


@wp.func
def contraction(x: real, a: real):
    return real(0.5) * (x + a / x)


@wp.kernel
def solve(a: wp.array(dtype=real), y: wp.array(dtype=real)):
    i = wp.tid()
    y[i] = wp.fixed_point(contraction, a[i], a[i])


def test_fixed_point(device):
    a = np.array([2.0, 9.0])
    found = push(solve, [(a, real)], [np.ones(2)], real, device)
    np.testing.assert_allclose(found, 0.5 / np.sqrt(a), rtol=1e-12)


@wp.func
def plain(x: real):
    return x


@wp.func
def takes_more(x: real, n: int, dx: real):
    return dx


@wp.func
def gives_a_vector(x: real, dx: real):
    return wp.vec3d(dx, dx, dx)


@pytest.mark.parametrize(
    "pushforward, message",
    [
        (takes_more, r"'takes_more' of 'plain' expects to take \(float64, float64\)"),
        (gives_a_vector, r"one tangent per result of floats, '\(float64\)', but returns"),
    ],
)
def test_bad_pushforwards(device, pushforward, message):
    function = wp.custom_jvp(plain, pushforward)

    @wp.kernel
    def use(x: wp.array(dtype=real), y: wp.array(dtype=real)):
        y[0] = function(x[0])

    x = np.ones(1)
    with pytest.raises(wp.WarpError, match=message):
        push(use, [(x, real)], [x], real, device)
    with pytest.raises(TypeError, match="custom_jvp expects functions"):
        wp.custom_jvp(plain, 3)
