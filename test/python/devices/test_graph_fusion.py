"""Launches of graphs that are one: which are, which are not, and the bits of eager launches."""

import numpy as np
import pytest

import warp as wp
from warp._src.arrays.hooks import captures


@wp.kernel
def scale(x: wp.array[float], factor: float, y: wp.array[float]):
    i = wp.tid()
    y[i] = factor * x[i]


@wp.kernel
def add(x: wp.array[float], y: wp.array[float]):
    i = wp.tid()
    y[i] = y[i] + x[i]


@wp.kernel
def mirror(x: wp.array[float], y: wp.array[float]):
    i = wp.tid()
    y[i] = x[x.shape[0] - 1 - i]


@wp.kernel
def whole_row(x: wp.array2d[float], sums: wp.array[float]):
    i = wp.tid()
    s = float(0.0)
    for j in range(x.shape[1]):
        s += x[i, j]
    sums[i] = s


@wp.kernel
def fill_row(x: wp.array2d[float], value: float):
    i = wp.tid()
    for j in range(x.shape[1]):
        x[i, j] = value * float(i + j)


@wp.kernel
def by_entry(x: wp.array2d[float], factor: float):
    i, j = wp.tid()
    x[i, j] = factor * x[i, j] + 0.1


@wp.kernel
def flat_entry(x: wp.array[float], width: int, factor: float):
    i, j = wp.tid()
    x[i * width + j] = factor * x[i * width + j] - 0.3


@wp.kernel
def column(x: wp.array2d[float], j: int):
    i = wp.tid()
    x[i, j] = x[i, j] + 1.0


@wp.kernel
def count(x: wp.array[float], counts: wp.array[int]):
    i = wp.tid()
    if x[i] > 0.5:
        wp.atomic_add(counts, 0, 1)


@wp.kernel
def gather(x: wp.array[float], indices: wp.array[int], y: wp.array[float]):
    i = wp.tid()
    y[i] = x[indices[i]]


def fusions(graph):
    return graph.schedule().fusions


def random_array(n, seed=0):
    return wp.array(np.random.default_rng(seed).random(n).astype(np.float32))


@pytest.fixture(autouse=True)
def on_cpu():
    with wp.ScopedDevice("cpu"):
        yield


@pytest.fixture
def verified():
    wp.config.verify_graphs = True
    yield
    wp.config.verify_graphs = False


def captured(step):
    with wp.ScopedCapture(optimize=True) as capture:
        step()
    return capture.graph


def check(step, arrays, expected):
    """The graph of a step fuses what is expected and leaves what eager launches do."""
    start = [array.numpy().copy() for array in arrays]
    step()
    eager = [array.numpy().copy() for array in arrays]
    graph = captured(step)
    for array, values in zip(arrays, start):
        array.assign(values)
    wp.capture_launch(graph)
    for array, values in zip(arrays, eager):
        assert array.numpy().tobytes() == values.tobytes()
    assert fusions(graph) == expected
    return graph


@pytest.mark.parametrize("n", [1, 10, 1000, 100_000])
def test_chain_of_elements(n):
    """Launches that read what the same thread wrote are one, and round as separate ones do."""
    x, y, z = random_array(n), random_array(n, 1), random_array(n, 2)

    def step():
        wp.launch(scale, n, [x, 1.1, y])
        wp.launch(add, n, [y, z])
        wp.launch(scale, n, [z, 0.7, x])

    check(step, [x, y, z], (("scale", "add", "scale"),))
    # A fused multiply-add of the first two would round once: the reference rounds twice.
    a, c = random_array(n).numpy().copy(), random_array(n, 2).numpy().copy()
    x.assign(a), z.assign(c)
    wp.capture_launch(
        captured(lambda: [wp.launch(scale, n, [x, 1.1, y]), wp.launch(add, n, [y, z])])
    )
    assert np.array_equal(z.numpy(), c + np.float32(1.1) * a)


