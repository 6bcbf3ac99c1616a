"""The watch over work of NCCL: it names an exchange that does not end, and who is missing."""

import gc
import os
import subprocess
import sys
import types

import pytest

import warp as wp
from warp._src.distributed import failures, watch


class Event:
    """An event of a GPU that the test completes."""

    is_complete = False

    def __init__(self, device):
        pass


class Stream:
    """A stream of a GPU that notes the events recorded on it."""

    is_capturing = False
    cuda_stream = 1

    def __init__(self):
        self.recorded = []

    def record_event(self, event):
        self.recorded.append(event)


@pytest.fixture
def watched(monkeypatch):
    """A watch of rank 0 of 2 whose thread never looks by itself; rank 1 is this process's child."""
    monkeypatch.setattr(watch, "_PAUSE", 1e6)
    monkeypatch.setattr(wp, "Event", Event)
    stream = Stream()
    monkeypatch.setattr(wp, "get_stream", lambda device: stream)
    log = failures.RankLog(2, 0)
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    log.words[failures._WORDS :][0] = child.pid
    comm = types.SimpleNamespace(
        **{"rank": 0, "size": 2, "device": None, "timeout": 5.0, "process": os.getpid()},
        **{"log": log, "plan_names": {7: "halo"}, "graph_names": {}},
        **{"failure": lambda: comm.problem, "problem": None},
    )
    made = watch.Watch(comm)
    yield made, comm, stream, child
    made.close()
    child.kill()
    child.wait()


def work(watched, comm, number=7, step=3):
    comm.log.begin(number, step)
    watched.begin("ncclGroupEnd")
    watched.end()


def test_work_that_ends_is_fine(watched):
    made, comm, stream, _ = watched
    work(made, comm)
    now = made.pending.since
    assert len(stream.recorded) == 1
    assert made.look(now + 1) is None
    made._event.is_complete = True
    assert made.look(now + 100) is None and made.pending is None


def test_work_behind_work_that_ends_is_watched(watched):
    made, comm, stream, _ = watched
    work(made, comm, step=3)
    work(made, comm, step=4)
    work(made, comm, step=5)
    first, last = stream.recorded[0], stream.recorded[-1]
    now = made.pending.since
    first.is_complete = True
    assert made.look(now + 100) is None and made.pending.step == 5
    assert "halo (plan 7, step 5): no answer within 5 s" in made.look(now + 106)
    last.is_complete, first.is_complete = True, False
    assert made.look(now + 107) is None and made.pending is None


def test_work_that_does_not_end_names_plan_and_ranks(watched):
    made, comm, _, _ = watched
    work(made, comm)
    comm.log.words[failures._WORDS + 1] = 7
    comm.log.words[failures._WORDS + 2] = 2
    text = made.look(made.pending.since + 6)
    assert text == (
        "rank 0: halo (plan 7, step 3): no answer within 5 s; "
        "rank 1 last began halo (plan 7, step 2)"
    )


def test_a_call_of_the_host_that_does_not_end(watched):
    made, comm, _, _ = watched
    comm.log.begin(9, 1)
    made.begin("ncclCommInitRank")
    text = made.look(made.calling.since + 6)
    assert "rank 0: ncclCommInitRank (plan 9, step 1): no answer within 5 s" in text


def test_a_rank_that_is_gone_is_told_before_the_limit(watched):
    made, comm, _, child = watched
    work(made, comm)
    child.kill()
    child.wait()
    now = made.pending.since
    assert made.look(now + 0.1) is None
    assert "rank 0: halo (plan 7, step 3): it waits; rank 1 is gone" == made.look(now + 1.2)


def test_a_rank_that_has_come_to_its_end_is_not_missed(watched):
    made, comm, _, child = watched
    comm.log.words[failures._WORDS] = -child.pid
    child.kill()
    child.wait()
    assert made.look(1.0) is None and made.look(9.0) is None
    work(made, comm)
    assert "rank 1 has come to its end" in made.look(made.pending.since + 6)


def test_replays_of_a_graph_name_its_messages(watched):
    made, comm, stream, _ = watched
    comm.check_use = lambda what: None
    graph = watch.WatchedGraph(types.SimpleNamespace(device_index=-1), {made: [7, 7]})
    launched = []
    for _ in range(2):
        graph.launch(stream, lambda *rest: launched.append(rest))
    assert launched == [(graph, stream)] * 2 and len(stream.recorded) == 2
    comm.log.words[failures._WORDS + 1] = -1
    comm.log.words[failures._WORDS + 2] = 1
    made._event.is_complete = True
    now = made.pending.since
    assert made.look(now) is None and made.look(now + 4) is None
    assert made.look(now + 6) == (
        "rank 0: replay 2 of graph 1 with halo: no answer within 5 s; "
        "rank 1 last began replay 1 of graph 1 with halo"
    )


def test_graphs_of_a_communicator_replay_on_one_stream(watched):
    made, comm, stream, _ = watched
    comm.check_use = lambda what: None
    native = types.SimpleNamespace(device_index=-1)
    first, second = (watch.WatchedGraph(native, {made: [7]}) for _ in range(2))
    other, launched = Stream(), []
    other.cuda_stream = 2

    def replay(graph, stream):
        graph.launch(stream, lambda *rest: launched.append(stream))

    replay(first, stream)
    with pytest.raises(failures.DistributedError) as caught:
        replay(second, other)
    assert str(caught.value) == (
        "rank 0: graph 2 with halo replays on another stream than graph 1 with halo: replay graphs "
        "of a communicator on one stream, or capture with `comm.split(0)`"
    )
    assert len(launched) == 1
    replay(second, stream)
    del first, caught
    gc.collect()
    # A graph alone may change its stream.
    replay(second, other)
    assert len(launched) == 3


def test_errors_of_nccl_and_captures(watched):
    made, comm, stream, _ = watched
    stream.is_capturing = True
    work(made, comm)
    assert made.pending is None and not stream.recorded
    comm.problem = "NCCL error 6"
    assert made.look(1.0) == "rank 0: NCCL error 6"
