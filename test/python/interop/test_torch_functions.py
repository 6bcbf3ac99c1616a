"""`torch.autograd.Function` around launches, in the forms in which programs write it.

Each is compared with the same expression in PyTorch, through graphs that use it in several ways.
"""

import numpy as np
import pytest

import warp as wp

torch = pytest.importorskip("torch")


@pytest.fixture(autouse=True)
def has_device(request):
    if request.getfixturevalue("device") != "cpu" and not torch.cuda.is_available():
        pytest.skip("PyTorch without CUDA")


@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


def forward(ctx, x, make=lambda x: wp.from_torch(x, requires_grad=True)):
    ctx.x = make(x)
    ctx.y = wp.zeros(len(x), dtype=float, device=ctx.x.device, requires_grad=True)
    wp.launch(square, len(x), [ctx.x], [ctx.y], device=ctx.x.device)
    return wp.to_torch(ctx.y)


def backward(ctx, g, **options):
    ctx.y.grad = wp.from_torch(g)
    wp.launch(square, len(g), [ctx.x], [ctx.y], adjoint=True, device=ctx.x.device, **options)
    return wp.to_torch(ctx.x.grad)


class Usual(torch.autograd.Function):
    forward = staticmethod(forward)

    @staticmethod
    def backward(ctx, g):
        return backward(ctx, g, adj_inputs=[ctx.x.grad])


class OwnGradients(Usual):
    """The launch takes the gradients that the arrays have."""

    backward = staticmethod(backward)


class NamedSeed(Usual):
    """The incoming gradient is named, and not set."""

    @staticmethod
    def backward(ctx, g):
        seed = wp.from_torch(g)
        named = {"adj_inputs": [ctx.x.grad], "adj_outputs": [seed]}
        wp.launch(square, len(g), [ctx.x], [ctx.y], adjoint=True, device=ctx.x.device, **named)
        return wp.to_torch(ctx.x.grad, requires_grad=False)


class Detached(Usual):
    @staticmethod
    def forward(ctx, x):
        return forward(ctx, x, lambda x: wp.from_torch(x.detach(), requires_grad=True))


class Saved(Usual):
    """Arrays are made in the backward pass."""

    @staticmethod
    def forward(ctx, x):
        ctx.save_for_backward(x)
        return forward(ctx, x, lambda x: wp.from_torch(x, requires_grad=False))

    @staticmethod
    def backward(ctx, g):
        (x,) = ctx.saved_tensors
        ctx.x = wp.from_torch(x, requires_grad=True)
        return Usual.backward(ctx, g)


class SetUpAfterwards(Usual):
    @staticmethod
    def forward(x):
        return x * x

    @staticmethod
    def setup_context(ctx, inputs, output):
        forward(ctx, *inputs)


class Taped(Usual):
    @staticmethod
    def forward(ctx, x):
        with wp.Tape() as ctx.tape:
            return forward(ctx, x)

    @staticmethod
    def backward(ctx, g):
        ctx.tape.backward(grads={ctx.y: wp.from_torch(g)})
        return wp.to_torch(ctx.x.grad)


class TapedInForward(Usual):
    """The gradient is computed ahead."""

    @staticmethod
    def forward(ctx, x):
        with wp.Tape() as tape:
            y = forward(ctx, x)
        tape.backward(grads={ctx.y: wp.ones_like(ctx.y, requires_grad=False)})
        ctx.factor = wp.to_torch(ctx.x.grad, requires_grad=False).clone()
        return y

    @staticmethod
    def backward(ctx, g):
        return ctx.factor * g


class OfAView(Usual):
    """The launch sees a view of a view of what was made of the input."""

    @staticmethod
    def forward(ctx, x):
        ctx.whole = wp.from_torch(x, requires_grad=True)
        return forward(ctx, x, lambda x: ctx.whole[0:][:])

    @staticmethod
    def backward(ctx, g):
        Usual.backward(ctx, g)
        return wp.to_torch(ctx.whole.grad)


class Tensors(torch.autograd.Function):
    """Launches get tensors."""

    convert = staticmethod(lambda t: t)

    @classmethod
    def forward(cls, ctx, x):
        y = torch.empty_like(x)
        ctx.save_for_backward(x, y)
        wp.launch(square, len(x), [x.detach()], [y], device=str(x.device))
        return y

    @classmethod
    def backward(cls, ctx, g):
        x, y = (t.detach() for t in ctx.saved_tensors)
        found = torch.zeros_like(x)
        named = {"adj_inputs": [found], "adj_outputs": [cls.convert(g)]}
        wp.launch(square, len(g), [x], [y], adjoint=True, device=str(x.device), **named)
        return found


class Capsules(Tensors):
    """The incoming gradient goes through DLPack."""

    convert = staticmethod(wp.from_dlpack)


FORMS = [
    *(Usual, OwnGradients, NamedSeed, Detached, Saved, SetUpAfterwards, Taped, TapedInForward),
    *(OfAView, Tensors, Capsules),
]


def once(f, x, u):
    f(x).sum().backward()


def inner_result(f, x, u):
    f(x * u).sum().backward()


def several_uses(f, x, u):
    (f(x) + 3.0 * f(x) + x).sum().backward()


def chained(f, x, u):
    f(f(x)).sum().backward()


def added_up(f, x, u):
    for _ in range(3):
        (f(x) * u).sum().backward()


