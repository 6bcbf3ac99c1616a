"""Lanes of the CPU are compared with scalar code while a kernel runs."""

import time

import numpy as np
import pytest

import warp as wp


def make(**options):
    @wp.kernel(module="unique", module_options=options)
    def roots(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        s = float(0.0)
        for k in range(8):
            s += wp.sqrt(x[i] + float(k))
        y[i] = s

    return roots


def measured(kernel):
    """The line about it, or nothing."""
    lines = str(kernel.schedule("cpu")).splitlines()
    return [line for line in lines if line.strip().startswith("measured")]


def launch(kernel, seconds, until=lambda: False):
    """Launches for some time; the results of each launch are the same."""
    x = np.linspace(0.0, 9.0, 1 << 16, dtype=np.float32)
    given = wp.array(x, dtype=float, device="cpu")
    result = wp.zeros(len(x), dtype=float, device="cpu")
    wanted = sum(np.sqrt(x.astype(np.float64) + k) for k in range(8))
    end = time.monotonic() + seconds
    while time.monotonic() < end and not until():
        for _ in range(50):
            result.zero_()
            wp.launch(kernel, len(x), [given, result], device="cpu")
            np.testing.assert_allclose(result.numpy(), wanted, rtol=1e-6)


def test_both_times_are_told():
    """Compilation in the background has as much time as it needs."""
    kernel = make()
    launch(kernel, 120, lambda: measured(kernel))
    (line,) = measured(kernel)
    assert "lanes took" in line and "scalar code" in line


def test_another_width_is_checked_where_lanes_stay():
    """Lanes that beat scalar code are compared with half or twice as many."""

    @wp.kernel(module="unique")
    def squares(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = wp.sin(x[i]) * x[i] + 2.0

    x = np.linspace(0.0, 9.0, 1 << 14, dtype=np.float32)
    given = wp.array(x, dtype=float, device="cpu")
    result = wp.zeros(len(x), dtype=float, device="cpu")
    wanted = np.sin(x.astype(np.float64)) * x + 2.0
    wp.launch(squares, len(x), [given, result], device="cpu")
    (lanes,) = [c.value for s in squares.schedule("cpu") for c in s.choices if c.what == "lanes"]
    end = time.monotonic() + 120
    while time.monotonic() < end and len(measured(squares)) < 2:
        for _ in range(50):
            result.zero_()
            wp.launch(squares, len(x), [given, result], device="cpu")
            np.testing.assert_allclose(result.numpy(), wanted, rtol=1e-6, atol=1e-6)
    scalar, other = measured(squares)
    assert "scalar code" in scalar
    width = int(lanes) // 2 if int(lanes) > 16 else 2 * int(lanes)
    assert "lanes took" in other and f", {width} lanes" in other


def test_scalar_code_is_compared_with_lanes():
    """The model takes gathers along short rows to lose; launches tell."""

    @wp.kernel(module="unique")
    def rows(
        begin: wp.array(dtype=int),
        x: wp.array(dtype=float),
        k: wp.array(dtype=int),
        y: wp.array(dtype=float),
    ):
        i = wp.tid()
        s = float(0.0)
        for e in range(begin[i], begin[i + 1]):
            s += x[k[e]]
        y[i] = s

    random = np.random.default_rng(3)
    begin = np.r_[0, random.integers(0, 12, 1 << 13).cumsum()]
    numbers = random.integers(0, 4096, begin[-1])
    x = random.random(4096).astype(np.float32)
    sums = np.r_[0, x[numbers].astype(np.float64).cumsum()]
    wanted = sums[begin[1:]] - sums[begin[:-1]]
    given = [
        wp.array(begin, dtype=int, device="cpu"),
        wp.array(x, dtype=float, device="cpu"),
        wp.array(numbers, dtype=int, device="cpu"),
    ]
    result = wp.zeros(1 << 13, dtype=float, device="cpu")

    def launched():
        result.zero_()
        wp.launch(rows, 1 << 13, [*given, result], device="cpu")
        np.testing.assert_allclose(result.numpy(), wanted, rtol=1e-5, atol=1e-6)

    launched()
    (lanes,) = [c.value for s in rows.schedule("cpu") for c in s.choices if c.what == "lanes"]
    assert lanes == "1"
    end = time.monotonic() + 120
    while time.monotonic() < end and not measured(rows):
        launched()
    line = measured(rows)[0]
    assert "scalar code took" in line and ", 16 lanes " in line
    for _ in range(50):
        launched()


def test_scalar_code_of_planes_is_compared_with_lanes():
    """Lanes come along long rows, and launches over short ones have code of their own."""

    @wp.kernel(module="unique")
    def rows(
        begin: wp.array2d(dtype=int),
        end: wp.array2d(dtype=int),
        x: wp.array(dtype=float),
        k: wp.array(dtype=int),
        y: wp.array2d(dtype=float),
    ):
        i, j = wp.tid()
        s = float(0.0)
        for e in range(begin[i, j], end[i, j]):
            s += x[k[e]]
        y[i, j] = s

    random = np.random.default_rng(4)
    x = random.random(4096).astype(np.float32)
    numbers = random.integers(0, 4096, 1 << 18)
    sums = np.r_[0, x[numbers].astype(np.float64).cumsum()]
    given = [wp.array(one, device="cpu") for one in (x, numbers.astype(np.int32))]

    def prepared(shape):
        ends = np.r_[0, random.integers(0, 12, np.prod(shape)).cumsum()]
        begin, end = (one.reshape(shape) for one in (ends[:-1], ends[1:]))
        places = [wp.array(one, dtype=int, ndim=2, device="cpu") for one in (begin, end)]
        result = wp.zeros(shape, dtype=float, device="cpu")
        return shape, places, result, sums[end] - sums[begin]

    def launched(shape, places, result, wanted):
        result.zero_()
        wp.launch(rows, shape, [*places, *given, result], device="cpu")
        np.testing.assert_allclose(result.numpy(), wanted, rtol=1e-5, atol=1e-6)

    long, short = prepared((64, 300)), [prepared((1000, n)) for n in (1, 3, 7, 20, 33)]
    launched(*long)
    (lanes,) = [c.value for s in rows.schedule("cpu") for c in s.choices if c.what == "lanes"]
    assert lanes == "1"
    end = time.monotonic() + 120
    while time.monotonic() < end and not measured(rows):
        launched(*long)
    assert "scalar code took" in measured(rows)[0]
    for one in [long, *short] * 20:
        launched(*one)


@pytest.mark.parametrize("threads", [1, 2])
def test_kernels_with_atomics_are_checked(threads, monkeypatch):
    """Pieces of launches update each element as often as it has to be, alone or in copies."""

    @wp.kernel(module="unique")
    def counted(
        x: wp.array(dtype=float), count: wp.array(dtype=int), total: wp.array(dtype=wp.float64)
    ):
        i = wp.tid()
        s = float(0.0)
        for k in range(8):
            s += wp.sqrt(x[i] + float(k))
        wp.atomic_add(count, i % 10, 1)
        wp.atomic_add(total, i % 10, wp.float64(s))

    monkeypatch.setattr(wp.config, "num_threads", threads)
    x = np.linspace(0.0, 9.0, 1 << 16, dtype=np.float32)
    given = wp.array(x, dtype=float, device="cpu")
    count = wp.zeros(10, dtype=int, device="cpu")
    total = wp.zeros(10, dtype=wp.float64, device="cpu")
    roots = sum(np.sqrt(x.astype(np.float64) + k) for k in range(8))
    wanted = [roots[first::10].sum() for first in range(10)]
    end = time.monotonic() + 120
    while time.monotonic() < end and len(measured(counted)) < 2:
        for _ in range(50):
            count.zero_()
            total.zero_()
            wp.launch(counted, len(x), [given, count, total], device="cpu")
            np.testing.assert_array_equal(count.numpy(), [len(x[k::10]) for k in range(10)])
            np.testing.assert_allclose(total.numpy(), wanted, rtol=1e-6)
    assert len(measured(counted)) >= 2


@pytest.mark.parametrize("options", [{"deterministic": True}, {"cpu_lanes": 8}])
def test_lanes_that_are_settled_stay(options):
    """Deterministic kernels keep their bits, and lanes that are asked for are there."""
    kernel = make(**options)
    launch(kernel, 1.0)
    assert not measured(kernel)


def test_setting_turns_it_off(monkeypatch):
    monkeypatch.setattr(wp.config, "check_lanes", False)
    kernel = make()
    launch(kernel, 1.0)
    assert not measured(kernel)


@pytest.mark.parametrize("gathers", [False, True])
def test_launches_of_all_extents_take_part(gathers):
    """NaN and infinities, the array itself as the result, extents around those of vectors and
    of pieces: each index runs once, whichever code runs it."""

    @wp.kernel(module="unique")
    def streamed(k: wp.array(dtype=int), x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = wp.sqrt(x[i]) * 0.5 + 1.0

    @wp.kernel(module="unique")
    def gathered(k: wp.array(dtype=int), x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        s = float(0.0)
        for e in range(k[i] % 5):
            s += x[k[(i + e) % k.shape[0]]]
        y[i] = y[i] + s

    random = np.random.default_rng(8)
    extents = [0, 1, 7, 8, 9, 15, 16, 17, 31, 33, 511, 512, 513, 2049, 70001]
    most = extents[-1]
    x = random.random(most).astype(np.float32)
    x[random.integers(0, most, 500)] = np.nan
    x[random.integers(0, most, 500)] = np.inf
    x[random.integers(0, most, 500)] *= -1.0
    k = random.integers(0, most, most)
    numbers = wp.array(k, dtype=int, device="cpu")
    kernel = gathered if gathers else streamed

    def wanted(n):
        with np.errstate(invalid="ignore"):
            if not gathers:
                return (np.sqrt(x[:n]) * np.float32(0.5) + np.float32(1.0)).astype(np.float32)
            sums = np.zeros(n, dtype=np.float32)
            for e in range(4):
                at = k[(np.arange(n) + e) % most]
                sums = np.where(e < k[:n] % 5, sums + x[at], sums).astype(np.float32)
            return (x[:n] + sums).astype(np.float32)

    results = {n: wanted(n) for n in extents}
    given = wp.array(x, dtype=float, device="cpu")
    result = wp.zeros(most, dtype=float, device="cpu")
    end = time.monotonic() + 120
    while time.monotonic() < end and not measured(kernel):
        for n in extents:
            result.assign(x)
            wp.launch(kernel, n, [numbers, given if gathers else result, result], device="cpu")
            np.testing.assert_array_equal(result.numpy()[:n], results[n])
            np.testing.assert_array_equal(result.numpy()[n:], x[n:])
    assert measured(kernel)
