"""Launches whose first extents are equal, run by blocks for each row: bits of eager launches."""

import numpy as np
import pytest

import warp as wp
from warp import _native


@wp.kernel
def entries(x: wp.array2d[float], y: wp.array2d[float]):
    i, j = wp.tid()
    if x[i, j] < 0.1:
        return
    y[i, j] = 1.5 * x[i, j] + 0.3


@wp.kernel
def reverse(x: wp.array2d[float], y: wp.array2d[float]):
    i, j = wp.tid()
    y[i, j] = 0.7 * x[i, x.shape[1] - 1 - j] + x[i, j]


@wp.kernel
def total(x: wp.array2d[float], sums: wp.array[float]):
    i = wp.tid()
    s = float(0.0)
    for j in range(x.shape[1]):
        s += x[i, j]
    sums[i] = s


@wp.kernel
def products(x: wp.array2d[float], sums: wp.array[float], out: wp.array3d[float]):
    i, j, k = wp.tid()
    out[i, j, k] = x[i, j] * x[i, k] + sums[i]


@wp.kernel
def columns(products: wp.array3d[float], x: wp.array2d[float]):
    i, j = wp.tid()
    s = float(0.0)
    for k in range(products.shape[2]):
        s += products[i, k, j]
    x[i, j] = 0.01 * s


@wp.kernel
def centred(x: wp.array2d[float], sums: wp.array[float], y: wp.array2d[float]):
    i, j = wp.tid()
    y[i, j] = x[i, j] - sums[i] / float(x.shape[1]) + 1.0


@wp.kernel
def flat(x: wp.array[float], width: int, factor: float):
    i, j = wp.tid()
    x[i * width + j] = factor * x[i * width + j] - 0.3


@wp.kernel
def flat_total(x: wp.array[float], width: int, sums: wp.array[float]):
    i = wp.tid()
    s = float(0.0)
    for j in range(width):
        s += x[i * width + j]
    sums[i] = s


@wp.kernel
def first_of_row(x: wp.array[float], width: int, y: wp.array[float]):
    i = wp.tid()
    y[i * width] = x[i * width + width - 1]


@wp.kernel
def next_row(x: wp.array2d[float], y: wp.array2d[float]):
    i, j = wp.tid()
    y[i, j] = x[(i + 1) % x.shape[0], j]


@wp.kernel
def broken(x: wp.array2d[float], indices: wp.array[int], y: wp.array2d[float]):
    i, j = wp.tid()
    y[i, j] = x[indices[i], j]


WIDTH = wp.constant(8)


@wp.kernel
def tile_squares(x: wp.array2d[float], skip: wp.array[int], y: wp.array2d[float]):
    i = wp.tid()
    if skip[i] == 1:
        return
    t = wp.tile_load(x[i], shape=WIDTH)
    wp.tile_store(y[i], t * t + t)


@wp.kernel
def mark(x: wp.array2d[float], skip: wp.array[int]):
    i = wp.tid()
    skip[i] = wp.where(x[i, 0] < 0.3, 1, 0)


@pytest.fixture
def cpu_blocks():
    wp.config.enable_cpu_blocks = True
    yield
    wp.config.enable_cpu_blocks = False


@pytest.fixture(autouse=True)
def rows_on_host(request):
    _native.set_fuses_rows_on_host(True)
    wp.config.fuse_rows = True
    names = request.fixturenames
    with wp.ScopedDevice(request.getfixturevalue("device") if "device" in names else "cpu"):
        yield
    wp.config.fuse_rows = False
    _native.set_fuses_rows_on_host(False)


def random_array(*shape, seed=0):
    return wp.array(np.random.default_rng(seed).random(shape).astype(np.float32))


def check(step, arrays, expected):
    """The graph of a step fuses what is expected and leaves what eager launches do."""
    start = [array.numpy().copy() for array in arrays]
    step()
    eager = [array.numpy().copy() for array in arrays]
    with wp.ScopedCapture(optimize=True) as capture:
        step()
    for _ in range(2):
        for array, values in zip(arrays, start):
            array.assign(values)
        wp.capture_launch(capture.graph)
        for array, values in zip(arrays, eager):
            assert array.numpy().tobytes() == values.tobytes()
    assert capture.graph.schedule().fusions == expected
    return capture.graph


