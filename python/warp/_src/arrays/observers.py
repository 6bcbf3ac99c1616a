"""Launches, copies and fills while somebody observes them.

`wp.launch`, `wp.copy`, `fill_` and `zero_` look at one flag, `Observers.active`. While it is set
they come here: memory that is about to change ends the versions of what tapes have recorded
(`versions`), a recording tape notes the operation, and an executor may run it in its own way
(forward mode computes tangents along with the values).
"""

from __future__ import annotations

import functools
import typing
import weakref

from warp import _native
from warp._src.arrays import hooks, kept, lending
from warp._src.arrays.layout import bytes_spanned
from warp._src.arrays.versions import Event, Memory, event
from warp._src.types.scalars import uint8


def copy_elements(dest, source, stream=None) -> None:
    """Copies all elements, with their tangents in forward mode; nobody observes."""
    if Observers.executor is not None:
        Observers.executor.copy(dest, source, stream)
    else:
        _native.copy_array(dest, source, stream)


def copy_layout(source, stream=None):
    """A copy with the strides of `source`, so that both have their elements at the same offsets."""
    bytes_ = hooks.plain_array(shape=bytes_spanned(source), dtype=uint8, device=source.device)
    strides = source.strides
    result = bytes_._view(0, source.shape, strides, source.dtype)
    if source.size:
        shape = [n if step else 1 for n, step in zip(source.shape, strides, strict=True)]
        target = bytes_._view(0, shape, strides, source.dtype)
        elements = source._view(0, shape, strides)
        copy_elements(target, elements, stream)
    return result


class Observers:
    """Who observes what is done with memory.

    Attributes:
        active: whether anybody does.
        tape: the tape that records, or None.
        executor: runs operations instead of the runtime, or None.
        memory: versions of what is recorded.
        timer: measures operations, or None.
    """

    active = False
    tape = None
    executor = None
    memory = Memory(copy_elements)
    timer = None
    # Weak references to those that have records, by their ids.
    _owners: typing.ClassVar[dict] = {}
    _listeners: typing.ClassVar[list] = []
    # The calls that all listeners were told of.
    _told = False

    @classmethod
    def update(cls) -> None:
        watched = cls.tape is not None or cls.executor is not None or cls.timer is not None
        cls.active = bool(cls._owners) or watched
        kept.natively = cls.executor is None
        # Tapes die at any time, also while another one is about to take its first record.
        if not cls.active:
            cls.memory.clear()
        # An interrupt may end this anywhere; the next call goes on.
        if cls.active != cls._told:
            for listener in cls._listeners:
                listener()
            cls._told = cls.active

    @classmethod
    def retain(cls, owner) -> None:
        """Keeps an eye on memory for something that has records, as long as it lives."""
        identity = id(owner)
        if identity not in cls._owners:
            drop = _native.Finalizer(functools.partial(cls._drop, identity))
            cls._owners[identity] = weakref.ref(owner, drop)
            cls.update()

    @classmethod
    def lend(cls, array) -> None:
        """Says that others get to see, and may write, an array on the CPU."""
        cls.memory.lend(array)
        if cls.tape is not None:
            lending.lend(array, cls.tape)

    @classmethod
    def release(cls, owner) -> None:
        cls._drop(id(owner))

    @classmethod
    def _drop(cls, identity) -> None:
        cls._owners.pop(identity, None)
        cls.update()

    @classmethod
    def on_change(cls, listener) -> None:
        """Calls `listener()` when `active` changes."""
        cls._listeners.append(listener)


class Observing(_native.Scope):
    """Replaces tape, executor or memory for a block."""

    def __init__(self, **changes):
        self.changes = {
            name: value for name, value in changes.items() if getattr(Observers, name) is not value
        }

    saved: typing.ClassVar[dict] = {}

    def _enter(self):
        self.saved = {name: getattr(Observers, name) for name in self.changes}
        self._set(self.changes)

    def _restore(self):
        self._set(self.saved)

    def _set(self, values):
        if not values:
            return
        for name, value in values.items():
            setattr(Observers, name, value)
        Observers.update()


