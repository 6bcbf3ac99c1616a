"""The context inside `forward` and `backward` of a `torch.autograd.Function`.

PyTorch adds what `backward` returns to the gradients of leaves by itself. An array made there of an
input therefore has a gradient of its own: with that of the tensor the sum would contain it twice.
The gradients that `backward` gets belong to PyTorch, which may pass them to others too, so they are
copied before a launch of a derivative changes it.
"""

from __future__ import annotations

import sys
import warnings

from warp._src.arrays.passing import PassingGradient


def innermost(torch):
    """The frame of PyTorch that has called `forward` or `backward` of a function, or None.

    It holds what PyTorch has passed: `args`, and in a backward pass the node as `self`.
    """
    if torch.is_grad_enabled() and torch._C._current_graph_task_id() == -1:
        return None
    codes = _codes(torch)
    frame = sys._getframe(1)
    while frame is not None and frame.f_code not in codes:
        frame = frame.f_back
    return frame


def _codes(torch) -> set:
    function = torch.autograd.Function
    node = torch.autograd.function.BackwardCFunction
    found = {function.apply.__func__.__code__, node.apply.__code__}
    # For newer versions, whose functions free the gradients they get.
    boxed = getattr(node, "apply_boxed", None)
    return found | ({boxed.__code__} if boxed else set())


def has_own_gradient(torch, t) -> bool:
    """True if the gradient of an array made of a tensor here and now is not that of the tensor.

    The one exception in a function is a leaf that it uses without being given it: nobody but the
    launches adds to its gradient.
    """
    frame = innermost(torch)
    if frame is None:
        return False
    if not t.is_leaf or not t.requires_grad:
        return True
    node = _node(frame)
    given = _tensors(torch, frame.f_locals["args"]) if node is None else _leaves(node)
    return any(one is t for one in given)


def is_lent(torch, t) -> bool:
    """True if a tensor is, or shares memory with, what PyTorch has passed to `backward`."""
    if torch._C._current_graph_task_id() == -1:
        return False
    frame = innermost(torch)
    if frame is None or _node(frame) is None:
        return False
    storage = t.untyped_storage().data_ptr()
    given = _tensors(torch, frame.f_locals["args"])
    return any(one.untyped_storage().data_ptr() == storage for one in given)


def warn_of_sum(torch, address) -> None:
    """Warns where `backward` of a function takes the gradient of a leaf, which it would return."""
    frame = innermost(torch) if torch._C._current_graph_task_id() != -1 else None
    node = None if frame is None else _node(frame)
    if node is None:
        return
    for leaf in _leaves(node):
        if leaf.grad is not None and leaf.grad.data_ptr() == address:
            warnings.warn(
                f"to_torch: in a backward pass of '{type(node).__name__}' this memory is the "
                f"`grad` of an input, to which PyTorch adds what is returned, so that it would "
                f"count twice: call `from_torch` in `forward`, or with `t.detach()`",
                stacklevel=3,
            )


def give_own_gradient(a, retain_grad) -> None:
    """Gives an array a gradient that is zero at the begin of each of PyTorch's backward passes."""
    PassingGradient(a, _at_end_of_pass)
    a.retain_grad = retain_grad


def _at_end_of_pass(function) -> bool:
    """Has a function called once the backward pass that runs is over; False if there is none."""
    import torch

    if torch._C._current_graph_task_id() == -1:
        return False
    torch.autograd.Variable._execution_engine.queue_callback(function)
    return True


def _node(frame):
    """The node of the graph whose `backward` PyTorch has called, None in `forward`."""
    return frame.f_locals.get("self")


def _leaves(node) -> list:
    """The leaves that a node passes gradients to."""
    found = [getattr(following, "variable", None) for following, _ in node.next_functions]
    return [one for one in found if one is not None]


def _tensors(torch, values) -> list:
    found = []
    for one in values:
        if isinstance(one, torch.Tensor):
            found.append(one)
        elif isinstance(one, list):
            found += _tensors(torch, one)
    return found
