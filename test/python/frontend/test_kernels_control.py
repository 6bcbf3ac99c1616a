"""Control flow of kernels, executed and compared with the same code run by Python."""

import enum

import numpy as np
import pytest

import warp as wp

N = 37


def evaluate(kernel, device, *inputs, dtype=int, n=N):
    """Launch `kernel(inputs..., out)` over `n` threads; the output as NumPy array."""
    out = wp.zeros(n, dtype=dtype, device=device)
    wp.launch(kernel, n, list(inputs), [out], device=device)
    return out.numpy()


def test_if_elif_else_merges_values(device):
    @wp.kernel
    def kernel(out: wp.array(dtype=int)):
        i = wp.tid()
        r = 0
        if i % 3 == 0:
            r = 10 + i
        elif i % 3 == 1:
            r = 20 - i
        else:
            r = i * i
        out[i] = r

    expected = [10 + i if i % 3 == 0 else 20 - i if i % 3 == 1 else i * i for i in range(N)]
    assert evaluate(kernel, device).tolist() == expected


def test_variable_first_assigned_in_branches(device):
    @wp.kernel
    def kernel(out: wp.array(dtype=int)):
        i = wp.tid()
        if i > 5:
            r = 2 * i
        else:
            r = -i
        out[i] = r

    assert evaluate(kernel, device).tolist() == [2 * i if i > 5 else -i for i in range(N)]


def test_static_and_dynamic_ranges(device):
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=int)):
        i = wp.tid()
        s = int(0)
        for a in range(4):
            s += a
        for b in range(n):
            s += b * i
        for c in range(10, n, -3):
            s += c * 100
        for d in range(i, i + 5, 2):
            s -= d
        out[i] = s

    def reference(i, n):
        s = sum(range(4)) + sum(b * i for b in range(n)) + sum(c * 100 for c in range(10, n, -3))
        return s - sum(range(i, i + 5, 2))

    for n in (0, 3, 20):
        assert evaluate(kernel, device, n).tolist() == [reference(i, n) for i in range(N)]


def test_dynamic_step_of_either_sign(device):
    @wp.kernel
    def kernel(lo: int, hi: int, step: int, out: wp.array(dtype=int)):
        i = wp.tid()
        s = int(0)
        for k in range(lo, hi, step):
            s = s * 3 + k
        out[i] = s + i

    for lo, hi, step in [(0, 7, 2), (7, 0, -2), (3, 3, 1), (0, 5, -1), (5, 0, 1)]:
        s = 0
        for k in range(lo, hi, step):
            s = s * 3 + k
        assert evaluate(kernel, device, lo, hi, step).tolist() == [s + i for i in range(N)]


def test_while_break_continue(device):
    @wp.kernel
    def kernel(limit: int, out: wp.array(dtype=int)):
        i = wp.tid()
        k = int(0)
        s = int(0)
        while True:
            k += 1
            if k % 2 == 0:
                continue
            if s > limit or k > i:
                break
            s += k
        out[i] = s * 1000 + k

    def reference(i, limit):
        k = s = 0
        while True:
            k += 1
            if k % 2 == 0:
                continue
            if s > limit or k > i:
                break
            s += k
        return s * 1000 + k

    assert evaluate(kernel, device, 50).tolist() == [reference(i, 50) for i in range(N)]


def test_break_leaves_only_the_inner_loop(device):
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=int)):
        i = wp.tid()
        s = int(0)
        for a in range(n):
            for b in range(n):
                if b > a:
                    break
                if (a + b) % 3 == i % 3:
                    continue
                s += a * 10 + b
            if s > 500:
                break
        out[i] = s

    def reference(i, n):
        s = 0
        for a in range(n):
            for b in range(n):
                if b > a:
                    break
                if (a + b) % 3 == i % 3:
                    continue
                s += a * 10 + b
            if s > 500:
                break
        return s

    assert evaluate(kernel, device, 9).tolist() == [reference(i, 9) for i in range(N)]


def test_early_return_skips_the_rest(device):
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=int)):
        i = wp.tid()
        if i % 4 == 1:
            return
        for k in range(n):
            if k == i:
                out[i] = 7
                return
        out[i] = -1

    expected = [0 if i % 4 == 1 else 7 if i < 10 else -1 for i in range(N)]
    assert evaluate(kernel, device, 10).tolist() == expected


def test_function_returns_from_inside_a_loop(device):
    @wp.func
    def first_divisor(n: int):
        for k in range(2, n):
            if n % k == 0:
                return k
        return n

    @wp.kernel
    def kernel(out: wp.array(dtype=int)):
        i = wp.tid()
        out[i] = first_divisor(i + 2)

    expected = [next(k for k in range(2, n + 1) if n % k == 0) for n in range(2, N + 2)]
    assert evaluate(kernel, device).tolist() == expected


def test_boolean_logic_is_short_circuit(device):
    @wp.kernel
    def kernel(x: wp.array(dtype=int), out: wp.array(dtype=int)):
        i = wp.tid()
        # x has ten elements: the guard keeps the read in bounds.
        if i < 10 and x[i] > 3:
            out[i] = 1
        if i >= 10 or x[i] > 5:
            out[i] += 2
        if not (i == 3):
            out[i] += 4

    x = wp.array(np.arange(10, dtype=np.int32), dtype=int, device=device)
    expected = [
        int(i < 10 and i > 3) + 2 * int(i >= 10 or i > 5) + 4 * int(i != 3) for i in range(N)
    ]
    assert evaluate(kernel, device, x).tolist() == expected


