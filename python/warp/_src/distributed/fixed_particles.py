"""Particles of fixed capacities: migration and ghosts in captures, whose sizes never change.

Arrays have as many rows as the capacity, the first of which are points. Messages have room for a
fixed number of points, and say how many there are. Each rank notes on its device what did not fit;
`check` reads it after a replay.
"""

from __future__ import annotations

import numpy as np

import warp as wp
from warp._src.arrays.observers import Observers
from warp._src.distributed.exchanges import Exchange, Side, described_gradients
from warp._src.distributed.failures import DistributedError, DistributedValueError
from warp._src.distributed.operations import checked
from warp._src.distributed.plans import without_tape
from warp._src.types import dtypes

# Rows of the table of what was wanted, with columns by rank.
_RECEIVED, _SENT, _NEAR, _GHOSTS, _NAN = range(5)
_NO_NUMBER = wp.constant(2147483647)


@wp.kernel(module="warp.distributed", enable_backward=False)
def _leave(
    cells: wp.array(dtype=int),
    owners: wp.array(dtype=int),
    live: wp.array(dtype=int),
    rank: int,
    flags: wp.array2d(dtype=int),
    nan: wp.array(dtype=int),
):
    """Flags the points that go to another rank, by the slot of that rank."""
    i = wp.tid()
    for slot in range(flags.shape[0]):
        flags[slot, i] = 0
    if i < live[0]:
        if cells[i] < 0:
            wp.atomic_max(nan, 0, i + 1)
        else:
            to = owners[cells[i]]
            if to != rank:
                flags[wp.where(to > rank, to - 1, to), i] = 1


@wp.kernel(module="warp.distributed", enable_backward=False)
def _approach(
    cells: wp.array(dtype=int),
    around: wp.array2d(dtype=wp.uint8),
    live: wp.array(dtype=int),
    rank: int,
    flags: wp.array2d(dtype=int),
    nan: wp.array(dtype=int),
):
    """Flags the points that are ghosts of another rank, by the slot of that rank."""
    i = wp.tid()
    for slot in range(flags.shape[0]):
        flags[slot, i] = 0
        if i < live[0] and cells[i] >= 0:
            flags[slot, i] = int(around[cells[i], wp.where(slot < rank, slot, slot + 1)])
    if i < live[0] and cells[i] < 0:
        wp.atomic_max(nan, 0, i + 1)


@wp.kernel(module="warp.distributed", enable_backward=False)
def _list(
    flags: wp.array2d(dtype=int),
    before: wp.array2d(dtype=int),
    chosen: wp.array2d(dtype=int),
    counts: wp.array(dtype=int),
    wanted: wp.array(dtype=int),
):
    """Lists flagged points of each slot in their order, as many as there is room for."""
    slot, i = wp.tid()
    at = before[slot, i] - before[slot, 0]
    if flags[slot, i] == 1 and at < chosen.shape[1]:
        chosen[slot, at] = i
    if i == flags.shape[1] - 1:
        total = at + flags[slot, i]
        counts[slot] = wp.min(total, chosen.shape[1])
        wp.atomic_max(wanted, 0, total)


@wp.kernel(module="warp.distributed", enable_backward=False)
def _label(
    numbers: wp.array(dtype=int),
    flags: wp.array2d(dtype=int),
    came: wp.array2d(dtype=int),
    counts: wp.array(dtype=int),
    live: wp.array(dtype=int),
    keys: wp.array(dtype=int),
    rows: wp.array(dtype=int),
    total: wp.array(dtype=int),
):
    """Gives each row that stays or came the number of its point, and others the last one."""
    i = wp.tid()
    own = numbers.shape[0]
    key = _NO_NUMBER
    if i < own:
        stays = i < live[0]
        for slot in range(flags.shape[0]):
            if flags[slot, i] == 1:
                stays = False
        if stays:
            key = numbers[i]
    else:
        slot = (i - own) // came.shape[1]
        at = (i - own) - slot * came.shape[1]
        if at < counts[slot]:
            key = came[slot, at]
    keys[i] = key
    rows[i] = i
    if key != _NO_NUMBER:
        wp.atomic_add(total, 0, 1)


