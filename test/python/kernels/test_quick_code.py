"""Small first launches on a CPU run quickly compiled code, and tier-1 code later, with the same
bits."""

import gc
import os
import time

import numpy as np
import pytest

import programs
import warp as wp
from kernel_cache import codes
from warp import _native


@pytest.fixture(autouse=True)
def unchecked(monkeypatch):
    """No code with other lanes is made to compare, so that pieces of code are tiers."""
    monkeypatch.setattr(wp.config, "check_lanes", False)


def make_kernel(**options):
    @wp.kernel(module="unique", module_options=options or None)
    def mixed(
        x: wp.array(dtype=float),
        trips: int,
        y: wp.array(dtype=float),
        total: wp.array(dtype=int),
        turns: wp.array(dtype=wp.quat),
    ):
        i = wp.tid()
        value = x[i]
        for k in range(trips):
            value = value * 1.01 + wp.sin(value) / (1.0 + float(k))
            if value > 3.0:
                value = wp.sqrt(value) - wp.exp(-value)
        axis = wp.normalize(wp.vec3(value, x[i], 1.0))
        turns[i] = wp.quat_from_axis_angle(axis, wp.atan2(value, x[i]))
        y[i] = value
        wp.atomic_add(total, 0, int(value))

    return mixed


def run(kernel, count=40, trips=7):
    x = wp.array(np.linspace(-4.0, 4.0, count, dtype=np.float32), device="cpu")
    y, total = wp.zeros(count, dtype=float, device="cpu"), wp.zeros(1, dtype=int, device="cpu")
    turns = wp.zeros(count, dtype=wp.quat, device="cpu")
    wp.launch(kernel, count, [x, trips], [y, total, turns], device="cpu")
    return b"".join(one.numpy().tobytes() for one in (y, total, turns))


def launch_until_better(folder, launch, seconds=60.0):
    """Launches until a second piece of code is in the cache."""
    end = time.monotonic() + seconds
    while codes(folder) < 2:
        assert time.monotonic() < end, f"after {seconds} s the cache has {codes(folder)} pieces"
        for _ in range(200):
            launch()
        _native.wait_for_background()


def test_better_code_comes_with_the_same_bits(fresh_cache):
    kernel = make_kernel()
    first = run(kernel)
    assert codes(fresh_cache) == 1
    launch_until_better(fresh_cache, lambda: run(kernel))
    assert run(kernel) == first
    # Others have no more to compile: what the cache has is the best code.
    again = make_kernel()
    assert run(again) == first
    assert codes(fresh_cache) == 2


@pytest.mark.parametrize("count", [1, 5, 15, 16, 40, 333])
def test_levels_have_the_same_bits(count):
    found = {level: run(make_kernel(optimization_level=level), count) for level in (0, 1, 2, 3)}
    assert run(make_kernel(), count) == found[2]
    assert set(found.values()) == {found[2]}


def test_a_large_launch_gets_the_best_code_at_once(fresh_cache):
    kernel = make_kernel()
    run(kernel, 1_000_000, 100)
    assert codes(fresh_cache) == 1
    for _ in range(3):
        run(kernel, 1_000_000, 100)
    _native.wait_for_background()
    assert codes(fresh_cache) == 1


def test_a_large_launch_waits_for_the_best_code(fresh_cache):
    kernel = make_kernel()
    small = run(kernel, 100)
    assert codes(fresh_cache) == 1
    run(kernel, 1_000_000)
    assert codes(fresh_cache) == 2
    assert run(kernel, 100) == small


