"""Small systems of many blocks, which a CPU solves together, against NumPy in float64."""

import numpy as np
import pytest

import warp as wp


def systems(n, count, real, seed=0):
    rng = np.random.default_rng(seed)
    g = rng.normal(size=(count, n, n))
    a = (g @ g.transpose(0, 2, 1) / n + np.eye(n)).astype(real)
    return a, rng.normal(size=(count, n)).astype(real)


def solver_of(n, dtype, mode):
    @wp.kernel(module="unique")
    def solver(
        a: wp.array3d(dtype=dtype),
        b: wp.array2d(dtype=dtype),
        factor: wp.array3d(dtype=dtype),
        x: wp.array2d(dtype=dtype),
    ):
        i = wp.tid()
        f = wp.tile_cholesky(wp.tile_load(a[i], shape=(n, n)), fill_mode=mode)
        wp.tile_store(factor[i], f)
        v = wp.tile_load(b[i], shape=n)
        wp.tile_store(x[i], wp.tile_cholesky_solve(f, v, fill_mode=mode))

    return solver


def run(kernel, arrays, outputs, dim):
    inputs = [wp.array(one, device="cpu") for one in arrays]
    made = [wp.array(one, device="cpu") for one in outputs]
    wp.launch_tiled(kernel, dim=dim, inputs=inputs + made, block_dim=32, device="cpu")
    return [one.numpy() for one in made]


def check(found, wanted):
    error = np.abs(found - wanted).max()
    assert error < 50 * np.finfo(found.dtype).eps * np.abs(wanted).max()


@pytest.mark.parametrize("mode", ["lower", "upper"])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize(
    "n,count", [(1, 17), (3, 16), (5, 1), (16, 50), (17, 15), (31, 33), (32, 7)]
)
def test_factors_and_solutions(n, count, dtype, mode):
    real = wp.dtype_to_numpy(dtype)
    a, b = systems(n, count, real)
    given = a.copy()
    rows, columns = np.triu_indices(n, 1) if mode == "lower" else np.tril_indices(n, -1)
    given[:, rows, columns] = np.nan
    kernel = solver_of(n, dtype, mode)
    factor, x = run(kernel, [given, b], [np.full_like(a, 9.0), np.zeros_like(b)], count)
    assert "small systems" in str(kernel.schedule("cpu"))
    lower = np.linalg.cholesky(a.astype(float))
    check(factor, lower if mode == "lower" else lower.transpose(0, 2, 1))
    check(x, np.linalg.solve(a.astype(float), b.astype(float)[..., None])[..., 0])


def test_a_system_has_the_same_bits_among_any_others():
    a, b = systems(20, 37, np.float32)
    kernel = solver_of(20, wp.float32, "lower")
    together = run(kernel, [a, b], [np.zeros_like(a), np.zeros_like(b)], 37)
    bad = a.copy()
    bad[::3] *= -1.0
    mixed = run(kernel, [bad, b], [np.zeros_like(a), np.zeros_like(b)], 37)
    for i in (0, 4, 16, 36):
        alone = run(kernel, [a[i : i + 1], b[i : i + 1]], [np.zeros_like(a[:1]), b[:1] * 0], 1)
        for one, all_of_them in zip(alone, together, strict=True):
            assert np.array_equal(one[0], all_of_them[i])
    for found, wanted in zip(mixed, together, strict=True):
        assert np.isnan(found[::3]).any(axis=-1).reshape(13, -1).any(axis=1).all()
        assert np.array_equal(found[1::3], wanted[1::3])


@wp.kernel
def plane(a: wp.array4d(dtype=float), b: wp.array3d(dtype=float), total: wp.array(dtype=float)):
    i, j = wp.tid()
    m = wp.tile_load(a[i, j], shape=(12, 12))
    v = wp.tile_load(b[i, j], shape=12)
    wp.tile_cholesky_inplace(m)
    wp.tile_cholesky_solve_inplace(m, v)
    wp.tile_atomic_add(total, wp.tile_map(wp.mul, v, v))


@pytest.mark.parametrize("rows,columns", [(1, 40), (40, 1), (7, 9)])
def test_launches_over_planes(rows, columns):
    a, b = systems(12, rows * columns, np.float32)
    x = np.linalg.solve(a.astype(float), b.astype(float)[..., None])[..., 0]
    shaped = [a.reshape(rows, columns, 12, 12), b.reshape(rows, columns, 12)]
    (total,) = run(plane, shaped, [np.zeros(12, np.float32)], (rows, columns))
    np.testing.assert_allclose(total, (x * x).sum(axis=0), rtol=1e-4)


@wp.kernel
def sides(
    a: wp.array3d(dtype=float),
    b: wp.array3d(dtype=float),
    scale: wp.array(dtype=float),
    y: wp.array3d(dtype=float),
    x: wp.array3d(dtype=float),
):
    i = wp.tid()
    m = wp.tile_load(a[i], shape=(10, 10))
    v = wp.tile_load(b[i], shape=(10, 3))
    s = scale[i]
    scale[i] = 0.0
    lower = wp.tile_lower_solve(m, v)
    wp.tile_store(y[i], lower * s)
    wp.tile_store(x[i], wp.tile_upper_solve(m, lower) * s)


def test_solves_alone_and_numbers_that_outlive_them():
    a, b = systems(10, 21, np.float32)
    a += np.float32(0.1) * np.arange(100, dtype=np.float32).reshape(10, 10) / 100
    rhs = np.random.default_rng(1).normal(size=(21, 10, 3)).astype(np.float32)
    scale = np.linspace(1.0, 2.0, 21).astype(np.float32)
    y, x = run(sides, [a, rhs, scale], [np.zeros_like(rhs), np.zeros_like(rhs)], 21)
    assert "small systems" in str(sides.schedule("cpu"))
    factor = scale.astype(float)[:, None, None]
    lower = np.linalg.solve(np.tril(a.astype(float)), rhs.astype(float))
    check(y, lower * factor)
    check(x, np.linalg.solve(np.triu(a.astype(float)), lower) * factor)