def test_other_threads():
    """A launch that reads what another thread wrote stays apart, and the schedule says so."""
    x, y, z = random_array(100), random_array(100, 1), random_array(100, 2)

    def step():
        wp.launch(scale, 100, [x, 2.0, y])
        wp.launch(mirror, 100, [y, z])

    graph = check(step, [x, y, z], ())
    assert "threads share elements of 'x'" in str(graph.schedule())


def test_gather_stays_apart():
    """An index that memory gives may be any thread's."""
    x, y, z = random_array(100), random_array(100, 1), random_array(100, 2)
    indices = wp.array(np.random.default_rng(3).permutation(100).astype(np.int32))

    def step():
        wp.launch(scale, 100, [x, 2.0, y])
        wp.launch(gather, 100, [y, indices, z])

    check(step, [x, y, z], ())


def test_overwritten_behind_readers():
    """An element that another thread has yet to read is not overwritten early."""
    x, y = random_array(64), random_array(64, 1)

    def step():
        wp.launch(mirror, 64, [x, y])
        wp.launch(scale, 64, [y, 3.0, x])

    check(step, [x, y], ())


def test_rows():
    """A thread's row is its own, whatever the other index is."""
    x = wp.array(np.random.default_rng(5).random((40, 7)).astype(np.float32))

    def step():
        wp.launch(column, 40, [x, 3])
        wp.launch(column, 40, [x, 3])
        wp.launch(column, 40, [x, 2])

    check(step, [x], (("column", "column", "column"),))


def test_lanes_are_kept():
    """Code with fewer lanes than that of the parts is not used."""
    x, sums = wp.zeros((4000, 7)), wp.zeros(4000)

    def step():
        wp.launch(fill_row, 4000, [x, 0.3])
        wp.launch(whole_row, 4000, [x, sums])

    graph = captured(step)
    wp.capture_launch(graph)
    i, j = np.meshgrid(np.arange(4000), np.arange(7), indexing="ij")
    expected = (np.float32(0.3) * (i + j).astype(np.float32)).astype(float).sum(axis=1)
    assert np.allclose(sums.numpy(), expected, rtol=1e-6)
    assert fusions(graph) or "fewer lanes" in str(graph.schedule())


def test_two_dimensions():
    """Threads of two dimensions are told apart by one index of both, if rows do not overlap."""
    x = wp.zeros(60)
    square = wp.zeros((6, 10))

    def step(width):
        wp.launch(flat_entry, (6, 10), [x, width, 0.5])
        wp.launch(flat_entry, (6, 10), [x, width, 0.25])

    check(lambda: step(10), [x], (("flat_entry", "flat_entry"),))
    graph = captured(lambda: step(5))
    assert fusions(graph) == ()
    check(
        lambda: [
            wp.launch(by_entry, (6, 10), [square, 0.5]),
            wp.launch(by_entry, (6, 10), [square, 1.5]),
        ],
        [square],
        (("by_entry", "by_entry"),),
    )


def test_other_extents():
    """Launches of other extents are two."""
    x = random_array(100)

    def step():
        wp.launch(scale, 100, [x, 2.0, x])
        wp.launch(scale, 50, [x, 2.0, x])

    check(step, [x], ())


def test_views_that_overlap():
    """Arrays that overlap under several names are no one thread's."""
    x = random_array(101)

    def step():
        wp.launch(scale, 100, [x[:100], 2.0, x[:100]])
        wp.launch(add, 100, [x[1:], x[:100]])
        wp.launch(scale, 100, [x[:100], 0.5, x[:100]])

    check(step, [x], ())


def test_stride_zero():
    """All threads of a broadcast array have one element."""
    x = wp.array(ptr=random_array(1).ptr, shape=(8,), strides=(0,), dtype=float)
    base = random_array(4)
    x = wp.array(ptr=base.ptr, shape=(8,), strides=(0,), dtype=float)
    y = wp.zeros(8)

    def step():
        wp.launch(scale, 8, [y, 2.0, x])
        wp.launch(add, 8, [x, y])

    assert fusions(captured(step)) == ()


