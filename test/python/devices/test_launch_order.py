"""Launches in a row, each of which reads what the one before it wrote at other threads' places.

The driver may start a kernel while the one before it ends: a kernel that read too early, or from a
cache that nobody told, would be off in the first elements it touches. Integers, so that NumPy's
result is the one result.
"""

import numpy as np
import pytest

import warp as wp

COUNT = 200_003
TURNS = 150


@wp.kernel
def shuffle(
    x: wp.array(dtype=wp.int32), order: wp.array(dtype=wp.int32), y: wp.array(dtype=wp.int32)
):
    i = wp.tid()
    y[i] = x[order[i]] * 3 + i


@wp.kernel
def advance(order: wp.array(dtype=wp.int32), n: int):
    i = wp.tid()
    order[i] = (order[i] + 7) % n


@wp.kernel
def count_down(n: wp.array(dtype=wp.int32)):
    n[0] = n[0] - 1


class Chain:
    """Two arrays written in turn, and the order to read in; on a device and in NumPy."""

    def __init__(self, device):
        rng = np.random.default_rng(5)
        self.values = rng.integers(0, 1 << 20, COUNT, dtype=np.int32)
        self.order = rng.permutation(COUNT).astype(np.int32)
        self.device = device
        self.x = wp.array(self.values, device=device)
        self.y = wp.zeros_like(self.x)
        self.steps = wp.array(self.order, device=device)

    def launch(self, turns, stream=None):
        """Two launches that exchange the arrays and one that moves the order, some times."""
        for _ in range(turns):
            for a, b in ((self.x, self.y), (self.y, self.x)):
                wp.launch(shuffle, COUNT, [a, self.steps, b], device=self.device, stream=stream)
            wp.launch(advance, COUNT, [self.steps, COUNT], device=self.device, stream=stream)

    def check(self, turns):
        """The same in NumPy."""
        ids = np.arange(COUNT, dtype=np.int32)
        for _ in range(turns):
            for _ in range(2):
                self.values = self.values[self.order] * np.int32(3) + ids
            self.order = (self.order + 7) % COUNT
        assert (self.x.numpy() == self.values).all()
        assert (self.steps.numpy() == self.order).all()


def test_in_a_row(device):
    chain = Chain(device)
    chain.launch(TURNS)
    chain.check(TURNS)


def test_in_a_graph(device):
    chain = Chain(device)
    with wp.ScopedCapture(device) as capture:
        chain.launch(10)
    for _ in range(5):
        wp.capture_launch(capture.graph)
    chain.check(50)


def test_in_a_graph_of_graphs(device):
    chain = Chain(device)
    with wp.ScopedCapture(device) as inner:
        chain.launch(3)
    with wp.ScopedCapture(device) as outer:
        chain.launch(1)
        wp.capture_launch(inner.graph)
        chain.launch(1)
    wp.capture_launch(outer.graph)
    wp.capture_launch(outer.graph)
    chain.check(10)


def test_with_copies_and_fills_between(device):
    chain = Chain(device)
    kept = wp.zeros_like(chain.x)

    def step():
        chain.launch(1)
        wp.copy(kept, chain.x)
        chain.x.zero_()
        chain.y.fill_(1)
        wp.copy(chain.x, kept)
        chain.launch(1)

    step()
    with wp.ScopedCapture(device) as capture:
        step()
    wp.capture_launch(capture.graph)
    chain.check(4)


@wp.kernel
def key_of(x: wp.array(dtype=wp.int32), keys: wp.array(dtype=wp.int32), ids: wp.array(dtype=int)):
    i = wp.tid()
    keys[i] = (x[len(x) - 1 - i] * 7919 + i) & 0xFFFF
    ids[i] = i


@wp.kernel
def spread(sums: wp.array(dtype=int), ids: wp.array(dtype=int), x: wp.array(dtype=wp.int32)):
    i = wp.tid()
    x[ids[i]] = sums[i] & 0xFFFFF


@pytest.mark.parametrize("in_graph", [False, True])
def test_with_sorts_and_sums_between(in_graph, device):
    """Kernels of the library, too, begin while the one before them ends."""
    values = np.random.default_rng(7).integers(0, 1 << 20, COUNT, dtype=np.int32)
    x = wp.array(values, device=device)
    keys, ids = (wp.zeros(2 * COUNT, dtype=wp.int32, device=device) for _ in range(2))
    sums = wp.zeros(COUNT, dtype=wp.int32, device=device)

    def step():
        wp.launch(key_of, COUNT, [x, keys, ids], device=device)
        wp.utils.radix_sort_pairs(keys, ids, COUNT)
        wp.utils.array_scan(keys[:COUNT], sums)
        wp.launch(spread, COUNT, [sums, ids, x], device=device)

    turns, again = 12, step
    if in_graph:
        # Memory for sorting is allocated before.
        step()
        x.assign(values)
        with wp.ScopedCapture(device) as capture:
            step()

        def again():
            wp.capture_launch(capture.graph)

    for _ in range(turns):
        again()
    for _ in range(turns):
        wanted = (values[::-1] * np.int32(7919) + np.arange(COUNT, dtype=np.int32)) & 0xFFFF
        order = np.argsort(wanted, kind="stable")
        values[order] = np.cumsum(wanted[order], dtype=np.int32) & 0xFFFFF
    assert (x.numpy() == values).all()


def test_in_loops_of_a_graph(device):
    if device != "cpu" and not wp.is_conditional_graph_supported():
        pytest.skip("the driver has no loops in graphs")
    chain = Chain(device)
    left = wp.array([4], dtype=wp.int32, device=device)

    def body():
        chain.launch(2)
        wp.launch(count_down, 1, [left], device=device)

    with wp.ScopedCapture(device) as inner:
        chain.launch(1)
        wp.capture_while(left, body)
        chain.launch(1)
    with wp.ScopedCapture(device) as outer:
        chain.launch(1)
        wp.capture_launch(inner.graph)
        chain.launch(1)
    wp.capture_launch(inner.graph)
    left.fill_(3)
    wp.capture_launch(outer.graph)
    chain.check(4 * 2 + 2 + 3 * 2 + 4)


def test_across_streams(device):
    if device == "cpu":
        pytest.skip("streams are those of GPUs")
    chain = Chain(device)
    first, second = wp.Stream(device), wp.Stream(device)
    first.wait_stream(wp.get_stream(device))

    def step():
        chain.launch(1, first)
        second.wait_stream(first)
        chain.launch(1, second)
        first.wait_stream(second)

    for _ in range(20):
        step()
    wp.synchronize_device(device)
    chain.check(40)
