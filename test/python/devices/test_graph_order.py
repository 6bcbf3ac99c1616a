"""Graphs by dependencies: what keeps its order, what does not, and the bits of eager launches.

With `wp.config.verify_graphs` each launch of a graph compares its memory with that of the recorded
order; on the CPU operations then come as late as the edges allow, so a missing edge shows.
"""

import threading
import xml.etree.ElementTree

import numpy as np
import pytest

import warp as wp


@wp.kernel
def scale(x: wp.array[float], factor: float):
    i = wp.tid()
    x[i] = factor * x[i] + 1.0


@wp.kernel
def shift(x: wp.array[float], y: wp.array[float], offset: int):
    i = wp.tid()
    if i + offset < x.shape[0]:
        y[i] = 0.5 * y[i] + x[i + offset]


@wp.kernel
def scatter(x: wp.array[float], indices: wp.array[int], y: wp.array[float]):
    i = wp.tid()
    y[indices[i]] = x[i] - 0.25


@wp.kernel
def total(x: wp.array[float], sums: wp.array[float]):
    s = float(0.0)
    for i in range(x.shape[0]):
        s += x[i]
    sums[0] = 0.5 * sums[0] + s


@wp.kernel
def count(x: wp.array[float], limit: float, counts: wp.array[int]):
    i = wp.tid()
    if x[i] > limit:
        wp.atomic_add(counts, i % 2, 1)


@wp.struct
class Pair:
    first: wp.array[float]
    second: wp.array[float]


@wp.kernel
def exchange(pair: Pair):
    i = wp.tid()
    value = pair.first[i]
    pair.first[i] = pair.second[i]
    pair.second[i] = value


@wp.kernel
def whole_rows(x: wp.array2d[float], row: int, factor: float):
    j = wp.tid()
    x[row, j] = factor * x[row, j] + 1.0


@wp.kernel
def halve(n: wp.array[int], x: wp.array[float]):
    i = wp.tid()
    if i == 0:
        n[0] = n[0] - 1
    x[i] = 0.5 * x[i] + 1.0


@pytest.fixture
def verified():
    wp.config.verify_graphs = True
    yield
    wp.config.verify_graphs = False


class Program:
    """Random launches, copies, fills and branches over overlapping views of three arrays."""

    def __init__(self, seed, device):
        self.seed, self.device = seed, device
        rng = np.random.default_rng(seed)
        self.start = [rng.random(40).astype(np.float32) for _ in range(3)]
        self.arrays = [wp.array(values, device=device) for values in self.start]
        self.counts = wp.zeros(2, dtype=int, device=device)
        self.flag = wp.zeros(1, dtype=int, device=device)
        self.indices = [
            wp.array(rng.permutation(10).astype(np.int32), device=device) for _ in range(2)
        ]

    def reset(self):
        for array, values in zip(self.arrays, self.start):
            array.assign(values)
        self.counts.zero_()
        self.flag.zero_()

    def contents(self):
        return [array.numpy() for array in (*self.arrays, self.counts, self.flag)]

    def view(self, rng):
        array = self.arrays[rng.integers(3)]
        begin, step = int(rng.integers(20)), int(rng.integers(1, 3))
        return array[begin : begin + 10 * step : step]

    def one(self, rng, kind):
        x, y = self.view(rng), self.view(rng)
        value = float(rng.integers(1, 5)) / 4.0
        index = self.indices[rng.integers(2)]
        if kind == 0:
            wp.launch(scale, 10, [x, value], device=self.device)
        elif kind == 1:
            # An array that is read elsewhere than it is written depends on threads.
            whole = self.arrays[rng.integers(3)]
            other = next(a for a in self.arrays if a is not whole)
            wp.launch(shift, 10, [whole, other, int(rng.integers(5))], device=self.device)
        elif kind == 2:
            source, target = (self.arrays[k] for k in rng.permutation(3)[:2])
            wp.launch(scatter, 10, [source, index, target], device=self.device)
        elif kind == 3:
            target = self.arrays[rng.integers(3)]
            source = next(a for a in self.arrays if a is not target)
            wp.launch(total, 1, [source[:20], target[30:]], device=self.device)
        elif kind == 4:
            wp.launch(count, 10, [x, value, self.counts], device=self.device)
        elif kind == 5:
            pair = Pair()
            pair.first, pair.second = self.arrays[0][:10], self.arrays[1][10:20]
            wp.launch(exchange, 10, [pair], device=self.device)
        elif kind == 6:
            wp.copy(x, y)
        elif kind == 7:
            x.fill_(value)
        elif kind == 8:
            wp.launch(scale, 0, [x, value], device=self.device)
        else:
            rows = self.arrays[rng.integers(3)].reshape((8, 5))
            inputs = [rows, int(rng.integers(8)), value]
            wp.launch(whole_rows, 5, inputs, device=self.device)

    def run(self):
        rng = np.random.default_rng(self.seed + 1)
        for _ in range(25):
            kind = int(rng.integers(12))
            if kind < 10:
                self.one(rng, kind)
                continue
            self.flag.fill_(int(rng.integers(2)))

            def body(seed=int(rng.integers(1000))):
                inner = np.random.default_rng(seed)
                for _ in range(3):
                    self.one(inner, int(inner.integers(10)))

            wp.capture_if(self.flag, body, body if kind == 11 else None)


