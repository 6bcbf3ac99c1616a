"""Records of a tape, and how each kind of record runs backwards.

A record has `event` (what and where), `arrays()` (what takes part in gradients), `written()` (what
it may change, as far as is known) and `reverse(state)`. `state` belongs to one backward pass; its
`seen_before(array)` tells whether an earlier record uses the same memory. If none does, filling an
array or copying constants to it is where its values come from, and the gradient with respect to
them stays readable.
"""

from __future__ import annotations

import sys

from warp import _native, config
from warp._src import config as settings
from warp._src import errors
from warp._src.arrays.array import array
from warp._src.arrays.gradients import gradient_type
from warp._src.arrays.kept import Budget
from warp._src.arrays.observers import Observers
from warp._src.arrays.versions import Event, event_of
from warp._src.derivatives import cotangents
from warp._src.derivatives.handles import arrays_of
from warp._src.derivatives.launch_gradients import gradients_of
from warp._src.derivatives.same_arrays import meetings, notes_of, same_arrays
from warp._src.derivatives.wide_gradients import WideGradients
from warp._src.devices import devices
from warp._src.kernels.call import Call
from warp._src.types import dtypes
from warp._src.types.scalars import float_base


class LaunchRecord(_native.Record):
    """A launch. Versions are those that its arrays had when it was done.

    Ordinary launches are recorded natively (`_native.launch_recorded`), without a call of
    `__init__`; what follows from them is found out when it is asked for.

    Attributes:
        budget: of the copies that are to be made when something is overwritten.
        pending: no backward pass has run it yet.
        versions: of each array, or None where it has no elements; None without gradients.
    """

    __slots__ = ()

    def __init__(self, call: Call, budget: Budget | None = None):
        self.kernel, self.native, self.stream = call.kernel, call.native, call.stream
        self._call, self._event, self.budget = call, call.event, budget
        self._before, self._saved = {}, []
        self._behind = [one for one in arrays_of(call) if one.requires_grad]
        self._has_gradients = any(call.active)
        if self._has_gradients:
            self._look_back()

    @property
    def call(self) -> Call:
        """The launch."""
        if self._call is None:
            self._call = Call(
                self.kernel, self.native, self.dim, self.values, self.device, None, self.block_dim
            )
            self._call._event = self.event
        return self._call

    @property
    def event(self) -> Event:
        """The kernel and the place of the call."""
        if self._event is None:
            self._event = event_of(self.place)
        return self._event

    @property
    def before(self) -> dict:
        """Versions of arrays as they were before the launch, by number."""
        return self._before or {}

    @property
    def behind(self) -> list[array]:
        """Arrays with gradients that the kernel knows by handles."""
        return self._behind or []

    @property
    def saved(self) -> list[array]:
        """The notes of the augmented kernel, in the order of the hidden arguments."""
        return self._saved or []

    @property
    def aliases(self) -> list[tuple[int, int]]:
        """Pairs (written, other) of arguments of which elements meet."""
        return self._aliases or []

    @property
    def same(self) -> tuple[int, ...]:
        """Arguments that are one array, as `same_arrays` says."""
        return same_arrays(self.call, self.aliases) if self.aliases else ()

    @property
    def apart(self) -> tuple:
        """Arrays that are read and written in different places; empty if none is."""
        if self._apart is None:
            self._apart = self.noted_apart()
        return self._apart

    def _look_back(self) -> None:
        """Finds out whether the launch overwrites what its own adjoint reads."""
        call = self.call
        looks_back = call.signature.looks_back
        if call.signature.written and len(call.leaves) > 1:
            self._aliases = meetings(call)
        if looks_back and not self.same and call.regions is not None:
            flags = tuple(call.regions.apart())
            self._apart = flags if any(flags) else ()
        if self.aliases or looks_back:
            try:
                self._made = self.derivative()
            except errors.WarpError:
                # Says so when gradients are asked for.
                return
            self._prepare(self._made)

    @property
    def _regions(self):
        """The access regions of the launch; all of them if some are one array, of which each
        name tells a part."""
        return None if self.same else self.call.regions

    def _prepare(self, derivative) -> None:
        """Sees to it that what the launch itself is going to overwrite is kept."""
        wanted = derivative.preserved
        for leaf in wanted:
            found = self.call.leaves[leaf][1]
            if found is not None and found.size:
                version = Observers.memory.observe(found, self._regions, leaf, reads=True)
                version.keep_for(self, self.budget)
                self._before[leaf] = version

    @property
    def structs(self) -> list:
        """The structs that were passed."""
        return self.call.originals if self._originals is None else self._originals

    def derivative(self, tape=None):
        """The derivative with respect to the arrays that have gradients.

        Args:
            tape: in place of the kernel's option of that name.

        Raises:
            WarpCodegenError: the kernel cannot be differentiated.
        """
        call = self.call
        same = self.same
        try:
            return call.kernel.derivatives.adjoint(
                call.native, call.active, True, tape, self.apart, same
            )
        except errors.WarpError as problem:
            problem.notes += notes_of(call, same)
            raise

    def run(self) -> None:
        """Runs the launch, with notes for the adjoint if that needs any."""
        made = self._made
        # The kernel that notes must do the same as the kernel; an adjoint that is not right here is
        # an error.
        if made is not None and made.augmented is not None and made.is_right_for(self.call):
            self._saved = made.run_augmented(self.call)
        else:
            self.call.run()
        self._made = None

    def observe(self) -> None:
        """Notes the versions of all arrays."""
        call, versions = self.call, []
        if self._has_gradients:
            regions, observe = self._regions, Observers.memory.observe
            for i, (_, leaf) in enumerate(call.leaves):
                version = None
                if leaf is not None and leaf.size:
                    # Writes elsewhere are of no concern to the adjoint.
                    reads = bool(self.apart) and self.apart[i]
                    version = observe(leaf, regions, i, reads)
                    if self.budget is not None:
                        version.keep_for(self, self.budget)
                    if config.verify_autograd_array_access and call.accesses[i][0]:
                        version.tell(self)
                versions.append(version)
        self.versions = tuple(versions)
        self._made = None
        call.done()

    def needs(self, version) -> bool:
        """True if the adjoint reads what this version is of."""
        return self._needed_name(version) is not None

    def _needed_name(self, version) -> str | None:
        """Name of the array that the adjoint reads and this version is of."""
        for leaf, known in self.before.items():
            if known is version:
                return self.call.leaves[leaf][0]
        try:
            wanted = self.derivative().needed
        except errors.WarpError:
            return None
        versions = self.versions or ()
        for leaf in wanted:
            if leaf < len(versions) and versions[leaf] is version:
                return self.call.leaves[leaf][0]
        return None

    def overwriting(self, version, by: Event) -> None:
        """Says that what a version is of is about to end, before a backward pass has run."""
        if not self.pending:
            return
        name = self._needed_name(version)
        if name is None and self.budget is None:
            return
        if name is None:
            why = f"no gradient of the {self.event} depends on what it held"
        else:
            why = f"the gradient of the {self.event} depends on its array '{name}'"
            if self.budget is None:
                why += "; write to another array, or use `wp.Tape(preserve='auto')`"
            else:
                why += ", of which the tape keeps a copy"
        place = f" by an array copy at {by.file}:{by.line}" if by.what == "copy" else ""
        text = (
            f"{by.file}:{by.line}: the {by.what} overwrites an array that has already been "
            f"read from: {why}"
        )
        lines = errors.with_peer_sentence([text], "overwritten", array=version.array, place=place)
        print("\n".join(lines), file=sys.stderr)

    def arrays(self) -> list[array]:
        return [leaf for _, leaf in self.call.leaves if leaf is not None] + self.behind

    def written(self) -> list[array]:
        return self.call.written

    def reverse(self, state) -> None:
        if not any(self.call.active):
            return
        if not self.call.kernel.option("enable_backward"):
            raise self._error("the kernel has `enable_backward=False`", "remove that option")
        derivative = self.derivative()
        self._check_aliases(derivative)
        wide = self._with_wide_gradients(derivative, state.images)
        initial = self._initial(state.images)
        runner = Observers.executor or self.call.kernel.derivatives
        if self.call.stream is not None:
            gradients_of(self.call, wide.values)
            self.call.stream.wait_stream(devices.get_stream(self.call.stream.device))
        wide.load()
        runner.run_adjoint(self.call, wide.values, initial, self.saved, self.apart, self.same)
        wide.store()
        self.pending = False

    def arguments(self, state) -> tuple | None:
        """All arguments of the adjoint with checkpoints, None if there is nothing to run.

        Returned are also the gradients among them, to be loaded before they are used.
        """
        if not any(self.call.active):
            return None
        derivative = self.derivative(tape="checkpoints")
        self._check_aliases(derivative)
        hidden = derivative.hidden_values(self.call, self._initial(state.images), self.saved)
        wide = self._with_wide_gradients(derivative, state.images)
        return (*wide.values, *hidden), wide

    def _check_aliases(self, derivative) -> None:
        """Rejects arrays that meet in part, if gradients or what is read of them matter."""
        if not self.aliases:
            return
        same = self.same
        active = {i for i, on in enumerate(self.call.active) if on}
        matters = active | set(derivative.needed) | derivative.preserved
        for written, other in self.aliases:
            if (same and same[written] == same[other]) or not matters & {written, other}:
                continue
            name, name_of_other = self.call.leaves[written][0], self.call.leaves[other][0]
            raise self._error(
                f"arguments '{name}', which is written, and '{name_of_other}' overlap",
                "give the kernel one array for both, or write to another array",
            )

    def _initial(self, images) -> dict[int, array]:
        """Arrays as they were before the launch, by number."""
        return {
            leaf: self._contents(leaf, version, images) for leaf, version in self.before.items()
        }

    def _with_wide_gradients(self, derivative, images) -> WideGradients:
        """The arguments as they were, with the arrays of gradients that they have."""
        replaced = {}
        versions = self.versions or ()
        for leaf in derivative.needed:
            version = versions[leaf] if leaf < len(versions) else None
            if version is None:
                continue
            found = self.call.leaves[leaf][1]
            contents = self._contents(leaf, version, images)
            if contents is not found:
                replaced[leaf] = cotangents.with_gradient_of(contents, found)
        return WideGradients(self.call, replaced)

    def _contents(self, leaf, version, images) -> array:
        """The array itself, or what it held if that is something else now."""
        name, found = self.call.leaves[leaf]
        by = version.overwriter()
        if by is not None:
            raise self._overwritten(name, by, version.refused)
        contents = version.contents(images, found)
        return found if contents is None else contents

    def _overwritten(self, name, by, budget):
        what = (
            f"its array '{name}' has been overwritten by the {by}, "
            f"but the gradient depends on what it held"
        )
        if budget is None:
            return self._error(what, "write to another array, or use `wp.Tape(preserve='auto')`")
        return self._error(
            f"{what}; {budget.report()}",
            "write to another array, raise `max_bytes` of the tape, or use "
            "`wp.autograd.checkpoint`",
        )

    def _error(self, what, hint):
        place = self.call.event
        return errors.WarpGradientError(
            f"gradient of the {place}: {what}", file=place.file, line=place.line, hint=hint
        )


