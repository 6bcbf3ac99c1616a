"""Sums over lists that all threads share: rows of warps in shared memory on GPUs."""

import numpy as np
import pytest
from support import ptx

import warp as wp


@wp.kernel
def left_early(
    x: wp.array(dtype=float), w: wp.array(dtype=float), limit: float, y: wp.array(dtype=float)
):
    i = wp.tid()
    a = x[i]
    for k in range(w.shape[0]):
        a = a + w[k] * x[i]
        if a > limit:
            break
    y[i] = a


@pytest.mark.parametrize("threads", [1, 31, 33, 257, 20000])
@pytest.mark.parametrize("elements", [9, 64, 256, 700])
def test_gradients_of_loops_that_threads_leave(threads, elements, device):
    """Element k has a gradient from the threads that came to iteration k, beyond a row, too.

    All sums are exact in float32, in any order.
    """
    random = np.random.default_rng(threads + elements)
    x = random.integers(1, 17, threads) / 16.0
    w = random.integers(0, 17, elements) / 16.0
    limit = elements // 5
    given = wp.array(x, dtype=float, device=device, requires_grad=True)
    weights = wp.array(w, dtype=float, device=device, requires_grad=True)
    y = wp.zeros(threads, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(left_early, threads, [given, weights, float(limit), y], device=device)
    tape.backward(grads={y: wp.ones(threads, dtype=float, device=device)})
    sums = x[:, None] * (1.0 + np.cumsum(w))
    came = np.c_[np.ones(threads, dtype=bool), sums[:, :-1] <= limit]
    np.testing.assert_array_equal(weights.grad.numpy(), (x[:, None] * came).sum(0))


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64, wp.int32, wp.int64])
@pytest.mark.parametrize("threads", [5, 64, 5000])
def test_sums_of_counted_elements(dtype, threads, device):
    """Indices from either end, in a loop whose start differs from thread to thread."""

    @wp.kernel(module="unique")
    def sums(
        start: wp.array(dtype=int), v: wp.array(dtype=dtype), n: int, s: wp.array(dtype=dtype)
    ):
        i = wp.tid()
        for k in range(n):
            wp.atomic_add(s, k, v[i])
            wp.atomic_sub(s, k - n, v[i])
            wp.atomic_add(s, n + k, v[i])
        for k in range(start[i], n):
            wp.atomic_add(s, k, v[i])

    n = 300
    random = np.random.default_rng(threads)
    v = random.integers(-3, 9, threads)
    start = random.integers(0, n, threads)
    result = wp.zeros(3 * n, dtype=dtype, device=device)
    given = [
        wp.array(start, dtype=int, device=device),
        wp.array(v, dtype=dtype, device=device),
    ]
    wp.launch(sums, threads, [*given, n, result], device=device)
    wanted = np.zeros(3 * n, dtype=np.int64)
    wanted[: 2 * n] += v.sum()
    wanted[2 * n :] -= v.sum()
    for first, value in zip(start, v, strict=True):
        wanted[first:n] += value
    np.testing.assert_array_equal(result.numpy(), wanted)


@pytest.mark.parametrize("threads", [40, 3000])
def test_gradients_of_vectors_in_a_list(threads, device):
    """Components of an element are added by lanes of their own."""

    @wp.kernel(module="unique")
    def pulls(x: wp.array(dtype=wp.vec3), c: wp.array(dtype=wp.vec3), y: wp.array(dtype=float)):
        i = wp.tid()
        s = float(0.0)
        for k in range(c.shape[0]):
            d = x[i] - c[k]
            s += wp.dot(d, d)
            if s > 1000.0:
                break
        y[i] = s

    random = np.random.default_rng(threads)
    x = random.uniform(size=(threads, 3)).astype(np.float32)
    for count in (20, 120):
        c = random.uniform(size=(count, 3)).astype(np.float32)
        given = wp.array(x, dtype=wp.vec3, device=device, requires_grad=True)
        list_ = wp.array(c, dtype=wp.vec3, device=device, requires_grad=True)
        y = wp.zeros(threads, dtype=float, device=device, requires_grad=True)
        with wp.Tape() as tape:
            wp.launch(pulls, threads, [given, list_, y], device=device)
        tape.backward(grads={y: wp.ones(threads, dtype=float, device=device)})
        wanted = 2.0 * (threads * c.astype(np.float64) - x.astype(np.float64).sum(0))
        np.testing.assert_allclose(list_.grad.numpy(), wanted, rtol=1e-4, atol=1e-5 * threads)


