"""Forward mode: launches that compute derivatives along a direction with the values.

Every allocation that depends on the inputs has a twin of the same layout, which holds the tangents
of its elements; a view of the array is the same view of the twin. `Tangents` is an executor (see
`observers`): as long as it is in place, each launch is replaced by one that reads and writes the
twins too, a copy also copies tangents, and filling clears them. An adjoint is a launch like any
other, so tangents of gradients, second derivatives, need nothing more: the twin of an array has a
gradient, which is the twin of the array's gradient.

With tangents along several directions an allocation has a twin for each, and a launch computes all
of them at once. Functions with more directions than that are run again (`chunks`), with what they
overwrote in between put back.
"""

from __future__ import annotations

from warp import _native
from warp._src import errors
from warp._src.arrays.array import array
from warp._src.arrays.create import empty, zeros
from warp._src.arrays.gradients import gradient_type, has_gradient
from warp._src.arrays.layout import bytes_spanned
from warp._src.arrays.observers import Observing, copy_layout
from warp._src.arrays.versions import event
from warp._src.derivatives import handles
from warp._src.derivatives.derivative import thread_count
from warp._src.derivatives.launch_gradients import gradients_of
from warp._src.derivatives.same_arrays import check_overlap, meetings, same_arrays
from warp._src.derivatives.singular import REPEATED, count_singular
from warp._src.kernels.call import Call
from warp._src.types import dtypes, scalars

# Numbers of directions that kernels are made for.
WIDTHS = (1, 4, 8)


def chunks(count: int) -> list[tuple[range, int]]:
    """Ranges of directions to do at once, and the numbers of directions that kernels for them have.

    These may have some more than there are in the range, which costs less than another evaluation.
    """
    last = WIDTHS[-1]
    parts = [range(first, min(first + last, count)) for first in range(0, count, last)]
    return [(part, next(width for width in WIDTHS if width >= len(part))) for part in parts]


