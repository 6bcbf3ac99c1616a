"""Graphs on CUDA: streams, what a capture refuses, and memory of other devices."""

import gc

import numpy as np
import pytest

import warp as wp

pytestmark = pytest.mark.cuda


@wp.kernel
def add(x: wp.array(dtype=float), v: float):
    i = wp.tid()
    x[i] = x[i] + v


def zeros(count=100):
    return wp.zeros(count, device="cuda:0")


def test_waiting_is_refused_and_harms_nothing():
    x = zeros()
    with wp.ScopedCapture("cuda:0") as capture:
        wp.launch(add, 100, [x, 1.0], device="cuda:0")
        with pytest.raises(RuntimeError, match="while a graph is being captured"):
            x.numpy()
        with pytest.raises(RuntimeError, match="while a graph is being captured"):
            wp.synchronize_device("cuda:0")
        with pytest.raises(RuntimeError, match="while a graph is being captured"):
            wp.synchronize_stream("cuda:0")
        wp.launch(add, 100, [x, 1.0], device="cuda:0")
    wp.capture_launch(capture.graph)
    assert (x.numpy() == 2.0).all()


def test_numpy_ends_a_capture_cleanly():
    x = zeros()
    with pytest.raises(RuntimeError, match="cannot read an array on 'cuda:0'"):
        with wp.ScopedCapture("cuda:0"):
            x.numpy()
    assert not wp.get_device("cuda:0").is_capturing
    assert not wp.get_stream("cuda:0").is_capturing
    assert (x.numpy() == 0.0).all()


def test_other_streams_join():
    x, y = zeros(), zeros()
    side = wp.Stream("cuda:0")
    main = wp.get_stream("cuda:0")
    with wp.ScopedCapture("cuda:0") as capture:
        wp.launch(add, 100, [x, 1.0], device="cuda:0")
        side.wait_stream(main)
        assert side.is_capturing
        wp.launch(add, 100, [y, 2.0], stream=side)
        wp.launch(add, 100, [x, 3.0], device="cuda:0")
        main.wait_event(side.record_event())
        wp.copy(x, y)
    assert not side.is_capturing
    wp.capture_launch(capture.graph)
    assert (y.numpy() == 2.0).all()
    assert (x.numpy() == 2.0).all()


def test_streams_that_nobody_joins_are_joined_at_the_end():
    x, y = zeros(), zeros()
    with wp.ScopedCapture("cuda:0") as capture:
        for target in (x, y):
            with wp.ScopedStream(wp.Stream("cuda:0")):
                wp.launch(add, 100, [target, 1.0], device="cuda:0")
                wp.launch(add, 100, [target, 2.0], device="cuda:0")
    for _ in range(3):
        wp.capture_launch(capture.graph)
    assert (x.numpy() + y.numpy() == 18.0).all()


def test_events_between_graphs():
    n = 1_000_000
    x, y = (wp.zeros(n, dtype=float, device="cuda:0") for _ in range(2))
    event = wp.Event("cuda:0")
    with wp.ScopedDevice("cuda:0"):
        with wp.ScopedCapture() as first:
            wp.launch(add, n, [x, 1.0])
            assert wp.record_event(event, external=True) is event
        with wp.ScopedCapture() as second:
            wp.wait_event(event, external=True)
            wp.copy(y, x)
        streams = [wp.Stream() for _ in range(2)]
        for _ in range(5):
            wp.capture_launch(first.graph, stream=streams[0])
            wp.capture_launch(second.graph, stream=streams[1])
            wp.synchronize_device()
    assert (y.numpy() == 5.0).all()


def test_events_that_measure_time_in_graphs():
    x = zeros()
    start, end = (wp.Event("cuda:0", enable_timing=True) for _ in range(2))
    stream = wp.get_stream("cuda:0")
    with wp.ScopedCapture("cuda:0") as capture:
        stream.record_event(start)
        wp.launch(add, 100, [x, 1.0], device="cuda:0")
        stream.record_event(end)
    wp.capture_launch(capture.graph)
    assert wp.get_event_elapsed_time(start, end) > 0.0
    with pytest.raises(RuntimeError, match="cannot wait for an event of 'cuda:0'"):
        with wp.ScopedCapture("cuda:0"):
            wp.synchronize_event(end)
    assert wp.get_device("cuda:0").null_stream.cuda_stream == 0