def test_chained_comparison_and_ternary(device):
    @wp.kernel
    def kernel(out: wp.array(dtype=int)):
        i = wp.tid()
        inside = 3 < i <= 20 != 15
        out[i] = (i if inside else -i) + (100 if 0 == i % 2 == 0 else 0)

    expected = [(i if 3 < i <= 20 else -i) + (100 if i % 2 == 0 else 0) for i in range(N)]
    assert evaluate(kernel, device).tolist() == expected


def test_constants_come_from_python(device):
    class Mode(enum.IntEnum):
        FAST = 3
        SLOW = 11

    scale = wp.constant(5)
    shift = 2

    @wp.kernel
    def kernel(out: wp.array(dtype=int)):
        i = wp.tid()
        if i < Mode.FAST:
            out[i] = i * scale + shift
        else:
            out[i] = int(Mode.SLOW) + N + Mode.FAST.value

    assert evaluate(kernel, device).tolist() == [5 * i + 2 if i < 3 else 14 + N for i in range(N)]


def test_closures_of_one_source_differ_by_constant(device):
    def make(c):
        @wp.kernel
        def kernel(out: wp.array(dtype=float)):
            out[wp.tid()] = c

        return kernel

    values = [0.5, 0.25, 1.0e-3]
    kernels = [make(v) for v in values]
    for value, kernel in zip(values, kernels):
        assert evaluate(kernel, device, dtype=float)[0] == np.float32(value)


def test_tuples_unpack_and_swap(device):
    @wp.func
    def divide(a: int, b: int):
        return a / b, a % b

    @wp.kernel
    def kernel(out: wp.array(dtype=int)):
        i = wp.tid()
        q, r = divide(i, 5)
        q, r = r, q
        a, b, c = 1, 2, i
        out[i] = q * 1000 + r * 10 + a + b + c

    expected = [i % 5 * 1000 + i // 5 * 10 + 3 + i for i in range(N)]
    assert evaluate(kernel, device).tolist() == expected


def test_functions_with_defaults_keywords_and_calls_among_each_other(device):
    @wp.func
    def scaled(x: int, factor: int = 3, offset: int = 1):
        return x * factor + offset

    @wp.func
    def twice(x: int):
        return scaled(scaled(x), offset=5)

    @wp.kernel
    def kernel(out: wp.array(dtype=int)):
        i = wp.tid()
        out[i] = twice(i) + scaled(x=i, factor=2) * 1000

    assert evaluate(kernel, device).tolist() == [
        (3 * i + 1) * 3 + 5 + (2 * i + 1) * 1000 for i in range(N)
    ]


def test_function_overloads_choose_by_type(device):
    @wp.func
    def kind(x: int):
        return 1

    @wp.func
    def kind(x: float):  # noqa: F811
        return 2

    @wp.kernel
    def kernel(out: wp.array(dtype=int)):
        i = wp.tid()
        out[i] = kind(i) * 10 + kind(float(i))

    assert set(evaluate(kernel, device).tolist()) == {12}


def test_names_that_other_languages_reserve(device):
    @wp.kernel
    def register(unsigned: int, template: wp.array(dtype=int)):
        volatile = wp.tid()
        union = unsigned + volatile
        template[volatile] = union

    out = wp.zeros(3, dtype=int, device=device)
    wp.launch(register, 3, [5, out], device=device)
    assert out.numpy().tolist() == [5, 6, 7]


@pytest.mark.parametrize("count", [0, 1, 16, 17, 100])
def test_loop_value_is_visible_after_the_loop(device, count):
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=int)):
        i = wp.tid()
        last = int(-1)
        for k in range(n):
            last = k
            part = k * i
            last += part
        out[i] = last

    expected = [-1 if count == 0 else (count - 1) * (1 + i) for i in range(N)]
    assert evaluate(kernel, device, count).tolist() == expected


def test_nested_loops_carry_many_values(device):
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=float)):
        i = wp.tid()
        a = float(i)
        b = float(1.0)
        v = wp.vec3(0.0, 1.0, 2.0)
        for j in range(n):
            k = j
            while k > 0:
                a = a * 0.5 + b
                b = b * 0.25 + float(k)
                v = v * 0.5 + wp.vec3(a, b, 1.0)
                k -= 1
        out[i] = a + b + v[0] + v[1] * 2.0 + v[2] * 3.0

    def reference(i, n):
        a, b, v = float(i), 1.0, np.array([0.0, 1.0, 2.0])
        for j in range(n):
            for k in range(j, 0, -1):
                a = a * 0.5 + b
                b = b * 0.25 + k
                v = v * 0.5 + np.array([a, b, 1.0])
        return a + b + v @ [1.0, 2.0, 3.0]

    expected = [reference(i, 6) for i in range(N)]
    np.testing.assert_allclose(evaluate(kernel, device, 6, dtype=float), expected, rtol=2e-6)


def test_reversed_range(device):
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=int)):
        i = wp.tid()
        s = int(0)
        for k in reversed(range(n)):
            s = s * 2 + k
        out[i] = s

    s = 0
    for k in reversed(range(6)):
        s = s * 2 + k
    assert set(evaluate(kernel, device, 6).tolist()) == {s}
