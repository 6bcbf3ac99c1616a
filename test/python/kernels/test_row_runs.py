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


def recurrences(dtype, lanes):
    """Kernels that store along rows, by as many lanes."""

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def smoothed(u: wp.array2d(dtype=dtype), first: int, last: int, q: wp.array2d(dtype=dtype)):
        i = wp.tid()
        for k in range(first, last):
            q[i, k + 1] = dtype(0.8) * q[i, k] + dtype(0.2) * u[i, k]
            if q[i, k + 1] > dtype(0.5):
                u[i, k] = dtype(2.0) * q[i, k + 1]

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def scanned(x: wp.array(dtype=dtype), n: int, y: wp.array(dtype=dtype)):
        i = wp.tid()
        if i % 3 != 1:
            s = dtype(0.0)
            for k in range(n):
                s += x[i * n + k]
                y[i * n + k] = s

    return smoothed, scanned


@pytest.mark.parametrize("lanes", [1, 4, 8, 16, 32])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_rows_that_are_stored(dtype, lanes):
    """The next iteration reads elements; some lanes store nothing; elements around stay."""
    real = wp.dtype_to_numpy(dtype)
    tolerance = {"rtol": 2e-5 if real == np.float32 else 1e-13, "atol": 1e-6}
    smoothed, scanned = recurrences(dtype, lanes)
    for n in LENGTHS[1:]:
        for rows in (1, lanes + 1, 2 * lanes + 3):
            for first, last in ((0, n - 1), (n // 3, n - 2), (n - 1, 0)):
                u, q = (rng.random((rows, n)).astype(real) for _ in range(2))
                arrays = [wp.array(one, dtype=dtype, device="cpu") for one in (u, q)]
                wp.launch(smoothed, rows, [arrays[0], first, last, arrays[1]], device="cpu")
                u, q = u.astype(float), q.astype(float)
                for k in range(first, last):
                    q[:, k + 1] = 0.8 * q[:, k] + 0.2 * u[:, k]
                    u[:, k] = np.where(q[:, k + 1] > 0.5, 2.0 * q[:, k + 1], u[:, k])
                np.testing.assert_allclose(arrays[1].numpy(), q, **tolerance)
                near = np.abs(q - 0.5).min(axis=1) > 1e-5
                np.testing.assert_allclose(arrays[0].numpy()[near], u[near], **tolerance)

            x = rng.random((rows, n)).astype(real)
            y = wp.full(rows * n, 7.0, dtype=dtype, device="cpu")
            given = wp.array(x.reshape(-1), dtype=dtype, device="cpu")
            wp.launch(scanned, rows, [given, n, y], device="cpu")
            sums = x.astype(float).cumsum(axis=1)
            sums[np.arange(rows) % 3 == 1] = 7.0
            np.testing.assert_allclose(y.numpy().reshape(rows, n), sums, **tolerance)


@pytest.mark.parametrize("lanes", [1, 4, 16, 32])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_rows_changed_in_place_back_to_front(dtype, lanes):
    """Thomas's algorithm, and the gradient of a filter, which goes through rows backwards."""

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def substituted(c: wp.array2d(dtype=dtype), n: int, x: wp.array2d(dtype=dtype)):
        i = wp.tid()
        for k in range(n - 2, -1, -1):
            x[i, k] = x[i, k] - c[i, k] * x[i, k + 1]

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def doubled(n: int, x: wp.array2d(dtype=dtype)):
        i = wp.tid()
        for k in range(n - 1, -1, -1):
            x[i, k] = x[i, k] * dtype(2.0) + dtype(1.0)

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def smoothed(u: wp.array2d(dtype=dtype), n: int, y: wp.array2d(dtype=dtype)):
        i = wp.tid()
        s = dtype(0.0)
        for k in range(n):
            s = dtype(0.5) * s + u[i, k] * u[i, k]
            y[i, k] = s

    real = wp.dtype_to_numpy(dtype)
    tolerance = {"rtol": 2e-5 if real == np.float32 else 1e-13, "atol": 1e-6}
    for n in (1, 2, 4, 7, 9, 16, 29):
        for rows in (1, lanes + 1, 2 * lanes + 3):
            c, x, seed = (rng.random((rows, n)).astype(real) for _ in range(3))
            given, solved = (wp.array(one, dtype=dtype, device="cpu") for one in (c, x))
            wp.launch(substituted, rows, [given, n, solved], device="cpu")
            wanted = x.astype(float)
            for k in range(n - 2, -1, -1):
                wanted[:, k] -= c[:, k] * wanted[:, k + 1]
            np.testing.assert_allclose(solved.numpy(), wanted, **tolerance)
            wp.launch(doubled, rows, [n, solved], device="cpu")
            np.testing.assert_allclose(solved.numpy(), 2.0 * wanted + 1.0, **tolerance)

            u = wp.array(c, dtype=dtype, device="cpu", requires_grad=True)
            y = wp.zeros((rows, n), dtype=dtype, device="cpu", requires_grad=True)
            tape = wp.Tape()
            with tape:
                wp.launch(smoothed, rows, [u, n, y], device="cpu")
            tape.backward(grads={y: wp.array(seed, dtype=dtype, device="cpu")})
            wanted, pulled = np.zeros((rows, n)), np.zeros(rows)
            for k in range(n - 1, -1, -1):
                pulled = 0.5 * pulled + seed[:, k]
                wanted[:, k] = 2.0 * c[:, k] * pulled
            np.testing.assert_allclose(u.grad.numpy(), wanted, **tolerance)


def test_stores_of_rows_over_what_is_read():
    """Rows of one array that overlap those of another are stored in turn."""

    @wp.kernel(module="unique", module_options={"cpu_lanes": 16})
    def shifted(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float), n: int):
        i = wp.tid()
        for k in range(n):
            y[i, k] = 0.5 * x[i, k]

    memory = wp.array(rng.random((20, 12)), dtype=float, device="cpu")
    wanted = memory.numpy()
    for k in range(11):
        wanted[:, k + 1] = 0.5 * wanted[:, k]
    wp.launch(shifted, 20, [memory[:, :11], memory[:, 1:], 11], device="cpu")
    np.testing.assert_array_equal(memory.numpy(), wanted)


def test_rows_of_a_rollout_that_reads_nothing():
    """Stores along rows alone; two of them in one array that overlap are made in turn."""

    @wp.kernel(module="unique", module_options={"cpu_lanes": 16})
    def rolled(n: int, x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
        i = wp.tid()
        s = float(i)
        for k in range(n):
            s = 0.5 * s + 1.0
            x[i, k] = s
            y[i, k] = -s

    values, s = np.empty((20, 11)), np.arange(20.0)
    for k in range(11):
        s = 0.5 * s + 1.0
        values[:, k] = s
    x, y = (wp.zeros((20, 11), dtype=float, device="cpu") for _ in range(2))
    wp.launch(rolled, 20, [11, x, y], device="cpu")
    np.testing.assert_allclose(x.numpy(), values, rtol=1e-6)
    np.testing.assert_allclose(y.numpy(), -values, rtol=1e-6)
    assert "each lane writes its own row" in str(rolled.schedule("cpu"))

    # Element k of x is element k - 1 of y, which is written one iteration later.
    memory = wp.zeros((20, 12), dtype=float, device="cpu")
    wp.launch(rolled, 20, [11, memory[:, :11], memory[:, 1:]], device="cpu")
    np.testing.assert_allclose(memory.numpy()[:, :11], values, rtol=1e-6)
    np.testing.assert_allclose(memory.numpy()[:, 11], -values[:, -1], rtol=1e-6)


def test_schedule_tells_of_runs():
    along, _, _ = kernels(wp.float32, 16)
    assert "rows, transposed" in str(along.schedule("cpu"))
    _, scanned = recurrences(wp.float32, 16)
    assert "each lane writes its own row" in str(scanned.schedule("cpu"))


@pytest.mark.parametrize("lanes", [4, 8, 16, 32])
@pytest.mark.parametrize("dtype", [wp.uint8, wp.int8, wp.bool])
def test_rows_of_bytes(dtype, lanes):
    """Texts of each lane's own, from both ends, some of them not read at all."""

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def hashed(x: wp.array2d(dtype=dtype), first: int, n: int, y: wp.array2d(dtype=int)):
        i = wp.tid()
        if i % 5 != 2:
            h = int(1)
            for k in range(first, n):
                h = h * 31 + int(x[i, k])
            b = int(1)
            for k in range(n - 1, first - 1, -1):
                b = b * 31 + int(x[i, k])
            y[i, 0] = h
            y[i, 1] = b

    for n in LENGTHS[1:]:
        for rows in (1, lanes - 1, 2 * lanes + 3):
            for first in (0, n // 3):
                x = rng.integers(0, 256, (rows, n)).astype(np.uint8)
                x = x > 127 if dtype is wp.bool else x.view(wp.dtype_to_numpy(dtype))
                y = wp.full((rows, 2), 7, dtype=int, device="cpu")
                given = wp.array(x, dtype=dtype, device="cpu")
                wp.launch(hashed, rows, [given, first, n, y], device="cpu")
                wanted = np.ones((rows, 2), dtype=np.int64)
                for k in range(first, n):
                    wanted[:, 0] = (wanted[:, 0] * 31 + x[:, k]) & 0xFFFFFFFF
                for k in range(n - 1, first - 1, -1):
                    wanted[:, 1] = (wanted[:, 1] * 31 + x[:, k]) & 0xFFFFFFFF
                wanted[np.arange(rows) % 5 == 2] = 7
                np.testing.assert_array_equal(y.numpy(), wanted.astype(np.uint32).view(np.int32))


@pytest.mark.parametrize("lanes", [1, 8, 16, 32])
def test_rows_of_adjoints(lanes):
    """The adjoint of a filter keeps two states, and reads and clears rows of gradients."""

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def tracked(
        z: wp.array2d(dtype=wp.float64),
        q: wp.array(dtype=wp.float64),
        m: wp.array2d(dtype=wp.float64),
        o: wp.array2d(dtype=wp.float64),
    ):
        i = wp.tid()
        x = wp.float64(0.0)
        p = wp.float64(1.0)
        for t in range(z.shape[1]):
            p = p + q[i]
            k = p / (p + wp.float64(0.5))
            x = x + k * (z[i, t] - x)
            p = (wp.float64(1.0) - k) * p
            m[i, t] = x
            o[i, t] = p

    def filtered(z, q):
        x, p, sums = 0.0 * q, 1.0 + 0.0 * q, 0.0
        for t in range(z.shape[1]):
            p = p + q
            k = p / (p + 0.5)
            x = x + k * (z[:, t] - x)
            p = (1.0 - k) * p
            sums = sums + (t + 1) * x + p / (t + 2)
        return sums

    for rows, n in ((2 * lanes + 3, 37), (lanes + 1, 100), (3, 5)):
        z, q = rng.random((rows, n)), rng.random(rows)
        arrays = [wp.array(one, device="cpu", requires_grad=True) for one in (z, q)]
        results = [
            wp.zeros((rows, n), dtype=wp.float64, device="cpu", requires_grad=True)
            for _ in range(2)
        ]
        with wp.Tape() as tape:
            wp.launch(tracked, rows, arrays, results, device="cpu")
        steps = np.arange(n, dtype=float)
        seeds = [np.tile(steps + 1, (rows, 1)), np.tile(1 / (steps + 2), (rows, 1))]
        tape.backward(
            grads={
                one: wp.array(seed, device="cpu") for one, seed in zip(results, seeds, strict=True)
            }
        )
        # Derivatives by complex steps.
        wanted = np.zeros((rows, n))
        for t in range(n):
            moved = z.astype(complex)
            moved[:, t] += 1e-30j
            wanted[:, t] = filtered(moved, q).imag / 1e-30
        np.testing.assert_allclose(arrays[0].grad.numpy(), wanted, rtol=1e-9, atol=1e-12)
        wanted = filtered(z, q + 1e-30j).imag / 1e-30
        np.testing.assert_allclose(arrays[1].grad.numpy(), wanted, rtol=1e-9, atol=1e-12)
