"""`checkpoint`: the gradient of a long time loop with a few copies of its state."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from warp._native import Region
from warp._src import errors
from warp._src.argument_kinds import ARRAYS, CALLABLE, COUNT
from warp._src.arguments import checked
from warp._src.arrays.array import array
from warp._src.arrays.observers import Observers, Observing, copy_elements, copy_layout
from warp._src.arrays.versions import Event, Memory, event
from warp._src.autograd.revolve import Reversal, first_sweep
from warp._src.derivatives.backward import BackwardPass
from warp._src.derivatives.tape import Tape
from warp._src.kernels.call import Call


@checked(step=CALLABLE, steps=COUNT, state=ARRAYS, snapshots=COUNT)
def checkpoint(
    step: Callable[[int], None], steps: int, state: Sequence[array], snapshots: int
) -> None:
    """Runs `step(0)`, ..., `step(steps - 1)`, recorded on a tape in little memory.

    The tape keeps at most `snapshots` copies of the state. The backward pass runs steps again from
    there, by a binomial schedule: 1000 steps with 8 copies take about four more forward sweeps. The
    gradients are the same bits as if every step were recorded, if the kernels are deterministic.
    Without a tape the steps just run.

    Args:
        step: launches what step number k does. All it depends on are its number, the state and
            arrays that do not change.
        steps: how often.
        state: arrays that a step reads and changes. Arrays that a step fills anew before it reads
        them need
            not be listed.
        snapshots: most copies of the state that exist at a time, at least 1.

    Raises:
        WarpGradientError: a step changes an array that it also reads and that is not in `state`.

    Example:
        >>> import warp as wp
        >>> @wp.kernel
        ... def advance(x: wp.array(dtype=float)):
        ...     i = wp.tid()
        ...     x[i] = x[i] * 0.5
        >>> x = wp.ones(1, dtype=float, requires_grad=True, device="cpu")
        >>> def step(k):
        ...     wp.launch(advance, 1, [x], device="cpu")
        >>> with wp.Tape() as tape:
        ...     wp.autograd.checkpoint(step, 10, state=[x], snapshots=3)
        >>> tape.backward(loss=x)
        >>> print(x.grad.numpy()[0] == 0.5**10)
        True
    """
    if not isinstance(steps, int) or steps < 0:
        raise ValueError(f"checkpoint expects a number of steps, but got {steps!r}")
    if not isinstance(snapshots, int) or snapshots < 1:
        raise ValueError(f"checkpoint expects at least one snapshot, but got {snapshots!r}")
    for one in state:
        if not isinstance(one, array):
            raise TypeError(f"checkpoint expects arrays as state, but got '{type(one).__name__}'")
    tape = Observers.tape
    if tape is None or not steps:
        for number in range(steps):
            step(number)
        return
    record = _CheckpointRecord(step, steps, list(state), snapshots, event("checkpoint"))
    record.first_sweep(tape.preserve == "auto", tape._budget)
    tape._add(record)


class _Observer:
    """Takes the place of the tape in the first sweep: sees what the steps read and write."""

    preserve, _budget = "never", None

    def __init__(self, state):
        self.state = [Region(one) for one in state]
        self.read: dict = {}
        self.written: dict = {}
        self._filled: list = []
        self._early: dict = {}

    def begin_step(self) -> None:
        self._filled, self._early = [], {}

    def ordinary_records(self) -> tuple:
        return None, None

    def begin_launch(self, call: Call):
        return call

    def end_launch(self, call: Call) -> None:
        for (name, one), access in zip(call.leaves, call.accesses, strict=True):
            if one is not None and one.size and (access[0] or access[2]):
                self._reads(one, name, call.event)
        for one in call.written:
            self._writes(one)

    def add_copy(self, dest, src, place) -> None:
        self._reads(src, "src", place)
        self._writes(dest)

    def add_fill(self, target, place) -> None:
        self._writes(target)

    def _reads(self, one, name, place) -> None:
        region, layout = Region(one), (one.ptr, one.shape, one.strides)
        self.read.setdefault(layout, one)
        inside = any(region.overlaps(known) for known in (*self.state, *self._filled))
        if not inside:
            self._early.setdefault(layout, (region, name, place))

    def _writes(self, one) -> None:
        self.written.setdefault((one.ptr, one.shape, one.strides), one)
        self._filled.append(Region(one))

    def end_step(self) -> None:
        for region, name, place in self._early.values():
            if any(region.overlaps(other) for other in self._filled):
                raise errors.WarpGradientError(
                    f"checkpoint: a step reads and changes array '{name}' of the {place}, "
                    f"which is not in `state`",
                    file=place.file,
                    line=place.line,
                    hint="list it in `state`, or fill it anew in each step",
                )

    def constants(self) -> list[array]:
        """Arrays that are read and never written."""
        changed = [Region(one) for one in self.written.values()] + self.state
        return [
            one
            for one in self.read.values()
            if not any(Region(one).overlaps(other) for other in changed)
        ]


class _CheckpointRecord:
    """A loop on a tape, with copies of its state."""

    def __init__(self, step, steps, state, snapshots, place: Event):
        self.step, self.steps, self.state = step, steps, state
        self.event = place
        # One of three or more copies is for the state at the end.
        self.slots = snapshots - 1 if snapshots > 2 else snapshots
        self.keeps_end = snapshots > 2
        self.copies: dict[int, list[array]] = {}
        self.kept: list = []
        self.versions: list = []
        self.observer = _Observer(state)

    def arrays(self) -> list[array]:
        found = {id(one): one for one in self.written()}
        found.update((id(version.array), version.array) for version in self.versions)
        return list(found.values())

    def written(self) -> list[array]:
        """Arrays that the loop changes."""
        return [*self.state, *self.observer.written.values()]

    # Forward.

    def first_sweep(self, preserve: bool, budget) -> None:
        """Runs all steps and keeps the copies that the backward pass begins with."""
        self.kept = first_sweep(self.steps, self.slots)
        starts = {start for start, _ in self.kept}
        with Observing(tape=self.observer):
            for number in range(self.steps):
                if number in starts:
                    self._keep(number)
                self.observer.begin_step()
                self.step(number)
                self.observer.end_step()
        for one in self.observer.constants():
            version = Observers.memory.observe(one)
            if preserve:
                version.keep_for(self, budget)
            self.versions.append(version)

    def needs(self, version) -> bool:
        return True

    def _keep(self, number) -> None:
        self.copies[number] = [copy_layout(one) for one in self.state]

    def _restore(self, number) -> None:
        for one, contents in zip(self.state, self.copies[number], strict=True):
            one.assign(contents)

    # Backward.

    def reverse(self, state) -> None:
        swapped = self._constants_as_they_were()
        self._seen_before = any(state.seen_before(one) for one in self.written())
        end = [copy_layout(one) for one in self.state] if self.keeps_end else None
        reversal = Reversal(self._keep, self._restore, self._drop, self.step, self._reverse_step)
        with Observing(tape=None, memory=Memory(copy_elements)):
            if len(self.copies) < len(self.kept):
                self._sweep_again()
            reversal.run(self.steps, self.kept)
            self._bring_back(end)
        for one, contents in swapped:
            one.assign(contents)
        inside = [Region(one) for one in self.state]
        for one in self.observer.written.values():
            if not any(Region(one).overlaps(other) for other in inside):
                Observers.memory.writing(one, self)

    def _drop(self, number) -> None:
        """Frees a copy; that of the beginning is kept for another backward pass."""
        if number:
            del self.copies[number]

    def _reverse_step(self, number) -> None:
        with Tape() as tape:
            self.step(number)
        BackwardPass(tape, {}, first=number == 0 and not self._seen_before).run()
        tape._records.clear()

    def _sweep_again(self) -> None:
        """Makes the copies that a backward pass begins with, after an earlier one."""
        starts = {start for start, _ in self.kept}
        self._restore(0)
        for number in range(self.kept[-1][0] + 1):
            if number in starts and number:
                self._keep(number)
            if number < self.kept[-1][0]:
                self.step(number)

    def _bring_back(self, end) -> None:
        """Gives the state the contents that it had after the last step."""
        if end is None:
            self._restore(0)
            for number in range(self.steps):
                self.step(number)
        else:
            for one, contents in zip(self.state, end, strict=True):
                one.assign(contents)

    def _constants_as_they_were(self) -> list:
        """Exchanges what has been overwritten since; returns the present contents."""
        swapped = []
        for version in self.versions:
            by = version.overwriter()
            if by is not None:
                raise errors.WarpGradientError(
                    f"gradient of the {self.event}: an array that its steps read, "
                    f"{version.array!r}, has been overwritten by the {by}",
                    file=self.event.file,
                    line=self.event.line,
                    hint="write to another array, or use `wp.Tape(preserve='auto')`",
                )
            contents = version.contents()
            if contents is not None:
                swapped.append((version.array, copy_layout(version.array)))
                version.array.assign(contents)
        return swapped
