"""A launch with everything it was given, and what is known of its kernel's arrays."""

from __future__ import annotations

import copy
import ctypes
import functools

from warp import _native
from warp._src import errors
from warp._src.arrays import hooks
from warp._src.arrays.array import array
from warp._src.arrays.indexed import IndexedRecord, indexedarray
from warp._src.arrays.versions import Event, event
from warp._src.types import dtypes
from warp._src.types.native import ArrayType
from warp._src.types.struct_fields import ArrayDescriptor
from warp._src.types.structs import StructInstance


class Signature:
    """The array arguments of a native kernel, numbered with those in structs.

    Attributes:
        parameters: (name, kind, ...) of each parameter.
        accesses: (loaded, stored, combined, fetched, line) of each array.
        written: numbers of the arrays that a launch may change.
        mutable: positions of structs and composites.
        looks_back: whether an array is loaded and changed, or results of atomics matter.
        has_source: whether it is known what the kernel does; if not, all counts as written.
    """

    def __init__(self, native, values, has_regions=True):
        self._native = native
        self._has_regions = has_regions
        self.parameters = native.parameters
        self.flat = all(kind != "struct" for _, kind, *_ in self.parameters)
        self.mutable = [
            i for i, (_, kind, *_) in enumerate(self.parameters) if kind in ("struct", "composite")
        ]
        self.arrays = [
            (i, name) for i, (name, kind, *_) in enumerate(self.parameters) if kind == "array"
        ]
        try:
            self.accesses = native.accesses
            self.has_source = True
        except RuntimeError:
            # Saved code without source.
            self.has_source = False
            count = len(leaves_of(self.parameters, values))
            self.accesses = [(True, True, True, False, 0)] * count
        self.written = [i for i, access in enumerate(self.accesses) if access[1] or access[2]]
        self.fetches = any(access[3] for access in self.accesses)
        self.looks_back = self.fetches or any(self.accesses[i][0] for i in self.written)

    @functools.cached_property
    def region_finder(self):
        """Finds which elements of arrays a launch touches; made when that is first asked."""
        known = self.has_source and self._has_regions
        return _native.RegionFinder(self._native) if known else None

    @functools.cached_property
    def recorder(self):
        """Launches the kernel while somebody observes; None if Python has to do that."""
        if not (self.has_source and self._has_regions):
            return None
        fields = None if self.flat else array_fields(self.parameters)
        if fields is None and not self.flat:
            return None
        made = _native.LaunchRecorder(self._native, fields)
        return made if made.is_eligible else None


class Call:
    """A launch with everything it was given.

    Attributes:
        kernel, native: what runs.
        dim, values, device, stream, block_dim: as passed; `device` is an index.
        originals: structs that `values` has copies of.
    """

    __slots__ = (
        *("_event", "_leaves", "_regions", "block_dim", "device", "dim", "kernel", "native"),
        *("originals", "signature", "stream", "values"),
    )

    def __init__(self, kernel, native, dim, values, device, stream=None, block_dim=0):
        self.kernel, self.native, self.dim = kernel, native, dim
        self.values = tuple(values)
        self.device, self.stream, self.block_dim = device, stream, block_dim
        self._event = self._leaves = self._regions = None
        self.originals: list = []
        self.signature = signature_of(kernel, native, self.values)
        if not self.signature.flat:
            self.values = self._structs()

    @property
    def event(self) -> Event:
        """The kernel and the place of the call; asked for first where the call happens."""
        if self._event is None:
            self._event = event(f"launch of '{self.kernel.key}'")
        return self._event

    @property
    def leaves(self) -> list[tuple[str, array | None]]:
        """Name and array for each array among the arguments, those in structs included."""
        if self._leaves is None:
            known, values = self.signature, self.values
            if known.flat:
                self._leaves = [
                    (name, values[i] if isinstance(values[i], array) else None)
                    for i, name in known.arrays
                ]
            else:
                self._leaves = leaves_of(known.parameters, values)
        return self._leaves

    @property
    def regions(self):
        """The access regions of the launch for each of them; forgotten by `done`.

        None if the kernel has no source to tell, or arrays are given as descriptors of ctypes.
        """
        finder = self.signature.region_finder
        if self._regions is None and finder is not None:
            if any(isinstance(value, ArrayDescriptor) for value in self.values):
                return None
            self._regions = finder.find(self.dim, self.values, self.device)
        return self._regions

    def done(self) -> None:
        """Called when nobody will ask for regions any more."""
        self._regions = None

    @property
    def accesses(self) -> list[tuple]:
        """(loaded, stored, combined, fetched, line) of each of them."""
        return self.signature.accesses

    @property
    def written(self) -> list[array]:
        """Arrays that the launch may change."""
        leaves = self.leaves
        return [leaves[i][1] for i in self.signature.written if leaves[i][1] is not None]

    @property
    def active(self) -> tuple[bool, ...]:
        """Flags of the arrays that have a gradient, or are going to."""
        return tuple([leaf is not None and leaf.requires_grad for _, leaf in self.leaves])

    def with_leaves(self, replaced: dict[int, array]) -> tuple:
        """The arguments with other arrays in some places, numbered as in `leaves`."""
        if not replaced:
            return self.values
        values, first = [], 0
        for parameter, value in zip(self.signature.parameters, self.values, strict=True):
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

    def settled(self) -> Call:
        """Exchanges values that the caller may change later for copies.

        Raises:
            WarpLaunchError: an array was given as a ctypes object, which does not hold its memory.
        """
        for i, name in self.signature.arrays:
            if isinstance(self.values[i], ctypes.Structure):
                raise errors.WarpLaunchError(
                    f"launch('{self.kernel.key}'): array '{name}' was set from a ctypes object and "
                    f"cannot be recorded on a tape, set the array itself"
                )
        if self.signature.mutable:
            values = list(self.values)
            for i in self.signature.mutable:
                if isinstance(values[i], StructInstance):
                    self.originals.append(values[i])
                values[i] = copy.copy(values[i])
            self.values = tuple(values)
            self._leaves = None
        return self

    def other(self, native, values) -> Call:
        """A launch of another native kernel in the same place."""
        made = Call(self.kernel, native, self.dim, values, self.device, self.stream, self.block_dim)
        made._event = self._event
        return made

    def _structs(self) -> tuple:
        """The arguments with structs in place of indexed arrays."""
        values = []
        for parameter, value in zip(self.signature.parameters, self.values, strict=False):
            if parameter[1] == "struct":
                value = struct_of(value, parameter[2])
                if getattr(value, "_native_", "") != parameter[2]:
                    # Raises what says so.
                    self.run()
            values.append(value)
        return (*values, *self.values[len(values) :])

    def run(self) -> None:
        """Runs the launch as it is."""
        self.native.launch(self.dim, self.values, (), self.device, self.stream, self.block_dim or 0)