@pytest.mark.parametrize("rows", [64, 101])
@pytest.mark.parametrize("width", [1, 3, 7, 11])
def test_parts_of_a_row(device, rows, width):
    """Elements, other elements of the row, sums of it and products of pairs are one launch."""
    x, y, z = (random_array(rows, width, seed=seed) for seed in range(3))
    sums, pairs = wp.zeros(rows), wp.zeros((rows, width, width))

    def step():
        wp.launch(entries, (rows, width), [x, y])
        wp.launch(reverse, (rows, width), [y, z])
        wp.launch(total, rows, [z, sums])
        wp.launch(products, (rows, width, width), [z, sums, pairs])
        wp.launch(columns, (rows, width), [pairs, x])

    names = ("entries", "reverse", "total", "products", "columns")
    start = [array.numpy().copy() for array in (x, y)]
    check(step, [x, y, z, sums, pairs], (names,))
    # The same in float64.
    a, b = (values.astype(np.float64) for values in start)
    b = np.where(a < np.float64(np.float32(0.1)), b, 1.5 * a + 0.3)
    c = 0.7 * b[:, ::-1] + b
    s = c.sum(axis=1)
    q = c[:, :, None] * c[:, None, :] + s[:, None, None]
    np.testing.assert_allclose(x.numpy(), 0.01 * q.sum(axis=1), rtol=2e-6)


def test_flat_rows():
    """One index of two thread dimensions tells rows apart like digits of a number; one that a loop
    changes may reach the next row."""
    x, y, sums = random_array(100 * 9), random_array(100 * 9, seed=1), wp.zeros(100)

    def step():
        wp.launch(flat, (100, 9), [x, 9, 1.1])
        wp.launch(first_of_row, 100, [x, 9, y])

    check(step, [x, y], (("flat", "first_of_row"),))

    def sum_step():
        wp.launch(flat, (100, 9), [x, 9, 1.1])
        wp.launch(flat_total, 100, [x, 9, sums])

    graph = check(sum_step, [x, sums], ())
    assert "not fused" in str(graph.schedule())


@pytest.mark.parametrize("case", ["other row", "gather", "overlap", "few rows", "wide"])
def test_rows_stay_apart(case):
    """Launches that share elements of several rows, few rows and wide ones stay apart."""
    rows = 20 if case == "few rows" else 100
    width = 200 if case == "wide" else 5
    x, y = random_array(rows + 1, width), random_array(rows, width, seed=1)
    z, sums = wp.zeros((rows, width)), wp.zeros(rows)
    indices = wp.array(np.random.default_rng(2).permutation(rows).astype(np.int32))

    def step():
        wp.launch(entries, (rows, width), [x[:rows], y])
        if case == "other row":
            wp.launch(next_row, (rows, width), [y, z])
        elif case == "gather":
            wp.launch(broken, (rows, width), [y, indices, z])
        elif case == "overlap":
            wp.launch(reverse, (rows, width), [y, x[1:]])
        else:
            wp.launch(total, rows, [y, sums])

    check(step, [x, y, z, sums], ())


def test_aliases(device):
    """One array under two names is one; a view of other strides of the same memory keeps apart."""
    rows, width = 70, 6
    x, y = random_array(rows, width), random_array(rows, width, seed=1)
    sums = wp.zeros(rows)
    again = wp.array(ptr=x.ptr, shape=x.shape, dtype=float)
    flattened = x.flatten()

    def same():
        wp.launch(reverse, (rows, width), [y, x])
        wp.launch(total, rows, [again, sums])

    check(same, [x, y, sums], (("reverse", "total"),))

    def other():
        wp.launch(reverse, (rows, width), [y, x])
        wp.launch(flat_total, rows, [flattened, width, sums])

    check(other, [x, y, sums], ())


@wp.kernel
def count_down(left: wp.array[int]):
    left[0] = left[0] - 1


