"""`paddle.autograd.PyLayer` around launches has the gradients of the same expression in Paddle."""

import numpy as np
import pytest

import warp as wp

paddle = pytest.importorskip("paddle")


@pytest.fixture(autouse=True)
def on_cpu():
    before = paddle.device.get_device()
    paddle.set_device("cpu")
    yield
    paddle.set_device(before)


@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


class Usual(paddle.autograd.PyLayer):
    @staticmethod
    def forward(ctx, x):
        ctx.x = wp.from_paddle(x, requires_grad=True)
        ctx.y = wp.zeros(x.shape[0], dtype=float, device="cpu", requires_grad=True)
        wp.launch(square, x.shape[0], [ctx.x], [ctx.y], device="cpu")
        return wp.to_paddle(ctx.y)

    @staticmethod
    def backward(ctx, g):
        ctx.y.grad = wp.from_paddle(g)
        wp.launch(square, g.shape[0], [ctx.x], [ctx.y], adjoint=True, device="cpu")
        return wp.to_paddle(ctx.x.grad)


class Saved(paddle.autograd.PyLayer):
    """Arrays are made in the backward pass; the gradient is named."""

    @staticmethod
    def forward(ctx, *tensors):
        (x,) = tensors
        ctx.save_for_backward(x)
        y = wp.zeros(x.shape[0], dtype=float, device="cpu")
        wp.launch(square, x.shape[0], [wp.from_paddle(x, requires_grad=False), y], device="cpu")
        return wp.to_paddle(y)

    @staticmethod
    def backward(ctx, g):
        (saved,) = ctx.saved_tensor()
        x, y = wp.from_paddle(saved, requires_grad=True), wp.zeros(g.shape[0], device="cpu")
        named = {"adj_inputs": [x.grad], "adj_outputs": [wp.from_paddle(g)]}
        wp.launch(square, g.shape[0], [x], [y], adjoint=True, device="cpu", **named)
        return wp.to_paddle(x.grad)


def once(f, x, u):
    f(x).sum().backward()


def inner_result(f, x, u):
    f(x * u).sum().backward()


def several_uses(f, x, u):
    (f(x) + 3.0 * f(x) + x).sum().backward()


def added_up(f, x, u):
    for _ in range(3):
        (f(x) * u).sum().backward()


def neighbour_shares_gradient(f, x, u):
    other = u * 3.0
    ((f(x) + other) ** 2).sum().backward()


@pytest.mark.parametrize(
    "graph", [once, inner_result, several_uses, added_up, neighbour_shares_gradient]
)
@pytest.mark.parametrize("layer", [Usual, Saved])
def test_gradients_are_those_of_paddle(layer, graph):
    found = []
    for function in (layer.apply, lambda x: x * x):
        x = paddle.to_tensor([1.0, -2.0, 3.0], stop_gradient=False)
        u = paddle.to_tensor([0.5, 1.5, -1.0], stop_gradient=False)
        graph(function, x, u)
        found.append([one.grad.numpy() for one in (x, u) if one.grad is not None])
    assert len(found[0]) == len(found[1])
    for ours, theirs in zip(*found, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-5)


def test_leaf_that_is_no_input():
    weight = paddle.to_tensor([2.0, 3.0], stop_gradient=False)

    class Weighted(paddle.autograd.PyLayer):
        @staticmethod
        def forward(ctx, x):
            return Usual.forward(ctx, weight) + 0.0 * x

        @staticmethod
        def backward(ctx, g):
            return Usual.backward(ctx, g) * 0.0

    Weighted.apply(paddle.to_tensor([1.0, 1.0], stop_gradient=False)).sum().backward()
    assert weight.grad.tolist() == [4.0, 6.0]


def test_outside_of_layers_the_gradient_is_the_tensors():
    x = paddle.to_tensor([1.0, 2.0], stop_gradient=False)
    with paddle.no_grad():
        a, y = wp.from_paddle(x), wp.zeros(2, dtype=float, device="cpu", requires_grad=True)
        with wp.Tape() as tape:
            wp.launch(square, 2, [a, y], device="cpu")
        tape.backward(grads={y: wp.ones(2, dtype=float, device="cpu")})
    assert x.grad.tolist() == [2.0, 4.0]


def test_tensors_as_arguments():
    """A kernel writes to a tensor that it gets, whole or in part."""
    x = paddle.arange(6, dtype="float32")
    y = paddle.zeros([6], dtype="float32")
    wp.launch(square, 6, [x, y], device="cpu")
    assert y.tolist() == [0.0, 1.0, 4.0, 9.0, 16.0, 25.0]
