"""Constant tables: captured NumPy arrays and tuples that kernels index."""

from typing import Any

import numpy as np
import pytest

import warp as wp

RNG = np.random.default_rng(7)
WEIGHTS = RNG.normal(size=27)
SINGLE = WEIGHTS.astype(np.float32)
SHIFTS = RNG.integers(-1, 2, size=(3, 27)).astype(np.int8)
DEEP = RNG.normal(size=(2, 3, 4, 5)).astype(np.float32)
FLAGS = np.array([True, False, False, True])
PRIMES = (2, 3, 5, 7)
RULES = ((0.1, 1.0, 2.5), (1e-3, -4.0, 0.0))
AXES = (wp.vec3(1.0, 2.0, 3.0), wp.vec3(4.0, 5.0, 6.0))
WIDE = RNG.normal(size=(3, 40))


@wp.kernel
def read_all(i: wp.array(dtype=int), d: wp.array(dtype=wp.float64), f: wp.array2d(dtype=float)):
    t = wp.tid()
    k = i[t]
    d[t] = WEIGHTS[k]
    f[t, 0] = SINGLE[k]
    f[t, 1] = float(SHIFTS[k % 3, k])
    f[t, 2] = DEEP[k % 2, k % 3, k % 4, k % 5]
    f[t, 3] = float(PRIMES[k % 4])
    f[t, 4] = RULES[k % 2][k % 3]
    f[t, 5] = float(int(FLAGS[k % 4]))
    f[t, 6] = float(WEIGHTS[k])
    f[t, 7] = AXES[k % 2][k % 3]
    row = WIDE[k % 3]
    f[t, 8] = float(row[7] + row[39])
    f[t, 10] = float(row[k])
    f[t, 9] = wp.length(AXES[k % 2])


def expected(k):
    floats = np.zeros((len(k), 11))
    floats[:, 0] = SINGLE[k]
    floats[:, 1] = SHIFTS[k % 3, k]
    floats[:, 2] = DEEP[k % 2, k % 3, k % 4, k % 5]
    floats[:, 3] = np.array(PRIMES)[k % 4]
    floats[:, 4] = np.array(RULES, np.float32)[k % 2, k % 3]
    floats[:, 5] = FLAGS[k % 4]
    floats[:, 6] = SINGLE[k]
    axes = np.array([[1, 2, 3], [4, 5, 6]])
    floats[:, 7] = axes[k % 2, k % 3]
    floats[:, 8] = (WIDE[k % 3, 7] + WIDE[k % 3, 39]).astype(np.float32)
    floats[:, 9] = np.linalg.norm(axes, axis=1)[k % 2]
    floats[:, 10] = WIDE[k % 3, k].astype(np.float32)
    return WEIGHTS[k], floats


@pytest.mark.parametrize("count", [1, 15, 1000])
def test_elements_are_those_of_numpy(count, device):
    k = RNG.integers(0, 27, size=count).astype(np.int32)
    doubles = wp.zeros(count, dtype=wp.float64, device=device)
    floats = wp.zeros((count, 11), dtype=float, device=device)
    wp.launch(
        read_all, count, [wp.array(k, dtype=int, device=device), doubles, floats], device=device
    )
    exact, near = expected(k)
    np.testing.assert_array_equal(doubles.numpy(), exact)
    np.testing.assert_allclose(floats.numpy(), near, rtol=2e-7)


@wp.kernel
def read_one(i: wp.array(dtype=wp.int64), o: wp.array2d(dtype=int)):
    t = wp.tid()
    o[t, 0] = PRIMES[i[t]]
    o[t, 1] = int(SHIFTS[2, i[t]])


def test_an_index_counts_from_the_end_and_stays_in_the_table(device):
    index = np.array([-1, -4, 4, -5, 2**31, -(2**40), 2**62, 1], np.int64)
    out = wp.zeros((len(index), 2), dtype=int, device=device)
    wp.launch(read_one, len(index), [wp.array(index, device=device), out], device=device)
    assert out.numpy()[:, 0].tolist() == [7, 2, 7, 7, 7, 7, 7, 3]
    wide = np.where((index < -27) | (index >= 27), 26, index)
    assert out.numpy()[:, 1].tolist() == SHIFTS[2, wide].tolist()


