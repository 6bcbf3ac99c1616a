"""Graphs: nodes of meshes and sparse patterns split over ranks, with ghost nodes."""

from __future__ import annotations

import importlib.util
import typing
from typing import Any

import numpy as np

import warp as wp
from warp._src.arrays.observers import Observers
from warp._src.distributed import forward
from warp._src.distributed.communicator import resolve
from warp._src.distributed.exchanges import (
    Exchange,
    Side,
    described_gradients,
    gradient_places,
)
from warp._src.distributed.failures import DistributedError, DistributedValueError
from warp._src.distributed.operations import checked, hash_of, rows_of
from warp._src.distributed.plans import check_plan, without_tape
from warp._src.types import dtypes

PARTITIONS = ("rows", "metis", "hilbert")


@wp.kernel(module="warp.distributed")
def _take(x: wp.array(dtype=Any), index: wp.array(dtype=int), out: wp.array(dtype=Any)):
    i = wp.tid()
    out[i] = x[index[i]]


@wp.kernel(module="warp.distributed")
def _add(values: wp.array(dtype=Any), index: wp.array(dtype=int), x: wp.array(dtype=Any)):
    i = wp.tid()
    x[index[i]] += values[i]


def owners_of(rows, columns, count, size, by, positions=None, weights=None):
    """The rank of each node.

    Args:
        rows, columns: ends of edges.
        count: nodes.
        size: ranks.
        by: "rows", equal ranges; "metis", fewest cut edges; "hilbert", along a curve through
            `positions`.
        positions: of the nodes, for "hilbert", and for "metis" where METIS is not installed.
        weights: of the nodes, for "hilbert".
    """
    if by == "rows" or size == 1:
        ends = [rows_of(count, rank, size)[1] for rank in range(size)]
        return np.searchsorted(ends, np.arange(count), side="right").astype(np.int64)
    if by == "metis" and importlib.util.find_spec("pymetis") is not None:
        import pymetis

        inside = rows != columns
        both = np.unique(
            np.stack([np.r_[rows, columns][np.r_[inside, inside]],
                      np.r_[columns, rows][np.r_[inside, inside]]], 1), axis=0,
        )  # fmt: skip
        starts = np.searchsorted(both[:, 0], np.arange(count + 1))
        _, parts = pymetis.part_graph(size, xadj=starts.tolist(), adjncy=both[:, 1].tolist())
        return np.asarray(parts, np.int64)
    if positions is None:
        # Without positions, neighbouring numbers are the nearest.
        return owners_of(rows, columns, count, size, "rows")
    from warp._src.distributed.curves import hilbert_keys

    order = np.argsort(hilbert_keys(positions), kind="stable")
    load = np.ones(count) if weights is None else np.asarray(weights, float)
    before = np.cumsum(load[order]) - load[order] / 2
    owner = np.empty(count, np.int64)
    owner[order] = np.minimum((before / load.sum() * size).astype(np.int64), size - 1)
    return owner


