"""Derivatives of launches, for the tape: which arrays they need, and running them.

A derivative is what `Kernel.adjoint` makes for a native kernel and the set of its arrays that have
gradients. Arrays are numbered as in `Call.leaves`.
"""

from __future__ import annotations

from warp._src import scalars, types
from warp._src.array import array
from warp._src.tracking import copy_layout


def derivative(call):
    """The derivative of a launch with respect to the arrays that have gradients.

    Raises:
        WarpCodegenError: the kernel cannot be differentiated.
    """
    return call.kernel.adjoint(call.native, call.active)


def needed(made) -> set[int]:
    """Arrays whose contents the adjoint reads."""
    return set(made.needed)


def preserved(made) -> set[int]:
    """Arrays of which it reads the contents before the launch."""
    return {hidden.leaf for hidden in made.hidden if hidden.kind == "preserved"}


def augmented(made):
    """The native kernel that takes notes for the adjoint, or None."""
    return made.augmented


def copy_of(source: array, stream=None) -> array:
    """The contents of an array, with the same strides."""
    return copy_layout(source, stream)


def with_gradient_of(contents: array, original: array) -> array:
    """An array with the contents of one and the gradient of another."""
    result = contents._view(0, contents.shape, contents.strides)
    if original.grad is not None:
        result.grad = original.grad
    return result


def launch_augmented(made, call) -> list[array]:
    """Runs the launch with notes; returns them."""
    raise NotImplementedError


def launch_adjoint(made, call, values, initial, saved) -> None:
    """Runs the adjoint of a launch."""
    raise NotImplementedError


def add_into(target: array, source: array) -> None:
    """Adds the elements of one array to those of another of equal size, on any devices."""
    if source.device_index != target.device_index:
        source = source.to(target.device)
    if source.shape != target.shape:
        target, source = target.flatten(), source.flatten()
    if types.is_struct(target.dtype):
        _add_structs(target, source)
        return
    if source.dtype is not target.dtype:
        scalar = getattr(target.dtype, "_wp_scalar_type_", target.dtype)
        target, source = target.view(scalar), source.view(scalar)
        if target.shape != source.shape:
            target, source = target.flatten(), source.flatten()
    target += source


def _add_structs(target, source) -> None:
    from warp._src.maps import map

    raise TypeError(f"copies of struct '{target.dtype.__name__}' have no gradient yet")