def test_capture_and_launch_on_a_stream():
    x = zeros()
    side = wp.Stream("cuda:0")
    wp.synchronize_device("cuda:0")
    with wp.ScopedCapture(stream=side) as capture:
        wp.launch(add, 100, [x, 2.0], stream=side)
    wp.capture_launch(capture.graph, stream=side)
    wp.capture_launch(capture.graph, stream=side)
    wp.synchronize_stream(side)
    assert (x.numpy() == 4.0).all()


@wp.kernel
def triple(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = 3.0 * x[x.shape[0] - 1 - i] + y[i]


def branches_of(count, size):
    """A graph of several branches, each of which clears an array and reads another one."""
    x, y = wp.zeros((count, size), device="cuda:0"), wp.zeros((count, size), device="cuda:0")
    with wp.ScopedCapture("cuda:0", optimize=True) as capture:
        for i in range(count):
            y[i].zero_()
            wp.launch(triple, size, [x[i], y[i]], device="cuda:0")
            # The sizes differ, so that launches stay apart.
            wp.launch(add, size - i, [y[i], 1.0], device="cuda:0")
    return x, y, capture.graph


def test_another_stream_writes_before_each_replay():
    """All branches come behind what the launching stream waits for, and later work behind all."""
    count, size, rounds = 6, 50_000, 20
    x, y, graph = branches_of(count, size)
    kept = wp.zeros((rounds, count, size), device="cuda:0")
    main, side = wp.get_stream("cuda:0"), wp.Stream("cuda:0")
    side.wait_stream(main)
    for k in range(rounds):
        with wp.ScopedStream(side, sync_enter=False):
            x.fill_(float(k))
        main.wait_stream(side)
        wp.capture_launch(graph)
        side.wait_stream(main)
        with wp.ScopedStream(side, sync_enter=False):
            wp.copy(kept[k], y)
        main.wait_stream(side)
    for i in range(count):
        expected = 3.0 * np.arange(rounds)[:, None] + (np.arange(size) < size - i)
        assert (kept.numpy()[:, i] == expected).all()


def test_another_stream_writes_during_replays():
    """Each element that a graph reads is an old or a new one; nothing else is touched."""
    count, size = 6, 50_000
    x, y, graph = branches_of(count, size)
    x.fill_(5.0)
    side = wp.Stream("cuda:0")
    side.wait_stream(wp.get_stream("cuda:0"))
    for k in range(50):
        with wp.ScopedStream(side, sync_enter=False):
            x.fill_(5.0 if k % 2 else 7.0)
        wp.capture_launch(graph)
    wp.synchronize_device("cuda:0")
    found = y.numpy()
    for i in range(count):
        base = (np.arange(size) < size - i).astype(np.float32)
        assert ((found[i] == 15.0 + base) | (found[i] == 21.0 + base)).all()
    assert (x.numpy() == 5.0).all()
    # Without anybody else, a replay sees what is there now.
    wp.capture_launch(graph)
    assert (y.numpy()[0] == 15.0 + (np.arange(size) < size)).all()


def test_current_stream_of_a_scope():
    x = zeros()
    with wp.ScopedStream(wp.Stream("cuda:0")):
        with wp.ScopedCapture() as capture:
            wp.launch(add, 100, [x, 2.0])
        wp.capture_launch(capture.graph)
        wp.synchronize_stream()
    assert (x.numpy() == 2.0).all()


def test_host_arrays():
    pinned = wp.zeros(100, device="cpu", pinned=True)
    result = wp.zeros(100, device="cpu", pinned=True)
    x = zeros()
    with wp.ScopedCapture("cuda:0") as capture:
        wp.copy(x, pinned)
        wp.launch(add, 100, [x, 1.0], device="cuda:0")
        wp.copy(result, x)
    for value in (5.0, 7.0):
        pinned.fill_(value)
        wp.capture_launch(capture.graph)
        wp.synchronize_device("cuda:0")
        assert (result.numpy() == value + 1.0).all()


def test_data_of_host_arrays_that_go_away():
    x = zeros(1000)
    with wp.ScopedCapture("cuda:0") as capture:
        made = wp.array(np.arange(1000.0), dtype=float, device="cuda:0")
        x.assign(np.full(1000, 3.0, dtype=np.float32))
    gc.collect()
    others = [np.full(1000, 9.0, dtype=np.float32) for _ in range(20)]
    wp.capture_launch(capture.graph)
    assert (made.numpy() == np.arange(1000.0)).all()
    assert (x.numpy() == 3.0).all()
    assert len(others) == 20


def test_external_captures():
    torch = pytest.importorskip("torch")
    if not torch.cuda.is_available():
        pytest.skip("no CUDA in torch")
    x = zeros()
    wp.launch(add, 100, [x, 0.0], device="cuda:0")
    wp.synchronize_device("cuda:0")
    graph = torch.cuda.CUDAGraph()
    stream = torch.cuda.Stream()
    with torch.cuda.graph(graph, stream=stream):
        ours = wp.stream_from_torch(stream)
        with wp.ScopedCapture(stream=ours, external=True) as capture:
            wp.launch(add, 100, [x, 1.0], stream=ours)
    with pytest.raises(RuntimeError, match="somebody else"):
        wp.capture_launch(capture.graph)
    graph.replay()
    torch.cuda.synchronize()
    assert (x.numpy() == 1.0).all()


def test_external_needs_a_capture():
    with pytest.raises(RuntimeError, match="nobody began"):
        wp.capture_begin("cuda:0", external=True)
    assert not wp.get_device("cuda:0").is_capturing


def test_graphs_may_go_while_they_run():
    x = zeros(1 << 20)
    for _ in range(20):
        with wp.ScopedCapture("cuda:0") as capture:
            temporary = wp.ones(1 << 20, device="cuda:0")
            for _ in range(10):
                wp.launch(add, x.size, [temporary, 1.0], device="cuda:0")
            wp.copy(x, temporary)
            del temporary
        wp.capture_launch(capture.graph)
        del capture
        wp.full(1 << 20, -1.0, device="cuda:0")
    assert (x.numpy() == 11.0).all()


def test_memory_returns_with_the_graph():
    device = wp.get_device("cuda:0")
    size = 64 << 20
    wp.synchronize_device(device)
    # Memory of this process: others may use the card meanwhile.
    before = wp.get_mempool_used_mem_current(device)
    for _ in range(20):
        with wp.ScopedCapture(device) as capture:
            wp.zeros(size, dtype=wp.uint8, device=device)
        wp.capture_launch(capture.graph)
        del capture
        wp.synchronize_device(device)
    assert wp.get_mempool_used_mem_current(device) - before < 4 * size


def test_host_data_is_part_of_a_saved_graph(tmp_path):
    x = zeros(4)
    with wp.ScopedCapture("cuda:0", apic=True) as capture:
        wp.copy(x, wp.array([1.0, 2.0, 3.0, 4.0], dtype=float, device="cpu"))
    wp.capture_save(capture.graph, tmp_path / "g", outputs={"x": x})
    graph = wp.capture_load(tmp_path / "g", device="cuda:0")
    wp.capture_launch(graph)
    graph.get_param("x", x)
    assert x.numpy().tolist() == [1.0, 2.0, 3.0, 4.0]
    with pytest.raises(RuntimeError, match="was made for 'sm_.*' and cannot run on 'cpu'"):
        wp.capture_load(tmp_path / "g", device="cpu")


def test_copies_to_the_host_are_not_saved(tmp_path):
    x, host = zeros(4), wp.zeros(4, device="cpu", pinned=True)
    with wp.ScopedCapture("cuda:0", apic=True) as capture:
        wp.copy(host, x)
    with pytest.raises(RuntimeError, match="it has a copy to the host, which no file holds"):
        wp.capture_save(capture.graph, tmp_path / "g")