class Neighbours:
    """Values of own nodes and of ghosts, which lie in ranges by owner.

    Attributes:
        comm: communicator.
        kind: of what, for messages.
        neighbours: for each other rank (its number, local numbers to send, slice of its ghosts).
        first, owned, local: the first own node, own nodes, and all.
    """

    kind = "a graph"
    first = owned = local = 0

    def __init__(self, comm, neighbours=()):
        self.comm, self.neighbours = comm, list(neighbours)
        self._exchanges: dict = {}
        self._plans: dict = {}

    def zeros(self, dtype: typing.Any = float, requires_grad=False):
        """A value for each local node."""
        return wp.zeros(
            self.local, dtype=dtype, device=self.comm.device, requires_grad=requires_grad
        )

    def inner(self, x):
        """The values of own nodes, as a view."""
        return x[self.first : self.first + self.owned]

    def _check(self, name, x) -> None:
        checked(self.comm, name, x)
        if x.shape != (self.local,):
            raise DistributedError(
                f"rank {self.comm.rank}: {name} expects {self.local} values, {self.owned} own and "
                f"{self.local - self.owned} of ghosts, but got {x.shape}: make it by `zeros`"
            )

    def halo(self, x) -> None:
        """Gives ghosts the values of their owners; on a tape with the exact adjoint."""
        if Observers.executor is not None:
            self._check("halo", x)
            forward.in_place([x], self.halo)
        else:
            self._start("halo", x).finish()

    def overlap(self, x):
        """Begins a halo; `finish` of the result ends it."""
        if Observers.executor is not None:
            # Tangents of forward mode need the memory of the message, too.
            self.halo(x)
            return _Done()
        return self._start("halo", x)

    def push(self, x) -> None:
        """Adds values of ghosts to their owners; on a tape with the exact adjoint."""
        if Observers.executor is not None:
            self._check("push", x)
            forward.in_place([x], self.push)
            return
        exchange, packed = self._exchange("push", x)
        exchange.run()
        for (_, index, _), values in zip(self.neighbours, packed, strict=True):
            if index.size:
                wp.launch(_add, index.size, [values, index, x], device=x.device)

    def _start(self, name, x):
        exchange, packed = self._exchange(name, x)
        for (_, index, _), values in zip(self.neighbours, packed, strict=True):
            if index.size:
                wp.launch(_take, index.size, [x, index, values], device=x.device)
        exchange.start()
        return exchange

    def _exchange(self, name, x):
        key = name, id(x)
        found = self._exchanges.get(key)
        if found is not None and (Observers.tape is None or found[0].suits([x])):
            return found[:2]
        self._check(name, x)
        packed, sides = [], []
        for peer, index, span in self.neighbours:
            values = wp.empty(
                index.size, dtype=x.dtype, device=x.device, requires_grad=x.requires_grad
            )
            packed.append(values)
            ghosts = [x[span]] if span.stop > span.start else []
            own = [values] if index.size else []
            give, take = (own, ghosts) if name == "halo" else (ghosts, own)
            sides.append(Side(peer, give, take, self.comm.rank, peer))
        recorded = described_gradients([x])
        symmetric = name, dtypes.type_repr(x.dtype), recorded, forward.Along.count
        text, plan = f"{name} of {self.kind}", self._plans.get(symmetric)
        exchange = Exchange(self.comm, text, sides, [x.dtype], recorded, plan)
        self._plans[symmetric] = exchange.plan
        while len(self._exchanges) >= 64:
            self._exchanges.pop(next(iter(self._exchanges)))
        exchange.gradient_places = gradient_places([x])
        self._exchanges[key] = exchange, packed, x
        return exchange, packed


class _Done:
    """A halo that has ended."""

    def finish(self) -> None:
        """Nothing is left to wait for."""


def numbers_of(who, given):
    """Numbers of nodes as integers.

    Raises:
        DistributedValueError: they are none, and rounding would hide it.
    """
    given = np.asarray(given).reshape(-1)
    if given.size and given.dtype.kind not in "iu":
        raise DistributedValueError(
            f"{who} expects integers as numbers of nodes, but got an array of {given.dtype}"
        )
    return given.astype(np.int64)