class Card:
    """Global memory for an interpreter of PTX, and the parameters of a launch."""

    def __init__(self, threads):
        self.memory = np.zeros(0, np.uint8)
        self.parameters = np.array([threads, 1, 1, 1, 0, 0], np.int32).tobytes()

    def add(self, values):
        """Float32 numbers in new memory; the address."""
        start = len(self.memory)
        made = np.ascontiguousarray(values, np.float32).reshape(-1).view(np.uint8)
        self.memory = np.r_[self.memory, made, np.zeros(-len(made) % 256, np.uint8)]
        return start

    def pass_array(self, values, grad):
        """An argument with its gradient; the place of the gradient."""
        shape = np.shape(values)
        pointers = [self.add(values), self.add(grad)]
        strides = [4 * int(np.prod(shape[k + 1 :])) for k in range(len(shape))]
        rest = [0] * (4 - len(shape))
        numbers = [*shape, *rest, *strides, *rest, len(shape), 0]
        self.parameters += np.array(pointers, np.uint64).tobytes()
        self.parameters += np.array(numbers, np.int32).tobytes()
        return slice(pointers[1], pointers[1] + 4 * int(np.prod(shape)))

    def run(self, kernel, threads, block):
        program = ptx.Program(kernel.ir("ptx", arch=90, derivative="adjoint"))
        parameters = np.frombuffer(self.parameters + bytes(64), np.uint8)
        program.run(-(-threads // block), block, parameters, self.memory)


@pytest.mark.parametrize("block", [256, 128])
@pytest.mark.parametrize("threads, elements", [(300, 20), (33, 9), (270, 280)])
def test_code_for_gpus_of_loops_that_threads_leave(threads, elements, block):
    """The PTX of the adjoint, run thread by thread; blocks may have half of the threads."""
    random = np.random.default_rng(threads)
    x = random.integers(1, 17, threads) / 16.0
    w = random.integers(0, 17, elements) / 16.0
    limit = elements // 5
    card = Card(threads)
    card.pass_array(x, np.zeros(threads))
    weights = card.pass_array(w, np.zeros(elements))
    card.parameters += np.array([limit, 0], np.float32).tobytes()
    card.pass_array(np.zeros(threads), np.ones(threads))
    card.run(left_early, threads, block)
    sums = x[:, None] * (1.0 + np.cumsum(w))
    came = np.c_[np.ones(threads, dtype=bool), sums[:, :-1] <= limit]
    wanted = (x[:, None] * came).sum(0)
    np.testing.assert_array_equal(card.memory[weights].view(np.float32), wanted)


@pytest.mark.parametrize("block", [256, 128])
@pytest.mark.parametrize("elements", [40, 290])
def test_code_for_gpus_of_rings(elements, block):
    """Lanes that add to an element in turn leave its sum."""

    @wp.kernel(module="unique")
    def layer(x: wp.array2d(dtype=float), w: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        s = float(0.0)
        for k in range(w.shape[0]):
            s += x[i, k] * w[k]
        y[i] = s

    threads = 300
    random = np.random.default_rng(elements)
    x = random.integers(0, 17, (threads, elements)) / 16.0
    w = random.integers(0, 17, elements) / 16.0
    card = Card(threads)
    rows = card.pass_array(x, np.zeros_like(x))
    weights = card.pass_array(w, np.zeros(elements))
    card.pass_array(np.zeros(threads), np.ones(threads))
    card.run(layer, threads, block)
    np.testing.assert_array_equal(card.memory[weights].view(np.float32), x.sum(0))
    found = card.memory[rows].view(np.float32).reshape(x.shape)
    np.testing.assert_array_equal(found, np.broadcast_to(w, x.shape))
