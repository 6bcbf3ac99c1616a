"""What a tape records, and how each kind of record runs backwards.

A record has `event` (what and where), `arrays()` (what takes part in gradients), `written()` (what
it may change, as far as is known) and `reverse(state)`. `state` belongs to one backward pass; its
`seen_before(array)` tells whether an earlier record uses the same memory. If none does, filling an
array or copying constants to it is where its values come from, and the gradient with respect to
them stays readable.
"""

from __future__ import annotations

import sys

from warp import _native, config
from warp._src import errors
from warp._src.arrays.array import array
from warp._src.arrays.boxes import Box
from warp._src.arrays.observers import Observers, copy_layout
from warp._src.arrays.versions import Event
from warp._src.derivatives import cotangents
from warp._src.kernels.call import Call
from warp._src.types import dtypes
from warp._src.types.scalars import float_base


class LaunchRecord:
    """A launch. Versions are those that its arrays had when it was done."""

    __slots__ = (
        "__weakref__",
        "aliases",
        "call",
        "event",
        "initial",
        "pending",
        "preserve",
        "saved",
        "versions",
    )

    def __init__(self, call: Call, preserve: bool = False):
        self.call = call
        self.event: Event = call.event
        self.preserve = preserve
        # No backward pass has run it yet.
        self.pending = True
        self.versions: list = []
        # Copies of arrays as they were before the launch, by number.
        self.initial: dict[int, array] = {}
        # What the augmented kernel has noted, in the order of the hidden arguments.
        self.saved: list[array] = []
        # Pairs (written, other) of arguments that share memory.
        self.aliases: list[tuple[int, int]] = []
        if not any(call.active):
            return
        self.aliases = _aliases(call)
        if self.aliases or call.signature.looks_back:
            self._prepare()

    def _prepare(self) -> None:
        """Keeps what the launch itself is going to overwrite."""
        try:
            derivative = self.derivative()
        except errors.WarpError:
            # Says so when gradients are asked for.
            return
        wanted = derivative.preserved
        wanted |= {reader for _, reader in self.aliases} & set(derivative.needed)
        for leaf in wanted:
            found = self.call.leaves[leaf][1]
            if found is not None:
                self.initial[leaf] = copy_layout(found, self.call.stream)

    @property
    def structs(self) -> list:
        """The structs that were passed."""
        return self.call.originals

    @property
    def kernel(self):
        return self.call.kernel

    def derivative(self, tape=None):
        """The derivative with respect to the arrays that have gradients.

        Args:
            tape: in place of the kernel's option of that name.

        Raises:
            WarpCodegenError: the kernel cannot be differentiated.
        """
        return self.call.kernel.derivatives.adjoint(self.call.native, self.call.active, tape=tape)

    def run(self) -> None:
        """Runs the launch, with notes for the adjoint if that needs any."""
        derivative = None
        if self.call.signature.looks_back and any(self.call.active):
            try:
                derivative = self.derivative()
            except errors.WarpError:
                derivative = None
        if derivative is not None and derivative.augmented is not None:
            self.saved = derivative.run_augmented(self.call)
        else:
            self.call.run()

    def observe(self) -> None:
        """Notes the versions of all arrays."""
        if not any(self.call.active):
            return
        for _, leaf in self.call.leaves:
            version = None
            if leaf is not None and leaf.size:
                version = Observers.memory.observe(leaf)
                if self.preserve:
                    version.keep_for(self)
                elif config.verify_autograd_array_access:
                    version.tell(self)
            self.versions.append(version)

    def needs(self, version) -> bool:
        """Whether the adjoint reads what this version is of."""
        return self._needed_name(version) is not None

    def _needed_name(self, version) -> str | None:
        """Name of the array that the adjoint reads and this version is of."""
        try:
            wanted = self.derivative().needed
        except errors.WarpError:
            return None
        for leaf in wanted:
            if leaf < len(self.versions) and self.versions[leaf] is version:
                return self.call.leaves[leaf][0]
        return None

    def overwriting(self, version, by: Event) -> None:
        """Says that a version is about to end although a backward pass has yet to read it."""
        name = self._needed_name(version) if self.pending else None
        if name is not None:
            print(
                f"{by.file}:{by.line}: the {by.what} overwrites an array that has already been "
                f"read from: the gradient of the {self.event} depends on its array '{name}'; "
                "write to another array, or use `wp.Tape(preserve='auto')`",
                file=sys.stderr,
            )

    def arrays(self) -> list[array]:
        return [leaf for _, leaf in self.call.leaves if leaf is not None]

    def written(self) -> list[array]:
        return self.call.written

    def reverse(self, state) -> None:
        active = self.call.active
        if not any(active):
            return
        if not self.call.kernel.option("enable_backward"):
            raise self._error("the kernel has `enable_backward=False`", "remove that option")
        derivative = self.call.kernel.derivatives.adjoint(self.call.native, active)
        if self.aliases:
            self._check_aliases()
        values = self._values(derivative)
        runner = Observers.executor or self.call.kernel.derivatives
        runner.run_adjoint(self.call, values, self.initial, self.saved)
        self.pending = False

    def arguments(self) -> tuple | None:
        """All arguments of the adjoint with checkpoints, None if there is nothing to run."""
        if not any(self.call.active):
            return None
        derivative = self.derivative(tape="checkpoints")
        hidden = derivative.hidden_values(self.call, self.initial, self.saved)
        return (*self._values(derivative), *hidden)

    def _check_aliases(self) -> None:
        elementwise = self.call.kernel.module.name == "warp.map"
        for written, other in self.aliases:
            name, first = self.call.leaves[written]
            name_of_other, second = self.call.leaves[other]
            same = (first.ptr, first.shape, first.strides) == (
                second.ptr,
                second.shape,
                second.strides,
            )
            if elementwise and same:
                continue
            raise self._error(
                f"arguments '{name}', which is written, and '{name_of_other}' overlap",
                "give the kernel one array for both, or write to another array",
            )

    def _values(self, derivative) -> tuple:
        """The arguments as they were, with the arrays of gradients that they have."""
        replaced = {}
        aliased = {reader for _, reader in self.aliases}
        for leaf in derivative.needed:
            version = self.versions[leaf] if leaf < len(self.versions) else None
            if version is None:
                continue
            name, found = self.call.leaves[leaf]
            if leaf in aliased and leaf in self.initial:
                replaced[leaf] = cotangents.with_gradient_of(self.initial[leaf], found)
            elif version.copy is not None:
                replaced[leaf] = cotangents.with_gradient_of(version.copy, found)
            elif version.overwriter() is not None:
                raise self._overwritten(name, version.ended)
        return self.call.with_leaves(replaced)

    def _overwritten(self, name, by):
        return self._error(
            f"its array '{name}' has been overwritten by the {by}, "
            f"but the gradient depends on what it held",
            "write to another array, or use `wp.Tape(preserve='auto')`",
        )

    def _error(self, what, hint):
        place = self.call.event
        return errors.WarpGradientError(
            f"gradient of the {place}: {what}", file=place.file, line=place.line, hint=hint
        )


def _aliases(call) -> list[tuple[int, int]]:
    """Pairs (written, other) of arguments that share memory."""
    written = call.signature.written
    arrays = [leaf for _, leaf in call.leaves if leaf is not None]
    if not written or len(arrays) < 2 or not _native.shares_elements(arrays):
        return []
    boxes = [None if leaf is None else Box(leaf) for _, leaf in call.leaves]
    return [
        (i, j)
        for i in written
        for j, other in enumerate(boxes)
        if i != j and boxes[i] and other and boxes[i].overlaps(other)
    ]


class CopyRecord:
    """A copy of all elements between arrays (or parts of them) of equal size."""

    def __init__(self, dest, src, event: Event):
        self.dest, self.src, self.event = dest, src, event

    def arrays(self) -> list[array]:
        return [self.dest, self.src]

    def written(self) -> list[array]:
        return [self.dest]

    def reverse(self, state) -> None:
        if self.dest.grad is None:
            return
        if self.src.grad is None and not state.seen_before(self.dest):
            return
        if self.src.grad is not None and _scalar(self.src) is _scalar(self.dest):
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
        if self.target.grad is not None and state.seen_before(self.target):
            self.target.grad.zero_()


class FunctionRecord:
    """What `Tape.record_func` was given."""

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