def make_long(shared=False, **options):
    """A kernel that takes long to compile and has loops that nobody knows the length of."""

    @wp.func
    def turn(m: wp.mat44, k: int):
        v = wp.vec4(float(k), 1.0, 2.0, 3.0)
        for row in range(4):
            if wp.length(v) > 2.0:
                v = wp.normalize(m * v) + wp.vec4(m[row, 0], m[row, 1], m[row, 2], m[row, 3])
        return wp.outer(v, v) * wp.inverse(m) + m

    @wp.kernel(module="unique", module_options=options or None)
    def long(trips: wp.array(dtype=int), y: wp.array(dtype=wp.mat44), total: wp.array(dtype=int)):
        i = wp.tid()
        m = wp.identity(n=4, dtype=float) * (1.0 + float(i))
        for a in range(trips[i]):
            for b in range(trips[i]):
                m = turn(m, a)
                for c in range(trips[i]):
                    m = turn(turn(turn(turn(m, b), a + c), b - c), a * b)
        y[i] = m
        if wp.static(shared):
            wp.atomic_add(total, i % 3, trips[i])

    return long


def run_long(kernel, count=24, most=3):
    trips = wp.array(np.arange(count) % most, dtype=int, device="cpu")
    y = wp.zeros(count, dtype=wp.mat44, device="cpu")
    total = wp.zeros(3, dtype=int, device="cpu")
    wp.launch(kernel, count, [trips], [y, total], device="cpu")
    return y.numpy().tobytes() + total.numpy().tobytes()


@pytest.mark.parametrize("shared", [False, True])
def test_long_code_is_quick_first_whatever_its_loops_may_cost(fresh_cache, shared):
    """Threads that come later have tier-1 code as soon as it is there, with the same bits."""
    kernel = make_long(shared)
    first = run_long(kernel)
    large = [run_long(kernel, count=2000, most=6) for _ in range(3)]
    # Only code that was compiled quickly is made again.
    launch_until_better(fresh_cache, lambda: run_long(kernel))
    best = make_long(shared, optimization_level=2)
    assert run_long(kernel) == run_long(best) == first
    assert {*large, run_long(kernel, 2000, 6), run_long(best, 2000, 6)} == {large[0]}


@pytest.mark.parametrize(
    "options", [{"optimization_level": 2}, {"fast_math": True}, {"mode": "debug"}]
)
def test_what_the_user_asks_for_is_compiled_so(fresh_cache, options):
    kernel = make_kernel(**options)
    for _ in range(1000):
        run(kernel, 100)
    _native.wait_for_background()
    assert codes(fresh_cache) == 1


def test_a_loaded_kernel_has_the_best_code(fresh_cache):
    kernel = make_kernel()
    wp.load_module(kernel.module, device="cpu")
    count = codes(fresh_cache)
    for _ in range(1000):
        run(kernel, 100)
    _native.wait_for_background()
    # At most that of another kind of launch.
    assert codes(fresh_cache) <= count + 2


def test_sums_in_any_order_have_the_best_code_at_once(fresh_cache):
    """The two might add in another order."""

    @wp.kernel(module="unique")
    def norm(x: wp.array(dtype=float), total: wp.array(dtype=float)):
        wp.atomic_add(total, 0, x[wp.tid()] * x[wp.tid()])

    x = wp.array(np.linspace(-1.0, 1.0, 1000, dtype=np.float32), device="cpu")
    found = set()
    for _ in range(1000):
        total = wp.zeros(1, dtype=float, device="cpu")
        wp.launch(norm, 1000, [x, total], device="cpu")
        found.add(total.numpy().tobytes())
    _native.wait_for_background()
    assert codes(fresh_cache) == 1
    assert len(found) == 1


def test_sums_that_the_user_compiled_quickly_are_not_taken_for_the_same_bits(fresh_cache):
    def make(**options):
        @wp.kernel(module="unique", module_options=options or None)
        def norm(x: wp.array(dtype=float), total: wp.array(dtype=float)):
            wp.atomic_add(total, 0, x[wp.tid()] * x[wp.tid()])

        return norm

    x = wp.array(np.random.default_rng(3).normal(size=999), dtype=float, device="cpu")

    def run(kernel):
        total = wp.zeros(1, dtype=float, device="cpu")
        wp.launch(kernel, 999, [x, total], device="cpu")
        return total.numpy().tobytes()

    run(make(optimization_level=0))
    kernel = make()
    found = {run(kernel) for _ in range(1000)}
    _native.wait_for_background()
    assert {*found, run(kernel)} == {run(make(optimization_level=2))}


