"""Derivatives of kernels: made on first use, kept with the kernel, run like any launch.

The compiler turns the module of a native kernel into that of its adjoint (or of its tangent) for a
given set of arrays that have gradients. What comes with it (which arrays it reads, arguments that
the primal does not have) is in `Derivative`.
"""

from __future__ import annotations

import functools
import math

from warp import _native
from warp._src import errors, types
from warp._src.array import array
from warp._src.boxes import Box
from warp._src.singular import count_singular
from warp._src.structs import StructInstance
from warp._src.watching import Call


class Derivative:
    """The derivative of a native kernel, itself a native kernel.

    Attributes:
        kernel: the kernel in Python.
        native: what runs.
        augmented: the primal, changed to save what the adjoint needs, or None.
        counting: finds how much memory the adjoint's loops need, or None if that is known.
        hidden: arguments after those of the primal; each has `kind`, `leaf`, `type`
            and `places`.
        hidden_of_counting: the same of `counting`.
        needed: numbers of the arrays whose contents are read.
        one_thread: why only launches of one thread are right; empty if all are.
    """

    def __init__(self, kernel, made, mode, unique=False):
        self.kernel = kernel
        self.module = made.module
        # An adjoint asserts what its derivatives require of the operands, always.
        checked = mode == "adjoint" and made.metrics.get("assertions", 0) > 0
        self.native = kernel.compile_module(made.module, checked)
        self._may_split = mode == "adjoint" and unique and not checked and made.counting is None
        self.augmented = None
        if made.augmented is not None:
            self.augmented = kernel.compile_module(made.augmented)
        self.counting = None
        if made.counting is not None:
            self.counting = kernel.compile_module(made.counting)
        self.hidden = made.hidden
        self.hidden_of_counting = made.hidden_of_counting
        self.needed = made.needed
        self.one_thread = made.one_thread
        self._metrics = made.metrics
        for line in made.notices:
            if line not in kernel.noticed:
                kernel.noticed.add(line)
                print(line, flush=True)

    @functools.cached_property
    def gathered(self):
        """The adjoint in two parts that have fewer atomic additions, or None."""
        if not self._may_split or not self._metrics.get("atomics"):
            return None
        from warp._src.gathers import gather_sums

        return gather_sums(self.kernel, self.module)

    @property
    def metrics(self) -> dict[str, int]:
        """Numbers about the code."""
        if self.gathered is None:
            return self._metrics
        return {**self._metrics, "atomics": self.gathered.atomics}


def differentiate(kernel, native, active, forward=False, unique=True, **options):
    """The derivative of a native kernel as the compiler's module, and what goes with it.

    Args:
        options: `width` and `winners` of forward mode, `tape` of reverse mode.

    Raises:
        WarpCodegenError: something active has no derivative.
    """
    from warp import config

    return _native.differentiate(
        native.module,
        forward=forward,
        active=list(active),
        singular=config.singular,
        unique=unique,
        **options,
    )


def run(made: Derivative, call: Call, values, initial=None, saved=()) -> None:
    """Runs the adjoint of a launch.

    Args:
        made: what `Kernel.adjoint` has made for the launch.
        call: the launch.
        values: its arguments.
        initial: copies of arrays as they were before the launch, by number.
        saved: what `run_augmented` has returned.
    """
    if made.one_thread:
        check_threads(made, call)
    if not call.signature.flat:
        for value in values:
            if isinstance(value, StructInstance):
                value.refresh()
    if _meet(call):
        tape = "checkpoints" if made.counting is None else "global"
        made = made.kernel.adjoint(call.native, call.active, unique=False, tape=tape)
    tapes = {}
    if made.counting is not None:
        tapes = _tapes(made, call, values, initial or {}, saved)
    hidden = hidden_values(made, call, initial or {}, saved, tapes)
    if made.gathered is not None and made.gathered.fits(call.dim):
        made.gathered.launch(call, values, hidden)
    else:
        made.native.launch(call.dim, values, hidden, call.device, call.stream, call.block_dim or 0)
    count_singular(made, hidden)


def _tapes(made, call, values, initial, saved) -> dict:
    """Memory for the loops of the adjoint, see `global_tape.allocate`."""
    from warp._src.global_tape import allocate

    def known(wanted, own):
        return hidden_values(made, call, initial, saved, own, wanted)

    return allocate(made, call, values, known)


