"""Deterministic sums are exact: rounded once, and the same in every order."""

import math
import os
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest

import warp as wp

DETERMINISTIC = {"deterministic": "gpu_to_gpu"}
REALS = [wp.float32, wp.float64]


def numpy_type(real):
    return np.float32 if real is wp.float32 else np.float64


def nearest(exact: Fraction, kind):
    """The float nearest to a number, ties to even; infinite from half beyond the largest."""
    largest = Fraction(float(np.finfo(kind).max))
    half_step = largest - Fraction(float(np.nextafter(np.finfo(kind).max, kind(0), dtype=kind)))
    if abs(exact) >= largest + half_step / 2:
        return kind(math.inf if exact > 0 else -math.inf)
    guess = kind(float(min(max(exact, -largest), largest)))
    with np.errstate(over="ignore"):
        candidates = [np.nextafter(guess, kind(s * np.inf)) for s in (-1, 1)] + [guess]
    finite = [c for c in candidates if np.isfinite(c)]

    def error(c):
        odd = int(c.view(np.uint32 if kind is np.float32 else np.uint64)) & 1
        return abs(Fraction(float(c)) - exact), odd

    return min(finite, key=error)


def exact_sum(values, start=0.0):
    return sum((Fraction(float(v)) for v in values), Fraction(float(start)))


def make_total(real):
    @wp.kernel(module_options=DETERMINISTIC)
    def total(x: wp.array(dtype=real), s: wp.array(dtype=real)):
        wp.atomic_add(s, 0, x[wp.tid()])

    return total


def make_scatter(real):
    @wp.kernel(module_options=DETERMINISTIC)
    def scatter(x: wp.array(dtype=real), to: wp.array(dtype=int), s: wp.array(dtype=real)):
        i = wp.tid()
        wp.atomic_add(s, to[i], x[i])

    return scatter


TOTAL = {real: make_total(real) for real in REALS}
SCATTER = {real: make_scatter(real) for real in REALS}


def add_up(real, values, device, start=0.0, block_dim=256):
    x = wp.array(np.asarray(values, numpy_type(real)), dtype=real, device=device)
    s = wp.full(1, start, dtype=real, device=device)
    wp.launch(TOTAL[real], x.size, [x, s], device=device, block_dim=block_dim)
    return s.numpy()[0]


def bits(a):
    return np.asarray(a).tobytes()


def hard_data(kind):
    random = np.random.default_rng(5)
    info = np.finfo(kind)
    big, tiny, least = info.max / 4, info.tiny, info.smallest_subnormal
    normal = random.standard_normal(4000).astype(kind)
    powers = 2.0 ** random.integers(info.minexp, info.maxexp - 2, 3000)
    wide = random.choice([-1.0, 1.0], 3000) * random.uniform(1, 2, 3000) * powers
    return {
        "normal": normal,
        "all magnitudes": wide.astype(kind),
        "cancellation": np.concatenate([normal, -normal[::-1], [kind(1e-30)]]),
        "large and small": np.array([big, 1e-38, -big, 1e-38, 1e38, -1e38], kind),
        "subnormal": random.integers(-500, 500, 3000) * least,
        "to the least normal": np.array([tiny, -least, tiny, -tiny], kind),
        "alternating": np.array([1e8, -1e8] * 1000 + [0.1], kind),
        "one huge, many small": np.concatenate([[1e30], np.full(5000, 1e-3)]).astype(kind),
        "a tie to even": np.array([1.0, info.eps / 2], kind),
        "a tie to odd": np.array([1.0 + info.eps, info.eps / 2], kind),
        "more than a tie": np.array([1.0, info.eps / 2, least], kind),
        "less than a tie": np.array([1.0, info.eps / 2, -least], kind),
        "carries": np.full(5000, 1.0 - info.epsneg, kind),
        "negative carries": np.full(5000, info.epsneg - 1.0, kind),
        "beyond the largest and back": np.array([info.max] * 40 + [-info.max] * 39, kind),
        "overflow": np.array([info.max, info.max], kind),
        "negative overflow": np.array([-info.max] * 3, kind),
        "just no overflow": np.array([info.max, info.max * info.epsneg / 4], kind),
    }


