"""`wp.launch(..., adjoint=True)`: one launch's derivative, without a tape.

Gradients that the launch names take the place of those that its arrays have.
"""

from __future__ import annotations

import functools
import sys

from warp import _native, config
from warp._src import errors
from warp._src.arrays.array import array
from warp._src.arrays.copies import clone, copy
from warp._src.arrays.gradients import make_gradient
from warp._src.arrays.indexed import indexedarray
from warp._src.arrays.observers import Observers, Observing
from warp._src.derivatives import handles
from warp._src.derivatives.gathers import extents_of
from warp._src.devices.devices import by_index
from warp._src.interop.dlpack import from_dlpack
from warp._src.interop.torch import from_torch
from warp._src.kernels.call import Call, leaves_of, signature_of
from warp._src.kernels.epoch import Epoch
from warp._src.kernels.parameters import LaunchParameters
from warp._src.types import dtypes
from warp._src.types.structs import StructInstance

_INTERFACES = ("__array_interface__", "__cuda_array_interface__")


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
        self._dim = dim if type(dim) in (int, tuple, list) else extents_of(dim)

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
        if stream is None and self._launch_ordinary():
            return
        signature = signature_of(self.kernel, self._native, self._values)
        expected = len(signature.parameters)
        if len(self._values) != expected:
            raise errors.WarpLaunchTypeError(
                f"launch('{self.kernel.key}'): expects {expected} arguments, "
                f"but got {len(self._values)}"
            )
        gradients = [self._writable(signature, i, given) for i, given in enumerate(self._gradients)]
        parameters = self._native.parameters
        late: list = []
        values = with_gradients(self._values, gradients, self.kernel.key, parameters, late)
        call = Call(self.kernel, self._native, self._dim, values, index, stream or own, block_dim)
        with Observing(tape=None):
            for given, stand_in in late:
                copy(stand_in, given, stream=call.stream)
            if not signature.flat:
                call = self._keeping(call)
            self.kernel.derivatives.launch(call)
            for given, stand_in in late:
                copy(given, stand_in, stream=call.stream)

    def _launch_ordinary(self) -> bool:
        """Runs the derivative with few calls; False if it takes more."""
        kernel, values, gradients = self.kernel, self._values, self._gradients
        index, stream, block_dim = self._place
        if (
            kernel.native is self._native
            and kernel.epoch is Epoch.current
            and not (stream is not None or Observers.active)
            and launch_again(kernel, self._dim, values, (), gradients, (), index, block_dim)
        ):
            return True
        return launch_plain(kernel, self._native, self._dim, values, gradients, self._place)

    def _writable(self, signature, position, given):
        """A gradient itself, or a copy of one that the derivative reads and does not add to.

        A derivative sets the gradient of what the launch overwrites to zero. One that the caller
        owns keeps its contents, as other libraries may read it again, and so does that of an array
        with `retain_grad`.

        Raises:
            ValueError: it is read-only, and the derivative adds to it.
        """
        value = self._values[position] if position < len(self._values) else None
        retains = isinstance(value, array) and value.retain_grad
        if given is None and retains:
            given = value.grad
        if not _is_array(given):
            return given
        found = _as_array(given)
        access = self._access(signature, position)
        is_added_to = access is None or access[0]
        if found.read_only:
            if not is_added_to:
                return clone(found, requires_grad=False)
            name = signature.parameters[position][0]
            raise errors.WarpLaunchValueError(
                f"launch('{self.kernel.key}', adjoint=True): the gradient of argument '{name}' is "
                "a read-only array, but the derivative adds to it, use a copy"
            )
        own = getattr(value, "_grad", None)
        is_own = isinstance(own, array) and own.ptr == found.ptr and not retains
        if is_added_to or is_own or not access[1]:
            return given
        return clone(found, requires_grad=False)

    def _keeping(self, call) -> Call:
        """The launch with copies of gradients that keep their contents, of a kernel with structs.

        They are those of `_writable`: in structs and beside them.
        """
        before = leaves_of(call.signature.parameters, self._values)
        copies = {}
        for i, ((_, own), (_, one)) in enumerate(zip(before, call.leaves, strict=True)):
            is_read, is_stored = call.accesses[i][:2]
            if is_read or not is_stored or own is None or one.grad is None:
                continue
            if own.retain_grad or own.grad is None or own.grad.ptr != one.grad.ptr:
                kept = clone(one.grad, requires_grad=False)
                copies[i] = _with_gradient(one, kept)
        return call.other(call.native, call.with_leaves(copies)) if copies else call

    @staticmethod
    def _access(signature, position):
        """Facts about the access of an array; None if they are not known."""
        if not signature.flat:
            return None
        numbers = [i for i, (place, _) in enumerate(signature.arrays) if place == position]
        return signature.accesses[numbers[0]] if numbers else None