def graph_kept(f, x, u):
    for inner in (x, x * u):
        loss = (f(inner) * u.detach()).sum()
        for _ in range(3):
            loss.backward(retain_graph=True)


def neighbour_shares_gradient(f, x, u):
    """PyTorch passes one tensor to both terms of a sum."""
    other = u * 3.0
    ((f(x) + other) ** 2).sum().backward()


def part_of_leaf(f, x, u):
    f(x[1:4]).sum().backward()
    f(x[::2]).sum().backward()


def retained(f, x, u):
    inner = x * u
    inner.retain_grad()
    y = f(inner)
    y.retain_grad()
    (y * u).sum().backward()
    return inner.grad, y.grad


def gradients_are_the_callers(f, x, u):
    """The result of `torch.autograd.grad` is not changed by the next call."""
    loss = (f(x) * u).sum()
    first = torch.autograd.grad(loss, (x, u), retain_graph=True)
    return *first, *torch.autograd.grad(loss, (x, u))


def seed_is_the_callers(f, x, u):
    seed = torch.ones_like(x)
    f(x).backward(seed)
    return (seed,)


GRAPHS = [
    *(once, inner_result, several_uses, chained, added_up, graph_kept, part_of_leaf, retained),
    *(neighbour_shares_gradient, gradients_are_the_callers, seed_is_the_callers),
]


@pytest.mark.parametrize("graph", GRAPHS, ids=lambda one: one.__name__)
@pytest.mark.parametrize("form", FORMS, ids=lambda one: one.__name__)
def test_gradients_are_those_of_pytorch(device, form, graph):
    """Each input counts once, in every pass, and nothing of PyTorch's is used up."""
    found = []
    for function in (form.apply, lambda x: x * x):
        x = torch.tensor([1.0, -2.0, 3.0, 0.5, 4.0], device=device, requires_grad=True)
        u = torch.tensor([0.5, 1.5, -1.0, 2.0, 1.0], device=device, requires_grad=True)
        others = graph(function, x, u) or ()
        found.append([one for one in (x.grad, u.grad, *others) if one is not None])
    assert len(found[0]) == len(found[1])
    for ours, theirs in zip(*found, strict=True):
        np.testing.assert_allclose(ours.cpu(), theirs.cpu(), rtol=1e-5)


@wp.kernel
def lengths(x: wp.array2d(dtype=wp.vec3), y: wp.array2d(dtype=float)):
    i, j = wp.tid()
    y[i, j] = wp.dot(x[i, j], x[i, j])


def test_tensors_as_arguments_of_an_adjoint_launch(device):
    """Tensors take the element types of the parameters, and their gradients, too."""
    x = torch.arange(12.0, device=device).reshape(2, 2, 3)
    y, seed = (torch.ones(2, 2, device=device) for _ in range(2))
    found = torch.zeros_like(x)
    named = {"adj_inputs": [found], "adj_outputs": [seed]}
    wp.launch(lengths, (2, 2), [x], [y], adjoint=True, device=device, **named)
    assert torch.equal(found, 2.0 * x)


def test_leaf_that_is_no_input(device):
    """A leaf that the function uses without being given it has the gradient of the launches."""
    weight = torch.tensor([2.0, 3.0], device=device, requires_grad=True)

    class Weighted(torch.autograd.Function):
        @staticmethod
        def forward(ctx, x):
            return forward(ctx, x, lambda x: wp.from_torch(weight, requires_grad=True))

        @staticmethod
        def backward(ctx, g):
            backward(ctx, g)
            return torch.zeros_like(g)

    Weighted.apply(torch.ones(2, device=device, requires_grad=True)).sum().backward()
    wp.synchronize()
    assert weight.grad.tolist() == [4.0, 6.0]


@pytest.mark.parametrize("mode", [torch.no_grad, torch.inference_mode, torch.enable_grad])
def test_outside_of_functions_the_gradient_is_the_tensors(device, mode):
    """Whatever PyTorch's mode is, `backward` of a tape fills `grad` of a tensor."""
    x = torch.tensor([1.0, 2.0], device=device, requires_grad=True)
    with mode():
        a = wp.from_torch(x)
        y = wp.zeros(2, dtype=float, device=device, requires_grad=True)
        with wp.Tape() as tape:
            wp.launch(square, 2, [a, y], device=device)
        tape.backward(grads={y: wp.ones(2, dtype=float, device=device)})
    wp.synchronize()
    assert x.grad.tolist() == [2.0, 4.0]


def test_hook_sees_the_gradient_of_its_leaf(device):
    """An optimiser that runs in a hook after the sum works on the tensor's gradient."""
    x = torch.tensor([1.0, 2.0], device=device, requires_grad=True)
    seen = []
    x.register_post_accumulate_grad_hook(lambda x: seen.append(wp.from_torch(x).grad.list()))
    Usual.apply(x).sum().backward()
    assert seen == [[2.0, 4.0]]


def test_array_made_before(device):
    """An array made outside has the tensor's gradient; to return that is worth a warning."""
    x = torch.tensor([1.0, 2.0], device=device, requires_grad=True)
    made = wp.from_torch(x)

    class Outside(Usual):
        @staticmethod
        def forward(ctx, x):
            return forward(ctx, x, lambda x: made)

    with pytest.warns(UserWarning, match=r"'OutsideBackward'.*count twice.*from_torch"):
        Outside.apply(x).sum().backward()
