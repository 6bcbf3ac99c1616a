"""Blocks: grids in 1 to 4 dimensions split over ranks, with ghost cells.

Each rank owns a block and keeps `width` layers of its neighbours' cells around it. A halo exchange
sends one message to each neighbour, edges and corners included, so all of it may travel while
the interior is computed.
"""

from __future__ import annotations

import itertools
import math
import operator
import typing

import numpy as np

import warp as wp
from warp._src.arrays.hooks import captures
from warp._src.arrays.observers import Observers
from warp._src.distributed import forward
from warp._src.distributed.communicator import Message, flat, resolve
from warp._src.distributed.exchanges import (
    Exchange,
    Side,
    Work,
    described_gradients,
    gradient_places,
)
from warp._src.distributed.failures import DistributedError, DistributedValueError
from warp._src.distributed.operations import checked, rows_of
from warp._src.distributed.plans import without_tape
from warp._src.types import dtypes

# Exchanges of fields that are kept with their buffers.
_MOST_KEPT = 64


class Box(typing.NamedTuple):
    """Cells of a block: the first one, in local indices, and extents."""

    start: tuple
    shape: tuple

    @property
    def slices(self) -> tuple:
        """The cells as slices of a field."""
        return tuple(slice(a, a + n) for a, n in zip(self.start, self.shape, strict=True))

    @property
    def size(self) -> int:
        """How many cells there are."""
        return math.prod(self.shape)


class Shell(list):
    """The boxes of a block whose cells read ghosts.

    Attributes:
        device: where `cells` is.
    """

    device = None
    _cells = None

    @property
    def cells(self):
        """Local indices of all cells, for one launch over `len(shell.cells)` threads."""
        if self._cells is None:
            ranges = [
                [range(a, a + n) for a, n in zip(box.start, box.shape, strict=True)] for box in self
            ]
            found = [cell for axes in ranges for cell in itertools.product(*axes)]
            ndim = len(self[0].shape) if self else 1
            kind = wp.types.vector(ndim, wp.int32)
            data = np.array(found, np.int32).reshape(-1, ndim)
            self._cells = wp.array(data, dtype=kind, device=self.device)
        return self._cells


