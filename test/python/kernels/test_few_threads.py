"""Launches of few threads on a CPU have code of their own, quickly compiled, if it has no loop."""

import numpy as np
import pytest

import warp as wp


def make_kernel():
    @wp.kernel(module="unique")
    def polynomial(x: wp.array(dtype=float), y: wp.array(dtype=float), total: wp.array(dtype=int)):
        i = wp.tid()
        value = x[i]
        power = float(1.0)
        if i % 5 > 0:
            power = power * value + wp.sin(value)
        if i % 5 > 1:
            power = power * value + wp.sin(value)
        y[i] = power
        wp.atomic_add(total, 0, i + 1)

    return polynomial


def expected(x):
    x = x.astype(np.float64)
    power = np.ones_like(x)
    for step in range(2):
        deeper = np.arange(len(x)) % 5 > step
        power = np.where(deeper, power * x + np.sin(x), power)
    return power


def check_run(kernel, count):
    x = np.linspace(-1.0, 2.0, 200, dtype=np.float32)[:count]
    y, total = wp.zeros(count, dtype=float, device="cpu"), wp.zeros(1, dtype=int, device="cpu")
    wp.launch(kernel, count, [wp.array(x, device="cpu"), y, total], device="cpu")
    np.testing.assert_allclose(y.numpy(), expected(x), rtol=1e-5)
    assert total.numpy()[0] == count * (count + 1) // 2
    return y.numpy()


def kinds(kernel):
    return [str(one).splitlines()[0] for one in kernel.schedule("cpu")]


@pytest.mark.parametrize("count", [1, 2, 15, 16, 17, 200])
def test_any_number_of_threads(count):
    check_run(make_kernel(), count)


def test_elements_have_the_same_bits_in_both():
    kernel = make_kernel()
    few = check_run(kernel, 15)
    many = check_run(kernel, 200)[:15]
    x = np.linspace(-1.0, 2.0, 200, dtype=np.float32)
    assert few.tobytes() == many.tobytes(), x[:15][few != many]


def test_few_threads_have_scalar_code_of_their_own():
    kernel = make_kernel()
    check_run(kernel, 3)
    check_run(kernel, 7)
    assert len(kinds(kernel)) == 1
    assert "few threads" in kinds(kernel)[0]
    assert any(
        choice.what == "lanes" and choice.value == "1"
        for choice in kernel.schedule("cpu")[0].choices
    )
    check_run(kernel, 100)
    assert len(kinds(kernel)) == 2
    assert "few threads" not in kinds(kernel)[1]


def test_code_for_many_threads_serves_few():
    kernel = make_kernel()
    check_run(kernel, 100)
    check_run(kernel, 3)
    assert len(kinds(kernel)) == 1


@pytest.mark.parametrize("options", [{"cpu_lanes": 8}, {"mode": "debug"}, {"deterministic": True}])
def test_what_is_asked_for_holds_for_few_threads(options):
    @wp.kernel(module="unique", module_options=options)
    def add(x: wp.array(dtype=float), total: wp.array(dtype=float)):
        wp.atomic_add(total, 0, x[wp.tid()])

    x = np.arange(9, dtype=np.float32)
    total = wp.zeros(1, dtype=float, device="cpu")
    wp.launch(add, 9, [wp.array(x, device="cpu"), total], device="cpu")
    assert total.numpy()[0] == x.sum()
    assert all("few threads" not in kind for kind in kinds(add))


def test_loops_may_be_long():
    @wp.kernel(module="unique")
    def sums(x: wp.array2d(dtype=int), y: wp.array(dtype=int)):
        i = wp.tid()
        for j in range(x.shape[1]):
            y[i] += x[i, j]

    x = np.arange(24, dtype=np.int32).reshape(3, 8)
    y = wp.zeros(3, dtype=int, device="cpu")
    wp.launch(sums, 3, [wp.array(x, device="cpu"), y], device="cpu")
    np.testing.assert_array_equal(y.numpy(), x.sum(axis=1))
    assert all("few threads" not in kind for kind in kinds(sums))


def test_a_block_of_tiles_is_not_brief():
    @wp.kernel(module="unique")
    def double(a: wp.array(dtype=float), b: wp.array(dtype=float)):
        tile = wp.tile_load(a, shape=32, offset=0)
        wp.tile_store(b, tile + tile, offset=0)

    a = np.arange(32, dtype=np.float32)
    b = wp.zeros(32, dtype=float, device="cpu")
    inputs = [wp.array(a, device="cpu"), b]
    wp.launch_tiled(double, dim=1, inputs=inputs, block_dim=32, device="cpu")
    np.testing.assert_array_equal(b.numpy(), 2.0 * a)


@wp.kernel
def products(
    n: wp.array(dtype=int),
    begin: wp.array(dtype=int),
    turned: bool,
    a: wp.array(dtype=float),
    b: wp.array(dtype=float),
    c: wp.array(dtype=float),
):
    """A product of matrices by each thread, whose elements lanes would gather."""
    m = n[wp.tid()]
    at = begin[wp.tid()]
    for i in range(m):
        for j in range(m):
            total = float(0.0)
            for k in range(m):
                if turned:
                    left = k * m + i
                else:
                    left = i * m + k
                if turned:
                    right = j * m + k
                else:
                    right = k * m + j
                total += a[at + left] * b[at + right]
            c[at + i * m + j] = total


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("count", [1, 4, 15, 16, 40])
def test_products_by_a_few_threads(count, turned):
    rng = np.random.default_rng(count)
    sizes = rng.integers(1, 9, count).astype(np.int32)
    begin = np.concatenate([[0], np.cumsum(sizes**2)]).astype(np.int32)
    a, b = (rng.random(begin[-1]).astype(np.float32) for _ in range(2))
    c = wp.zeros(begin[-1], dtype=float, device="cpu")
    integers = [wp.array(v, dtype=int, device="cpu") for v in (sizes, begin)]
    floats = [wp.array(v, dtype=float, device="cpu") for v in (a, b)]
    wp.launch(products, count, [*integers, turned, *floats, c], device="cpu")
    found = c.numpy()
    for size, first in zip(sizes, begin, strict=False):
        part = slice(first, first + size**2)
        x, y = (v[part].astype(np.float64).reshape(size, size) for v in (a, b))
        wanted = x.T @ y.T if turned else x @ y
        np.testing.assert_allclose(found[part].reshape(size, size), wanted, rtol=1e-5)


def test_few_threads_that_gather_have_no_lanes():
    kernel = wp.kernel(module="unique")(products.func)
    for count in (4, 40):
        sizes, begin = wp.full(count, 2, dtype=int, device="cpu"), 4 * np.arange(count)
        begin = wp.array(begin.astype(np.int32), device="cpu")
        floats = [wp.ones(4 * count, dtype=float, device="cpu") for _ in range(3)]
        wp.launch(kernel, count, [sizes, begin, False, *floats], device="cpu")
        np.testing.assert_array_equal(floats[2].numpy(), 2.0)
    few, many = kernel.schedule("cpu")
    lanes = [
        next(choice.value for choice in one.choices if choice.what == "lanes")
        for one in (few, many)
    ]
    assert "few threads" in str(few).splitlines()[0]
    assert lanes[0] == "1" and int(lanes[1]) > 1