def launch_again(kernel, dim, inputs, outputs, adj_inputs, adj_outputs, index, block_dim) -> bool:
    """Runs the derivative of a launch like one that `launch_plain` has run; False if it is none.

    Nobody observes, and the kernel is translated.
    """
    derivatives = kernel.derivatives
    known = derivatives.ready.get(config.singular)
    if known is None or derivatives.epoch is not kernel.epoch or kernel.hooks or handles.alive:
        return False
    return kernel.native.launch_adjoint(
        known, array, dim, inputs, outputs, adj_inputs, adj_outputs, index, block_dim
    )


def launch_plain(kernel, native, dim, values, gradients, place) -> bool:
    """Runs the derivative of an ordinary launch with few calls; False if it takes more.

    Ordinary are arrays of this package with the gradients that the launch names, of which no two
    share memory, and a derivative that takes no arguments of its own.
    """
    index, stream, block_dim = place
    signature = kernel.signatures.get(native)
    if signature is None or not signature.flat or stream is not None or handles.alive:
        return False
    if not len(gradients) <= len(values) == len(signature.parameters):
        return False
    # Tapes watch what arrays hold, of which an adjoint writes none.
    if not dim or Observers.executor is not None or Observers.timer is not None:
        return False
    arrays, memory, count = [], [], len(gradients)
    for i, _ in signature.arrays:
        one = values[i]
        if type(one) is not array:
            return False
        gradient, named = one._grad, gradients[i] if i < count else None
        if one._retain_grad:
            return False
        if named is not None and named is not gradient:
            return False
        if gradient is not None:
            if gradient.read_only:
                return False
            memory.append(gradient)
        elif one._requires_grad:
            return False
        arrays.append(one)
    made = kernel.derivatives.plain(native, arrays)
    if made is None or _native.shares_elements(arrays + memory):
        return False
    if made.gathered is None:
        made.native.launch(dim, values, (), index, None, block_dim)
    else:
        made.launch(Call(kernel, native, dim, values, index, None, block_dim), values)
    return True


def with_gradients(values, adjoints, key, parameters, late) -> tuple:
    """Arguments whose arrays have the gradients that a launch names.

    Args:
        values: the arguments.
        adjoints: for each, the array of gradients, a struct of such arrays, or None; may be short.
        key: the kernel's name, for messages.
        parameters: what the native kernel says of them, for the types of arrays of others.
        late: gets pairs of gradients with other strides than their arrays and what stands in for
            them, to be copied back after the launch.

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
        elif _is_array(values[i]):
            _, kind, *_, element = parameters[i]
            dtype = dtypes.dtype_of(element) if kind == "array" else None
            result[i] = _with_gradient(values[i], given, dtype, late)
    return tuple(result)


def _is_array(value) -> bool:
    """True if it is an array of ours or of another library."""
    return isinstance(value, array) or any(
        hasattr(value, name) for name in (*_INTERFACES, "__dlpack__")
    )


def _as_array(value, dtype=None):
    """An array over the memory of what another library calls one."""
    if isinstance(value, array):
        return value
    torch = sys.modules.get("torch")
    if torch is not None and isinstance(value, torch.Tensor):
        return from_torch(value, dtype, requires_grad=False)
    if any(hasattr(value, name) for name in _INTERFACES):
        return array(value, dtype=dtype, copy=False, device=_place_of(value))
    return from_dlpack(value, dtype)


def _place_of(value):
    return None if hasattr(value, "__cuda_array_interface__") else "cpu"


def _with_gradient(value, given, dtype=None, late=None):
    value, given = _as_array(value, dtype), _as_array(given, dtype)
    if value.grad is given:
        return value
    result = value._view(0, value.shape, value.strides)
    result.bare = value.bare
    if late is not None and _differs_in_layout(value, given):
        stand_in = make_gradient(value)
        late.append((given, stand_in))
        given = stand_in
    result.grad = given
    return result


def _differs_in_layout(value, given) -> bool:
    """True if only its strides keep an array from being the gradient of another one.

    Lent arrays are copied anyway.
    """
    if given.lent:
        return False
    alike = (given.shape, given.device_index) == (value.shape, value.device_index)
    return alike and given.dtype is value.dtype and given.strides != value.strides


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