def choose_ranks(shape, size, width, periodic) -> tuple:
    """Ranks along each axis: the fewest ghost cells of the largest block.

    Raises:
        DistributedValueError: no split gives each rank `width` cells along each axis.
    """
    best = None
    for ranks in _factors(size, len(shape)):
        if any(n // r < max(w, 1) for n, r, w in zip(shape, ranks, width, strict=True)):
            continue
        extents = [-(-n // r) for n, r in zip(shape, ranks, strict=True)]
        ghosts = 0
        for axis, (extent, count) in enumerate(zip(extents, ranks, strict=True)):
            if count > 1 or periodic[axis]:
                ghosts += 2 * width[axis] * math.prod(extents) // extent
        if best is None or ghosts < best[0]:
            best = ghosts, ranks
    if best is None:
        raise DistributedValueError(
            f"Blocks: {size} ranks have no blocks of at least {max(width)} cells along each axis "
            f"of {tuple(shape)}: use fewer ranks, a smaller width or more cells"
        )
    return best[1]


def _factors(size, ndim):
    """All products of `ndim` numbers, those with large first factors first."""
    if ndim == 1:
        yield (size,)
        return
    for first in range(size, 0, -1):
        if size % first == 0:
            for others in _factors(size // first, ndim - 1):
                yield (first, *others)


def _integers(who, name, given) -> tuple:
    """Integers as they are given, not rounded."""
    try:
        return tuple(operator.index(one) for one in given)
    except TypeError:
        raise DistributedValueError(
            f"{who} expects integers as {name}, but got {tuple(given)}"
        ) from None


class Blocks:
    """A grid whose cells are split over ranks.

    Args:
        shape: cells along each axis, 1 to 4.
        width: layers of ghost cells; one number, or one for each axis.
        periodic: whether the grid is; one value, or one for each axis.
        ranks: ranks along each axis, by default those with the fewest ghosts.
        comm: by default that of `wd.init`.
        corners: exchange edges and corners, too; stencils along axes need none.

    Attributes:
        shape, width, periodic, ranks: as above, for each axis.
        coordinates: of this rank among `ranks`.
        offset: the first cell that this rank owns, in the whole grid.
        owned: extents of its cells.
        local: the same with ghosts; a field has this shape.
        interior: a `Box` of the cells that read no ghosts.
        shell: boxes of the others; `shell.cells` are their indices for one launch.

    Raises:
        DistributedValueError: a block would have fewer cells than `width`, or extents do not fit.
    """

    def __init__(self, shape, width=1, periodic=False, ranks=None, comm=None, corners=True):
        self.comm = resolve(comm)
        who = f"rank {self.comm.rank}: Blocks"
        self.shape = _integers(who, "shape", shape if hasattr(shape, "__len__") else (shape,))
        ndim = len(self.shape)
        self.ndim = ndim
        if not 1 <= ndim <= 4 or min(self.shape) < 1:
            raise DistributedValueError(
                f"{who} expects 1 to 4 extents of at least one cell, but got {self.shape}"
            )
        self.width = _integers(
            who, "width", width if hasattr(width, "__len__") else (width,) * ndim
        )
        self.periodic = tuple(periodic) if hasattr(periodic, "__len__") else (periodic,) * ndim
        if len(self.width) != ndim or len(self.periodic) != ndim or min(self.width) < 0:
            raise DistributedValueError(
                f"{who} expects a width of at least 0 and a periodicity for each of {ndim} axes, "
                f"but got {self.width} and {self.periodic}"
            )
        self.ranks = self._checked_ranks(who, ranks)
        self.coordinates = tuple(int(k) for k in np.unravel_index(self.comm.rank, self.ranks))
        ends = [
            rows_of(n, k, r)
            for n, k, r in zip(self.shape, self.coordinates, self.ranks, strict=True)
        ]
        self.offset = tuple(a for a, _ in ends)
        self.owned = tuple(b - a for a, b in ends)
        self.local = tuple(n + 2 * w for n, w in zip(self.owned, self.width, strict=True))
        self.corners = corners
        self.interior, self.shell = self._split_owned()
        self.directions = self._find_directions()
        self._exchanges: dict = {}
        # Native functions of exchanges that need no Python, by the field's id.
        self._quick: dict = {}
        self._plans: dict = {}

    def _checked_ranks(self, who, ranks) -> tuple:
        size = self.comm.size
        if ranks is None:
            try:
                return choose_ranks(self.shape, size, self.width, self.periodic)
            except DistributedValueError as problem:
                raise DistributedValueError(f"rank {self.comm.rank}: {problem}") from None
        ranks = tuple(ranks)
        if len(ranks) != self.ndim or math.prod(ranks) != size:
            raise DistributedValueError(
                f"{who} expects {self.ndim} numbers of ranks with product {size}, but got {ranks}"
            )
        for axis, (n, r, w) in enumerate(zip(self.shape, ranks, self.width, strict=True)):
            if n // r < max(w, 1):
                raise DistributedValueError(
                    f"{who}: {n} cells over {r} ranks along axis {axis} leave {n // r} for a rank, "
                    f"fewer than the width {w}: use fewer ranks or a smaller width"
                )
        return ranks

    def rank_at(self, coordinates):
        """The rank of coordinates among `ranks`, None beyond a border that is not periodic."""
        found = []
        for k, r, wraps in zip(coordinates, self.ranks, self.periodic, strict=True):
            if not 0 <= k < r and not wraps:
                return None
            found.append(k % r)
        return int(np.ravel_multi_index(found, self.ranks))

    def _split_owned(self):
        starts, ends = [], []
        for axis in range(self.ndim):
            sides = []
            for step in (-1, 1):
                k = list(self.coordinates)
                k[axis] += step
                sides.append(self.width[axis] if self.rank_at(k) is not None else 0)
            starts.append(self.width[axis] + sides[0])
            ends.append(self.width[axis] + self.owned[axis] - sides[1])
        shell = Shell()
        shell.device = self.comm.device
        first = list(self.width)
        last = [w + n for w, n in zip(self.width, self.owned, strict=True)]
        if any(b <= a for a, b in zip(starts, ends, strict=True)):
            shell.append(Box(tuple(first), self.owned))
            return Box(tuple(first), (0,) * self.ndim), shell
        interior = Box(tuple(starts), tuple(b - a for a, b in zip(starts, ends, strict=True)))
        for axis in range(self.ndim):
            for a, b in ((first[axis], starts[axis]), (ends[axis], last[axis])):
                if b > a:
                    low, high = list(first), list(last)
                    low[axis], high[axis] = a, b
                    extents = tuple(v - u for u, v in zip(low, high, strict=True))
                    shell.append(Box(tuple(low), extents))
            first[axis], last[axis] = starts[axis], ends[axis]
        return interior, shell

    def _find_directions(self) -> list:
        found = []
        for direction in itertools.product((-1, 0, 1), repeat=self.ndim):
            steps = sum(map(abs, direction))
            if not steps or (steps > 1 and not self.corners):
                continue
            if any(d and not w for d, w in zip(direction, self.width, strict=True)):
                continue
            there = [k + d for k, d in zip(self.coordinates, direction, strict=True)]
            peer = self.rank_at(there)
            if peer is not None:
                found.append((direction, peer))
        return found

    # Fields.

    def zeros(self, dtype: typing.Any = float, items=None, requires_grad=False):
        """A field of zeros, with ghosts; `items` is the extent of a leading axis."""
        shape = self.local if items is None else (items, *self.local)
        return wp.zeros(shape, dtype=dtype, device=self.comm.device, requires_grad=requires_grad)

    def inner(self, x):
        """The cells of a field that this rank owns, as a view."""
        own = Box(self.width, self.owned).slices
        return x[(slice(None), *own)] if x.ndim > self.ndim else x[own]

    def halo(self, *fields, items=None) -> None:
        """Fills the ghosts of fields with the values of their owners.

        On a tape the adjoints of ghosts go home, are added there, and are zero then.

        Args:
            fields: arrays with the shape of `local`, and perhaps a leading axis.
            items: which entries of the leading axis travel: indices, or for each entry its velocity
                (an array of `ndim` columns), so that those travel that cross a face.
        """
        # Small messages take a microsecond in all.
        alone = len(fields) == 1 and items is None and not Observers.active and not captures
        if alone and (quick := self._quick.get(id(fields[0]))) and not self.comm.closed:
            if found := quick():
                self._exchanges[id(fields[0]), None].settle(found)
            return
        exchange = self._exchange("halo", fields, items)
        exchange.run()
        if alone and (quick := exchange.quick()):
            self._quick[id(fields[0])] = quick

    def push(self, *fields) -> None:
        """Adds the values of ghosts to their owners' cells; ghosts keep theirs.

        The adjoint is that of `halo`: ghosts' values get the adjoints of their owners.
        """
        from warp._src.distributed.pushes import push

        push(self, fields)

    def overlap(self, *fields, items=None):
        """A block in which the halo of fields travels: compute what needs no ghosts in it."""
        return _Overlap(self._exchange("halo", fields, items))

    def _exchange(self, name, fields, items):
        if Observers.executor is not None:
            for number, one in enumerate(fields):
                self._check_field(name, number, one)
            return forward.with_tangents(fields, lambda all_: self._exchange(name, all_, items))
        key = (*map(id, fields), None if items is None else id(items))
        if name != "halo":
            key = name, *key
        found = self._exchanges.get(key)
        if found is not None and (Observers.tape is None or found.suits(fields)):
            return found
        if not fields:
            raise DistributedValueError(f"rank {self.comm.rank}: {name} expects a field")
        self.comm.check_use(name)
        for number, one in enumerate(fields):
            self._check_field(name, number, one)
            self._check_items(name, number, one, items)
        sides = without_tape(lambda: self._sides(fields, items))
        text = name if len(fields) == 1 else f"{name} of {len(fields)} fields"
        described = tuple(
            (dtypes.type_repr(one.dtype), one.shape[: one.ndim - self.ndim]) for one in fields
        )
        recorded = described_gradients(fields)
        symmetric = repr((name, described, _items_key(items), recorded, forward.Along.count))
        kinds = [one.dtype for one in fields]
        exchange = Exchange(self.comm, text, sides, kinds, recorded, self._plans.get(symmetric))
        self._plans[symmetric] = exchange.plan
        exchange.gradient_places = gradient_places(fields)
        # The key stays that of these objects.
        exchange.fields = fields, items
        while len(self._exchanges) >= _MOST_KEPT:
            oldest = next(iter(self._exchanges))
            del self._exchanges[oldest]
            self._quick.pop(oldest[0], None)
        self._quick.pop(key[0], None)
        self._exchanges[key] = exchange
        return exchange

    def _check_field(self, name, number, x) -> None:
        who = f"{name}, field {number}"
        self._check_shape(who, x)
        if x.read_only:
            raise DistributedError(
                f"rank {self.comm.rank}: {who} is read-only, but its ghosts are written: use "
                "`wp.clone(x)`"
            )

    def _check_shape(self, who, x) -> None:
        checked(self.comm, who, x)
        if x.ndim not in (self.ndim, self.ndim + 1) or x.shape[x.ndim - self.ndim :] != self.local:
            raise DistributedError(
                f"rank {self.comm.rank}: {who} has shape {x.shape}, but blocks with ghosts have "
                f"{self.local}: make it by `blocks.zeros`"
            )

    def _check_items(self, name, number, x, items) -> None:
        if items is None or x.ndim == self.ndim:
            return
        given, count = np.asarray(items), x.shape[0]
        if given.ndim == 1 and given.size and not 0 <= given.min() <= given.max() < count:
            problem = f"{given.tolist()}: indices are below {count}"
        elif given.ndim != 1 and given.shape[1:] != (self.ndim,):
            problem = f"an array of shape {given.shape}: velocities have {self.ndim} columns"
        else:
            return
        raise DistributedValueError(
            f"rank {self.comm.rank}: {name}, field {number} has {count} entries in front, but "
            f"`items` is {problem}"
        )

    def _sides(self, fields, items) -> list:
        sides = []
        for direction, peer in self.directions:
            give, take = [], []
            for one in fields:
                lead = one.ndim > self.ndim
                chosen = _crossing(items, direction, one.shape[0]) if lead else [None]
                there = (
                    _crossing(items, tuple(-d for d in direction), one.shape[0]) if lead else [None]
                )
                give += self._parts(one, direction, chosen, True)
                take += self._parts(one, direction, there, False)
            code = _code(direction)
            back = _code(tuple(-d for d in direction))
            sides.append(Side(peer, give, take, code, back))
        return sides

    def _parts(self, x, direction, chosen, given) -> list:
        """Views of the cells that go in a direction, or of ghosts there."""
        slices = []
        for d, w, n in zip(direction, self.width, self.owned, strict=True):
            if d == 0:
                slices.append(slice(w, w + n))
            elif given:
                slices.append(slice(w, 2 * w) if d < 0 else slice(n, n + w))
            else:
                slices.append(slice(0, w) if d < 0 else slice(w + n, 2 * w + n))
        if chosen == [None]:
            return [x[tuple(slices)]]
        if chosen is None:
            return [x[(slice(None), *slices)]]
        return [x[(int(item), *slices)] for item in chosen]

    # All cells.

    def gather(self, x, root=0) -> typing.Any:
        """The whole field on one rank, as a NumPy array without ghosts; None on the others."""
        self._check_shape("gather", x)
        own = without_tape(lambda: self.inner(x).contiguous())
        messages, parts = [], {}
        if self.comm.rank == root:
            for peer in range(self.comm.size):
                box = self._box_of(peer)
                shape = (*x.shape[: x.ndim - self.ndim], *box.shape)
                parts[peer] = wp.empty(shape, dtype=x.dtype, device=x.device)
                messages.append(Message(peer, own if peer == root else None, parts[peer], 0, 0))
        else:
            messages.append(Message(root, own, None, 0, 0))
        self._move("gather", messages)
        if self.comm.rank != root:
            return None
        whole = None
        for peer, part in parts.items():
            values = part.numpy()
            if whole is None:
                lead, inner = values.shape[: x.ndim - self.ndim], values.shape[x.ndim :]
                whole = np.empty((*lead, *self.shape, *inner), values.dtype)
            whole[(*(slice(None),) * (x.ndim - self.ndim), *self._box_of(peer).slices)] = values
        return whole

    def scatter(self, data, x, root=0) -> None:
        """Copies a NumPy array of all cells on one rank to the owners' cells of a field."""
        self._check_field("scatter", 0, x)
        lead, problem = x.ndim - self.ndim, None
        if self.comm.rank == root:
            data, whole = np.asarray(data), (*x.shape[:lead], *self.shape)
            if data.shape[: x.ndim] != whole:
                problem = f"data of shape {data.shape}, but all cells of the field are {whole}"
        if problem := self.comm.broadcast_object(problem, root):
            raise DistributedError(
                f"rank {self.comm.rank}: scatter: rank {root} gives {problem}: pass the values of "
                "the whole grid there"
            )
        own = wp.empty((*x.shape[:lead], *self.owned), dtype=x.dtype, device=x.device)
        messages = [Message(root, None, own, 0, 0)]
        if self.comm.rank == root:
            messages = []
            for peer in range(self.comm.size):
                part = np.ascontiguousarray(
                    data[(*(slice(None),) * lead, *self._box_of(peer).slices)]
                )
                give = wp.array(part, dtype=x.dtype, device=x.device)
                messages.append(Message(peer, give, own if peer == root else None, 0, 0))
        self._move("scatter", messages)
        wp.copy(self.inner(x), own)

    def _box_of(self, rank) -> Box:
        k = np.unravel_index(rank, self.ranks)
        ends = [rows_of(n, int(i), r) for n, i, r in zip(self.shape, k, self.ranks, strict=True)]
        return Box(tuple(a for a, _ in ends), tuple(b - a for a, b in ends))

    def _move(self, name, messages) -> None:
        self.comm.check_use(name)
        packed = [
            one._replace(
                give=None if one.give is None else flat(one.give, wp.uint8),
                take=None if one.take is None else flat(one.take, wp.uint8),
            )
            for one in messages
        ]
        work = Work(self.comm, name, packed)
        work.start()
        work.finish()
        if work.engine is not None:
            work.engine.free()


class _Overlap:
    """Sends at its beginning, waits at its end."""

    def __init__(self, exchange):
        self.exchange = exchange

    def __enter__(self):
        self.exchange.start()
        return self

    def __exit__(self, kind, *_):
        if kind is None:
            self.exchange.finish()


def _items_key(items):
    return None if items is None else np.asarray(items).tolist()


def _code(direction) -> int:
    """A number for a direction."""
    code = 0
    for d in direction:
        code = 3 * code + d + 1
    return code


def _crossing(items, direction, count):
    """The entries of a leading axis that travel in a direction; None for all."""
    if items is None:
        return None
    items = np.asarray(items)
    if items.ndim == 1:
        return items.tolist()
    return [
        k
        for k in range(min(count, len(items)))
        if all(int(c) * d > 0 for c, d in zip(items[k], direction, strict=True) if d)
    ]