def _needs(kernel, native, active, apart):
    """The reads of the adjoint of an ordinary launch: numbers of arrays, those that it reads as
    they were before the launch, or None if the launch has to note more, and whether it reads all as
    they are after the launch. None if there is no adjoint.
    """
    try:
        made = kernel.derivatives.adjoint(native, active, True, None, apart)
    except errors.WarpError:
        # Says so when gradients are asked for.
        return None
    noted = made.augmented is not None
    return made.needed, None if noted else made.preserved, not (noted or made.preserved)


def _plain_adjoint(kernel, native, active, apart, elements):
    """The native adjoint if a launch of it with the same arguments is all there is to do, perhaps
    with arrays as they were before the launch: their numbers.

    elements: types of the elements of arrays, as `active` counts them.
    """
    if not kernel.option("enable_backward"):
        return None
    if any(on and gradient_type(one) is not one for on, one in zip(active, elements, strict=True)):
        # Their gradients may have to be widened.
        return None
    try:
        made = kernel.derivatives.adjoint(native, active, True, None, apart)
    except errors.WarpError:
        return None
    former = [hidden.leaf for hidden in made.hidden if hidden.kind == "preserved"]
    others = made.one_thread or made.counting or made.recording or made.augmented or made.gathered
    if others or made.max_rank < 4 or len(former) != len(made.hidden):
        return None
    return made.native, former