def test_between():
    """A node that has to run between two launches keeps them apart."""
    x, y, z = random_array(50), random_array(50, 1), random_array(50, 2)

    def step():
        wp.launch(scale, 50, [x, 2.0, y])
        wp.copy(z, y)
        wp.launch(add, 50, [z, y])

    check(step, [x, y, z], ())


@wp.kernel
def collect(x: wp.array[float], total: wp.array[float]):
    wp.atomic_add(total, 0, x[wp.tid()])


@wp.kernel
def take_slot(x: wp.array[float], counts: wp.array[int], slots: wp.array[int]):
    i = wp.tid()
    slots[i] = wp.atomic_add(counts, 0, 1)


def test_updates():
    """Sums of integers have any order; those of floats and slots of a counter keep their plan."""
    x, counts, total = random_array(50), wp.zeros(1, dtype=int), wp.zeros(1)
    slots = wp.zeros(50, dtype=int)

    def step():
        wp.launch(scale, 50, [x, 1.5, x])
        wp.launch(count, 50, [x, counts])

    check(step, [x, counts], (("scale", "count"),))

    def add_up():
        wp.launch(scale, 50, [x, 1.5, x])
        wp.launch(collect, 50, [x, total])

    graph = check(add_up, [x, total], ())
    assert "it updates elements" in str(graph.schedule())

    def take():
        wp.launch(scale, 50, [x, 1.5, x])
        wp.launch(take_slot, 50, [x, counts, slots])

    check(take, [x, counts, slots], ())


def test_updates_of_what_others_read():
    """A sum that another launch of the same extents reads or clears is complete before."""
    x, counts = random_array(50), wp.zeros(50, dtype=int)

    @wp.kernel
    def spread(counts: wp.array[int], x: wp.array[float]):
        i = wp.tid()
        x[i] = x[i] + float(counts[0])

    @wp.kernel
    def clear(counts: wp.array[int]):
        counts[wp.tid()] = 0

    def step():
        wp.launch(clear, 50, [counts])
        wp.launch(count, 50, [x, counts])
        wp.launch(spread, 50, [counts, x])

    check(step, [x, counts], ())


def test_same_array_twice():
    """An array that is passed under two names is one argument."""
    x = random_array(70)

    def step():
        wp.launch(scale, 70, [x, 2.0, x])
        wp.launch(add, 70, [x, x])
        wp.launch(scale, 70, [x, 0.25, x])

    check(step, [x], (("scale", "add", "scale"),))


def test_recorded_order_and_debug():
    """`optimize=False` runs what was recorded; debug mode fuses nothing."""
    x = random_array(70)

    def step():
        wp.launch(scale, 70, [x, 2.0, x])
        wp.launch(scale, 70, [x, 0.25, x])

    with wp.ScopedCapture(optimize=False) as capture:
        step()
    with pytest.raises(wp.WarpError, match="recording"):
        capture.graph.schedule()
    wp.config.mode = "debug"
    try:
        with wp.ScopedCapture(optimize=True) as capture:
            wp.launch(scale, 70, [x, 2.0, x])
            wp.launch(scale, 70, [x, 0.25, x])
        with pytest.raises(wp.WarpError, match="recording"):
            capture.graph.schedule()
    finally:
        wp.config.mode = "release"


def test_setting():
    """`wp.config.fuse_graphs = False` keeps launches as they were recorded."""
    x = random_array(70)
    wp.config.fuse_graphs = False
    try:
        graph = captured(lambda: [wp.launch(scale, 70, [x, 2.0, x]) for _ in range(2)])
    finally:
        wp.config.fuse_graphs = True
    assert [node.name for node in graph.schedule().nodes] == ["scale", "scale"]