@pytest.mark.parametrize("real", REALS)
def test_hard_sums_are_rounded_once(real, device):
    kind = numpy_type(real)
    for name, values in hard_data(kind).items():
        expected = nearest(exact_sum(values), kind)
        shuffled = np.random.default_rng(1).permutation(values)
        for data in (values, values[::-1], shuffled):
            assert bits(add_up(real, data, device)) == bits(expected), name
        into = add_up(real, values[1:], device, start=values[0])
        assert bits(into) == bits(expected), name
        if kind is np.float64 and np.isfinite(expected) and "beyond" not in name:
            assert expected == math.fsum(values)


@pytest.mark.parametrize("real", REALS)
def test_infinities_and_nan(real, device):
    inf, nan = math.inf, math.nan
    assert add_up(real, [1.0, inf, -3.0], device) == inf
    assert add_up(real, [1.0, -inf], device) == -inf
    assert math.isnan(add_up(real, [inf, -inf], device))
    assert math.isnan(add_up(real, [1.0, nan], device))
    assert add_up(real, [1.0, 2.0], device, start=inf) == inf
    assert math.isnan(add_up(real, [-inf], device, start=inf))
    assert math.isnan(add_up(real, [1.0], device, start=nan))


@pytest.mark.parametrize("real", REALS)
def test_zeros(real, device):
    assert bits(add_up(real, [-0.0, -0.0], device, start=-0.0)) == bits(numpy_type(real)(-0.0))
    assert bits(add_up(real, [-0.0], device)) == bits(numpy_type(real)(0.0))
    assert bits(add_up(real, [1.5, -2.5], device, start=1.0)) == bits(numpy_type(real)(0.0))


@pytest.mark.parametrize("real", REALS)
def test_scattered_sums(real, device):
    """Each element has its own sum, and one that no thread adds to stays as it is."""
    kind = numpy_type(real)
    random = np.random.default_rng(3)
    n, buckets = 100_000, 97
    values = (random.standard_normal(n) * 10.0 ** random.integers(-12, 12, n)).astype(kind)
    to = random.integers(0, buckets - 1, n).astype(np.int32)
    start = random.standard_normal(buckets).astype(kind)
    start[-1] = np.nan
    x = wp.array(values, dtype=real, device=device)
    where = wp.array(to, dtype=int, device=device)
    found = set()
    for block_dim in [256] * 10 + [32, 64, 96, 1, 1024] * 2:
        s = wp.array(start, dtype=real, device=device)
        wp.launch(SCATTER[real], n, [x, where, s], device=device, block_dim=block_dim)
        found.add(bits(s.numpy()))
    assert len(found) == 1
    for bucket in range(buckets - 1):
        exact = exact_sum(values[to == bucket], start[bucket])
        assert s.numpy()[bucket] == nearest(exact, kind)
    assert np.isnan(s.numpy()[-1])


@wp.struct
class Totals:
    weight: float
    force: wp.array(dtype=wp.vec3)
    table: wp.array2d(dtype=wp.float64)


@wp.kernel(module_options=DETERMINISTIC)
def composites(
    x: wp.array(dtype=wp.vec3),
    totals: Totals,
    m: wp.array2d(dtype=wp.mat22),
    part: wp.array(dtype=float),
):
    i, j = wp.tid()
    v = x[i * 8 + j] * totals.weight
    wp.atomic_add(totals.force, j, v)
    wp.atomic_sub(totals.table, i % 3, j % 2, wp.float64(v[0]))
    wp.atomic_add(m, i % 2, j % 2, wp.outer(wp.vec2(v[0], v[1]), wp.vec2(1.0, 2.0)))
    row = m[1]
    wp.atomic_add(row, 0, wp.mat22(v[2]))
    wp.atomic_add(part[1:], 2 * (i % 2), v[1])


