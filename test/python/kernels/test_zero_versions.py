"""Versions of kernels for launches in which loops and branches are left out."""

import numpy as np
import pytest

import warp as wp

COUNT = 100


def body(
    x: wp.array(dtype=wp.vec3),
    y: wp.array(dtype=wp.vec3),
    n: int,
    on: bool,
    m: wp.array(dtype=int),
    p: wp.array(dtype=wp.vec3),
    dt: float,
):
    i = wp.tid()
    a = x[i] * dt
    for k in range(n):
        d = x[i] - p[k]
        a += wp.normalize(d) * wp.exp(-wp.dot(d, d)) - wp.cross(d, p[k])
    for k in range(m[0]):
        d = x[i] + p[k]
        a -= wp.normalize(d) * wp.exp(-wp.dot(d, d)) - wp.cross(d, p[k])
    if on:
        for c in range(3):
            a[c] += wp.sin(a[c]) * wp.cos(a[c]) + wp.exp(a[c]) * wp.tanh(a[c])
    y[i] = a + x[i]


def expected(x, n, on, m, p, dt):
    x, p = x.astype(np.float64), p.astype(np.float64)
    a = x * np.float64(np.float32(dt))

    def part(d, q):
        square = (d * d).sum(1, keepdims=True)
        return d / np.sqrt(square) * np.exp(-square) - np.cross(d, q)

    for k in range(n):
        a = a + part(x - p[k], p[k])
    for k in range(m):
        a = a - part(x + p[k], p[k])
    if on:
        a = a + np.sin(a) * np.cos(a) + np.exp(a) * np.tanh(a)
    return a + x


def make(device, **options):
    """A kernel without versions so far, and arrays for it."""
    random = np.random.default_rng(5)
    kernel = wp.kernel(name="parts", module="unique", **options)(body)
    data = [random.uniform(-1.0, 1.0, (size, 3)).astype(np.float32) for size in (COUNT, 8)]
    x, p = (wp.array(one, dtype=wp.vec3, device=device) for one in data)
    y = wp.zeros(COUNT, dtype=wp.vec3, device=device)
    m = wp.zeros(1, dtype=int, device=device)
    return kernel, x, y, m, p


def left_out(kernel, device):
    """Notes of code left out, by kind of launch; none for the general code."""
    return [
        [choice.reason for choice in schedule.choices if choice.what == "left out"]
        for schedule in kernel.schedule(device)
    ]


def test_results_do_not_change_with_the_version(device):
    kernel, x, y, m, p = make(device)
    values = [(0, False, 0)] * 3 + [(3, False, 0), (0, True, 0), (0, False, 2), (4, True, 3)] * 2
    seen = {}
    for n, on, count in values:
        m.fill_(count)
        y.zero_()
        wp.launch(kernel, COUNT, [x, y, n, on, m, p, 0.25], device=device)
        got = y.numpy()
        wanted = expected(x.numpy(), n, on, count, p.numpy(), 0.25)
        np.testing.assert_allclose(got, wanted, rtol=1e-5, atol=1e-5)
        first = seen.setdefault((n, on, count), got)
        np.testing.assert_array_equal(first, got)


def test_second_launch_with_zeros_has_a_version():
    kernel, x, y, m, p = make("cpu")
    wp.launch(kernel, COUNT, [x, y, 0, False, m, p, 0.25], device="cpu")
    assert left_out(kernel, "cpu") == [[]]
    wp.launch(kernel, COUNT, [x, y, 0, False, m, p, 0.25], device="cpu")
    (general, version) = left_out(kernel, "cpu")
    assert general == [] and version == ["zero in such launches: n, on, m"]
    # There is no other one.
    for _ in range(4):
        wp.launch(kernel, COUNT, [x, y, 0, True, m, p, 0.25], device="cpu")
    assert len(left_out(kernel, "cpu")) == 2


def test_recorded_launches_read_counts_anew():
    kernel, x, y, m, p = make("cpu")
    command = wp.launch(kernel, COUNT, [x, y, 0, False, m, p, 0.25], device="cpu", record_cmd=True)

    def check(counts):
        for count in counts:
            m.fill_(count)
            y.zero_()
            command.launch()
            wanted = expected(x.numpy(), 0, False, count, p.numpy(), 0.25)
            np.testing.assert_allclose(y.numpy(), wanted, rtol=1e-5, atol=1e-5)

    # Launches with the same zeros as the one before keep its plan.
    check((2, 2, 0, 0, 0, 0, 2, 0, 0, 3, 3, 0, 3))
    m = wp.zeros_like(m)
    command.set_param_at_index(4, m)
    check((0, 0, 3))
    # Other launches have the version made.
    kernel, x, y, m, p = make("cpu")
    values = [x, y, 0, False, m, p, 0.25]
    command = wp.launch(kernel, COUNT, values, device="cpu", record_cmd=True)
    check((2, 2))
    m.zero_()
    for _ in range(2):
        wp.launch(kernel, COUNT, values, device="cpu")
    assert len(left_out(kernel, "cpu")) == 2
    check((0, 0, 3, 3))
    command.set_param_at_index(2, 3)
    command.launch()
    wanted = expected(x.numpy(), 3, False, 3, p.numpy(), 0.25)
    np.testing.assert_allclose(y.numpy(), wanted, rtol=1e-5, atol=1e-5)


