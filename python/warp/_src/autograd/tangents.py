"""Forward mode: launches that compute derivatives along a direction with the values.

Every allocation that depends on the inputs has a twin of the same layout, which holds the tangents
of its elements; a view of the array is the same view of the twin. `Tangents` is an executor (see
`watching`): as long as it is in place, each launch is replaced by one that reads and writes the
twins too, a copy also copies tangents, and filling clears them. An adjoint is a launch like any
other, so tangents of gradients, second derivatives, need nothing more: the twin of an array has a
gradient, which is the twin of the array's gradient.
"""

from __future__ import annotations

from warp import _native
from warp._src import kernel_derivatives, scalars, types
from warp._src.array import array
from warp._src.array_create import empty
from warp._src.array_gradients import gradient_type, has_gradient
from warp._src.boxes import Box
from warp._src.tracking import event
from warp._src.watching import Call


class Tangents:
    """Twins of allocations, and the operations on both.

    Args:
        tape: records what is done with both, for derivatives of tangents; twins then have gradients
            of their own.
    """

    def __init__(self, tape=None):
        self.tape = tape
        # By address: the allocation's array, the bytes of its twin, those of the twin's gradient.
        self._twins: dict[int, tuple[array, array, array | None]] = {}

    # Twins.

    def find(self, one: array) -> array | None:
        """The tangents of an array, None if they are all zero."""
        base = _base(one)
        if (base.ptr or 0) not in self._twins:
            return None
        return self._view(one, base)

    def twin(self, one: array) -> array:
        """The tangents of an array, which become zeros if it had none."""
        base = _base(one)
        if (base.ptr or 0) not in self._twins:
            box = Box(base)
            size = (box.stop - box.start) * _widening(base.dtype)
            made = [_zeros(size, base.device)]
            made.append(None if self.tape is None else _zeros(size, base.device))
            self._twins[base.ptr or 0] = (base, *made)
        return self._view(one, base)

    def _view(self, one: array, base: array) -> array:
        _, tangents, gradients = self._twins[base.ptr or 0]
        wide, dtype = _widening(one.dtype), gradient_type(one.dtype)
        offset = ((one.ptr or 0) - (base.ptr or 0)) * wide
        strides = [stride * wide for stride in one.strides]
        result = tangents._view(offset, one.shape, strides, dtype)
        if gradients is not None:
            result.grad = gradients._view(offset, one.shape, strides, dtype)
        elif one.grad is not None:
            result.grad = self.twin(one.grad)
        return result

    # Operations.

    def launch(self, call: Call) -> None:
        """Runs a launch with tangents."""
        active = self._active(call.leaves, call.accesses)
        if any(active):
            made = call.kernel.tangent(call.native, active)
            kernel_derivatives.check_threads(made, call)
            hidden = self._hidden(made, [one for _, one in call.leaves])
            call = call.other(made.native, (*call.values, *hidden))
        if self.tape is None:
            call.run()
            return
        record = self.tape.begin_launch(call)
        record.run()
        self.tape.end_launch(record)

    def _active(self, leaves, accesses) -> tuple[bool, ...]:
        """Arrays that have tangents, or get some from those that have."""
        known = [
            one is not None and has_gradient(one.dtype) and self.find(one) is not None
            for _, one in leaves
        ]
        if not any(known):
            return tuple(known)
        return tuple(
            found or (one is not None and has_gradient(one.dtype) and (access[1] or access[2]))
            for found, (_, one), access in zip(known, leaves, accesses, strict=True)
        )

    def _hidden(self, made, leaves) -> list:
        return [
            self.twin(leaves[hidden.leaf]) if hidden.kind == "tangent" else None
            for hidden in made.hidden
        ]

    def launch_adjoint(self, made, call: Call, values, initial, saved) -> None:
        """Runs the adjoint of a launch with tangents."""
        grads = [one.grad for _, one in call.leaves if one is not None and one.grad is not None]
        unique = not _native.shares_elements(grads)
        if not unique:
            made = call.kernel.adjoint(call.native, call.active, unique=False)
        hidden = kernel_derivatives.hidden_values(made, call, initial, saved)
        again = call.other(made.native, (*values, *hidden))
        arrays = [one for _, one in again.leaves]
        active = tuple(
            one is not None
            and has_gradient(one.dtype)
            and (self.find(one) is not None or one.grad is not None)
            for one in arrays
        )
        second = _tangent_of(made, active, unique)
        call.other(second.native, (*again.values, *self._hidden(second, arrays))).run()

    def copy(self, dest: array, src: array, stream=None) -> None:
        """Copies values and tangents."""
        self._copy(dest, src, stream)
        if not has_gradient(dest.dtype):
            return
        tangents = self.find(src)
        if tangents is not None:
            self._copy(self.twin(dest), tangents, stream)
        elif self.find(dest) is not None:
            self._clear(dest)

    def fill(self, target: array, pattern: bytes) -> None:
        """Fills with a constant, whose tangent is zero."""
        self._fill(target, pattern)
        if self.find(target) is not None:
            self._clear(target)

    def _clear(self, one: array) -> None:
        tangents = self.twin(one)
        self._fill(tangents, bytes(tangents.item_size))

    def _copy(self, dest, src, stream) -> None:
        _native.copy_array(dest, src, stream)
        if self.tape is not None:
            self.tape.add_copy(dest, src, event("copy"))

    def _fill(self, target, pattern) -> None:
        _native.fill_array(target, pattern)
        if self.tape is not None:
            self.tape.add_fill(target, event("fill"))


def _zeros(size, device) -> array:
    made = empty(max(size, 1), scalars.uint8, device)
    _native.fill_array(made, bytes(1))
    return made


def _tangent_of(made, active, unique):
    """The tangent of a derivative, kept with it."""
    known = made.__dict__.setdefault("tangents", {})
    if (active, unique) not in known:
        second = kernel_derivatives.differentiate(made.kernel, made.native, active, True, unique)
        known[active, unique] = kernel_derivatives.Derivative(
            made.kernel, second, "adjoint_tangent"
        )
    return known[active, unique]


def _base(one: array) -> array:
    """The array that a view was made of."""
    owner = one.owner
    while isinstance(owner, array):
        one, owner = owner, owner.owner
    return one


def _widening(dtype) -> int:
    """How many times more bytes the tangent of an element has."""
    return types.type_size_in_bytes(gradient_type(dtype)) // types.type_size_in_bytes(dtype)
