"""Gradients that an array and a tensor of another library have in common."""

from __future__ import annotations

from warp._src.arrays.array import array


def share_gradient(result, grad, wanted, alias, own) -> None:
    """Gives an array over a tensor a gradient that both have.

    Args:
        grad: the array or tensor that was passed for it, or None.
        wanted: whether the array is to have one where none was passed.
        alias: makes an array over a tensor.
        own: gives the tensor's gradient, made if there is none.

    Raises:
        ValueError: what was passed does not fit.
    """
    if grad is None:
        if not wanted:
            return
        grad = own()
    if not isinstance(grad, array):
        grad = alias(grad)
    result.grad = grad