@pytest.mark.parametrize("is_verified", [False, True])
@pytest.mark.parametrize("seed", range(25))
def test_random_programs_have_the_bits_of_eager_launches(device, seed, is_verified, monkeypatch):
    monkeypatch.setattr(wp.config, "verify_graphs", is_verified)
    program = Program(seed, device)
    program.run()
    program.reset()
    program.run()
    expected = program.contents()
    program.reset()
    with wp.ScopedCapture(device, optimize=True) as capture:
        program.run()
    for _ in range(2):
        program.reset()
        wp.capture_launch(capture.graph)
        for found, wanted in zip(program.contents(), expected):
            assert found.tobytes() == wanted.tobytes()
    schedule = capture.graph.schedule()
    if schedule.kept:
        # The driver has no second form of a graph with branches.
        assert is_verified and wp.get_device(device).is_cuda and "two orders" in schedule.kept
    else:
        assert schedule.edges < len(schedule.nodes) * 3


def test_what_shares_no_memory_is_on_branches(device):
    x, y, z = (wp.zeros(100, device=device) for _ in range(3))
    with wp.ScopedCapture(device, optimize=True) as capture:
        wp.launch(scale, 100, [x, 2.0], device=device)
        wp.launch(scale, 99, [y, 2.0], device=device)
        wp.launch(shift, 50, [x, z, 3], device=device)
        wp.launch(shift, 49, [y[50:], z[50:], 3], device=device)
        z.fill_(0.0)
    schedule = capture.graph.schedule()
    assert [sorted(node.before) for node in schedule.nodes] == [[], [], [0], [1], [2, 3]]
    assert (schedule.depth, schedule.recorded_edges, schedule.edges) == (3, 4, 4)
    assert schedule.nodes[2].before[0] == "'x' is read"
    assert schedule.nodes[4].name == "fill"
    assert "shift (50 threads); after 0: 'x' is read" in str(schedule)


def test_aliases_and_columns(device):
    x = wp.zeros((4, 6), device=device)
    alias = wp.array(ptr=x.ptr, shape=(24,), dtype=float, device=device)
    with wp.ScopedCapture(device, optimize=True) as capture:
        wp.launch(whole_rows, 6, [x, 1, 2.0], device=device)
        wp.launch(whole_rows, 5, [x, 2, 2.0], device=device)
        wp.launch(scale, 6, [alias[6:12], 2.0], device=device)
        wp.copy(x[:, 0], x[:, 5])
        x[:, 1].fill_(3.0)
    schedule = capture.graph.schedule()
    assert [sorted(node.before) for node in schedule.nodes] == [[], [], [0], [1, 2], [1, 2]]


