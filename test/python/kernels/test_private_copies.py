"""Scattered sums of launches that are large beside their arrays: workers sum into copies on CPUs.

Terms are whole numbers, or halves, so that sums are the same in every order.
"""

import threading

import numpy as np
import pytest

import warp as wp

ITEMS = 300_000


def places(bins, count=ITEMS, seed=0):
    return np.random.default_rng(seed).integers(0, bins, count).astype(np.int32)


@wp.kernel
def add_numbers(
    at: wp.array(dtype=int),
    ints: wp.array(dtype=int),
    longs: wp.array(dtype=wp.uint64),
    floats: wp.array(dtype=float),
    doubles: wp.array(dtype=wp.float64),
):
    i = wp.tid()
    j = at[i]
    wp.atomic_add(ints, j, i)
    wp.atomic_sub(longs, j, wp.uint64(3))
    wp.atomic_add(floats, j, 0.5)
    wp.atomic_sub(doubles, j, wp.float64(i))


@pytest.mark.parametrize("bins", [1, 17, 4096, 50_000])
def test_types(device, bins):
    at = places(bins)
    start = np.arange(bins)
    ints = wp.array(start.astype(np.int32), device=device)
    longs = wp.array(start.astype(np.uint64), device=device)
    floats = wp.array(start.astype(np.float32), device=device)
    doubles = wp.array(start.astype(np.float64), device=device)
    arrays = [wp.array(at, device=device), ints, longs, floats, doubles]
    counts = np.bincount(at, minlength=bins)
    # Beyond 2^31 for one bin, where integers wrap.
    indices = np.zeros(bins, np.int64)
    np.add.at(indices, at, np.arange(ITEMS))
    for launch in range(1, 4):
        wp.launch(add_numbers, ITEMS, arrays, device=device)
        wrapped = (start + launch * indices).astype(np.uint64).astype(np.uint32).view(np.int32)
        np.testing.assert_array_equal(ints.numpy(), wrapped)
        expected = start.astype(np.uint64) - (3 * launch * counts).astype(np.uint64)
        np.testing.assert_array_equal(longs.numpy(), expected)
        np.testing.assert_array_equal(floats.numpy(), start + 0.5 * launch * counts)
        np.testing.assert_array_equal(doubles.numpy(), start - launch * indices)


@wp.struct
class Body:
    force: wp.array(dtype=wp.vec3)
    inertia: wp.array2d(dtype=wp.mat33)
    scale: float


@wp.kernel
def add_to_fields(at: wp.array(dtype=int), body: Body, total: wp.array(dtype=float)):
    i = wp.tid()
    j = at[i]
    v = wp.vec3(1.0, 2.0, 0.5) * body.scale
    wp.atomic_add(body.force, j, v)
    wp.atomic_sub(body.inertia, j % 3, j, wp.outer(v, v))
    wp.atomic_add(total, 0, 1.0)


def test_fields_of_structs(device):
    bins = 500
    at = places(bins)
    body = Body()
    body.force = wp.ones(bins, dtype=wp.vec3, device=device)
    body.inertia = wp.zeros((3, bins), dtype=wp.mat33, device=device)
    body.scale = 2.0
    total = wp.zeros(1, dtype=float, device=device)
    inputs = [wp.array(at, device=device), body, total]
    wp.launch(add_to_fields, ITEMS, inputs, device=device)
    counts = np.bincount(at, minlength=bins)
    v = np.array([2.0, 4.0, 1.0])
    np.testing.assert_array_equal(body.force.numpy(), 1.0 + counts[:, None] * v)
    inertia = np.zeros((3, bins, 3, 3))
    inertia[np.arange(bins) % 3, np.arange(bins)] = -counts[:, None, None] * np.outer(v, v)
    np.testing.assert_array_equal(body.inertia.numpy(), inertia)
    assert total.numpy()[0] == ITEMS


@wp.kernel
def add_to_rows(at: wp.array(dtype=int), x: wp.array2d(dtype=float), weight: float):
    i, j = wp.tid()
    row = x[at[i]]
    wp.atomic_add(row, j, weight)
    wp.atomic_add(x, at[i], (j + 1) % 5, -2.0 * weight)


