"""Kernels and surroundings that a hostile user would try."""

import os
import subprocess
import sys
import threading

import numpy as np
import pytest

import warp as wp


@pytest.mark.parametrize(
    "lo,hi,step",
    [
        (2147483640, 2147483647, 5),
        (2147483640, 2147483647, 7),
        (2147483000, 2147483646, 1000),
        (-2147483640, -2147483648, -5),
        (-2147483648, 2147483647, 2147483647),
        (0, 2147483647, 2147483647),
        (-5, 40, 9),
    ],
)
def test_ranges_end_at_the_limits_of_the_type(device, lo, hi, step):
    @wp.kernel
    def static(out: wp.array(dtype=int)):
        for i in range(lo, hi, step):
            out[0] = out[0] + 1
            out[1] = i

    @wp.kernel
    def dynamic(a: int, b: int, out: wp.array(dtype=int)):
        for i in range(a, b, step):
            out[0] = out[0] + 1
            out[1] = i

    @wp.kernel
    def open_step(a: int, b: int, c: int, out: wp.array(dtype=int)):
        for i in range(a, b, c):
            out[0] = out[0] + 1
            out[1] = i

    expected = list(range(lo, hi, step))
    for kernel, inputs in ((static, []), (dynamic, [lo, hi]), (open_step, [lo, hi, step])):
        out = wp.zeros(2, dtype=int, device=device)
        wp.launch(kernel, 1, [*inputs, out], device=device)
        assert out.numpy().tolist() == [len(expected), expected[-1]]


def test_stepped_loops_over_arrays(device):
    @wp.kernel
    def kernel(x: wp.array(dtype=float), n: int, out: wp.array(dtype=float)):
        t = wp.tid()
        total = float(0.0)
        for i in range(t, n, 8):
            total += x[i]
        for i in range(t - 8, 0, 3):
            total += x[i] * 100.0
        out[t] = total

    data = np.arange(101, dtype=np.float32)
    out = wp.zeros(8, dtype=float, device=device)
    wp.launch(kernel, 8, [wp.array(data, dtype=float, device=device), 101, out], device=device)
    expected = [data[t::8].sum() + 100 * sum(data[i] for i in range(t - 8, 0, 3)) for t in range(8)]
    np.testing.assert_array_equal(out.numpy(), np.array(expected, dtype=np.float32))


def test_extremes_of_nothing_but_nan(device):
    @wp.kernel
    def kernel(x: wp.array(dtype=float), low: wp.array(dtype=float), high: wp.array(dtype=float)):
        i = wp.tid()
        wp.atomic_min(low, 0, x[i])
        wp.atomic_max(high, 0, x[i])

    n = 40000
    some = np.where(np.arange(n) % 7 == 0, np.nan, np.arange(n) - 100.0)
    cases = [np.full(n, np.nan), some, np.full(n, np.inf), np.full(n, -np.inf)]
    for data in cases:
        for start in (np.nan, 5.0, np.inf, -np.inf):
            x = wp.array(data.astype(np.float32), dtype=float, device=device)
            low, high = (wp.full(1, start, dtype=float, device=device) for _ in range(2))
            wp.launch(kernel, n, [x, low, high], device=device)
            expected = [np.fmin(start, np.fmin.reduce(data)), np.fmax(start, np.fmax.reduce(data))]
            np.testing.assert_array_equal([low.numpy()[0], high.numpy()[0]], expected)


def test_kernels_on_two_threads_update_one_array():
    """One of them is cheap enough to run without atomic instructions on few cores."""

    @wp.kernel
    def scatter(at: wp.array(dtype=int), count: wp.array(dtype=int)):
        wp.atomic_add(count, at[wp.tid()], 1)

    @wp.kernel
    def heavy(x: wp.array(dtype=float), count: wp.array(dtype=int)):
        i = wp.tid()
        s = float(0.0)
        for j in range(20):
            s += wp.sin(x[i] + float(j))
        wp.atomic_add(count, wp.where(s > 1.0e9, 1, 0), 1)

    @wp.kernel
    def total(count: wp.array(dtype=int)):
        wp.atomic_add(count, 0, 1)

    n = 200_000
    count = wp.zeros(2, dtype=int, device="cpu")
    at = wp.zeros(n, dtype=int, device="cpu")
    x = wp.zeros(n, dtype=float, device="cpu")
    work = {
        scatter: ([at, count], n, 200),
        heavy: ([x, count], 50_000, 30),
        total: ([count], n, 99),
    }

    def launch(kernel):
        arguments, items, times = work[kernel]
        for _ in range(times):
            wp.launch(kernel, items, arguments, device="cpu")

    threads = [threading.Thread(target=launch, args=(kernel,)) for kernel in work]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert count.numpy()[0] == sum(items * times for _, items, times in work.values())


def test_expressions_too_deep_are_named(tmp_path):
    (tmp_path / "deep.py").write_text(
        "import warp as wp\n@wp.kernel\ndef kernel(out: wp.array(dtype=float)):\n"
        f"    out[0] = {' + '.join(['out[1]'] * 900)}\n"
    )
    sys.path.insert(0, str(tmp_path))
    try:
        import deep
    finally:
        sys.path.remove(str(tmp_path))
    out = wp.zeros(2, dtype=float, device="cpu")
    with pytest.raises(wp.WarpCodegenError, match=r"deep.py:4:\d+: .*nested too deeply"):
        wp.launch(deep.kernel, 1, [out], device="cpu")


def test_errors_point_at_the_first_line_of_a_statement():
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        i = wp.tid()
        try:
            out[i] = 1.0
        finally:
            out[i] = 2.0

    out = wp.zeros(1, dtype=float, device="cpu")
    with pytest.raises(wp.WarpCodegenError) as caught:
        wp.launch(kernel, 1, [out], device="cpu")
    assert caught.value.line == kernel.func.__code__.co_firstlineno + 3
    assert "try:\n" in str(caught.value)


def test_paths_that_are_no_text(tmp_path):
    folder = os.fsencode(tmp_path) + b"/odd\xff"
    os.mkdir(folder)
    program = folder + b"/program.py"
    with open(program, "w") as file:
        file.write(
            "import warp as wp\n@wp.kernel\ndef kernel(out: wp.array(dtype=float)):\n"
            "    out[wp.tid()] = 2.0\n"
            "out = wp.zeros(1, dtype=float, device='cpu')\n"
            "wp.launch(kernel, 1, [out], device='cpu')\n"
            "print(out.numpy())\n"
        )
    environment = {**os.environb, b"WARP_CACHE_PATH": folder + b"/cache"}
    done = subprocess.run([sys.executable, program], env=environment, capture_output=True)
    assert (done.stdout, done.returncode) == (b"[2.]\n", 0), done.stderr.decode()
    assert os.listdir(folder + b"/cache")