def test_body_of_loop(device):
    """Rows of a loop's body are one launch, and later launches see what the last turn left."""
    rows, width = 80, 5
    x, y = random_array(rows, width), wp.zeros((rows, width))
    sums, left = wp.zeros(rows), wp.zeros(1, dtype=int)
    start = x.numpy().astype(np.float64)

    def turn():
        wp.launch(reverse, (rows, width), [x, y])
        wp.launch(total, rows, [y, sums])
        wp.launch(centred, (rows, width), [y, sums, x])
        wp.launch(count_down, 1, [left])

    with wp.ScopedCapture(optimize=True) as capture:
        left.fill_(4)
        wp.capture_while(left, turn)
        wp.launch(total, rows, [x, sums])
    wp.capture_launch(capture.graph)
    for _ in range(4):
        y_ = 0.7 * start[:, ::-1] + start
        start = y_ - y_.sum(1, keepdims=True) / width + 1.0
    np.testing.assert_allclose(x.numpy(), start, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(sums.numpy(), start.sum(1), rtol=1e-5)
    body = next(node.body for node in capture.graph.schedule().nodes if node.body)
    assert body.fusions == (("reverse", "total", "centred"),)


@wp.kernel(module_options={"deterministic": True}, module="unique")
def add_up(x: wp.array2d[float], sums: wp.array[float]):
    i, j = wp.tid()
    wp.atomic_add(sums, i, x[i, j])


@wp.kernel(module_options={"deterministic": True}, module="unique")
def fill_up(x: wp.array2d[float], y: wp.array2d[float]):
    i, j = wp.tid()
    y[i, j] = 0.3 * x[i, j]


def test_deterministic_sums():
    """Sums whose order counts keep their launch."""
    x, y, sums = random_array(90, 6), wp.zeros((90, 6)), wp.zeros(90)

    def step():
        wp.launch(fill_up, (90, 6), [x, y])
        wp.launch(add_up, (90, 6), [y, sums])

    graph = check(step, [x, y, sums], ())
    assert "it updates elements" in str(graph.schedule())


@pytest.mark.parametrize("rows", [64, 99])
def test_tiles_of_a_row(cpu_blocks, rows):
    """Blocks that work on a tile of a row are parts, too; a return ends their own part alone."""
    x, y, z = (random_array(rows, 8, seed=seed) for seed in range(3))
    skip, sums = wp.zeros(rows, dtype=int), wp.zeros(rows)
    a, b = x.numpy().astype(np.float64), y.numpy().astype(np.float64)

    def step():
        wp.launch(reverse, (rows, 8), [x, z])
        wp.launch(mark, rows, [z, skip])
        wp.launch_tiled(tile_squares, rows, [z, skip, y], block_dim=32)
        wp.launch(total, rows, [y, sums])

    step()
    c = 0.7 * a[:, ::-1] + a
    taken = z.numpy()[:, :1] >= np.float32(0.3)
    np.testing.assert_allclose(sums.numpy(), np.where(taken, c * c + c, b).sum(1), rtol=2e-6)
    y.assign(b.astype(np.float32))
    check(step, [x, y, z, skip, sums], (("reverse", "mark", "tile_squares", "total"),))


@pytest.mark.parametrize("seed", range(12))
def test_random_programs(device, seed):
    """Random launches over rows leave the bits of eager ones, fused as far as they may be."""
    rng = np.random.default_rng(seed)
    rows, width = int(rng.integers(64, 90)), int(rng.integers(1, 12))
    grids = [random_array(rows, width, seed=10 * seed + k) for k in range(4)]
    sums = [random_array(rows, seed=100 + seed)]
    pairs = [wp.zeros((rows, width, width))]
    calls = []
    for _ in range(12):
        a, b = (grids[k] for k in rng.choice(4, 2, replace=False))
        calls.append(
            (
                lambda a=a, b=b: wp.launch(entries, (rows, width), [a, b]),
                lambda a=a, b=b: wp.launch(reverse, (rows, width), [a, b]),
                lambda a=a: wp.launch(total, rows, [a, sums[0]]),
                lambda a=a: wp.launch(products, (rows, width, width), [a, sums[0], pairs[0]]),
                lambda b=b: wp.launch(columns, (rows, width), [pairs[0], b]),
                lambda a=a, b=b: wp.launch(next_row, (rows, width), [a, b]),
                lambda a=a, b=b: wp.copy(a, b),
            )[rng.integers(7)]
        )
    arrays = [*grids, *sums, *pairs]
    start = [array.numpy().copy() for array in arrays]
    for call in calls:
        call()
    eager = [array.numpy().copy() for array in arrays]
    with wp.ScopedCapture(optimize=True) as capture:
        for call in calls:
            call()
    for array, values in zip(arrays, start):
        array.assign(values)
    wp.capture_launch(capture.graph)
    for array, values in zip(arrays, eager):
        assert array.numpy().tobytes() == values.tobytes()


@wp.func
def put(x: wp.array2d[float], i: int, j: int, value: float):
    x[i, j] = value


@wp.func
def get(x: wp.array2d[float], i: int, j: int):
    return x[i, x.shape[1] - 1 - j]


@wp.kernel
def by_functions(x: wp.array2d[float], y: wp.array2d[float]):
    i, j = wp.tid()
    put(y, i, j, 2.0 * get(x, i, j))


def test_arrays_of_functions():
    """Indices are followed into functions that get the arrays."""
    x, y, sums = random_array(75, 6), wp.zeros((75, 6)), wp.zeros(75)

    def step():
        wp.launch(by_functions, (75, 6), [x, y])
        wp.launch(by_functions, (75, 6), [y, x])
        wp.launch(total, 75, [x, sums])

    check(step, [x, y, sums], (("by_functions", "by_functions", "total"),))