@wp.kernel(module="warp.distributed", enable_backward=False)
def _settle(
    keys: wp.array(dtype=int),
    rows: wp.array(dtype=int),
    total: wp.array(dtype=int),
    numbers: wp.array(dtype=int),
    index: wp.array(dtype=int),
    live: wp.array(dtype=int),
    wanted: wp.array(dtype=int),
):
    """Keeps the first rows in the order of their numbers, and counts points."""
    i = wp.tid()
    numbers[i] = keys[i]
    index[i] = rows[i]
    if i == 0:
        live[0] = wp.min(total[0], numbers.shape[0])
        wp.atomic_max(wanted, 0, total[0])


@wp.kernel(module="warp.distributed", enable_backward=False)
def _append(
    counts: wp.array(dtype=int),
    live: wp.array(dtype=int),
    room: int,
    index: wp.array(dtype=int),
    reach: wp.array(dtype=int),
    wanted: wp.array(dtype=int),
):
    """Lists the source of each row: own points, then ghosts by rank."""
    i = wp.tid()
    own = index.shape[0]
    if i < own:
        if i < live[0]:
            index[i] = i
    else:
        slot = (i - own) // room
        at = (i - own) - slot * room
        if at < counts[slot]:
            for other in range(slot):
                at += counts[other]
            if live[0] + at < own:
                index[live[0] + at] = i
    if i == 0:
        total = int(live[0])
        for slot in range(counts.shape[0]):
            total += counts[slot]
        reach[0] = wp.min(total, own)
        wp.atomic_max(wanted, 0, total)