def test_composites_structs_and_views(device):
    random = np.random.default_rng(8)
    # Products by 0.5 are exact, so the terms are known.
    values = (random.standard_normal((400, 3)) * 10.0 ** random.integers(-6, 6, (400, 1))).astype(
        np.float32
    )
    totals = Totals()
    totals.weight = 0.5
    totals.force = wp.zeros(8, dtype=wp.vec3, device=device)
    table = wp.zeros((5, 4), dtype=wp.float64, device=device)
    totals.table = table[:3, ::2]
    m = wp.zeros((2, 2), dtype=wp.mat22, device=device)
    wide = wp.zeros(12, dtype=float, device=device)
    x = wp.array(values, dtype=wp.vec3, device=device)
    wp.launch(composites, (50, 8), [x, totals, m, wide[::2]], device=device)

    v = (values * np.float32(0.5)).reshape(50, 8, 3)
    i, j = np.meshgrid(np.arange(50), np.arange(8), indexing="ij")
    for k in range(8):
        expected = [nearest(exact_sum(v[:, k, c]), np.float32) for c in range(3)]
        assert totals.force.numpy()[k].tolist() == expected
    for row in range(3):
        for column in range(2):
            terms = v[..., 0][(i % 3 == row) & (j % 2 == column)]
            assert table.numpy()[row, 2 * column] == float(-exact_sum(terms))
    assert not table.numpy()[3:].any() and not table.numpy()[:, 1::2].any()
    for row in range(2):
        for column in range(2):
            chosen = (i % 2 == row) & (j % 2 == column)
            more = exact_sum(v[..., 2].ravel()) if (row, column) == (1, 0) else 0
            for a in range(2):
                for c in range(2):
                    exact = (c + 1) * exact_sum(v[..., a][chosen]) + more
                    assert m.numpy()[row, column, a, c] == nearest(exact, np.float32)
    for row in range(2):
        exact = exact_sum(v[..., 1][i % 2 == row])
        assert wide.numpy()[2 + 4 * row] == nearest(exact, np.float32)
    assert np.count_nonzero(wide.numpy()) == 2


@wp.kernel(module_options=DETERMINISTIC)
def gather(
    x: wp.array(dtype=float),
    to: wp.array(dtype=int),
    table: wp.array(dtype=float),
    y: wp.array(dtype=float),
):
    i = wp.tid()
    y[i] = table[to[i]] * x[i] + table[0]


def test_gradients(device):
    random = np.random.default_rng(4)
    n = 20_000
    values = (random.standard_normal(n) * 10.0 ** random.integers(-9, 9, n)).astype(np.float32)
    to = random.integers(0, 7, n).astype(np.int32)
    x = wp.array(values, dtype=float, device=device)
    where = wp.array(to, dtype=int, device=device)
    found = set()
    for block_dim in [256] * 10 + [32, 128] * 5:
        table = wp.ones(7, device=device, requires_grad=True)
        y = wp.zeros(n, device=device, requires_grad=True)
        with wp.Tape() as tape:
            wp.launch(gather, n, [x, where, table], [y], device=device, block_dim=block_dim)
        tape.backward(grads={y: wp.full(n, 2.0, device=device)})
        found.add(bits(table.grad.numpy()))
    assert len(found) == 1
    for bucket in range(7):
        exact = 2 * exact_sum(values[to == bucket]) + (2 * n if bucket == 0 else 0)
        assert table.grad.numpy()[bucket] == nearest(exact, np.float32)


def test_captured(device):
    """Every replay of a graph adds the sums once."""
    values = np.array([1e8, 0.25, -1e8, 0.5], np.float32)
    x = wp.array(values, device=device)
    s = wp.zeros(1, device=device)
    wp.launch(TOTAL[wp.float32], 4, [x, s], device=device)
    s.zero_()
    with wp.ScopedCapture(device) as capture:
        wp.launch(TOTAL[wp.float32], 4, [x, s], device=device)
    for count in range(3):
        assert s.numpy()[0] == 0.75 * count
        wp.capture_launch(capture.graph)


