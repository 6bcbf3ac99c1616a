"""Derivatives of launches, for the tape: which arrays they need, and running them.

A derivative is what `Kernel.adjoint` makes for a native kernel and the set of its arrays that have
gradients. Arrays are numbered as in `Call.leaves`.
"""

from __future__ import annotations

from warp._src import errors, kernel_derivatives, types
from warp._src.annotations import ArrayType
from warp._src.array import array
from warp._src.array_gradients import gradient_type
from warp._src.tracking import Watch, copy_layout


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


def copy_of(source: array, stream=None) -> array:
    """The contents of an array, with the same strides."""
    return copy_layout(source, stream)


def with_gradient_of(contents: array, original: array) -> array:
    """An array with the contents of one and the gradient of another."""
    result = contents._view(0, contents.shape, contents.strides)
    if original.grad is not None:
        result.grad = original.grad
    return result


def as_gradient(seed: array, target: array) -> array:
    """A seed with elements like those of an array's gradient; 16 bits become 32.

    Raises:
        WarpTypeError: it has elements of another type.
    """
    expected = target.grad.dtype
    if types.types_equal(seed.dtype, expected):
        return seed
    if gradient_type(seed.dtype) is not expected:
        raise errors.WarpTypeError(
            f"backward: expects a gradient with elements of '{types.type_repr(expected)}', but got "
            f"'{types.type_repr(seed.dtype)}'"
        )
    return array(seed.list(), dtype=expected, device=seed.device).reshape(seed.shape)


def gradient_struct(value):
    """A copy of a struct whose arrays are the gradients of its arrays."""
    result = value.__copy__()
    for name, dtype in value._wp_fields_.items():
        field = getattr(value, name)
        if isinstance(dtype, ArrayType):
            setattr(result, name, None if field is None else field.grad)
        elif types.is_struct(dtype):
            setattr(result, name, gradient_struct(field))
    return result


def launch_augmented(made, call) -> list[array]:
    """Runs a launch that saves what its adjoint needs, and returns that."""
    return kernel_derivatives.run_augmented(made, call)


def launch_adjoint(made, call, values, initial, saved) -> None:
    """Runs the adjoint of a launch."""
    if Watch.executor is not None:
        Watch.executor.launch_adjoint(made, call, values, initial, saved)
    else:
        kernel_derivatives.run(made, call, values, initial, saved)


def hidden_values(made, call, initial, saved) -> list:
    """The arguments of the adjoint that the launch does not have."""
    return kernel_derivatives.hidden_values(made, call, initial, list(saved))


def add_into(target: array, source: array) -> None:
    """Adds the elements of one array to those of another of equal size, on any devices."""
    if source.device_index != target.device_index:
        source = source.to(target.device)
    if source.shape != target.shape:
        target, source = target.flatten(), source.flatten()
    if types.is_struct(target.dtype):
        from warp._src.struct_sums import add_structs

        add_structs(target, source)
        return
    if source.dtype is not target.dtype:
        scalar = getattr(target.dtype, "_wp_scalar_type_", target.dtype)
        target, source = _as_scalars(target, scalar), _as_scalars(source, scalar)
    target += source


def _as_scalars(one: array, scalar) -> array:
    """The scalars of packed elements in one row."""
    if one.dtype is scalar:
        return one.flatten()
    return one.flatten().view(scalar).flatten()
