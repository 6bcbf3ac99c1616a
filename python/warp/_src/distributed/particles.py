"""Particles: points that move between ranks, with ghosts within a radius.

Space is cut into cells no smaller than the radius, each of which belongs to one rank. Cells are
dealt out along a Hilbert curve, by the particles in them, so that ranks have equal loads and
compact parts. A particle belongs to the owner of its cell and is a ghost of the owners of cells
around.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

import warp as wp
from warp._src.arrays.observers import Observers, Observing
from warp._src.distributed import forward
from warp._src.distributed.communicator import flat, resolve
from warp._src.distributed.curves import hilbert_keys
from warp._src.distributed.failures import DistributedError, DistributedValueError
from warp._src.distributed.graphs import Neighbours, _take
from warp._src.distributed.operations import (
    _is_recorded,
    _Movement,
    _plan,
    _row_bytes,
    checked,
)
from warp._src.distributed.plans import without_tape
from warp._src.types import dtypes

# Most cells along an axis, by the number of axes.
_MOST_CELLS = {1: 1 << 16, 2: 512, 3: 64}


@wp.kernel(module="warp.distributed", enable_backward=False)
def _find_cells(
    x: wp.array2d(dtype=Any),
    ndim: int,
    low: wp.vec3d,
    scale: wp.vec3d,
    extents: wp.vec3i,
    cells: wp.array(dtype=int),
):
    """The cell of each position; those outside count to the nearest, NaN is -1."""
    i = wp.tid()
    cell = int(0)
    for axis in range(ndim):
        at = (wp.float64(x[i, axis]) - low[axis]) * scale[axis]
        if wp.isnan(at) or cell < 0:
            cell = -1
        else:
            most = wp.float64(extents[axis] - 1)
            cell = cell * extents[axis] + int(wp.clamp(wp.floor(at), wp.float64(0.0), most))
    cells[i] = cell


def _are_loads(weights, count) -> bool:
    weights = np.asarray(weights, float)
    return weights.shape == (count,) and bool((np.isfinite(weights) & (weights >= 0)).all())


class Particles:
    """Points split over ranks by where they are.

    Args:
        bounds: (low, high), corners of the box that is divided, of 1 to 3 coordinates. Points
            outside count to the nearest cell.
        radius: reach of interactions: ghosts are all points that may be so near.
        comm: by default that of `wd.init`.
        by: "hilbert", or "slabs" along the first axis.
        capacity: most points of a rank after a migration, own and ghosts; by default any number.

    Attributes:
        count: own points.
        numbers: global numbers of own points, in ascending order.
        ghosts_of: `Neighbours` of the last `ghosts`, or None.

    Raises:
        DistributedValueError: bounds or radius are not positive, or there are fewer cells than
            ranks.
    """

    def __init__(self, bounds, radius, comm=None, by="hilbert", capacity=None):
        self.comm = comm = resolve(comm)
        who = f"rank {comm.rank}: Particles"
        low, high = (np.atleast_1d(np.asarray(one, float)) for one in bounds)
        self.ndim = len(low)
        fits = low.shape == high.shape and 1 <= self.ndim <= 3
        if not fits or not np.isfinite(high - low).all() or not (high > low).all():
            raise DistributedValueError(
                f"{who} expects finite corners of a box in 1 to 3 dimensions, but got {bounds}"
            )
        if not radius > 0:
            raise DistributedValueError(f"{who} expects a positive radius, but got {radius}")
        if by not in ("hilbert", "slabs"):
            raise DistributedValueError(f"{who} expects by 'hilbert' or 'slabs', but got {by!r}")
        most = _MOST_CELLS[self.ndim]
        self.extents = np.clip(np.floor((high - low) / radius), 1, most).astype(int)
        cells = int(self.extents.prod())
        if cells < comm.size:
            raise DistributedValueError(
                f"{who}: {comm.size} ranks, but only {cells} cells of radius {radius}: use fewer "
                "ranks"
            )
        self.low, self.scale = low, self.extents / (high - low)
        self.radius, self.by, self.capacity = radius, by, capacity
        index = np.stack(np.unravel_index(np.arange(cells), self.extents), 1)
        keys = hilbert_keys(index) if by == "hilbert" else np.arange(cells)
        self.order = np.argsort(keys, kind="stable")
        self._tables: dict = {}
        self._deal(np.ones(cells))
        self.count, self.numbers, self.ghosts_of = 0, None, None
        self._plans: dict = {}

    # Owners.

    def _deal(self, load) -> None:
        """Gives cells to ranks, in their order, so that loads are equal."""
        size = self.comm.size
        load = load[self.order] + 1e-9 * max(load.sum(), 1.0) / len(load)
        middle = np.cumsum(load) - load / 2
        owners = np.empty(len(load), np.int32)
        owners[self.order] = np.minimum((middle / load.sum() * size).astype(np.int32), size - 1)
        self.owners = owners
        # For each cell the other owners around it.
        grid = np.arange(len(load)).reshape(self.extents)
        around = np.zeros((len(load), size), bool)
        for step in itertools.product((-1, 0, 1), repeat=self.ndim):
            to = [slice(max(-d, 0), n - max(d, 0)) for d, n in zip(step, self.extents, strict=True)]
            at = [slice(max(d, 0), n - max(-d, 0)) for d, n in zip(step, self.extents, strict=True)]
            around[grid[tuple(to)].ravel(), owners[grid[tuple(at)].ravel()]] = True
        self.around = around
        # Graphs go on with the new owners.
        for name, table in self._tables.items():
            table.assign(getattr(self, name))

    def _table(self, name, dtype):
        if name not in self._tables:
            values = getattr(self, name)
            self._tables[name] = wp.array(values, dtype=dtype, device=self.comm.device)
        return self._tables[name]

    def device_owners(self):
        """The owner of each cell, an int32 array on the device."""
        return self._table("owners", wp.int32)

    def device_around(self):
        """1 for ranks that own cells around a cell: uint8, (cells, ranks), on the device."""
        return self._table("around", wp.uint8)

    def fixed(self, moving=None, near=None):
        """The same points in arrays whose sizes never change, for steps that are captured.

        Args:
            moving: most points that go from a rank to another one in a step, by default the
                capacity.
            near: most ghosts that a rank has of another one, by default the capacity.

        Returns:
            `FixedParticles`.

        Raises:
            DistributedValueError: the particles have no capacity, or a number is no positive
                integer.
            DistributedError: points have no numbers yet, or are more than the capacity.
        """
        from warp._src.distributed.fixed_particles import FixedParticles

        return FixedParticles(self, moving, near)

    def _cells_of(self, name, x):
        """The cell of each position, on the device; -1 for NaN."""
        checked(self.comm, name, x)
        length = (getattr(x.dtype, "_shape_", ()) or (1,))[0]
        if x.ndim != 1 or length < self.ndim or dtypes.is_struct(x.dtype):
            raise DistributedError(
                f"rank {self.comm.rank}: {name} expects an array of vectors of {self.ndim} "
                f"coordinates, but got {x!r}"
            )
        cells = wp.empty(x.size, dtype=int, device=x.device)
        three = [*self.low, 0.0, 0.0][:3], [*self.scale, 0.0, 0.0][:3], [*self.extents, 1, 1][:3]
        low, scale, extents = (
            wp.vec3d(*three[0]),
            wp.vec3d(*three[1]),
            wp.vec3i(*map(int, three[2])),
        )
        scalar = getattr(x.dtype, "_wp_scalar_type_", x.dtype)
        strides = x.strides[0], dtypes.type_size_in_bytes(scalar)
        numbers = x._view(0, (x.size, length), strides, scalar)
        inputs = [numbers, self.ndim, low, scale, extents, cells]
        with Observing(tape=None, executor=None):
            wp.launch(_find_cells, x.size, inputs, device=x.device)
        return cells

    def _cells(self, name, x) -> np.ndarray:
        """The cell of each position, on the host.

        Raises:
            DistributedError: a position is NaN, or a graph is captured.
        """
        if self.comm.device.is_capturing:
            raise DistributedError(
                f"rank {self.comm.rank}: {name} in a capture, whose sizes cannot change: use "
                "`particles.fixed()`"
            )
        found = self._cells_of(name, x).numpy().copy()
        # All ranks stop if one has to.
        bad = int((found < 0).sum())
        total = self.comm.check_sum([bad])[0]
        if total:
            where = f"its point {int(np.argmax(found < 0))}" if bad else "a point of another rank"
            raise DistributedError(
                f"rank {self.comm.rank}: {name}: {where} has a position that is NaN ({total} in "
                "all): look at forces and time step"
            )
        return found

    def balance(self, x, weights=None) -> None:
        """Deals cells out anew by the points in them; the next `migrate` moves the points.

        Args:
            x: positions of own points.
            weights: NumPy array of the load of each, by default 1.

        Raises:
            DistributedError: on a rank there is not a weight of at least 0 for each point.
        """
        cells = self._cells("balance", x)
        bad = weights is not None and not _are_loads(weights, len(cells))
        load = np.bincount(cells, None if bad else weights, minlength=len(self.owners))
        # Integers add up to the same on any number of ranks.
        words = np.append(np.rint(load.astype(float) * 1024), bad).astype(np.int64)
        words = self.comm.check_sum(words)
        if words[-1]:
            where = "this rank" if bad else "another rank"
            raise DistributedError(
                f"rank {self.comm.rank}: balance expects a finite weight of at least 0 for each "
                f"point, but {where} passes others: look at `weights`"
            )
        self._deal(words[:-1] / 1024.0)

    # Movement.

    def migrate(self, x, *arrays) -> list:
        """Sends each point to the rank that owns its place.

        Rows come in the order of the points' numbers. On a tape the adjoint sends rows back.

        Args:
            x: positions of own points.
            arrays: what else points have, one row for each.

        Returns:
            The arrays of the points that this rank has now, positions first.

        Raises:
            DistributedError: a position is NaN, or a rank gets more points than `capacity`.
        """
        comm = self.comm
        owner = self.owners[self._cells("migrate", x)]
        for one in arrays:
            checked(comm, "migrate", one)
            if one.shape[0] != x.shape[0]:
                raise DistributedError(
                    f"rank {comm.rank}: migrate expects {x.shape[0]} rows in each array, but got "
                    f"{one!r}"
                )
        all_ = (x, *arrays)
        kinds = [f"{dtypes.type_repr(one.dtype)} {one.shape[1:]}" for one in all_]
        common = f"of rows of {', '.join(kinds)}"
        _plan(comm, ("migrate", common), "migrate", common, any(map(_is_recorded, all_)))
        if self.numbers is None:
            ahead = np.zeros(comm.size, np.int64)
            ahead[comm.rank] = x.shape[0]
            first = int(comm.check_sum(ahead)[: comm.rank].sum())
            numbers = np.arange(first, first + x.shape[0], dtype=np.int32)
            self.numbers = wp.array(numbers, dtype=int, device=comm.device)
        table = np.zeros((comm.size, comm.size), np.int64)
        table[comm.rank] = np.bincount(owner, minlength=comm.size)
        table = comm.check_sum(table.reshape(-1)).reshape(comm.size, comm.size)
        self._check_capacity("migrate", table.sum(0))
        order = np.argsort(owner, kind="stable").astype(np.int32)
        counts, came = table[comm.rank].tolist(), table[:, comm.rank].tolist()
        numbers = without_tape(lambda: self._move(self.numbers, order, counts, came))
        final = np.argsort(numbers.numpy(), kind="stable").astype(np.int32)
        found = [_chosen(self._move(one, order, counts, came), final) for one in (x, *arrays)]
        self.numbers = without_tape(lambda: _chosen(numbers, final))
        self.count, self.ghosts_of = len(final), None
        return found

    def _check_capacity(self, name, loads) -> None:
        if self.capacity is not None and loads.max() > self.capacity:
            rank = int(loads.argmax())
            raise DistributedError(
                f"rank {self.comm.rank}: {name}: rank {rank} received {loads[rank]} of at most "
                f"{self.capacity}: raise `capacity`, or call `balance`"
            )

    def _move(self, x, order, counts, came):
        """Rows of an array in an order, sent to ranks by counts."""
        comm = self.comm
        if Observers.executor is not None:
            return forward.produced(x, lambda x: self._move(x, order, counts, came))
        sorted_ = _chosen(x, order)
        step = _row_bytes(x)
        given, taken = [step * one for one in counts], [step * one for one in came]

        def deliver(out, source):
            if comm.size > 1:
                comm.all_to_all(out, source, taken, given)
            elif source.size:
                wp.copy(out, source)

        def backward(found, grad):
            target, source = flat(found, wp.uint8), flat(grad.contiguous(), wp.uint8)
            if comm.size > 1:
                comm.all_to_all(target, source, given, taken)
            elif source.size:
                wp.copy(target, source)

        return _Movement(comm, "migrate", sorted_, sum(came), deliver, backward).y

    # Ghosts.

    def ghosts(self, x) -> int:
        """Finds the points of other ranks within the radius; gives their number.

        `halo` and `push` use them until the next call.
        """
        comm = self.comm
        cells = self._cells("ghosts", x)
        near = self.around[cells] if len(cells) else np.zeros((0, comm.size), bool)
        near[:, comm.rank] = False
        table = np.zeros((comm.size, comm.size), np.int64)
        table[comm.rank] = near.sum(0)
        table = comm.check_sum(table.reshape(-1)).reshape(comm.size, comm.size)
        own = np.zeros(comm.size, np.int64)
        own[comm.rank] = len(cells)
        self._check_capacity("ghosts", table.sum(0) + comm.check_sum(own))
        neighbours, at = [], len(cells)
        for peer in range(comm.size):
            index = np.flatnonzero(near[:, peer]).astype(np.int32)
            count = int(table[peer, comm.rank])
            if len(index) or count:
                there = wp.array(index, dtype=int, device=comm.device)
                neighbours.append((peer, there, slice(at, at + count)))
            at += count
        found = Neighbours(comm, neighbours)
        found.kind = "particles"
        found.first, found.owned, found.local = 0, len(cells), at
        # Sizes are known on both sides: nothing is left to compare.
        found._plans = self._plans
        self.ghosts_of = found
        return at - len(cells)

    def halo(self, *arrays):
        """Arrays of own points with the rows of ghosts behind; one array, or a list of several.

        On a tape the adjoints of ghosts go home.
        """
        found = [self._extended(one) for one in arrays]
        return found[0] if len(found) == 1 else found

    def _extended(self, x):
        near = self._near("halo")
        checked(self.comm, "halo", x)
        if x.shape != (near.owned,):
            raise DistributedError(
                f"rank {self.comm.rank}: halo expects an array of {near.owned} own points, but got "
                f"{x!r}: call `ghosts` after `migrate`"
            )
        y = near.zeros(x.dtype, requires_grad=x.requires_grad)
        if near.owned:
            wp.copy(y[: near.owned], x)
        near.halo(y)
        return y

    def push(self, x):
        """Adds the rows of ghosts to their owners' points; gives the array of own points."""
        near = self._near("push")
        near.push(x)
        return x[: near.owned]

    def _near(self, name):
        if self.ghosts_of is None:
            raise DistributedError(
                f"rank {self.comm.rank}: {name} of particles without ghosts: call `ghosts` first"
            )
        return self.ghosts_of


def _chosen(x, order):
    """Rows of an array in an order, recorded on tapes."""
    index = wp.array(order, dtype=int, device=x.device)
    rows = wp.empty(
        (len(order), *x.shape[1:]), dtype=x.dtype, device=x.device, requires_grad=x.requires_grad
    )
    if len(order):
        if x.ndim == 1 and not dtypes.is_struct(x.dtype):
            wp.launch(_take, len(order), [x, index, rows], device=x.device)
        else:
            wp.copy(rows, x[index])
    return rows