def test_body_of_loop():
    """Bodies of branches and loops are optimised as well."""
    x, left = random_array(30), wp.zeros(1, dtype=int)

    @wp.kernel
    def decrement(n: wp.array[int]):
        n[0] = n[0] - 1

    def body():
        wp.launch(scale, 30, [x, 2.0, x])
        wp.launch(scale, 30, [x, 0.625, x])
        wp.launch(decrement, 1, [left])

    with wp.ScopedCapture(optimize=True) as capture:
        left.fill_(3)
        wp.capture_while(left, body)
    start = x.numpy().copy()
    wp.capture_launch(capture.graph)
    expected = start.copy()
    for _ in range(3):
        expected = np.float32(0.625) * (np.float32(2.0) * expected)
    assert np.array_equal(x.numpy(), expected)
    loop = next(node for node in capture.graph.schedule().nodes if node.body)
    assert loop.body.fusions == (("scale", "scale"),)


@wp.func
def long_way(x: float):
    s = x
    for k in range(12):
        s = s + wp.sin(s * float(k)) * 0.25
    return s


def test_functions_of_both_parts():
    """Functions of one name that two kernels call stay the function of each."""

    def make(factor):
        @wp.func
        def change(x: float):
            return factor * long_way(x)

        @wp.kernel(module="unique")
        def apply(x: wp.array[float]):
            i = wp.tid()
            x[i] = change(x[i])

        return apply

    x = random_array(33)
    first, second = make(wp.constant(0.5)), make(wp.constant(-1.5))

    def step():
        wp.launch(first, 33, [x])
        wp.launch(second, 33, [x])

    name = first.key.replace(".", "_").replace("<locals>", "")
    check(step, [x], ((name, name),))


@wp.struct
class Body:
    position: wp.array[wp.vec3]
    velocity: wp.array[wp.vec3]
    mass: float


@wp.kernel
def fall(body: Body, dt: float):
    i = wp.tid()
    body.velocity[i] = body.velocity[i] + wp.vec3(0.0, -9.81 * dt / body.mass, 0.0)


@wp.kernel
def drift(body: Body, dt: float):
    i = wp.tid()
    body.position[i] = body.position[i] + dt * body.velocity[i]


def test_structs():
    """Arrays in structs count, and structs of equal contents are one argument."""
    body = Body()
    body.position, body.velocity = wp.zeros(20, dtype=wp.vec3), wp.ones(20, dtype=wp.vec3)
    body.mass = 2.0

    def step():
        wp.launch(fall, 20, [body, 0.1])
        wp.launch(drift, 20, [body, 0.1])

    check(step, [body.position, body.velocity], (("fall", "drift"),))


def test_host_calls_and_copies_between():
    """Calls of the host keep their place between launches."""
    x, y = random_array(24), wp.zeros(24)
    seen = []
    with wp.ScopedCapture(optimize=True) as capture:
        wp.launch(scale, 24, [x, 2.0, x])
        next(iter(captures.values())).add_host(lambda: seen.append(float(x.numpy()[0])), "look")
        wp.launch(scale, 24, [x, 2.0, x])
        wp.copy(y, x)
    first = float(x.numpy()[0])
    wp.capture_launch(capture.graph)
    assert seen == [2.0 * first]
    assert y.numpy()[0] == 4.0 * first
    assert fusions(capture.graph) == ()


def test_arrays_of_the_capture():
    """Arrays that the captured step allocates, and frees, are the graph's."""
    x = random_array(60)

    def step():
        y = wp.empty(60)
        wp.launch(scale, 60, [x, 2.0, y])
        wp.launch(add, 60, [y, x])
        del y
        z = wp.zeros(60)
        wp.launch(add, 60, [x, z])
        wp.launch(scale, 60, [z, 0.5, x])

    start = x.numpy().copy()
    graph = captured(step)
    wp.capture_launch(graph)
    assert np.array_equal(x.numpy(), np.float32(1.5) * start)
    wp.capture_launch(graph)
    assert np.array_equal(x.numpy(), np.float32(1.5) * (np.float32(1.5) * start))
    assert graph.schedule().fused >= 4


