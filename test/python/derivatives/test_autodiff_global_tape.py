"""Adjoints of loops that keep all of their iterations in memory allocated for the launch.

Expected gradients are complex-step derivatives of the same computation in NumPy.
"""

import numpy as np
import pytest

import autodiff_catalogue
import warp as wp

LOOPS = ("T54", "T55", "T57", "T58", "T59", "T61", "T63", "T67", "T68", "T69", "T71")
F = wp.float64
GLOBAL = {"tape": "global"}
# Rows of a tape have 65536 elements.
TRIPS = [0, 1, 17, 100_000, 31, 65_536, 2, 0]


@wp.kernel(module_options=GLOBAL)
def sines(x: wp.array(dtype=F), n: wp.array(dtype=int), y: wp.array(dtype=F)):
    i = wp.tid()
    s = x[i]
    for _ in range(n[i]):
        s = wp.sin(s) + F(0.4) * s
    y[i] = s


def sines_in_numpy(x, n):
    for _ in range(n):
        x = np.sin(x) + 0.4 * x
    return x


@wp.kernel(module_options=GLOBAL)
def exits(x: wp.array(dtype=F), n: wp.array(dtype=int), y: wp.array(dtype=F)):
    i = wp.tid()
    s = x[i]
    for k in range(n[i]):
        if k % 3 == 1:
            continue
        s = s * s + F(0.01) * F(k)
        if s > F(2.0):
            break
    while s > F(0.3):
        s = s * wp.cos(s) * F(0.9)
    y[i] = s


def exits_in_numpy(x, n):
    for k in range(n):
        if k % 3 == 1:
            continue
        x = x * x + 0.01 * k
        if x.real > 2.0:
            break
    while x.real > 0.3:
        x = x * np.cos(x) * 0.9
    return x


@wp.kernel(module_options=GLOBAL)
def nested(x: wp.array(dtype=F), n: wp.array(dtype=int), y: wp.array(dtype=F)):
    i = wp.tid()
    s = x[i]
    for k in range(n[i] % 40):
        for _ in range(k % 5):
            s = s * F(0.9) + F(0.1) * wp.sin(s)
        s = s * s * F(0.7) + F(0.2)
    y[i] = s


def nested_in_numpy(x, n):
    for k in range(n % 40):
        for _ in range(k % 5):
            x = x * 0.9 + 0.1 * np.sin(x)
        x = x * x * 0.7 + 0.2
    return x


@wp.kernel(module_options=GLOBAL)
def sums(x: wp.array(dtype=F), n: wp.array(dtype=int), y: wp.array(dtype=F)):
    i = wp.tid()
    state = wp.uint32(12345)
    total = F(0.0)
    for _ in range(n[i] % 40):
        state = state * wp.uint32(1664525) + wp.uint32(1013904223)
        s = x[i] * F(state >> wp.uint32(16)) * F(1e-4)
        for _ in range(int(state >> wp.uint32(28))):
            s = wp.sin(s) + F(0.1)
        total += s * s
    y[i] = total


def sums_in_numpy(x, n):
    state, total = 12345, 0.0 * x
    for _ in range(n % 40):
        state = (state * 1664525 + 1013904223) % 2**32
        s = x * (state >> 16) * 1e-4
        for _ in range(state >> 28):
            s = np.sin(s) + 0.1
        total += s * s
    return total


@wp.kernel(module_options=GLOBAL)
def branches(x: wp.array(dtype=F), n: wp.array(dtype=int), y: wp.array(dtype=F)):
    i = wp.tid()
    v = wp.vec3d(x[i], F(0.3), F(-0.2))
    up = bool(True)
    seed = wp.uint32(i)
    if i % 2 == 1:
        for k in range(n[i] % 1000):
            u = wp.randf(seed)
            if up:
                v = wp.vec3d(wp.sin(v[1]), v[2] + F(0.2) * F(u), v[0])
            else:
                v = wp.vec3d(v[0] * v[1], v[2], v[0] - v[2])
            up = (v[0] > F(0.2)) != (k % 2 == 0)
    else:
        for _ in range(3 * (n[i] % 100)):
            v = wp.vec3d(v[1], wp.cos(v[2]), v[0] * v[2])
    y[i] = v[0] + F(2.0) * v[1] - v[2]


