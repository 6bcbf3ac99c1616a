"""Loops, what leaves them, and what is evaluated when."""

import numpy as np

import warp as wp
from frontend_programs import run


def test_names_leave_branches_and_loops():
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=float)):
        for i in range(n):
            if i == 1:
                z = 11.0
        out[0] = z
        out[1] = float(i)
        kept = float(0.0)
        for i in range(n):
            for j in range(i):
                if j == 1:
                    w = float(i)
            if i > 1:
                kept += w
        out[2] = kept
        if n > 100:
            never = 5.0
        out[3] = never

    assert run(kernel, 4)[:4] == [11.0, 3.0, 5.0, 0.0]


def test_return_from_nested_loops():
    @wp.func
    def find(x: wp.array2d(dtype=int), value: int):
        for i in range(x.shape[0]):
            for j in range(x.shape[1]):
                if x[i, j] == value:
                    return i, j
        return -1, -1

    @wp.kernel
    def kernel(x: wp.array2d(dtype=int), out: wp.array(dtype=int)):
        i, j = find(x, 7)
        out[0] = i
        out[1] = j
        i, j = find(x, 99)
        out[2] = i

    x = wp.array(np.arange(12, dtype=np.int32).reshape(3, 4), device="cpu")
    assert run(kernel, x, dtype=int)[:3] == [1, 3, -1]


def test_ranges():
    @wp.kernel
    def kernel(n: int, s: int, out: wp.array(dtype=int)):
        for i in reversed(range(n)):
            out[0] = out[0] * 10 + i
        for i in range(n, 0, s):
            out[1] = out[1] * 10 + i
        for i in range(wp.int64(3)):
            out[2] += int(i)
        for i in range(2147483640, 2147483647, 5):
            out[3] += 1
            if i < 0:
                break
        for _ in range(5, n - 10):
            out[4] += 1
        for i in range(n):
            i = i * 2
            out[5] += i

    assert run(kernel, 4, -2, dtype=int)[:6] == [3210, 42, 3, 2, 0, 12]


def test_short_circuit_protects_an_access():
    @wp.kernel
    def kernel(x: wp.array(dtype=float), n: int, out: wp.array(dtype=float)):
        i = wp.tid()
        if i < n and x[i] > 0.0:
            out[i] = 1.0
        k = int(0)
        while k < n and x[k] > 0.0:
            k += 1
        out[15] = float(k)
        out[14] = x[1000000000] if n > 1000 else 3.0

    x = wp.array(np.ones(4, np.float32), device="cpu")
    result = run(kernel, x, 4, n=8)
    assert result[:8] == [1.0] * 4 + [0.0] * 4 and result[14:] == [3.0, 4.0]


def test_state_of_random_numbers_is_updated_everywhere():
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        s = wp.rand_init(7, wp.tid())
        a = wp.randf(s)
        n = int(0)
        while wp.randf(s) < 0.8 and n < 1000:
            n += 1
        b = wp.randf(s)
        if a < 2.0 and wp.randf(s) < 2.0:
            c = wp.randf(s)
        wp.atomic_add(out, 0, float(n))
        wp.atomic_add(out, 1, float(a != b and b != c))
        wp.atomic_add(out, 2, float(s != wp.rand_init(7, wp.tid())))

    count, differ, moved = run(kernel, n=8)[:3]
    assert 0 < count < 200 and differ == moved == 8.0


def test_state_by_keyword_is_updated_too():
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=float)):
        a = wp.rand_init(seed=7)
        b = wp.rand_init(7)
        for i in range(n):
            out[i] = wp.randf(a) - wp.randf(low=0.0, state=b, high=1.0)
        out[4] = float(a == b)
        out[5] = float(a != wp.rand_init(7))
        # The new value of a state that no variable holds is dropped.
        out[6] = wp.randf(wp.rand_init(7)) - wp.randf(state=wp.rand_init(7))

    assert run(kernel, 4)[:7] == [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0]
