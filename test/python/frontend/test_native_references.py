"""Native code that changes its arguments or has an adjoint, against NumPy and exact derivatives."""

import numpy as np
import pytest

import warp as wp

pytestmark = pytest.mark.usefixtures("native_device")


@wp.func_native("if (x < 0) return false; high = x * y; y += 1; return true;")
def split(x: wp.int32, y: wp.ref[wp.int32], high: wp.ref[wp.int64]) -> bool: ...


@wp.func_native(
    "out = a * a * b; if (b > 100.0) return 0.0; return a + b;",
    adj_snippet="adj_a += 2.0 * a * b * adj_out + adj_ret; adj_b += a * a * adj_out + adj_ret;"
    "adj_out = 0.0;",
)
def products(a: wp.float64, b: wp.float64, out: wp.ref[wp.float64]) -> wp.float64: ...


@wp.func_native("*(int32_t *)where += by; by = -1;")
def add_at(where: wp.uint64, by: int): ...


@wp.struct
class Pair:
    count: int
    at: wp.vec2i


@wp.kernel
def splits(x: wp.array[int], y: wp.array[int], high: wp.array[wp.int64], ok: wp.array[bool]):
    i = wp.tid()
    large = wp.int64(-5)
    ok[i] = split(x[i], y[i], large)
    high[i] = large


@wp.kernel
def uses_products(
    a: wp.array[wp.float64], b: wp.array[wp.float64], y: wp.array[wp.float64], n: int
):
    i = wp.tid()
    out = wp.float64(0.0)
    total = wp.float64(0.0)
    for _ in range(n):
        total += products(a[i], b[i], out) * out
    y[i] = total


@wp.kernel
def adds(pairs: wp.array[Pair], x: wp.array2d[int], y: wp.array[int]):
    i = wp.tid()
    local = wp.int32(i)
    add_at(wp.address_of(local), 10)
    add_at(wp.address_of(pairs[i].at[1]), 20)
    add_at(wp.address_of(pairs[i].count), by=i)
    add_at(wp.address_of(x[i, 1]), 30)
    y[i] = local


def test_results_and_references():
    x = np.array([3, -2, 100000, 7, -1], np.int32)
    y = np.array([4, 5, 100, 6, 8], np.int32)
    given = wp.array(y)
    high = wp.zeros(5, dtype=wp.int64)
    ok = wp.zeros(5, dtype=bool)
    wp.launch(splits, 5, [wp.array(x), given, high, ok])
    kept = x >= 0
    np.testing.assert_array_equal(ok.numpy(), kept)
    np.testing.assert_array_equal(given.numpy(), np.where(kept, y + 1, y))
    np.testing.assert_array_equal(high.numpy(), np.where(kept, x.astype(np.int64) * y, -5))


@pytest.mark.parametrize("n", [1, 3])
def test_adjoints_of_results_and_references(n):
    a, b = np.array([1.5, -2.0, 0.25]), np.array([4.0, 0.5, -3.0])
    given = [wp.array(v, requires_grad=True) for v in (a, b)]
    y = wp.zeros(3, dtype=wp.float64, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(uses_products, 3, [*given, y, n])
    np.testing.assert_allclose(y.numpy(), n * (a + b) * a * a * b, rtol=1e-15)
    tape.backward(grads={y: wp.array(np.ones(3))})
    np.testing.assert_allclose(
        given[0].grad.numpy(), n * (a * a * b + (a + b) * 2 * a * b), rtol=1e-14
    )
    np.testing.assert_allclose(given[1].grad.numpy(), n * (a * a * b + (a + b) * a * a), rtol=1e-14)


def test_addresses_of_numbers():
    pairs = wp.zeros(3, dtype=Pair)
    x = wp.array(np.arange(6).reshape(3, 2), dtype=int)
    y = wp.zeros(3, dtype=int)
    wp.launch(adds, 3, [pairs, x, y])
    np.testing.assert_array_equal(y.numpy(), [10, 11, 12])
    np.testing.assert_array_equal(x.numpy(), [[0, 31], [2, 33], [4, 35]])
    found = pairs.numpy()
    np.testing.assert_array_equal(found["count"], [0, 1, 2])
    np.testing.assert_array_equal(found["at"], [[0, 20]] * 3)


def refused(kernel, *arguments):
    with pytest.raises(wp.WarpError) as problem:
        wp.launch(kernel, 1, arguments)
        wp.synchronize()
    return str(problem.value)


def test_what_has_no_address():
    @wp.kernel
    def constant(y: wp.array[int]):
        n = 3
        add_at(wp.address_of(n), y[0])

    @wp.kernel
    def sum_of_two(y: wp.array[int]):
        add_at(wp.address_of(y[0] + y[0]), 1)

    y = wp.zeros(1, dtype=int)
    assert "`n = wp.int32(3)`" in refused(constant, y)
    assert "addresses of numbers in variables" in refused(sum_of_two, y)


def test_without_an_adjoint_there_is_no_gradient():
    @wp.func_native("x = x + 1.0f;")
    def increase(x: wp.ref[float]): ...

    @wp.kernel
    def increases(x: wp.array[float]):
        increase(x[wp.tid()])

    x = wp.zeros(2, dtype=float, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(increases, 2, [x])
    np.testing.assert_array_equal(x.numpy(), [1.0, 1.0])
    with pytest.raises(RuntimeError):
        tape.backward(grads={x: wp.ones_like(x)})
        wp.synchronize()


def test_other_types_and_words_of_clang():
    @wp.func_native("x = 1.0f;")
    def store(x: wp.ref[wp.float16]): ...

    @wp.func_native("x = not_there;")
    def broken(x: wp.ref[float]): ...

    @wp.kernel
    def stores(y: wp.array[wp.float16]):
        store(y[0])

    @wp.kernel
    def breaks(y: wp.array[float]):
        broken(y[0])

    assert "'x' is no number" in refused(stores, wp.zeros(1, dtype=wp.float16))
    message = refused(breaks, wp.zeros(1, dtype=float))
    assert "not_there" in message and "test_native_references.py" in message