def draws_in_numpy(seed, n):
    """Numbers of the PCG generator, see Jarzynski and Olano, JCGT 9(3), 2020."""
    for _ in range(n):
        state = (seed * 747796405 + 2891336453) % 2**32
        word = (((state >> ((state >> 28) + 4)) ^ state) * 277803737) % 2**32
        seed = (word >> 22) ^ word
        yield (seed >> 8) * 2.0**-24


def branches_in_numpy(x, n, i):
    a, b, c, up = x, 0.3, -0.2, True
    if i % 2 == 1:
        for k, u in enumerate(draws_in_numpy(i, n % 1000)):
            if up:
                a, b, c = np.sin(b), c + 0.2 * u, a
            else:
                a, b, c = a * b, c, a - c
            up = (np.real(a) > 0.2) != (k % 2 == 0)
    else:
        for _ in range(3 * (n % 100)):
            a, b, c = b, np.cos(c), a * c
    return a + 2.0 * b - c


def gradient(kernel, x, trips, device):
    x = wp.array(x, dtype=F, device=device, requires_grad=True)
    y = wp.zeros(len(trips), dtype=F, device=device, requires_grad=True)
    n = wp.array(trips, dtype=int, device=device)
    with wp.Tape() as tape:
        wp.launch(kernel, len(trips), [x, n, y], device=device)
    tape.backward(grads={y: wp.ones(len(trips), dtype=F, device=device)})
    return x.grad.numpy()


def complex_step(function, x, trips):
    return [function(v + 1e-30j, n).imag * 1e30 for v, n in zip(x, trips, strict=True)]


@pytest.mark.parametrize(
    ("kernel", "function"),
    [
        (sines, sines_in_numpy),
        (exits, exits_in_numpy),
        (nested, nested_in_numpy),
        (sums, sums_in_numpy),
    ],
    ids=["sines", "exits", "nested", "sums"],
)
def test_gradients(kernel, function, device):
    x = np.linspace(0.3, 1.1, len(TRIPS))
    got = gradient(kernel, x, TRIPS, device)
    np.testing.assert_allclose(got, complex_step(function, x, TRIPS), rtol=1e-9)
    assert wp.autograd.adjoint_metrics(kernel)["tape_bytes_per_trip"] > 0


def test_states_of_several_types_in_branches(device):
    trips = [0, 1, 250, 999, 64, 501, 99, 777]
    x = np.linspace(0.3, 1.1, len(trips))
    got = gradient(branches, x, trips, device)
    expected = [
        np.imag(branches_in_numpy(v + 1e-30j, n, i)) * 1e30
        for i, (v, n) in enumerate(zip(x, trips, strict=True))
    ]
    np.testing.assert_allclose(got, expected, rtol=1e-9)
    assert wp.autograd.adjoint_metrics(branches)["tape_bytes"] == 0


def test_no_iterations_at_all(device):
    np.testing.assert_array_equal(gradient(sines, [0.5, 0.7], [0, 0], device), [1.0, 1.0])
    assert gradient(sines, [], [], device).shape == (0,)


def test_launches_of_rank_two(device):
    @wp.kernel(module_options=GLOBAL)
    def grid(x: wp.array2d(dtype=F), y: wp.array2d(dtype=F)):
        i, j = wp.tid()
        s = x[i, j]
        for _ in range(i * 7 + j):
            s = wp.sin(s) + F(0.4) * s
        y[i, j] = s

    values = np.linspace(0.3, 1.1, 12).reshape(3, 4)
    x = wp.array(values, dtype=F, device=device, requires_grad=True)
    y = wp.zeros_like(x)
    with wp.Tape() as tape:
        wp.launch(grid, (3, 4), [x, y], device=device)
    tape.backward(grads={y: wp.ones((3, 4), dtype=F, device=device)})
    trips = np.add.outer(7 * np.arange(3), np.arange(4)).ravel()
    expected = complex_step(sines_in_numpy, values.ravel(), trips)
    np.testing.assert_allclose(x.grad.numpy().ravel(), expected, rtol=1e-12)


