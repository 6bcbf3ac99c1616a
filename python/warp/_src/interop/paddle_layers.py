"""The context inside `forward` and `backward` of a `paddle.autograd.PyLayer`.

The same as in PyTorch's functions (`torch_functions`): Paddle adds what `backward` returns to the
gradients of tensors by itself, and keeps what `backward` gets.
"""

from __future__ import annotations

import sys


def has_own_gradient(paddle, t) -> bool:
    """True if the gradient of an array made of a tensor here and now is not that of the tensor.

    The one exception in a layer is a leaf that `forward` uses without being given it.
    """
    frame = _innermost(paddle)
    if frame is None:
        return False
    is_captured = t.is_leaf and not t.stop_gradient and frame.f_code.co_name == "forward"
    return not is_captured or any(one is t for one in _arguments(frame))


def is_lent(paddle, t) -> bool:
    """True if a tensor has the memory of what Paddle has passed to `backward`."""
    frame = _innermost(paddle)
    if frame is None or frame.f_code.co_name != "backward":
        return False
    given = [one for one in _arguments(frame) if isinstance(one, paddle.Tensor)]
    return any(one.data_ptr() == t.data_ptr() for one in given)


def _innermost(paddle):
    """The frame of the method that Paddle has called of the layer that runs, or None."""
    if paddle.is_grad_enabled():
        return None
    frame, found, context = sys._getframe(1), None, None
    while frame is not None:
        first = _context(paddle, frame)
        if first is not None and (context is None or first is context):
            # A method may have called that of another class.
            found, context = frame, first
        frame = frame.f_back
    return found


def _context(paddle, frame):
    """The context, if the frame is of a method of a layer."""
    code = frame.f_code
    if code.co_name not in ("forward", "backward") or not code.co_argcount:
        return None
    first = frame.f_locals.get(code.co_varnames[0])
    return first if isinstance(first, paddle.autograd.PyLayerContext) else None


def _arguments(frame) -> list:
    import inspect

    code, values = frame.f_code, frame.f_locals
    found = [values.get(name) for name in code.co_varnames[1 : code.co_argcount]]
    if code.co_flags & inspect.CO_VARARGS:
        found += values.get(code.co_varnames[code.co_argcount + code.co_kwonlyargcount], ())
    return found