class Graph(Neighbours):
    """Nodes that are split over ranks, with the nodes of others that edges lead to.

    The local order is by owner, and within one by number: ghosts of lower ranks, own nodes, ghosts
    of higher ranks. With `by="rows"` that is the global order, so sums along rows have the same
    bits on any number of ranks.

    Args:
        rows, columns: ends of all edges, such as rows and columns of a sparse matrix, on each rank.
        count: nodes, by default one more than the largest number.
        comm: by default that of `wd.init`.
        by: "metis" (needs pymetis; else as "hilbert"), "hilbert" or "rows".
        positions: of all nodes, for "hilbert".

    Attributes:
        owners: the rank of each node.
        numbers: global numbers of the local nodes.
        first, owned, local: the first own node in the local order, own nodes, and all.
        cut: edges between ranks.

    Raises:
        DistributedValueError: a number is no node, or there are more ranks than nodes.
    """

    def __init__(self, rows, columns, count=None, comm=None, by="metis", positions=None):
        comm = resolve(comm)
        super().__init__(comm)
        who = f"rank {comm.rank}: Graph"
        rows, columns = (numbers_of(who, one) for one in (rows, columns))
        if by not in PARTITIONS:
            raise DistributedValueError(f"{who} expects by={PARTITIONS}, but got {by!r}")
        if rows.size != columns.size:
            raise DistributedValueError(
                f"{who} expects as many rows as columns, but got {rows.size} and {columns.size}"
            )
        most = int(max(rows.max(initial=-1), columns.max(initial=-1)))
        least = int(min(rows.min(initial=0), columns.min(initial=0)))
        count = most + 1 if count is None else int(count)
        if most >= count or least < 0:
            raise DistributedValueError(
                f"{who} expects numbers of nodes from 0 to {count - 1}, but got "
                f"{most if most >= count else least}"
            )
        if not count:
            raise DistributedValueError(f"{who} has no nodes: give edges, or `count`")
        if count < comm.size:
            raise DistributedValueError(
                f"{who}: {comm.size} ranks have no node each of {count}: use fewer ranks"
            )
        self.count = count
        self.owners = owners_of(rows, columns, count, comm.size, by, positions)
        facts = hash_of(b"".join(one.tobytes() for one in (rows, columns, self.owners)))
        check_plan(comm, "Graph", f"of {count} nodes and {rows.size} edges by {by}, hash {facts}")
        self.cut = int((self.owners[rows] != self.owners[columns]).sum())
        self._find_local(rows, columns)

    def _find_local(self, rows, columns) -> None:
        rank, size = self.comm.rank, self.comm.size
        owners = self.owners
        order = np.argsort(owners, kind="stable")
        # Local numbers: by owner, then by global number.
        place = np.empty(self.count, np.int64)
        place[order] = np.arange(self.count)
        needed = [[] for _ in range(size)]
        for reader in range(size):
            ghosts = np.unique(columns[(owners[rows] == reader) & (owners[columns] != reader)])
            needed[reader] = ghosts[np.argsort(place[ghosts], kind="stable")]
        mine = np.flatnonzero(owners == rank)
        both = np.concatenate([mine, needed[rank]])
        self.numbers = both[np.argsort(place[both], kind="stable")]
        self.local, self.owned = len(self.numbers), len(mine)
        self.first = int(np.searchsorted(place[self.numbers], place[mine[0]])) if len(mine) else 0
        at = np.full(self.count, -1, np.int64)
        at[self.numbers] = np.arange(self.local)
        self._at = at
        for peer in range(size):
            give = needed[peer][owners[needed[peer]] == rank] if peer != rank else ()
            take = needed[rank][owners[needed[rank]] == peer] if peer != rank else ()
            if len(give) or len(take):
                index = wp.array(at[give].astype(np.int32), dtype=int, device=self.comm.device)
                begin = int(at[take[0]]) if len(take) else 0
                self.neighbours.append((peer, index, slice(begin, begin + len(take))))

    def local_of(self, numbers) -> np.ndarray:
        """Local numbers of nodes, -1 for those that are not here."""
        return self._at[np.asarray(numbers, np.int64)]

    def scatter(self, data):
        """The local part of values of all nodes, which each rank has."""
        return np.asarray(data)[self.numbers]

    def gather(self, x):
        """The values of all nodes on each rank, as a NumPy array."""
        values = without_tape(lambda: self.inner(x).numpy().copy())
        own = self.numbers[self.first : self.first + self.owned]
        parts = self.comm.gather_objects((own, values))
        whole = np.empty((self.count, *values.shape[1:]), values.dtype)
        for numbers, part in parts:
            whole[numbers] = part
        return whole
