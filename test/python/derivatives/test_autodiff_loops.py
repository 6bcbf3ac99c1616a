"""Adjoints of loops, against central differences of the kernel itself in float64.

The numbered catalogue has the textbook cases; here are states of every kind, exits of every kind,
and trip counts at the edges of what an adjoint loop keeps.
"""

import numpy as np
import pytest

import warp as wp

rng = np.random.default_rng(5)

F = wp.float64
STEP = 1e-5


def run(kernel, values, rest, out):
    """The outputs of a launch, one thread per output."""
    arrays = [wp.array(v, dtype=F, device="cpu") for v in values]
    result = wp.zeros(out, dtype=F, device="cpu")
    wp.launch(kernel, out, inputs=[*arrays, *rest], outputs=[result], device="cpu")
    return result.numpy()


def gradients(kernel, values, rest, weights):
    """Gradients of the weighted sum of the outputs, from the adjoint."""
    arrays = [wp.array(v, dtype=F, device="cpu", requires_grad=True) for v in values]
    out = wp.zeros(len(weights), dtype=F, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(kernel, len(weights), inputs=[*arrays, *rest], outputs=[out], device="cpu")
    tape.backward(grads={out: wp.array(weights, dtype=F, device="cpu")})
    return [a.grad.numpy() for a in arrays]


def differences(kernel, values, rest, weights):
    """The same from central differences, extrapolated to a step of zero."""
    found = []
    for i, value in enumerate(values):
        slope = np.zeros_like(value)
        for at in np.ndindex(value.shape):

            def end(step, i=i, at=at):
                moved = [v.copy() for v in values]
                moved[i][at] += step
                return weights @ run(kernel, moved, rest, len(weights))

            wide = (end(STEP) - end(-STEP)) / (2.0 * STEP)
            narrow = (end(0.5 * STEP) - end(-0.5 * STEP)) / STEP
            slope[at] = (4.0 * narrow - wide) / 3.0
        found.append(slope)
    return found


def check(kernel, values, rest=(), threads=3):
    values = [np.array(v, dtype=np.float64) for v in values]
    weights = np.linspace(0.5, 1.5, threads)
    got = gradients(kernel, values, rest, weights)
    wanted = differences(kernel, values, rest, weights)
    for a, b in zip(got, wanted):
        np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-9)
        assert np.isfinite(a).all()


X = np.array([0.7, -0.4, 1.2])
W = np.array([0.3, 0.8, -0.5, 1.1, 0.6])

# Around the ring, around the stack of checkpoints, and beyond both.
EDGES = (0, 1, 15, 16, 17, 31, 32, 33, 511, 512, 513, 5000)


@pytest.mark.parametrize("n", EDGES)
def test_states_of_vectors_and_integers(n):
    @wp.kernel
    def rotate(x: wp.array(dtype=F), n: int, out: wp.array(dtype=F)):
        i = wp.tid()
        v = wp.vec2d(x[i], F(1.0))
        k = wp.uint32(7)
        for _ in range(n):
            k = k * wp.uint32(1664525) + wp.uint32(1013904223)
            a = F(k >> wp.uint32(20)) * F(1e-6)
            v = wp.vec2d(v[0] - a * wp.sin(v[1]), v[1] + a * v[0])
        out[i] = wp.dot(v, v)

    check(rotate, [X], [n])


def test_matrix_states():
    @wp.kernel
    def powers(x: wp.array(dtype=F), n: int, out: wp.array(dtype=F)):
        i = wp.tid()
        m = wp.mat22d(F(1.0), F(0.0), F(0.0), F(1.0))
        a = wp.mat22d(F(0.9), x[i], -x[i], F(0.8))
        for _ in range(n):
            m = m * a
        out[i] = m[0, 0] + F(2.0) * m[1, 0]

    check(powers, [X], [40])


