"""Updates of one element by the threads of a warp, against sums of integers, which are exact."""

import numpy as np
import pytest

import warp as wp


@pytest.mark.parametrize("threads, block", [(1, 256), (31, 256), (64, 32), (1000, 256), (333, 96)])
def test_parameters(device, threads, block):
    @wp.kernel(module="unique")
    def fit(x: wp.array(dtype=float), few: wp.array(dtype=wp.vec2), many: wp.array(dtype=float)):
        i = wp.tid()
        for k in range(5):
            wp.atomic_sub(few, k, wp.vec2(x[i], float(k)))
        # No sum over tiles: each iteration needs the one before.
        state = int(i)
        for k in range(many.shape[0]):
            state = (state * 5 + 3) % 16
            wp.atomic_add(many, k, float(state))

    x = np.random.default_rng(threads).integers(-9, 9, threads).astype(np.float32)
    few = wp.zeros(5, dtype=wp.vec2, device=device)
    many = wp.zeros(70, dtype=float, device=device)
    wp.launch(fit, threads, [wp.array(x, device=device), few, many], device=device, block_dim=block)
    wanted = np.stack([np.full(5, -x.sum()), -threads * np.arange(5.0)], 1)
    np.testing.assert_array_equal(few.numpy(), wanted)
    state, sums = np.arange(threads), []
    for _ in range(70):
        state = (state * 5 + 3) % 16
        sums.append(state.sum())
    np.testing.assert_array_equal(many.numpy(), sums)


@pytest.mark.parametrize("shape", [(1, 1), (3, 200), (70, 64), (64, 5), (33, 31)])
@pytest.mark.parametrize("block", [32, 256])
def test_rows_and_columns(device, shape, block):
    """Warps lie in one row of the launch, or in several."""

    @wp.kernel(module="unique")
    def margins(
        a: wp.array2d(dtype=wp.int64),
        rows: wp.array(dtype=wp.int64),
        columns: wp.array(dtype=wp.int64),
        most: wp.array(dtype=wp.int64),
    ):
        i, j = wp.tid()
        wp.atomic_add(rows, i, a[i, j])
        wp.atomic_add(columns, j, a[i, j])
        if a[i, j] > wp.int64(0):
            wp.atomic_max(most, i, a[i, j])

    values = np.random.default_rng(2).integers(-(2**40), 2**40, shape)
    a = wp.array(values, dtype=wp.int64, device=device)
    out = [wp.zeros(n, dtype=wp.int64, device=device) for n in (*shape, shape[0])]
    wp.launch(margins, shape, [a, *out], device=device, block_dim=block)
    np.testing.assert_array_equal(out[0].numpy(), values.sum(1))
    np.testing.assert_array_equal(out[1].numpy(), values.sum(0))
    np.testing.assert_array_equal(out[2].numpy(), values.max(1).clip(0))


@pytest.mark.parametrize("shape", [(40, 70, 33), (64, 64, 64)])
def test_adjoint_of_a_matrix_product(device, shape):
    """All threads of a row add to the gradients of a row of the first factor."""

    @wp.kernel(module="unique")
    def multiply(
        a: wp.array2d(dtype=wp.float64),
        b: wp.array2d(dtype=wp.float64),
        c: wp.array2d(dtype=wp.float64),
    ):
        i, j = wp.tid()
        sum = wp.float64(0.0)
        for k in range(a.shape[1]):
            sum += a[i, k] * b[k, j]
        c[i, j] = sum

    n, m, width = shape
    rng = np.random.default_rng(7)
    values = [rng.normal(size=size) for size in ((n, width), (width, m), (n, m))]
    a, b, c = (wp.array(v, dtype=wp.float64, device=device, requires_grad=True) for v in values)
    with wp.Tape() as tape:
        wp.launch(multiply, (n, m), [a, b, c], device=device)
    tape.backward(grads={c: wp.array(values[2], dtype=wp.float64, device=device)})
    np.testing.assert_allclose(a.grad.numpy(), values[2] @ values[1].T, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(b.grad.numpy(), values[0].T @ values[2], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64, wp.int32])
@pytest.mark.parametrize("shape", [(2,), (3,), (5,), (2, 3), (4, 4), (6, 6), (8, 8)])
def test_elements_with_components(device, shape, dtype):
    """Lanes of a warp share the components: fewer than there are lanes, as many, and more."""
    kind = wp.types.vector(*shape, dtype) if len(shape) == 1 else wp.types.matrix(shape, dtype)
    count = int(np.prod(shape))

    @wp.kernel(module="unique")
    def fit(x: wp.array(dtype=kind), total: wp.array(dtype=kind), high: wp.array(dtype=kind)):
        i = wp.tid()
        state = int(0)
        for k in range(total.shape[0]):
            # No sum over tiles: each iteration needs the one before.
            state = (state * 5 + 3) % 16
            wp.atomic_sub(total, k, x[i] * dtype(state))
            wp.atomic_max(high, k, x[i] * dtype(state))

    x = np.random.default_rng(count).integers(-99, 100, (333, *shape))
    total = wp.zeros(40, dtype=kind, device=device)
    high = wp.full(40, -50, dtype=kind, device=device)
    wp.launch(fit, 333, [wp.array(x, dtype=kind, device=device), total, high], device=device)
    state = 0
    for k in range(40):
        state = (state * 5 + 3) % 16
        np.testing.assert_array_equal(total.numpy()[k], -x.sum(0) * state)
        np.testing.assert_array_equal(high.numpy()[k], np.maximum((x * state).max(0), -50))
