"""One derivative of a kernel: native code, arrays that it reads, arguments beyond the primal's."""

from __future__ import annotations

import functools
import math

from warp import _native, config
from warp._src import errors
from warp._src.arrays.array import array
from warp._src.arrays.create import zeros
from warp._src.derivatives.gathers import gather_sums
from warp._src.derivatives.singular import count_singular
from warp._src.devices.devices import by_index
from warp._src.kernels.call import Call
from warp._src.types import dtypes


class KernelDerivative:
    """One derivative of a native kernel, itself a native kernel.

    Attributes:
        kernel: the kernel in Python.
        native: what runs.
        augmented: the primal, changed to save what the adjoint needs, or None.
        counting: finds how much memory the adjoint's loops need, or None if that is known.
        hidden: arguments after those of the primal; each has `kind`, `leaf`, `type`
            and `places`.
        hidden_of_counting: the same of `counting`.
        sizing, recording: run the launch again and keep what loops read, or None if none needs
            that.
        hidden_of_sizing, hidden_of_recording: the same of those.
        needed: numbers of the arrays whose contents are read.
        one_thread: why only launches of one thread are right; empty if all are.
        unrecorded: what the launch has left takes the place of what it has overwritten.
    """

    def __init__(self, kernel, made, mode, unique=False, unrecorded=False):
        self.kernel = kernel
        # An adjoint asserts what its derivatives require of the operands, always.
        checked = mode == "adjoint" and made.metrics.get("assertions", 0) > 0
        self._tangents: dict = {}
        self.native = kernel.compile_module(made.module, checked)
        self._may_split = mode == "adjoint" and unique and not checked
        self._may_split = self._may_split and made.counting is None and made.recording is None
        self.augmented = None
        if made.augmented is not None:
            self.augmented = kernel.compile_module(made.augmented)
        self.counting = None
        if made.counting is not None:
            self.counting = kernel.compile_module(made.counting)
        self.sizing = self.recording = None
        if made.recording is not None:
            self.sizing = kernel.compile_module(made.sizing)
            self.recording = kernel.compile_module(made.recording)
        self.hidden = made.hidden
        self.hidden_of_counting = made.hidden_of_counting
        self.hidden_of_sizing = made.hidden_of_sizing
        self.hidden_of_recording = made.hidden_of_recording
        self.needed = made.needed
        self._preserved = {
            hidden.leaf
            for hidden in (*self.hidden, *self.hidden_of_recording)
            if hidden.kind == "preserved"
        }
        self.one_thread = made.one_thread
        self.unrecorded = unrecorded
        self._metrics = made.metrics

    @property
    def module(self):
        """The compiler's module of what runs."""
        return self.native.module

    @functools.cached_property
    def gathered(self):
        """The adjoint in two parts that have fewer atomic additions, or None."""
        if not self._may_split or not self._metrics.get("atomics"):
            return None
        return gather_sums(self.kernel, self.module)

    @property
    def metrics(self) -> dict[str, int]:
        """Numbers about the code."""
        if self.gathered is None:
            return self._metrics
        return {**self._metrics, "atomics": self.gathered.atomics}

    @property
    def is_plain(self) -> bool:
        """True if it takes a launch's own arguments alone, and is right for all extents."""
        alone = not self.hidden and self.counting is None and self.recording is None
        return alone and not self.one_thread and self.max_rank == 4

    @property
    def counts(self) -> bool:
        """True if it counts singular points."""
        return any(hidden.kind == "counters" for hidden in self.hidden)

    @property
    def may_run_again(self) -> bool:
        """True if the adjoint may do without copies of arrays from before the launch.

        It needs them to run the launch again, or where loops read an element before they write it.
        """
        if self._metrics.get("ordered_reads"):
            return not any(one.kind == "saved" for one in self.hidden)
        return self.recording is not None and not any(
            one.kind in ("preserved", "saved") for one in self.hidden
        )

    @property
    def preserved(self) -> set[int]:
        """Arrays of which it reads the contents before the launch."""
        return set(self._preserved)

    def tangent(self, active, unique, width) -> KernelDerivative:
        """Its own derivative in forward mode."""
        key = (active, unique, width)
        if key not in self._tangents:
            # Tangents of vectors of repeated values are zero: where that matters, it is said.
            singular = "strict" if config.singular == "strict" else "repeated"
            made = differentiate(self.native, active, True, unique, singular, width=width)
            self._tangents[key] = KernelDerivative(self.kernel, made, "adjoint_tangent")
            self.kernel.derivatives.notice(made.notices)
        return self._tangents[key]

    @property
    def max_rank(self) -> int:
        """How many dimensions a launch may have, 4 if any: threads of a launch of more would share
        elements that the derivative takes for one thread's own."""
        return self._metrics.get("launch_dimensions", 4)

    def check_rank(self, call: Call) -> None:
        """Rejects a launch of more dimensions than the derivative is right for."""
        rank = _rank(call)
        if rank > self.max_rank:
            raise errors.WarpGradientError(
                f"launch('{call.kernel.key}'): derivatives of this kernel, which uses what atomics "
                f"return, are right for launches of up to {self.max_rank} dimensions, "
                f"but this one has {rank}",
                hint="take all indices from `wp.tid()`",
            )

    def is_right_for(self, call: Call) -> bool:
        """True if the launch has no more threads and dimensions than the derivative allows."""
        return _rank(call) <= self.max_rank and not (self.one_thread and thread_count(call.dim) > 1)

    def check_threads(self, call: Call) -> None:
        """Rejects a launch that the derivative is not right for."""
        self.check_rank(call)
        if not self.is_right_for(call):
            threads = thread_count(call.dim)
            raise errors.WarpGradientError(
                f"launch('{call.kernel.key}'): derivatives of this kernel are right for "
                f"one thread only, but the launch has {threads}: {self.one_thread}"
            )

    def run(self, call: Call, values, initial, saved) -> None:
        """Runs it for a launch."""
        tapes = {}
        if self.recording is not None:
            from warp._src.derivatives.memory_log import record

            tapes = record(self, call, values, initial, saved)
        if self.counting is not None:
            tapes = self._tapes(call, values, initial, saved, tapes)
        hidden = self.hidden_values(call, initial, saved, tapes)
        self.launch(call, values, hidden)
        count_singular(self, hidden)

    def launch(self, call: Call, values, hidden=()) -> None:
        """Launches it, or the two parts that it is taken apart into."""
        if self.gathered is not None and self.gathered.fits(call.dim):
            self.gathered.launch(call, values, hidden)
        else:
            self.native.launch(
                call.dim, values, hidden, call.device, call.stream, call.block_dim or 0
            )

    def _tapes(self, call, values, initial, saved, logged) -> dict:
        """Memory for the loops of the adjoint, see `global_tape.allocate`, and the log."""
        from warp._src.derivatives.global_tape import allocate

        def known(wanted, own):
            return self.hidden_values(call, initial, saved, own | logged, wanted)

        return allocate(self, call, values, known) | logged

    def run_augmented(self, call: Call) -> list[array]:
        """Runs a launch that saves what its adjoint needs, and returns that."""
        # An element for each thread, at its index.
        extents = tuple(call.dim) if isinstance(call.dim, (tuple, list)) else (int(call.dim),)
        shape = extents + (1,) * (4 - len(extents))
        saved = []
        for hidden in self.hidden:
            if hidden.kind == "saved":
                dtype = dtypes.dtype_of(hidden.type).dtype
                saved.append(zeros(shape, dtype, by_index(call.device)))
        self.augmented.launch(
            call.dim, call.values, saved, call.device, call.stream, call.block_dim or 0
        )
        return saved

    def hidden_values(self, call, initial, saved, tapes=None, wanted=None) -> list[array]:
        """Values of the arguments that only the derivative has.

        Args:
            tapes: those of loops that keep their iterations, by kind and number of the loop.
            wanted: the arguments; None stands for those of the derivative itself.
        """
        if wanted is None:
            wanted = self.hidden
        if not wanted:
            return []
        notes = dict(
            zip([one.leaf for one in self.hidden if one.kind == "saved"], saved, strict=False)
        )
        left = {key: list(arrays) for key, arrays in (tapes or {}).items()}
        values = []
        for hidden in wanted:
            key = hidden.kind, hidden.leaf
            if key in left:
                values.append(left[key].pop(0))
            elif hidden.kind == "counters":
                dtype = dtypes.dtype_of(hidden.type).dtype
                values.append(zeros(len(hidden.places) or 1, dtype, by_index(call.device)))
            elif hidden.kind == "saved" and hidden.leaf in notes:
                values.append(notes[hidden.leaf])
            elif hidden.kind == "preserved" and hidden.leaf in initial:
                values.append(initial[hidden.leaf])
            else:
                raise self.not_recorded(call, hidden)
        return values

    @staticmethod
    def not_recorded(call, hidden):
        """The error for a value that only a tape could have."""
        if hidden.kind == "preserved":
            return KernelDerivative.overwritten(call, hidden.leaf)
        return KernelDerivative._needs_tape(
            call, "values that the launch overwrote, or that atomics returned"
        )

    @staticmethod
    def overwritten(call, leaf):
        """The error for contents of an array that only a tape could have."""
        return KernelDerivative._needs_tape(
            call, f"array '{call.leaves[leaf][0]}' as it was before the launch"
        )

    @staticmethod
    def _needs_tape(call, what):
        return errors.WarpGradientError(
            f"launch('{call.kernel.key}', adjoint=True): the derivative depends on {what}, "
            f"record the launch on a `wp.Tape`",
            hint="a tape keeps what is overwritten in arrays with `requires_grad=True`",
        )


def _rank(call: Call) -> int:
    """Dimensions of a launch."""
    return len(call.dim) if isinstance(call.dim, (tuple, list)) else 1


def differentiate(native, active, forward=False, unique=True, singular=None, **options):
    """The derivative of a native kernel as the compiler's module, and what goes with it.

    Args:
        singular: the policy at singular points, by default that of the settings.
        options: `width` and `winners` of forward mode, `tape` of reverse mode.

    Raises:
        WarpCodegenError: something active has no derivative.
    """
    return _native.differentiate(
        native.module,
        forward=forward,
        active=list(active),
        singular=singular or config.singular,
        unique=unique,
        **options,
    )


def thread_count(dim) -> int:
    """Threads of a launch over these extents."""
    return math.prod(dim) if isinstance(dim, (tuple, list)) else int(dim)