def _timed(kind, name, device_of):
    """Decorator: a timer, if there is one, measures the operation."""

    def decorate(function):
        @functools.wraps(function)
        def run(*args, **kwargs):
            timer = Observers.timer
            if timer is None:
                return function(*args, **kwargs)
            work = functools.partial(function, *args, **kwargs)
            return timer.measure(kind, name(*args), device_of(*args), work)

        return run

    return decorate


@_timed(1, lambda call, *_: f"forward kernel {call.kernel.key}", lambda call, *_: call.device)
def observed_launch(call, record: bool = True) -> None:
    """Runs a launch."""
    if lending.lent:
        lending.settle()
    entry = Observers.tape.begin_launch(call) if record and Observers.tape is not None else None
    Observers.memory.launching(call)
    if Observers.executor is not None:
        Observers.executor.launch(call)
    elif entry is not None:
        entry.run()
    else:
        call.run()
    if entry is not None:
        Observers.tape.end_launch(entry)


def launch_ordinary(kernel, dim, inputs, outputs, index, block_dim, record) -> bool:
    """Runs a launch while tapes observe, and records it, in one native call.

    Returns:
        False, and nothing is done, if it takes more than that.
    """
    if lending.lent:
        lending.settle()
    known = kernel.signatures.get(kernel.native)
    if known is None:
        # The first launch that somebody observes.
        if not (isinstance(inputs, (list, tuple)) and isinstance(outputs, (list, tuple))):
            return False
        known = hooks.signature_of(kernel, kernel.native, (*inputs, *outputs))
    if known.recorder is None:
        return False
    if Observers.executor is not None or Observers.timer is not None:
        return False
    records = budget = tape = None
    if record and Observers.tape is not None:
        tape = Observers.tape
        records, budget = tape.ordinary_records()
        if records is None:
            return False
    done = _native.launch_recorded(
        known.recorder,
        Observers.memory,
        records,
        budget,
        kernel,
        dim,
        inputs,
        outputs,
        index,
        block_dim,
    )
    if done and tape is not None and len(records) == 1:
        Observers.retain(tape)
    return done


class Place:
    """Makes the event of what is going on when somebody wants it."""

    def __init__(self, what):
        self.what = what
        self._event = None

    @property
    def event(self) -> Event:
        if self._event is None:
            self._event = event(self.what)
        return self._event


def _copy_name(dest, src, *_) -> str:
    ends = [array.device for array in (src, dest)]
    if all(device.is_cpu for device in ends):
        return "memcpy"
    if all(device.is_cuda for device in ends) and ends[0] is not ends[1]:
        return "memcpy PtoP"
    return "memcpy " + "to".join("D" if device.is_cuda else "H" for device in ends)


def _copying_device(dest, src, *_):
    return src.device if dest.device.is_cpu else dest.device


@_timed(4, _copy_name, _copying_device)
def observed_copy(dest, src, stream=None) -> None:
    """Copies all elements."""
    if lending.lent:
        lending.settle()
    place = Place("copy")
    Observers.memory.writing(dest, place)
    copy_elements(dest, src, stream)
    if Observers.tape is not None:
        Observers.tape.add_copy(dest, src, place.event)


@_timed(8, lambda *_: "memset", lambda target, *_: target.device)
def observed_fill(target, pattern, name) -> None:
    """Fills an array with an element's bytes."""
    if lending.lent:
        lending.settle()
    place = Place(name)
    Observers.memory.writing(target, place)
    if Observers.executor is not None:
        Observers.executor.fill(target, pattern)
    else:
        _native.fill_array(target, pattern)
    if Observers.tape is not None:
        Observers.tape.add_fill(target, place.event)