def test_bodies_change_what_follows(device, monkeypatch):
    monkeypatch.setattr(wp.config, "fuse_graphs", False)
    if wp.get_device(device).is_cuda and not wp.is_conditional_graph_supported():
        pytest.skip("the driver has no conditional nodes")
    n, x, y = (
        wp.zeros(1, dtype=int, device=device),
        wp.ones(8, device=device),
        wp.ones(8, device=device),
    )
    with wp.ScopedCapture(device, optimize=True) as capture:
        n.fill_(3)
        wp.launch(scale, 8, [y, 2.0], device=device)
        wp.capture_while(n, lambda: wp.launch(halve, 8, [n, x], device=device))
        wp.launch(shift, 8, [x, y, 0], device=device)
    wp.capture_launch(capture.graph)
    # x = 1 -> 1.5 -> 1.75 -> 1.875; y = 0.5 * 3 + 1.875.
    assert (y.numpy() == 3.375).all()
    assert n.numpy()[0] == 0
    schedule = capture.graph.schedule()
    names = [node.name for node in schedule.nodes]
    assert names == ["fill", "scale", "condition", "while", "shift"]
    assert sorted(schedule.nodes[4].before) == [1, 3]
    assert [node.name for node in schedule.nodes[3].body.nodes] == ["halve", "condition"]


snippet = "x[0] = x[0] + 1.0f;"


@wp.func_native(snippet)
def native_add(x: wp.array[float]): ...


@wp.kernel
def by_native_code(x: wp.array[float]):
    native_add(x)


@wp.kernel
def by_address(address: wp.uint64):
    x = wp.array(ptr=address, shape=(1,), dtype=float)
    x[0] = x[0] + 1.0


@wp.kernel
def printing(x: wp.array[float]):
    printf("%f\n", x[0])


@pytest.mark.parametrize("kernel", [by_native_code, by_address])
def test_what_may_reach_anything_keeps_its_order(device, kernel):
    x, y = wp.zeros(8, device=device), wp.zeros(8, device=device)
    argument = x.ptr if kernel is by_address else x
    with wp.ScopedCapture(device, optimize=True) as capture:
        wp.launch(scale, 8, [y, 2.0], device=device)
        wp.launch(kernel, 1, [argument], device=device)
        wp.launch(scale, 8, [y, 2.0], device=device)
    nodes = capture.graph.schedule().nodes
    assert [sorted(node.before) for node in nodes] == [[], [0], [1]]
    assert nodes[1].barrier == "it may reach memory that no argument names"


@wp.kernel
def raise_points(points: wp.array[wp.vec3]):
    i = wp.tid()
    points[i] = points[i] + wp.vec3(0.0, 1.0, 0.0)


@wp.kernel
def height(mesh: wp.uint64, y: wp.array[float]):
    y[wp.tid()] = wp.mesh_eval_position(mesh, 0, 0.25, 0.5)[1]


@pytest.mark.parametrize("is_verified", [False, True])
def test_meshes_may_get_other_points_between_replays(device, is_verified, monkeypatch):
    """A handle leads to other memory than at the capture: views of arrays that launches write."""
    monkeypatch.setattr(wp.config, "verify_graphs", is_verified)
    corners = np.array([[-9, 0, -9], [9, 0, -9], [0, 0, 9]], dtype=np.float32)
    both = wp.array(np.concatenate([corners, corners + [0, 20, 0]]), dtype=wp.vec3, device=device)
    alias = wp.array(ptr=both.ptr, shape=(6,), dtype=wp.vec3, device=device)
    low, high = both[:3], both[3:]
    mesh = wp.Mesh(low, wp.array([0, 1, 2], dtype=int, device=device))
    y = wp.zeros(1, device=device)
    with wp.ScopedCapture(device, optimize=True) as capture:
        wp.launch(raise_points, 3, [alias[:3]], device=device)
        wp.launch(raise_points, 3, [alias[3:]], device=device)
        wp.launch(height, 1, [mesh.id, y], device=device)
        wp.launch(raise_points, 6, [alias], device=device)
    for turn, (points, base) in enumerate([(low, 1), (high, 21), (high, 21), (low, 1)]):
        mesh.points = points
        wp.capture_launch(capture.graph)
        assert y.numpy()[0] == base + 2 * turn


