"""Products of tiles in a loop over the depth, against NumPy."""

import numpy as np

import warp as wp


def rounded(values, dtype):
    """The nearest values that a type of at most 32 bits has, as float32."""
    if dtype is wp.float32:
        return values.astype(np.float32)
    if dtype is wp.float16:
        return values.astype(np.float16).astype(np.float32)
    bits = values.astype(np.float32).view(np.uint32)
    return ((bits + 0x7FFF + (bits >> 16 & 1)) & 0xFFFF0000).view(np.float32)


def product(dtype, m, n, k, a_turned=False, b_turned=False, first=0.0, halves=False):
    """A tile of the result per block; the number of steps is known at the launch only."""

    @wp.kernel(module="unique")
    def work(
        a: wp.array2d(dtype=dtype),
        b: wp.array2d(dtype=dtype),
        c: wp.array2d(dtype=float),
        steps: int,
    ):
        i, j = wp.tid()
        sums = wp.tile_full(shape=(m, n), value=float(wp.static(first)), dtype=float)
        for s in range(steps):
            if wp.static(a_turned):
                x = wp.tile_transpose(wp.tile_load(a, shape=(k, m), offset=(s * k, i * m)))
            else:
                x = wp.tile_load(a, shape=(m, k), offset=(i * m, s * k))
            if wp.static(b_turned):
                y = wp.tile_transpose(wp.tile_load(b, shape=(n, k), offset=(j * n, s * k)))
            else:
                y = wp.tile_load(b, shape=(k, n), offset=(s * k, j * n))
            wp.tile_matmul(x, y, sums)
        if wp.static(halves):
            sums = sums * 0.5
        wp.tile_store(c, sums, offset=(i * m, j * n))

    return work


def check(
    kernel,
    dtype,
    tile,
    shape,
    threads,
    device,
    turned=(False, False),
    start=0,
    first=0.0,
    scale=1.0,
    steps=None,
):
    """Launches what `product` made; every element has to be within a bound of float32 sums."""
    m, n, k = shape
    rng = np.random.default_rng(sum(shape))
    values = [rounded(rng.normal(size=s), dtype) for s in ((m, k), (k, n))]
    steps = -(-k // tile[2]) if steps is None else steps
    used = [values[0][:, : steps * tile[2]], values[1][: steps * tile[2]]]
    expected = (used[0].astype(float) @ used[1].astype(float) + first) * scale
    bound = np.abs(used[0]).astype(float) @ np.abs(used[1]).astype(float) + abs(first)
    given = [v.T.copy() if t else v for v, t in zip(values, turned, strict=True)]
    if start:  # Rows that do not begin at multiples of 16 bytes.
        given = [np.pad(v, ((0, 0), (start, 0))) for v in given]
    arrays = [wp.array(v, dtype=dtype, device=device)[:, start:] for v in given]
    c = wp.full((m, n), np.nan, dtype=float, device=device)
    grid = (-(-m // tile[0]), -(-n // tile[1]))
    inputs = [*arrays, c, steps]
    wp.launch_tiled(kernel, dim=grid, inputs=inputs, block_dim=threads, device=device)
    assert np.all(np.abs(c.numpy() - expected) <= (k + 8) * 2.0**-24 * bound)