def test_views_in_kernels(device):
    bins = 300
    at = places(bins, ITEMS // 5)
    x = wp.zeros((bins, 5), dtype=float, device=device)
    inputs = [wp.array(at, device=device), x, 1.5]
    wp.launch(add_to_rows, (at.size, 5), inputs, device=device)
    counts = np.bincount(at, minlength=bins)
    expected = np.repeat(-1.5 * counts[:, None], 5, axis=1)
    np.testing.assert_array_equal(x.numpy(), expected)


def test_views_as_arguments(device):
    at = places(100)
    counts = np.bincount(at, minlength=100)
    memory = wp.zeros((3, 100), dtype=wp.uint64, device=device)
    columns = wp.zeros((100, 3), dtype=float, device=device)
    arrays = [
        wp.array(at, device=device),
        wp.zeros(100, dtype=int, device=device),
        memory[1],
        columns[:, 1],
        wp.zeros(100, dtype=wp.float64, device=device),
    ]
    wp.launch(add_numbers, ITEMS, arrays, device=device)
    expected = np.zeros((3, 100), np.uint64)
    expected[1] -= (3 * counts).astype(np.uint64)
    np.testing.assert_array_equal(memory.numpy(), expected)
    np.testing.assert_array_equal(columns.numpy()[:, 1], 0.5 * counts)
    assert not columns.numpy()[:, [0, 2]].any()


@wp.kernel
def add_to_two(at: wp.array(dtype=int), x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(x, at[i], 1.0)
    wp.atomic_add(y, at[i], 2.0)


def test_one_array_under_two_names(device):
    at = places(200)
    counts = np.bincount(at, minlength=200)
    x = wp.zeros(201, dtype=float, device=device)
    inputs = wp.array(at, device=device)
    wp.launch(add_to_two, ITEMS, [inputs, x[:200], x[:200]], device=device)
    np.testing.assert_array_equal(x.numpy()[:200], 3.0 * counts)
    x.zero_()
    wp.launch(add_to_two, ITEMS, [inputs, x[:200], x[1:]], device=device)
    expected = np.zeros(201)
    expected[:200] += counts
    expected[1:] += 2.0 * counts
    np.testing.assert_array_equal(x.numpy(), expected)


@wp.kernel
def gather(
    at: wp.array(dtype=int),
    x: wp.array(dtype=wp.vec3),
    w: wp.array(dtype=float),
    y: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    j = at[i]
    y[i] = x[j] * w[j]


@pytest.mark.parametrize("with_weights", [True, False])
def test_adjoints_of_gathers(device, with_weights):
    bins = 700
    at = places(bins)
    rng = np.random.default_rng(1)
    x = rng.integers(-4, 5, (bins, 3)).astype(np.float32)
    w = rng.integers(1, 4, bins).astype(np.float32)
    seeds = rng.integers(-2, 3, (ITEMS, 3)).astype(np.float32)
    points = wp.array(x, dtype=wp.vec3, device=device, requires_grad=True)
    weights = wp.array(w, dtype=float, device=device, requires_grad=with_weights)
    y = wp.zeros(ITEMS, dtype=wp.vec3, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(gather, ITEMS, [wp.array(at, device=device), points, weights, y], device=device)
    tape.backward(grads={y: wp.array(seeds, dtype=wp.vec3, device=device)})
    of_points = np.zeros((bins, 3))
    np.add.at(of_points, at, seeds * w[at][:, None])
    np.testing.assert_array_equal(points.grad.numpy(), of_points)
    if with_weights:
        of_weights = np.zeros(bins)
        np.add.at(of_weights, at, (seeds * x[at]).sum(1))
        np.testing.assert_array_equal(weights.grad.numpy(), of_weights)


def test_python_threads(device):
    at = places(1000)
    x = wp.zeros(1000, dtype=float, device=device)
    y = wp.zeros(1000, dtype=float, device=device)
    inputs = wp.array(at, device=device)
    launches = 8

    def work():
        for _ in range(launches):
            wp.launch(add_to_two, ITEMS, [inputs, x, y], device=device)

    work()
    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    wp.synchronize()
    counts = np.bincount(at, minlength=1000)
    np.testing.assert_array_equal(x.numpy(), 4.0 * launches * counts)
    np.testing.assert_array_equal(y.numpy(), 8.0 * launches * counts)


def test_empty_launches_and_arrays(device):
    x = wp.zeros(3, dtype=float, device=device)
    empty = wp.zeros(0, dtype=float, device=device)
    at = wp.zeros(0, dtype=int, device=device)
    wp.launch(add_to_two, 0, [at, x, empty], device=device)
    assert not x.numpy().any()


@wp.kernel
def add_some(at: wp.array(dtype=int), x: wp.array(dtype=float)):
    i = wp.tid()
    if at[i] >= 0:
        wp.atomic_add(x, at[i], 1.0)


def test_launches_that_add_nothing(device):
    empty = wp.zeros(0, dtype=float, device=device)
    at = wp.array(np.full(ITEMS, -1, np.int32), device=device)
    wp.launch(add_some, ITEMS, [at, empty], device=device)
    special = np.array([np.nan, np.inf, -np.inf, -0.0, 1e-45] * 16, np.float32)
    x = wp.array(special, device=device)
    wp.launch(add_some, ITEMS, [at, x], device=device)
    np.testing.assert_array_equal(x.numpy().view(np.uint32), special.view(np.uint32))


@wp.kernel
def add_thirds(at: wp.array(dtype=int), x: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(x, at[i], 1.0 / float(i % 7 + 1))


def test_sums_that_round(device):
    at = places(64)
    x = wp.zeros(64, dtype=float, device=device)
    wp.launch(add_thirds, ITEMS, [wp.array(at, device=device), x], device=device)
    expected = np.zeros(64)
    np.add.at(expected, at, 1.0 / (np.arange(ITEMS) % 7 + 1))
    # A few thousand terms of one sign each.
    np.testing.assert_allclose(x.numpy(), expected, rtol=2e-5)
