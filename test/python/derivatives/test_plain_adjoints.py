"""`wp.launch(..., adjoint=True)` again and again: what a launch differs in from the one before."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def product(x: wp.array(dtype=float), y: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = x[i] * y[i] * y[i]


@wp.kernel
def spread(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(out, i // 2, x[i] * x[i])


def arrays(device, *gradients):
    values = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [0.0, 0.0, 0.0]], np.float32)
    return [
        wp.array(one, dtype=float, device=device, requires_grad=has)
        for one, has in zip(values, gradients, strict=True)
    ]


def run(x, y, out, **changes):
    # The derivative takes the gradient of what the launch overwrites, and leaves zeros.
    out.grad.fill_(1.0)
    given = {"adj_inputs": [x.grad, y.grad], "adj_outputs": [out.grad], "adjoint": True}
    wp.launch(product, x.size, [x, y], [out], device=x.device, **(given | changes))


def expected(x, y, times):
    y = y.numpy()
    return times * y * y, times * 2.0 * x.numpy() * y


def test_sums_grow_with_each_launch(device):
    x, y, out = arrays(device, True, True, True)
    for times in range(1, 5):
        run(x, y, out)
        for found, right in zip((x.grad, y.grad), expected(x, y, times), strict=True):
            np.testing.assert_array_equal(found.numpy(), right)


def test_gradients_come_and_go_between_launches(device):
    x, y, out = arrays(device, True, True, True)
    run(x, y, out)
    run(x, y, out)
    constant = wp.array(y.numpy(), dtype=float, device=device)
    run(x, constant, out)
    np.testing.assert_array_equal(x.grad.numpy(), expected(x, y, 3)[0])
    np.testing.assert_array_equal(y.grad.numpy(), expected(x, y, 2)[1])
    other = wp.zeros(3, dtype=float, device=device)
    run(x, y, out, adj_inputs=[other, None])
    np.testing.assert_array_equal(other.numpy(), expected(x, y, 1)[0])
    np.testing.assert_array_equal(x.grad.numpy(), expected(x, y, 3)[0])
    np.testing.assert_array_equal(y.grad.numpy(), expected(x, y, 3)[1])


def test_one_array_in_two_places(device):
    x, y, out = arrays(device, True, True, True)
    for _ in range(2):
        run(x, y, out)
    x.grad.zero_()
    # d/dx of x * x * x.
    run(x, x, out)
    np.testing.assert_array_equal(x.grad.numpy(), 3.0 * x.numpy() ** 2)


def test_views_that_overlap(device):
    both = wp.array([1.0, 2.0, 3.0, 4.0], dtype=float, device=device, requires_grad=True)
    out = wp.zeros(3, dtype=float, device=device, requires_grad=True)
    for _ in range(3):
        both.grad.zero_()
        run(both[:3], both[1:], out)
    # y^2 to x, 2 x y to y, at neighbouring places.
    v = np.array([1.0, 2.0, 3.0, 4.0])
    right = np.zeros(4)
    right[:3] += v[1:] ** 2
    right[1:] += 2.0 * v[:3] * v[1:]
    np.testing.assert_array_equal(both.grad.numpy(), right)


def test_sizes_and_no_threads(device):
    x, y, out = arrays(device, True, True, True)
    run(x, y, out)
    run(x, y, out)
    wp.launch(
        product,
        *(0, [x, y], [out]),
        adj_inputs=[x.grad, y.grad],
        adj_outputs=[out.grad],
        adjoint=True,
        device=device,
    )
    np.testing.assert_array_equal(x.grad.numpy(), expected(x, y, 2)[0])
    with pytest.raises(Exception, match="3 arguments"):
        wp.launch(product, 3, [x, y], adj_inputs=[x.grad], adjoint=True, device=device)


def test_sums_that_are_gathered(device):
    n = 1000
    x = wp.array(np.arange(n), dtype=float, device=device, requires_grad=True)
    out = wp.zeros(n // 2, dtype=float, device=device, requires_grad=True)
    out.grad.fill_(1.0)
    for times in range(1, 4):
        wp.launch(
            *(spread, n, [x], [out]),
            adj_inputs=[x.grad],
            adj_outputs=[out.grad],
            adjoint=True,
            device=device,
        )
        np.testing.assert_array_equal(x.grad.numpy(), times * 2.0 * np.arange(n))


@wp.kernel
def difference(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = x[i + 1] - 3.0 * x[i]


def test_two_launches_for_one(device):
    x = wp.zeros(6, dtype=float, device=device, requires_grad=True)
    out = wp.zeros(5, dtype=float, device=device, requires_grad=True)
    for dim in (5, 5, 2, (4,), 0, 5):
        x.grad.zero_()
        out.grad.fill_(1.0)
        wp.launch(difference, dim, [x], [out], adjoint=True, device=device)
        n = dim[0] if isinstance(dim, tuple) else dim
        right = np.zeros(6)
        right[:n] -= 3.0
        right[1 : n + 1] += 1.0
        np.testing.assert_array_equal(x.grad.numpy(), right)
        np.testing.assert_array_equal(out.grad.numpy(), np.arange(5) >= n)
    assert difference.derivatives.last_adjoint().gathered is not None


def test_a_tape_does_not_record_it(device):
    x, y, out = arrays(device, True, True, True)
    run(x, y, out)
    with wp.Tape() as tape:
        run(x, y, out)
        wp.launch(product, 3, [x, y], [out], device=device)
    x.grad.zero_()
    tape.backward(grads={out: wp.full(3, 1.0, dtype=float, device=device)})
    np.testing.assert_array_equal(x.grad.numpy(), expected(x, y, 1)[0])


def test_a_policy_for_singular_points_counts(device):
    @wp.kernel(module="unique")
    def root(x: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = wp.sqrt(x[i])

    x = wp.array([0.0, 4.0], dtype=float, device=device, requires_grad=True)
    out = wp.zeros(2, dtype=float, device=device, requires_grad=True)
    out.grad.fill_(1.0)
    given = {"adj_inputs": [x.grad], "adj_outputs": [out.grad], "adjoint": True, "device": device}
    before = wp.config.singular
    try:
        for policy, at_zero in (("pinned", 0.0), ("strict", np.inf), ("pinned", 0.0)):
            wp.config.singular = policy
            for _ in range(2):
                x.grad.zero_()
                out.grad.fill_(1.0)
                wp.launch(root, 2, [x], [out], **given)
                np.testing.assert_array_equal(x.grad.numpy(), [at_zero, 0.25])
    finally:
        wp.config.singular = before


@wp.kernel
def half_square(x: wp.array(dtype=wp.float16), out: wp.array(dtype=wp.float16)):
    i = wp.tid()
    out[i] = x[i] * x[i]


def test_gradients_of_16_bits_after_those_of_32(device):
    x = wp.array([1.0, 2.0, 3.0], dtype=wp.float16, device=device, requires_grad=True)
    out = wp.zeros(3, dtype=wp.float16, device=device, requires_grad=True)
    for dtype in (wp.float32, wp.float16):
        for _ in range(3):
            x.grad = wp.zeros(3, dtype=dtype, device=device)
            out.grad = wp.full(3, 1.0, dtype=dtype, device=device)
            given = {"adj_inputs": [x.grad], "adj_outputs": [out.grad], "adjoint": True}
            wp.launch(half_square, 3, [x], [out], device=device, **given)
            np.testing.assert_array_equal(x.grad.numpy(), [2.0, 4.0, 6.0])


def test_recorded_launches_again(device):
    x, y, out = arrays(device, True, True, True)
    given = {"adj_inputs": [x.grad, y.grad], "adj_outputs": [out.grad], "adjoint": True}
    recorded = wp.launch(product, 3, [x, y], [out], device=device, record_cmd=True, **given)
    for times in range(1, 4):
        out.grad.fill_(1.0)
        recorded.launch()
        np.testing.assert_array_equal(x.grad.numpy(), expected(x, y, times)[0])
    other = wp.zeros(3, dtype=float, device=device)
    recorded.set_param(0, other, adjoint=True)
    recorded.set_dim(2)
    out.grad.fill_(1.0)
    recorded.launch()
    np.testing.assert_array_equal(other.numpy(), [*expected(x, y, 1)[0][:2], 0.0])
    np.testing.assert_array_equal(x.grad.numpy(), expected(x, y, 3)[0])


def test_gradients_that_must_not_be_written():
    x, y, out = arrays("cpu", True, True, True)
    run(x, y, out)
    run(x, y, out)
    numbers = np.zeros(3, np.float32)
    numbers.setflags(write=False)
    fixed = wp.array(numbers, dtype=float, copy=False, device="cpu")
    if not fixed.read_only:
        pytest.skip("the array has memory of its own")
    with pytest.raises(ValueError, match="read-only"):
        run(x, y, out, adj_inputs=[fixed, y.grad])


def test_extents_of_launches_differ(device):
    x, y, out = arrays(device, True, True, True)
    for dim, done in ((3, 1), (2, 2), ((3,), 3)):
        out.grad.fill_(1.0)
        given = {"adj_inputs": [x.grad, y.grad], "adj_outputs": [out.grad], "adjoint": True}
        wp.launch(product, dim, [x, y], [out], device=device, **given)
        right = expected(x, y, 1)[0] * [done, done, done - (dim == 2 or done == 3)]
        np.testing.assert_array_equal(x.grad.numpy(), right)


@wp.kernel
def triple(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = 3.0 * x[i]


@wp.kernel
def neighbors(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[wp.max(i - 1, 0)] + 2.0 * x[wp.min(i + 1, x.shape[0] - 1)]


@pytest.mark.parametrize("count", [np.int64(4), np.array([4]), np.array([4, 1]), range(4, 5)])
@pytest.mark.parametrize("kernel", [triple, neighbors], ids=["whole", "gathered"])
def test_extents_of_other_types(device, kernel, count):
    """An adjoint takes the extents that a launch takes, in each of its paths."""
    x, y = (wp.zeros(4, dtype=float, device=device, requires_grad=True) for _ in range(2))
    wanted = [3, 3, 3, 3] if kernel is triple else [2, 3, 3, 4]
    with wp.Tape() as tape:
        wp.launch(kernel, count, [x], [y], device=device)
    for _ in range(2):
        x.grad.zero_()
        y.grad.fill_(1.0)
        tape.backward()
        assert x.grad.numpy().tolist() == wanted
    command = wp.launch(kernel, count, [x], [y], device=device, adjoint=True, record_cmd=True)
    command.set_dim(count)
    for recorded in (False, False, False, True):
        x.grad.zero_()
        y.grad.fill_(1.0)
        if recorded:
            command.launch()
        else:
            wp.launch(kernel, count, [x], [y], device=device, adjoint=True)
        assert x.grad.numpy().tolist() == wanted
