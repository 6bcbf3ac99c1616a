"""Work of libraries that is neither a launch nor a copy, as tapes and forward mode see it."""

from __future__ import annotations

import typing

from warp import _native
from warp._src.argument_kinds import CALLABLE, LIST, TEXT, offers
from warp._src.arguments import checked
from warp._src.arrays.observers import Observers, Observing, Place

if typing.TYPE_CHECKING:
    from collections.abc import Callable, Sequence


def is_recording() -> bool:
    """True if a tape records in this program.

    Example:
        >>> import warp as wp
        >>> from warp import extend
        >>> extend.is_recording()
        False
        >>> with wp.Tape():
        ...     extend.is_recording()
        True
    """
    return Observers.tape is not None


def is_differentiating() -> bool:
    """True if a tape records or forward mode runs: then work has to be done by launches and copies,
    or be recorded by `record_adjoint`.

    Example:
        >>> from warp import extend
        >>> extend.is_differentiating()
        False
    """
    return Observers.tape is not None or Observers.executor is not None


@checked(backward=CALLABLE, arrays=LIST)
def record_adjoint(backward: Callable[[], None], arrays: Sequence) -> bool:
    """Puts the adjoint of work on the tape that records.

    Do the work itself within `unrecorded()`, so that the tape does not see its launches.

    Args:
        backward: is called in the backward pass, without arguments, where it is this record's turn.
            It reads the gradients of the arrays that the work has written and adds to those of
            the arrays that it has read.
        arrays: arrays and structs, of any shape, whose gradients take part.

    Returns:
        False if no tape records; `backward` is not called then.

    Example:
        >>> import warp as wp
        >>> from warp import extend
        >>> def cube(x, y):
        ...     def backward():
        ...         seeds, values = y.grad.numpy(), x.numpy()
        ...         x.grad.assign(x.grad.numpy() + 3.0 * seeds * values * values)
        ...     extend.record_adjoint(backward, [x, y])
        ...     with extend.unrecorded():
        ...         y.assign(x.numpy() ** 3)
        >>> x = wp.array([2.0], dtype=wp.float64, requires_grad=True, device="cpu")
        >>> y = wp.zeros_like(x)
        >>> with wp.Tape() as tape:
        ...     cube(x, y)
        >>> tape.backward(grads={y: wp.ones_like(y)})
        >>> x.grad.numpy().tolist()
        [12.0]
    """
    tape = Observers.tape
    if tape is not None:
        tape.add_function(backward, arrays)
    return tape is not None


def unrecorded() -> _native.Scope:
    """A `with` block in which no tape records; forward mode goes on.

    Example:
        >>> import warp as wp
        >>> from warp import extend
        >>> with wp.Tape() as tape, extend.unrecorded():
        ...     extend.is_recording()
        False
    """
    return Observing(tape=None)


@checked(timer=offers("a timer (an object with `measure`)", "measure"))
def measured_by(timer) -> _native.Scope:
    """A `with` block whose launches, copies and fills a timer runs.

    Args:
        timer: has `measure(kind, name, device, work)`, which calls `work()` and returns its result.
            `kind` is 1 for launches, 4 for copies and 8 for fills; `device` is the device, or its
            index for a launch.

    Example:
        >>> import warp as wp
        >>> from warp import extend
        >>> class Names:
        ...     def measure(self, kind, name, device, work):
        ...         print(kind, name)
        ...         return work()
        >>> x = wp.empty(3, device="cpu")
        >>> with extend.measured_by(Names()):
        ...     x.fill_(1.0)
        8 memset
    """
    return Observing(timer=timer)


@checked(operation=TEXT)
def note_writes(operation: str, *targets) -> None:
    """Says that arrays are about to be written by other means than launches and copies of the
    package: values that tapes have recorded of them are kept or become errors.

    Args:
        operation: its name, for messages.
        targets: the arrays, of any shape and type.

    Raises:
        ValueError: one of them is read-only.

    Example:
        >>> import warp as wp
        >>> from warp import extend
        >>> x = wp.zeros(3, device="cpu")
        >>> extend.note_writes("solve", x)
    """
    for target in targets:
        target._check_writable(operation)
    if Observers.active:
        for target in targets:
            Observers.memory.writing(target, Place(operation))