@pytest.mark.cuda
def test_launches_on_other_streams():
    x = wp.array([0.5, 0.9], dtype=F, device="cuda:0", requires_grad=True)
    y = wp.zeros(2, dtype=F, device="cuda:0", requires_grad=True)
    n = wp.array([70_000, 3], dtype=int, device="cuda:0")
    y.grad.fill_(1.0)
    wp.synchronize_device("cuda:0")
    wp.launch(sines, 2, [x, n, y], adjoint=True, stream=wp.Stream("cuda:0"))
    wp.synchronize_device("cuda:0")
    expected = complex_step(sines_in_numpy, [0.5, 0.9], [70_000, 3])
    np.testing.assert_allclose(x.grad.numpy(), expected, rtol=1e-9)


def test_loops_that_atomics_decide_about(device):
    """Counting has what the launch saved."""

    @wp.kernel(module_options=GLOBAL)
    def numbered(x: wp.array(dtype=F), count: wp.array(dtype=int), y: wp.array(dtype=F)):
        i = wp.tid()
        number = wp.atomic_add(count, 0, 3)
        s = x[i]
        for _ in range(number):
            s = wp.sin(s) + F(0.4) * s
        y[i] = s

    x = wp.array([0.4] * 5, dtype=F, device=device, requires_grad=True)
    y = wp.zeros(5, dtype=F, device=device, requires_grad=True)
    count = wp.zeros(1, dtype=int, device=device)
    with wp.Tape() as tape:
        wp.launch(numbered, 5, [x, count, y], device=device)
    tape.backward(grads={y: wp.ones(5, dtype=F, device=device)})
    expected = complex_step(sines_in_numpy, [0.4] * 5, range(0, 15, 3))
    np.testing.assert_allclose(sorted(x.grad.numpy()), sorted(expected), rtol=1e-12)
    assert wp.autograd.adjoint_metrics(numbered)["tape_bytes_per_trip"] == 8


def test_gradients_that_repeat():
    """With exact sums, too, threads may have their parts of the tape in any order."""

    @wp.kernel(module_options=GLOBAL | {"deterministic": True})
    def shared(x: wp.array(dtype=F), n: wp.array(dtype=int), y: wp.array(dtype=F)):
        i = wp.tid()
        s = x[0]
        for _ in range(n[i]):
            s = wp.sin(s) + F(0.4) * s
        wp.atomic_add(y, 0, s)

    trips = [3, 500, 0, 41] * 16
    found = []
    for _ in range(3):
        x = wp.array([0.4], dtype=F, requires_grad=True)
        y = wp.zeros(1, dtype=F, requires_grad=True)
        with wp.Tape() as tape:
            wp.launch(shared, len(trips), [x, wp.array(trips, dtype=int), y])
        tape.backward(grads={y: wp.ones(1, dtype=F)})
        found.append(x.grad.numpy()[0])
    expected = 16.0 * sum(complex_step(sines_in_numpy, [0.4] * 4, trips[:4]))
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert len(set(found)) == 1


def test_what_it_costs():
    """Checkpoints have memory in each thread, the tape has some per iteration."""

    def halve(x: wp.array(dtype=float), n: int, y: wp.array(dtype=float)):
        i = wp.tid()
        s = x[i]
        for _ in range(n):
            s = s * s * 0.5
        y[i] = s

    kept = wp.autograd.adjoint_metrics(wp.kernel(halve, name="kept", module_options=GLOBAL))
    assert (kept["tape_bytes"], kept["tape_bytes_per_trip"], kept["replay_loops"]) == (0, 4, 1)
    again = wp.autograd.adjoint_metrics(wp.kernel(halve, name="again"))
    assert again["tape_bytes"] > 0
    assert again["tape_bytes_per_trip"] == 0