@wp.kernel
def closest(mesh: wp.uint64, points: wp.array[wp.vec3], y: wp.array[float]):
    i = wp.tid()
    found = wp.mesh_query_point(mesh, points[i], 10.0)
    y[i] = wp.length(points[i] - wp.mesh_eval_position(mesh, found.face, found.u, found.v))


@wp.kernel
def raise_points(points: wp.array[wp.vec3]):
    i = wp.tid()
    points[i] = points[i] + wp.vec3(0.0, 1.0, 0.0)


def test_geometry_between():
    """Launches that move a mesh, its refit and queries keep their order."""
    corners = np.array([[-9, 0, -9], [9, 0, -9], [0, 0, 9]], dtype=np.float32)
    vertices = wp.array(corners, dtype=wp.vec3)
    mesh = wp.Mesh(vertices, wp.array([0, 1, 2], dtype=int))
    points, y = wp.zeros(3, dtype=wp.vec3), wp.zeros(3)
    with wp.ScopedCapture(optimize=True) as capture:
        wp.launch(raise_points, 3, [vertices])
        mesh.refit()
        wp.launch(closest, 3, [mesh.id, points, y])
        wp.launch(scale, 3, [y, 2.0, y])
    for turn in range(1, 4):
        wp.capture_launch(capture.graph)
        assert np.allclose(y.numpy(), 2.0 * turn, rtol=1e-6)
    assert fusions(capture.graph) == ()


@wp.kernel
def take_ticket(counts: wp.array[int], tickets: wp.array[int]):
    i = wp.tid()
    tickets[i] = wp.atomic_add(counts, i, 2)


@wp.kernel
def double_ticket(tickets: wp.array[int]):
    i = wp.tid()
    tickets[i] = 2 * tickets[i]
    if tickets[i] > 1000000:
        wp.printf("%d\n", tickets[i])


@pytest.mark.cuda
def test_used_updates_and_output_on_a_gpu():
    """On GPUs, results of updates may be used by fused launches, and one of these may print."""
    with wp.ScopedDevice("cuda:0"):
        counts, tickets = wp.full(500, 3, dtype=int), wp.zeros(500, dtype=int)

        def step():
            wp.launch(take_ticket, 500, [counts, tickets])
            wp.launch(double_ticket, 500, [tickets])

        check(step, [counts, tickets], (("take_ticket", "double_ticket"),))
        assert np.array_equal(tickets.numpy(), np.full(500, 6))

        def prints_twice():
            wp.launch(double_ticket, 500, [tickets])
            wp.launch(double_ticket, 500, [tickets])

        graph = check(prints_twice, [tickets], ())
        assert "both of them print" in str(graph.schedule())


@wp.kernel
def neighbours(grid: wp.uint64, points: wp.array[wp.vec3], counts: wp.array[int]):
    i = wp.tid()
    found = int(0)
    for j in wp.hash_grid_query(grid, points[i], 1.0):
        if wp.length(points[i] - points[j]) < 1.0:
            found += 1
    counts[i] = found


def test_handles_rebuilt_between_captures():
    """Graphs search the grid as it was built last, before their capture or between replays."""
    grid, rng = wp.HashGrid(8, 8, 8), np.random.default_rng(7)
    graphs = []

    def expected(at):
        return (np.linalg.norm(at[:, None] - at[None], axis=2) < 1.0).sum(axis=1)

    for size in (40, 400):
        at = rng.uniform(0.0, 6.0, (size, 3))
        points, counts = wp.array(at, dtype=wp.vec3), wp.zeros(size, dtype=int)
        grid.build(points, 1.0)

        def step(points=points, counts=counts, size=size):
            counts.fill_(-1)
            wp.launch(neighbours, size, [grid.id, points, counts])

        graphs.append((captured(step), points, counts, expected(at)))
    for graph, points, counts, right in (graphs[1], graphs[0], graphs[1]):
        grid.build(points, 1.0)
        wp.capture_launch(graph)
        assert np.array_equal(counts.numpy(), right)