def test_another_thread_writes_during_replays():
    """Each element that a graph of a CPU reads is an old or a new one; others stay as they are."""
    size = 4096
    x, y = wp.full(size, 5.0, device="cpu"), wp.zeros((4, size), device="cpu")
    with wp.ScopedCapture("cpu", optimize=True) as capture:
        for i in range(4):
            y[i].zero_()
            wp.launch(shift, size - i, [x, y[i], i], device="cpu")
    view, stop = x.numpy(), threading.Event()

    def write():
        while not stop.is_set():
            view[:] = 7.0
            view[:] = 5.0

    writer = threading.Thread(target=write)
    writer.start()
    try:
        for _ in range(200):
            wp.capture_launch(capture.graph)
            for i in range(4):
                row = y.numpy()[i]
                assert np.isin(row[: size - i], (5.0, 7.0)).all() and not row[size - i :].any()
    finally:
        stop.set()
        writer.join()
    wp.capture_launch(capture.graph)
    assert (y.numpy()[0] == 5.0).all()


def test_output_keeps_its_order(device):
    x, y = wp.zeros(8, device=device), wp.zeros(8, device=device)
    with wp.ScopedCapture(device, optimize=True) as capture:
        wp.launch(printing, 1, [x], device=device)
        wp.launch(scale, 8, [y, 2.0], device=device)
        wp.launch(printing, 1, [y], device=device)
    nodes = capture.graph.schedule().nodes
    assert [sorted(node.before) for node in nodes] == [[], [], [0, 1]]
    assert nodes[2].before[0] == "'output' is written again"


def test_gradients_are_memory(device):
    x = wp.ones(8, device=device, requires_grad=True)
    y, z = wp.zeros(8, device=device, requires_grad=True), wp.zeros(8, device=device)
    with wp.Tape() as tape:
        wp.launch(shift, 8, [x, y, 1], device=device)
    y.grad.fill_(1.0)
    tape.backward()
    expected = x.grad.numpy()
    tape.zero()
    with wp.ScopedCapture(device, optimize=True) as capture:
        y.grad.fill_(1.0)
        wp.launch(scale, 8, [z, 2.0], device=device)
        tape.backward()
        wp.copy(z, x.grad)
    wp.capture_launch(capture.graph)
    assert (z.numpy() == expected).all()
    nodes = capture.graph.schedule().nodes
    assert sorted(nodes[-1].before)[0] == 1
    assert any("grad" in reason for node in nodes for reason in node.before.values())


def test_launches_and_copies_of_nothing_are_left_out(device):
    x = wp.zeros(8, device=device)
    with wp.ScopedCapture(device, optimize=True) as capture:
        wp.launch(scale, 0, [x, 2.0], device=device)
        wp.copy(x[:0], x[4:4])
        x[:0].fill_(1.0)
    assert capture.graph.node_count == 0
    assert capture.graph.schedule().nodes == ()