def run_augmented(made: Derivative, call: Call) -> list[array]:
    """Runs a launch that saves what its adjoint needs, and returns that."""
    from warp._src.array_create import zeros

    # An element for each thread, at its index.
    extents = tuple(call.dim) if isinstance(call.dim, (tuple, list)) else (int(call.dim),)
    shape = extents + (1,) * (4 - len(extents))
    saved = []
    for hidden in made.hidden:
        if hidden.kind == "saved":
            dtype = types.dtype_of(hidden.type).dtype
            saved.append(zeros(shape, dtype, _device(call)))
    made.augmented.launch(
        call.dim, call.values, saved, call.device, call.stream, call.block_dim or 0
    )
    return saved


def _device(call):
    from warp._src.devices import by_index

    return by_index(call.device)


def thread_count(dim) -> int:
    return math.prod(dim) if isinstance(dim, (tuple, list)) else int(dim)


def check_threads(made, call) -> None:
    """Rejects a launch of several threads where derivatives are right for one only."""
    threads = thread_count(call.dim)
    if threads > 1:
        raise errors.WarpGradientError(
            f"launch('{call.kernel.key}'): derivatives of this kernel are right for "
            f"one thread only, but the launch has {threads}: {made.one_thread}"
        )


def _meet(call) -> bool:
    """Whether threads with different indices may meet at a gradient."""
    return _native.shares_elements([leaf.grad for _, leaf in call.leaves if _is_active(leaf)])


def _is_active(leaf) -> bool:
    return leaf is not None and leaf.grad is not None


def hidden_values(made, call, initial, saved, tapes=None, wanted=None) -> list[array]:
    """Values of the arguments that only the derivative has.

    Args:
        tapes: those of loops that keep their iterations, by kind and number of the loop.
        wanted: the arguments; None stands for those of the derivative itself.
    """
    if wanted is None:
        wanted = made.hidden
    if not wanted:
        return []
    from warp._src.array_create import zeros

    notes = dict(zip([one.leaf for one in made.hidden if one.kind == "saved"], saved, strict=False))
    left = {key: list(arrays) for key, arrays in (tapes or {}).items()}
    values = []
    for hidden in wanted:
        if (hidden.kind, hidden.leaf) in left:
            values.append(left[hidden.kind, hidden.leaf].pop(0))
            continue
        if hidden.kind == "counters":
            kind = types.dtype_of(hidden.type)
            values.append(zeros(len(hidden.places) or 1, kind.dtype, _device(call)))
            continue
        if hidden.kind == "saved" and hidden.leaf in notes:
            values.append(notes[hidden.leaf])
            continue
        if hidden.kind == "preserved" and hidden.leaf in initial:
            values.append(initial[hidden.leaf])
            continue
        what = "values that the launch overwrote, or that atomics returned"
        if hidden.kind == "preserved":
            what = f"array '{call.leaves[hidden.leaf][0]}' as it was before the launch"
        raise errors.WarpGradientError(
            f"launch('{call.kernel.key}', adjoint=True): the derivative depends on {what}, "
            f"record the launch on a `wp.Tape`"
        )
    return values


def check_overlap(call: Call, active, what: str) -> None:
    """Rejects a written array that shares memory with another one if one of both is active.

    Raises:
        WarpGradientError: there is one.
    """
    if not _native.shares_elements([leaf for _, leaf in call.leaves if leaf is not None]):
        return
    boxes = [None if leaf is None else Box(leaf) for _, leaf in call.leaves]
    for i, (_, stored, combined, *_) in enumerate(call.accesses):
        if boxes[i] is None or not (stored or combined):
            continue
        for j, other in enumerate(boxes):
            if j == i or other is None or not boxes[i].overlaps(other):
                continue
            if active[i] or active[j]:
                raise errors.WarpGradientError(
                    f"launch('{call.kernel.key}'{what}): arguments "
                    f"'{call.leaves[i][0]}', which is written, and '{call.leaves[j][0]}' overlap, "
                    f"give the kernel one array for both, or write to another array"
                )


def launch(call: Call) -> None:
    """Runs the adjoint of a launch whose arrays have their gradients."""
    if not call.kernel.option("enable_backward"):
        raise errors.WarpGradientError(
            f"launch('{call.kernel.key}', adjoint=True): the kernel has `enable_backward=False`, "
            f"remove that option"
        )
    active = call.active
    check_overlap(call, active, ", adjoint=True")
    if any(active) and thread_count(call.dim):
        run(call.kernel.adjoint(call.native, active), call, call.values)