_native.set_record_type(LaunchRecord, _needs, _plain_adjoint)
for _name in ("singular", "tape"):
    settings.on_change(_name, lambda *_: _native.forget_needs())


class CopyRecord:
    """A copy of all elements between arrays (or parts of them) of equal size."""

    def __init__(self, dest, src, event: Event):
        self.dest, self.src, self.event = dest, src, event

    def arrays(self) -> list[array]:
        return [self.dest, self.src]

    def written(self) -> list[array]:
        return [self.dest]

    def reverse(self, state) -> None:
        if self.dest.grad_in_use is None:
            return
        if not self.src.requires_grad and not state.seen_before(self.dest):
            return
        if self.src.requires_grad and _scalar(self.src) is _scalar(self.dest):
            if (self.src.ptr, self.src.strides) == (self.dest.ptr, self.dest.strides):
                return
            cotangents.add_into(self.src.grad, self.dest.grad)
        self.dest.grad.zero_()


def _scalar(value):
    """Type of the components of an array's elements, None if they have no gradient."""
    if dtypes.is_struct(value.dtype):
        return value.dtype
    scalar = getattr(value.dtype, "_wp_scalar_type_", value.dtype)
    return scalar if issubclass(scalar, float_base) else None


class FillRecord:
    """`fill_` or `zero_`."""

    def __init__(self, target, event: Event):
        self.target, self.event = target, event

    def arrays(self) -> list[array]:
        return [self.target]

    def written(self) -> list[array]:
        return [self.target]

    def reverse(self, state) -> None:
        if self.target.grad_in_use is not None and state.seen_before(self.target):
            self.target.grad.zero_()


class FunctionRecord:
    """The arguments of `Tape.record_func`."""

    def __init__(self, backward, arrays, event: Event):
        self.backward, self.event = backward, event
        self._arrays = [one for one in arrays if one is not None]

    def arrays(self) -> list[array]:
        found: list = []
        for one in self._arrays:
            found += [one] if isinstance(one, array) else list(one.arrays())
        return found

    def written(self) -> list[array]:
        return []

    def reverse(self, state) -> None:
        self.backward()