def test_graphs_read_counts_anew(device):
    kernel, x, y, m, p = make(device)
    for _ in range(3):
        wp.launch(kernel, COUNT, [x, y, 0, False, m, p, 0.25], device=device)
    with wp.ScopedCapture(device=device) as capture:
        wp.launch(kernel, COUNT, [x, y, 0, False, m, p, 0.25], device=device)
    for count in (2, 0, 3):
        m.fill_(count)
        wp.capture_launch(capture.graph)
        wanted = expected(x.numpy(), 0, False, count, p.numpy(), 0.25)
        np.testing.assert_allclose(y.numpy(), wanted, rtol=1e-5, atol=1e-5)


def test_counts_that_a_launch_writes_are_no_zeros():
    """Thread 0 runs first, on one thread of the CPU, and the others see what it wrote."""

    @wp.kernel
    def count(m: wp.array(dtype=int), y: wp.array(dtype=int), out: wp.array(dtype=int)):
        i = wp.tid()
        if i == 0:
            out[0] = 3
        total = int(0)
        for k in range(m[0]):
            total += k * i + (k ^ i) * (k | i) + (k & i) * 3 + k * k - i
        y[i] = total

    m, y = wp.zeros(1, dtype=int, device="cpu"), wp.zeros(64, dtype=int, device="cpu")
    for _ in range(4):
        wp.launch(count, 1, [m, y, m], device="cpu")
        assert m.numpy()[0] == 3
        m.zero_()
    assert all(one == [] for one in left_out(count, "cpu"))


@pytest.mark.parametrize("options", [{"mode": "debug"}, {"deterministic": True}])
def test_modes_without_versions(options):
    kernel, x, y, m, p = make("cpu", module_options=options)
    for _ in range(4):
        wp.launch(kernel, COUNT, [x, y, 0, False, m, p, 0.25], device="cpu")
    assert all(one == [] for one in left_out(kernel, "cpu"))


def test_derivatives_without_iterations(device):
    """d/dx of x dt + x is dt + 1, whatever code the adjoint has."""
    kernel, x, y, m, p = make(device)
    x = wp.clone(x, requires_grad=True)
    y.requires_grad = p.requires_grad = True
    for _ in range(4):
        tape = wp.Tape()
        with tape:
            wp.launch(kernel, COUNT, [x, y, 0, False, m, p, 0.25], device=device)
        y.grad.fill_(1.0)
        tape.backward()
        np.testing.assert_array_equal(x.grad.numpy(), np.full((COUNT, 3), 1.25))
        np.testing.assert_array_equal(p.grad.numpy(), 0.0)
        tape.zero()


def test_products_keep_their_rounding(device):
    """x * x is rounded before 1 is subtracted, with the loop as without it."""

    @wp.kernel(module="unique")
    def rest(x: wp.array(dtype=float), y: wp.array(dtype=float), n: int):
        i = wp.tid()
        s = x[i] * x[i]
        for k in range(n):
            s += wp.sin(float(k)) * x[i] + wp.cos(x[i]) * wp.exp(x[i]) - s * x[i]
        y[i] = s - 1.0

    values = (1.0 + np.arange(1, 65) * 2.0**-12 + 2.0**-20).astype(np.float32)
    x, y = wp.array(values, device=device), wp.zeros(64, dtype=float, device=device)
    wanted = values * values - np.float32(1.0)
    assert (wanted != (values.astype(np.float64) ** 2 - 1.0).astype(np.float32)).any()
    for _ in range(4):
        wp.launch(rest, 64, [x, y, 0], device=device)
        np.testing.assert_array_equal(y.numpy(), wanted)


def test_fused_launches_read_counts_anew():
    """Graphs keep code for what memory holds when they run, not when they were captured."""
    kernel, x, y, m, p = make("cpu")
    z = wp.zeros(COUNT, dtype=wp.vec3, device="cpu")
    for _ in range(4):
        with wp.ScopedCapture(device="cpu", optimize=True) as capture:
            wp.launch(kernel, COUNT, [x, y, 0, False, m, p, 0.25], device="cpu")
            wp.launch(kernel, COUNT, [y, z, 0, False, m, p, 0.25], device="cpu")
    for count in (2, 0, 3):
        m.fill_(count)
        wp.capture_launch(capture.graph)
        first = expected(x.numpy(), 0, False, count, p.numpy(), 0.25)
        np.testing.assert_allclose(y.numpy(), first, rtol=1e-5, atol=1e-5)
        second = expected(y.numpy(), 0, False, count, p.numpy(), 0.25)
        np.testing.assert_allclose(z.numpy(), second, rtol=1e-4, atol=1e-4)