@pytest.mark.parametrize("fuses", [False, True])
def test_fills_of_many_types_and_lengths(device, fuses, monkeypatch):
    """Fills, also those that are one kernel, write the bytes that NumPy writes, and no others."""
    monkeypatch.setattr(wp.config, "fuse_graphs", fuses)
    rng = np.random.default_rng(3)
    cases = []
    for dtype, value, number in (
        (wp.int8, 7, np.int8),
        (wp.int16, -300, np.int16),
        (wp.float32, 1.5, np.float32),
        (wp.float64, -2.25, np.float64),
        (wp.vec4, wp.vec4(1.0, 2.0, 3.0, 4.0), np.float32),
        (wp.vec3, wp.vec3(0.0), np.float32),
        (wp.vec3, wp.vec3(1.0, 2.0, 3.0), np.float32),
    ):
        for length in (1, 5, 333, 20000):
            width = len(value) if hasattr(value, "__len__") else 1
            old = rng.integers(1, 100, (length + 3, width)).astype(number)
            array = wp.array(old if width > 1 else old[:, 0], dtype=dtype, device=device)
            begin = int(rng.integers(0, 3))
            old[begin : begin + length] = np.array(value, number)
            cases.append((array, slice(begin, begin + length), value, old))
    with wp.ScopedCapture(device, optimize=True) as capture:
        for array, where, value, _ in cases:
            array[where].fill_(value)
        x = wp.zeros(100, device=device)
        wp.launch(scale, 100, [x, 2.0], device=device)
        x.zero_()
    for _ in range(2):
        wp.capture_launch(capture.graph)
    for array, where, value, expected in cases:
        found = array.numpy().reshape(expected.shape)
        np.testing.assert_array_equal(found, expected, f"{array.dtype} {where} {value}")
    np.testing.assert_array_equal(x.numpy(), np.zeros(100, np.float32))
    if x.device.is_cuda:
        names = [node.name for node in capture.graph.schedule().nodes]
        assert any(name.endswith(" fills") for name in names) == fuses, names


def test_options(device):
    x = wp.zeros(8, device=device)

    def captured(**options):
        with wp.ScopedCapture(device, **options) as capture:
            wp.launch(scale, 8, [x, 2.0], device=device)
        return capture.graph

    assert captured(optimize=True).schedule().branches == 1
    with pytest.raises(RuntimeError, match="capture it with `optimize=True`"):
        captured(optimize=False).schedule()
    if wp.get_device(device).is_cuda:
        assert captured().schedule().edges == 0
    else:
        with pytest.raises(RuntimeError, match="order of its recording"):
            captured().schedule()
    for setting in (True, False):
        wp.config.optimize_graphs = setting
        try:
            assert captured(optimize=True).schedule().edges == 0
            for options in ({"optimize": False}, {}):
                if setting and not options:
                    assert captured(**options).schedule().edges == 0
                    continue
                with pytest.raises(RuntimeError, match="order of its recording"):
                    captured(**options).schedule()
        finally:
            wp.config.optimize_graphs = None
    wp.config.mode = "debug"
    try:
        with pytest.raises(RuntimeError, match="order of its recording"):
            captured(optimize=True).schedule()
    finally:
        wp.config.mode = "release"


def test_pictures(device, tmp_path):
    x, y = wp.zeros(8, device=device), wp.zeros(8, device=device)
    with wp.ScopedCapture(device, optimize=True) as capture:
        # Launches of equal extents would be one.
        for i in range(2):
            wp.launch(scale, 8 - i, [x, 2.0], device=device)
            wp.launch(scale, 6 - i, [y, 2.0], device=device)
        wp.launch(shift, 8, [x, y, 0], device=device)
    capture.graph.save_picture(tmp_path / "graph.svg")
    root = xml.etree.ElementTree.parse(tmp_path / "graph.svg").getroot()
    kinds = [element.tag.split("}")[1] for element in root.iter()]
    assert (kinds.count("rect"), kinds.count("path")) == (5, 4)
    capture.graph.save_picture(tmp_path / "graph.dot")
    text = (tmp_path / "graph.dot").read_text()
    assert text.count("->") == 4
    assert 'n4 [label="shift (8 threads)"]' in text