class FixedParticles:
    """Points of `Particles` in arrays whose sizes never change, for steps that are captured.

    Made by `Particles.fixed`. Arrays have `capacity` rows; rows behind the points are padding,
    which kernels skip.

    Attributes:
        capacity: rows of arrays.
        moving: most points that go to another rank in a `migrate`.
        near: most ghosts of another rank.
        live: int32 array of one element on the device, the count of own points.
        reach: int32 array of one element on the device, the count of own points and ghosts.
        numbers: int32 array of `capacity` rows, global numbers of own points, in ascending order.
    """

    def __init__(self, particles, moving, near):
        self.comm = comm = particles.comm
        who = f"rank {comm.rank}: fixed particles"
        if particles.capacity is None:
            raise DistributedValueError(
                f"{who} expect a capacity: make them by `Particles(..., capacity=n)`"
            )
        self.capacity = capacity = int(particles.capacity)
        for name, one in (("moving", moving), ("near", near)):
            if one is not None and not (isinstance(one, (int, np.integer)) and one > 0):
                raise DistributedValueError(
                    f"{who} expect a positive integer {name!r}, but got {one!r}"
                )
        self.moving, self.near = (capacity if one is None else int(one) for one in (moving, near))
        if particles.numbers is None:
            raise DistributedError(f"{who}: points have no numbers yet: call `migrate` first")
        particles._check_capacity("fixed", np.array([particles.count]))
        self.particles = particles
        self.peers = [rank for rank in range(comm.size) if rank != comm.rank]
        device, slots = comm.device, len(self.peers)
        self.live = wp.array([particles.count], dtype=int, device=device)
        self.reach = wp.array([particles.count], dtype=int, device=device)
        self.numbers = wp.full(capacity, int(_NO_NUMBER), dtype=int, device=device)
        if particles.count:
            wp.copy(self.numbers, particles.numbers, 0, 0, particles.count)
        self._wanted = wp.zeros((5, 1), dtype=int, device=device)
        self._flags = wp.zeros((slots, capacity), dtype=int, device=device)
        self._before = wp.zeros_like(self._flags)
        self._total = wp.zeros(1, dtype=int, device=device)
        self._given, self._came = (wp.zeros(slots, dtype=int, device=device) for _ in range(2))
        # Captures hold no copies of them from the host.
        self._owners, self._around = particles.device_owners(), particles.device_around()
        self._chosen = self._index = None
        self._plans: dict = {}

    def padded(self, *arrays):
        """Arrays of own points, `count` rows each, with rows of zeros up to `capacity` behind.

        Returns:
            One array, or a list of several.
        """
        comm, count, found = self.comm, self.particles.count, []
        for one in arrays:
            checked(comm, "padded", one)
            if one.shape[0] != count:
                raise DistributedError(
                    f"rank {comm.rank}: padded expects {count} rows, but got {one!r}"
                )
            shape = (self.capacity, *one.shape[1:])
            y = wp.zeros(shape, dtype=one.dtype, device=one.device, requires_grad=one.requires_grad)
            if count:
                wp.copy(y[:count], one)
            found.append(y)
        return found[0] if len(found) == 1 else found

    def migrate(self, x, *arrays) -> list:
        """Sends own points to the ranks that own their cells; `live` and `numbers` change.

        Args:
            x: positions, `capacity` rows.
            arrays: values of the same points, `capacity` rows each.

        Returns:
            Arrays of `capacity` rows, of own points in the order of their numbers.
        """
        self._check("migrate", x, *arrays)
        chosen = self._choose("migrate", x, self._owners, _leave, _SENT)
        came = wp.empty((len(self.peers), self.moving), dtype=int, device=self.comm.device)
        sources = self._deliver("migrate", [x, *arrays], chosen, came)
        index = without_tape(lambda: self._order(came))
        return [_rows(one, index) for one in sources]

    def ghosts(self, x) -> None:
        """Finds the points of other ranks within the radius; `reach` is the number with ghosts."""
        self._check("ghosts", x)
        self._chosen = self._choose("ghosts", x, self._around, _approach, _GHOSTS)
        self._deliver("ghosts", [], self._chosen)
        self._index = index = wp.zeros(self.capacity, dtype=int, device=self.comm.device)
        rows = self.capacity + len(self.peers) * self.near
        inputs = [self._came, self.live, self.near, index, self.reach, self._wanted[_NEAR]]
        without_tape(lambda: wp.launch(_append, rows, inputs, device=self.comm.device))

    def halo(self, *arrays):
        """Arrays of `capacity` rows with those of ghosts behind own points, `reach` rows in all.

        Returns:
            One array, or a list of several.
        """
        if self._chosen is None:
            raise DistributedError(
                f"rank {self.comm.rank}: halo of particles without ghosts: call `ghosts` first"
            )
        self._check("halo", *arrays)
        sources = self._deliver("halo", arrays, self._chosen)
        found = [_rows(one, self._index) for one in sources]
        return found[0] if len(found) == 1 else found

    def check(self) -> int:
        """Reads the count of own points after replays, which `Particles` get; all ranks call this.

        Returns:
            The count of own points.

        Raises:
            DistributedError: since the last call points did not fit, or one had no position.
        """
        comm, particles = self.comm, self.particles
        wanted = np.array(comm.gather_objects(self._wanted.numpy()[:, 0].tolist()))
        self._wanted.zero_()
        who = f"rank {comm.rank}:"
        if wanted[:, _NAN].any():
            rank = int(wanted[:, _NAN].argmax())
            raise DistributedError(
                f"{who} migrate: point {wanted[rank, _NAN] - 1} of rank {rank} has a position that "
                "is NaN: look at forces and time step"
            )
        for kind, text, room, name in (
            (_RECEIVED, "migrate: rank {} received {}", self.capacity, "capacity"),
            (_SENT, "migrate: rank {} sent another one {}", self.moving, "moving"),
            (_NEAR, "ghosts: rank {} received {}", self.capacity, "capacity"),
            (_GHOSTS, "ghosts: rank {} sent another one {}", self.near, "near"),
        ):
            rank = int(wanted[:, kind].argmax())
            if wanted[rank, kind] > room:
                text = text.format(rank, wanted[rank, kind])
                raise DistributedError(
                    f"{who} {text} of at most {room}: raise `{name}`, or call `balance`"
                )
        particles.count = count = int(self.live.numpy()[0])
        particles.numbers, particles.ghosts_of = wp.clone(self.numbers[:count]), None
        return count

    def _check(self, name, *arrays) -> None:
        comm = self.comm
        if Observers.executor is not None:
            raise DistributedError(
                f"rank {comm.rank}: {name} of fixed particles in forward mode: use those of "
                "`Particles`"
            )
        for one in arrays:
            checked(comm, name, one)
            if one.shape[0] != self.capacity:
                raise DistributedError(
                    f"rank {comm.rank}: {name} expects arrays of {self.capacity} rows, but got "
                    f"{one!r}: use `padded`"
                )

    def _choose(self, name, x, table, kernel, kind):
        """The rows that go to each other rank; their numbers are `_given`."""
        room = self.moving if kind == _SENT else self.near
        chosen = wp.zeros((len(self.peers), room), dtype=int, device=self.comm.device)

        def run():
            device, flags, wanted = self.comm.device, self._flags, self._wanted
            cells = self.particles._cells_of(name, x)
            inputs = [cells, table, self.live, self.comm.rank, flags, wanted[_NAN]]
            wp.launch(kernel, self.capacity, inputs, device=device)
            if self.peers:
                wp.utils.array_scan(flags.flatten(), self._before.flatten(), inclusive=False)
                inputs = [flags, self._before, chosen, self._given, wanted[kind]]
                wp.launch(_list, flags.shape, inputs, device=device)

        without_tape(run)
        return chosen

    def _deliver(self, name, arrays, chosen, came=None):
        """Sends rows that were chosen.

        Args:
            came: gets the numbers of points that came, if it is given.

        Returns:
            Each array with the rows that came behind, for each rank in turn.
        """
        comm, room, device = self.comm, chosen.shape[1], self.comm.device
        index = chosen.flatten()
        sent, sources = [], []
        for x in arrays:
            like = {"dtype": x.dtype, "device": device, "requires_grad": x.requires_grad}
            sources.append(wp.empty((self.capacity + index.size, *x.shape[1:]), **like))
            wp.copy(sources[-1][: self.capacity], x)
            sent.append(_rows(x, index) if index.size else None)
        numbers = None
        if came is not None and index.size:
            numbers = without_tape(lambda: _rows(self.numbers, index))
        sides = []
        for slot, peer in enumerate(self.peers):
            part = slice(slot * room, (slot + 1) * room)
            behind = slice(self.capacity + part.start, self.capacity + part.stop)
            give = [one[part] for one in sent]
            take = [one[behind] for one in sources]
            if not arrays or came is not None:
                give.append(self._given[slot : slot + 1])
                take.append(self._came[slot : slot + 1])
            if came is not None:
                give.append(numbers[part])
                take.append(came[slot])
            sides.append(Side(peer, give, take, comm.rank, peer))
        kinds = [one.dtype for one in arrays]
        shapes = [(dtypes.type_repr(one.dtype), one.shape[1:]) for one in arrays]
        gradients = described_gradients(arrays)
        key = repr((name, shapes, gradients))
        title = f"{name} of fixed particles"
        exchange = Exchange(comm, title, sides, kinds, gradients, self._plans.get(key))
        self._plans[key] = exchange.plan
        exchange.run()
        return sources

    def _order(self, came):
        """The rows of own points after a migration, by number; padding is behind."""
        device, rows = self.comm.device, self.capacity + came.size
        keys, values = (wp.empty(2 * rows, dtype=int, device=device) for _ in range(2))
        index = wp.empty(self.capacity, dtype=int, device=device)
        self._total.zero_()
        inputs = [self.numbers, self._flags, came, self._came, self.live]
        wp.launch(_label, rows, [*inputs, keys, values, self._total], device=device)
        wp.utils.radix_sort_pairs(keys, values, rows)
        outputs = [self.numbers, index, self.live, self._wanted[_RECEIVED]]
        wp.launch(_settle, self.capacity, [keys, values, self._total, *outputs], device=device)
        return index


def _rows(x, index):
    """Rows of an array, recorded on tapes."""
    rows = wp.empty(
        (index.size, *x.shape[1:]), dtype=x.dtype, device=x.device, requires_grad=x.requires_grad
    )
    wp.copy(rows, x[index])
    return rows
