"""Graphs on every device: what is recorded, kept alive and replayed."""

import gc
import threading

import numpy as np
import pytest

import warp as wp


@wp.kernel
def add(x: wp.array(dtype=float), v: float):
    i = wp.tid()
    x[i] = x[i] + v


@wp.kernel
def combine(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = y[i] + 2.0 * x[i]


@wp.kernel
def count_down(n: wp.array(dtype=int)):
    n[0] = n[0] - 1


@wp.struct
class Pair:
    values: wp.array(dtype=float)
    scale: float


@wp.kernel
def scale_pair(p: Pair):
    i = wp.tid()
    p.values[i] = p.values[i] * p.scale


def test_nothing_runs_before_the_launch(device):
    x = wp.zeros(10, device=device)
    with wp.ScopedCapture(device) as capture:
        assert wp.get_device(device).is_capturing
        wp.launch(add, 10, [x, 1.0], device=device)
    assert not wp.get_device(device).is_capturing
    assert (x.numpy() == 0.0).all()
    for turn in range(1, 4):
        wp.capture_launch(capture.graph)
        assert (x.numpy() == turn).all()


def test_begin_and_end(device):
    x = wp.zeros(10, device=device)
    # As recorded: launches that are fused are one node.
    wp.capture_begin(device, optimize=False)
    for _ in range(5):
        wp.launch(add, 10, [x, 1.0], device=device)
    graph = wp.capture_end(device)
    assert graph.node_count == 5
    assert graph.device == wp.get_device(device)
    wp.capture_launch(graph)
    assert (x.numpy() == 5.0).all()


def test_copies_and_fills(device):
    x = wp.array(np.arange(6.0), dtype=float, device=device)
    y = wp.zeros(6, device=device)
    parts = wp.zeros((3, 2), dtype=float, device=device)
    vectors = wp.zeros(5, dtype=wp.vec3, device=device)
    with wp.ScopedCapture(device) as capture:
        wp.copy(y, x)
        wp.copy(parts[:, 1], x[:3])
        parts[:, 0].fill_(7.0)
        vectors.fill_(wp.vec3(1.0, 2.0, 3.0))
        x.zero_()
    assert not y.numpy().any()
    wp.capture_launch(capture.graph)
    assert y.numpy().tolist() == [0, 1, 2, 3, 4, 5]
    assert parts.numpy().tolist() == [[7, 0], [7, 1], [7, 2]]
    assert vectors.numpy().tolist() == [[1, 2, 3]] * 5
    assert not x.numpy().any()


def test_arrays_made_inside(device):
    x = wp.zeros(1000, device=device)
    with wp.ScopedCapture(device) as capture:
        temporary = wp.ones(1000, device=device)
        result = wp.empty(1000, device=device)
        wp.copy(result, temporary)
        wp.launch(combine, 1000, [temporary, x], device=device)
        del temporary
    for turn in range(1, 4):
        wp.capture_launch(capture.graph)
        assert (x.numpy() == 2.0 * turn).all()
        assert (result.numpy() == 1.0).all()


def test_arrays_live_as_long_as_the_graph(device):
    y = wp.zeros(1000, device=device)
    x = wp.ones(1000, device=device)
    pair = Pair()
    pair.values, pair.scale = wp.ones(1000, device=device), 2.0
    scaled = pair.values
    with wp.ScopedCapture(device) as capture:
        wp.launch(combine, 1000, [x, y], device=device)
        wp.launch(scale_pair, 1000, [pair], device=device)
    pair.values = wp.zeros(1000, device=device)
    del x
    gc.collect()
    others = [wp.full(1000, 99.0, device=device) for _ in range(10)]
    wp.capture_launch(capture.graph)
    assert (y.numpy() == 2.0).all()
    assert (scaled.numpy() == 2.0).all()
    assert all((other.numpy() == 99.0).all() for other in others)


def test_kernels_live_as_long_as_the_graph(device):
    def make():
        @wp.kernel(module="unique")
        def local(x: wp.array(dtype=float)):
            i = wp.tid()
            x[i] = x[i] + 3.0

        return local

    x = wp.zeros(10, device=device)
    with wp.ScopedCapture(device) as capture:
        wp.launch(make(), 10, [x], device=device)
    gc.collect()
    wp.capture_launch(capture.graph)
    assert (x.numpy() == 3.0).all()


def test_kernels_compiled_inside(device, fresh_cache):
    @wp.kernel
    def first_seen_here(x: wp.array(dtype=float)):
        i = wp.tid()
        x[i] = x[i] + float(i)

    x = wp.zeros(4, device=device)
    with wp.ScopedCapture(device) as capture:
        wp.launch(first_seen_here, 4, [x], device=device)
    wp.capture_launch(capture.graph)
    assert x.numpy().tolist() == [0, 1, 2, 3]


def test_large_launches(device):
    x = wp.zeros(1 << 20, device=device)
    with wp.ScopedCapture(device) as capture:
        for _ in range(3):
            wp.launch(add, x.size, [x, 1.0], device=device)
    wp.capture_launch(capture.graph)
    assert (x.numpy() == 3.0).all()


def test_errors_end_the_capture(device):
    x = wp.zeros(4, device=device)
    with pytest.raises(wp.WarpLaunchError), wp.ScopedCapture(device):
        wp.launch(add, 4, [x], device=device)
    assert not wp.get_device(device).is_capturing
    wp.launch(add, 4, [x, 1.0], device=device)
    assert (x.numpy() == 1.0).all()


def test_misuse(device):
    with pytest.raises(RuntimeError, match="no graph is being captured"):
        wp.capture_end(device)
    with wp.ScopedCapture(device) as capture:
        with pytest.raises(RuntimeError, match="already"):
            wp.capture_begin(device)
    assert capture.graph.node_count == 0
    wp.capture_launch(capture.graph)
    with pytest.raises(TypeError, match="expects a graph"):
        wp.capture_launch(capture)


def test_graphs_in_graphs(device):
    x = wp.zeros(4, device=device)
    with wp.ScopedCapture(device) as inner:
        wp.launch(add, 4, [x, 1.0], device=device)
    with wp.ScopedCapture(device) as outer:
        wp.capture_launch(inner.graph)
        wp.launch(add, 4, [x, 10.0], device=device)
        wp.capture_launch(inner.graph)
    del inner
    gc.collect()
    wp.capture_launch(outer.graph)
    assert (x.numpy() == 12.0).all()


def test_pictures(device, tmp_path):
    x = wp.zeros(4, device=device)
    with wp.ScopedCapture(device) as capture:
        wp.launch(add, 4, [x, 1.0], device=device)
        x.zero_()
    path = tmp_path / "graph.dot"
    wp.capture_debug_dot_print(capture.graph, path)
    assert path.read_text().startswith("digraph")


@pytest.mark.parametrize("value", [0, 1, -3])
@pytest.mark.parametrize("captured", [False, True])
def test_if(device, value, captured):
    if captured and device != "cpu" and not wp.is_conditional_graph_supported():
        pytest.skip("the driver has no conditional nodes")
    condition = wp.zeros(1, dtype=int, device=device)
    x = wp.zeros(4, device=device)

    def yes(step):
        condition.zero_()
        wp.launch(add, 4, [x, step], device=device)

    def no(step):
        wp.launch(add, 4, [x, -step], device=device)

    def work():
        condition.fill_(value)
        wp.capture_if(condition, yes, no, step=2.0)
        wp.capture_if(condition, on_false=yes, step=100.0)

    if captured:
        with wp.ScopedCapture(device) as capture:
            work()
        assert not x.numpy().any()
        wp.capture_launch(capture.graph)
        wp.capture_launch(capture.graph)
    else:
        work()
        work()
    assert (x.numpy() == 2 * (102.0 if value else 98.0)).all()


@pytest.mark.parametrize("captured", [False, True])
@pytest.mark.parametrize("turns", [0, 1, 7])
def test_while(device, captured, turns):
    if captured and device != "cpu" and not wp.is_conditional_graph_supported():
        pytest.skip("the driver has no conditional nodes")
    condition = wp.zeros(1, dtype=int, device=device)
    x = wp.zeros(4, device=device)

    def body(step):
        wp.launch(add, 4, [x, step], device=device)
        wp.launch(count_down, 1, [condition], device=device)

    def work():
        condition.fill_(turns)
        wp.capture_while(condition, body, step=1.0)

    if captured:
        with wp.ScopedCapture(device) as capture:
            work()
            wp.launch(add, 4, [x, 0.5], device=device)
        wp.capture_launch(capture.graph)
        wp.capture_launch(capture.graph)
        assert (x.numpy() == 2 * turns + 1.0).all()
    else:
        work()
        assert (x.numpy() == turns).all()
    assert condition.numpy()[0] == 0


def test_loops_nest(device):
    if device != "cpu" and not wp.is_conditional_graph_supported():
        pytest.skip("the driver has no conditional nodes")
    outer = wp.zeros(1, dtype=int, device=device)
    inner = wp.zeros(1, dtype=int, device=device)
    x = wp.zeros(4, device=device)

    def inner_body():
        wp.launch(add, 4, [x, 1.0], device=device)
        wp.launch(count_down, 1, [inner], device=device)

    def outer_body():
        inner.fill_(3)
        wp.capture_while(inner, inner_body)
        wp.launch(count_down, 1, [outer], device=device)
        wp.capture_if(outer, on_false=lambda: wp.launch(add, 4, [x, 100.0], device=device))

    with wp.ScopedCapture(device) as capture:
        outer.fill_(4)
        wp.capture_while(outer, outer_body)
    wp.capture_launch(capture.graph)
    assert (x.numpy() == 112.0).all()


def test_loops_and_branches_of_graphs_in_graphs(device):
    if device != "cpu" and not wp.is_conditional_graph_supported():
        pytest.skip("the driver has no conditional nodes")
    left, runs = wp.zeros(1, dtype=int, device=device), wp.zeros(1, dtype=int, device=device)
    x, y = wp.zeros(4, device=device), wp.zeros(4, device=device)

    def body():
        wp.launch(add, 4, [x, 1.0], device=device)
        wp.launch(count_down, 1, [left], device=device)
        wp.capture_if(left, on_false=lambda: wp.copy(y, x))

    with wp.ScopedCapture(device) as inner:
        left.fill_(3)
        wp.capture_while(left, body)
        wp.launch(add, 4, [x, 10.0], device=device)

    def twice():
        wp.capture_launch(inner.graph)
        wp.capture_launch(inner.graph)
        wp.launch(count_down, 1, [runs], device=device)

    with wp.ScopedCapture(device) as middle:
        runs.fill_(2)
        wp.capture_while(runs, twice)
    with wp.ScopedCapture(device) as outer:
        x.fill_(0.5)
        wp.capture_launch(middle.graph)
        wp.launch(add, 4, [y, 0.25], device=device)
    del inner, middle
    for _ in range(2):
        wp.capture_launch(outer.graph)
        assert (x.numpy() == 52.5).all() and (y.numpy() == 42.75).all()


def test_graphs_as_bodies(device):
    if device != "cpu" and not wp.is_conditional_graph_supported():
        pytest.skip("the driver has no conditional nodes")
    condition = wp.array([3], dtype=int, device=device)
    x = wp.zeros(4, device=device)
    with wp.ScopedCapture(device) as body:
        wp.launch(add, 4, [x, 1.0], device=device)
        wp.launch(count_down, 1, [condition], device=device)
    wp.capture_while(condition, body.graph)
    assert (x.numpy() == 3.0).all()
    with wp.ScopedCapture(device) as capture:
        condition.fill_(5)
        wp.capture_while(condition, body.graph)
    wp.capture_launch(capture.graph)
    assert (x.numpy() == 8.0).all()


def test_conditions_are_checked(device):
    with pytest.raises(TypeError, match="int32"):
        wp.capture_if(wp.zeros(1, device=device), lambda: None)
    with pytest.raises(TypeError, match="expects an array"):
        wp.capture_while(1, lambda: None)
    with pytest.raises(TypeError, match="function or a graph"):
        wp.capture_if(wp.ones(1, dtype=int, device=device), 3)
    wp.capture_if(wp.ones(1, dtype=int, device=device), None, None)


def test_errors_in_bodies_end_the_capture(device):
    if device != "cpu" and not wp.is_conditional_graph_supported():
        pytest.skip("the driver has no conditional nodes")
    condition = wp.ones(1, dtype=int, device=device)

    def body():
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"), wp.ScopedCapture(device):
        wp.capture_while(condition, body)
    assert not wp.get_device(device).is_capturing
    assert condition.numpy()[0] == 1


def test_recorded_launches_in_graphs(device):
    x = wp.zeros(8, device=device)
    command = wp.launch(add, 8, [x, 1.0], device=device, record_cmd=True)
    with wp.ScopedCapture(device) as capture:
        command.launch()
        command.set_param_by_name("v", 10.0)
        command.launch()
    del command
    wp.capture_launch(capture.graph)
    assert (x.numpy() == 11.0).all()


def test_captures_on_two_threads(device):
    if device != "cpu":
        pytest.skip("threads share the current stream")
    results = {}

    def work(number):
        x = wp.zeros(100, device=device)
        with wp.ScopedCapture(device) as capture:
            for _ in range(50):
                wp.launch(add, 100, [x, float(number)], device=device)
        for _ in range(20):
            wp.capture_launch(capture.graph)
        results[number] = x.numpy().copy()

    threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all((results[number] == 1000.0 * number).all() for number in range(8))


def test_debug_kernels(device, config):
    config.mode = "debug"

    @wp.kernel
    def write(x: wp.array(dtype=float), offset: wp.array(dtype=int)):
        i = wp.tid()
        x[i + offset[0]] = 1.0

    x = wp.zeros(10, device=device)
    offset = wp.zeros(1, dtype=int, device=device)
    with wp.ScopedCapture(device) as capture:
        wp.launch(write, 10, [x, offset], device=device)
    wp.capture_launch(capture.graph)
    wp.synchronize_device(device)
    offset.fill_(1)
    with pytest.raises(wp.WarpLaunchError, match="out of bounds"):
        wp.capture_launch(capture.graph)
        wp.synchronize_device(device)