@wp.kernel
def in_turn(a: wp.array3d(dtype=float), lock: wp.array(dtype=int), out: wp.array(dtype=float)):
    i = wp.tid()
    while wp.atomic_cas(lock, 0, 0, 1) != 0:
        pass
    f = wp.tile_cholesky(wp.tile_load(a[i], shape=(8, 8)))
    out[0] = out[0] + wp.tile_extract(f, 0, 0)
    wp.atomic_exch(lock, 0, 0)


def test_blocks_that_wait_for_each_other_run_one_after_the_other():
    a, _ = systems(8, 20, np.float32)
    _, out = run(in_turn, [a], [np.zeros(1, np.int32), np.zeros(1, np.float32)], 20)
    np.testing.assert_allclose(out[0], np.sqrt(a[:, 0, 0]).sum(), rtol=1e-5)
    assert "small systems" not in str(in_turn.schedule("cpu"))


def loss_of(n, columns, mode, uses_factor):
    @wp.kernel(module="unique")
    def loss(
        a: wp.array3d(dtype=wp.float64),
        b: wp.array3d(dtype=wp.float64),
        w: wp.array3d(dtype=wp.float64),
        out: wp.array(dtype=wp.float64),
    ):
        i = wp.tid()
        f = wp.tile_cholesky(wp.tile_load(a[i], shape=(n, n)), fill_mode=mode)
        x = wp.tile_cholesky_solve(f, wp.tile_load(b[i], shape=(n, columns)), fill_mode=mode)
        weights = wp.tile_load(w[i], shape=(n, columns))
        wp.tile_atomic_add(out, wp.tile_sum(wp.tile_map(wp.mul, weights, x)))
        if wp.static(uses_factor):
            wp.tile_atomic_add(out, wp.tile_sum(wp.tile_map(wp.sin, f)))

    return loss


@pytest.mark.parametrize("uses_factor", [False, True])
@pytest.mark.parametrize("columns,count", [(1, 18), (3, 2)])
@pytest.mark.parametrize("mode", ["lower", "upper"])
def test_gradients_of_systems(mode, columns, count, uses_factor):
    n, rng = 6, np.random.default_rng(columns)
    a, _ = systems(n, count, np.float64)
    b, w = (rng.normal(size=(count, n, columns)) for _ in range(2))
    inputs = [wp.array(one, device="cpu", requires_grad=True) for one in (a, b, w)]
    out = wp.zeros(1, dtype=wp.float64, device="cpu", requires_grad=True)
    tape = wp.Tape()
    with tape:
        kernel = loss_of(n, columns, mode, uses_factor)
        wp.launch_tiled(kernel, dim=count, inputs=[*inputs, out], block_dim=32, device="cpu")
    tape.backward(loss=out)

    def loss(a, b):
        lower = np.tril(a) if mode == "lower" else np.triu(a).transpose(0, 2, 1)
        whole = lower + np.tril(lower, -1).transpose(0, 2, 1)
        total = (w * np.linalg.solve(whole, b)).sum()
        return total + np.sin(np.linalg.cholesky(whole)).sum() * uses_factor

    step = 1e-6
    for which, array in enumerate((a, b)):
        u = rng.normal(size=array.shape)
        ahead, behind = ([a, b], [a, b])
        ahead[which], behind[which] = array + step * u, array - step * u
        slope = (loss(*ahead) - loss(*behind)) / (2 * step)
        found = (inputs[which].grad.numpy() * u).sum()
        np.testing.assert_allclose(found, slope, rtol=2e-7, atol=1e-7)
    other = np.triu_indices(n, 1) if mode == "lower" else np.tril_indices(n, -1)
    assert not inputs[0].grad.numpy()[:, other[0], other[1]].any()


@pytest.mark.parametrize("n", [1, 3, 16, 17, 32])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("mode", ["lower", "upper"])
def test_adjoints_of_factors(n, dtype, mode):
    @wp.kernel(module="unique")
    def factor(a: wp.array3d(dtype=dtype), out: wp.array3d(dtype=dtype)):
        i = wp.tid()
        f = wp.tile_cholesky(wp.tile_load(a[i], shape=(n, n)), fill_mode=mode)
        wp.tile_store(out[i], f)

    real, count = wp.dtype_to_numpy(dtype), 19
    a, _ = systems(n, count, real)
    g = np.random.default_rng(n).normal(size=a.shape).astype(real)
    da = wp.array(a, device="cpu", requires_grad=True)
    out = wp.zeros_like(da)
    tape = wp.Tape()
    with tape:
        wp.launch_tiled(factor, dim=count, inputs=[da, out], block_dim=32, device="cpu")
    tape.backward(grads={out: wp.array(g, device="cpu")})
    # With P(X), the lower triangle with half of the diagonal: L^-T P(L^T L') L^-1.
    lower = np.linalg.cholesky(a.astype(float))
    bar = np.tril((g if mode == "lower" else g.transpose(0, 2, 1)).astype(float))
    inner = np.tril(lower.transpose(0, 2, 1) @ bar) * (1.0 - 0.5 * np.eye(n))
    inverse = np.linalg.inv(lower)
    whole = inverse.transpose(0, 2, 1) @ inner @ inverse
    both = whole + whole.transpose(0, 2, 1)
    expected = np.tril(both, -1) + whole * np.eye(n)
    found = da.grad.numpy()
    check(found if mode == "lower" else found.transpose(0, 2, 1), expected)
