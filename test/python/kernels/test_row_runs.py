"""Lanes that go along rows of their own and load several elements of each at once."""

import numpy as np
import pytest

import warp as wp

rng = np.random.default_rng(5)
LENGTHS = (0, 1, 3, 4, 5, 8, 11, 16, 37)


def kernels(dtype, lanes):
    """Sums of rows, by as many lanes."""

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def along(x: wp.array2d(dtype=dtype), first: int, last: int, y: wp.array(dtype=dtype)):
        i = wp.tid()
        s = dtype(1.0)
        for k in range(first, last):
            s = s * dtype(0.5) + x[i, k]
        y[i] = s

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def flat(x: wp.array(dtype=dtype), n: int, y: wp.array(dtype=dtype)):
        i = wp.tid()
        s = dtype(0.0)
        for k in range(n):
            s += x[i * n + k] * dtype(k + 1)
        y[i] = s

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def chosen(
        x: wp.array2d(dtype=dtype), row: wp.array(dtype=int), n: int, y: wp.array(dtype=dtype)
    ):
        i = wp.tid()
        if row[i] >= 0:
            s = dtype(0.0)
            for k in range(n):
                v = x[row[i], k]
                if v < dtype(0.5):
                    s += v
                else:
                    s -= v * dtype(0.25)
            y[i] = s

    return along, flat, chosen


@pytest.mark.parametrize("lanes", [4, 8, 16, 32])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_rows_of_any_length(dtype, lanes):
    """Elements behind the last whole run, lanes that have nothing to do, rows at the end."""
    real = wp.dtype_to_numpy(dtype)
    tolerance = {"rtol": 1e-5 if real == np.float32 else 1e-13, "atol": 1e-6}
    along, flat, chosen = kernels(dtype, lanes)
    for n in LENGTHS:
        for rows in (1, lanes - 1, 2 * lanes + 3):
            x = rng.random((rows, n)).astype(real)
            given = wp.array(x, dtype=dtype, device="cpu", ndim=2)
            result = wp.zeros(rows, dtype=dtype, device="cpu")

            wp.launch(along, rows, [given, 0, n, result], device="cpu")
            wanted = np.ones(rows)
            for k in range(n):
                wanted = wanted * 0.5 + x[:, k]
            np.testing.assert_allclose(result.numpy(), wanted, **tolerance)

            wp.launch(flat, rows, [given.flatten(), n, result], device="cpu")
            wanted = x.astype(float) @ np.arange(1, n + 1)
            np.testing.assert_allclose(result.numpy(), wanted, **tolerance)

            order = rng.integers(-rows, rows, rows)
            result.fill_(7.0)
            wp.launch(
                chosen,
                rows,
                [given, wp.array(order, dtype=int, device="cpu"), n, result],
                device="cpu",
            )
            sums = np.where(x < 0.5, x, -0.25 * x).sum(axis=1)
            wanted = np.where(order < 0, 7.0, sums[np.maximum(order, 0)])
            np.testing.assert_allclose(result.numpy(), wanted, **tolerance)


@pytest.mark.parametrize("lanes", [8, 16])
def test_parts_of_rows(lanes):
    """A loop that begins and ends within rows, or does not run."""
    along, _, _ = kernels(wp.float64, lanes)
    x = rng.random((lanes + 1, 29))
    given = wp.array(x, dtype=wp.float64, device="cpu")
    for first, last in ((3, 29), (1, 2), (28, 29), (7, 7), (9, 2), (5, 14)):
        result = wp.zeros(len(x), dtype=wp.float64, device="cpu")
        wp.launch(along, len(x), [given, first, last, result], device="cpu")
        wanted = np.ones(len(x))
        for k in range(first, last):
            wanted = wanted * 0.5 + x[:, k]
        np.testing.assert_allclose(result.numpy(), wanted, rtol=1e-13)


def test_rows_that_are_written_are_read_in_turn():
    """Elements that an earlier iteration has written, through the same array and through another
    one over the same memory."""

    @wp.kernel(module="unique", module_options={"cpu_lanes": 16})
    def filtered(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float), n: int):
        i = wp.tid()
        for k in range(1, n):
            y[i, k] = 0.5 * x[i, k - 1] + y[i, k]

    start = rng.random((33, 21)).astype(np.float32)
    for same in (False, True):
        y = wp.array(start, dtype=float, device="cpu")
        x = y if same else wp.array(start, dtype=float, device="cpu")
        wp.launch(filtered, 33, [x, y, 21], device="cpu")
        wanted = start.astype(float)
        for k in range(1, 21):
            before = wanted if same else start
            wanted[:, k] += 0.5 * before[:, k - 1]
        np.testing.assert_allclose(y.numpy(), wanted, rtol=1e-5)


def test_schedule_tells_of_runs():
    along, _, _ = kernels(wp.float32, 16)
    assert "rows, transposed" in str(along.schedule("cpu"))