def test_debug_launches_report_an_index(device, monkeypatch):
    monkeypatch.setattr(wp.config, "mode", "debug")
    out = wp.zeros((2, 2), dtype=int, device=device)
    index = wp.array(np.array([0, 4], np.int64), device=device)
    with pytest.raises(wp.WarpError, match="a table"):
        wp.launch(read_one, 2, [index, out], device=device)
        wp.synchronize_device(device)


FIVE = RNG.normal(size=(2, 2, 2, 2, 2))


@wp.kernel
def read_five(i: wp.array(dtype=int), o: wp.array(dtype=wp.float64)):
    k = i[0]
    o[0] = FIVE[k % 2, 0, 1, k % 2, k]


def test_debug_launches_check_all_dimensions(device, monkeypatch):
    monkeypatch.setattr(wp.config, "mode", "debug")
    out = wp.zeros(1, dtype=wp.float64, device=device)
    wp.launch(read_five, 1, [wp.array([1], dtype=int, device=device), out], device=device)
    assert out.numpy()[0] == FIVE[1, 0, 1, 1, 1]
    with pytest.raises(wp.WarpError, match="a table"):
        wp.launch(read_five, 1, [wp.array([2], dtype=int, device=device), out], device=device)
        wp.synchronize_device(device)


@wp.func
def weighed(table: Any, x: float, k: int):
    return table[k] * x


@wp.kernel
def polynomial(x: wp.array(dtype=float), o: wp.array(dtype=float)):
    t = wp.tid()
    s = float(0.0)
    for k in range(27):
        s += weighed(SINGLE, x[t], k) * x[t]
    o[t] = s


def test_a_table_is_an_argument_and_has_no_gradient(device):
    at = np.linspace(-1, 1, 33).astype(np.float32)
    x = wp.array(at, dtype=float, device=device, requires_grad=True)
    out = wp.zeros(33, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(polynomial, 33, [x, out], device=device)
    tape.backward(grads={out: wp.ones(33, dtype=float, device=device)})
    total = SINGLE.astype(np.float64).sum()
    np.testing.assert_allclose(out.numpy(), total * at.astype(np.float64) ** 2, atol=1e-5)
    np.testing.assert_allclose(x.grad.numpy(), 2 * total * at.astype(np.float64), atol=1e-5)


def kernel_of(table):
    @wp.kernel
    def read(o: wp.array(dtype=float)):
        o[wp.tid()] = float(wp.static(table)[wp.tid(), 1]) + float(table[0][wp.tid()])

    return read


@pytest.mark.parametrize(
    "table",
    [
        np.arange(6.0).reshape(3, 2).T[:, ::-1],
        np.arange(6, dtype=">i4").reshape(2, 3),
        np.arange(6, dtype=np.uint64).reshape(2, 3),
        np.arange(6, dtype=np.float16).reshape(2, 3),
    ],
)
def test_layout_and_type_of_the_array(table):
    out = wp.zeros(2, dtype=float, device="cpu")
    wp.launch(kernel_of(table), 2, [out], device="cpu")
    np.testing.assert_array_equal(out.numpy(), (table[:, 1] + table[0, :2]).astype(np.float32))


@wp.kernel
def known(o: wp.array(dtype=int)):
    table = wp.static(np.array([[4, 3], [2, 5]], np.int32))
    for i in range(table.shape[0]):
        for _ in range(table[1, 0]):
            o[0] += table[i][len(table) - 1]


def test_elements_at_known_places_are_numbers():
    out = wp.zeros(1, dtype=int, device="cpu")
    wp.launch(known, 1, [out], device="cpu")
    assert out.numpy()[0] == 2 * (3 + 5)