def struct_of(value, native=""):
    """The struct that an argument stands for, as an indexed array does; others as they are.

    native: text of the parameter's type; None stands for an indexed array without elements.
    """
    if value is None and native:
        dtype = dtypes.dtype_of(native)
        return dtype() if issubclass(dtype, IndexedRecord) else None
    return value.__ctype__() if isinstance(value, indexedarray) else value


def leaves_of(parameters, values) -> list[tuple[str, array | None]]:
    """Name and array for each array among arguments, those in structs included."""
    found: list = []
    for parameter, value in zip(parameters, values, strict=False):
        if parameter[1] == "array":
            found.append((parameter[0], value if isinstance(value, array) else None))
        elif parameter[1] == "struct":
            found += struct_leaves(parameter[0], struct_of(value, parameter[2]))
    return found


def signature_of(kernel, native, values) -> Signature:
    """The facts about a native kernel."""
    known = kernel.signatures
    found = known.get(native)
    if found is None:
        if len(known) >= 64:
            known.clear()
        found = known[native] = Signature(native, values, kernel.has_regions)
    return found


hooks.signature_of = signature_of


def struct_leaves(name, value) -> list[tuple[str, array | None]]:
    """The array fields of a struct and of the structs in it."""
    found: list = []
    for field, dtype in value._wp_fields_.items():
        if isinstance(dtype, ArrayType):
            found.append((f"{name}.{field}", getattr(value, field)))
        elif dtypes.is_struct(dtype):
            found += struct_leaves(f"{name}.{field}", value._inner(field))
    return found


def array_fields(parameters) -> list[tuple] | None:
    """(position, class, field) of each array among parameters, with None where it is in no struct.

    None if a struct is in another one, or stands for what users pass as something else.
    """
    found: list = []
    for position, parameter in enumerate(parameters):
        if parameter[1] == "array":
            found.append((position, None, None))
        elif parameter[1] == "struct":
            dtype = dtypes.dtype_of(parameter[2])
            if issubclass(dtype, IndexedRecord):
                return None
            for field, kind in dtype._wp_fields_.items():
                if isinstance(kind, ArrayType):
                    found.append((position, dtype, field))
                elif dtypes.is_struct(kind):
                    return None
    return found


def replace_in_struct(value, replaced):
    """A copy of a struct with other arrays, numbered as in `struct_leaves`."""
    result, first = value.__copy__(), 0
    for field, dtype in value._wp_fields_.items():
        if isinstance(dtype, ArrayType):
            if first in replaced:
                setattr(result, field, replaced[first])
            first += 1
        elif dtypes.is_struct(dtype):
            inner = value._inner(field)
            count = len(struct_leaves("", inner))
            inside = {i - first: a for i, a in replaced.items() if first <= i < first + count}
            if inside:
                setattr(result, field, replace_in_struct(inner, inside))
            first += count
    return result
