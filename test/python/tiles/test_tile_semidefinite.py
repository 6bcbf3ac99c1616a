"""Cholesky factors of semidefinite and indefinite matrices: NaN, or a factor of the matrix."""

import numpy as np
import pytest

import warp as wp

ROUNDOFF = {wp.float32: 6e-8, wp.float64: 1.2e-16}


def matrices(n, kind, count=60):
    """Matrices whose rank, or sign, is not that of a positive definite one."""
    rng = np.random.default_rng(n)
    made = []
    for i in range(count):
        rank = int(rng.integers(0, n))
        if kind == "integers":
            b = rng.integers(-2, 3, size=(n, rank)).astype(float)
        elif kind == "scaled":
            b = rng.normal(size=(n, rank)) * 10.0 ** rng.integers(-3, 4, size=(n, 1))
        else:
            b = rng.normal(size=(n, rank))
        a = b @ b.T
        if kind == "indefinite":
            a = a + a.max() * np.diag(-1.0 * (np.arange(n) == i % n))
        made.append(a)
    return np.stack(made)


def make_factor(n, dtype, fill_mode):
    @wp.kernel(module="unique")
    def factor(a: wp.array3d(dtype=dtype), out: wp.array3d(dtype=dtype)):
        i = wp.tid()
        tile = wp.tile_load(a[i], shape=(n, n))
        wp.tile_store(out[i], wp.tile_cholesky(tile, fill_mode=fill_mode))

    return factor


def check(factors, a, roundoff):
    """Each is NaN, or positive on the diagonal and a factor to within its rounding."""
    n = a.shape[1]
    for one, of in zip(factors.astype(np.float64), a.astype(np.float64), strict=True):
        assert not np.isinf(one).any()
        if np.isnan(one).any():
            # It is what the last pivot says.
            assert np.isnan(one[-1, -1])
            assert np.linalg.eigvalsh(of)[0] < 8 * n * roundoff * np.trace(of) + 1e-300
            continue
        assert (np.diag(one) > 0).all()
        sizes = np.sqrt(np.outer(np.diag(of), np.diag(of)))
        assert (np.abs(one @ one.T - of) <= 8 * (n + 2) * roundoff * sizes + 1e-300).all()


@pytest.mark.parametrize("kind", ["integers", "reals", "scaled", "indefinite"])
@pytest.mark.parametrize("block_dim", [1, 32])
@pytest.mark.parametrize("n", [2, 3, 5, 8, 9, 17, 33])
@pytest.mark.parametrize("dtype", ROUNDOFF)
def test_tiles(device, dtype, n, block_dim, kind):
    a = matrices(n, kind).astype(np.float32 if dtype is wp.float32 else np.float64)
    for fill_mode in ("lower", "upper"):
        given = wp.array(a, dtype=dtype, device=device)
        out = wp.zeros_like(given)
        wp.launch_tiled(
            make_factor(n, dtype, fill_mode), [len(a)], [given, out],
            block_dim=block_dim, device=device,
        )  # fmt: skip
        found = out.numpy()
        check(found if fill_mode == "lower" else found.transpose(0, 2, 1), a, ROUNDOFF[dtype])
        if kind == "indefinite":
            assert np.isnan(found).any((1, 2)).all()


@wp.kernel
def factor_dense(n: int, a: wp.array(dtype=float), out: wp.array(dtype=float)):
    wp.dense_chol(n, a, 0.0, out)


@pytest.mark.parametrize("kind", ["integers", "reals", "scaled", "indefinite"])
@pytest.mark.parametrize("n", [2, 3, 6])
def test_dense(device, n, kind):
    """A last pivot of 0 is no factor, either: what is solved with it would be infinite."""
    a = matrices(n, kind).astype(np.float32)
    found = []
    for one in a:
        out = wp.zeros(n * n, dtype=float, device=device)
        given = wp.array(one.ravel(), dtype=float, device=device)
        wp.launch(factor_dense, 1, inputs=[n, given, out], device=device)
        found.append(out.numpy().reshape(n, n))
    check(np.stack(found), a, ROUNDOFF[wp.float32])


@pytest.mark.parametrize("a", [[[1, 1], [1, 1]], [[4, 2], [2, 1]], [[0, 0], [0, 1]]])
def test_debug_mode_reports_a_pivot_that_is_not_positive(device, a):
    @wp.kernel(module="unique", module_options={"mode": "debug"})
    def factor(a: wp.array2d(dtype=float), out: wp.array2d(dtype=float)):
        wp.tile_store(out, wp.tile_cholesky(wp.tile_load(a, shape=(2, 2))))

    given = wp.array(np.float32(a), dtype=float, device=device)
    with pytest.raises(RuntimeError, match="matrix that is not positive definite"):
        wp.launch_tiled(factor, [1], [given, wp.zeros_like(given)], block_dim=32, device=device)
        wp.synchronize_device(device)
