"""Products with matrices whose rows are long and uneven, which GPU threads share."""

import numpy as np
import pytest

import warp as wp
import warp.sparse as sp
from warp._src.sparse import vector_product


def matrix_of(lengths, block, dtype, device):
    """A matrix with so many blocks in each row, some of them anywhere twice; and its parts."""
    rng = np.random.default_rng(len(lengths))
    count = len(lengths)
    rows = np.repeat(np.arange(count), lengths)
    columns = rng.integers(0, count, rows.size)
    shape = (rows.size, *block) if block != (1, 1) else rows.size
    numbers = rng.standard_normal(shape).astype(dtype.__name__)
    parts = [wp.array(a, dtype=int, device=device) for a in (rows, columns)]
    data = wp.array(numbers, dtype=dtype, device=device)
    matrix = sp.bsr_from_triplets(count, count, *parts, data)
    return matrix, rows, columns, numbers.reshape(rows.size, *block).astype(np.float64)


def reference(parts, x):
    """The product in float64, and the sum of magnitudes, which rounding is measured by."""
    rows, columns, numbers = parts
    result = np.zeros((2, len(x), numbers.shape[1]))
    x = x.astype(np.float64)
    np.add.at(result[0], rows, np.einsum("nij,nj->ni", numbers, x[columns]))
    np.add.at(result[1], rows, np.einsum("nij,nj->ni", abs(numbers), abs(x[columns])))
    return result


def uneven(seed):
    """Rows of about 40 blocks, of none, and a few that a whole block of threads has to work on."""
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.integers(0, 90, 70), [2000, 0, 0, 1100, 257, 1], np.zeros(9, int)])


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("block", [(1, 1), (3, 3)])
def test_rows_of_any_length(device, block, dtype):
    matrix, *parts = matrix_of(uneven(1), block, dtype, device)
    rng = np.random.default_rng(2)
    x, y = (rng.standard_normal((85, block[0])).astype(dtype.__name__) for _ in range(2))
    X, Y = (wp.array(a, dtype=dtype, device=device) for a in (x, y))
    sp.bsr_mv(matrix, X, Y, alpha=0.5, beta=2.0)
    product, scale = reference(parts, x)
    error = abs(Y.numpy() - (0.5 * product + 2.0 * y)) / (scale + abs(y))
    assert error.max() < 8 * np.finfo(dtype.__name__).eps


@pytest.mark.parametrize("sharers", [8, 16, 32])
def test_shared_rows(device, sharers, monkeypatch):
    """The kernel of GPUs, with the threads of CPU blocks."""
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    matrix, *parts = matrix_of(uneven(3), (1, 1), wp.float64, device)
    x = np.random.default_rng(4).standard_normal((85, 1))
    # Unwanted entries need not be numbers.
    y = wp.full((85, 1), np.nan, dtype=wp.float64, device=device)
    kernel = vector_product._shared_row_kernel(wp.float64, 1, 1, sharers)
    numbers = (matrix.offsets, matrix._row_ends(), matrix.columns, matrix.scalar_values)
    inputs = [2.0, *numbers, wp.array(x, device=device), 0.0, y]
    blocks = -(-85 * sharers // 256)
    wp.launch_tiled(kernel, [blocks], inputs, block_dim=256, device=device)
    product, scale = reference(parts, x)
    assert (abs(y.numpy() - 2.0 * product) / (2.0 * scale + 1e-300)).max() < 1e-14


def test_a_tape_has_the_gradient(device):
    matrix, rows, columns, numbers = matrix_of(uneven(5), (1, 1), wp.float64, device)
    x = wp.ones(85, dtype=wp.float64, device=device, requires_grad=True)
    with wp.Tape() as tape:
        y = sp.bsr_mv(matrix, x)
    seed = np.random.default_rng(6).standard_normal(85)
    tape.backward(grads={y: wp.array(seed, device=device)})
    expected = np.zeros(85)
    np.add.at(expected, columns, numbers.ravel() * seed[rows])
    np.testing.assert_allclose(x.grad.numpy(), expected, rtol=1e-10, atol=1e-10)


LENGTHS = {
    "power law": lambda rng: np.minimum(rng.pareto(1.2, 3000) * 8 + 1, 9000).astype(int),
    "rows of 64": lambda rng: np.full(500, 64),
    "one row": lambda rng: np.array([50_000]),
    "among empty rows": lambda rng: np.r_[np.zeros(9000, int), 300_000, np.zeros(9000, int), 5],
    "rows that end with tiles": lambda rng: np.array([1791, 1791, 3583, 1791, 7, 1783]),
    "short rows": lambda rng: rng.integers(8, 12, 5000),
}


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("kind", LENGTHS)
def test_blocks_share_what_rows_have(device, kind, dtype):
    """Whatever the lengths of rows: within rounding of float64, and in a graph the same bits."""
    rng = np.random.default_rng(7)
    lengths = LENGTHS[kind](rng)
    count, width = len(lengths), 1000
    offsets = np.r_[0, np.cumsum(lengths)]
    columns = rng.integers(0, width, offsets[-1])
    values, x = (rng.standard_normal(n).astype(dtype.__name__) for n in (offsets[-1], width))
    matrix = sp.bsr_zeros(count, width, dtype, device=device)
    matrix.offsets = wp.array(offsets, dtype=int, device=device)
    matrix.columns = wp.array(columns, dtype=int, device=device)
    matrix.values = wp.array(values, device=device)
    matrix.nnz = int(offsets[-1])
    X = wp.array(x, device=device)
    y = wp.full(count, np.nan, dtype=dtype, device=device)
    sp.bsr_mv(matrix, X, y, alpha=-2.0, beta=0.0)

    products = values.astype(float) * x[columns]
    rows = np.repeat(np.arange(count), lengths)
    expected, scale = (np.bincount(rows, p, count) for p in (products, abs(products)))
    first = y.numpy()
    error = abs(first + 2.0 * expected) / np.maximum(2.0 * scale, 1e-300)
    terms = np.sqrt(lengths.max()) + 8
    assert error.max() < terms * np.finfo(dtype.__name__).eps

    with wp.ScopedCapture(device=device) as capture:
        sp.bsr_mv(matrix, X, y, alpha=-2.0, beta=0.0)
    y.fill_(np.nan)
    wp.capture_launch(capture.graph)
    np.testing.assert_array_equal(y.numpy(), first)
