"""Watch: a thread that ends the process when work of a communicator on a GPU does not end.

A kernel of NCCL waits on the GPU for a rank that is gone, and the host with it in whatever call
comes next. So no call can raise; the watch says which exchange waits for whom and ends all ranks.
"""

from __future__ import annotations

import os
import sys
import threading
import time
import typing
import weakref

import warp as wp
from warp._src.arrays.hooks import captures, graph_makers
from warp._src.devices import graphs
from warp._src.distributed import failures

# Seconds between two looks, and until a rank that is gone has been missed for good.
_PAUSE, _GRACE = 0.25, 1.0


class Pending(typing.NamedTuple):
    """Work whose end is awaited, and when it began."""

    since: float
    plan: int
    step: int
    name: str


class Watch:
    """Watches the work of a communicator until `close`.

    Attributes:
        pending: the oldest work that may not have ended, or None.
        latest: the last work that was queued behind it, or None.
        replays: streams on which graphs were replayed last.
    """

    def __init__(self, comm):
        self.comm = comm
        self.pending = self.latest = self.calling = None
        self._event, self._last = wp.Event(comm.device), wp.Event(comm.device)
        self._lock = threading.Lock()
        self._missed = None
        self.replays: weakref.WeakKeyDictionary = weakref.WeakKeyDictionary()
        self._stop = threading.Event()
        thread = threading.Thread(target=self._run, name="warp-watch", daemon=True)
        thread.start()

    def begin(self, name) -> None:
        """Notes that a call of the host begins which may wait for other ranks."""
        plan, step = self.comm.log.last(self.comm.rank)[1:]
        self.calling = Pending(time.monotonic(), plan, step, name)

    def end(self, stream=None) -> None:
        """Notes the end of that call; what it queued on a stream is watched then.

        Args:
            stream: by default the current one.
        """
        called, self.calling = self.calling, None
        stream = stream or wp.get_stream(self.comm.device)
        if stream.is_capturing:
            self._note_captured([called.plan])
            return
        with self._lock:
            if self.pending is None:
                stream.record_event(self._event)
                self.pending = called
            else:
                stream.record_event(self._last)
                self.latest = called

    def _note_captured(self, plans) -> None:
        """Notes plans whose messages the captures on the GPU take down."""
        for key in captures:
            if isinstance(key, tuple) and key[0] == self.comm.device.index:
                maker = graph_makers.setdefault(key, GraphMaker())
                maker.plans.setdefault(self, []).extend(plans)

    def close(self) -> None:
        """Ends the watch."""
        self._stop.set()

    def _run(self) -> None:
        while not self._stop.wait(_PAUSE):
            text = self.look(time.monotonic())
            if text is not None and not self._stop.is_set():
                print(f"{text}: rank {self.comm.rank} ends all ranks", file=sys.stderr, flush=True)
                self.comm.bootstrap.abort(1)

    def look(self, now) -> str | None:
        """A message about an error or a wait that has lasted too long, else None."""
        comm = self.comm
        if os.getpid() != comm.process:
            return None
        with self._lock:
            if self.pending is not None and self._event.is_complete:
                # The work behind it began to wait at about this time.
                self.pending = self.latest and self.latest._replace(since=now)
                self.latest = None
                self._event, self._last = self._last, self._event
            work = self.calling or self.pending
        gone = [
            rank
            for rank in range(comm.size)
            if rank != comm.rank
            and comm.log.last(rank)[0] > 0
            and not failures.is_alive(comm.log.last(rank)[0])
        ]
        if not gone:
            self._missed = None
        elif self._missed is None:
            self._missed = now
        is_missed = gone and now - self._missed > _GRACE
        problem = comm.failure()
        if problem is not None:
            return f"rank {comm.rank}: {problem}"
        if work is None or not (is_missed or now - work.since > comm.timeout):
            return f"rank {comm.rank}: rank {gone[0]} is gone" if is_missed else None
        waited = "it waits" if is_missed else f"no answer within {comm.timeout:g} s"
        others = failures.describe_ranks(comm, work.plan, work.step)
        what = failures.describe_work(comm, work.plan, work.step, work.name)
        return f"rank {comm.rank}: {what}: {waited}; {others}"


class GraphMaker:
    """Makes the graph of a capture that holds messages.

    Attributes:
        plans: numbers of what was captured, in order, by watch.
    """

    def __init__(self):
        self.plans: dict[Watch, list] = {}

    def __call__(self, native) -> WatchedGraph:
        return WatchedGraph(native, self.plans)


class WatchedGraph(graphs.Graph):
    """A graph with messages of NCCL, whose replays are watched.

    Args:
        native: the graph.
        plans: by watch the numbers of the plans in it.
    """

    def __init__(self, native, plans):
        super().__init__(native)
        self._plans = plans
        self._steps = {}
        for watch, numbers in plans.items():
            comm = watch.comm
            number = -1 - len(comm.graph_names)
            names = [comm.plan_names.get(one, "messages") for one in dict.fromkeys(numbers)]
            comm.graph_names[number] = ", ".join(dict.fromkeys(names))
            self._steps[watch] = [number, 0]

    def launch(self, stream, launch) -> None:
        """Replays it on a stream, by default the current one, by `launch(graph, stream)`."""
        for watch, found in self._steps.items():
            comm = watch.comm
            comm.check_use("a graph with messages")
            if (stream or wp.get_stream(self.device)).is_capturing:
                watch._note_captured(self._plans[watch])
                continue
            self._check_stream(watch, stream or wp.get_stream(self.device))
            found[1] += 1
            comm.log.begin(*found)
            watch.begin("a graph")
        try:
            launch(self, stream)
        finally:
            for watch in self._steps:
                if watch.calling is not None:
                    watch.end(stream)

    def _check_stream(self, watch, stream) -> None:
        """Rejects a replay beside one of another graph, in which both may wait for each other.

        Raises:
            DistributedError: another graph of the communicator replays on another stream.
        """
        comm, number = watch.comm, self._steps[watch][0]
        for graph, used in watch.replays.items():
            if graph is not self and used != stream.cuda_stream:
                other = graph._steps[watch][0]
                raise failures.DistributedError(
                    f"rank {comm.rank}: graph {-number} with {comm.graph_names[number]} replays on "
                    f"another stream than graph {-other} with {comm.graph_names[other]}: replay "
                    "graphs of a communicator on one stream, or capture with `comm.split(0)`"
                )
        watch.replays[self] = stream.cuda_stream