def test_the_setting_and_its_values(monkeypatch):
    def cube(x: wp.array(dtype=float), n: int, y: wp.array(dtype=float)):
        i = wp.tid()
        s = x[i]
        for _ in range(n):
            s = s * s * s
        y[i] = s

    kernel = wp.kernel(cube)
    arguments = [wp.ones(2, requires_grad=True), 3, wp.zeros(2, requires_grad=True)]
    wp.launch(kernel, 2, arguments, adjoint=True)
    assert wp.autograd.adjoint_metrics(kernel)["tape_bytes_per_trip"] == 0
    monkeypatch.setattr(wp.config, "tape", "global")
    wp.launch(kernel, 2, arguments, adjoint=True)
    assert wp.autograd.adjoint_metrics(kernel)["tape_bytes_per_trip"] == 4
    with pytest.raises(ValueError, match="'checkpoints'"):
        wp.config.tape = "endless"
    with pytest.raises(ValueError, match="'checkpoints'"):
        wp.kernel(cube, name="other", module_options={"tape": "endless"})


def test_too_much_memory_is_an_error_before_anything_runs(device):
    threads = 2000
    x = wp.array(np.full(threads, 0.5), dtype=F, device=device, requires_grad=True)
    y = wp.zeros(threads, dtype=F, device=device, requires_grad=True)
    y.grad.fill_(1.0)
    n = wp.full(threads, 2**31 - 1, dtype=int, device=device)
    needed = threads * (2**31 - 1) * 8
    with pytest.raises(MemoryError, match=rf"'sines'.* needs {needed} bytes.*") as caught:
        wp.launch(sines, threads, [x, n, y], adjoint=True, device=device)
    assert "'checkpoints'" in str(caught.value)
    assert not x.grad.numpy().any()
    assert (y.grad.numpy() == 1.0).all()


def test_captured_graphs_have_no_tape(device):
    x = wp.ones(2, dtype=F, device=device, requires_grad=True)
    y = wp.zeros(2, dtype=F, device=device, requires_grad=True)
    n = wp.full(2, 5, dtype=int, device=device)
    gradient(sines, [0.5], [3], device)
    with pytest.raises(RuntimeError, match="'sines'.*while a graph is being captured") as caught:
        with wp.ScopedCapture(device):
            wp.launch(sines, 2, [x, n, y], adjoint=True, device=device)
    assert "'checkpoints'" in str(caught.value)
    assert __file__ in str(caught.value)


def test_products_with_the_hessian(device):
    """Forward mode over the adjoint has checkpoints."""

    def total(x):
        y = wp.zeros(2, dtype=F, device=device, requires_grad=True)
        loss = wp.zeros(1, dtype=F, device=device, requires_grad=True)
        n = wp.array([4, 9], dtype=int, device=device)
        wp.launch(sines, 2, [x, n, y], device=device)
        wp.launch(collect, 2, [y, loss], device=device)
        return loss

    @wp.kernel
    def collect(y: wp.array(dtype=F), loss: wp.array(dtype=F)):
        wp.atomic_add(loss, 0, y[wp.tid()])

    x = wp.array([0.5, 0.8], dtype=F, device=device, requires_grad=True)
    along = wp.ones(2, dtype=F, device=device)
    got = wp.autograd.hvp(total, inputs=[x], vectors=[along]).numpy()
    step = 1e-5
    above, below = (gradient(sines, [0.5 + h, 0.8 + h], [4, 9], device) for h in (step, -step))
    np.testing.assert_allclose(got, (above - below) / (2.0 * step), rtol=1e-8)


def test_bad_gradients_are_found(device):
    """The sanitizer explains a gradient of a loop that is in a tape."""

    @wp.kernel(module_options=GLOBAL)
    def roots(x: wp.array(dtype=float), n: int, y: wp.array(dtype=float)):
        i = wp.tid()
        s = x[i]
        for _ in range(n):
            s = wp.sqrt(s) * s * 1.0e30
        y[i] = s

    x = wp.array([1.0e-3], dtype=float, device=device, requires_grad=True)
    y = wp.zeros(1, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(roots, 1, [x, 6, y], device=device)
    with pytest.raises(RuntimeError, match="gradient of 'x' became"):
        tape.backward(grads={y: wp.ones(1, dtype=float, device=device)}, check_finite=True)


CASES = [run for run in autodiff_catalogue.runs() if run[0] in LOOPS]


@pytest.mark.parametrize(("number", "precision"), CASES, ids=map("-".join, CASES))
def test_cases_of_the_catalogue(number, precision, device, monkeypatch):
    monkeypatch.setattr(wp.config, "tape", "global")
    autodiff_catalogue.check_case(number, precision, device)
