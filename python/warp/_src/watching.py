"""Launches, copies and fills while somebody watches them.

`wp.launch`, `wp.copy`, `fill_` and `zero_` look at one flag, `Watch.active`. While it is set they
come here: memory that is about to change ends the versions of what tapes have recorded
(`tracking`), a recording tape notes the operation, and an executor may run it in its own way
(forward mode computes tangents along with the values).
"""

from __future__ import annotations

import functools

from warp import _native
from warp._src import types
from warp._src.annotations import ArrayType
from warp._src.array import array
from warp._src.tracking import Event, Watch, event


class Call:
    """A launch with everything it was given.

    Attributes:
        kernel, native: what runs.
        dim, values, device, stream, block_dim: as passed; `device` is an index.
        event: kernel and place of the call.
    """

    __slots__ = ("__dict__", "block_dim", "device", "dim", "event", "kernel", "native", "stream")

    def __init__(self, kernel, native, dim, values, device, stream=None, block_dim=0):
        self.kernel, self.native, self.dim = kernel, native, dim
        self.values = tuple(values)
        self.device, self.stream, self.block_dim = device, stream, block_dim
        self.event = event(f"launch of '{kernel.key}'")

    @functools.cached_property
    def leaves(self) -> list[tuple[str, array | None]]:
        """Name and array for each array among the arguments, those in structs included."""
        found: list = []
        for parameter, value in zip(self.native.parameters, self.values, strict=False):
            if parameter[1] == "array":
                found.append((parameter[0], value if isinstance(value, array) else None))
            elif parameter[1] == "struct":
                found += struct_leaves(parameter[0], value)
        return found

    @functools.cached_property
    def accesses(self) -> list[tuple]:
        """(loaded, stored, combined, fetched, line) of each of them."""
        return accesses_of(self.kernel, self.native, len(self.leaves))

    @property
    def written(self) -> list[array]:
        """Arrays that the launch may change."""
        return [
            leaf
            for (_, leaf), (_, stored, combined, _, _) in zip(
                self.leaves, self.accesses, strict=True
            )
            if leaf is not None and (stored or combined)
        ]

    @property
    def active(self) -> tuple[bool, ...]:
        """Which of the arrays have a gradient."""
        return tuple(leaf is not None and leaf.grad is not None for _, leaf in self.leaves)

    def with_leaves(self, replaced: dict[int, array]) -> tuple:
        """The arguments with other arrays in some places, numbered as in `leaves`."""
        if not replaced:
            return self.values
        values, first = [], 0
        for parameter, value in zip(self.native.parameters, self.values, strict=True):
            if parameter[1] == "array":
                value = replaced.get(first, value)
                first += 1
            elif parameter[1] == "struct":
                count = len(struct_leaves("", value))
                inside = {i - first: a for i, a in replaced.items() if first <= i < first + count}
                value = replace_in_struct(value, inside) if inside else value
                first += count
            values.append(value)
        return tuple(values)

    def run(self) -> None:
        self.native.launch(self.dim, self.values, (), self.device, self.stream, self.block_dim or 0)


def accesses_of(kernel, native, count) -> list[tuple]:
    """What a native kernel does with its arrays; everything if its source is not known."""
    known = kernel.__dict__.setdefault("_known_accesses", {})
    found = known.get(native)
    if found is None:
        try:
            found = native.accesses
        except RuntimeError:
            found = [(True, True, True, False, 0)] * count
        known[native] = found
    return found


def struct_leaves(name, value) -> list[tuple[str, array | None]]:
    """The array fields of a struct and of the structs in it."""
    found: list = []
    for field, dtype in value._wp_fields_.items():
        if isinstance(dtype, ArrayType):
            found.append((f"{name}.{field}", getattr(value, field)))
        elif types.is_struct(dtype):
            found += struct_leaves(f"{name}.{field}", getattr(value, field))
    return found


def replace_in_struct(value, replaced):
    """A copy of a struct with other arrays, numbered as in `struct_leaves`."""
    result, first = value.__copy__(), 0
    for field, dtype in value._wp_fields_.items():
        if isinstance(dtype, ArrayType):
            if first in replaced:
                setattr(result, field, replaced[first])
            first += 1
        elif types.is_struct(dtype):
            inner = getattr(value, field)
            count = len(struct_leaves("", inner))
            inside = {i - first: a for i, a in replaced.items() if first <= i < first + count}
            if inside:
                setattr(result, field, replace_in_struct(inner, inside))
            first += count
    return result


def watched_launch(call: Call, record: bool = True) -> None:
    """Runs a launch."""
    entry = Watch.tape.begin_launch(call) if record and Watch.tape is not None else None
    for written in call.written:
        Watch.memory.writing(written, lambda: call.event)
    if Watch.executor is not None:
        Watch.executor.launch(call)
    elif entry is not None:
        entry.run()
    else:
        call.run()
    if entry is not None:
        Watch.tape.end_launch(entry)


def watched_copy(dest, src, stream=None) -> None:
    """Copies all elements."""
    place = event("copy")
    Watch.memory.writing(dest, lambda: place)
    if Watch.executor is not None:
        Watch.executor.copy(dest, src, stream)
    else:
        _native.copy_array(dest, src, stream)
    if Watch.tape is not None:
        Watch.tape.add_copy(dest, src, place)


def watched_fill(target, pattern, name) -> None:
    """Fills an array with an element's bytes."""
    place: Event = event(name)
    Watch.memory.writing(target, lambda: place)
    if Watch.executor is not None:
        Watch.executor.fill(target, pattern)
    else:
        _native.fill_array(target, pattern)
    if Watch.tape is not None:
        Watch.tape.add_fill(target, place)