def test_break_continue_and_return():
    @wp.func
    def search(x: F, w: wp.array(dtype=F), n: int):
        s = x
        for k in range(n):
            if w[k] < F(0.0):
                continue
            s = s * s + w[k]
            if s > F(4.0):
                break
            for j in range(k):
                s = wp.sin(s) + w[j]
                if s < F(-0.8):
                    return s * F(3.0)
        return s

    @wp.kernel
    def exits(x: wp.array(dtype=F), w: wp.array(dtype=F), n: int, out: wp.array(dtype=F)):
        i = wp.tid()
        out[i] = search(x[i], w, n)

    check(exits, [X, W], [5])
    check(exits, [X, W], [0])


def test_trips_that_depend_on_the_state():
    @wp.kernel
    def uneven(x: wp.array(dtype=F), n: int, out: wp.array(dtype=F)):
        i = wp.tid()
        s = x[i]
        for k in range(n):
            m = int(s * s * F(7.0)) + k
            for j in range(m, 0, -2):
                s = s - F(0.1) * wp.sin(s * F(j))
        out[i] = s

    check(uneven, [X], [9])


def test_while_in_for_in_while():
    @wp.kernel
    def mixed(x: wp.array(dtype=F), w: wp.array(dtype=F), out: wp.array(dtype=F)):
        i = wp.tid()
        s = x[i]
        level = int(0)
        while level < 4 and s < F(50.0):
            for k in range(level, 5):
                t = w[k] * s
                while t * t > F(0.5):
                    t = t * F(0.4)
                s = s + t * t
            level += 1
        out[i] = s

    check(mixed, [X, W])


def test_values_from_outside_and_only_one_result():
    @wp.kernel
    def outside(x: wp.array(dtype=F), w: wp.array(dtype=F), n: int, out: wp.array(dtype=F)):
        i = wp.tid()
        a = wp.exp(x[i])
        unused = a
        s = F(0.0)
        last = F(0.0)
        for k in range(n):
            unused = unused * w[k]
            last = a * w[k] + x[i]
            s += last * last
        out[i] = s / a + last

    check(outside, [X, W], [5])
    check(outside, [X, W], [0])


def test_values_after_a_loop_use_what_it_leaves():
    @wp.kernel
    def chained(x: wp.array(dtype=F), n: int, out: wp.array(dtype=F)):
        i = wp.tid()
        a = x[i]
        for _ in range(n):
            a = wp.cos(a)
        b = a * a
        for _ in range(n):
            b = b * a + F(0.1)
        out[i] = b / (a + F(2.0))

    check(chained, [X], [50])


def test_what_a_while_loop_leaves_is_used_twice():
    @wp.kernel
    def left(x: wp.array(dtype=F), out: wp.array(dtype=F)):
        i = wp.tid()
        s = x[i] * x[i] + F(3.0)
        t = F(1.0)
        while s > F(0.3):
            s = s * F(0.5) + F(0.05) * wp.sin(t)
            t = t + s
        out[i] = s * t * t

    check(left, [X])


def test_loops_over_memory_without_gradients_do_not_matter():
    @wp.kernel
    def counted(x: wp.array(dtype=F), left: wp.array(dtype=int), out: wp.array(dtype=F)):
        i = wp.tid()
        while left[i] > 0:
            left[i] = left[i] - 1
        out[i] = x[i] * x[i]

    left = wp.array([3, 0, 5], dtype=int, device="cpu")
    check(counted, [X], [left])


