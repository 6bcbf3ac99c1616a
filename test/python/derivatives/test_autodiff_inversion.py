"""Adjoints of loops whose integers are carried backwards by exact inverses.

The factor of the carried value in an iteration depends on an integer, so that the gradient of the
product is the product of those factors: Python's integers give it, cut to the width of the type.
"""

import numpy as np
import pytest

import warp as wp
from frontend_programs import define as translate

TRIPS = [0, 1, 2, 33, 1000]


def gradient(kernel, arguments, device, threads):
    """Gradient of the sum of the outputs by the first argument, and the outputs."""
    x = wp.array(np.linspace(0.5, 1.5, threads), dtype=wp.float64, device=device)
    x.requires_grad = True
    y = wp.zeros(threads, dtype=wp.float64, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(kernel, threads, [x, *arguments, y], device=device)
    tape.backward(grads={y: wp.ones(threads, dtype=wp.float64, device=device)})
    return x.grad.numpy(), y.numpy() / x.numpy()


def check_no_memory(kernel, loops=1):
    counted = wp.autograd.adjoint_metrics(kernel)
    assert (counted["tape_bytes"], counted["replay_loops"]) == (0, loops)


def wrapped(value, dtype):
    """An integer as the type holds it."""
    info = np.iinfo(wp.dtype_to_numpy(dtype))
    return (value - info.min) % 2**info.bits + info.min


# By name: the update in a kernel, where `k` is the integer and `j` the iteration, of the same type.
UPDATES = {
    "xor": "k ^ T(0x5b)",
    "complement": "~k + j",
    "difference": "T(77) - k",
    "negative": "-k - T(3)",
    "counter": "k + j * j",
    "congruential": "k * T(109) + T(37)",
    "negative factor": "T(-3) * k - T(1)",
}
UNSIGNED = {
    "left": "k ^ (k << T(3))",
    "right": "(k >> T(5)) ^ k",
    "by one": "k ^ (k >> T(1))",
    "rotation": "((k << T(3)) | (k >> T(W - 3))) + T(1)",
    "rotation by a sum": "(k >> T(W - 5)) + (k << T(5))",
}
SIGNED = [wp.int8, wp.int16, wp.int32, wp.int64]
RUNS = [(name, dtype) for name in UPDATES for dtype in (*SIGNED, wp.uint32, wp.uint64)]
RUNS += [
    (name, dtype) for name in UNSIGNED for dtype in (wp.uint8, wp.uint16, wp.uint32, wp.uint64)
]


def product_kernel(update, dtype, width):
    source = f"""
@wp.func
def advance(k: T, j: T):
    return {update}

@wp.kernel
def product(x: wp.array(dtype=F), seed: T, n: wp.array(dtype=int), y: wp.array(dtype=F)):
    i = wp.tid()
    s = x[i]
    k = seed
    for j in range(n[i]):
        s = s * (F(1.0) + F(k & T(63)) * F(1e-3))
        k = advance(k, T(j))
    y[i] = s
"""
    return translate(source, T=dtype, W=width, F=wp.float64)["product"]


@pytest.mark.parametrize(("name", "dtype"), RUNS)
def test_inverses_wrap_around(name, dtype, device):
    width = np.iinfo(wp.dtype_to_numpy(dtype)).bits
    update = (UPDATES | UNSIGNED)[name]
    if dtype not in SIGNED:
        update = update.replace("T(-3)", f"T({2**width - 3})")
    kernel = product_kernel(update, dtype, width)
    seed = wrapped(0x1234567890ABCDEF, dtype)
    trips = wp.array(TRIPS, dtype=int, device=device)
    got, _ = gradient(kernel, [seed, trips], device, len(TRIPS))
    advance = eval(f"lambda k, j: {update}", {"T": int, "W": width})
    expected = []
    for n in TRIPS:
        k, product = seed, 1.0
        for j in range(n):
            product *= 1.0 + (k & 63) * 1e-3
            k = wrapped(advance(k, wrapped(j, dtype)), dtype)
        expected.append(product)
    np.testing.assert_allclose(got, expected, rtol=1e-12)
    check_no_memory(kernel)


def random_kernel(draw):
    return translate(
        f"""
@wp.kernel
def walk(x: wp.array(dtype=F), n: wp.array(dtype=int), y: wp.array(dtype=F)):
    i = wp.tid()
    state = wp.rand_init(42, i)
    s = x[i]
    for _ in range(n[i]):
        {draw}
        s = s * (F(1.0) + F(1e-2) * F(u))
    y[i] = s
""",
        F=wp.float64,
    )["walk"]


DRAWS = [
    "u = wp.randf(state)",
    "u = wp.randf(state, -1.0, 2.0)",
    "u = wp.randi(state) % 64",
    "u = wp.randi(state, -3, 9)",
    "u = wp.randu(state) % wp.uint32(64)",
    "u = wp.randu(state, wp.uint32(3), wp.uint32(9))",
    "u = wp.randn(state)",
    "u = wp.randn(state, 1.0, 0.5)",
    "u = wp.sample_unit_ring(state)[0]",
    "u = wp.sample_unit_disk(state)[0]",
    "u = wp.sample_unit_square(state)[0]",
    "u = wp.sample_unit_cube(state)[0]",
    "u = wp.sample_unit_sphere_surface(state)[0]",
    "u = wp.sample_unit_sphere(state)[0]",
    "u = wp.sample_unit_hemisphere_surface(state)[0]",
    "u = wp.sample_unit_hemisphere(state)[0]",
    "u = wp.sample_triangle(state)[0]",
    "state = wp.rand_init(int(state)); u = state % wp.uint32(64)",
    "state = wp.rand_init(int(state), i); u = state % wp.uint32(64)",
    "state = wp.rand_init(i, int(state)); u = state % wp.uint32(64)",
    "u = wp.randf(state) + wp.randn(state)",
]


@pytest.mark.parametrize("draw", DRAWS)
def test_random_states_go_backwards(draw, device):
    kernel = random_kernel(draw)
    trips = wp.array(TRIPS, dtype=int, device=device)
    got, ratio = gradient(kernel, [trips], device, len(TRIPS))
    # The derivative of x times the product of the factors is the product.
    np.testing.assert_allclose(got, ratio, rtol=1e-12)
    check_no_memory(kernel)


def test_long_loops(device):
    kernel = random_kernel("u = wp.randf(state) - 0.5")
    trips = wp.array([100_000, 0, 1, 99_999], dtype=int, device=device)
    got, ratio = gradient(kernel, [trips], device, 4)
    np.testing.assert_allclose(got, ratio, rtol=1e-9)


@wp.kernel
def samples(u: wp.array2d(dtype=float)):
    i = wp.tid()
    state = wp.rand_init(7, i)
    for k in range(u.shape[0]):
        u[k, i] = wp.randf(state)


def drawn(threads, n, device):
    """The n draws of each thread, a row per draw."""
    u = wp.zeros((n, threads), dtype=float, device=device)
    wp.launch(samples, threads, [u], device=device)
    return u.numpy().astype(np.float64)


def test_short_loops_keep_floats_only(device):
    """With a float and a random state, the float is in the tape."""

    @wp.kernel
    def short(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
        i = wp.tid()
        state = wp.rand_init(7, i)
        s = x[i]
        for _ in range(20):
            s = wp.sin(s) + wp.float64(wp.randf(state)) * s
        y[i] = s

    threads = 3
    got, _ = gradient(short, [], device, threads)
    s = np.linspace(0.5, 1.5, threads) + 1e-30j
    for u in drawn(threads, 20, device):
        s = np.sin(s) + u * s
    np.testing.assert_allclose(got, s.imag * 1e30, rtol=1e-12)
    assert wp.autograd.adjoint_metrics(short)["tape_bytes"] == 20 * 8


def test_monte_carlo_sums_keep_nothing(device):
    """The gradient of a mean over samples: one loop, no memory."""

    @wp.kernel
    def mean(x: wp.array(dtype=wp.float64), n: int, y: wp.array(dtype=wp.float64)):
        i = wp.tid()
        state = wp.rand_init(7, i)
        s = wp.float64(0.0)
        time = wp.float64(0.0)
        for _ in range(n):
            u = wp.float64(wp.randf(state))
            time = time * wp.float64(0.5) + u
            s += wp.sin(x[i] * time)
        y[i] = s

    n, threads = 500, 3
    got, _ = gradient(mean, [n], device, threads)
    time, expected = np.zeros(threads), np.zeros(threads)
    x = np.linspace(0.5, 1.5, threads)
    for u in drawn(threads, n, device):
        time = 0.5 * time + u
        expected += time * np.cos(x * time)
    np.testing.assert_allclose(got, expected, rtol=1e-11)
    check_no_memory(mean, loops=0)


def test_values_that_depend_on_each_other(device):
    """Fibonacci's sequence and a state mixed with it, backwards."""

    @wp.kernel
    def mixed(x: wp.array(dtype=wp.float64), n: int, y: wp.array(dtype=wp.float64)):
        i = wp.tid()
        s = x[i]
        a = wp.uint32(i)
        b = wp.uint32(1)
        state = wp.uint32(5)
        for _ in range(n):
            s = s * (wp.float64(1.0) + wp.float64(state & wp.uint32(63)) * wp.float64(1e-3))
            c = a + b
            a = b
            b = c
            state = (state ^ a) * wp.uint32(747796405) + b
        y[i] = s

    n, threads = 200, 3
    got, _ = gradient(mixed, [n], device, threads)
    expected = []
    for i in range(threads):
        a, b, state, product = i, 1, 5, 1.0
        for _ in range(n):
            product *= 1.0 + (state & 63) * 1e-3
            a, b = b, (a + b) % 2**32
            state = ((state ^ a) * 747796405 + b) % 2**32
        expected.append(product)
    np.testing.assert_allclose(got, expected, rtol=1e-12)
    check_no_memory(mixed)


def test_exits_and_nested_loops(device):
    """A break, a loop with a condition, and a state that an inner loop advances."""

    @wp.kernel
    def exits(x: wp.array(dtype=wp.float64), n: int, y: wp.array(dtype=wp.float64)):
        i = wp.tid()
        s = x[i]
        state = wp.rand_init(3, i)
        for _ in range(n):
            u = wp.randf(state)
            if u > 0.95:
                break
            s = s * (wp.float64(1.0) + wp.float64(u) * wp.float64(0.1))
        while wp.randf(state) < 0.9:
            for _ in range(3):
                s = s * (wp.float64(0.8) + wp.float64(wp.randf(state)) * wp.float64(0.4))
        y[i] = s

    got, ratio = gradient(exits, [1000], device, 16)
    np.testing.assert_allclose(got, ratio, rtol=1e-12)
    assert len(set(np.round(ratio, 6))) > 8


def test_what_has_no_inverse_is_kept(device):
    """Floats, even factors, products of two integers and states in a branch."""

    @wp.kernel
    def lossy(x: wp.array(dtype=wp.float64), n: int, y: wp.array(dtype=wp.float64)):
        i = wp.tid()
        s = x[i]
        a = wp.uint32(i + 3)
        b = wp.uint32(9)
        state = wp.rand_init(11, i)
        time = wp.float64(0.1)
        for k in range(n):
            u = wp.float64((a ^ b) & wp.uint32(31)) * wp.float64(1e-3) + time * wp.float64(1e-2)
            s = s * (wp.float64(1.0) + u)
            a = a * wp.uint32(6) + wp.uint32(1)
            b = b * a + wp.uint32(k)
            time = time * wp.float64(0.99) + wp.float64(0.01)
            if a > b:
                s = s * (wp.float64(1.0) + wp.float64(wp.randf(state)) * wp.float64(1e-2))
        y[i] = s

    got, ratio = gradient(lossy, [300], device, 5)
    np.testing.assert_allclose(got, ratio, rtol=1e-12)
    assert wp.autograd.adjoint_metrics(lossy)["tape_bytes"] > 0


def test_terms_that_come_from_arrays(device):
    """Integers and floats are read again, but arithmetic of floats might round otherwise."""

    def define(term):
        return translate(
            f"""
@wp.kernel
def steps(x: wp.array(dtype=F), table: wp.array(dtype=int), w: wp.array(dtype=float), n: int,
          y: wp.array(dtype=F)):
    i = wp.tid()
    s = x[i]
    k = i
    for j in range(n):
        s = s * (F(1.0) + F(k & 63) * F(1e-3))
        k = k + {term}
    y[i] = s
""",
            F=wp.float64,
        )["steps"]

    n, threads = 200, 3
    rng = np.random.default_rng(5)
    table = rng.integers(-(2**31), 2**31, n).astype(np.int32)
    w = rng.uniform(-100.0, 100.0, n).astype(np.float32)
    arguments = [wp.array(table, device=device), wp.array(w, device=device), n]
    terms = {
        "table[j]": table,
        "int(w[j])": w.astype(np.int32),
        "int(w[j] * 0.37 + 0.5)": None,
    }
    for term, steps in terms.items():
        kernel = define(term)
        got, ratio = gradient(kernel, arguments, device, threads)
        np.testing.assert_allclose(got, ratio, rtol=1e-12)
        if steps is None:
            assert wp.autograd.adjoint_metrics(kernel)["tape_bytes"] > 0
            continue
        check_no_memory(kernel)
        before = np.concatenate([[0], np.cumsum(steps, dtype=np.int64)[:-1]])
        expected = [np.prod(1.0 + ((before + i) & 63) * 1e-3) for i in range(threads)]
        np.testing.assert_allclose(got, expected, rtol=1e-12)