@wp.kernel(module_options=DETERMINISTIC)
def own_place(x: wp.array(dtype=float), s: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(s, i, x[i])
    y[i] = s[i]


@wp.kernel(module_options=DETERMINISTIC)
def both(x: wp.array(dtype=float), s: wp.array(dtype=float), other: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(s, i, x[i])
    x[i] = other[i]


def test_sums_that_the_launch_reads(device):
    """A thread that reads what it added to finds the sum there."""
    x = wp.array([1.0, 2.0, 3.0], dtype=float, device=device)
    s, y = wp.ones(3, device=device), wp.zeros(3, device=device)
    wp.launch(own_place, 3, [x, s, y], device=device)
    assert y.numpy().tolist() == [2, 3, 4]
    # Also if it reads it by another argument.
    wp.launch(both, 3, [x, s, s], device=device)
    assert x.numpy().tolist() == [3, 5, 7] and s.numpy().tolist() == [3, 5, 7]


def test_out_of_bounds(device):
    @wp.kernel(module="unique", module_options={"deterministic": "gpu_to_gpu", "mode": "debug"})
    def beyond(s: wp.array(dtype=float)):
        wp.atomic_add(s, wp.tid() * 100, 1.0)

    s = wp.zeros(3, device=device)
    with pytest.raises(Exception, match="out of bounds"):
        wp.launch(beyond, 2, [s], device=device)
        wp.synchronize_device(device)


def test_arrays_that_have_no_exact_sums(device):
    @wp.kernel(module_options=DETERMINISTIC)
    def count(s: wp.array(dtype=float)):
        wp.atomic_add(s, 0, 1.0)

    s = wp.zeros(2, dtype=float, device=device)
    far = wp.array(ptr=s.ptr, dtype=float, shape=(2,), strides=(1 << 30,), device=device)
    with pytest.raises(Exception, match=r"deterministic sums into an array .* 2\^27"):
        wp.launch(count, 4, [far], device=device)
        wp.synchronize()
    odd = wp.array(ptr=s.ptr, dtype=float, shape=(2,), strides=(2,), device=device)
    with pytest.raises(Exception, match="strides that are multiples of 4 bytes, but got 2"):
        wp.launch(count, 4, [odd], device=device)
        wp.synchronize()


CHILD = """
import numpy as np, sys
import warp as wp
wp.config.quiet = True
@wp.kernel(module_options={"deterministic": sys.argv[2]})
def work(x: wp.array(dtype=float), to: wp.array(dtype=int), s: wp.array(dtype=float),
         t: wp.array(dtype=wp.float64)):
    i = wp.tid()
    wp.atomic_add(s, to[i], x[i])
    wp.atomic_add(t, 0, wp.float64(x[i]))
random = np.random.default_rng(1)
n = 300_000
x = (random.standard_normal(n) * 10.0 ** random.integers(-9, 9, n)).astype(np.float32)
device = sys.argv[1]
s, t = wp.zeros(50, device=device), wp.zeros(1, dtype=wp.float64, device=device)
to = random.integers(0, 50, n).astype(np.int32)
wp.launch(work, n, [wp.array(x, device=device), wp.array(to, device=device), s, t], device=device)
print(s.numpy().tobytes().hex(), t.numpy().tobytes().hex())
"""


def run_child(device, threads, tmp_path, mode="gpu_to_gpu"):
    script = tmp_path / "work.py"
    script.write_text(CHILD)
    environment = {**os.environ, "WARP_NUM_THREADS": str(threads)}
    command = [sys.executable, str(script), device, mode]
    return subprocess.run(
        command, capture_output=True, text=True, check=True, env=environment
    ).stdout


def test_threads_and_devices_agree(device, tmp_path):
    alone = run_child("cpu", 1, tmp_path)
    assert len(alone) > 400
    assert run_child(device, 7, tmp_path) == alone


def test_one_order_for_any_number_of_threads(tmp_path):
    """On the CPU sums are only exact if they have to be the same on a GPU."""
    found = {run_child("cpu", threads, tmp_path, "run_to_run") for threads in (1, 2, 7)}
    assert len(found) == 1
    assert found != {run_child("cpu", 2, tmp_path)}