def test_loop_writes_what_it_computes():
    @wp.kernel
    def written(x: wp.array(dtype=F), n: int, out: wp.array(dtype=F)):
        c = x[0]
        for k in range(n):
            out[k] = c
            c = wp.sin(c) * x[1]

    x, weights = np.array([0.7, 1.3]), np.linspace(0.5, 1.5, 45)
    arrays = wp.array(x, dtype=F, device="cpu", requires_grad=True)
    out = wp.zeros(45, dtype=F, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(written, 1, inputs=[arrays, 45], outputs=[out], device="cpu")
    tape.backward(grads={out: wp.array(weights, dtype=F, device="cpu")})
    c, slope, expected = x[0], np.array([1.0, 0.0]), np.zeros(2)
    for weight in weights:
        expected += weight * slope
        slope = np.cos(c) * slope * x[1] + np.array([0.0, np.sin(c)])
        c = np.sin(c) * x[1]
    np.testing.assert_allclose(arrays.grad.numpy(), expected, rtol=1e-12)


@pytest.mark.parametrize(
    "counter, bounds",
    [
        (wp.int64, (2**40, 2**40 + 12, 5)),
        (wp.uint32, (2**32 - 9, 2**32 - 1, 2)),
        (wp.int32, (2**31 - 9, 2**31 - 1, 3)),
        (wp.int32, (-(2**31), -(2**31) + 9, 4)),
        (wp.int32, (6, -7, -4)),
        (wp.uint8, (250, 255, 1)),
    ],
)
def test_counters_at_their_limits(counter, bounds):
    lo, hi, by = bounds

    @wp.kernel
    def counted(x: wp.array(dtype=F), a: counter, b: counter, c: counter, out: wp.array(dtype=F)):
        i = wp.tid()
        s = x[i]
        for k in range(a, b, c):
            s = s * s + F(k - a) * F(0.01) + F(0.2)
        out[i] = s

    values = [np.array([0.1, 0.2, 0.3])]
    check(counted, values, [counter(lo), counter(hi), counter(by)])


def test_half_precision_states_have_single_precision_cotangents():
    H = wp.float16

    @wp.kernel
    def halves(x: wp.array(dtype=H), n: int, out: wp.array(dtype=H)):
        i = wp.tid()
        s = x[i]
        for _ in range(n):
            s = s * x[i]
        out[i] = s

    x = wp.array([0.01, 0.5], dtype=H, device="cpu", requires_grad=True)
    out = wp.zeros(2, dtype=H, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(halves, 2, inputs=[x, 2], outputs=[out], device="cpu")
    tape.backward(grads={out: wp.ones(2, dtype=out.grad.dtype, device="cpu")})
    np.testing.assert_allclose(x.grad.numpy(), [3e-4, 0.75], rtol=2e-3)


def test_sums_cost_no_replay():
    @wp.kernel
    def weighted(x: wp.array(dtype=F), w: wp.array(dtype=F), n: int, out: wp.array(dtype=F)):
        i = wp.tid()
        s = F(0.0)
        for k in range(n):
            s += w[k] * wp.sin(x[i] * F(k))
        out[i] = s

    check(weighted, [X, W], [5])
    metrics = wp.autograd.adjoint_metrics(weighted)
    assert metrics["replay_loops"] == 0
    assert metrics["tape_bytes"] == 0


@pytest.mark.parametrize("trips", [32, 33, 105, 106, 300])
def test_values_of_loops_of_constant_length(trips, device):
    """Few are kept, more are kept where checkpoints would take as much, others run again."""

    @wp.kernel
    def rounds(x: wp.array(dtype=wp.float64), w: wp.array(dtype=wp.float64)):
        i = wp.tid()
        a = x[i]
        for j in range(trips):
            a = wp.sin(a) * w[j] + a
        x[i] = a

    start, weights = np.array([0.3, -0.7]), np.linspace(-0.2, 0.3, trips)
    x, w = (
        wp.array(one, dtype=wp.float64, device=device, requires_grad=True)
        for one in (start, weights)
    )
    with wp.Tape() as tape:
        wp.launch(rounds, 2, [x, w], device=device)
    tape.backward(grads={x: wp.ones(2, dtype=wp.float64, device=device)})

    def plain(x, w):
        for weight in w:
            x = np.sin(x) * weight + x
        return x.sum().imag / 1e-30

    for one, got in ((0, x.grad), (1, w.grad)):
        values = [start.astype(complex), weights.astype(complex)]
        wanted = []
        for j in range(len(values[one])):
            values[one][j] += 1e-30j
            wanted.append(plain(*values))
            values[one][j] -= 1e-30j
        np.testing.assert_allclose(got.numpy(), wanted, rtol=1e-12)


@wp.kernel
def march(
    x: wp.array(dtype=wp.float64), w: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float64)
):
    i = wp.tid()
    a = x[i]
    for j in range(3, 60, 2):
        if a > wp.float64(4.0):
            break
        n = int(j)
        while a < w[j] and n < 40:
            a = a * wp.float64(1.1) + wp.sin(a) * w[n]
            n += 3
        if a < wp.float64(0.1):
            continue
        a = a + wp.exp(-a) * w[j]
    out[i] = a


def march_plain(x, w):
    out = []
    for a in x:
        for j in range(3, 60, 2):
            if a.real > 4.0:
                break
            n = j
            while a.real < w[j].real and n < 40:
                a = a * 1.1 + np.sin(a) * w[n]
                n += 3
            if a.real < 0.1:
                continue
            a = a + np.exp(-a) * w[j]
        out.append(a)
    return np.array(out)


def test_values_of_loops_with_a_bounded_length(device):
    """Loops that a condition or `break` leaves: the run that counts the trips keeps the values."""
    start, weights, seed = rng.uniform(-1, 5, 40), rng.uniform(0, 1.5, 60), rng.normal(size=40)
    x, w = (
        wp.array(one, dtype=wp.float64, device=device, requires_grad=True)
        for one in (start, weights)
    )
    out = wp.zeros(40, dtype=wp.float64, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(march, 40, [x, w, out], device=device)
    np.testing.assert_allclose(out.numpy(), march_plain(start + 0j, weights + 0j).real, rtol=1e-12)
    tape.backward(grads={out: wp.array(seed, dtype=wp.float64, device=device)})

    def slope(one, j):
        values = [start.astype(complex), weights.astype(complex)]
        values[one][j] += 1e-30j
        return (march_plain(*values) @ seed).imag / 1e-30

    for one, got in ((0, x.grad), (1, w.grad)):
        wanted = [slope(one, j) for j in range(len((start, weights)[one]))]
        np.testing.assert_allclose(got.numpy(), wanted, rtol=1e-11, atol=1e-13)


def wrapping_loops():
    """Loops with a counter that wraps, or with a bound that a cast wraps, and their numbers."""

    @wp.kernel
    def signed(x: wp.array(dtype=wp.float64), most: int):
        i = wp.tid()
        a = x[i]
        k = int(0)
        n = int(0)
        while k < 2000000000:
            a = a + wp.float64(0.1) * wp.sin(a)
            k += 1500000000
            n += 1
            if n >= most:
                break
        x[i] = a

    @wp.kernel
    def unsigned(x: wp.array(dtype=wp.float64), most: int):
        i = wp.tid()
        a = x[i]
        k = wp.uint32(0)
        n = int(0)
        while k < wp.uint32(-1):
            a = a + wp.float64(0.1) * wp.sin(a)
            k += wp.uint32(1)
            n += 1
            if n >= most:
                break
        x[i] = a

    # 1500000000 k, as 32 bits with a sign, is at least 2000000000 for k = 10 first.
    return (signed, 10), (unsigned, 300)


@pytest.mark.parametrize("which", [0, 1])
def test_values_of_loops_whose_counter_wraps(which, device):
    """The bound of a counter says nothing about the trips if the next step leaves its type."""
    kernel, trips = wrapping_loops()[which]
    start = rng.uniform(0.2, 2.0, 9)
    first = wp.array(start, dtype=wp.float64, device=device, requires_grad=True)
    x = wp.zeros_like(first)
    with wp.Tape(preserve="auto") as tape:
        wp.copy(x, first)
        wp.launch(kernel, 9, [x, 300], device=device)
    wanted = start + 1e-30j
    for _ in range(trips):
        wanted = wanted + 0.1 * np.sin(wanted)
    np.testing.assert_allclose(x.numpy(), wanted.real, rtol=1e-12)
    tape.backward(grads={x: wp.ones(9, dtype=wp.float64, device=device)})
    np.testing.assert_allclose(first.grad.numpy(), wanted.imag / 1e-30, rtol=1e-11)