def test_deterministic():
    """In deterministic mode sums keep their launch, and the bits of two replays and eager agree."""
    x, total = random_array(5000), wp.zeros(1)

    @wp.kernel(module_options={"deterministic": True}, module="unique")
    def halve(x: wp.array[float]):
        i = wp.tid()
        x[i] = 0.5 * x[i] + 0.25

    @wp.kernel(module_options={"deterministic": True}, module="unique")
    def sum_up(x: wp.array[float], total: wp.array[float]):
        wp.atomic_add(total, 0, x[wp.tid()])

    def step():
        wp.launch(halve, 5000, [x])
        wp.launch(sum_up, 5000, [x, total])

    check(step, [x, total], ())


def test_error_names_the_kernel(capfd):
    """A failed check is one of the kernel and line that has it: such launches stay apart."""
    x = random_array(8)

    @wp.kernel(module="unique")
    def insist(x: wp.array[float]):
        i = wp.tid()
        assert x[i] < 1.0e6, "too large"
        x[i] = 2.0 * x[i]

    wp.config.mode = "debug"
    try:
        with wp.ScopedCapture(optimize=True) as capture:
            wp.launch(scale, 8, [x, 1.0e7, x])
            wp.launch(insist, 8, [x])
        with pytest.raises(wp.WarpError, match=r"(?s)insist.*too large|too large.*insist"):
            wp.capture_launch(capture.graph)
            wp.synchronize()
    finally:
        wp.config.mode = "release"


def test_graph_in_graph():
    """A fused graph that another capture launches is part of that."""
    x = random_array(40)

    def step():
        wp.launch(scale, 40, [x, 2.0, x])
        wp.launch(scale, 40, [x, 1.5, x])

    inner = captured(step)
    start = x.numpy().copy()

    def outer():
        wp.launch(scale, 40, [x, 0.5, x])
        wp.capture_launch(inner)
        wp.launch(scale, 40, [x, 0.5, x])

    wp.capture_launch(captured(outer))
    assert np.array_equal(x.numpy(), np.float32(0.75) * start)


class Program:
    """Random launches, most of equal extents, over arrays and views."""

    def __init__(self, seed):
        self.seed = seed
        self.arrays = [random_array(48, seed + k) for k in range(4)]
        self.indices = wp.array(np.random.default_rng(seed).permutation(16).astype(np.int32))

    def view(self, rng):
        array = self.arrays[rng.integers(4)]
        return array[int(rng.integers(3)) * 8 :][:16] if rng.integers(4) == 0 else array[:16]

    def step(self):
        rng = np.random.default_rng(self.seed)
        for _ in range(int(rng.integers(4, 14))):
            x, y, kind = self.view(rng), self.view(rng), rng.integers(9)
            factor = float(rng.integers(1, 7)) / 4.0
            if kind < 3:
                wp.launch(scale, 16, [x, factor, y])
            elif kind < 6:
                wp.launch(add, 16, [x, y])
            elif kind == 6:
                wp.launch(mirror, 16, [x, y])
            elif kind == 7:
                wp.launch(gather, 16, [x, self.indices, y])
            else:
                wp.launch(scale, 16, [x, factor, x])


def test_random_programs(verified, device):
    """Random programs leave the memory of eager launches, in the latest order that edges allow."""
    with wp.ScopedDevice(device):
        compare_random_programs()


def compare_random_programs():
    fused = 0
    for seed in range(120):
        program = Program(seed)
        start = [array.numpy().copy() for array in program.arrays]
        program.step()
        eager = [array.numpy().copy() for array in program.arrays]
        graph = captured(program.step)
        fused += graph.schedule().fused
        for array, values in zip(program.arrays, start):
            array.assign(values)
        wp.capture_launch(graph)
        for array, values in zip(program.arrays, eager):
            assert array.numpy().tobytes() == values.tobytes()
    assert fused > 100
