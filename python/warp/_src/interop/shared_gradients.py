"""Gradients that an array and a tensor of another library have in common."""

from __future__ import annotations

from warp._src.arrays.array import array
from warp._src.arrays.gradients import gradient_type
from warp._src.types import dtypes


def share_gradient(function, result, grad, wanted, alias, own) -> None:
    """Gives an array over a tensor a gradient that both have.

    Args:
        function: name of the caller, for errors.
        grad: the array or tensor that was passed for it, or None.
        wanted: whether the array is to have one where none was passed.
        alias: makes an array over a tensor.
        own: gives the tensor's gradient, made if there is none.

    Raises:
        ValueError: the array would take a copy of what was passed, which never changed then.
    """
    wide = gradient_type(result.dtype)
    if grad is None:
        if not wanted:
            return
        if wide is not result.dtype:
            result.requires_grad = True
            return
        grad = own()
    if not isinstance(grad, array):
        grad = alias(grad)
    if wide is not result.dtype and grad.dtype is not wide:
        raise ValueError(
            f"{function}(): expects a gradient of '{dtypes.type_repr(wide)}' for an array of "
            f"'{dtypes.type_repr(result.dtype)}', but got '{dtypes.type_repr(grad.dtype)}'"
        )
    result.grad = grad