def test_loaded_long_code_is_the_best(fresh_cache):
    kernel = make_long()
    wp.load_module(kernel.module, device="cpu")
    before = codes(fresh_cache)
    for _ in range(300):
        run_long(kernel)
    _native.wait_for_background()
    # At most that of another kind of launch, which is quick first.
    assert codes(fresh_cache) <= before + 2


def scale_kernel():
    @wp.kernel(module="unique")
    def scale(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = wp.sin(x[i]) * 2.0

    return scale


@pytest.mark.parametrize("kind", ["recorded", "graph"])
def test_recorded_launches_go_over(fresh_cache, kind):
    kernel = scale_kernel()
    x = wp.array(np.linspace(0.0, 1.0, 100, dtype=np.float32), device="cpu")
    y = wp.zeros(100, dtype=float, device="cpu")
    if kind == "recorded":
        command = wp.launch(kernel, 100, [x], [y], device="cpu", record_cmd=True)
        replay = command.launch
    else:
        with wp.ScopedCapture(device="cpu") as capture:
            wp.launch(kernel, 100, [x], [y], device="cpu")
        replay = lambda: wp.capture_launch(capture.graph)  # noqa: E731
    replay()
    first = y.numpy()
    np.testing.assert_allclose(first, 2.0 * np.sin(x.numpy()), rtol=1e-6)
    assert codes(fresh_cache) == 1
    launch_until_better(fresh_cache, replay)
    y.zero_()
    replay()
    assert y.numpy().tobytes() == first.tobytes()


def test_kernels_may_go_while_better_code_is_made():
    for _ in range(5):
        kernel = make_kernel()
        assert len({run(kernel, 100) for _ in range(300)}) == 1
        del kernel
        gc.collect()
    _native.wait_for_background()


PROGRAM = programs.write_program("""
import os, sys
import warp as wp
from warp import _native
wp.config.quiet = True

kernels = []
for c in range(8):
    @wp.kernel(module="unique")
    def fill(x: wp.array(dtype=float), trips: int):
        i = wp.tid()
        for k in range(trips):
            x[i] = wp.sin(x[i]) + wp.static(float(c))
    kernels.append(fill)

def run():
    found = []
    for kernel in kernels:
        x = wp.zeros(200, dtype=float, device="cpu")
        for _ in range(300):
            wp.launch(kernel, 200, [x, 10], device="cpu")
        found.append(x.numpy().tobytes())
    return found

if sys.argv[1] == "fork":
    expected = run()
    child = os.fork()
    found = run()
    assert found == expected
    if child == 0:
        _native.wait_for_background()
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
else:
    run()
print("done")
""")


@pytest.mark.parametrize("what", ["exit", "fork"])
def test_a_process_may_end_or_fork_meanwhile(tmp_path, what):
    for attempt in range(3):
        status, out, err = programs.run(PROGRAM, what, WARP_CACHE_PATH=tmp_path / str(attempt))
        assert (status, out.strip()) == (0, "done"), err
    assert os.listdir(tmp_path)


@pytest.mark.parametrize("dim", [0, (0,), (3, 0), [0, 5]])
def test_a_launch_of_no_threads_translates_nothing(fresh_cache, dim):
    kernel = make_kernel()
    wp.launch(kernel, dim, [], device="cpu")
    assert kernel.native is None and not fresh_cache.exists()


def test_impossible_extents_beside_zero_are_refused():
    for dim in (-1, (0, -1), (0, 1, 1, 1, 1)):
        with pytest.raises((ValueError, wp.WarpError)):
            wp.launch(scale_kernel(), dim, [wp.zeros(1, dtype=float), wp.zeros(1, dtype=float)])
