"""`wp.launch(..., adjoint=True)`: one launch's derivative, without a tape.

Gradients that the launch names take the place of those that its arrays have.
"""

from __future__ import annotations

import functools

from warp._src import errors
from warp._src.arrays.array import array
from warp._src.arrays.copies import clone
from warp._src.arrays.indexed import indexedarray
from warp._src.arrays.observers import Observing
from warp._src.devices.devices import by_index
from warp._src.kernels.call import Call, signature_of
from warp._src.kernels.parameters import LaunchParameters
from warp._src.types.structs import StructInstance


class AdjointLaunch(LaunchParameters):
    """The derivative of a launch, to be run many times.

    Made by `wp.launch(..., adjoint=True, record_cmd=True)`. Arguments are read at each launch.

    Attributes:
        kernel: the kernel.
        device: where it runs.
    """

    def __init__(self, kernel, native, dim, values, gradients, place):
        self.kernel = kernel
        self.device = by_index(place[0])
        self._native, self._place = native, place
        self._values = list(values)
        self._gradients = [*gradients, *[None] * (len(self._values) - len(gradients))]
        self.set_dim(dim)

    @functools.cached_property
    def _index(self) -> dict[str, int]:
        return {parameter[0]: i for i, parameter in enumerate(self._native.parameters)}

    def set_dim(self, dim) -> None:
        """Changes the extents of the grid."""
        self._dim = dim

    def set_param(self, index, value, adjoint=False) -> None:
        """Changes the value of a parameter, or its gradient, by position."""
        target = self._gradients if adjoint else self._values
        if not 0 <= index < len(target):
            raise errors.WarpLaunchValueError(
                f"launch('{self.kernel.key}', adjoint=True): expects a position below "
                f"{len(target)}, but got {index}"
            )
        target[index] = value

    set_param_bytes = set_param

    def set_params(self, values) -> None:
        """Changes the values of the first parameters."""
        for index, value in enumerate(values):
            self.set_param(index, value)

    def launch(self, stream=None) -> None:
        """Runs the derivative."""
        index, own, block_dim = self._place
        signature = signature_of(self.kernel, self._native, self._values)
        expected = len(signature.parameters)
        if len(self._values) != expected:
            raise errors.WarpLaunchTypeError(
                f"launch('{self.kernel.key}'): expects {expected} arguments, "
                f"but got {len(self._values)}"
            )
        gradients = [self._writable(signature, i, given) for i, given in enumerate(self._gradients)]
        values = with_gradients(self._values, gradients, self.kernel.key)
        call = Call(self.kernel, self._native, self._dim, values, index, stream or own, block_dim)
        with Observing(tape=None):
            self.kernel.derivatives.launch(call)

    def _writable(self, signature, position, given):
        """A gradient itself, or a copy of a read-only one that is only read.

        Raises:
            ValueError: the derivative adds to it.
        """
        if not _is_array_like(given):
            return given
        found = _as_array(given)
        if not found.read_only:
            return given
        number = [i for i, _ in signature.arrays].index(position) if signature.flat else None
        if number is not None and not signature.accesses[number][0]:
            return clone(found, requires_grad=False)
        name = signature.parameters[position][0]
        raise errors.WarpLaunchValueError(
            f"launch('{self.kernel.key}', adjoint=True): the gradient of argument '{name}' is a "
            "read-only array, but the derivative adds to it, use a copy"
        )


def with_gradients(values, adjoints, key) -> tuple:
    """Arguments whose arrays have the gradients that a launch names.

    Args:
        values: the arguments.
        adjoints: for each, the array of gradients, a struct of such arrays, or None; may be short.
        key: the kernel's name, for messages.

    Raises:
        WarpLaunchValueError: there are more of them than arguments.
        TypeError, ValueError: one does not fit its array.
    """
    if len(adjoints) > len(values):
        raise errors.WarpLaunchValueError(
            f"launch('{key}', adjoint=True): expects at most {len(values)} gradients, "
            f"but got {len(adjoints)}"
        )
    result = list(values)
    for i, given in enumerate(adjoints):
        if given is None:
            continue
        if isinstance(values[i], StructInstance) and isinstance(given, StructInstance):
            result[i] = _struct_with_gradients(values[i], given)
        elif isinstance(values[i], indexedarray):
            given = given.data if isinstance(given, indexedarray) else given
            result[i] = values[i].over(_with_gradient(values[i].data, given))
        elif _is_array_like(values[i]):
            result[i] = _with_gradient(values[i], given)
    return tuple(result)


def _is_array_like(value) -> bool:
    return isinstance(value, array) or any(
        hasattr(value, name) for name in ("__array_interface__", "__cuda_array_interface__")
    )


def _as_array(value):
    return value if isinstance(value, array) else array(value, copy=False, device=_place_of(value))


def _place_of(value):
    return None if hasattr(value, "__cuda_array_interface__") else "cpu"


def _with_gradient(value, given):
    value = _as_array(value)
    if value.grad is given:
        return value
    result = value._view(0, value.shape, value.strides)
    result.grad = _as_array(given)
    return result


def _struct_with_gradients(value, given):
    result = value.__copy__()
    for name in value._wp_fields_:
        own, other = getattr(value, name), getattr(given, name, None)
        if other is None:
            continue
        if isinstance(own, array):
            setattr(result, name, _with_gradient(own, other))
        elif isinstance(own, StructInstance):
            setattr(result, name, _struct_with_gradients(own, other))
    return result