class Tangents:
    """Twins of allocations, and the operations on both.

    Args:
        tape: records what is done with both, for derivatives of tangents; twins then have gradients
            of their own.
        width: number of directions.
        previous: of the same evaluation with other directions, whose writes are undone.
        is_last: whether no such evaluation follows.
    """

    def __init__(self, tape=None, width=1, previous=None, is_last=True):
        self.tape, self.width, self.is_last = tape, width, is_last
        # By address: the allocation's array, bytes from one direction's twin to the next one's, the
        # bytes of all of them and those of their gradients.
        self._twins: dict[int, tuple[array, int, array, array | None]] = {}
        # By the identity of arrays: the array, its gradient, its tangents along each direction.
        self._views: dict[int, tuple[array, array | None, list[array]]] = {}
        # By address: the allocation's array and what it held before the first write; and the same
        # of the previous evaluation.
        self._kept: dict[int, tuple[array, array]] = {}
        self._changed: dict[int, tuple[array, array]] = {}
        if previous is not None:
            self._changed = previous._kept
            # A tape may need contents of arrays that only the previous evaluation knows.
            for address in () if tape is not None else list(self._changed):
                self._restore(address)

    # Twins.

    def has(self, one: array) -> bool:
        """True if an array has tangents; if not, they are all zero."""
        return (_base(one).ptr or 0) in self._twins

    def find(self, one: array, direction=0) -> array | None:
        """The tangents of an array, None if they are all zero."""
        return self.twin(one, direction) if self.has(one) else None

    def twin(self, one: array, direction=0) -> array:
        """The tangents of an array, which become zeros if it had none."""
        known = self._views.get(id(one))
        if known is None or known[1] is not one.grad_in_use:
            base = self._allocate(one)
            views = [self._view(one, base, i) for i in range(self.width)]
            known = self._views[id(one)] = (one, one.grad_in_use, views)
        return known[2][direction]

    def packed(self, one: array) -> array:
        """A copy of the tangents of a packed array along all directions, one after the other."""
        result = empty((self.width, *one.shape), gradient_type(one.dtype), one.device)
        for i in range(self.width):
            _native.copy_array(result[i], self.twin(one, i), None)
        return result

    def _allocate(self, one: array) -> array:
        """Sees to it that the allocation of an array has twins; returns the allocation."""
        base = _base(one)
        if (base.ptr or 0) not in self._twins:
            pitch = _pitch(bytes_spanned(base) * _widening(base.dtype))
            tangents = _zeros(self.width * pitch, base.device)
            gradients = None if self.tape is None else _zeros(self.width * pitch, base.device)
            self._twins[base.ptr or 0] = (base, pitch, tangents, gradients)
        return base

    def _view(self, one: array, base: array, direction) -> array:
        _, pitch, tangents, gradients = self._twins[base.ptr or 0]
        wide, dtype = _widening(one.dtype), gradient_type(one.dtype)
        offset = ((one.ptr or 0) - (base.ptr or 0)) * wide + direction * pitch
        strides = [stride * wide for stride in one.strides]
        result = tangents._view(offset, one.shape, strides, dtype)
        if gradients is not None:
            result.grad = gradients._view(offset, one.shape, strides, dtype)
        elif one.grad_in_use is not None:
            result.grad = self.twin(one.grad, direction)
        return result

    # The overwritten arrays.

    def access(self, arrays, written) -> None:
        """Called before arrays are read or written."""
        if self._changed:
            for one in arrays:
                self._restore(_base(one).ptr or 0)
        for one in () if self.is_last else written:
            base = _base(one)
            if (base.ptr or 0) not in self._kept:
                self._kept[base.ptr or 0] = (base, self._keep(base))

    def _keep(self, base: array) -> array:
        with Observing(executor=None):
            kept = copy_layout(base)
        if self.tape is not None and base.requires_grad:
            kept.requires_grad = True
            self.tape.add_copy(kept, base, event("copy"))
        return kept

    def _restore(self, address: int) -> None:
        if address in self._changed:
            base, kept = self._changed.pop(address)
            with Observing(executor=None, tape=self.tape):
                base.assign(kept)

    # Operations.

    def launch(self, call: Call) -> None:
        """Runs a launch with tangents."""
        self.access([one for _, one in call.leaves if one is not None], call.written)
        is_behind = any(self.has(one) for one in handles.arrays_of(call))
        active = self._active(call.leaves, call.accesses, is_behind)
        if not any(active):
            self._run(call)
            return
        with handles.Showing(self):
            self._launch(call, active)

    def _launch(self, call, active) -> None:
        derivatives = call.kernel.derivatives
        same = same_arrays(call, meetings(call))
        if same:
            written = {one for one, on in zip(same, active, strict=True) if on}
            active = tuple([one in written for one in same])
        options = {"width": self.width, "same": same}
        made = [derivatives.tangent(call.native, active, **options)]
        made[0].check_rank(call)
        if made[0].one_thread and thread_count(call.dim) > 1:
            check_overlap(call, active, "")
            made.append(derivatives.tangent(call.native, active, winners=True, **options))
        arrays = [one for _, one in call.leaves]
        for one in made:
            self._run(call.other(one.native, (*call.values, *self._hidden(one, arrays))))

    def _run(self, call: Call) -> None:
        if self.tape is None:
            call.run()
            return
        record = self.tape.begin_launch(call)
        record.run()
        self.tape.end_launch(record)

    def _active(self, leaves, accesses, is_behind) -> tuple[bool, ...]:
        """Arrays that have tangents, or get some from those that have.

        is_behind: whether arrays that are known by handles have some.
        """
        known = [one is not None and has_gradient(one.dtype) and self.has(one) for _, one in leaves]
        if not any(known) and not is_behind:
            return tuple(known)
        return tuple(
            found or (one is not None and has_gradient(one.dtype) and (access[1] or access[2]))
            for found, (_, one), access in zip(known, leaves, accesses, strict=True)
        )

    def _hidden(self, made, leaves, first=0) -> list:
        """Twins, zeros for the claims of winners, and counters of singular points.

        first: the direction of the derivative's first one.
        """
        values = []
        for hidden in made.hidden:
            if hidden.kind == "counters":
                dtype = dtypes.dtype_of(hidden.type).dtype
                values.append(zeros(len(hidden.places) or 1, dtype, leaves[0].device))
                continue
            one = leaves[hidden.leaf]
            if hidden.kind == "tangent":
                values.append(self.twin(one, first + hidden.direction))
            else:
                values.append(zeros(one.shape, dtypes.dtype_of(hidden.type).dtype, one.device))
        return values

    def run_adjoint(self, call: Call, values, initial, saved, apart=(), same=()) -> None:
        """Runs the adjoint of a launch with tangents."""
        if any(self.has(one) for one in handles.arrays_of(call)):
            raise errors.WarpGradientError(
                f"launch('{call.kernel.key}'): second derivatives by arrays that kernels know by a "
                "handle, such as vertices of a mesh, are not there",
                hint="pass the array to the kernel, too, and compute with its elements",
            )
        behind = handles.show_gradients()
        unique = not _native.shares_elements([*gradients_of(call, values, same), *behind])
        made = call.kernel.derivatives.adjoint(call.native, call.active, apart=apart, same=same)
        if made.recording is not None:
            raise errors.WarpGradientError(
                f"launch('{call.kernel.key}'): second derivatives through loops that read what "
                "they overwrite are not there",
                hint="write to another array than the one that is read",
            )
        if not unique or made.counting is not None:
            made = call.kernel.derivatives.adjoint(
                call.native, call.active, unique, "checkpoints", apart, same
            )
        hidden = made.hidden_values(call, initial, saved)
        again = call.other(made.native, (*values, *hidden))
        arrays = [one for _, one in again.leaves]
        active = tuple(
            one is not None and has_gradient(one.dtype) and (self.has(one) or one.requires_grad)
            for one in arrays
        )
        second = made.tangent(active, unique, self.width)
        if self.width > 1 and second.counts:
            self._run_each(made.tangent(active, unique, 1), again, arrays)
            return
        hidden = self._hidden(second, arrays)
        call.other(second.native, (*again.values, *hidden)).run()
        count_singular(second, hidden, REPEATED)

    def _run_each(self, second, again: Call, arrays) -> None:
        """Runs a derivative of an adjoint along one direction after the other.

        Vectors of repeated singular values or eigenvalues suit one direction. The adjoint itself
        counts once: each run begins with the gradients that there were.
        """
        with Observing(executor=None):
            gradients = [one.grad for one in arrays if one is not None and one.requires_grad]
            before = [copy_layout(one) for one in gradients]
            for direction in range(self.width):
                for one, contents in zip(gradients, before, strict=True) if direction else ():
                    _native.copy_array(one, contents, None)
                hidden = self._hidden(second, arrays, direction)
                again.other(second.native, (*again.values, *hidden)).run()
                count_singular(second, hidden, REPEATED)

    def copy(self, dest: array, src: array, stream=None) -> None:
        """Copies values and tangents."""
        self.access((dest, src), (dest,))
        self._copy(dest, src, stream)
        if not has_gradient(dest.dtype):
            return
        if self.has(src):
            for i in range(self.width):
                self._copy(self.twin(dest, i), self.twin(src, i), stream)
        elif self.has(dest):
            self._clear(dest)

    def fill(self, target: array, pattern: bytes) -> None:
        """Fills with a constant, whose tangent is zero."""
        self.access((target,), (target,))
        self._fill(target, pattern)
        if self.has(target):
            self._clear(target)

    def _clear(self, one: array) -> None:
        for i in range(self.width):
            tangents = self.twin(one, i)
            self._fill(tangents, bytes(tangents.item_size))

    def _copy(self, dest, src, stream) -> None:
        _native.copy_array(dest, src, stream)
        if self.tape is not None:
            self.tape.add_copy(dest, src, event("copy"))

    def _fill(self, target, pattern) -> None:
        _native.fill_array(target, pattern)
        if self.tape is not None:
            self.tape.add_fill(target, event("fill"))


def _pitch(size: int) -> int:
    """Bytes from one twin to the next; not a power of two, so that caches have room for all."""
    return (size + 63) // 64 * 64 + 320


def _zeros(size, device) -> array:
    made = empty(max(size, 1), scalars.uint8, device)
    _native.fill_array(made, bytes(1))
    return made


def _base(one: array) -> array:
    """The array that a view was made of."""
    owner = one._owner
    while isinstance(owner, array):
        one, owner = owner, owner._owner
    return one


def _widening(dtype) -> int:
    """How many times more bytes the tangent of an element has."""
    return dtypes.type_size_in_bytes(gradient_type(dtype)) // dtypes.type_size_in_bytes(dtype)
